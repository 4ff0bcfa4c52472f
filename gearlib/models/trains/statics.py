"""Static equilibrium of a train with backlash and errors, and its load sharing.

In every mesh either the drive side or the coast side can carry a force,

    P >= 0, d <= P / C, P (d - P / C) = 0        and the same for Q on the coast side,

which is a linear complementarity problem for the mesh force P, the distance d of the flanks and the
stiffness C. Its solutions are the minima of a convex, piecewise quadratic energy, so the forces are
unique. Newton's method with an exact line search ends after finitely many steps, and the result is
checked against all conditions.
"""

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import xarray as xr

from gearlib import checks
from gearlib.data import status
from gearlib.data.variables import add_metadata
from gearlib.models.trains.waves import (
    SAME_PHASE_TOLERANCE,
    force_direction,
    force_frequency,
    is_at_lower_level,
)

if TYPE_CHECKING:
    from gearlib.models.trains.train import GearTrain

_MAX_NEWTON_STEPS = 200
#: Largest residual over the forces; the rounding errors of loose gears can be large.
_RESIDUAL_TOLERANCE = 1e-9


def _balancing_torques(train: "GearTrain") -> str:
    """Return a suggestion of torques that balance a train, as in "-20 N m on wheel".

    As few torques as possible are changed. The first loaded body, which drives, keeps its torque;
    loaded bodies without a carrier are changed first, and among equals the last body first.
    """
    radii, torques = np.array([(body.base_radius, body.torque) for body in train.bodies]).T
    # Work of 1 N m on each body in each rigid-body ("free") motion, which no spring resists; works
    # below the tolerance are rounding errors.
    works = (train.structure.motions[:, 2] @ train.free_motions).T / radii
    work_tolerance = 1e-6 * abs(works).max()
    # Bodies with the highest preference are changed first.
    preferences = [(body.carrier is None, body.torque != 0.0) for body in train.bodies]
    if torques.any():
        first_loaded = int(torques.nonzero()[0][0])
        preferences[first_loaded] = (False, False)
    changed: list[int] = []
    for i in sorted(range(len(torques)), key=lambda i: (*preferences[i], i), reverse=True):
        if np.linalg.matrix_rank(works[:, [*changed, i]], work_tolerance) > len(changed):
            changed.append(i)
    torques[changed] = 0.0
    balancing = np.linalg.lstsq(works[:, changed], -works @ torques)[0]
    values = zip(balancing, changed, strict=True)
    return " and ".join(f"{value:.12g} N m on {train.bodies[i].name}" for value, i in values)


def check_balance(train: "GearTrain") -> None:
    """Raise ValueError if a `GearTrain` cannot move, lacks a mass or has unbalanced torques.

    Torques balance if they do no work on rigid-body motions, which no spring resists. Also raise
    ValueError for a harmonic force along a direction in which its body cannot move, or with the
    frequency 0, and for a moving backlash of a gear whose axis moves freely.
    """
    if not train.structure.coordinates:
        raise ValueError("bodies is not allowed: at least one of them must be able to move")
    if train.structure.mass.diagonal().min() <= 0.0:
        raise ValueError("bodies is not allowed: every motion must have a mass")
    for force in train.forces:
        owner = f"a force on body {force.body}"
        can_move = force_direction(train, force, train.structure.motions).any()
        checks.require(
            can_move, "axis", force.axis, "a direction in which this body can move", owner
        )
        has_frequency = force_frequency(train, force) != 0
        checks.require(has_frequency, "reference", force.of, "a mesh, or a body that turns", owner)
    load = train.structure.load
    for motion in train.free_motions.T:
        works = motion * load
        is_unbalanced = abs(works.sum()) > 1e-9 * abs(works).sum()
        if is_unbalanced and train.matrices is not None:
            raise _unbalanced_forces(train, motion)
        if is_unbalanced:
            moving_bodies = [
                body.name
                for body, rows in zip(train.bodies, train.structure.motions, strict=True)
                if abs(rows @ motion).max() > 1e-6 * abs(motion).max()
            ]
            raise ValueError(
                f"torque of bodies {', '.join(moving_bodies)} is not allowed: they must balance on "
                f"the free rotation of the train, as with {_balancing_torques(train)}"
            )
    # Coast-side flanks with moving backlash follow the axes; a motion that no spring resists must
    # not change their distance.
    changes = abs(train.coast_lines @ train.free_motions)
    scale = abs(train.coast_lines) @ abs(train.free_motions)
    changes_distance = (changes > 1e-9 * scale).any(axis=1)
    for mesh, moves_freely in zip(train.meshes, changes_distance, strict=True):
        valid = not (mesh.moving_backlash and moves_freely)
        allowed = "False where an axis of its gears moves freely"
        checks.require(valid, f"moving_backlash of mesh {mesh.name}", True, allowed)


