"""Gear pair whose single pairs of teeth share the load, each with a gap and a compliance.

    m x'' + k (x' - e') + sum_i F_i(x, tau) = F,

with the forces F_i of `gearlib.models.geometry.load_sharing` at a displacement x: touching pairs
satisfy Q F = x - g, the others have no force. The smallest gap e(tau) is the displacement at which
flanks touch without load; x - e is the relative displacement y of `OneDegreePair`. The coast side
touches at x = -backlash, where all pairs on their path of contact carry load, without gaps.

Gaps and compliances are linear between phases, ends of the path, starts of reliefs and points of
tables, so that linear reliefs with constant stiffness are exact. Intervals are shorter where tip
corners touch or where the slices of a helical face begin and end their contact.
"""

import math
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np

from gearlib import checks
from gearlib.engines.taylor.teeth import ToothPairSystem
from gearlib.models.geometry.gear import PathTable
from gearlib.models.geometry.load_sharing import (
    MIN_LINES,
    SAME_PLACE,
    ToothPairs,
    checked_errors,
    corner_zones,
    face_slices,
    pairs_at,
    tooth_pairs,
)
from gearlib.models.geometry.mesh import Mesh
from gearlib.models.geometry.mesh_stiffness import PairCompliance
from gearlib.models.harmonics import Harmonics
from gearlib.models.one_degree import OneDegreePair
from gearlib.models.pair import GearPair, WithPair
from gearlib.models.profiles import Tabulated
from gearlib.parameters import TRUTH, Instance, Integer, Number, documented

if TYPE_CHECKING:  # loaded by name, for `workflow.sources`
    from gearlib.engines.taylor import teeth  # noqa: F401

#: Longest step times the highest frequency: a Taylor series of order 20 has an error of 1e-17.
_MAX_STEP_ANGLE = 1.18
#: Options of the stiffness methods of a drawing; only the coupling concerns pairs of teeth.
_STIFFNESS_OPTIONS = ("torque", "application_factor", "samples", "coupling", "hertz")
#: Tuning at which inertia adds less than 1 % to the load if corners touch on `_USUAL_ZONE` base
#: pitches; with a shorter zone it is lower, down to a quarter.
_QUASI_STATIC_TUNING, _USUAL_ZONE = 2e-4, 0.05
#: Intervals between the phases at which a pair begins to touch and reaches its path of contact.
_INTERVALS_OF_A_ZONE = 32


