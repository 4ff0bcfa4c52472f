"""Two gears in mesh: working pressure angle, path of contact, contact ratio, backlash and
interference.

A position on the path of contact is the radius of curvature of the pinion's flank in m, which is 0
where the line of action touches the base circle of the pinion. The pinion drives. Contact begins at
``path[0]``, at the tip of the wheel, and ends at ``path[1]``, at the tip of the pinion.

The mesh phase is 0 in the middle of the segment with the larger number of tooth pairs in contact,
as in `gearlib.engines.pair.stiffness`; a transverse base pitch corresponds to 2 pi.
"""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Annotated, Any

from annotated_types import Le

from gearlib import checks, parameters
from gearlib.engines.pair.stiffness import mean_over_max
from gearlib.models.geometry.gear import SpurGear, TipRelief, inv, inverse_involute
from gearlib.models.geometry.iso import MIN_ROOT_RATIO, iso_rectangle
from gearlib.parameters import (
    BelowCritical,
    Damping,
    Diameter,
    DrivingTorque,
    NonNegative,
    Phases,
    Power,
    RunOut,
    Speed,
    Torque,
    Unit,
    check,
    checked,
    declared,
    described,
)

if TYPE_CHECKING:
    from gearlib.models.geometry.mesh_stiffness import MeshStiffness

#: A smaller absolute backlash, in modules, is attributed to rounded input and treated as 0.
_MAX_ROUNDED_BACKLASH = 1e-3
#: Largest depth of contact below the start of the involute, in modules. The deviation of the fillet
#: from the involute is only 0.002 modules there, and rings of published planetary sets reach 0.03.
_MAX_FILLET_CONTACT = 0.05
#: Models of a mesh in a gear train, see `gearlib.Mesh.from_geometry`.
TRAIN_MODELS = "teeth", "rectangle"
#: Options of the energy method that apply to single tooth pairs.
PAIR_OPTIONS = "coupling", "twist"
#: Largest static deflection, in modules; hardened teeth break at about 0.02, plastic at 0.1.
MAX_DEFLECTION = 0.1


