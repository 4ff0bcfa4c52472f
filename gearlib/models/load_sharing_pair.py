"""Gear pair whose single pairs of teeth share the load, each with a gap and a compliance.

    m x'' + k (x' - e') + sum_i F_i(x, tau) = F,

with the forces F_i of `gearlib.models.geometry.load_sharing` at a displacement x: touching pairs
satisfy Q F = x - g, and the other pairs have no force. The smallest gap e(tau) is the displacement
at which flanks touch without load, for helical gears its mean over the face; x - e is the relative
displacement y of `OneDegreePair`. The coast side touches at x = -backlash, where all pairs on their
path of contact carry load, without gaps.

Over the phase, forces and overlaps are parabolas through their values at both ends and in the
middle of intervals. The intervals end at equally spaced phases, the ends of the path, the starts of
reliefs and the points of tables, so that linear and parabolic reliefs with constant stiffness are
exact. They are shorter where tip corners touch. For helical gears, forces and overlaps are straight
lines between the phases at which slices of the face begin and end their contact.
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
    from gearlib.engines.taylor.teeth_courses import propagator_of

    return propagator_of(model)


Method = Annotated[Literal["energy", "iso"], CHOICE]
#: Longest step times the highest frequency: a Taylor series of order 20 has an error of 1e-17.
_MAX_STEP_ANGLE = 1.18
#: Options of the stiffness methods.
_STIFFNESS_OPTIONS = ("torque", "application_factor", "samples", "hertz", *PAIR_OPTIONS)
#: Tuning at which inertia adds less than 1 % to the load if corners touch over the typical length,
#: in base pitches. It is lower for shorter corner contact and higher for pitch errors, by factors.
_QUASI_STATIC_TUNING, _TYPICAL_CORNER_LENGTH = 2e-4, 0.05
_MIN_CORNER_FACTOR, _PITCH_ERROR_FACTOR = 0.25, 10.0
#: Segment boundaries whose phases differ by less, in rad, count as equal.
_PHASE_TOLERANCE = 1e-9
#: Number of intervals of the corner contact before, and also behind, the path of contact.
_CORNER_INTERVALS = 8


@declared()
class LoadSharingPair(WithPair):
    """A gear pair in which pairs of teeth with tip relief and errors share the load; immutable.

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
        """Check the parameters, and set the pitch errors, by default those of the gears."""
        super().__post_init__()
        errors = tuple(load_sharing.checked_errors(self.stage, self.pitch_errors).tolist())
        object.__setattr__(self, "pitch_errors", errors)
        # Computing the pairs of teeth at one phase raises ValueError if stiffness or coupling is
        # not allowed.
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
        # Fields of this class are taken out of the options; the others belong to the `GearPair`.
        fields = {name: options.pop(name) for name in cls.__dataclass_fields__ if name in options}
        fields |= {"stiffness": stiffness, "coupling": coupling, "twist": twist}
        method_options = {"coupling": coupling, "twist": twist} if stiffness == "energy" else {}
        pair = GearPair.from_geometry(stage, stiffness=stiffness, options=method_options, **options)
        return cls(pair=pair, stage=stage, **fields)

    @property
    def stiffness_model(self) -> str:
        """The mesh model and the stiffness method in words, as in "pairs of teeth, table"."""
        method = self.stiffness if isinstance(self.stiffness, str) else "table"
        return f"pairs of teeth, {METHOD_NAMES[method]}"

    def extra_summary_variables(self, dims: tuple, summaries: np.ndarray, span: float) -> dict:
        """Return the dynamic factor, largest over static mesh force, as {name: (dims, values)}.

        `summaries` are rows of extrema and sums over a record, with the dimensions `dims` and one
        more axis for the columns. The phase of the record, `span`, is not used.
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
                f"pitch_errors = {self.pitch_errors!r} is not allowed: it must have one value, "
                "where one mesh period stands for all"
            )
        pairs = load_sharing.tooth_pairs(self.stage, phases, **self._options)
        # Transmission errors x of both loads, in m, one for each phase.
        unloaded, loaded = pairs.forces_under_loads([0.0, self.load]).displacement
        # The stiffness F / (x - e) over the phase, and its rectangle with the stiffness ratio kappa
        # and the contact ratio epsilon.
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
        """Keyword arguments of `load_sharing.pairs_at` that follow from the fields of the model.

        `pairs_at` computes the gaps and compliances of the pairs of teeth in mesh.
        """
        names = ("stiffness", "coupling", "twist", "deviation", "pitch_errors", "load")
        return {name: getattr(self, name) for name in names} | {"corners": self.corner_contact}

    def _pairs(self, pitches: np.ndarray, *selection: np.ndarray) -> load_sharing.ToothPairs:
        """Return the pairs of teeth in mesh at phases in base pitches, with gaps and compliances.

        `pitches` and `selection` are the arguments of `load_sharing.pairs_at`; `selection` holds
        the phases that decide which pairs are in mesh, and whether each pair can touch.
        """
        return load_sharing.pairs_at(self.stage, pitches, *selection, **self._options)

    def tooth_forces(self, phase: Any, displacement: Any) -> np.ndarray:
        """Return the forces of the pairs of teeth on the drive side.

        Parameters
        ----------
        phase : array_like, shape (m,)
            Mesh phase, rad.
        displacement : array_like, shape (m,)
            Displacement in static deflections, as `gearlib.simulate` returns it.

        Returns
        -------
        numpy.ndarray, shape (m, k)
            Forces in N of the k pairs; the first pair came into mesh last.
        """
        # Phases are counted in base pitches from the start of contact, displacements in m.
        pairs = self._pairs(np.asarray(phase, float) / math.tau + self._phase_offset)
        displacement = np.asarray(displacement, float) * self.static_deflection
        return pairs.forces_at_displacement(displacement).force[0]

    def static_state(self, tuning: float, load: float = 1.0) -> tuple[float, float]:
        """Return displacement and velocity in static equilibrium at phase 0, in static deflections.

        `load` is the load over the load of the model; a negative load acts on the coast-side
        flanks. If there are none, because the backlash is infinite, the result is (0, 0). The
        equilibrium does not depend on the `tuning`, the mesh frequency over the natural frequency.
        """
        if load >= 0.0:
            pairs = self._pairs(np.array([self._phase_offset]))
            sharing = pairs.forces_under_loads([load * self.load])
            return float(sharing.displacement[0, 0]) / self.static_deflection, 0.0
        if self.backlash == math.inf:
            return 0.0, 0.0
        # On the coast side the force is stiffness * x - offset, with both coefficients at the start
        # of the first segment; the last set of pairs is contact on the coast side.
        system, _ = self.system_and_max_stiffness
        stiffness, _, _, offset, _, _ = system.force_laws[0, -1]
        return float((load + offset) / stiffness), 0.0

    @property
    def repeats(self) -> int:
        """Number of mesh periods after which the pitch errors, and thus the excitation, repeat."""
        return len(self.pitch_errors)

    @cached_property
    def _corner_lengths(self) -> Any:
        """Lengths of corner contact before and behind the path of contact, in base pitches."""
        return load_sharing.corner_contact_lengths(
            self.stage, self.corner_contact, self.load, self.pitch_errors
        )

    def _breakpoints(self) -> np.ndarray:
        """Return the phases, in [0, 1) base pitches, that divide a mesh period into segments.

        In a segment, the gaps and compliances of the pairs of teeth are smooth for spur gears and
        linear for helical gears. A segment ends where a pair enters or leaves its path of contact,
        where a tip relief or a point of a table begins, and at equally spaced phases. The phases
        are not sorted.
        """
        stage = self.stage
        count = load_sharing.face_slices(stage, self.repeats).intervals_per_pitch
        if count:  # The gears are helical.
            # A multiple of this number keeps a whole number of slices in each interval.
            count *= math.ceil(self.phases / load_sharing.MIN_INTERVALS_PER_PITCH)
            return (self._phase_offset + np.arange(count) / count) % 1.0
        start, end = stage.path
        kinks = [start, end]  # positions on the path of contact, m
        # The teeth are relieved at the tip of the wheel, where contact starts, and at the tip of
        # the pinion, where it ends.
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
            # Where tip corners touch, before and behind the path, the gap changes fast.
            entry_length, exit_length = self._corner_lengths
            breaks.append(0.0 - np.linspace(0.0, entry_length, _CORNER_INTERVALS + 1))
            exit_breaks = np.linspace(0.0, exit_length, _CORNER_INTERVALS + 1)
            breaks.append(stage.contact_ratio + exit_breaks)
        return np.append(np.concatenate(breaks), self._phase_offset) % 1.0

    @property
    def _phase_offset(self) -> float:
        """Base pitches from the start of contact of a pair of teeth to mesh phase 0.

        Phase 0 is the middle of the segment with the most pairs in contact, whose length in base
        pitches is the fractional part of the contact ratio.
        """
        return (self.stage.contact_ratio % 1.0) / 2.0

    def _pair_numbers(self, pitches: np.ndarray) -> np.ndarray:
        """Return the number of the last pair of teeth to come into mesh, at phases in base pitches.

        A pair comes into mesh earlier than it reaches the start of the path of contact if tip
        corners touch before it or if, in helical gears, one end of the face meshes before the
        middle.
        """
        half_overlap = load_sharing.face_slices(self.stage, self.repeats).half_overlap
        return np.floor(pitches + self._corner_lengths[0] + half_overlap)

    @cached_property
    def system_and_max_stiffness(self) -> tuple[ToothPairSystem, float]:
        """The `ToothPairSystem` for any tuning, and the ratio of its largest to its mean stiffness.

        The `ToothPairSystem` holds the coefficients of the equation of motion in segments of the
        mesh phase. They lie between neighbouring breakpoints of the whole period, which is
        `repeats` mesh periods long and starts at phase 0. The method `system` sets its tuning,
        damping and largest step.
        """
        # The breakpoints of all mesh periods, without duplicates, from phase 0 on.
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
        smallest_gaps = points[0].smallest_gap, points[-1].smallest_gap  # at both ends
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
            force_laws=_parabolas(forces, lengths),
            overlap_laws=_parabolas(overlaps, lengths),
            gap_rate=(smallest_gaps[1] - smallest_gaps[0]) / lengths / self.static_deflection,
            damping=np.zeros(2),
            coast_line=-self.backlash_ratio,
            max_step=0.0,
            tuning=0.0,
            repeats=repeats,
            may_jam=bool(-np.min(smallest_gaps) > self.backlash),
        )
        return system, max(values[..., 0].max() for values in forces)

    def _segments(
        self, left, midpoints, right
    ) -> tuple[np.ndarray, np.ndarray, list[load_sharing.ToothPairs]]:
        """Return the k pairs of teeth in mesh in p segments as (can_touch, on_path, points).

        The segments are given by their left ends, midpoints and right ends in base pitches, (p,)
        each. `can_touch`, (p, k), is whether a pair can touch, and `on_path`, (p, k), whether it
        also lies on its path of contact. `points` is a list of `ToothPairs`, the gaps and
        compliances of the pairs: at the left ends, at the midpoints (for spur gears only), and at
        the right ends.
        """
        stage = self.stage
        if stage.overlap_ratio == 0.0:
            pairs = self._pairs(midpoints)
            can_touch = pairs.can_touch
            on_path = pairs.position == np.clip(pairs.position, *stage.path)
            left_pairs = self._pairs(left, midpoints, can_touch)
            right_pairs = self._pairs(right, midpoints, can_touch)
            return can_touch, can_touch & on_path, [left_pairs, pairs, right_pairs]
        # Most segments start with the same pairs of teeth with which the segment before ends. Such
        # pairs are computed only once.
        pitches, middles = np.concatenate([left, right]), np.concatenate([midpoints] * 2)
        phases = np.column_stack([pitches, self._pair_numbers(middles)])
        _, unique, indices = np.unique(phases, axis=0, return_index=True, return_inverse=True)
        pairs = self._pairs(pitches[unique], middles[unique])
        ends = [pairs.at_phases(end_indices) for end_indices in np.split(indices.reshape(-1), 2)]
        can_touch = ends[0].can_touch | ends[1].can_touch
        return can_touch, can_touch, [replace(end, can_touch=can_touch) for end in ends]

    def _force_coefficients(self, pairs, on_path) -> tuple[np.ndarray, np.ndarray]:
        """Return dimensionless coefficients (forces, overlaps) for all sets of touching pairs.

        `pairs` are the `ToothPairs`, k pairs of teeth at each of m phases, which have 2^k sets; bit
        i of the index of a set is 1 if pair i touches. `on_path`, shape (m, k), is whether a pair
        lies on its path of contact. The mesh force at a displacement x is a x - b with
        forces[phase, set] = (a, b); the last set, with the index 2^k, is contact on the coast side.
        The flanks of a pair overlap by p x - r with overlaps[phase, set, pair] = (p, r) if only the
        pairs of the set carry the load.
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
            # On the coast side all pairs on their path of contact touch.
            coast_side = on_path[:, touching].all(-1) & (on_path.sum(-1) == len(touching))
            forces[coast_side, -1, 0] = mesh_stiffness[coast_side]
        # The force on the coast side is 0 at the displacement x = -backlash_ratio.
        if self.backlash < math.inf:
            forces[:, -1, 1] = -self.backlash_ratio * forces[:, -1, 0]
        return forces, overlaps

    def steps_per_period(self, tuning: float) -> float:
        """Return the minimum number of integration steps per mesh period at a tuning.

        `tuning` is the mesh frequency over the mean natural frequency. Each segment of the mesh
        period takes at least one step, and no step is longer than the largest step of the system.
        """
        system = self.system(tuning)
        return max(len(system.force_laws) / self.repeats, math.tau / system.max_step)

    @property
    def slowest_tuning(self) -> float:
        """Tuning, mesh over natural frequency, below which a run counts as quasi-static.

        Below it, inertia adds less than 1 % to the load. It is lower if tip corners touch over a
        short length, where contact begins suddenly, and higher if pitch errors excite the mesh.
        """
        relative_length = sum(self._corner_lengths) / _TYPICAL_CORNER_LENGTH
        corner_factor = min(max(relative_length, _MIN_CORNER_FACTOR), 1.0)
        if relative_length == 0.0:  # There is no corner contact.
            corner_factor = 1.0
        error_factor = 1.0 if self.repeats == 1 else _PITCH_ERROR_FACTOR
        return _QUASI_STATIC_TUNING * corner_factor * error_factor

    def system(self, tuning: float) -> ToothPairSystem:
        """Return the constants of the equation of motion at a tuning, as a `ToothPairSystem`.

        `tuning` is the mesh frequency over the mean natural frequency.
        """
        system, max_stiffness = self.system_and_max_stiffness
        # Damping 2 beta / nu in free flight and in contact, for velocities by mesh phase.
        damping = 2.0 * np.array([self.backlash_damping_ratio, self.damping_ratio]) / tuning
        # The sum is at least the highest natural frequency by mesh phase.
        max_step = _MAX_STEP_ANGLE / (math.sqrt(max_stiffness) / tuning + damping.max())
        return system._replace(damping=damping, max_step=max_step, tuning=tuning)


