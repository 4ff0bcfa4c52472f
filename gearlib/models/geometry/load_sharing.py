"""Load sharing of the tooth pairs in mesh: gaps, compliances and exact equilibrium.

The displacement x along the line of action, the forces F_i of the pairs and their gaps g_i satisfy

    x - g_i = sum_j Q_ij F_j  and  F_i > 0   for pairs in contact,
    x - g_i <= sum_j Q_ij F_j  and  F_i = 0  for all others,       sum F_i = F.

If the pairs do not share gear bodies, Q is diagonal and a pair carries c_i max(x - g_i, 0). Q is
positive definite, so exactly one set of pairs in contact satisfies all conditions at each phase and
load. All sets are solved directly, and the one that satisfies the conditions is selected.

Without corner contact, pairs are in contact on the path of contact only. With corner contact, a tip
corner also touches the mating flank before the start and after the end of the path. Its gap is
`corner_gap`, and its compliance is constant beyond each end of the path, so that forces have no
jumps.

The pairs of a helical gear are averages over transverse slices of the face, linearized at the
displacement under a load. Each slice is a spur gear that meshes slightly later than the preceding
one. From each phase to the next, an integer number of slices comes into mesh, so that the stiffness
has no steps.

Sources: Harris, Proc. Inst. Mech. Eng. 172 (1958) 87-112; Q by the energy method.
"""

import itertools
import math
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from gearlib import checks
from gearlib.models.geometry.gear import PathTable, inv
from gearlib.models.geometry.iso import pair_stiffness
from gearlib.models.geometry.mesh_stiffness import (
    PairCompliance,
    compliance_matrices,
)
from gearlib.parameters import Fraction, Numbers, check, checked

if TYPE_CHECKING:
    from gearlib.models.geometry.gear_stage import GearStage

#: Positions that differ by less, in base pitches, are treated as equal.
SAME_POSITION_TOLERANCE = 1e-12
#: Minimum number of slices of a helical face; limits of the number of phases per base pitch.
MIN_SLICES, MIN_INTERVALS_PER_PITCH, _MAX_INTERVALS_PER_PITCH = 48, 48, 128
#: Minimum number of phases per base pitch if there are many mesh periods.
_MIN_COARSE_INTERVALS = 8
#: Approximate maximum of (number of slices) * (number of phases), which takes 0.4 s.
_MAX_SLICES_AT_PHASES = 120_000
#: Maximum number of tooth pairs in mesh.
_MAX_PAIRS = 10
#: Largest gap at which a tip corner can touch, over the deflection of one pair under the load.
MAX_CORNER_GAP = 6.0
#: Largest distance from the path of contact at which a corner can touch, in base pitches.
_MAX_CORNER_DISTANCE = 0.45
#: Number of samples of the corner gap, from which the length of corner contact is computed.
_CORNER_SAMPLES = 201
#: Maximum number of Newton steps for the displacement of a helical mesh; relative tolerance.
_MAX_NEWTON_STEPS, _NEWTON_TOLERANCE = 50, 1e-12


@dataclass(frozen=True)
class LoadSharing:
    """Equilibrium of k tooth pairs under n loads at m phases."""

    displacement: np.ndarray  #: displacement x, the transmission error, m, shape (n, m)
    force: np.ndarray  #: force of each pair, N, shape (n, m, k)
    touching: np.ndarray  #: whether each pair is in contact, bool, shape (n, m, k)
    stiffness: np.ndarray  #: dF_i/dx of each pair, N/m, shape (n, m, k)