@declared(kw_only=False)
class GearStage:
    """A pinion and a wheel in mesh; immutable, in SI units.

    Two helical gears of an external mesh have helices of opposite hand. The helix angle of the
    wheel is the angle of the pinion with the opposite sign; the same number means the same gears,
    and its sign is the hand of the pinion. The gears of an internal mesh have the same hand and
    sign.

    Raises
    ------
    ValueError
        If the gears do not fit together; the message names parameter, value and range.
    """

    pinion: Annotated[SpurGear, described("The driving gear, external")]
    wheel: Annotated[SpurGear, described("Of an internal mesh the ring gear")]
    centre_distance: Annotated[
        Diameter | None,
        described("a; by default that at which the nominal teeth touch on both flanks"),
    ] = None
    backlash: Annotated[
        RunOut | None,
        described(
            "Normal backlash j_bn; by default it follows from shifts, centre distance and tooth "
            "thickness allowances, or where they leave none, it is `recommended_backlash`"
        ),
    ] = None

    def __post_init__(self) -> None:
        """Check that both gears fit together; set the default centre distance and backlash.

        At the default centre distance, the nominal teeth have no backlash.
        """
        self._check_gears()
        base_diameter_sum = self._signed_sum(self.pinion.base_diameter, self.wheel.base_diameter)
        min_distance = abs(base_diameter_sum) / 2.0
        if self.centre_distance is None:
            distance = min_distance / math.cos(self._zero_backlash_angle())
            object.__setattr__(self, "centre_distance", distance)
        reason = "where the base circles would have no line of action"
        allowed = f"finite and > {min_distance:.6g} m, {reason}"
        distance = self.centre_distance
        checks.require(min_distance < distance < math.inf, "centre_distance", distance, allowed)
        self._check_interference()
        self._check_contact_ratio()
        self._check_relief_lengths()
        self._set_backlash()

    def _check_relief_lengths(self) -> None:
        """Raise an `InputError` if a tip relief is longer than `longest_relief`.

        Up to that length, a single tooth pair in contact has no relief.
        """
        reason = "half of the path of contact"
        if self.contact_ratio >= 1.0:
            reason = "(eps_alpha - 1) p_bt, or single contact has no involute"
        allowed = f"<= {self.longest_relief:.6g} m, {reason}"
        # The tolerance allows for rounding errors.
        max_length = self.longest_relief * (1.0 + 1e-9)
        for name, gear in (("pinion", self.pinion), ("wheel", self.wheel)):
            if gear.tip_relief is not None:
                length = gear.tip_relief.length
                checks.require(length <= max_length, f"{name}.tip_relief.length", length, allowed)

    def _signed_sum(self, pinion_value: float, wheel_value: float) -> float:
        """Return pinion_value + wheel_value, or their difference if the wheel is a ring gear."""
        return pinion_value + self.wheel.sign * wheel_value

    def _check_gears(self) -> None:
        """Raise an `InputError` unless both gears have the same module and angles.

        The helix angles of an external mesh may also have opposite signs. The pinion must be
        external, and a ring gear must have more teeth than the pinion.
        """
        pinion, wheel = self.pinion, self.wheel
        allowed = "False; the ring gear is the wheel"
        checks.require(not pinion.internal, "pinion.internal", True, allowed)
        for name in ("module", "pressure_angle", "helix_angle"):
            pinion_value, wheel_value = getattr(pinion, name), getattr(wheel, name)
            allowed_values = [pinion_value]
            allowed = f"the value of the pinion, {pinion_value!r}"
            if name == "helix_angle" and pinion_value and not wheel.internal:
                allowed_values.append(-pinion_value)
                allowed += f", or {-pinion_value!r}, of the opposite hand"
            tolerances = {"rel_tol": 1e-9, "abs_tol": 1e-12}
            valid = any(math.isclose(wheel_value, value, **tolerances) for value in allowed_values)
            checks.require(valid, f"wheel.{name}", wheel_value, allowed)
        if wheel.internal:
            allowed = f"an integer >= {pinion.teeth + 1}"
            checks.require(wheel.teeth > pinion.teeth, "wheel.teeth", wheel.teeth, allowed)

    def _check_contact_ratio(self) -> None:
        """Raise an `InputError` unless at least one tooth pair is always in contact.

        Spur gears need a transverse contact ratio >= 1. Helical gears need only a total contact
        ratio > 1, because their contact moves across the face width.
        """
        if self.contact_ratio >= 1.0:
            return
        advice = "larger tip diameters or a smaller centre distance raise it"
        if self.overlap_ratio and self.contact_ratio > 0.0:
            ratio = self.total_contact_ratio
            allowed = f"> 1; {advice}, as does a larger width or helix angle"
            checks.require(ratio > 1.0, "total_contact_ratio", float(f"{ratio:.4f}"), allowed)
        else:
            minimum = "> 0" if self.overlap_ratio else ">= 1"
            ratio = float(f"{self.contact_ratio:.4f}")
            raise checks.InputError("contact_ratio", ratio, f"{minimum}; {advice}")

    def _zero_backlash_angle(self) -> float:
        """Return the working pressure angle alpha_wt for zero backlash, rad.

        inv(alpha_wt) = inv(alpha_t) + 2 tan(alpha_n) (x_1 + x_2) / (z_1 + z_2), ISO 21771, with the
        involute function inv, the profile shifts x and the tooth numbers z, which are negative for
        ring gears.
        """
        tooth_sum = self._signed_sum(self.pinion.teeth, self.wheel.teeth)
        shift_sum = self.pinion.shift + self.wheel.shift
        involute = inv(self.pinion.transverse_pressure_angle)
        involute += 2.0 * math.tan(self.pinion.pressure_angle) * shift_sum / tooth_sum
        allowed = "such that the gears have a centre distance without backlash"
        checks.require(involute > 0.0, "wheel.shift", self.wheel.shift, allowed)
        return inverse_involute(involute)

    def _check_interference(self) -> None:
        """Raise an `InputError` if a tip interferes with the fillet, root or tip of the other gear.

        Interference of tips is possible in internal meshes only.
        """
        pinion, wheel, (start, end) = self.pinion, self.wheel, self.path
        # Gear whose tip is in contact at the start or end of the path, its name, its mate, and the
        # radius of curvature of the mate's flank there.
        end_contacts = (
            (wheel, "wheel", pinion, start),
            (pinion, "pinion", wheel, self.wheel_roll_length(end)),
        )
        for gear, name, mate, roll_length in end_contacts:
            base_radius, form_roll_length = mate.base_diameter / 2.0, mate.form_roll_length
            form_radius = math.hypot(form_roll_length, base_radius)
            # Depth of contact below the start of the mate's involute.
            depth = mate.sign * (form_radius - math.hypot(roll_length, base_radius))
            checks.require(
                roll_length >= 0.0 and depth <= _MAX_FILLET_CONTACT * mate.module,
                f"{name}.tip_diameter",
                gear.tip_diameter,
                "such that it keeps out of the fillet of the mating tooth, whose involute begins "
                f"{form_roll_length:.4g} m along the line of action; contact would reach "
                f"{roll_length:.4g} m (interference)",
            )
        for gear, mate, name in ((pinion, wheel, "pinion"), (wheel, pinion, "wheel")):
            clearance = self._clearance(gear, mate)
            allowed = (
                f"such that tip and root keep clear of each other (clearance {clearance:.4g} m)"
            )
            field = f"{name}.tip_diameter"
            checks.require(clearance >= 0.0, field, gear.tip_diameter, allowed)
        if wheel.internal:
            checks.require(
                self._has_tip_clearance(),
                "wheel.teeth",
                wheel.teeth,
                f"larger by more than {wheel.teeth - pinion.teeth} than pinion.teeth, or the "
                "tips strike each other (tip interference)",
            )

    def _clearance(self, gear: SpurGear, mate: SpurGear) -> float:
        """Return the bottom clearance between the tip of a gear and the root of its mate, m."""
        if not self.wheel.internal:
            return self.centre_distance - (gear.tip_diameter + mate.root_diameter) / 2.0
        if gear.internal:
            ring_diameter, pinion_diameter = gear.tip_diameter, mate.root_diameter
        else:
            ring_diameter, pinion_diameter = mate.root_diameter, gear.tip_diameter
        return (ring_diameter - pinion_diameter) / 2.0 - self.centre_distance

    @property
    def clearances(self) -> tuple[float, float]:
        """Bottom clearances c at the tips of (pinion, wheel), m."""
        pinion, wheel = self.pinion, self.wheel
        return self._clearance(pinion, wheel), self._clearance(wheel, pinion)

    def _has_tip_clearance(self) -> bool:
        """Return whether an internal mesh is free of tip interference.

        Tips could collide where the tip circles intersect. All angles are measured from the line of
        centres around the axis of each gear.
        """
        a, angle = self.centre_distance, self.working_pressure_angle
        pinion_radius = self.pinion.tip_diameter / 2.0
        ring_radius = self.wheel.tip_diameter / 2.0
        cosine = (ring_radius**2 - pinion_radius**2 - a**2) / (2.0 * a * pinion_radius)
        if abs(cosine) >= 1.0:
            return True  # The tip circles do not intersect.
        # Angle of the intersection, as seen from the axis of the ring gear.
        intersection_angle = math.acos(
            (a**2 + ring_radius**2 - pinion_radius**2) / (2.0 * a * ring_radius)
        )
        gears = self.pinion, self.wheel
        tip_angles = [math.acos(gear.base_diameter / gear.tip_diameter) for gear in gears]
        # Rotation of the pinion from contact at the pitch point until its tip reaches the
        # intersection of the tip circles.
        pinion_rotation = math.acos(cosine) + inv(tip_angles[0]) - inv(angle)
        ring_rotation = pinion_rotation * (self.pinion.teeth / self.wheel.teeth)
        return ring_rotation + inv(angle) - inv(tip_angles[1]) >= intersection_angle

    def _set_backlash(self) -> None:
        """Check the given backlash, or compute it from the geometry of the gears.

        If it is zero up to rounding errors, the backlash recommended by ISO/TR 10064-2 is used,
        unless a tooth thickness allowance is given.
        """
        if self.backlash is not None:
            allowed = f"at most the base pitch, {self.base_pitch:.4g} m"
            # The message suggests um (for values >= 1) or mm if the value would be valid then.
            example = "80 um" if self.backlash >= 1.0 else "0.08 mm"
            backlash_type = Annotated[float, Le(self.base_pitch), Unit("m", example)]
            allowed += parameters.unit_hint(self.backlash, backlash_type)
            checks.require(self.backlash <= self.base_pitch, "backlash", self.backlash, allowed)
            return
        # The backlash is the pitch minus both tooth thicknesses on the working pitch circles; it is
        # then projected on the normal.
        cosine, module = math.cos(self.working_pressure_angle), self.pinion.module
        gears = (self.pinion, self.wheel)
        thicknesses = sum(gear.thickness_at(gear.base_diameter / cosine) for gear in gears)
        backlash = math.pi * self.pinion.base_diameter / cosine / self.pinion.teeth - thicknesses
        backlash = backlash * cosine * math.cos(self.pinion.base_helix_angle)
        if abs(backlash) <= _MAX_ROUNDED_BACKLASH * module:
            if any(gear.thickness_allowance for gear in gears):
                backlash = max(backlash, 0.0)
            else:
                backlash = self.recommended_backlash
        reason = (
            "shifts, allowances of the tooth thickness and centre_distance leave too little room"
        )
        allowed = f">= 0; {reason}"
        checks.require(backlash >= 0.0, "backlash", backlash, allowed)
        object.__setattr__(self, "backlash", backlash)

    @property
    def width(self) -> float:
        """Common face width, the smaller of both widths, m."""
        return min(self.pinion.width, self.wheel.width)

    @property
    def working_pressure_angle(self) -> float:
        """Working pressure angle alpha_wt = arccos((r_b1 +- r_b2) / a), rad; ISO 21771."""
        base_diameter_sum = self._signed_sum(self.pinion.base_diameter, self.wheel.base_diameter)
        return math.acos(abs(base_diameter_sum) / 2.0 / self.centre_distance)

    @property
    def base_pitch(self) -> float:
        """Transverse base pitch p_bt = pi m_t cos(alpha_t), m."""
        return math.pi * self.pinion.base_diameter / self.pinion.teeth

    @property
    def _tangent_length(self) -> float:
        """Length a sin(alpha_wt) of the line of action between both base circles, m."""
        return self.centre_distance * math.sin(self.working_pressure_angle)

    def wheel_roll_length(self, position: float) -> float:
        """Return the radius of curvature of the wheel's flank at a position on the path, m."""
        return self._tangent_length - self.wheel.sign * position

    @property
    def path(self) -> tuple[float, float]:
        """Positions of the start and the end of the path of contact, m; ISO 21771."""
        start = self.wheel.sign * (self._tangent_length - self.wheel.tip_roll_length)
        return start, self.pinion.tip_roll_length

    @property
    def pitch_point(self) -> float:
        """Position of the pitch point on the path of contact, r_b1 tan(alpha_wt), m."""
        return self.pinion.base_diameter / 2.0 * math.tan(self.working_pressure_angle)

    @property
    def contact_ratio(self) -> float:
        """Transverse contact ratio eps_alpha: path of contact over base pitch; ISO 21771."""
        start, end = self.path
        return (end - start) / self.base_pitch

    @property
    def longest_relief(self) -> float:
        """Length of the longest possible tip relief, m.

        It is (eps_alpha - 1) p_bt with the contact ratio eps_alpha and the base pitch p_bt, or half
        of the path of contact if eps_alpha is below 1.
        """
        ratio = self.contact_ratio
        return (ratio - 1.0 if ratio >= 1.0 else ratio / 2.0) * self.base_pitch

    @property
    def overlap_ratio(self) -> float:
        """Overlap ratio eps_beta = b sin|beta| / (pi m_n), 0 for spur gears; ISO 21771."""
        gear = self.pinion
        return self.width * math.sin(abs(gear.helix_angle)) / (math.pi * gear.module)

    @property
    def total_contact_ratio(self) -> float:
        """Total contact ratio eps_gamma = eps_alpha + eps_beta."""
        return self.contact_ratio + self.overlap_ratio

    def phase_of(self, position: float) -> float:
        """Return the mesh phase in [0, 2 pi) at which a tooth pair is in contact at a position.

        `position` in m is on the path of contact, for helical gears in the middle of the face. The
        phase is 0 in the middle of the segment with the most pairs in contact, whose length in base
        pitches is the fractional part of the contact ratio.
        """
        fraction = self.contact_ratio - math.floor(self.contact_ratio)
        pitches = (position - self.path[0]) / self.base_pitch
        return math.tau * ((pitches - fraction / 2.0) % 1.0)

    @property
    def pitch_phase(self) -> float:
        """Mesh phase at which a tooth pair is in contact at the pitch point, rad."""
        return self.phase_of(self.pitch_point)

    @property
    def pitch_errors(self) -> tuple[float, ...]:
        """Pitch errors of successive tooth pairs until the same teeth meet again, m.

        The pitch error of a pair is the sum of the errors of its two teeth. Without pitch errors of
        the gears, the result is (0,).
        """
        pinion_errors = self.pinion.pitch_errors or (0.0,)
        wheel_errors = self.wheel.pitch_errors or (0.0,)
        # Tooth i of the pinion meets tooth i of the wheel, modulo the numbers of errors.
        m, n = len(pinion_errors), len(wheel_errors)
        return tuple(pinion_errors[i % m] + wheel_errors[i % n] for i in range(math.lcm(m, n)))

    @property
    def tooth_stiffness(self) -> str:
        """Default method of the tooth stiffness: "energy", or "iso" (ISO 6336) for large bores.

        The energy method has data for the compliance of gear bodies only up to a limited bore.
        """
        for gear in (self.pinion, self.wheel):
            if gear.bore > gear.root_diameter / MIN_ROOT_RATIO:
                return "iso"
        return "energy"

    @property
    def line_backlash(self) -> float:
        """Backlash along the transverse line of action j_bt = j_bn / cos(beta_b), m."""
        return self.backlash / math.cos(self.pinion.base_helix_angle)

    @property
    def recommended_backlash(self) -> float:
        """Smallest normal backlash for steel in steel or iron housings, m; ISO/TR 10064-2.

        It is 2/3 (0.06 + 0.0005 a + 0.03 m_n), with the centre distance a and the normal module
        m_n, all in mm.
        """
        return 2.0 / 3.0 * (6e-5 + 0.0005 * self.centre_distance + 0.03 * self.pinion.module)

    @property
    def has_recommended_backlash(self) -> bool:
        """Whether the backlash equals `recommended_backlash`."""
        return self.backlash == self.recommended_backlash

    @property
    def reduced_mass(self) -> float:
        """Reduced mass along the line of action, 1 / (r_b1^2 / J_1 + r_b2^2 / J_2), kg."""
        gears = (self.pinion, self.wheel)
        return 1.0 / sum((gear.base_diameter / 2.0) ** 2 / gear.inertia for gear in gears)

    def load(self, torque: float) -> float:
        """Return the force along the transverse line of action in N for a pinion torque in N m."""
        return torque / (self.pinion.base_diameter / 2.0)

    def tangential_force(self, torque: float) -> float:
        """Return the force F_t at the reference circle in N for a pinion torque in N m."""
        return torque / (self.pinion.reference_diameter / 2.0)

    def pitch_line_velocity(self, rpm: float) -> float:
        """Return the velocity v at the reference circle in m/s for a pinion speed in rpm."""
        return math.pi * self.pinion.reference_diameter * rpm / 60.0

    def stiffness(self, method: Any = "iso", **options: Any) -> "MeshStiffness":
        """Compute the mesh stiffness as a `MeshStiffness`.

        `method` is "iso" for ISO 6336, "energy" for the energy method or a `Tabulated` stiffness.
        `options`, such as the torque in N m, are passed to `gearlib.geometry.mesh_stiffness`.
        """
        # This import loads NumPy, which the checks of the geometry do not need.
        from gearlib.models.geometry.mesh_stiffness import mesh_stiffness

        return mesh_stiffness(self, method, **options)

    def with_reliefs(self, pinion: TipRelief | None, wheel: TipRelief | None) -> "GearStage":
        """Return a copy of the stage with the given tip reliefs; None means no tip relief."""
        return replace(
            self,
            pinion=replace(self.pinion, tip_relief=pinion),
            wheel=replace(self.wheel, tip_relief=wheel),
        )

    @checked
    def transmission_error(
        self, torque: float | Sequence[float], *, phases: Phases = 256, **options: Any
    ) -> Any:
        """Return the static transmission error and the load sharing of the gears under load.

        The tip reliefs of the gears are taken into account; helical faces are divided into slices.
        The module ``gearlib.models.geometry.load_sharing`` describes the model.

        Parameters
        ----------
        torque : float or sequence of float
            Torque of the pinion, N m; finite, >= 0.
        phases : int, default 256
            Number of phases in each mesh period, >= 8.
        stiffness : {"energy", "iso"} or PathTable, default "energy"
            Stiffness of a tooth pair: the energy method with constant Hertz contact; c' of ISO
            6336-1, which is constant along the path; or a table in N/m.
        coupling : float, optional
            Fraction of the compliance of the gear bodies that all tooth pairs share, from 0 to 1;
            by default a fit to finite elements. It has no effect if the stiffness is a table.
        twist : bool, default True
            Whether gear bodies twist about their bores; only for "energy".
        deviation : PathTable, optional
            Additional gap over the path of contact, m.
        pitch_errors : sequence of float, optional
            Gaps of successive pairs of teeth, m, repeated periodically. By default the
            `pitch_errors` of the stage.

        Returns
        -------
        xarray.Dataset
            Over torque and phase, for as many mesh periods as there are pitch errors:
            transmission_error (m, approach of the teeth along the line of action),
            pairs_in_contact, mesh_stiffness (dF/dx), and load_share over tooth_pair, NaN without
            load. Over phase and tooth_pair: path_position, in the middle of the face, and the gap
            of spur gears; both are NaN where spur gears are out of mesh. Over torque:
            peak_to_peak_error, effective_contact_ratio, mesh_force.

        Raises
        ------
        ValueError
            If a value is not allowed; the message names parameter, value and range.
        """
        from gearlib.models.geometry.transmission_error import transmission_error

        return transmission_error(self, torque, phases, **options)

    def pair_parameters(
        self,
        *,
        torque: float | None = None,
        power: float | None = None,
        speed: float | None = None,
        **options: Any,
    ) -> dict[str, float | None]:
        """Return the parameters of a `GearPair` with these gears as a dict, in SI units.

        The load is given by the pinion torque in N m, or by the power in W at the speed in rpm.
        `options` are the arguments of `GearPair.from_geometry` for damping and stiffness, such as
        damping_ratio. Raise an `InputError` if the static deflection is too large or the speed is
        out of range.
        """
        load_argument = ("torque", torque, "N m") if power is None else ("power", power, "W")
        torque = resolve_torque(torque, power, speed)
        parameters = {
            **self._mesh_parameters(torque=torque, **options),
            "reduced_mass": self.reduced_mass,
            "load": self.load(torque),
            "teeth": self.pinion.teeth,
        }
        mean_stiffness = self._compute_mean_stiffness(torque, parameters, *load_argument)
        if speed is not None:
            frequency = math.sqrt(mean_stiffness / self.reduced_mass)
            checks.check_speed("speed", speed, frequency * 60.0 / (math.tau * self.pinion.teeth))
        return parameters

    def train_parameters(
        self,
        *,
        torque: float | None = None,
        load_argument: tuple | None = None,
        model: str = "teeth",
        stiffness: Any = None,
        options: dict | None = None,
        **dampings: Any,
    ) -> dict[str, Any]:
        """Return the parameters of a mesh in a gear train as a dict, in SI units.

        `gearlib.Mesh.from_geometry` describes the arguments; `torque` is the pinion torque in N m.
        `load_argument` is (name, value, unit) of the argument that error messages name if the load
        is not given by the torque.
        """
        is_teeth_model = checks.check_choice("model", model, TRAIN_MODELS) == "teeth"
        if torque is not None:
            allowed = "a finite number, not 0; negative on the coast side"
            torque = check("torque", torque, Torque)
            checks.require(torque != 0.0, "torque", torque, allowed)
        elif is_teeth_model:
            problem = (
                "is missing: it must be given in N m for the model 'teeth', whose transmission "
                "error depends on it; the model 'rectangle' needs none"
            )
            raise checks.InputError("torque", problem=problem)
        if is_teeth_model:
            # This import loads NumPy, which the checks of the geometry do not need.
            from gearlib.models.geometry.transmission_error import transmission_error_harmonics

            method = self.tooth_stiffness if stiffness is None else stiffness
            stiffness = checks.check_choice("stiffness", method, ("energy", "iso"))
        # The sign does not matter, because flanks of both sides have the same stiffness.
        magnitude = None if torque is None else abs(torque)
        parameters = self._mesh_parameters(
            torque=magnitude,
            stiffness="iso" if stiffness is None else stiffness,
            options=options,
            **dampings,
        )
        if torque is not None:
            load_argument = load_argument or ("torque", torque, "N m")
            mean_stiffness = self._compute_mean_stiffness(torque, parameters, *load_argument)
        if is_teeth_model:
            options = options or {}
            pair_options = {name: options[name] for name in PAIR_OPTIONS if name in options}
            load = self.load(magnitude)
            parameters |= {
                "max_stiffness": mean_stiffness,
                "stiffness_ratio": 1.0,
                "transmission_error": transmission_error_harmonics(
                    self, load, stiffness=stiffness, **pair_options
                ),
            }
        angle = self.working_pressure_angle
        thicknesses = []  # tooth thickness over pitch on the working pitch circles
        for gear in (self.pinion, self.wheel):
            diameter = gear.base_diameter / math.cos(angle)
            pitch = math.pi * diameter / gear.teeth
            thicknesses.append(gear.thickness_at(diameter) / pitch)
        return parameters | {
            "internal": self.wheel.internal,
            "pressure_angle": angle,
            "pitch_phase": self.pitch_phase,
            "tooth_thickness": tuple(thicknesses),
        }

    def _mesh_parameters(
        self,
        *,
        torque: float | None = None,
        damping_ratio: float | None = None,
        logarithmic_decrement: float | None = None,
        material_damping: float | None = None,
        backlash_damping_ratio: float = 0.0,
        stiffness: Any = "iso",
        options: dict | None = None,
    ) -> dict[str, float | None]:
        """Return the stiffness, backlash and damping of the mesh as a dict, in SI units.

        `torque` is the pinion torque in N m. At most one of `damping_ratio`,
        `logarithmic_decrement` and `material_damping` (N s/m) gives the damping in contact; if none
        is given, the material damping is None. `backlash_damping_ratio` is the damping ratio in
        free flight. `stiffness` is "iso", "energy" or a `Tabulated`; `options` are the options of
        this method, a dict or None.
        """
        options = checks.check_options(options)
        # Unlike `self.stiffness`, the stiffness of ISO 6336 does not load NumPy.
        if isinstance(stiffness, str) and stiffness == "iso":
            max_stiffness, kappa, epsilon = iso_rectangle(self, torque=torque, **options)
        else:
            # The equivalent rectangle over the mesh period.
            rectangle = self.stiffness(stiffness, torque=torque, **options).ratios()
            max_stiffness, kappa, epsilon = rectangle.values()
        mean_stiffness = max_stiffness * mean_over_max(epsilon, kappa)
        dampings = {
            "damping_ratio": damping_ratio,
            "logarithmic_decrement": logarithmic_decrement,
            "material_damping": material_damping,
        }
        given_dampings = {name: value for name, value in dampings.items() if value is not None}
        if len(given_dampings) > 1:
            name, *other_names = given_dampings
            problem = f"and {' and '.join(other_names)} are not allowed together"
            raise checks.InputError(name, problem=f"{problem}: it must be one of them")
        mass, damping = self.reduced_mass, None
        for name, value in given_dampings.items():
            damping = resolve_damping(name, value, mean_stiffness, mass)
        return {
            "max_stiffness": max_stiffness,
            "stiffness_ratio": kappa,
            "contact_ratio": epsilon,
            "backlash": self.line_backlash,
            "material_damping": damping,
            "backlash_damping": resolve_damping(
                "backlash_damping_ratio", backlash_damping_ratio, mean_stiffness, mass
            ),
        }

    def _compute_mean_stiffness(self, torque, parameters, name, value, unit) -> float:
        """Return the mean stiffness in N/m; raise an `InputError` if the deflection is too large.

        `torque` is the pinion torque in N m; `parameters` is a dict with the max_stiffness,
        stiffness_ratio and contact_ratio of the mesh. `name`, `value` and `unit` describe the
        argument that gives the load, such as the power in W, for the error message.
        """
        contact_ratio, stiffness_ratio = parameters["contact_ratio"], parameters["stiffness_ratio"]
        mean_ratio = mean_over_max(contact_ratio, stiffness_ratio)
        mean_stiffness = parameters["max_stiffness"] * mean_ratio
        deflection = abs(self.load(torque)) / mean_stiffness
        deflection_ratio = deflection / (MAX_DEFLECTION * self.pinion.module)
        max_value = abs(value) / (deflection_ratio or 1.0)
        allowed = (
            f"at most {max_value:.4g} {unit}, "
            f"at which the static deflection is {MAX_DEFLECTION:g} modules"
        )
        checks.require(deflection_ratio <= 1.0, name, value, allowed)
        return mean_stiffness


