"""Load sharing of the pairs of teeth in mesh: gaps, compliances and exact equilibrium.

With the displacement x along the line of action, the forces F_i of the pairs and their gaps g_i,

    x - g_i = sum_j Q_ij F_j  and  F_i > 0   of pairs that touch,
    x - g_i <= sum_j Q_ij F_j  and  F_i = 0  of the others,        sum F_i = F.

Without common bodies Q is diagonal and a pair carries c_i max(x - g_i, 0). Q is positive definite,
so exactly one set of touching pairs satisfies all conditions at each phase and load. All sets are
solved at once, without iteration, and the set that satisfies the conditions is taken.

Without corner contact, pairs touch only on the path of contact. With corner contact, the corner of
a tip also touches the mating flank before the start and behind the end of the path, with the gap of
`corner_gap` and the compliance at the end of the path, so that no force jumps.

The pairs of a helical gear are averages over transverse slices of the face, linearized at the
displacement under a load. Each slice is a spur gear that meshes a little later than the slice
before. Between two of the `Face.lines` phases all slices move on by the same whole number, so that
the stiffness has no steps.

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
#: Least number of slices of a helical face, and limits of the number of phases in a base pitch.
_MIN_SLICES, MIN_LINES, _MAX_LINES = 48, 48, 128
#: Largest number of slices at all phases, which take 0.4 s; with more, slices become wider.
_MAX_ROWS = 120_000
#: Largest number of pairs of teeth in mesh at once.
_MAX_PAIRS = 10
#: Largest gap at which a tip corner can touch, in deflections of one pair under the load.
MAX_CORNER_GAP = 6.0
#: Largest distance from the path of contact at which a corner can touch, in base pitches.
_MAX_APPROACH = 0.45
#: Largest number of Newton steps for the displacement of a helical mesh, and their tolerance.
_MAX_NEWTON_STEPS, _NEWTON_TOLERANCE = 50, 1e-12


@dataclass(frozen=True)
class Sharing:
    """Equilibrium of k pairs of teeth under l loads at m phases."""

    error: np.ndarray  #: displacement x, the transmission error, m, shape (l, m)
    force: np.ndarray  #: force of each pair, N, shape (l, m, k)
    touching: np.ndarray  #: whether each pair touches, bool, shape (l, m, k)
    stiffness: np.ndarray  #: dF_i/dx of each pair, N/m, shape (l, m, k)


@dataclass(frozen=True)
class ToothPairs:
    """At most k pairs of teeth in mesh at m phases; pair 0 is the last that came into mesh."""

    pitches: np.ndarray  #: base pitches since pair 0 of the first mesh period, shape (m,)
    position: np.ndarray  #: position on the path of contact, m, shape (m, k)
    inside: np.ndarray  #: whether a pair can touch, bool, shape (m, k)
    compliance: np.ndarray  #: compliance matrix Q, m/N, shape (m, k, k)
    gap: np.ndarray  #: gap g, m, shape (m, k)

    def at_phases(self, rows):
        """Return the pairs at the phases with the given indices."""
        return ToothPairs(*(getattr(self, field.name)[rows] for field in fields(self)))

    def force_law(self, pairs, rows=slice(None)):
        """Return (stiffness, offset), (m, p) each, of p touching pairs with the indices `pairs`.

        Their forces at a displacement x are stiffness * x - offset.
        """
        inverse = np.linalg.inv(self.compliance[rows][:, pairs][:, :, pairs])
        return inverse.sum(-1), (inverse @ self.gap[rows][:, pairs, None])[..., 0]

    def share(self, loads):
        """Return the equilibrium under loads >= 0 in N, shape (l,)."""
        loads = np.asarray(loads, float)[:, None]

        def displacement(rows, stiffness, offset):
            return (loads + offset.sum(-1)) / stiffness.sum(-1)

        return self._equilibrium(len(loads), 1, displacement)

    def forces_at(self, displacement):
        """Return the forces at displacements in m, shape (m,), as `Sharing` with one load."""
        return self._equilibrium(1, 0, lambda rows, stiffness, offset: displacement[None, rows])

    def _equilibrium(self, count: int, min_pairs: int, displacement) -> Sharing:
        """Return the equilibrium of `count` loads from all sets of at least `min_pairs` pairs.

        `displacement` is a function of the indices of phases and of the `force_law` of a set.
        """
        m, k = self.gap.shape
        error, worst = np.zeros((count, m)), np.full((count, m), math.inf)
        force, stiffness = np.zeros((count, m, k)), np.zeros((count, m, k))
        touching = np.zeros((count, m, k), bool)
        diagonal = np.einsum("mii->mi", self.compliance)
        sizes = range(min_pairs, k + 1)
        combinations = (itertools.combinations(range(k), size) for size in sizes)
        for pairs in map(list, itertools.chain.from_iterable(combinations)):
            rows = np.flatnonzero(self.inside[:, pairs].all(-1))
            if not rows.size:
                continue
            pair_stiffness, offset = self.force_law(pairs, rows)
            x = displacement(rows, pair_stiffness, offset)
            forces = np.zeros((count, rows.size, k))
            forces[..., pairs] = pair_stiffness * x[..., None] - offset
            # A solution has no pulling force of touching pairs and no overlap of the others.
            violation = x[..., None] - self.gap[rows]
            violation = violation - _displacements(self.compliance[rows], forces)
            violation[..., pairs] = -(diagonal[rows] * forces)[..., pairs]
            largest = np.where(self.inside[rows], violation, -math.inf).max(-1)
            better = largest < worst[:, rows]
            load, phase = np.nonzero(better)
            place = load, rows[phase]
            worst[place], error[place], force[place] = largest[better], x[better], forces[better]
            touching[place] = np.isin(np.arange(k), pairs)
            slopes = np.zeros((rows.size, k))
            slopes[:, pairs] = pair_stiffness
            stiffness[place] = slopes[phase]
        return Sharing(error, np.maximum(force, 0.0), touching, stiffness)

    def overlap(self, sharing):
        """Return the overlap that the flanks of each pair would have without its force, (l, m, k).

        It is in m and > 0 for touching pairs; for others it is minus the distance of the flanks.
        """
        diagonal = np.einsum("mii->mi", self.compliance)
        coupled = _displacements(self.compliance, sharing.force) - diagonal * sharing.force
        overlap = sharing.error[..., None] - self.gap - coupled
        # The sign must agree with `touching` even if pairs touch without a load.
        tiny = np.finfo(float).tiny
        return np.where(sharing.touching, np.maximum(overlap, tiny), np.minimum(overlap, -tiny))


def _displacements(compliance, forces):
    """Return the displacements Q F, (..., k), of matrices (..., k, k) and forces (..., k)."""
    return np.einsum("...ij,...j->...i", compliance, forces)


def tooth_pairs(mesh, phases, *, pitch_errors=None, **options):
    """Return the pairs of teeth in mesh at a number of equal phases of each mesh period.

    Further options are those of `pairs_at`.
    """
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
    load: float | None = None  #: load of corner contact and of helical gears, N


def pairs_at(mesh, pitches, middle=None, inside=None, **options):
    """Return the pairs of teeth in mesh at m phases; further arguments are `Options`.

    `pitches`, shape (m,), are base pitches since the first pair reached the start of its path of
    contact. The pairs in mesh are those at the phases `middle`, by default at `pitches`, or those
    in `inside`, bool, shape (m, k).
    """
    stiffness, coupling, deviation, pitch_errors, corners, load = Options(**options)
    possible = isinstance(deviation, PathTable | None)
    checks.require(possible, "deviation", deviation, "a PathTable")
    errors, overlap = checked_errors(mesh, pitch_errors), mesh.overlap_ratio
    allowed = "0, load sharing along the path of contact is that of spur gears"
    possible = overlap == 0.0 or load is not None
    checks.require(possible, "helix_angle", mesh.pinion.helix_angle, allowed)
    before, behind = zone_of_contact(mesh, corners, load, errors)
    face = face_of(mesh, errors.size)
    begun = np.floor((pitches if middle is None else middle) + before + face.reach)
    count = math.floor(mesh.contact_ratio + before + behind + 2.0 * face.reach) + 1
    allowed = f"such that at most {_MAX_PAIRS} pairs of teeth are in mesh"
    checks.require(count <= _MAX_PAIRS, "total contact ratio", mesh.total_contact_ratio, allowed)
    slots = np.arange(count)
    tooth_numbers = begun.astype(int)[:, None] - slots
    slice_count = len(face.shares)
    contact = ((pitches - begun)[:, None] + face.places)[..., None] + slots  # (m, slices, k)
    in_mesh = (contact >= -before) & (contact < mesh.contact_ratio + behind)
    slices, in_mesh = contact.reshape(-1, count), in_mesh.reshape(-1, count)
    if overlap == 0.0 and inside is not None:
        in_mesh = inside
    position = mesh.path[0] + slices * mesh.base_pitch
    # Everything but the pitch errors repeats in each base pitch and is computed only once.
    place = np.round(slices[:, 0] / SAME_PLACE).astype(int) * 2**count + in_mesh @ 2**slots
    _, first, each = np.unique(place, return_index=True, return_inverse=True)
    on_path = np.clip(position[first], *mesh.path)
    # A number of pairs that changed where corners begin to touch would make the forces jump.
    pair_count = math.floor(mesh.contact_ratio) + 1 if corners else in_mesh[first].sum(-1)
    compliance = _compliance(mesh, on_path, stiffness, coupling, pair_count)
    gap = relief_gap(mesh, on_path)
    if deviation is not None:
        gap = gap + deviation.at(on_path)
    if corners:
        gap = gap + corner_gap(mesh, position[first])
    else:
        position = np.clip(position, *mesh.path)
    gap = gap[each] + np.repeat(errors[tooth_numbers % errors.size], slice_count, axis=0)
    if overlap == 0.0:
        return ToothPairs(pitches, position, in_mesh, compliance[each], gap)
    force, slopes, x = _face_equilibrium(face.shares, compliance[each], in_mesh, gap, load)
    # A pair that begins to touch has no stiffness; a small one keeps its compliance finite.
    positive_slopes = np.maximum(slopes, 1e-9 * slopes.sum(-1, keepdims=True))
    return ToothPairs(
        pitches,
        position.reshape(-1, slice_count, count).mean(axis=1),
        force > 0.0 if inside is None else inside,
        np.eye(count) / positive_slopes[..., None],
        x[:, None] - force / positive_slopes,
    )


class Face(NamedTuple):
    """Slices of the face of a gear; the face of a spur gear is one slice."""

    shares: np.ndarray  #: shares of the face width, shape (n,); the outer slices are narrower
    places: np.ndarray  #: base pitches by which slices mesh later than the middle, shape (n,)
    lines: int  #: equal parts of a base pitch, each a whole number of slices; 0 for spur gears
    reach: float  #: base pitches by which a pair meshes before the middle of its face


def face_of(mesh, periods):
    """Return the slices of the face of a mesh whose pairs of teeth repeat after some periods."""
    overlap = mesh.overlap_ratio
    if overlap == 0.0:
        return Face(np.ones(1), np.zeros(1), 0, 0.0)
    lines = min(max(math.ceil(_MIN_SLICES / overlap), MIN_LINES), _MAX_LINES)
    rows = periods * lines * max(_MIN_SLICES, overlap * lines)
    coarsening = max(1.0, math.sqrt(rows / _MAX_ROWS))
    lines = max(8, round(lines / coarsening))
    per_pitch = lines * max(1, round(_MIN_SLICES / coarsening / overlap / lines))
    count = math.ceil(overlap * per_pitch)
    shares = np.full(count, 1.0 / (overlap * per_pitch))
    shares[[0, -1]] = (1.0 - shares[1:-1].sum()) / 2.0
    places = (np.arange(count) - (count - 1) / 2.0) / per_pitch
    return Face(shares, places, lines, (overlap + 1.0 / lines) / 2.0)


def _face_equilibrium(shares, compliance, inside, gap, load: float):
    """Return forces and stiffnesses, (m, k), and displacements, (m,), of a helical mesh.

    `shares`, (n,), are those of the slices; compliances, (m n, k, k), and gaps, (m n, k), are those
    of k pairs in all slices at m phases. In each step of Newton's method a pair in a slice begins
    or ceases to touch if its overlap or its force has the wrong sign.
    """
    count, touching = gap.shape[1], inside

    def face_sum(values):
        return shares @ values.reshape(-1, len(shares), count)

    diagonal = np.einsum("mii->mi", compliance)
    x = np.full(len(gap) // len(shares), load * compliance.max() + gap[inside].max())
    for _ in range(_MAX_NEWTON_STEPS):
        approach = np.repeat(x, len(shares))[:, None] - gap
        both = touching[:, :, None] & touching[:, None, :]
        inverse = np.linalg.inv(np.where(both, compliance, np.eye(count))) * both
        force = _displacements(inverse, approach)
        overlap = approach - _displacements(compliance, force)
        violation = inside * np.where(touching, -diagonal * force, overlap)
        total, stiffness = face_sum(force), face_sum(np.einsum("mij->mi", inverse))
        step = (total.sum(-1) - load) / stiffness.sum(-1)
        if max(np.abs(step).max(), violation.max()) <= _NEWTON_TOLERANCE * np.abs(x).max():
            return total, stiffness, x
        x, touching = x - step, touching ^ (violation > 0.0)
    raise RuntimeError(f"no displacement of a helical mesh in {_MAX_NEWTON_STEPS} steps")


def zone_of_contact(mesh, corners, load, errors):
    """Return the lengths of corner contact before and behind the path of contact, base pitches.

    Corners can touch where their gap is below `MAX_CORNER_GAP` deflections of one pair.
    """
    if not corners:
        return 0.0, 0.0
    limit = MAX_CORNER_GAP * load / pair_stiffness(mesh) + np.ptp(errors)
    pitches = np.linspace(0.0, _MAX_APPROACH, 201)
    (start, end), distances = mesh.path, pitches * mesh.base_pitch
    gaps = (corner_gap(mesh, position) for position in (start - distances, end + distances))
    # The gap grows with the square of the distance.
    return tuple(float(np.interp(math.sqrt(limit), np.sqrt(gap), pitches)) for gap in gaps)


def corner_gap(mesh, position):
    """Return the gap of tip corners at positions beyond the path of contact, m; 0 on the path.

    Before the start of the path, the tip corner of the wheel approaches the flank of the pinion;
    behind its end, the tip corner of the pinion leaves the flank of the wheel. A position is where
    longer involutes of the pair would touch.
    """
    (start, end), far = mesh.path, _MAX_APPROACH * mesh.base_pitch
    entering = _gap_to_corner(mesh, "pinion", np.clip(position, start - far, start))
    leaving = _gap_to_corner(mesh, "wheel", np.clip(position, end, end + far))
    return np.where(position < start, entering, 0.0) + np.where(position > end, leaving, 0.0)


def _gap_to_corner(mesh, flank_name: str, position):
    """Return the gap between the flank of pinion or wheel and the tip corner of the other, m."""
    sign, angle = mesh.wheel.sign, mesh.working_pressure_angle
    flank, corner, direction = mesh.pinion, mesh.wheel, 1
    if flank_name == "wheel":
        flank, corner, direction = corner, flank, -sign
    base = flank.base_diameter / 2.0
    rotation = direction * (position - mesh.pitch_point) / base  # from contact at the pitch point
    centre = mesh.centre_distance * (1 if sign == 1 else -flank.sign)
    tip = corner.tip_diameter / 2.0
    tip_angle = math.acos(corner.base_diameter / corner.tip_diameter)
    corner_angle = -sign * rotation * flank.teeth / corner.teeth + inv(angle) - inv(tip_angle)
    x, y = centre - sign * tip * np.cos(corner_angle), -sign * tip * np.sin(corner_angle)
    flank_angle = np.arccos(base / np.hypot(x, y))
    involute = np.tan(flank_angle) - flank_angle
    return flank.sign * base * (np.arctan2(y, x) - (rotation + inv(angle) - involute))


def checked_errors(mesh, values=None):
    """Return the checked pitch errors, by default those of the gears, in m, shape (n,)."""
    if values is None:
        return np.array(mesh.pitch_errors)
    if np.ndim(values) != 1 or not np.size(values):
        raise checks.refusal("pitch_errors", values, "a sequence of at least one number")
    return np.array(checks.finite("pitch_errors", values))


def relief_gap(mesh, position):
    """Return the gap due to the tip reliefs of both gears at positions on the path, m."""
    start, end = mesh.path
    gap = np.zeros(np.shape(position))
    for gear, tip_distance in ((mesh.pinion, end - position), (mesh.wheel, position - start)):
        if gear.tip_relief is not None:
            gap = gap + gear.tip_relief.gap(tip_distance)
    return gap


def _compliance(mesh, position, stiffness, coupling, pair_count):
    """Return the compliance matrices Q of pairs at positions (m, k), shape (m, k, k), m/N.

    `pair_count`, an int or shape (m,), is the number of pairs that share a body in ISO 6336.
    """
    coupling = checks.number("coupling", coupling, "from 0 to 1", lambda v: 0.0 <= v <= 1.0)
    identity = np.eye(position.shape[1])
    if isinstance(stiffness, PathTable):
        values = stiffness.at(position)
        if not values.min() > 0.0:
            raise ValueError(
                f"stiffness = {values.min():.6g} N/m is not allowed: it must be > 0 all along the "
                "path of contact"
            )
        return identity / values[..., None]
    if stiffness == "energy":
        return compliance_matrix(PairCompliance(mesh), position, np.ones(position.shape), coupling)
    checks.require(stiffness == "iso", "stiffness", stiffness, "'iso', 'energy' or a PathTable")
    # If n pairs share a body of the compliance 1 / ((1 + 3 n) c'), their stiffness is
    # (0.25 + 0.75 n) c', that of ISO 6336.
    single = 1.0 / pair_stiffness(mesh)
    count = np.broadcast_to(pair_count, len(position))[:, None, None]
    body = single * coupling / (1.0 + 3.0 * count)
    return (single - body) * identity + body