@dataclass(frozen=True)
class ToothPairs:
    """At most k tooth pairs in mesh at m phases; pair 0 came into mesh last."""

    pitches: np.ndarray  #: phases in base pitches, see `tooth_pairs_at`, shape (m,)
    position: np.ndarray  #: on the path of contact in the middle of the face, m, shape (m, k)
    can_touch: np.ndarray  #: whether a pair can be in contact, bool, shape (m, k)
    compliance: np.ndarray  #: compliance matrix Q, m/N, shape (m, k, k)
    gap: np.ndarray  #: gap g, m, shape (m, k)
    smallest_gap: np.ndarray  #: minimum over all pairs, mean over the face, m, shape (m,)

    def select_phases(self, phase_indices: np.ndarray) -> "ToothPairs":
        """Return the tooth pairs at a selection of phases, given by their indices, shape (j,)."""
        arrays = [getattr(self, field.name)[phase_indices] for field in fields(self)]
        return ToothPairs(*arrays)

    def force_coefficients(self, pair_indices, phase_indices=slice(None)):
        """Return (stiffness, offset) of the forces if only the given pairs are in contact.

        `pair_indices` are the indices of p tooth pairs, and `phase_indices` those of m phases, by
        default all. Both results have the shape (m, p). At a displacement x in m, the forces in N
        are stiffness * x - offset.
        """
        compliance = self.compliance[phase_indices][:, pair_indices][:, :, pair_indices]
        inverse = np.linalg.inv(compliance)
        gap = self.gap[phase_indices][:, pair_indices, None]
        return inverse.sum(-1), (inverse @ gap)[..., 0]

    def solve_for_loads(self, loads: ArrayLike) -> LoadSharing:
        """Solve for the equilibrium of all tooth pairs at each phase, under n loads.

        `loads`, shape (n,), are in N and >= 0.
        """
        loads = np.asarray(loads, float)[:, None]

        def displacements(_, stiffness, offset):
            # The forces, stiffness * x - offset, of the pairs in contact add up to the load.
            return (loads + offset.sum(-1)) / stiffness.sum(-1)

        return self._solve_contact(displacements, load_count=len(loads), min_touching_pairs=1)

    def solve_for_displacement(self, displacement: np.ndarray) -> LoadSharing:
        """Solve for the forces of all tooth pairs at a given displacement in m, shape (m,).

        The axis of the loads in the result has the length 1.
        """

        def displacements(phase_indices, *_):
            return displacement[None, phase_indices]

        return self._solve_contact(displacements, load_count=1, min_touching_pairs=0)

    def _solve_contact(self, displacements, load_count, min_touching_pairs) -> LoadSharing:
        """Find the forces of all pairs at each phase that satisfy the contact conditions.

        All sets of at least `min_touching_pairs` pairs are tried as the pairs in contact, and the
        set with the smallest violation of the conditions is selected. `displacements` is a function
        of the indices of j phases, and of stiffness and offset of the forces of a set at these
        phases, shape (j, pairs) each; it returns displacements in m, shape (load_count, j).
        """
        m, k = self.gap.shape
        displacement, min_violation = np.zeros((load_count, m)), np.full((load_count, m), math.inf)
        force, stiffness = np.zeros((load_count, m, k)), np.zeros((load_count, m, k))
        touching = np.zeros((load_count, m, k), bool)
        diagonal = np.einsum("mii->mi", self.compliance)  # compliance of each pair alone
        sets_of_pairs = []
        for pair_count in range(min_touching_pairs, k + 1):
            sets_of_pairs += [list(pairs) for pairs in itertools.combinations(range(k), pair_count)]
        for pairs in sets_of_pairs:
            indices = np.flatnonzero(self.can_touch[:, pairs].all(-1))
            if not indices.size:
                continue
            pair_stiffness, offset = self.force_coefficients(pairs, indices)
            x = displacements(indices, pair_stiffness, offset)
            forces = np.zeros((load_count, indices.size, k))
            forces[..., pairs] = pair_stiffness * x[..., None] - offset
            # In equilibrium, forces of pairs in contact are not negative, and the flanks of the
            # others do not overlap. Both violations are lengths in m.
            violation = x[..., None] - self.gap[indices]
            violation = violation - _deflections(self.compliance[indices], forces)
            violation[..., pairs] = -(diagonal[indices] * forces)[..., pairs]
            max_violation = np.where(self.can_touch[indices], violation, -math.inf).max(-1)
            # Keep the results of this set where its violation is smaller than before.
            is_better = max_violation < min_violation[:, indices]
            load_indices, columns = np.nonzero(is_better)
            improved = load_indices, indices[columns]
            min_violation[improved] = max_violation[is_better]
            displacement[improved] = x[is_better]
            force[improved] = forces[is_better]
            touching[improved] = [i in pairs for i in range(k)]
            stiffnesses = np.zeros((indices.size, k))
            stiffnesses[:, pairs] = pair_stiffness
            stiffness[improved] = stiffnesses[columns]
        return LoadSharing(displacement, np.maximum(force, 0.0), touching, stiffness)

    def overlap(self, equilibrium: LoadSharing) -> np.ndarray:
        """Return the overlap in m of the flanks of each pair without its own force, (n, m, k).

        It is positive for pairs in contact, and minus the distance of the flanks for all others.
        `equilibrium` is the `LoadSharing` of these k pairs under n loads at m phases.
        """
        force, touching = equilibrium.force, equilibrium.touching
        diagonal = np.einsum("mii->mi", self.compliance)
        deflection_by_others = _deflections(self.compliance, force) - diagonal * force
        overlap = equilibrium.displacement[..., None] - self.gap - deflection_by_others
        # The sign must agree with `touching` even if the force is 0.
        tiny = np.finfo(float).tiny
        return np.where(touching, np.maximum(overlap, tiny), np.minimum(overlap, -tiny))