@documented
@dataclass(frozen=True, kw_only=True)
class LoadSharingPair(WithPair):
    """A gear pair in which pairs of teeth with tip relief and errors share the load; immutable.

    Stiffness, coupling, deviation and pitch_errors are those of
    `gearlib.geometry.Mesh.transmission_error`. Helical gears are divided into slices, whose forces
    are linearized at the displacement under the load.

    Raises
    ------
    ValueError
        If a value is not allowed; the message names parameter, value and range.
    """

    pair: Annotated[
        GearPair,
        Instance((GearPair,)),
        "Gear pair with mass, load, damping, backlash and scales; its stiffness is not used",
    ]
    drawing: Annotated[
        Mesh, Instance((Mesh,), "a gearlib.geometry.Mesh"), "Drawn gears with their tip reliefs"
    ]
    phases: Annotated[
        int,
        Integer(8, 100_000),
        "Number of equal intervals of a mesh period in which gaps and compliances are linear",
    ] = 32
    stiffness: Any = "energy"
    coupling: Annotated[
        float,
        Number("1", least=0, most=1),
        "Share of the gear body's compliance that is common to all pairs of teeth",
    ] = 1.0
    deviation: PathTable | None = None
    pitch_errors: Any = None  #: tuple of pitch errors, m
    corner_contact: Annotated[
        bool, TRUTH, "Whether tip corners touch before and behind the path of contact"
    ] = True

    defaults = {"pitch_errors": lambda model: model.drawing.pitch_errors}
    propagators = {"exact": "taylor.teeth"}
    piecewise_linear = False
    damped = property(lambda model: model.pair.damped, doc="`GearPair.damped` of the pair.")
    references = (
        "Harris: Proc. Inst. Mech. Eng. 172 (1958) 87-112; "
        "Hortel, Skuderova: Engineering Mechanics 14 (2007) 91-104"
    )

    def __post_init__(self) -> None:
        """Check the parameters, and that the pairs of teeth can be computed."""
        super().__post_init__()
        errors = tuple(checked_errors(self.drawing, self.pitch_errors).tolist())
        object.__setattr__(self, "pitch_errors", errors)
        self._pairs(np.zeros(1))

    @classmethod
    def from_geometry(
        cls, mesh: Mesh, *, stiffness: str = "energy", coupling: float = 1.0, **options: Any
    ) -> "LoadSharingPair":
        """Return the pair of two drawn gears, with scales from the same mesh stiffness.

        Parameters
        ----------
        mesh : gearlib.geometry.Mesh
            The drawn gears.
        stiffness : {"energy", "iso"}, default "energy"
            Method of the mesh stiffness. For a table create the class with its fields instead.
        coupling : float, default 1
            Share of the gear body's compliance that is common to all pairs of teeth, from 0 to 1.
        **options
            Fields of the class: phases, deviation, pitch_errors, corner_contact; and arguments of
            `GearPair.from_geometry` such as torque and damping_ratio.
        """
        checks.one_of("stiffness", stiffness, ("energy", "iso"))
        fields = {name: options.pop(name) for name in cls.__dataclass_fields__ if name in options}
        method_options = {"coupling": coupling} if stiffness == "energy" else {}
        pair = GearPair.from_geometry(mesh, stiffness=stiffness, options=method_options, **options)
        return cls(pair=pair, drawing=mesh, stiffness=stiffness, coupling=coupling, **fields)

    def at_load(self, *, phases: int = 128, harmonics: int = 24) -> OneDegreePair:
        """Return the `OneDegreePair` with the same static transmission error at the load.

        Its deviation is -e(tau), the error without load, and its stiffness is F / (x - e). At other
        loads its transmission error differs.

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
        pairs = tooth_pairs(self.drawing, phases, **self._options)
        # Transmission errors x of both loads, in m, one for each phase.
        unloaded, loaded = pairs.share([0.0, self.load]).error
        phase = math.tau * np.arange(phases) / phases
        profile = Tabulated(tuple(phase), tuple(self.load / (loaded - unloaded)))
        names = ("max_stiffness", "stiffness_ratio", "contact_ratio")
        pair = self.pair.replace(**dict(zip(names, profile.ratios(), strict=True)))
        deviation = Harmonics.from_table(phase, -unloaded, harmonics)
        return OneDegreePair(pair=pair, profile=profile, deviation=deviation)

    @property
    def _options(self) -> dict[str, Any]:
        """Keyword arguments of `pairs_at` that follow from the fields of the model."""
        names = ("stiffness", "coupling", "deviation", "pitch_errors", "load")
        return {name: getattr(self, name) for name in names} | {"corners": self.corner_contact}

    def _pairs(
        self, pitches: np.ndarray, middle: np.ndarray | None = None, inside: Any = None
    ) -> ToothPairs:
        """Return the pairs of teeth in mesh at m phases `pitches`, in base pitches, shape (m,).

        `middle`, shape (m,), are phases that decide which pairs are in mesh, by default `pitches`;
        `inside`, shape (m, k), is whether each pair can touch, by default computed.
        """
        return pairs_at(self.drawing, pitches, middle, inside, **self._options)

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
            Forces in N of the k pairs; the first pair is the one that came into mesh last.
        """
        pairs = self._pairs(np.asarray(phase, float) / math.tau + self._shift)
        return pairs.forces_at(np.asarray(displacement, float) * self.static_deflection).force[0]

    @property
    def repeats(self) -> int:
        """Number of mesh periods after which the pitch errors repeat."""
        return len(self.pitch_errors)

    @cached_property
    def _corner_zone(self) -> Any:
        """Lengths of corner contact before and behind the path of contact in base pitches."""
        return corner_zones(self.drawing, self.corner_contact, self.load, self.pitch_errors)

    def _breaks(self) -> np.ndarray:
        """Return phases in [0, 1) base pitches between which gaps and compliances are linear."""
        mesh = self.drawing
        line_count = face_slices(mesh, self.repeats).lines
        if line_count:  # A helical face, given at equal distances.
            line_count *= math.ceil(self.phases / MIN_LINES)
            return (self._shift + np.arange(line_count) / line_count) % 1.0
        start, end = mesh.path
        kinks = [start, end]  # positions on the path of contact, m
        for gear, tip in ((mesh.pinion, end), (mesh.wheel, start)):
            if gear.tip_relief is not None:
                inward = start + end - 2.0 * tip
                kinks.append(tip + math.copysign(gear.tip_relief.length, inward))
        for table in (self.deviation, self.stiffness):
            if isinstance(table, PathTable):
                kinks += [position for position in table.position if start < position < end]
        equal_intervals = np.arange(self.phases) / self.phases
        breaks = [(np.array(kinks) - start) / mesh.base_pitch, equal_intervals]
        if any(self._corner_zone):
            before, behind = (
                np.linspace(0.0, length, _INTERVALS_OF_A_ZONE + 1) for length in self._corner_zone
            )
            breaks += [0.0 - before, mesh.contact_ratio + behind]
        return np.append(np.concatenate(breaks), self._shift) % 1.0

    @property
    def _shift(self) -> float:
        """Base pitches from the start of contact to phase 0, where most pairs touch."""
        return (self.drawing.contact_ratio % 1.0) / 2.0

    def _pair_numbers(self, pitches: np.ndarray) -> np.ndarray:
        """Return the number of the last pair of teeth in mesh at phases in base pitches."""
        return np.floor(
            pitches + self._corner_zone[0] + face_slices(self.drawing, self.repeats).reach
        )

    @cached_property
    def tables(self) -> tuple[ToothPairSystem, float]:
        """The `ToothPairSystem` without tuning and damping, and its largest stiffness.

        Segments lie between neighbouring breaks of the whole period, from phase 0 on.
        """
        repeats, shift = self.repeats, self._shift
        pitches = np.sort((np.arange(repeats)[:, None] + self._breaks()).ravel())
        pitches = pitches[np.diff(pitches, prepend=-1.0) > SAME_PLACE]
        pitches = pitches[pitches < repeats - SAME_PLACE]
        first = int(np.searchsorted(pitches, shift - SAME_PLACE))
        pitches = np.concatenate([pitches[first:], pitches[:first] + repeats, [repeats + shift]])
        left, right = pitches[:-1], pitches[1:]
        middles = (left + right) / 2.0
        inside, on_path, ends = self._segments(left, middles, right)
        pair_numbers = self._pair_numbers(middles)
        lengths = math.tau * (right - left)
        left_laws, right_laws = (self._force_laws(end, on_path) for end in ends)
        force = _linear_laws(left_laws[0], right_laws[0], lengths)
        overlap = _linear_laws(left_laws[1], right_laws[1], lengths)
        smallest_gaps = [np.where(inside, end.gap, math.inf).min(-1) for end in ends]
        # Bit i of the number is set if pair i can touch.
        touchable_pairs = inside @ 2 ** np.arange(inside.shape[1])
        other_pairs = touchable_pairs != np.roll(touchable_pairs, 1)
        starts = math.tau * (pitches - shift)
        firsts = np.searchsorted(starts, math.tau * np.arange(repeats + 1) - 1e-9)
        system = ToothPairSystem(
            starts=starts,
            first_segment=firsts,
            renewed=other_pairs | (pair_numbers != np.roll(pair_numbers, 1)),
            inside=touchable_pairs,
            force=force,
            overlap=overlap,
            slip=(smallest_gaps[1] - smallest_gaps[0]) / lengths / self.static_deflection,
            damping=np.zeros(2),
            lower=-self.backlash_ratio,
            longest=0.0,
            tuning=0.0,
            repeats=repeats,
            closing=bool(-np.min(smallest_gaps) > self.backlash),
        )
        max_stiffness = max(force_law[..., 0].max() for force_law in (left_laws[0], right_laws[0]))
        return system, max_stiffness

    def _segments(
        self, left: np.ndarray, middles: np.ndarray, right: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, list[ToothPairs]]:
        """Return the pairs of teeth in mesh in p segments, up to k at a time.

        The segments are given by their ends and middles in base pitches, (p,) each. The result is
        (which pairs can touch, (p, k), which of them lie on their path of contact, (p, k), and the
        `ToothPairs` at the left and at the right ends).
        """
        mesh, pitches = self.drawing, np.concatenate([left, right])
        segment_middles = np.concatenate([middles] * 2)
        if mesh.overlap_ratio == 0.0:
            pairs = self._pairs(middles)
            inside = pairs.inside
            on_path = pairs.position == np.clip(pairs.position, *mesh.path)
            pairs = self._pairs(pitches, segment_middles, np.concatenate([inside] * 2))
            indices = np.arange(pitches.size)
        else:
            # Most segments start with the pairs at the end of the last one, computed only once.
            phases = np.column_stack([pitches, self._pair_numbers(segment_middles)])
            _, first, indices = np.unique(phases, axis=0, return_index=True, return_inverse=True)
            pairs = self._pairs(pitches[first], segment_middles[first])
        ends = [pairs.at_phases(at_end) for at_end in np.split(indices.reshape(-1), 2)]
        if mesh.overlap_ratio != 0.0:
            inside = on_path = ends[0].inside | ends[1].inside
        return inside, inside & on_path, [replace(end, inside=inside) for end in ends]

    def _force_laws(self, pairs: ToothPairs, on_path: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the dimensionless forces and overlaps of all 2^k sets of touching pairs of teeth.

        There are k pairs at each of m phases; `on_path`, shape (m, k), is whether a pair lies on
        its path of contact. The force at a displacement x is a x - b, with (a, b) of shape
        (m, 2^k + 1, 2), the last for the coast side. The overlap of the flanks of a pair is
        p x - r, with (p, r) of shape (m, 2^k, k, 2).
        """
        m, k = pairs.gap.shape
        force, overlap = np.zeros((m, 2**k + 1, 2)), np.zeros((m, 2**k, k, 2))
        for number in range(2**k):
            touching = [i for i in range(k) if number >> i & 1]
            possible = pairs.inside[:, touching].all(-1)
            if not possible.any():
                continue
            slope, offset = pairs.force_law(touching)
            law = np.stack([slope.sum(-1) / self.mean_stiffness, offset.sum(-1) / self.load], -1)
            force[possible, number] = law[possible]
            # The forces of the touching pairs displace the flanks of all pairs.
            compliance = pairs.compliance[:, :, touching]
            overlap[:, number, :, 0] = 1.0 - (compliance @ slope[..., None])[..., 0]
            distance = pairs.gap - (compliance @ offset[..., None])[..., 0]
            overlap[:, number, :, 1] = distance / self.static_deflection
            coast = on_path[:, touching].all(-1) & (on_path.sum(-1) == len(touching))
            force[coast, -1, 0] = law[coast, 0]
        if self.backlash < math.inf:
            force[:, -1, 1] = -self.backlash_ratio * force[:, -1, 0]
        return force, overlap

    def steps_per_period(self, tuning: float) -> float:
        """Return the minimum number of integration steps per mesh period."""
        system = self.system(tuning)
        return max(len(system.force) / self.repeats, math.tau / system.longest)

    @property
    def slowest_tuning(self) -> float:
        """Smallest tuning of a simulated duty point; below it, the motion is quasi-static."""
        zone_length = sum(self._corner_zone)
        share = min(max(zone_length / _USUAL_ZONE, 0.25), 1.0) if zone_length else 1.0
        return _QUASI_STATIC_TUNING * share * (1.0 if self.repeats == 1 else 10.0)

    def system(self, tuning: float) -> ToothPairSystem:
        """Return the force laws of the pairs of teeth for the engine at a tuning."""
        system, max_stiffness = self.tables
        damping = 2.0 * np.array([self.backlash_damping_ratio, self.damping_ratio]) / tuning
        longest = _MAX_STEP_ANGLE / (math.sqrt(max_stiffness) / tuning + damping.max())
        return system._replace(damping=damping, longest=longest, tuning=tuning)


def _linear_laws(left: np.ndarray, right: np.ndarray, lengths: np.ndarray) -> np.ndarray:
    """Return laws (slope, offset) of p segments as linear functions of phase, shape (p, ..., 4).

    `left` and `right`, shape (p, ..., 2), are the laws at both ends of segments with these lengths,
    (p,). The last axis is (slope, its rate, offset, its rate), as the engine expects it.
    """
    rates = (right - left) / lengths.reshape(-1, *[1] * (left.ndim - 1))
    return np.concatenate([left, rates], axis=-1)[..., [0, 2, 1, 3]]


def tooth_pairs_of(
    mesh: Mesh, *, stiffness: Any = None, options: dict | None = None, **arguments: Any
) -> LoadSharingPair:
    """Return the `LoadSharingPair` of drawn gears with a default stiffness method.

    The default is the energy method or, if a bore is too large for it, ISO 6336. From the options
    of the method only the coupling is used; `arguments` are the others of
    `LoadSharingPair.from_geometry`, such as torque and damping_ratio.
    """
    if stiffness is None:
        try:
            PairCompliance(mesh)
            stiffness = "energy"
        except ValueError:
            stiffness = "iso"
    options = options or {}
    checks.known("stiffness", options, _STIFFNESS_OPTIONS)
    if stiffness == "energy" and "coupling" in options:
        arguments["coupling"] = options["coupling"]
    return LoadSharingPair.from_geometry(mesh, stiffness=stiffness, **arguments)
