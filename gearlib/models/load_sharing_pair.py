"""A gear pair whose pairs of teeth touch one by one, each with its own gap and compliance.

    m x'' + k (x' - e') + sum_i F_i(x, tau) = F,

with the forces of `gearlib.models.geometry.load_sharing` at any displacement x: pairs that touch
share Q F_i = x - g_i, the others have none. e(tau) is the least gap, where the flanks touch without
load; x - e is the relative displacement of the flanks that `OneDegreePair` calls y. The coast side
touches at x = -backlash; there all pairs on their path of contact carry, without gaps.

Gaps and compliances are straight lines between phases, the ends of the path, the starts of the
reliefs and the points of tables, so linear reliefs of pairs of constant stiffness are exact. Where
corners of tips touch or the slices of a helical face come and go the lines are shorter.
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
    FEWEST_LINES,
    SAME_PLACE,
    checked_errors,
    face_of,
    pairs_at,
    tooth_pairs,
    zone_of_contact,
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

#: x^20 / 20! = 1e-17 at x = 1.18: natural frequency times the longest step.
_CONVERGED = 1.18
#: Options of the stiffness of a drawing, of which pairs of teeth take the coupling.
_STIFFNESS_OPTIONS = ("torque", "application_factor", "samples", "coupling", "hertz")
#: Tuning at which inertia adds less than 1 % to the load, and base pitches on which corners touch
#: before and behind the path there; on shorter ones it is lower, down to a quarter.
_SLOWEST, _USUAL_ZONE = 2e-4, 0.05
#: Lines between the phases at which a pair begins to touch and is on its path.
_LINES_OF_A_ZONE = 32


@documented
@dataclass(frozen=True, kw_only=True)
class LoadSharingPair(WithPair):
    """A gear pair whose load is shared by pairs of teeth with tip relief and errors; immutable.

    Stiffness, coupling, deviation and pitch_errors are those of
    `gearlib.geometry.Mesh.transmission_error`. Helical gears are cut into slices, whose forces are
    linearized at the displacement under the load.

    Raises
    ------
    ValueError
        If a value is not allowed; the message names parameter, value and range.
    """

    pair: Annotated[
        GearPair,
        Instance((GearPair,)),
        "Mass, load, damping, backlash and scales; the stiffness is that of the drawing",
    ]
    drawing: Annotated[
        Mesh, Instance((Mesh,), "a gearlib.geometry.Mesh"), "Both gears with their tip reliefs"
    ]
    phases: Annotated[
        int,
        Integer(8, 100_000),
        "Equal parts of a mesh period between which gaps and compliances are straight lines",
    ] = 32
    stiffness: Any = "energy"
    coupling: Annotated[
        float, Number("1", least=0, most=1), "How far pairs of teeth share the body"
    ] = 1.0
    deviation: PathTable | None = None
    pitch_errors: tuple | None = None
    corner_contact: Annotated[
        bool, TRUTH, "Whether corners of tips touch before and behind the path of contact"
    ] = True

    defaults = {"pitch_errors": lambda model: model.drawing.pitch_errors}
    propagators = {"exact": "taylor.teeth"}
    piecewise_linear = False
    damped = property(lambda model: model.pair.damped, doc="`GearPair.damped` of the pair.")
    references = (
        "Harris: Proc. Inst. Mech. Eng. 172 (1958) 87-112; "
        "Hortel, Skuderova: Engineering Mechanics 14 (2007) 91-104"
    )

    def __post_init__(self):
        super().__post_init__()
        errors = tuple(checked_errors(self.drawing, self.pitch_errors).tolist())
        object.__setattr__(self, "pitch_errors", errors)
        self._pairs(np.zeros(1))

    @classmethod
    def from_geometry(cls, mesh, *, stiffness="energy", coupling=1.0, **options):
        """Return the pair of two drawn gears, its scales from the same mesh stiffness.

        Parameters
        ----------
        mesh : gearlib.geometry.Mesh
        stiffness : {"energy", "iso"}, default "energy"
            A table needs a `pair` of one's own.
        coupling : float, default 1
            How far pairs of teeth share the body.
        **options
            Fields of the class: phases, deviation, pitch_errors, corner_contact; and arguments of
            `GearPair.from_geometry` such as torque and damping_ratio.
        """
        checks.one_of("stiffness", stiffness, ("energy", "iso"))
        fields = {x: options.pop(x) for x in cls.__dataclass_fields__ if x in options}
        of_stiffness = {"coupling": coupling} if stiffness == "energy" else {}
        pair = GearPair.from_geometry(mesh, stiffness=stiffness, options=of_stiffness, **options)
        return cls(pair=pair, drawing=mesh, stiffness=stiffness, coupling=coupling, **fields)

    def at_load(self, *, phases=128, harmonics=24):
        """Return the `OneDegreePair` with the stiffness and the deviation of the pair's load.

        Its deviation is -e(tau), the error without load, and its stiffness F / (x - e), so that it
        has the same static transmission error at this load, another one at others.

        Parameters
        ----------
        phases : int, default 128
            Phases of the stiffness, between which it is linear; >= 8.
        harmonics : int, default 24
            Harmonics of the deviation; < phases / 2.

        Raises
        ------
        ValueError
            If successive pairs of teeth differ.
        """
        if self.repeats > 1:
            words = "is not allowed: it must have one value, where one mesh period stands for all"
            raise ValueError(f"pitch_errors = {self.pitch_errors!r} {words}")
        pairs = tooth_pairs(self.drawing, phases, **self._options)
        bare, loaded = pairs.share([0.0, self.load]).error
        phase = math.tau * np.arange(phases) / phases
        profile = Tabulated(tuple(phase), tuple(self.load / (loaded - bare)))
        names = ("max_stiffness", "stiffness_ratio", "contact_ratio")
        pair = self.pair.replace(**dict(zip(names, profile.ratios(), strict=True)))
        deviation = Harmonics.from_table(phase, -bare, harmonics)
        return OneDegreePair(pair=pair, profile=profile, deviation=deviation)

    @property
    def _options(self):
        """Options of `pairs_at`."""
        names = ("stiffness", "coupling", "deviation", "pitch_errors", "load")
        return {name: getattr(self, name) for name in names} | {"corners": self.corner_contact}

    def _pairs(self, pitches, middle=None, inside=None):
        """Return the `ToothPairs` at base pitches, see `pairs_at`."""
        return pairs_at(self.drawing, pitches, middle, inside, **self._options)

    def tooth_forces(self, phase, displacement):
        """Return the forces that pairs of teeth carry on the drive side.

        Parameters
        ----------
        phase : array_like, shape (m,)
            Mesh phase, rad.
        displacement : array_like, shape (m,)
            As `gearlib.simulate` returns it, in static deflections.

        Returns
        -------
        numpy.ndarray, shape (m, k)
            N; the first pair is the last that came into mesh.
        """
        pairs = self._pairs(np.asarray(phase, float) / math.tau + self._shift)
        return pairs.forces_at(np.asarray(displacement, float) * self.static_deflection).force[0]

    @property
    def repeats(self):
        """Mesh periods after which the pairs of teeth repeat."""
        return len(self.pitch_errors)

    @cached_property
    def _zone(self):
        """Base pitches on which corners may touch before and behind the path of contact."""
        return zone_of_contact(self.drawing, self.corner_contact, self.load, self.pitch_errors)

    def _cuts(self):
        """Return base pitches, from 0 to 1, between which gaps and compliances are straight."""
        mesh = self.drawing
        if lines := face_of(mesh, self.repeats).lines:
            lines *= math.ceil(self.phases / FEWEST_LINES)
            return (self._shift + np.arange(lines) / lines) % 1.0
        start, end = mesh.path
        corners = [start, end]
        for gear, tip in ((mesh.pinion, end), (mesh.wheel, start)):
            if gear.tip_relief is not None:
                corners.append(tip + math.copysign(gear.tip_relief.length, start + end - 2.0 * tip))
        for table in (self.deviation, self.stiffness):
            if isinstance(table, PathTable):
                corners += [position for position in table.position if start < position < end]
        cuts = [(np.array(corners) - start) / mesh.base_pitch, np.arange(self.phases) / self.phases]
        ends = (-1.0, 0.0, self._zone[0]), (1.0, mesh.contact_ratio, self._zone[1])
        for sign, end_of_path, beyond in ends if any(self._zone) else ():
            cuts.append(end_of_path + sign * np.linspace(0.0, beyond, _LINES_OF_A_ZONE + 1))
        return np.append(np.concatenate(cuts), self._shift) % 1.0

    @property
    def _shift(self):
        """Base pitches at phase 0, in the middle of the segment with the most pairs."""
        return (self.drawing.contact_ratio % 1.0) / 2.0

    def _begun(self, pitches):
        """Return how many pairs have come into mesh."""
        return np.floor(pitches + self._zone[0] + face_of(self.drawing, self.repeats).reach)

    @cached_property
    def tables(self):
        """The `ToothPairSystem` without tuning and damping, and its largest stiffness."""
        repeats, shift = self.repeats, self._shift
        pitches = np.sort((np.arange(repeats)[:, None] + self._cuts()).ravel())
        pitches = pitches[np.diff(pitches, prepend=-1.0) > SAME_PLACE]
        pitches = pitches[pitches < repeats - SAME_PLACE]
        first = int(np.searchsorted(pitches, shift - SAME_PLACE))
        pitches = np.concatenate([pitches[first:], pitches[:first] + repeats, [repeats + shift]])
        left, right = pitches[:-1], pitches[1:]
        between = (left + right) / 2.0
        inside, on_path, ends = self._segments(left, between, right)
        begun = self._begun(between)
        lengths = math.tau * (right - left)
        lines = [self._laws(end, on_path) for end in ends]
        force, overlap = (
            np.concatenate([a, (b - a) / lengths.reshape(-1, *[1] * (a.ndim - 1))], axis=-1)
            for a, b in zip(*lines, strict=True)
        )
        # In the order of the columns of `gearlib.engines.taylor.teeth`.
        force, overlap = force[..., [0, 2, 1, 3]], overlap[..., [0, 2, 1, 3]]
        least = [np.where(inside, end.gap, math.inf).min(-1) for end in ends]
        members = inside @ 2 ** np.arange(inside.shape[1])
        starts = math.tau * (pitches - shift)
        firsts = np.searchsorted(starts, math.tau * np.arange(repeats + 1) - 1e-9)
        system = ToothPairSystem(
            starts=starts,
            first_segment=firsts,
            renewed=(members != np.roll(members, 1)) | (begun != np.roll(begun, 1)),
            inside=members,
            force=force,
            overlap=overlap,
            slip=(least[1] - least[0]) / lengths / self.static_deflection,
            damping=np.zeros(2),
            lower=-self.backlash_ratio,
            longest=0.0,
            tuning=0.0,
            repeats=repeats,
            closing=bool(-np.min(least) > self.backlash),
        )
        return system, max(line[0][..., 0].max() for line in lines)

    def _segments(self, left, between, right):
        """Return which pairs may touch in segments, which are on their path, pairs at both ends."""
        mesh, pitches = self.drawing, np.concatenate([left, right])
        middle = np.concatenate([between] * 2)
        if mesh.overlap_ratio == 0.0:
            pairs = self._pairs(between)
            inside = pairs.inside
            on_path = pairs.position == np.clip(pairs.position, *mesh.path)
            pairs = self._pairs(pitches, middle, np.concatenate([inside] * 2))
            ends = [pairs.at_phases(rows) for rows in np.split(np.arange(pitches.size), 2)]
        else:
            # Most segments start with the pairs with which the last one ends.
            same = np.column_stack([pitches, self._begun(middle)])
            _, first, each = np.unique(same, axis=0, return_index=True, return_inverse=True)
            pairs = self._pairs(pitches[first], middle[first])
            ends = [pairs.at_phases(rows) for rows in np.split(each.reshape(-1), 2)]
            inside = on_path = ends[0].inside | ends[1].inside
        return inside, inside & on_path, [replace(end, inside=inside) for end in ends]

    def _laws(self, pairs, on_path):
        """Return (a, b) of all sets, shape (p, sets + 1, 2), and (p, r), shape (p, sets, k, 2)."""
        m, k = pairs.gap.shape
        force, overlap = np.zeros((m, 2**k + 1, 2)), np.zeros((m, 2**k, k, 2))
        for number in range(2**k):
            touching = [i for i in range(k) if number >> i & 1]
            rows = pairs.inside[:, touching].all(-1)
            if not rows.any():
                continue
            rise, back = pairs.carried_by(touching)
            law = np.stack([rise.sum(-1) / self.mean_stiffness, back.sum(-1) / self.load], -1)
            force[rows, number] = law[rows]
            # By how much the forces of the others move the flanks of a pair.
            yielding = pairs.compliance[:, :, touching]
            overlap[:, number, :, 0] = 1.0 - (yielding @ rise[..., None])[..., 0]
            distance = pairs.gap - (yielding @ back[..., None])[..., 0]
            overlap[:, number, :, 1] = distance / self.static_deflection
            coast = on_path[:, touching].all(-1) & (on_path.sum(-1) == len(touching))
            force[coast, -1, 0] = law[coast, 0]
        if self.backlash < math.inf:
            force[:, -1, 1] = -self.backlash_ratio * force[:, -1, 0]
        return force, overlap

    def steps_per_period(self, tuning):
        """Return how many steps a mesh period takes at least."""
        system = self.system(tuning)
        return max(len(system.force) / self.repeats, math.tau / system.longest)

    @property
    def slowest_tuning(self):
        """Tuning below which the duty point is that at it; higher where pitch errors repeat."""
        share = min(max(sum(self._zone) / _USUAL_ZONE, 0.25), 1.0) if any(self._zone) else 1.0
        return _SLOWEST * share * (1.0 if self.repeats == 1 else 10.0)

    def system(self, tuning):
        """Return the `ToothPairSystem` at one tuning."""
        system, stiffest = self.tables
        damping = 2.0 * np.array([self.backlash_damping_ratio, self.damping_ratio]) / tuning
        longest = _CONVERGED / (math.sqrt(stiffest) / tuning + damping.max())
        return system._replace(damping=damping, longest=longest, tuning=tuning)


def tooth_pairs_of(mesh, *, stiffness=None, options=None, **load):
    """Return the `LoadSharingPair` of drawn gears.

    The stiffness is by default that of the energy method, or of ISO 6336 where a bore is too large
    for it. Of its options pairs of teeth take the coupling; `load` are the other arguments of
    `LoadSharingPair.from_geometry`.
    """
    if stiffness is None:
        try:
            PairCompliance(mesh)
            stiffness = "energy"
        except ValueError:
            stiffness = "iso"
    checks.known("stiffness", options or {}, _STIFFNESS_OPTIONS)
    if stiffness == "energy" and "coupling" in (options or {}):
        load["coupling"] = options["coupling"]
    return LoadSharingPair.from_geometry(mesh, stiffness=stiffness, **load)
