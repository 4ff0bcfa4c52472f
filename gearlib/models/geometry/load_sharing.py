"""How the pairs of teeth in mesh share the load: gaps, compliances, and the exact equilibrium.

With the displacement x along the line of action, the forces F_i of the pairs and their gaps g_i,

    x - g_i = sum_j Q_ij F_j  and  F_i > 0   of pairs that touch,
    x - g_i <= sum_j Q_ij F_j  and  F_i = 0  of the others,        sum F_i = F.

Without common bodies Q is diagonal and a pair carries c_i (x - g_i)+. Q is positive definite, so
one set of touching pairs fulfils all conditions at each phase and load: all sets are solved at
once, and the one that holds is taken. There is no iteration.

Without corner contact a pair touches between both ends of the path of contact only. With it the
corner of a tip also touches the mating flank before the start and behind the end, with the gap of
`corner_gap` and the compliance of the end of the path, so that no force jumps.

The pairs of a helical gear are averages over transverse slices of the face, each a spur gear that
is in mesh a little later than the last, linearized at the displacement under a load. From each of
`Face.lines` phases to the next all slices move on by as many, so that stiffness has no steps.

Sources: Harris, Proc. Inst. Mech. Eng. 172 (1958) 87-112; Q by the energy method.
"""

import itertools
import math
from dataclasses import dataclass, fields
from typing import Any, NamedTuple

import numpy as np

from gearlib import checks
from gearlib.models.geometry.gear import PathTable, inv
from gearlib.models.geometry.iso import pair_stiffness
from gearlib.models.geometry.mesh_stiffness import PairCompliance, compliance_matrix

#: Positions closer than this fraction of a base pitch count as equal.
SAME_PLACE = 1e-12
#: Slices of a helical face at least, fewest and most lines of a base pitch.
_SLICES, FEWEST_LINES, _MOST_LINES = 48, 48, 128
#: Slices at all phases together, some 0.4 s: where pitch errors make more, both are coarser.
_MOST_ROWS = 120_000
#: Largest number of pairs of teeth in mesh at once.
_MAX_PAIRS = 10
#: Largest gap at which a tip corner can touch, in deflections of one pair under the load.
MAX_CORNER_GAP = 6.0
#: Longest way on which a corner may touch, in base pitches.
_LONGEST_APPROACH = 0.45
#: Iterations of Newton's method that find the displacement of a helical mesh, and its tolerance.
_NEWTON_STEPS, _NEWTON_TOLERANCE = 50, 1e-12


@dataclass(frozen=True)
class Sharing:
    """Equilibrium under loads: l loads, m phases, k pairs."""

    error: np.ndarray  #: x, m, shape (l, m)
    force: np.ndarray  #: of each pair, N, shape (l, m, k)
    touching: np.ndarray  #: bool, shape (l, m, k)
    stiffness: np.ndarray  #: dF_i/dx of each pair, N/m, shape (l, m, k)