def _deflections(compliance: np.ndarray, forces: np.ndarray) -> np.ndarray:
    """Return compliance @ forces: deflections in m, shape (..., k), for k tooth pairs."""
    return np.einsum("...ij,...j->...i", compliance, forces)


def tooth_pairs(stage, phases, *, pitch_errors=None, **options) -> ToothPairs:
    """Compute the tooth pairs in mesh, as `ToothPairs`, at equally spaced phases from 0.

    `phases` is their number per mesh period. There is one mesh period for each of `pitch_errors` in
    m, by default `stage.pitch_errors`. `options`, such as the stiffness method, are passed to
    `tooth_pairs_at`.
    """
    # The mesh phase is 0 in the middle of the segment with the most pairs.
    start = (stage.contact_ratio - math.floor(stage.contact_ratio)) / 2.0
    pitch_errors = check_pitch_errors(stage, pitch_errors)
    pitches = start + np.arange(pitch_errors.size * phases) / phases
    return tooth_pairs_at(stage, pitches, pitch_errors=pitch_errors, **options)


class PairOptions(NamedTuple):
    """Options of `tooth_pairs_at`; `GearStage.transmission_error` describes the first five."""

    stiffness: Any = "energy"
    coupling: float | None = None
    twist: bool = True
    deviation: PathTable | None = None
    pitch_errors: Any = None
    corners: bool = False  #: whether tip corners touch beyond the path of contact
    load: float | None = None  #: load, needed for corner contact and helical gears, N
    intervals: int | None = None  #: number of intervals per base pitch, see `FaceSlices`