def _unbalanced_forces(train: "GearTrain", motion: np.ndarray) -> ValueError:
    """Return the ValueError for forces that do work on a rigid-body motion of given matrices.

    `motion`, shape (n,), is the motion, which no spring resists. The message names the coordinates
    that move, at most eight, and a force on one of them that would balance the others.
    """
    names, load = [name for name, _ in train.structure.coordinates], train.structure.load
    least_motion = 1e-6 * max(abs(motion))
    pairs = zip(names, motion, strict=True)
    moving = [name for name, amplitude in pairs if abs(amplitude) > least_motion]
    # The last force that does work is changed so that the total work is 0.
    changed = np.flatnonzero(load * motion)[-1]
    balancing = load[changed] - (load @ motion) / motion[changed]
    return ValueError(
        f"forces are not allowed: no spring resists a motion of {', '.join(moving[:8])}, on which "
        f"they must do no work, as with {balancing:.12g} on {names[changed]}"
    )


class Equilibrium(NamedTuple):
    """Static equilibrium of a train with n coordinates and m meshes."""

    q: np.ndarray  #: coordinates, m, shape (n,), without free motions
    force: np.ndarray  #: N, positive on drive sides, negative on coast sides, shape (m,)
    contact: np.ndarray  #: contact states 1, 0 and -1, shape (m,)
    both_flanks_touch: np.ndarray  #: bool, whether forces act on both flanks, shape (m,)


def equilibrium(train: "GearTrain", phase: float = 0.0, load_ratio: float = 1.0) -> Equilibrium:
    """Return the static `Equilibrium` of a train with backlash and errors.

    `phase` is the phase of the reference mesh in rad, at which stiffness and errors are taken;
    `load_ratio` is a factor on all torques. Raises ValueError if the load opens a mesh with
    infinite backlash permanently.
    """
    frequencies, amplitudes, constants = train.excitation
    harmonics = np.stack([np.cos(frequencies * phase), np.sin(frequencies * phase)], axis=1)
    # Distances of (coast, drive) flanks while all coordinates are 0.
    gaps = constants + amplitudes @ harmonics.ravel()
    gaps[0] += [mesh.backlash for mesh in train.meshes]
    stiffness = _stiffness_levels(train, phase)
    # The unknowns are amplitudes of elastic modes, scaled to unit stiffness of the linear train.
    # They exclude free motions.
    squares, shapes = train.linear_modes
    basis = shapes / np.sqrt(squares)
    drive_lines = train.modal_mesh_displacements / np.sqrt(squares)
    has_moving_backlash = np.array([[mesh.moving_backlash] for mesh in train.meshes])
    coast_lines = np.where(has_moving_backlash, train.coast_lines @ basis, drive_lines)
    lines = np.stack([coast_lines, drive_lines])
    strains = train.strains[: -len(train.meshes)]
    load = load_ratio * (basis.T @ train.structure.load)
    energy = _Energy(strains.T @ strains, lines, stiffness, gaps, load)
    # Rounding errors of the gaps cause forces of this size, even without a load.
    gap_sizes = np.where(np.isfinite(gaps), np.abs(gaps), 0.0)
    force_scale = (np.abs(drive_lines.T) @ (stiffness * gap_sizes).max(axis=0)).max(initial=0.0)
    # Only a symmetric stiffness has an energy to be minimized.
    if train.matrices is None or train.matrices.is_symmetric:
        modal_amplitudes = _minimize(energy, force_scale)
    else:
        skew = (train.structure.stiffness - train.structure.stiffness.T) / 2.0
        allowed = "without forces that free motions feel or cause"
        free_forces = np.abs(skew @ train.free_motions).max(initial=0.0)
        valid = free_forces <= _RESIDUAL_TOLERANCE * np.abs(skew).max()
        checks.require(valid, "stiffness", "an unsymmetric matrix", allowed)
        energy = energy._replace(elastic=energy.elastic + basis.T @ skew @ basis)
        modal_amplitudes = _balance(energy, force_scale)
    if modal_amplitudes is None:
        raise ValueError(
            "the train has no static equilibrium: its torques or errors open a mesh with infinite "
            "backlash permanently; a finite backlash would close"
        )
    distances = lines @ modal_amplitudes + gaps
    forces, (residual, force_sizes) = energy.forces(distances), energy.gradient(modal_amplitudes)
    scale = force_scale + np.abs(load).sum() + force_sizes.sum()
    if not np.abs(residual).max(initial=0.0) <= _RESIDUAL_TOLERANCE * scale:
        raise ValueError("the static equilibrium is not accurate to rounding; no result")
    contact_states = np.where(distances[1] >= 0.0, 1, np.where(distances[0] <= 0.0, -1, 0))
    # A smaller overlap of the coast-side flanks is a rounding error of the distance.
    rounding = 1e-12 * (gap_sizes.max() + np.abs(drive_lines @ modal_amplitudes))
    both_flanks_touch = (contact_states == 1) & (distances[0] < -rounding)
    coordinates = basis @ modal_amplitudes
    contact_states = contact_states.astype(np.int8)
    return Equilibrium(coordinates, forces.sum(axis=0), contact_states, both_flanks_touch)