@dataclass(frozen=True)
class ToothPairs:
    """The pairs of teeth in mesh at m phases, k at most; pair 0 is the last that came into mesh."""

    pitches: np.ndarray  #: base pitches since pair 0 of the first mesh period, shape (m,)
    position: np.ndarray  #: on the path of contact, m, shape (m, k)
    inside: np.ndarray  #: bool, whether between its ends, shape (m, k)
    compliance: np.ndarray  #: Q, m/N, shape (m, k, k)
    gap: np.ndarray  #: g, m, shape (m, k)

    def at_phases(self, rows):
        """Return the pairs at some of the phases."""
        return ToothPairs(*(getattr(self, field.name)[rows] for field in fields(self)))

    def carried_by(self, pairs, rows=slice(None)):
        """Return (a, b) of a set of pairs that touch, shape (m, p): their forces are a x - b."""
        inverse = np.linalg.inv(self.compliance[rows][:, pairs][:, :, pairs])
        return inverse.sum(-1), (inverse @ self.gap[rows][:, pairs, None])[..., 0]

    def share(self, loads):
        """Return the `Sharing` under loads >= 0 in N, shape (l,)."""
        loads = np.asarray(loads, float)[:, None]

        def displacement(rows, rise, back):
            return (loads + back.sum(-1)) / rise.sum(-1)

        return self._equilibrium(len(loads), 1, displacement)

    def forces_at(self, displacement):
        """Return the `Sharing` at displacements in m, shape (m,); its first axis has length 1."""
        return self._equilibrium(1, 0, lambda rows, rise, back: displacement[None, rows])

    def _equilibrium(self, count: int, least: int, displacement) -> Sharing:
        """Return the `Sharing` of the sets of at least so many pairs that meet all conditions.

        `displacement` gives that of phases, by their numbers and `carried_by` of a set.
        """
        m, k = self.gap.shape
        error, worst = np.zeros((count, m)), np.full((count, m), math.inf)
        force, stiffness = np.zeros((count, m, k)), np.zeros((count, m, k))
        touching = np.zeros((count, m, k), bool)
        diagonal = np.einsum("mii->mi", self.compliance)
        sizes = range(least, k + 1)
        combinations = (itertools.combinations(range(k), size) for size in sizes)
        for pairs in map(list, itertools.chain.from_iterable(combinations)):
            rows = np.flatnonzero(self.inside[:, pairs].all(-1))
            if not rows.size:
                continue
            rise, back = self.carried_by(pairs, rows)
            x = displacement(rows, rise, back)
            forces = np.zeros((count, rows.size, k))
            forces[..., pairs] = rise * x[..., None] - back
            # The pull that pairs in contact would need, the overlap of the others: both <= 0.
            wrong = x[..., None] - self.gap[rows] - _displacements(self.compliance[rows], forces)
            wrong[..., pairs] = -(diagonal[rows] * forces)[..., pairs]
            most = np.where(self.inside[rows], wrong, -math.inf).max(-1)
            better = most < worst[:, rows]
            load, phase = np.nonzero(better)
            at = load, rows[phase]
            worst[at], error[at], force[at] = most[better], x[better], forces[better]
            touching[at] = np.isin(np.arange(k), pairs)
            slopes = np.zeros((rows.size, k))
            slopes[:, pairs] = rise
            stiffness[at] = slopes[phase]
        return Sharing(error, np.maximum(force, 0.0), touching, stiffness)

    def overlap(self, sharing):
        """Return the overlap of the flanks of each pair beside the others, m, shape (l, m, k).

        Of a pair that touches it is > 0, of others the negative distance of their flanks.
        """
        diagonal = np.einsum("mii->mi", self.compliance)
        beside = _displacements(self.compliance, sharing.force) - diagonal * sharing.force
        overlap = sharing.error[..., None] - self.gap - beside
        # Without load pairs touch that do not overlap: the sign tells.
        least = np.finfo(float).tiny
        return np.where(sharing.touching, np.maximum(overlap, least), np.minimum(overlap, -least))


def _displacements(compliance, forces):
    """Return Q F, shape (..., k)."""
    return np.einsum("...ij,...j->...i", compliance, forces)


def tooth_pairs(mesh, phases, *, pitch_errors=None, **options):
    """Return the `ToothPairs` at equal phases; further arguments are those of `pairs_at`."""
    phases = checks.integer("phases", phases, 8, 100_000)
    # The mesh phase is 0 in the middle of the segment with the most pairs.
    first = (mesh.contact_ratio - math.floor(mesh.contact_ratio)) / 2.0
    pitch_errors = checked_errors(mesh, pitch_errors)
    pitches = first + np.arange(pitch_errors.size * phases) / phases
    return pairs_at(mesh, pitches, pitch_errors=pitch_errors, **options)


class Options(NamedTuple):
    """Options of pairs of teeth; the first four are those of `Mesh.transmission_error`."""

    stiffness: Any = "energy"
    coupling: float = 1.0
    deviation: PathTable | None = None
    pitch_errors: Any = None
    corners: bool = False  #: whether corners of tips touch beyond the path of contact
    load: float | None = None  #: N, that of corners and of helical gears