def tooth_pairs_at(stage, pitches, selection_pitches=None, can_touch=None, **options) -> ToothPairs:
    """Compute the k tooth pairs in mesh at m phases, with their gaps and compliances.

    `pitches`, shape (m,), are the phases in base pitches since the first pair reached the start of
    the path of contact. Which pairs are in mesh is determined at `selection_pitches`, (m,), by
    default equal to `pitches`; `can_touch`, bool, (m, k), is computed by default. `options` are the
    fields of `PairOptions`; corner contact and helical gears need the load.
    """
    stiffness, coupling, twist, deviation, pitch_errors, corners, load, intervals = PairOptions(
        **options
    )
    is_valid = isinstance(deviation, PathTable | None)
    checks.require(is_valid, "deviation", deviation, "a PathTable")
    errors, is_spur = check_pitch_errors(stage, pitch_errors), stage.overlap_ratio == 0.0
    allowed = "0, because without a load only spur gears have load sharing along the path"
    checks.require(is_spur or load is not None, "helix_angle", stage.pinion.helix_angle, allowed)
    entry_length, exit_length = corner_contact_lengths(stage, corners, load, errors)
    face = divide_face(stage, errors.size, intervals)
    selection_pitches = pitches if selection_pitches is None else selection_pitches
    last_pair = np.floor(selection_pitches + entry_length + face.half_overlap)
    mesh_length = entry_length + stage.contact_ratio + exit_length + 2.0 * face.half_overlap
    count = math.floor(mesh_length) + 1
    allowed = f"such that at most {_MAX_PAIRS} pairs of teeth are in mesh"
    checks.require(count <= _MAX_PAIRS, "total contact ratio", stage.total_contact_ratio, allowed)
    pair_indices, slice_count = np.arange(count), len(face.width_fractions)
    tooth_numbers = last_pair.astype(int)[:, None] - pair_indices
    # Base pitches since the contact of each pair began in each slice, (m * slices, k).
    pitches_on_path = ((pitches - last_pair)[:, None] + face.delays)[..., None] + pair_indices
    pitches_on_path = pitches_on_path.reshape(-1, count)
    end = stage.contact_ratio + exit_length
    in_mesh = (pitches_on_path >= -entry_length) & (pitches_on_path < end)
    if is_spur and can_touch is not None:
        in_mesh = can_touch
    position = stage.path[0] + pitches_on_path * stage.base_pitch
    # Gaps without pitch errors and compliances repeat in each base pitch. They are computed once
    # for each combination of position and pairs in mesh, which is encoded as an integer.
    codes = np.round(pitches_on_path[:, 0] / SAME_POSITION_TOLERANCE).astype(int) * 2**count
    codes += in_mesh @ 2**pair_indices
    _, unique, inverse = np.unique(codes, return_index=True, return_inverse=True)
    on_path = np.clip(position[unique], *stage.path)
    pair_count = in_mesh[unique].sum(-1)
    if corners:
        # A constant number avoids jumps of the forces where corner contact begins.
        pair_count = math.floor(stage.contact_ratio) + 1
    compliance = _compliance_matrices(stage, on_path, stiffness, coupling, twist, pair_count)[
        inverse
    ]
    gap = relief_gap(stage, on_path)
    if deviation is not None:
        gap = gap + deviation.at(on_path)
    if corners:
        gap = gap + corner_gap(stage, position[unique])
    elif is_spur:
        position = np.clip(position, *stage.path)
    gap = gap[inverse] + np.repeat(errors[tooth_numbers % errors.size], slice_count, axis=0)
    valid = in_mesh.reshape(-1, slice_count * count).any(axis=-1).all()
    allowed = "larger: at some phases no slice of the face is in mesh"
    checks.require(valid, "total_contact_ratio", stage.total_contact_ratio, allowed)
    slice_gaps = np.where(in_mesh, gap, math.inf).min(axis=1).reshape(-1, slice_count)
    # Slices without a tooth pair in mesh are ignored.
    weights = np.where(slice_gaps < math.inf, face.width_fractions, 0.0)
    smallest_gap = np.average(np.minimum(slice_gaps, 1.0), axis=1, weights=weights)
    if is_spur:
        return ToothPairs(pitches, position, in_mesh, compliance, gap, smallest_gap)
    mean_position = position.reshape(-1, slice_count, count).mean(axis=1)
    force, pair_stiffness, x = _solve_face_equilibrium(
        face.width_fractions, compliance, in_mesh, gap, load
    )
    can_touch = force > 0.0 if can_touch is None else can_touch
    # A lower bound of the stiffness keeps the compliance finite at the beginning of contact.
    min_stiffness = 1e-9 * pair_stiffness.sum(-1, keepdims=True)
    pair_stiffness = np.maximum(pair_stiffness, min_stiffness)
    compliance = np.eye(count) / pair_stiffness[..., None]
    gap = x[:, None] - force / pair_stiffness
    return ToothPairs(pitches, mean_position, can_touch, compliance, gap, smallest_gap)