def static(train: "GearTrain", phase: float = 0.0) -> xr.Dataset:
    """Return the static equilibrium of a train at a reference mesh phase in rad as a dataset.

    It holds mesh forces, contacts, load sharing and displacements, see `GearTrain.static`. The
    status is JAMMED if both flanks of a mesh carry a force.
    """
    result = equilibrium(train, phase)
    status_code = status.JAMMED if result.both_flanks_touch.any() else status.OK
    dataset = xr.Dataset(
        {
            "mesh_force": ("mesh", result.force),
            "contact": ("mesh", result.contact),
            "load_sharing": ("mesh", load_shares(train, result.force)),
            "body_displacement": (("body", "axis"), train.structure.motions @ result.q),
            "reference_phase": ((), float(phase)),
            "status": ((), np.int8(status_code)),
        },
        coords=train.names,
        attrs={"title": "Static equilibrium of a gear train"},
    )
    dataset = add_metadata(dataset)
    dataset["status"].attrs["message"] = status.MESSAGES[status_code]
    return dataset


def mesh_groups(train: "GearTrain") -> list[tuple[str, str]]:
    """Return the group of meshes that share a load with each mesh, as a pair of strings.

    The pair is ("pinion", name of the pinion) for meshes with a common pinion, else ("wheel", name
    of the wheel) for those with a common wheel, else ("mesh", its own name) for a single mesh.
    """
    pinions = [mesh.pinion for mesh in train.meshes]
    wheels = [mesh.wheel for mesh in train.meshes]
    groups = []
    for mesh in train.meshes:
        if pinions.count(mesh.pinion) > 1:
            groups.append(("pinion", mesh.pinion))
        elif wheels.count(mesh.wheel) > 1:
            groups.append(("wheel", mesh.wheel))
        else:
            groups.append(("mesh", mesh.name))
    return groups


def load_shares(train: "GearTrain", forces: np.ndarray) -> np.ndarray:
    """Return the force of each mesh over the mean force of the meshes that share its load.

    These are the meshes of a common pinion or wheel, see `mesh_groups`. `forces` of m meshes in N,
    shape (..., m), and the result have the same shape. The result is NaN where the forces of a
    group sum to 0.
    """
    groups = np.array(["/".join(group) for group in mesh_groups(train)])
    shares = np.empty_like(forces)
    with np.errstate(divide="ignore", invalid="ignore"):
        for group in set(groups):
            in_group = groups == group
            total = forces[..., in_group].sum(axis=-1, keepdims=True)
            total = np.where(total, total, math.nan)
            shares[..., in_group] = forces[..., in_group] * in_group.sum() / total
    return shares