def pairs_at(mesh, pitches, middle=None, inside=None, **options):
    """Return the `ToothPairs` of a mesh; further arguments are `Options`.

    `pitches`, shape (m,), are base pitches since the first pair reached the start of its path of
    contact. The pairs in mesh are those at `middle`, by default at `pitches`; `inside`, shape
    (m, k), states them if they are known.
    """
    stiffness, coupling, deviation, pitch_errors, corners, load = Options(**options)
    possible = isinstance(deviation, PathTable | None)
    checks.require(possible, "deviation", deviation, "a PathTable")
    errors, overlap = checked_errors(mesh, pitch_errors), mesh.overlap_ratio
    words = "0, load sharing along the path of contact is that of spur gears"
    possible = overlap == 0.0 or load is not None
    checks.require(possible, "helix_angle", mesh.pinion.helix_angle, words)
    before, behind = zone_of_contact(mesh, corners, load, errors)
    face = face_of(mesh, errors.size)
    begun = np.floor((pitches if middle is None else middle) + before + face.reach)
    count = math.floor(mesh.contact_ratio + before + behind + 2.0 * face.reach) + 1
    words = f"such that at most {_MAX_PAIRS} pairs of teeth are in mesh"
    checks.require(count <= _MAX_PAIRS, "total contact ratio", mesh.total_contact_ratio, words)
    slots = np.arange(count)
    number = begun.astype(int)[:, None] - slots
    pieces = len(face.shares)
    since = ((pitches - begun)[:, None] + face.places)[..., None] + slots  # (m, slices, k)
    there = (since >= -before) & (since < mesh.contact_ratio + behind)
    slices, there = since.reshape(-1, count), there.reshape(-1, count)
    if overlap == 0.0 and inside is not None:
        there = inside
    position = mesh.path[0] + slices * mesh.base_pitch
    # All but the errors repeats with every pitch.
    place = np.round(slices[:, 0] / SAME_PLACE).astype(int) * 2**count + there @ 2**slots
    _, first, each = np.unique(place, return_index=True, return_inverse=True)
    on_path = np.clip(position[first], *mesh.path)
    # With corners more pairs are inside; a body that changed with their number would be a jump.
    together = math.floor(mesh.contact_ratio) + 1 if corners else there[first].sum(-1)
    compliance = _compliance(mesh, on_path, stiffness, coupling, together)
    gap = relief_gap(mesh, on_path)
    if deviation is not None:
        gap = gap + deviation.at(on_path)
    if corners:
        gap = gap + corner_gap(mesh, position[first])
    else:
        position = np.clip(position, *mesh.path)
    gap = gap[each] + np.repeat(errors[number % errors.size], pieces, axis=0)
    if overlap == 0.0:
        return ToothPairs(pitches, position, there, compliance[each], gap)
    force, slopes, x = _over_face(face.shares, compliance[each], there, gap, load)
    # A pair about to touch has no stiffness yet; a small one keeps the compliance finite.
    regular = np.maximum(slopes, 1e-9 * slopes.sum(-1, keepdims=True))
    return ToothPairs(
        pitches,
        position.reshape(-1, pieces, count).mean(axis=1),
        force > 0.0 if inside is None else inside,
        np.eye(count) / regular[..., None],
        x[:, None] - force / regular,
    )


class Face(NamedTuple):
    """How a face is cut into n slices; that of a spur gear is one slice."""

    shares: np.ndarray  #: of the width, shape (n,); slices at the edges are narrower
    places: np.ndarray  #: how many base pitches later they are in mesh, shape (n,)
    lines: int  #: equal parts of a base pitch, each a whole number of slices long; 0 of spur gears
    reach: float  #: base pitches by which a pair comes earlier than the middle of its face


def face_of(mesh, periods):
    """Return the `Face` of a mesh whose pairs of teeth repeat after some mesh periods."""
    overlap = mesh.overlap_ratio
    if overlap == 0.0:
        return Face(np.ones(1), np.zeros(1), 0, 0.0)
    lines = min(max(math.ceil(_SLICES / overlap), FEWEST_LINES), _MOST_LINES)
    rows = periods * lines * max(_SLICES, overlap * lines)
    coarser = max(1.0, math.sqrt(rows / _MOST_ROWS))
    lines = max(8, round(lines / coarser))
    per_pitch = lines * max(1, round(_SLICES / coarser / overlap / lines))
    count = math.ceil(overlap * per_pitch)
    shares = np.full(count, 1.0 / (overlap * per_pitch))
    shares[[0, -1]] = (1.0 - shares[1:-1].sum()) / 2.0
    places = (np.arange(count) - (count - 1) / 2.0) / per_pitch
    return Face(shares, places, lines, (overlap + 1.0 / lines) / 2.0)