class FaceSlices(NamedTuple):
    """Slices of the face of a gear; the face of a spur gear is one slice."""

    width_fractions: np.ndarray  #: slice width over face width, shape (n,); outer ones are narrower
    delays: np.ndarray  #: delay relative to the middle of the face, base pitches, shape (n,)
    #: Number of intervals of a base pitch, each an integer number of slices; 0 for spur gears.
    intervals_per_pitch: int
    half_overlap: float  #: base pitches from the first contact to that in the middle


def divide_face(stage: "GearStage", periods: int, intervals: int | None = None) -> FaceSlices:
    """Divide the face of a gear stage into transverse slices; a spur gear has one slice.

    `periods` is the number of mesh periods to be computed. For many periods, slices are wider, so
    that (number of slices) * (number of phases) remains near `_MAX_SLICES_AT_PHASES`, unless the
    number of phases per base pitch is given by `intervals`.
    """
    overlap = stage.overlap_ratio
    if overlap == 0.0:
        return FaceSlices(np.ones(1), np.zeros(1), intervals_per_pitch=0, half_overlap=0.0)
    coarsening = 1.0
    if intervals is None:
        intervals = max(math.ceil(MIN_SLICES / overlap), MIN_INTERVALS_PER_PITCH)
        intervals = min(intervals, _MAX_INTERVALS_PER_PITCH)
        slices_at_phases = periods * intervals * max(MIN_SLICES, overlap * intervals)
        coarsening = max(1.0, math.sqrt(slices_at_phases / _MAX_SLICES_AT_PHASES))
        intervals = max(_MIN_COARSE_INTERVALS, round(intervals / coarsening))
    slices_per_pitch = intervals * max(1, round(MIN_SLICES / coarsening / overlap / intervals))
    count = math.ceil(overlap * slices_per_pitch)
    width_fractions = np.full(count, 1.0 / (overlap * slices_per_pitch))
    # The two outer slices share the remaining face width.
    width_fractions[[0, -1]] = (1.0 - width_fractions[1:-1].sum()) / 2.0
    delays = (np.arange(count) - (count - 1) / 2.0) / slices_per_pitch
    half_overlap = (overlap + 1.0 / intervals) / 2.0
    return FaceSlices(width_fractions, delays, intervals, half_overlap)