def _parabolas(values: Sequence[np.ndarray], lengths: np.ndarray) -> np.ndarray:
    """Return laws a x - b on p segments, with parabolas of the phase for a and b.

    `values` are arrays (p, ..., 2) of (a, b) at the left ends, the midpoints and the right ends of
    the segments, whose `lengths` in mesh phase have the shape (p,). Without the midpoints the
    parabolas are straight lines. The last axis of the result, of length 6, has the coefficients of
    the powers 0, 1, 2 of the phase from the left end: three for a, then three for b.
    """
    left, right = values[0], values[-1]
    middle = values[1] if len(values) == 3 else 0.5 * (left + right)
    lengths = lengths.reshape(-1, *[1] * (left.ndim - 1))
    slopes = (4.0 * middle - 3.0 * left - right) / lengths
    squares = 2.0 * (left - 2.0 * middle + right) / lengths**2
    return np.stack([left, slopes, squares], -1).reshape(*left.shape[:-1], 6)


def default_load_sharing_pair(stage, *, stiffness=None, options=None, **arguments):
    """Return the `LoadSharingPair` of a gear stage, with a default stiffness method.

    `stage` is a `gearlib.geometry.GearStage`. If `stiffness` is None, the method is the energy
    method or, if a bore is too large for that method, ISO 6336. `options` is a dict of options of
    `gearlib.geometry.mesh_stiffness`, of which only coupling and twist are used; `arguments`, such
    as torque and damping_ratio, are passed to `LoadSharingPair.from_geometry`.
    """
    stiffness = stiffness or checks.check_gear_stage(stage).tooth_stiffness  # "energy" or "iso"
    options = options or {}
    checks.check_parameter_names("stiffness", options, _STIFFNESS_OPTIONS)
    if stiffness == "energy":
        arguments |= {name: options[name] for name in PAIR_OPTIONS if name in options}
    return LoadSharingPair.from_geometry(stage, stiffness=stiffness, **arguments)