def _over_face(shares, compliance, inside, gap, load: float):
    """Return forces and stiffnesses of pairs, shape (m, k), and the displacement under a load.

    In each step of Newton's method a pair of a slice begins to touch or parts where its force or
    its overlap has the wrong sign. Compliances of the slices have the shape (m n, k, k).
    """
    count, touching = gap.shape[1], inside

    def over_face(values):
        return shares @ values.reshape(-1, len(shares), count)

    diagonal = np.einsum("mii->mi", compliance)
    x = np.full(len(gap) // len(shares), load * compliance.max() + gap[inside].max())
    for _ in range(_NEWTON_STEPS):
        way = np.repeat(x, len(shares))[:, None] - gap
        both = touching[:, :, None] & touching[:, None, :]
        inverse = np.linalg.inv(np.where(both, compliance, np.eye(count))) * both
        force = _displacements(inverse, way)
        overlap = way - _displacements(compliance, force)
        wrong = inside * np.where(touching, -diagonal * force, overlap)
        total, stiffness = over_face(force), over_face(np.einsum("mij->mi", inverse))
        step = (total.sum(-1) - load) / stiffness.sum(-1)
        if max(np.abs(step).max(), wrong.max()) <= _NEWTON_TOLERANCE * np.abs(x).max():
            return total, stiffness, x
        x, touching = x - step, touching ^ (wrong > 0.0)
    raise RuntimeError(f"no displacement of a helical mesh in {_NEWTON_STEPS} steps")


def zone_of_contact(mesh, corners, load, errors):
    """Return the base pitches on which pairs may touch before and behind the path of contact.

    Corners touch where their gap is below `MAX_CORNER_GAP` deflections of one pair.
    """
    if not corners:
        return 0.0, 0.0
    limit = MAX_CORNER_GAP * load / pair_stiffness(mesh) + np.ptp(errors)
    beyond = np.linspace(0.0, _LONGEST_APPROACH, 201)
    (start, end), ways = mesh.path, beyond * mesh.base_pitch
    gaps = (corner_gap(mesh, place) for place in (start - ways, end + ways))
    # The gap grows with the square of the distance.
    return tuple(float(np.interp(math.sqrt(limit), np.sqrt(gap), beyond)) for gap in gaps)


def corner_gap(mesh, position):
    """Return the gap of tip corners beyond both ends of the path of contact, m; 0 between them.

    Before the start the corner of the wheel's tip approaches the flank of the pinion, behind the
    end that of the pinion leaves the flank of the wheel. A position is where the pair would touch
    if its involutes went on, the gap along the line of action.
    """
    (start, end), far = mesh.path, _LONGEST_APPROACH * mesh.base_pitch
    entering = _gap_to_corner(mesh, "pinion", np.clip(position, start - far, start))
    leaving = _gap_to_corner(mesh, "wheel", np.clip(position, end, end + far))
    return np.where(position < start, entering, 0.0) + np.where(position > end, leaving, 0.0)


def _gap_to_corner(mesh, name: str, position):
    """Return the gap between the flank of the pinion or wheel and the other's tip corner, m."""
    sign, angle = mesh.wheel.sign, mesh.working_pressure_angle
    flank, corner, way = mesh.pinion, mesh.wheel, 1
    if name == "wheel":
        flank, corner, way = corner, flank, -sign
    base = flank.base_diameter / 2.0
    turned = way * (position - mesh.pitch_point) / base  # from contact at the pitch point
    centre = mesh.centre_distance * (1 if sign == 1 else -flank.sign)
    tip = corner.tip_diameter / 2.0
    tip_angle = math.acos(corner.base_diameter / corner.tip_diameter)
    psi = -sign * turned * flank.teeth / corner.teeth + inv(angle) - inv(tip_angle)
    x, y = centre - sign * tip * np.cos(psi), -sign * tip * np.sin(psi)
    flank_angle = np.arccos(base / np.hypot(x, y))
    involute = np.tan(flank_angle) - flank_angle
    return flank.sign * base * (np.arctan2(y, x) - (turned + inv(angle) - involute))


def checked_errors(mesh, values=None):
    """Return pitch errors, by default those of the gears, as an array, shape (n,), n > 0."""
    if values is None:
        return np.array(mesh.pitch_errors)
    if np.ndim(values) != 1 or not np.size(values):
        raise checks.refusal("pitch_errors", values, "a sequence of at least one number")
    return np.array(checks.finite("pitch_errors", values))


def relief_gap(mesh, position):
    """Return the gap that the tip reliefs of both gears leave at positions of the path, m."""
    start, end = mesh.path
    gap = np.zeros(np.shape(position))
    for gear, from_tip in ((mesh.pinion, end - position), (mesh.wheel, position - start)):
        if gear.tip_relief is not None:
            gap = gap + gear.tip_relief.gap(from_tip)
    return gap


def _compliance(mesh, position, stiffness, coupling, together):
    """Return the compliances Q of pairs, of which `together` touch, shape (m, k, k)."""
    coupling = checks.number("coupling", coupling, "from 0 to 1", lambda v: 0.0 <= v <= 1.0)
    identity = np.eye(position.shape[1])
    if isinstance(stiffness, PathTable):
        values = stiffness.at(position)
        if not values.min() > 0.0:
            words = "is not allowed: it must be > 0 all along the path of contact"
            raise ValueError(f"stiffness = {values.min():.6g} N/m {words}")
        return identity / values[..., None]
    if stiffness == "energy":
        return compliance_matrix(PairCompliance(mesh), position, np.ones(position.shape), coupling)
    checks.require(stiffness == "iso", "stiffness", stiffness, "'iso', 'energy' or a PathTable")
    # n pairs in mesh are (0.25 + 0.75 n) c' together if they share a body of 1 / (1 + 3 n) c'.
    single = 1.0 / pair_stiffness(mesh)
    count = np.broadcast_to(together, len(position))[:, None, None]
    body = single * coupling / (1.0 + 3.0 * count)
    return (single - body) * identity + body
