"""Gear pair in which individual tooth pairs, each with a gap and a compliance, share the load.

    m x'' + k (x' - e') + sum_i F_i(x, tau) = F,

`gearlib.models.geometry.load_sharing` computes the forces F_i at a displacement x: the pairs in
contact satisfy Q F = x - g with their compliances Q and gaps g, and all other forces are zero. The
smallest gap e(tau) is the displacement at which the flanks touch without load (for helical gears,
its mean over the face width); x - e is the relative displacement y of `OneDegreePair`. Contact on
the coast side begins at x = -backlash; there all pairs on their path of contact carry load, and
gaps are neglected.

Each mesh period is divided into intervals of the phase. In an interval, forces and overlaps are
interpolated by parabolas through their values at the ends and at the midpoint. Intervals end at
equally spaced phases, at the ends of the path of contact, at the starts of tip reliefs and at the
points of tables, so that linear and parabolic reliefs with constant stiffness are exact. They are
shorter where tip corners touch. For helical gears, forces and overlaps are interpolated linearly
between the phases at which slices of the face enter or leave contact.
"""

import math
from collections.abc import Sequence
from dataclasses import field, replace
from functools import cached_property
from typing import Annotated, Any, Literal

import numpy as np

from gearlib import checks
from gearlib.data import summary
from gearlib.engines.taylor.teeth import Propagator, ToothPairSystem
from gearlib.models.geometry import load_sharing
from gearlib.models.geometry.gear import PathTable
from gearlib.models.geometry.gear_stage import PAIR_OPTIONS, GearStage
from gearlib.models.geometry.iso import METHOD_NAMES
from gearlib.models.harmonics import Harmonics
from gearlib.models.one_degree_pair import OneDegreePair
from gearlib.models.pair import GearPair, WithPair
from gearlib.models.profiles import Tabulated
from gearlib.parameters import (
    CHOICE,
    Boolean,
    Count,
    Fraction,
    Phases,
    checked,
    declared,
    described,
)


def _speed_course_propagator(model: Any) -> Any:
    """Return the integrator of a `LoadSharingPair` for runs whose speed changes with time."""
    # Imported on first use, because it takes time to load.
    from gearlib.engines.taylor.teeth_courses import create_course_propagator

    return create_course_propagator(model)


Method = Annotated[Literal["energy", "iso"], CHOICE]
#: Largest product of step and highest frequency; a Taylor series of order 20 then has an error of
#: 1e-17.
_MAX_STEP_ANGLE = 1.18
#: Names of the options of the stiffness methods.
_STIFFNESS_OPTIONS = ("torque", "application_factor", "samples", "hertz", *PAIR_OPTIONS)
#: Tuning below which inertia adds less than 1 % to the load if the corner contact has the typical
#: length, in base pitches. Factors lower it for shorter corner contact and raise it for pitch
#: errors.
_QUASI_STATIC_TUNING, _TYPICAL_CORNER_LENGTH = 2e-4, 0.05
_MIN_CORNER_FACTOR, _PITCH_ERROR_FACTOR = 0.25, 10.0
#: Segment boundaries closer than this phase difference in rad are merged.
_PHASE_TOLERANCE = 1e-9
#: Number of intervals of the corner contact at each end of the path of contact.
_CORNER_INTERVALS = 8


