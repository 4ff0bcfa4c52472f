"""`read_gearbox`: stages, shafts, springs and load cases of a gearbox from a REXS file."""

import math
import textwrap
from collections.abc import Iterable, Iterator
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from gearlib import checks
from gearlib.checks import InputError
from gearlib.gearboxes import gears, parts, rexs
from gearlib.gearboxes.gears import Stage
from gearlib.gearboxes.loads import Loads, Rotors, compute_loads
from gearlib.gearboxes.rexs import Component, RexsModel
from gearlib.models.geometry.gear_stage import GearStage
from gearlib.models.trains.ready_made import STRUCTURAL_DAMPING

if TYPE_CHECKING:
    import xarray as xr

    from gearlib.models.trains.train import GearTrain

#: Tolerances for positions that the file states in two ways, m and rad.
_DISTANCE_TOLERANCE, _ANGLE_TOLERANCE = 1e-5, 1e-3
_GEAR_TYPES = ("cylindrical_gear", "ring_gear")
#: Maximum length of printed lines.
_LINE_WIDTH = 80
#: Name of the load case if the file has no load spectrum.
NOMINAL = "nominal"


def read_gearbox(path: Any) -> "Gearbox":
    """Read a gearbox from a REXS file: .rexs, .rexsj, .rexsz or .rexs.zip, versions 1.0 to 1.7.

    Parameters
    ----------
    path : str or path-like
        File to read.

    Returns
    -------
    Gearbox
        Its `stage`, `load` and `train` return models; printed, it is a table of the stages.

    Raises
    ------
    FileNotFoundError
        If there is no such file.
    ValueError
        If the file is damaged, of another version or without cylindrical stages.
    """
    model = rexs.read(path)
    try:
        return Gearbox(model)
    except InputError as error:
        raise ValueError(f"{path}: {error}") from None