def _solve_face_equilibrium(width_fractions, compliance, can_touch, gap, load):
    """Return forces and stiffnesses, (m, k), and displacements, (m,), of a helical mesh.

    The face has n slices with the relative widths `width_fractions`, (n,). There are k tooth pairs
    in each slice at m phases, with `compliance` matrices, (m n, k, k), gaps in m, (m n, k), and
    `can_touch`, bool, (m n, k); `load` is in N. In each step of Newton's method, contact of a pair
    in a slice begins if its flanks overlap, and ends if its force is negative.
    """
    pair_count, slice_count, touching = gap.shape[1], len(width_fractions), can_touch

    def face_average(values):
        """Return the average of values (m n, k) over the n slices of the face, shape (m, k)."""
        return width_fractions @ values.reshape(-1, slice_count, pair_count)

    diagonal = np.einsum("mii->mi", compliance)
    gap_scale = np.abs(gap[can_touch]).max()  # m, scale of rounding errors for light loads
    x = np.full(len(gap) // slice_count, load * compliance.max() + gap[can_touch].max())
    for _ in range(_MAX_NEWTON_STEPS):
        approach = np.repeat(x, slice_count)[:, None] - gap
        # Invert the compliance matrices of the pairs in contact only.
        both_touch = touching[:, :, None] & touching[:, None, :]
        inverse = np.linalg.inv(np.where(both_touch, compliance, np.eye(pair_count))) * both_touch
        slice_forces = _deflections(inverse, approach)
        overlap = approach - _deflections(compliance, slice_forces)
        violation = can_touch * np.where(touching, -diagonal * slice_forces, overlap)
        forces = face_average(slice_forces)
        stiffnesses = face_average(np.einsum("mij->mi", inverse))
        step = (forces.sum(-1) - load) / stiffnesses.sum(-1)
        scale = max(np.abs(x).max(), gap_scale)
        if max(np.abs(step).max(), violation.max()) <= _NEWTON_TOLERANCE * scale:
            return forces, stiffnesses, x
        x = x - step
        # The contact of pairs that violate a condition is switched on or off.
        touching = touching ^ (violation > 0.0)
    raise RuntimeError(f"the forces of a helical mesh do not converge in {_MAX_NEWTON_STEPS} steps")


def corner_contact_lengths(stage, corner_contact, load, pitch_errors) -> tuple[float, ...]:
    """Return the lengths of corner contact before and after the path of contact, base pitches.

    Tip corners can touch where their gap is below `MAX_CORNER_GAP` times the deflection of one pair
    under the `load` in N, plus the range of the `pitch_errors` in m. Both lengths are 0 if
    `corner_contact` is False.
    """
    if not corner_contact:
        return 0.0, 0.0
    max_gap = MAX_CORNER_GAP * load / pair_stiffness(stage) + np.ptp(pitch_errors)
    pitches = np.linspace(0.0, _MAX_CORNER_DISTANCE, _CORNER_SAMPLES)
    start, end = stage.path
    distances = pitches * stage.base_pitch
    lengths = []
    for positions in (start - distances, end + distances):
        # The square root is interpolated, because the gap increases quadratically.
        root_gaps = np.sqrt(corner_gap(stage, positions))
        lengths.append(float(np.interp(math.sqrt(max_gap), root_gaps, pitches)))
    return tuple(lengths)


def corner_gap(stage: "GearStage", position: np.ndarray) -> np.ndarray:
    """Return the gap in m between tip corner and flank beyond the path of contact, 0 on the path.

    Before the start of the path, the tip corner of the wheel approaches the flank of the pinion;
    after its end, the tip corner of the pinion leaves the flank of the wheel. `position`, in m
    along the line of action, is where extended involutes would be in contact. Far from the path,
    the gap is constant.
    """
    start, end = stage.path
    max_distance = _MAX_CORNER_DISTANCE * stage.base_pitch
    entering = _tip_corner_gap(stage, "pinion", np.clip(position, start - max_distance, start))
    leaving = _tip_corner_gap(stage, "wheel", np.clip(position, end, end + max_distance))
    return np.where(position < start, entering, 0.0) + np.where(position > end, leaving, 0.0)


def _tip_corner_gap(stage: "GearStage", flank_name: str, position: np.ndarray) -> np.ndarray:
    """Return the gap in m between the flank of a gear and the tip corner of its mating gear.

    `flank_name` is "pinion" or "wheel", the gear with the flank. `position`, in m along the line of
    action, is where extended involutes would be in contact. The gap is an angle about the axis of
    the gear with the flank, times its base radius.
    """
    # The origin is the axis of the gear with the flank, and the x axis points to the pitch point.
    # The sign of a ring gear is -1, because it turns in the same direction as the pinion.
    sign, angle = stage.wheel.sign, stage.working_pressure_angle
    flank_gear, corner_gear, direction = stage.pinion, stage.wheel, 1
    if flank_name == "wheel":
        flank_gear, corner_gear, direction = stage.wheel, stage.pinion, -sign
    base_radius, tip_radius = flank_gear.base_diameter / 2.0, corner_gear.tip_diameter / 2.0
    # Rotation of the gear with the flank since contact at the pitch point.
    rotation = direction * (position - stage.pitch_point) / base_radius
    # x coordinate of the axis of the gear with the corner.
    centre = stage.centre_distance * (1 if sign == 1 else -flank_gear.sign)
    tip_angle = math.acos(corner_gear.base_diameter / corner_gear.tip_diameter)
    corner_rotation = -sign * rotation * flank_gear.teeth / corner_gear.teeth
    corner_angle = corner_rotation + inv(angle) - inv(tip_angle)
    # Coordinates of the corner.
    x = centre - sign * tip_radius * np.cos(corner_angle)
    y = -sign * tip_radius * np.sin(corner_angle)
    # The gap is the angle between the corner and the flank at the same radius.
    flank_angle = np.arccos(base_radius / np.hypot(x, y))
    involute = np.tan(flank_angle) - flank_angle
    gap_angle = np.arctan2(y, x) - (rotation + inv(angle) - involute)
    return flank_gear.sign * base_radius * gap_angle


def check_pitch_errors(stage: "GearStage", pitch_errors: ArrayLike | None = None) -> np.ndarray:
    """Check pitch errors in m, by default `stage.pitch_errors`; return them as an array, (n,).

    They are the gaps of n successive tooth pairs, repeated periodically.
    """
    if pitch_errors is None:
        return np.array(stage.pitch_errors)
    return np.array(check("pitch_errors", pitch_errors, Numbers))


def relief_gap(stage: "GearStage", position: np.ndarray) -> np.ndarray:
    """Return the gap in m between the flanks due to the tip reliefs of both gears.

    `position` in m is on the path of contact. The relief of the pinion acts at the end of the path,
    the relief of the wheel at its start.
    """
    start, end = stage.path
    gap = np.zeros(np.shape(position))
    for gear, tip_distance in ((stage.pinion, end - position), (stage.wheel, position - start)):
        if gear.tip_relief is not None:
            gap = gap + gear.tip_relief.gap(tip_distance)
    return gap


@checked
def _compliance_matrices(
    stage, position, stiffness, coupling: Fraction | None, twist, pair_count
) -> np.ndarray:
    """Return the compliance matrices of k tooth pairs at m phases in m/N, shape (m, k, k).

    `position`, (m, k), is on the path of contact in m; `stiffness` is "iso" (ISO 6336), "energy"
    (energy method) or a `PathTable` in N/m. For "energy", `twist` is whether gear bodies twist
    about their bores. `coupling` is the fraction of the body compliance that all pairs share; for
    "iso" it is 1 by default. `pair_count`, int or (m,), is the number of pairs that load a body.
    """
    identity = np.eye(position.shape[1])
    if isinstance(stiffness, PathTable):
        stiffnesses = stiffness.at(position)
        if not stiffnesses.min() > 0.0:
            raise ValueError(
                f"stiffness = {stiffnesses.min():.6g} N/m is not allowed: it must be > 0 all along "
                "the path of contact"
            )
        return identity / stiffnesses[..., None]
    checks.require(
        checks.is_one_of(stiffness, ("iso", "energy")),
        "stiffness",
        stiffness,
        "'iso', 'energy' or a PathTable",
    )
    if stiffness == "energy":
        pair = PairCompliance(stage, twist=twist)
        return compliance_matrices(pair, position, np.ones(position.shape), coupling)
    # If n pairs with the stiffness c' share a body with the compliance 1 / ((1 + 3 n) c'), their
    # total stiffness is (0.25 + 0.75 n) c', as in ISO 6336.
    pair_compliance = 1.0 / pair_stiffness(stage)
    count = np.broadcast_to(pair_count, len(position))[:, None, None]
    if coupling is None:
        coupling = 1.0
    body_compliance = pair_compliance * coupling / (1.0 + 3.0 * count)
    return (pair_compliance - body_compliance) * identity + body_compliance