def _stiffness_levels(train: "GearTrain", phase: float) -> np.ndarray:
    """Return the mesh stiffness on the (coast, drive) sides just after a phase, N/m, (2, m).

    The drive side has the flanks loaded in the sense of the driving torque, the coast side the
    others. `phase` is the phase of the reference mesh in rad.
    """
    # All stiffnesses repeat after `train.repeats` periods of the reference mesh.
    period, phase_in_period = divmod(phase % (math.tau * train.repeats), math.tau)
    levels = np.empty((2, len(train.meshes)))
    for j, (mesh, ratio) in enumerate(zip(train.meshes, train.frequency_ratios, strict=True)):
        stiffness_phases = train.coast_phases[mesh.name], train.phases[mesh.name]
        # At a jump of the stiffness, the tolerance selects the level after it.
        fraction = (phase_in_period + SAME_PHASE_TOLERANCE) / math.tau
        # Phase of this mesh in its periods, exact for the whole periods of the reference mesh.
        mesh_phase = float(int(period) * ratio % 1) + fraction * float(ratio)
        low = is_at_lower_level(mesh, stiffness_phases, np.array([mesh_phase]))[:, 0]
        levels[:, j] = mesh.max_stiffness * np.where(low, mesh.stiffness_ratio, 1.0)
    return levels