class Gearbox:
    """A gearbox: stages, shafts, bearings, couplings and load cases of a REXS file.

    Parameters
    ----------
    model : gearlib.gearboxes.rexs.RexsModel
        Content of the file.

    Attributes
    ----------
    stages : dict of str to gearlib.gearboxes.gears.Stage
        Cylindrical stages by name.
    refused : dict of str to str
        Names of stages that cannot be computed, and the reasons.
    shafts : dict of str to gearlib.gearboxes.parts.Shaft
        Shafts by the id of their component.
    bearings, couplings : list of gearlib.gearboxes.parts.Spring
        Bearings, and couplings that are engaged.
    planetary_stages : list of str
        Names of the planetary stages.
    load_cases : dict of str to float
        Load cases and their fractions of the load duration, NaN if they are not stated; "nominal"
        alone if the file has no load spectrum.
    notes : list of str
        Contradictions in the file, and the values that are used.
    """

    def __init__(self, model: RexsModel):
        """Read all parts of the gearbox and compute its loads and the geometry of its stages."""
        self.model = model
        # Description of a default value -> names of the components with this value.
        self._defaults: dict[str, list[str]] = {}
        self.notes: list[str] = []
        self.refused: dict[str, str] = {}
        self.positions = parts.Positions(model)
        self.shafts = parts.read_shafts(model, self.positions, self.default)
        self.bearings = parts.read_springs(model, parts.BEARINGS, "radial_stiffness", "N/m")
        self.couplings = parts.read_springs(
            model, parts.COUPLINGS, "rotational_stiffness", "N m/rad"
        )
        self.planetary_stages = [part.name for part in model.components_of_type("planetary_stage")]
        self.load_cases = model.load_case_fractions() or {NOMINAL: math.nan}
        # Id of a gear -> component of its shaft.
        self.shaft_of = {
            gear.id: shaft
            for shaft in model.components_of_type("shaft")
            for gear in model.parts_of(shaft)
            if gear.type in _GEAR_TYPES
        }
        self.stages = self._read_stages()
        self._loads: dict[str, Loads] = {}
        self.loads()  # Raises an error if the gearbox is locked.
        for name in self.stages:
            # An invalid stage does not prevent the computation of the others.
            try:
                self.stage(name)
            except ValueError as error:
                self.refused[name] = str(error)

    @property
    def defaults(self) -> list[str]:
        """Default values of missing attributes, each with the names of the components."""
        return [f"{text}: {', '.join(names)}" for text, names in self._defaults.items()]

    def default(self, text: str, part: Component) -> None:
        """Record that a component gets a default value, because the file does not state one.

        `text` describes the value; `defaults` lists the names of all components that have it.
        """
        names = self._defaults.setdefault(text, [])
        if part.name not in names:
            names.append(part.name)

    def note(self, text: str) -> None:
        """Add a contradiction in the file, described by `text`, to the notes if it is new."""
        if text not in self.notes:
            self.notes.append(text)

    def _read_stages(self) -> dict[str, Stage]:
        """Return the cylindrical stages, i.e. pairs of gears in mesh, by name.

        Reasons why other stages cannot be computed are added to `refused`. Raise an `InputError` if
        there is no cylindrical stage.
        """
        carriers = {}  # id of a planet shaft -> id of its carrier
        for planetary in self.model.components_of_type("planetary_stage"):
            carrier_parts = [
                x for x in self.model.parts_of(planetary) if x.type == "planet_carrier"
            ]
            carrier_part = carrier_parts[0] if carrier_parts else planetary
            for roles in self.model.find_relations("planet_shaft", planetary_stage=planetary):
                carriers[roles["shaft"].id] = carrier_part.id
        stages = {}
        for part in self.model.components.values():
            if not part.type.endswith("_stage") or part.type == "planetary_stage":
                continue
            roles = next(self.model.find_relations("stage", stage=part), {})
            pair = [roles.get("gear_1"), roles.get("gear_2")]
            if part.type != "cylindrical_stage":
                allowed = "a cylindrical_stage, with spur or helical gears"
                self.refused[part.name] = f"{part} is not allowed: it must be {allowed}"
            elif None in pair or any(gear.id not in self.shaft_of for gear in pair):
                allowed = "a stage of two gears that lie on shafts"
                self.refused[part.name] = f"{part} is not allowed: it must be {allowed}"
            else:
                # The pinion is the gear with fewer teeth; a ring gear is always the wheel.
                pair.sort(key=lambda gear: (gear.type == "ring_gear", gears.tooth_count(gear)))
                pinion, wheel = pair
                carrier = carriers.get(self.shaft_of[pinion.id].id)
                if carrier is None:
                    carrier = carriers.get(self.shaft_of[wheel.id].id)
                stages[part.name] = Stage(part.name, part, pinion, wheel, carrier)
        if not stages:
            problem = "are missing: it must have a cylindrical_stage with two gears"
            if self.refused:
                problem = f"{problem}: {'; '.join(self.refused.values())}"
            raise InputError("stages", problem=problem)
        return stages

    @cached_property
    def rotors(self) -> Rotors:
        """The rotors of the gearbox, i.e. the sets of parts that turn together."""
        return Rotors(self)

    def loads(self, load_case: str | None = None) -> Loads:
        """Return all torques and speeds in a load case, by default in the first one.

        The result is cached. Contradictions in the file are added to the notes.
        """
        case = next(iter(self.load_cases)) if load_case is None else load_case
        checks.check_choice("load_case", case, list(self.load_cases))
        if case not in self._loads:
            self._loads[case] = compute_loads(self, None if case == NOMINAL else case)
            for text in self._loads[case].notes:
                self.note(text)
        return self._loads[case]

    def _get_stage(self, name: str) -> Stage:
        """Return the stage with the given name; raise an `InputError` if there is none."""
        return self.stages[checks.check_choice("stage", name, list(self.stages))]

    def load(self, stage: str, load_case: str | None = None) -> dict[str, float]:
        """Return the torque (N m) and the speed (rpm) of the pinion of a stage in a load case.

        The result is a dict with the keys "torque" and "speed", which are arguments of
        `gearlib.duty_point`. Both values are magnitudes. The speed is relative to the line of
        centres, which turns if one of the gears is a planet; the key is omitted if the file states
        too few speeds. The default load case is the first one.

        Raises
        ------
        ValueError
            If a torque is missing, or the stage or load case is unknown.
        """
        name, loads = self._get_stage(stage).name, self.loads(load_case)
        if loads.torque_error is not None:
            raise loads.torque_error
        load = {"torque": abs(loads.pinion_torques[name])}
        if loads.pinion_speeds is not None:
            load["speed"] = abs(loads.pinion_speeds[name])
        # Digits beyond the twelfth are rounding errors.
        return {quantity: float(f"{value:.12g}") for quantity, value in load.items()}

    def stage(self, name: str, load_case: str | None = None) -> GearStage:
        """Return the geometry of a stage with the flanks that carry the load in a load case.

        If the torque is unknown, a torque that is positive about the axis of each gear is assumed.
        The default load case is the first one.

        Raises
        ------
        ValueError
            If the geometry is incomplete or impossible; the message names component and attribute.
        """
        stage = self._get_stage(name)
        torque = self.loads(load_case).pinion_torques.get(name, 0.0)
        sides = [self._loaded_side(gear, torque) for gear in (stage.pinion, stage.wheel)]
        return gears.build_gear_stage(self, stage, sides, self.centre_distance(stage))

    def _loaded_side(self, gear: Component, torque: float) -> str:
        """Return the loaded flank of a gear, "left" or "right".

        `torque` in N m acts on the pinion of the stage, positive counterclockwise; if it is 0, a
        torque that is positive about the axis of the gear is assumed. As in ISO 21771, left and
        right are as seen towards the datum face, with the tooth upright. The loaded flanks of both
        gears have the same name.
        """
        datum_face = str(gear.get_value("datum_face_orientation") or "negative").lower()
        face_sign = 1 if datum_face.startswith("pos") or datum_face == "+" else -1
        # The direction is -1 if the axis of the gear is opposite to the common direction u.
        torque_on_face = torque * self.positions.direction(gear) * face_sign
        if torque_on_face < 0.0 or (torque_on_face == 0.0 and face_sign < 0):
            return "right"
        return "left"

    def shaft_diameters(self, gear: Component) -> tuple[float, float]:
        """Return the inner and outer diameter, in m, of the shaft at the middle of a gear.

        The diameters of a conical section vary linearly. Both are 0 if the shaft has no section
        there.
        """
        shaft = self.shafts[self.shaft_of[gear.id].id]
        middle = sum(self.face(gear)) / 2.0
        for section in shaft.sections:
            if section.start <= middle <= section.end:
                fraction = (middle - section.start) / (section.end - section.start)
                inner = section.inner[0] + (section.inner[1] - section.inner[0]) * fraction
                outer = section.outer[0] + (section.outer[1] - section.outer[0]) * fraction
                return inner, outer
        return 0.0, 0.0

    def face(self, gear: Component) -> tuple[float, float]:
        """Return the coordinates, in m along its shaft, of both faces of a gear.

        The file states the coordinate of the start of the gear in REXS 1.0, and of its middle in
        later versions.
        """
        width = gear.get_number("face_width", "m", "for the contact ratios and the stiffness")
        shaft, start = self.shaft_of[gear.id], gear.get_number("u_coordinate_on_shaft", "m")
        if start is None or self._has_position(gear, shaft):
            # In all versions, the position in space refers to the middle of the gear.
            middle = self.coordinate(gear, shaft)
        else:
            middle = start + (width / 2.0 if self.model.version == "1.0" else 0.0)
        return middle - width / 2.0, middle + width / 2.0

    def _has_position(self, part: Component, shaft: Component) -> bool:
        """Return whether the file states the positions of a component and of its shaft."""
        return self.positions.position(part) is not None and self.shafts[shaft.id].start is not None

    def coordinate(self, part: Component, shaft: Component) -> float:
        """Compute the coordinate of a component along a shaft, in m, from its position.

        A coupling without a position is assumed to be at the first other gear of the shaft. Raise
        an `InputError` if any other component has no position.
        """
        gears_on_shaft = [gear for gear in self.model.parts_of(shaft) if gear.type in _GEAR_TYPES]
        other_gears = [gear for gear in gears_on_shaft if gear.id != part.id]
        if not self._has_position(part, shaft) and part.type in parts.COUPLINGS and other_gears:
            self.default(f"lies at {other_gears[0].name}", part)
            return sum(self.face(other_gears[0])) / 2.0
        if not self._has_position(part, shaft):
            problem = f"is missing: it must be given for the place on {shaft}"
            raise InputError("u_coordinate_on_shaft", problem=problem, owner=str(part))
        axis = self.shafts[shaft.id]
        distance_along_u = float((self.positions.position(part) - axis.start)[0])
        return axis.direction * distance_along_u

    def line_of_centres(self, stage: Stage) -> np.ndarray | None:
        """Return the vector (v, w) in m from the axis of the pinion to the axis of the wheel.

        v and w are perpendicular to the shafts. A gear without a stated position has the position
        of its shaft. Return None if a position is unknown or if both axes coincide.
        """
        positions = []
        for gear in (stage.pinion, stage.wheel):
            position = self.positions.position(gear)
            if position is None:
                position = self.shafts[self.shaft_of[gear.id].id].start
            positions.append(position)
        if any(position is None for position in positions):
            return None
        vector = (positions[1] - positions[0])[1:]  # components v and w
        return vector if math.hypot(*vector) > _DISTANCE_TOLERANCE else None

    def centre_distance(self, stage: Stage) -> float:
        """Return the centre distance of a stage in m: the stated value, else from the positions.

        Raise an `InputError` if neither is known. A contradiction between both is added to the
        notes.
        """
        stated, vector = stage.part.get_number("center_distance", "m"), self.line_of_centres(stage)
        by_positions = None if vector is None else math.hypot(*vector)
        if stated is None and by_positions is None:
            problem = "is missing: it must be given, or support_vector of both gears"
            raise InputError("center_distance", problem=problem, owner=str(stage.part))
        if stated is None:
            return float(by_positions)
        if by_positions is not None and abs(by_positions - stated) > _DISTANCE_TOLERANCE:
            self.note(
                f"center_distance of {stage.part} is {1e3 * stated:.7g} mm, but by support_vector "
                f"{1e3 * by_positions:.7g} mm; the first is used"
            )
        return float(stated)

    def centre_line_angle(self, stage: Stage) -> float:
        """Return the angle in rad of the line from the pinion axis to the wheel axis.

        It is measured in the transverse plane from the direction v towards w, and computed from the
        positions of the gears. If these are unknown, it is the angle stated for the stage, or 0. A
        contradiction between both is added to the notes.
        """
        vector = self.line_of_centres(stage)
        stated = stage.part.get_number("rotating_angle_around_neg_u_axis", "rad")
        if stated is not None:
            # The stated angle is measured from w towards v. The line points from the first gear of
            # the stage, which may be the wheel, to the second one.
            stated = math.pi / 2.0 - stated
            first_gear = next(self.model.find_relations("stage", stage=stage.part))["gear_1"]
            stated += 0.0 if first_gear.id == stage.pinion.id else math.pi
        if vector is None:
            if stated is None:
                self.default("the wheel lies along v from the pinion", stage.part)
            return stated or 0.0
        angle = math.atan2(vector[1], vector[0])
        if stated is not None and abs(math.remainder(angle - stated, math.tau)) > _ANGLE_TOLERANCE:
            degrees = math.degrees(math.remainder(stated - angle, math.tau))
            self.note(
                f"rotating_angle_around_neg_u_axis of {stage.part} puts the wheel {degrees:.4g} "
                "degrees from its support_vector, which is used"
            )
        return angle

    def material(self, part: Component) -> tuple:
        """Return the material of a component and its shear modulus in Pa."""
        return parts.read_material(self.model, part, self.default)

    def planet(self, stage: Stage) -> Component:
        """Return the planet of a stage, i.e. the gear on a planet shaft."""
        planet_shafts = {roles["shaft"].id for roles in self.model.find_relations("planet_shaft")}
        pair = stage.pinion, stage.wheel
        return next(gear for gear in pair if self.shaft_of[gear.id].id in planet_shafts)

    def _stages_of_carrier(self, carrier: Component) -> list[Stage]:
        """Return the stages whose planets are on the given carrier."""
        return [stage for stage in self.stages.values() if stage.carrier == carrier.id]

    def pin_radius(self, carrier: Component) -> float:
        """Return the radius, in m, at which the pins of a carrier are located."""
        return self.centre_distance(self._stages_of_carrier(carrier)[0])

    def default_carrier(self, carrier: Component) -> tuple[float, float]:
        """Return the default mass (kg) and moment of inertia (kg m^2) of a planet carrier.

        They apply if the file does not describe the parts of the carrier, which is then modelled as
        a disc with the width and material of a planet and the radius of the pins.
        """
        planet, radius = self.planet(self._stages_of_carrier(carrier)[0]), self.pin_radius(carrier)
        width = planet.get_number("face_width", "m", "for the inertia of the carrier")
        mass = math.pi * radius**2 * width * self.material(planet)[0].density
        self.default("the carrier is a disc with the width and material of a planet", carrier)
        return mass, mass * radius**2 / 2.0

    def end_at_planets(self, part: Component, carrier: Component) -> float:
        """Return the coordinate of the end of a carrier shaft that is near the planets, in m.

        `part` is the component of the shaft.
        """
        shaft, planet = self.shafts[part.id], self.planet(self._stages_of_carrier(carrier)[0])
        u = self.coordinate(planet, part)
        return min(shaft.ends, key=lambda end: abs(end - u))

    def train(
        self,
        load_case: str | None = None,
        *,
        bearing_stiffness: float | None = None,
        damping_ratio: float = 0.05,
        structural_damping: float = STRUCTURAL_DAMPING,
        model: str = "teeth",
        stiffness: str | None = None,
        options: dict | None = None,
        reference: str | None = None,
    ) -> "GearTrain":
        """Return the whole gearbox as a gear train in a load case.

        Parameters
        ----------
        load_case : str, optional
            Name of a load case, by default the first.
        bearing_stiffness : float, optional
            Stiffness of all bearings, N/m. By default the stiffness that the file states for each
            bearing; axes without one are rigid.
        damping_ratio : float, default 0.05
            Damping ratio of each mesh, with its two gears alone.
        structural_damping : float, default 1e-6
            Damping of shafts, couplings and bearings over their stiffness, s.
        model, stiffness, options
            Model of the meshes ("teeth" or "rectangle"), method of their stiffness ("iso" or
            "energy") and options of this method, see `gearlib.Mesh.from_geometry`.
        reference : str, optional
            Stage whose mesh sets the scales and the tuning (mesh frequency over natural
            frequency), by default the first.

        Returns
        -------
        GearTrain
            Meshes are named after the stages, bodies after gears, loads and carriers.

        Raises
        ------
        ValueError
            If something is missing or impossible; the message names component and attribute.
        """
        # This import loads the compiled code of trains, which other methods do not need.
        from gearlib.gearboxes.train import build_train

        return build_train(
            self,
            load_case,
            bearing_stiffness=bearing_stiffness,
            structural_damping=structural_damping,
            reference=reference,
            damping_ratio=damping_ratio,
            model=model,
            stiffness=stiffness,
            options=options,
        )

    def outline(self) -> "xr.Dataset":
        """Return the outlines of sections and gears to scale, seen across the gearbox.

        Returns
        -------
        xarray.Dataset
            Over ``part``, ``corner`` and ``coordinate`` (along the shafts, and across them in the
            direction in which the axes lie furthest apart): corner_position in m; over ``part``:
            part_stage, the stage of a gear, "" for shafts. Parts without positions are left out.
        """
        from gearlib.data.result import make_study_result

        placed_shafts = {
            key: shaft for key, shaft in self.shafts.items() if shaft.start is not None
        }
        axes = np.array([shaft.start[1:] for shaft in placed_shafts.values()]).reshape(-1, 2)
        # The first singular vector is the direction in which the axes are furthest apart; it is
        # oriented upwards, i.e. along w.
        across = np.array([0.0, 1.0])
        if placed_shafts:
            across = np.linalg.svd(axes - axes.mean(axis=0))[2][0]
        across = across * (1.0 if across[1] >= 0.0 else -1.0)
        solids: list[tuple] = []  # (shaft, ends, inner diameters, outer diameters, stage)
        for shaft in placed_shafts.values():
            for section in shaft.sections:
                ends = section.start, section.end
                solids.append((shaft, ends, section.inner, section.outer, ""))
        added_gears: set = set()
        for name, stage in self.stages.items():
            if name in self.refused:
                continue
            geometry = self.stage(name)
            pairs = (stage.pinion, geometry.pinion), (stage.wheel, geometry.wheel)
            for gear, spur_gear in pairs:
                shaft = placed_shafts.get(self.shaft_of[gear.id].id)
                if shaft is None or gear.id in added_gears:
                    continue
                added_gears.add(gear.id)
                if spur_gear.internal:
                    inner, outer = spur_gear.tip_diameter, spur_gear.outer_diameter
                else:
                    inner, outer = spur_gear.bore, spur_gear.tip_diameter
                solids.append((shaft, self.face(gear), (inner, inner), (outer, outer), name))
        corners, stages = [], []
        for shaft, ends, inner, outer, name in solids:
            u = shaft.start[0] + shaft.direction * np.array(ends)
            axis_height = float(shaft.start[1:] @ across)
            for factor in (0.5, -0.5):  # above and below the axis
                heights = axis_height + factor * np.array([*outer, *inner[::-1]])
                corners.append(np.stack([[*u, *u[::-1]], heights], axis=1))
                stages.append(name)
        data = {
            "corner_position": (("part", "corner", "coordinate"), np.reshape(corners, (-1, 4, 2))),
            "part_stage": ("part", np.array(stages, object)),
        }
        coords = {"coordinate": ["along", "across"]}
        return make_study_result("Outline of a gearbox", data, coords)

    def rows(self, load_case: str | None = None) -> Iterator[list]:
        """Yield the rows of a table of the stages in a load case.

        The first row is the header, and each other row has the values of a stage, see `_COLUMNS`.
        Unknown values are None, e.g. the geometry of a stage that cannot be computed.
        """
        yield [name for name, _ in _COLUMNS]
        loads = self.loads(load_case)
        for name, stage in self.stages.items():
            geometry = None if name in self.refused else self.stage(name, load_case)
            torque = abs(loads.pinion_torques[name]) if loads.torque_error is None else None
            speed = None if loads.pinion_speeds is None else abs(loads.pinion_speeds[name])
            arguments = name, stage.signed_teeth, geometry, torque, speed
            yield [get_value(*arguments) for _, get_value in _COLUMNS]

    def __str__(self) -> str:
        """Return tables of the stages and external loads in all load cases, followed by remarks.

        The remarks list default values, contradictions in the file and stages that cannot be
        computed.
        """
        lines = [f"gearbox, REXS {self.model.version}, {self.model.application}".rstrip(", ")]
        for case, fraction in self.load_cases.items():
            share = "" if math.isnan(fraction) else f", {100.0 * fraction:.4g} % of the duration"
            lines += ["", f"load case {case}{share}", *_format_table(self.rows(case))]
            lines += ["", *_format_table(self._load_rows(case))]
            torque_error = self.loads(case).torque_error
            if torque_error is not None:
                lines += _wrap_entry(str(torque_error))
        for title, texts in (
            ("not stated in the file", self.defaults),
            ("contradictions in the file", self.notes),
            ("stages that are not computed", self.refused.values()),
        ):
            if texts:
                lines += ["", f"{title}:"]
            for text in texts:
                lines += _wrap_entry(text)
        return "\n".join(lines)

    def _load_rows(self, case: str) -> Iterator[list]:
        """Yield the rows of a table of the external loads in a load case.

        The first row is the header. Torques and speeds are positive counterclockwise, and None if
        they are unknown.
        """
        yield ["external load", "on", "torque (N m)", "speed (rpm)"]
        loads = self.loads(case)
        for load, part in loads.external_loads:
            torque = None if loads.torque_error else loads.torques[load.id]
            speed = None if loads.speeds is None else loads.speeds[part.id]
            yield [load.name, part.name, torque, speed]