@declared()
class LoadSharingPair(WithPair):
    """A gear pair whose tooth pairs, with tip relief and errors, share the load; immutable.

    `gearlib.geometry.GearStage.transmission_error` describes stiffness, coupling, deviation and
    pitch_errors. Helical gears are divided into slices, whose forces are linearized at the
    displacement under the load.
    """

    pair: Annotated[
        GearPair,
        described(
            "Gear pair with mass, load, damping, backlash and scales; its stiffness is not used"
        ),
    ] = field()
    stage: Annotated[GearStage, described("Gears with their tip reliefs")]
    phases: Annotated[
        Phases,
        described(
            "Number of equal intervals of a mesh period in which gaps and compliances are parabolas"
        ),
    ] = 16
    stiffness: Any = "energy"
    coupling: Annotated[
        Fraction | None,
        described(
            "Share of the gear body's compliance that is common to all pairs of teeth; None for "
            "a fit to finite elements"
        ),
    ] = None
    twist: Annotated[Boolean, described("Whether gear bodies twist about their bores")] = True
    deviation: PathTable | None = None
    pitch_errors: Any = None  #: tuple of pitch errors, m
    corner_contact: Annotated[
        Boolean, described("Whether tip corners touch before and behind the path of contact")
    ] = True

    defaults = {"pitch_errors": lambda model: model.stage.pitch_errors}
    propagators = {"exact": Propagator}
    speed_course_propagator = staticmethod(_speed_course_propagator)
    piecewise_linear = False
    force_ratio_name = "dynamic_factor"
    has_damping = property(lambda model: model.pair.has_damping, doc="`GearPair.has_damping`.")
    references = (
        "Harris: Proc. Inst. Mech. Eng. 172 (1958) 87-112; "
        "Hortel, Skuderova: Engineering Mechanics 14 (2007) 91-104"
    )

    def __post_init__(self) -> None:
        """Check the parameters; by default, copy the pitch errors of the gears."""
        super().__post_init__()
        errors = tuple(load_sharing.check_pitch_errors(self.stage, self.pitch_errors).tolist())
        object.__setattr__(self, "pitch_errors", errors)
        # This computation at one phase raises ValueError for an invalid stiffness or coupling.
        self._pairs(np.zeros(1))

    @classmethod
    @checked
    def from_geometry(
        cls,
        stage: GearStage,
        *,
        stiffness: Method = "energy",
        coupling=None,
        twist=True,
        **options: Any,
    ) -> "LoadSharingPair":
        """Return the pair of two gears, with scales from the mean of the mesh stiffness.

        Parameters
        ----------
        stage : gearlib.geometry.GearStage
            Geometry of both gears.
        stiffness : {"energy", "iso"}, default "energy"
            Method of the mesh stiffness. For a table create the class with its fields instead.
        coupling : float, optional
            Fraction of the gear bodies' compliance that all pairs have in common, from 0 to 1; by
            default a fit to finite elements, see `gearlib.models.geometry.mesh_stiffness`.
        twist : bool, default True
            Whether gear bodies twist about their bores.
        **options
            Fields of the class: phases, deviation, pitch_errors, corner_contact; and arguments of
            `GearPair.from_geometry` such as torque and damping_ratio.
        """
        # The options that are no fields of this class are passed to `GearPair`.
        fields = {name: options.pop(name) for name in cls.__dataclass_fields__ if name in options}
        fields |= {"stiffness": stiffness, "coupling": coupling, "twist": twist}
        method_options = {"coupling": coupling, "twist": twist} if stiffness == "energy" else {}
        pair = GearPair.from_geometry(stage, stiffness=stiffness, options=method_options, **options)
        return cls(pair=pair, stage=stage, **fields)

    @property
    def stiffness_model(self) -> str:
        """Description of the mesh model and the stiffness method, e.g. "pairs of teeth, table"."""
        method = self.stiffness if isinstance(self.stiffness, str) else "table"
        return f"pairs of teeth, {METHOD_NAMES[method]}"

    def extra_summary_variables(self, dims: tuple, summaries: np.ndarray, span: float) -> dict:
        """Return the dynamic factor as a dataset variable {name: (dims, values)}.

        The dynamic factor is the largest mesh force divided by the static mesh force. `summaries`
        contains the extrema and sums of recorded runs; its last axis has the columns of a summary,
        and `dims` are the dimensions of the other axes. `span`, the phase of the record in rad, is
        not used.
        """
        return {"dynamic_factor": (dims, self.force_ratios(summary.largest_force(summaries)))}

    @checked
    def at_load(self, *, phases: Phases = 128, harmonics: Count = 24) -> OneDegreePair:
        """Return the `OneDegreePair` with the same static transmission error at the load.

        With the transmission errors e(tau) without load and x(tau) under the load F, over the mesh
        phase tau, its deviation is -e and its mesh stiffness F / (x - e). At other loads its
        transmission error differs.

        Parameters
        ----------
        phases : int, default 128
            Number of phases of the stiffness, which is linear between them; >= 8.
        harmonics : int, default 24
            Number of harmonics of the deviation; < phases / 2.

        Raises
        ------
        ValueError
            If successive pairs of teeth differ.
        """
        if self.repeats > 1:
            raise ValueError(
                f"pitch_errors = {self.pitch_errors!r} is not allowed: it must have a single "
                "value, because all mesh periods must be equal"
            )
        pairs = load_sharing.tooth_pairs(self.stage, phases, **self._options)
        # Transmission errors x without load and under the load, in m, for each phase.
        unloaded, loaded = pairs.solve_for_loads([0.0, self.load]).displacement
        # The equivalent rectangle of the stiffness F / (x - e) has the stiffness ratio kappa and
        # the contact ratio epsilon.
        phase = math.tau * np.arange(phases) / phases
        profile = Tabulated(tuple(phase), tuple(self.load / (loaded - unloaded)))
        max_stiffness, kappa, epsilon = profile.ratios()
        pair = self.pair.replace(
            max_stiffness=max_stiffness, stiffness_ratio=kappa, contact_ratio=epsilon
        )
        deviation = Harmonics.from_table(phase, -unloaded, harmonics)
        return OneDegreePair(pair=pair, profile=profile, deviation=deviation)

    @property
    def _options(self) -> dict[str, Any]:
        """Keyword arguments of `load_sharing.tooth_pairs_at`, taken from the fields of the model.

        `tooth_pairs_at` computes the gaps and compliances of the tooth pairs in mesh.
        """
        names = ("stiffness", "coupling", "twist", "deviation", "pitch_errors", "load")
        return {name: getattr(self, name) for name in names} | {"corners": self.corner_contact}

    def _pairs(self, pitches: np.ndarray, *selection: np.ndarray) -> load_sharing.ToothPairs:
        """Return the tooth pairs in mesh, with their gaps and compliances, at given phases.

        `pitches` and `selection` are positional arguments of `load_sharing.tooth_pairs_at`: the
        phases in base pitches, the phases that decide which pairs are in mesh, and a mask of the
        pairs that can touch.
        """
        return load_sharing.tooth_pairs_at(self.stage, pitches, *selection, **self._options)

    def tooth_forces(self, phase: Any, displacement: Any) -> np.ndarray:
        """Return the forces of the pairs of teeth on the drive side.

        Parameters
        ----------
        phase : array_like, shape (m,)
            Mesh phase, rad.
        displacement : array_like, shape (m,)
            Displacement in units of the static deflection, as returned by `gearlib.simulate`.

        Returns
        -------
        numpy.ndarray, shape (m, k)
            Forces in N of the k pairs; the first pair came into mesh last.
        """
        # `_pairs` counts phases in base pitches from the start of contact.
        pairs = self._pairs(np.asarray(phase, float) / math.tau + self._phase_offset)
        displacement = np.asarray(displacement, float) * self.static_deflection
        return pairs.solve_for_displacement(displacement).force[0]

    def static_state(self, tuning: float, load: float = 1.0) -> tuple[float, float]:
        """Return (displacement, velocity) in static equilibrium at phase 0.

        The displacement is in units of the static deflection. `load` is a factor on the load of the
        model; a negative load acts on the coast-side flanks. If these never touch, because the
        backlash is infinite, the result is (0, 0). The equilibrium does not depend on `tuning`.
        """
        if load >= 0.0:
            pairs = self._pairs(np.array([self._phase_offset]))
            sharing = pairs.solve_for_loads([load * self.load])
            return float(sharing.displacement[0, 0]) / self.static_deflection, 0.0
        if self.backlash == math.inf:
            return 0.0, 0.0
        # The last set of tooth pairs is coast-side contact, with the force stiffness * x - offset.
        # Both coefficients are parabolas of the phase; the first segment starts at phase 0.
        system, _ = self.system_and_max_stiffness
        stiffness, _, _, offset, _, _ = system.force_coefficients[0, -1]
        return float((load + offset) / stiffness), 0.0

    @property
    def repeats(self) -> int:
        """Number of mesh periods after which the pitch errors and the excitation repeat."""
        return len(self.pitch_errors)

    @cached_property
    def _corner_lengths(self) -> Any:
        """Lengths of corner contact before and after the path of contact, in base pitches."""
        return load_sharing.corner_contact_lengths(
            self.stage, self.corner_contact, self.load, self.pitch_errors
        )

    def _breakpoints(self) -> np.ndarray:
        """Return the phases, in [0, 1) base pitches, that divide a mesh period into segments.

        In a segment, the gaps and compliances of the tooth pairs are smooth for spur gears and
        linear for helical gears. There are breakpoints where a pair enters or leaves its path of
        contact, where a tip relief begins, at the points of tables, and at equally spaced phases.
        The phases are not sorted.
        """
        stage = self.stage
        count = load_sharing.divide_face(stage, self.repeats).intervals_per_pitch
        if count:  # The gears are helical.
            # Multiples of this number keep an integer number of slices in each interval.
            count *= math.ceil(self.phases / load_sharing.MIN_INTERVALS_PER_PITCH)
            return (self._phase_offset + np.arange(count) / count) % 1.0
        start, end = stage.path
        kinks = [start, end]  # positions on the path of contact, m
        # Contact starts at the tip of the wheel and ends at the tip of the pinion.
        if stage.pinion.tip_relief is not None:
            kinks.append(end - stage.pinion.tip_relief.length)
        if stage.wheel.tip_relief is not None:
            kinks.append(start + stage.wheel.tip_relief.length)
        for table in (self.deviation, self.stiffness):
            if isinstance(table, PathTable):
                kinks += [position for position in table.position if start < position < end]
        equal_intervals = np.arange(self.phases) / self.phases
        breaks = [(np.array(kinks) - start) / stage.base_pitch, equal_intervals]
        if any(self._corner_lengths):
            # The gap changes rapidly where tip corners touch, before and after the path.
            entry_length, exit_length = self._corner_lengths
            breaks.append(0.0 - np.linspace(0.0, entry_length, _CORNER_INTERVALS + 1))
            exit_breaks = np.linspace(0.0, exit_length, _CORNER_INTERVALS + 1)
            breaks.append(stage.contact_ratio + exit_breaks)
        return np.append(np.concatenate(breaks), self._phase_offset) % 1.0

    @property
    def _phase_offset(self) -> float:
        """Phase offset in base pitches from the start of contact of a tooth pair to mesh phase 0.

        Phase 0 is the middle of the interval with the most pairs in contact. The length of this
        interval in base pitches is the fractional part of the contact ratio.
        """
        return (self.stage.contact_ratio % 1.0) / 2.0

    def _pair_numbers(self, pitches: np.ndarray) -> np.ndarray:
        """Return the number of the tooth pair that came into mesh last, for phases in base pitches.

        A pair comes into mesh before the start of its path of contact if tip corners touch earlier
        or if, in helical gears, one end of the face meshes before the middle.
        """
        half_overlap = load_sharing.divide_face(self.stage, self.repeats).half_overlap
        return np.floor(pitches + self._corner_lengths[0] + half_overlap)

    @cached_property
    def system_and_max_stiffness(self) -> tuple[ToothPairSystem, float]:
        """The `ToothPairSystem` without its tuning, and its maximum over its mean stiffness.

        The `ToothPairSystem` contains the coefficients of the equation of motion for each segment
        of the mesh phase. Segments lie between neighbouring breakpoints of the whole period, which
        has `repeats` mesh periods and starts at phase 0. The method `system` sets the tuning, the
        damping and the largest step.
        """
        # The sorted breakpoints of all mesh periods from phase 0, without duplicates.
        repeats, offset = self.repeats, self._phase_offset
        pitches = np.sort((np.arange(repeats)[:, None] + self._breakpoints()).ravel())
        pitches = pitches[np.diff(pitches, prepend=-1.0) > load_sharing.SAME_POSITION_TOLERANCE]
        pitches = pitches[pitches < repeats - load_sharing.SAME_POSITION_TOLERANCE]
        start = int(np.searchsorted(pitches, offset - load_sharing.SAME_POSITION_TOLERANCE))
        pitches = np.concatenate([pitches[start:], pitches[:start] + repeats, [repeats + offset]])
        left, right = pitches[:-1], pitches[1:]
        midpoints = (left + right) / 2.0
        can_touch, on_path, points = self._segments(left, midpoints, right)
        pair_numbers = self._pair_numbers(midpoints)
        lengths = math.tau * (right - left)
        forces, overlaps = [], []
        for pairs in points:
            force_coefficients, overlap_coefficients = self._force_coefficients(pairs, on_path)
            forces.append(force_coefficients)
            overlaps.append(overlap_coefficients)
        smallest_gaps = points[0].smallest_gap, points[-1].smallest_gap  # at the segment ends
        # Bit i of a mask is set if pair i can touch.
        pair_masks = can_touch @ 2 ** np.arange(can_touch.shape[1])
        masks_change = pair_masks != np.roll(pair_masks, 1)
        starts = math.tau * (pitches - offset)
        period_starts = math.tau * np.arange(repeats + 1)
        first_segment = np.searchsorted(starts, period_starts - _PHASE_TOLERANCE)
        system = ToothPairSystem(
            starts=starts,
            times=starts[:-1] - np.repeat(starts[first_segment[:-1]], np.diff(first_segment)),
            lengths=np.diff(starts),
            first_segment=first_segment,
            summary_blocks=np.zeros(repeats, int),
            intervals=np.arange(left.size),
            start_phases=np.zeros(left.size),
            speeds=np.ones(left.size),
            acceleration=0.0,
            loads=np.ones(left.size),
            load_rate=0.0,
            pairs_change=masks_change | (pair_numbers != np.roll(pair_numbers, 1)),
            active_pairs=pair_masks,
            force_coefficients=_interpolate_coefficients(forces, lengths),
            overlap_coefficients=_interpolate_coefficients(overlaps, lengths),
            gap_rate=(smallest_gaps[1] - smallest_gaps[0]) / lengths / self.static_deflection,
            damping=np.zeros(2),
            coast_line=-self.backlash_ratio,
            max_step=0.0,
            tuning=0.0,
            excitation_period=repeats,
            may_jam=bool(-np.min(smallest_gaps) > self.backlash),
        )
        return system, max(values[..., 0].max() for values in forces)

    def _segments(
        self, left, midpoints, right
    ) -> tuple[np.ndarray, np.ndarray, list[load_sharing.ToothPairs]]:
        """Return (can_touch, on_path, points) for the k tooth pairs in mesh in each of p segments.

        `left`, `midpoints` and `right` are the left ends, midpoints and right ends of the segments
        in base pitches, shape (p,). `can_touch`, shape (p, k), is whether a pair can touch, and
        `on_path`, shape (p, k), whether it also lies on its path of contact. `points` is a list of
        `ToothPairs`, which hold gaps and compliances at the left ends, at the midpoints (for spur
        gears only) and at the right ends.
        """
        stage = self.stage
        if stage.overlap_ratio == 0.0:
            pairs = self._pairs(midpoints)
            can_touch = pairs.can_touch
            on_path = pairs.position == np.clip(pairs.position, *stage.path)
            left_pairs = self._pairs(left, midpoints, can_touch)
            right_pairs = self._pairs(right, midpoints, can_touch)
            return can_touch, can_touch & on_path, [left_pairs, pairs, right_pairs]
        # Most segments start with the tooth pairs with which the previous segment ends, so that
        # duplicates are computed only once.
        pitches = np.concatenate([left, right])
        selection_pitches = np.concatenate([midpoints, midpoints])
        phases = np.column_stack([pitches, self._pair_numbers(selection_pitches)])
        _, unique, indices = np.unique(phases, axis=0, return_index=True, return_inverse=True)
        pairs = self._pairs(pitches[unique], selection_pitches[unique])
        left_indices, right_indices = np.split(indices.reshape(-1), 2)
        left_pairs, right_pairs = (
            pairs.select_phases(left_indices),
            pairs.select_phases(right_indices),
        )
        can_touch = left_pairs.can_touch | right_pairs.can_touch
        points = [replace(pairs, can_touch=can_touch) for pairs in (left_pairs, right_pairs)]
        return can_touch, can_touch, points

    def _force_coefficients(self, pairs, on_path) -> tuple[np.ndarray, np.ndarray]:
        """Return dimensionless coefficients (forces, overlaps) for each set of touching pairs.

        `pairs` is a `ToothPairs` with k tooth pairs at each of m phases. There are 2^k sets of
        touching pairs: bit i of the index of a set is 1 if pair i touches. `on_path`, shape (m, k),
        is whether a pair lies on its path of contact. At a displacement x the mesh force is a x - b
        with (a, b) = forces[phase, set]; the last set, with the index 2^k, is coast-side contact.
        If only the pairs of a set carry the load, the flanks of each pair overlap by p x - r with
        (p, r) = overlaps[phase, set, pair].
        """
        m, k = pairs.gap.shape
        forces, overlaps = np.zeros((m, 2**k + 1, 2)), np.zeros((m, 2**k, k, 2))
        for set_index in range(2**k):
            touching = [i for i in range(k) if set_index >> i & 1]  # the pairs whose bit is 1
            can_touch = pairs.can_touch[:, touching].all(-1)
            if not can_touch.any():
                continue
            stiffness, offset = pairs.force_coefficients(touching)
            mesh_stiffness = stiffness.sum(-1) / self.mean_stiffness
            coefficients = np.stack([mesh_stiffness, offset.sum(-1) / self.load], -1)
            forces[can_touch, set_index] = coefficients[can_touch]
            # The forces of the touching pairs displace the flanks of all pairs.
            compliance = pairs.compliance[:, :, touching]
            overlaps[:, set_index, :, 0] = 1.0 - (compliance @ stiffness[..., None])[..., 0]
            distance = pairs.gap - (compliance @ offset[..., None])[..., 0]
            overlaps[:, set_index, :, 1] = distance / self.static_deflection
            # All pairs on their path of contact touch on the coast side.
            coast_side = on_path[:, touching].all(-1) & (on_path.sum(-1) == len(touching))
            forces[coast_side, -1, 0] = mesh_stiffness[coast_side]
        # The force on the coast side is 0 at the displacement x = -backlash_ratio.
        if self.backlash < math.inf:
            forces[:, -1, 1] = -self.backlash_ratio * forces[:, -1, 0]
        return forces, overlaps

    def steps_per_period(self, tuning: float) -> float:
        """Return the minimum number of integration steps per mesh period at a tuning.

        `tuning` is the mesh frequency over the mean natural frequency. Each segment of the phase
        takes at least one step, and no step is longer than `max_step` of the system.
        """
        system = self.system(tuning)
        return max(len(system.force_coefficients) / self.repeats, math.tau / system.max_step)

    @property
    def slowest_tuning(self) -> float:
        """Tuning (mesh over natural frequency) below which a run is quasi-static.

        Inertia then adds less than 1 % to the load. The limit is lower if tip corners touch over a
        short length, because contact begins abruptly, and higher if pitch errors excite the mesh.
        """
        relative_length = sum(self._corner_lengths) / _TYPICAL_CORNER_LENGTH
        corner_factor = min(max(relative_length, _MIN_CORNER_FACTOR), 1.0)
        if relative_length == 0.0:  # There is no corner contact.
            corner_factor = 1.0
        error_factor = 1.0 if self.repeats == 1 else _PITCH_ERROR_FACTOR
        return _QUASI_STATIC_TUNING * corner_factor * error_factor

    def system(self, tuning: float) -> ToothPairSystem:
        """Return the `ToothPairSystem` of the equation of motion at a tuning.

        `tuning` is the mesh frequency over the mean natural frequency.
        """
        system, max_stiffness = self.system_and_max_stiffness
        # Damping 2 beta / nu in free flight and in contact, for derivatives by the mesh phase.
        damping = 2.0 * np.array([self.backlash_damping_ratio, self.damping_ratio]) / tuning
        # The denominator is an upper bound of the natural frequency per radian of phase.
        max_step = _MAX_STEP_ANGLE / (math.sqrt(max_stiffness) / tuning + damping.max())
        return system._replace(damping=damping, max_step=max_step, tuning=tuning)