class _Energy(NamedTuple):
    """Potential energy of a train, a convex, piecewise quadratic function of p modal amplitudes.

    Drive-side flanks touch at distances >= 0, coast-side flanks at distances <= 0. Forces are
    positive on the drive side and negative on the coast side.
    """

    elastic: np.ndarray  #: stiffness without the meshes, shape (p, p)
    lines: np.ndarray  #: distances of (coast, drive) flanks per amplitude, shape (2, m, p)
    stiffness: np.ndarray  #: stiffness of (coast, drive) flanks, N/m, shape (2, m)
    gaps: np.ndarray  #: distances of (coast, drive) flanks at amplitudes 0, m, shape (2, m)
    load: np.ndarray  #: modal load, shape (p,)

    def forces(self, distances: np.ndarray) -> np.ndarray:
        """Return the forces in N at distances of (coast, drive) flanks in m, shape (2, m)."""
        coast, drive = distances
        return self.stiffness * np.stack([np.minimum(coast, 0.0), np.maximum(drive, 0.0)])

    def gradient(self, amplitudes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return (gradient of the energy, sum of the magnitudes of its terms by mesh forces).

        `amplitudes` of p modes and both results have the shape (p,). The second result measures the
        size of rounding errors in the first.
        """
        forces = self.forces(self.lines @ amplitudes + self.gaps)
        gradient = self.elastic @ amplitudes + _modal_forces(self.lines, forces) - self.load
        return gradient, _modal_forces(np.abs(self.lines), np.abs(forces))

    def hessian(self, distances: np.ndarray) -> np.ndarray:
        """Return the Hessian matrix of the energy, (p, p), the stiffness with the touching flanks.

        `distances`, shape (2, m), of (coast, drive) flanks decide which flanks touch.
        """
        touching = np.stack([distances[0] <= 0.0, distances[1] >= 0.0])
        sides = zip(self.lines, self.stiffness * touching, strict=True)
        return self.elastic + sum(
            lines.T @ (stiffness[:, None] * lines) for lines, stiffness in sides
        )


def _modal_forces(lines: np.ndarray, forces: np.ndarray) -> np.ndarray:
    """Return the sum of the flank forces in modal coordinates, shape (p,).

    `forces`, shape (2, m), are the forces on (coast, drive) flanks of m meshes. `lines`, shape (2,
    m, p), hold the distance of each pair of flanks per amplitude of each of the p modes; by virtual
    work they also convert forces.
    """
    return lines[0].T @ forces[0] + lines[1].T @ forces[1]


def _minimize(energy: _Energy, force_scale: float) -> np.ndarray | None:
    """Minimize the energy by Newton's method and return the modal amplitudes, shape (p,), or None.

    None means that the energy has no minimum, because a mesh opens without limit. `force_scale` is
    the magnitude of additional forces; rounding errors of this magnitude are tolerated.
    """
    load, gaps = energy.load, energy.gaps
    amplitudes = load.copy()
    # Larger distances mean that a body moves away under its load without limit.
    largest_gap = np.abs(gaps[np.isfinite(gaps)]).max(initial=0.0)
    deflection = np.abs(energy.lines @ load).max(initial=0.0)
    max_distance = 1e6 * (largest_gap + deflection) if deflection > 0.0 else math.inf
    for _ in range(_MAX_NEWTON_STEPS):
        hessian = energy.hessian(energy.lines @ amplitudes + gaps)
        if np.linalg.eigvalsh(hessian)[0] < 1e-11:
            # A body is loose: a small stiffness makes a long step, which the line search shortens.
            hessian = hessian + 1e-9 * np.eye(amplitudes.size)
        step = -np.linalg.solve(hessian, energy.gradient(amplitudes)[0])
        step_length = _line_search(energy, amplitudes, step)
        if step_length is None:
            return None
        amplitudes = amplitudes + step_length * step
        if -(energy.lines[1] @ amplitudes + gaps[1]).min() > max_distance:
            return None
        gradient, mesh_forces = energy.gradient(amplitudes)
        forces = load, energy.elastic @ amplitudes, mesh_forces
        scale = force_scale + sum(np.abs(force).max(initial=0.0) for force in forces)
        if np.abs(gradient).max(initial=0.0) <= 1e-14 * amplitudes.size * scale:
            break
    return amplitudes


def _balance(energy: _Energy, force_scale: float) -> np.ndarray | None:
    """Return the modal amplitudes at which all forces balance, shape (p,), or None.

    This suits an unsymmetric stiffness, which has no energy; `_Energy.gradient` then is the
    residual of the forces. Newton's method halves each step until the residual decreases. None
    means that it did not converge. `force_scale` is the magnitude of additional forces; rounding
    errors of this magnitude are tolerated.
    """
    amplitudes = energy.load.copy()
    for _ in range(_MAX_NEWTON_STEPS):
        residual, mesh_forces = energy.gradient(amplitudes)
        scale = force_scale + np.abs(energy.load).max(initial=0.0) + mesh_forces.max(initial=0.0)
        if np.abs(residual).max(initial=0.0) <= 1e-14 * amplitudes.size * scale:
            return amplitudes
        jacobian = energy.hessian(energy.lines @ amplitudes + energy.gaps)
        step = -np.linalg.lstsq(jacobian, residual)[0]
        step_length, residual_norm = 1.0, np.linalg.norm(residual)
        while np.linalg.norm(energy.gradient(amplitudes + step_length * step)[0]) >= residual_norm:
            step_length /= 2.0
            if step_length < 1e-12:
                # Only rounding errors are left, and the caller checks their size.
                return amplitudes
        amplitudes = amplitudes + step_length * step
    return None


def _line_search(energy: _Energy, amplitudes: np.ndarray, step: np.ndarray) -> float | None:
    """Return the factor on a step that minimizes the energy from given amplitudes, or None.

    `amplitudes` and `step` have the shape (p,). None means that the energy decreases without limit.
    Along the step the slope of the energy grows, and it is linear between the lengths at which
    flanks touch or separate; so these lengths are searched in order for a change of its sign.
    """
    distances, rates = energy.lines @ amplitudes + energy.gaps, energy.lines @ step
    with np.errstate(divide="ignore", invalid="ignore"):
        contact_lengths = -distances / rates
    is_ahead = np.isfinite(contact_lengths) & (contact_lengths > 0.0)
    contact_lengths = np.sort(contact_lengths[is_ahead])

    def slope(length: float) -> float:
        """Return the derivative of the energy with respect to the length, a factor on the step."""
        forces = energy.forces(distances + length * rates)
        elastic_forces = energy.elastic @ (amplitudes + length * step)
        return step @ (elastic_forces - energy.load) + (rates * forces).sum()

    start, start_slope = 0.0, slope(0.0)
    if start_slope >= 0.0:
        return 0.0
    for end in contact_lengths:
        end_slope = slope(end)
        if end_slope >= 0.0:
            return start + (end - start) * start_slope / (start_slope - end_slope)
        start, start_slope = end, end_slope
    # Beyond the last contact the slope is linear.
    end = 2.0 * start + 1.0
    end_slope = slope(end)
    increase = end_slope - start_slope
    if increase <= 1e-13 * (abs(end_slope) + abs(start_slope)):
        # The slope stays negative: a load opens a mesh without limit. Without a load the remaining
        # slope is a rounding error.
        return None if energy.load.any() else start
    return start - start_slope * (end - start) / increase