def _multiply(value: float | None, factor: float) -> float | None:
    """Return value * factor, or None if the value is None."""
    return None if value is None else value * factor


#: Columns of the table of stages: header, and function that computes the value from the name of a
#: stage, its tooth numbers z, its geometry (None if unknown), and torque and speed of the pinion.
_COLUMNS: tuple = (
    ("stage", lambda name, z, stage, torque, speed: name),
    ("teeth", lambda name, z, stage, torque, speed: f"{z[0]}/{abs(z[1])}"),
    ("m_n (mm)", lambda name, z, stage, torque, speed: stage and 1e3 * stage.pinion.module),
    ("beta (deg)", lambda name, z, stage, *_: stage and math.degrees(stage.pinion.helix_angle)),
    ("a (mm)", lambda name, z, stage, torque, speed: stage and 1e3 * stage.centre_distance),
    ("b (mm)", lambda name, z, stage, torque, speed: stage and 1e3 * stage.width),
    ("eps_alpha", lambda name, z, stage, torque, speed: stage and round(stage.contact_ratio, 4)),
    ("eps_beta", lambda name, z, stage, torque, speed: stage and round(stage.overlap_ratio, 4)),
    ("ratio", lambda name, z, stage, torque, speed: abs(z[1]) / z[0]),
    ("n_1 (rpm)", lambda name, z, stage, torque, speed: speed),
    ("n_2 (rpm)", lambda name, z, stage, torque, speed: _multiply(speed, z[0] / abs(z[1]))),
    ("T_1 (N m)", lambda name, z, stage, torque, speed: torque),
    ("T_2 (N m)", lambda name, z, stage, torque, speed: _multiply(torque, abs(z[1]) / z[0])),
    ("f_mesh (Hz)", lambda name, z, stage, torque, speed: _multiply(speed, z[0] / 60.0)),
    (
        "F_bt (N)",
        lambda name, z, stage, torque, speed: (
            None if None in (stage, torque) else stage.load(torque)
        ),
    ),
)