def _interpolate_coefficients(values: Sequence[np.ndarray], lengths: np.ndarray) -> np.ndarray:
    """Interpolate the coefficients (a, b) of a x - b on p segments by parabolas of the phase.

    `values` is a list of arrays (p, ..., 2) of (a, b) at the left ends, the midpoints and the right
    ends of the segments; if the midpoints are omitted, the interpolation is linear. `lengths`,
    shape (p,), are the lengths of the segments in rad. The last axis of the result has the 6
    polynomial coefficients (a0, a1, a2, b0, b1, b2) in powers of the phase from the left end.
    """
    left, right = values[0], values[-1]
    middle = values[1] if len(values) == 3 else 0.5 * (left + right)
    lengths = lengths.reshape(-1, *[1] * (left.ndim - 1))
    linear = (4.0 * middle - 3.0 * left - right) / lengths
    quadratic = 2.0 * (left - 2.0 * middle + right) / lengths**2
    return np.stack([left, linear, quadratic], -1).reshape(*left.shape[:-1], 6)


def default_load_sharing_pair(stage, *, stiffness=None, options=None, **arguments):
    """Create the `LoadSharingPair` of a gear stage, with a default stiffness method.

    `stage` is a `gearlib.geometry.GearStage`. If `stiffness` is None, the energy method is used or,
    if a bore is too large for it, ISO 6336. `options` is a dict of options of
    `gearlib.geometry.mesh_stiffness`, of which only coupling and twist are used; `arguments`, such
    as torque and damping_ratio, are passed to `LoadSharingPair.from_geometry`.
    """
    stiffness = stiffness or checks.check_gear_stage(stage).tooth_stiffness  # "energy" or "iso"
    options = options or {}
    checks.check_parameter_names("stiffness", options, _STIFFNESS_OPTIONS)
    if stiffness == "energy":
        arguments |= {name: options[name] for name in PAIR_OPTIONS if name in options}
    return LoadSharingPair.from_geometry(stage, stiffness=stiffness, **arguments)