def six_degree_parameters(stage: GearStage) -> dict[str, Any]:
    """Return the parameters of a `SixDegreePair` that follow from a gear stage, in SI units.

    Base radii, moments of inertia, masses and tooth numbers are lists for (pinion, wheel). The
    pitch phase in rad is the mesh phase of contact at the pitch point.
    """
    gears = stage.pinion, stage.wheel
    return {
        "base_radii": [gear.base_diameter / 2.0 for gear in gears],
        "inertias": [gear.inertia for gear in gears],
        "masses": [gear.mass for gear in gears],
        "teeth": [gear.teeth for gear in gears],
        "pitch_phase": stage.pitch_phase,
    }


def resolve_damping(name: str, value: float, stiffness: float, mass: float) -> float:
    """Convert a damping parameter of an oscillator to its damping coefficient in N s/m.

    `name` is the kind of `value`: "material_damping" or "backlash_damping" for a coefficient in
    N s/m, "logarithmic_decrement", or any other name for a damping ratio. `stiffness` is in N/m and
    `mass` in kg. Raise an `InputError` unless the damping ratio is >= 0 and < 1.
    """
    critical_damping = damping_coefficient(1.0, stiffness, mass)
    if name in ("material_damping", "backlash_damping"):
        allowed = f"a finite number >= 0 and < {critical_damping:.4g} N s/m, a damping ratio of 1"
        value = check(name, value, Damping)
        checks.require(value < critical_damping, name, value, allowed)
        return value
    if name == "logarithmic_decrement":
        decrement = check(name, value, NonNegative)
        return damping_coefficient(decrement / math.hypot(math.tau, decrement), stiffness, mass)
    return check(name, value, BelowCritical) * critical_damping


def damping_coefficient(damping_ratio: float, stiffness: float, mass: float) -> float:
    """Return the damping coefficient 2 beta sqrt(C_s m) in N s/m for the damping ratio beta."""
    return 2.0 * damping_ratio * math.sqrt(stiffness * mass)


@checked
def resolve_torque(torque: DrivingTorque | None, power: Power | None, speed: Speed | None) -> float:
    """Return the pinion torque in N m, given directly or by power in W and speed in rpm.

    Raise an `InputError` unless either the torque is given, or the power together with the speed.
    """
    if torque is not None and power is not None:
        problem = "and power are not allowed together: it must be one of them"
        raise checks.InputError("torque", problem=problem)
    if torque is None and power is None:
        problem = "is missing: it must be given in N m, or power and speed"
        raise checks.InputError("torque", problem=problem)
    if power is not None and speed is None:
        problem = "is missing: it must be given in rpm, where power is given"
        raise checks.InputError("speed", problem=problem)
    if power is None:
        return float(torque)
    return power / (math.tau / 60.0 * speed)