def _wrap_entry(text: str) -> list[str]:
    """Wrap an entry of a printed list; return its indented lines."""
    return textwrap.wrap(text, _LINE_WIDTH, initial_indent="  ", subsequent_indent="    ")


def _format_table(rows: Iterable[list]) -> list[str]:
    """Format a table with aligned columns; return its lines.

    A row is a list of values. Columns that do not fit into `_LINE_WIDTH` characters follow in
    further blocks, each of which repeats the first column.
    """
    cells = [[_format_cell(value) for value in row] for row in rows]
    widths = [max(map(len, column)) + 2 for column in zip(*cells, strict=True)]
    blocks: list[list[int]] = []  # indices of the columns in each block
    for column, width in enumerate(widths[1:], 1):
        if not blocks or widths[0] + sum(widths[j] for j in blocks[-1]) + width > _LINE_WIDTH:
            blocks.append([])
        blocks[-1].append(column)
    lines = []
    for block in blocks:
        for row in cells:
            lines.append("".join(row[i].ljust(widths[i]) for i in [0, *block]).rstrip())
    return lines


def _format_cell(value: Any) -> str:
    """Format a table cell: "-" for None, six significant digits for a float."""
    if value is None:
        return "-"
    if isinstance(value, float):
        return f"{value + 0.0:.6g}"
    return str(value)
