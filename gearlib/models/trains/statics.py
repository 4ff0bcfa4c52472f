"""Static equilibrium of a train with backlash and errors, and its load sharing.

In each mesh, either the drive side or the coast side can carry a force,

    P >= 0, d <= P / C, P (d - P / C) = 0        and the same for Q on the coast side,

which is a linear complementarity problem for the mesh force P and the flank distance d, with the
stiffness C. Its solutions are the minima of a convex, piecewise quadratic energy, so that the
forces are unique. Newton's method with an exact line search terminates after finitely many steps,
and the result is checked against all conditions.
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
#: Tolerance of the residual relative to the forces; loose gears can have large rounding errors.
_RESIDUAL_TOLERANCE = 1e-9


def _suggest_balancing_torques(train: "GearTrain") -> str:
    """Suggest torques that balance a train, e.g. "-20 N m on wheel".

    As few torques as possible are changed. The torque of the first loaded body, the driver, is
    kept. Loaded bodies without a carrier are changed first; otherwise the last body is changed
    first.
    """
    radii, torques = np.array([(body.base_radius, body.torque) for body in train.bodies]).T
    # Work of a unit torque on each body in each rigid-body mode; work below the tolerance is a
    # rounding error.
    works = (train.structure.motions[:, 2] @ train.free_motions).T / radii
    work_tolerance = 1e-6 * abs(works).max()
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

    Torques are balanced if they do no work on rigid-body modes. Harmonic forces must have a
    frequency and act in a direction in which the body can move. A mesh with moving backlash must
    not have a gear whose axis moves freely.
    """
    if not train.structure.coordinates:
        raise ValueError(
            "bodies that cannot move are not allowed: one of them must be able to move"
        )
    if train.structure.mass.diagonal().min() <= 0.0:
        raise ValueError("bodies without inertia are not allowed: each motion must have a mass")
    for force in train.forces:
        owner = f"a force on body {force.body}"
        can_move = force_direction(train, force, train.structure.motions).any()
        checks.require(
            can_move, "axis", force.axis, "a direction in which this body can move", owner
        )
        has_frequency = force_frequency(train, force) != 0
        checks.require(
            has_frequency, "reference", force.of, "a mesh, or a body that rotates", owner
        )
    load = train.structure.load
    for motion in train.free_motions.T:
        works = motion * load
        is_unbalanced = abs(works.sum()) > 1e-9 * abs(works).sum()
        if is_unbalanced and train.matrices is not None:
            raise _unbalanced_forces_error(train, motion)
        if is_unbalanced:
            moving_bodies = [
                body.name
                for body, rows in zip(train.bodies, train.structure.motions, strict=True)
                if abs(rows @ motion).max() > 1e-6 * abs(motion).max()
            ]
            raise ValueError(
                f"torque of bodies {', '.join(moving_bodies)} is not allowed: the torques must "
                "balance in the rigid-body rotation of the train, for example with "
                f"{_suggest_balancing_torques(train)}"
            )
    # Coast-side flanks with moving backlash follow the axes; rigid-body modes must not change their
    # distance.
    changes = abs(train.coast_lines @ train.free_motions)
    scale = abs(train.coast_lines) @ abs(train.free_motions)
    changes_distance = (changes > 1e-9 * scale).any(axis=1)
    for mesh, moves_freely in zip(train.meshes, changes_distance, strict=True):
        valid = not (mesh.moving_backlash and moves_freely)
        allowed = "False if an axis of its gears moves freely"
        checks.require(valid, f"moving_backlash of mesh {mesh.name}", True, allowed)


def _unbalanced_forces_error(train: "GearTrain", motion: np.ndarray) -> ValueError:
    """Create the ValueError for forces that do work on a rigid-body mode of given matrices.

    `motion`, shape (n,), is the rigid-body mode. The message names at most eight coordinates that
    move, and a force on one of them that would balance the others.
    """
    names, load = [name for name, _ in train.structure.coordinates], train.structure.load
    tolerance = 1e-6 * max(abs(motion))
    amplitudes = zip(names, motion, strict=True)
    moving_names = [name for name, amplitude in amplitudes if abs(amplitude) > tolerance]
    # The suggested force replaces the last force that does work, so that the total work is 0.
    changed = np.flatnonzero(load * motion)[-1]
    balancing = load[changed] - (load @ motion) / motion[changed]
    return ValueError(
        f"forces are not allowed: no spring resists a motion of {', '.join(moving_names[:8])}; "
        "the forces must do no work in this motion, for example with "
        f"{balancing:.12g} on {names[changed]}"
    )


class Equilibrium(NamedTuple):
    """Static equilibrium of a train with n coordinates and m meshes."""

    q: np.ndarray  #: coordinates without rigid-body modes, m, shape (n,)
    force: np.ndarray  #: mesh forces, N, positive on drive sides, negative on coast sides, (m,)
    contact: np.ndarray  #: contact states 1 (drive side), 0 (none) and -1 (coast side), shape (m,)
    both_flanks_touch: np.ndarray  #: whether forces act on both flanks, shape (m,)


def equilibrium(train: "GearTrain", phase: float = 0.0, load_ratio: float = 1.0) -> Equilibrium:
    """Compute the static `Equilibrium` of a train with backlash and errors.

    `phase` is the reference mesh phase in rad at which stiffness and errors are evaluated, and
    `load_ratio` is a factor on all torques. Raises ValueError if the load permanently opens a mesh
    with infinite backlash.
    """
    frequencies, amplitudes, constants = train.excitation
    harmonics = np.stack([np.cos(frequencies * phase), np.sin(frequencies * phase)], axis=1)
    # Flank distances on the (coast, drive) sides if all coordinates are 0.
    gaps = constants + amplitudes @ harmonics.ravel()
    gaps[0] += [mesh.backlash for mesh in train.meshes]
    stiffness = _stiffness_levels(train, phase)
    # The unknowns are amplitudes of the elastic modes, scaled to unit modal stiffness.
    squared_frequencies, shapes = train.linear_modes
    basis = shapes / np.sqrt(squared_frequencies)
    drive_jacobian = train.modal_mesh_displacements / np.sqrt(squared_frequencies)
    has_moving_backlash = np.array([[mesh.moving_backlash] for mesh in train.meshes])
    coast_jacobian = np.where(has_moving_backlash, train.coast_lines @ basis, drive_jacobian)
    jacobians = np.stack([coast_jacobian, drive_jacobian])
    strains = train.strains[: -len(train.meshes)]
    load = load_ratio * (basis.T @ train.structure.load)
    energy = _Energy(strains.T @ strains, jacobians, stiffness, gaps, load)
    # This is the scale of forces that correspond to the gaps, and thus of their rounding errors.
    gap_sizes = np.where(np.isfinite(gaps), np.abs(gaps), 0.0)
    mesh_force_scales = (stiffness * gap_sizes).max(axis=0)
    force_scale = (np.abs(drive_jacobian.T) @ mesh_force_scales).max(initial=0.0)
    # A potential energy exists only if the stiffness is symmetric.
    if train.matrices is None or train.matrices.is_symmetric:
        amplitudes = _minimize_energy(energy, force_scale)
    else:
        skew = (train.structure.stiffness - train.structure.stiffness.T) / 2.0
        rigid_body_forces = np.abs(skew @ train.free_motions).max(initial=0.0)
        valid = rigid_body_forces <= _RESIDUAL_TOLERANCE * np.abs(skew).max()
        allowed = "a matrix whose skew-symmetric part does not act on rigid-body modes"
        checks.require(valid, "stiffness", "an unsymmetric matrix", allowed)
        energy = energy._replace(elastic=energy.elastic + basis.T @ skew @ basis)
        amplitudes = _balance_forces(energy, force_scale)
    if amplitudes is None:
        raise ValueError(
            "the train has no static equilibrium: its torques or errors permanently open a mesh "
            "with infinite backlash; a finite backlash would close"
        )
    distances = jacobians @ amplitudes + gaps
    forces = energy.forces(distances)
    residual, force_sizes = energy.gradient(amplitudes)
    scale = force_scale + np.abs(load).sum() + force_sizes.sum()
    if not np.abs(residual).max(initial=0.0) <= _RESIDUAL_TOLERANCE * scale:
        raise ValueError("the static equilibrium cannot be computed: its residual is too large")
    contact_states = np.where(distances[1] >= 0.0, 1, np.where(distances[0] <= 0.0, -1, 0))
    # Smaller overlaps of the coast-side flanks are rounding errors of the distance.
    rounding = 1e-12 * (gap_sizes.max() + np.abs(drive_jacobian @ amplitudes))
    both_flanks_touch = (contact_states == 1) & (distances[0] < -rounding)
    coordinates = basis @ amplitudes
    contact_states = contact_states.astype(np.int8)
    return Equilibrium(coordinates, forces.sum(axis=0), contact_states, both_flanks_touch)


def static(train: "GearTrain", phase: float = 0.0) -> xr.Dataset:
    """Return the static equilibrium of a train at a reference mesh phase in rad as a dataset.

    `GearTrain.static` describes the dataset. Its status is JAMMED if both flanks of a mesh carry a
    force.
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
    """Return the load-sharing group of each mesh as a pair of strings.

    Meshes with a common pinion have the group ("pinion", name of the pinion), other meshes with a
    common wheel have ("wheel", name of the wheel), and all others have ("mesh", name of the mesh).
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
    """Return the force of each mesh relative to the mean force of its load-sharing group.

    `mesh_groups` defines these groups. `forces`, shape (..., m), are the forces of m meshes, and
    the result has the same shape. It is NaN if the forces of a group sum to 0.
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

    `phase` is the phase of the reference mesh in rad.
    """
    # The stiffness of all meshes repeats after `train.repeats` periods of the reference mesh.
    period, phase_in_period = divmod(phase % (math.tau * train.repeats), math.tau)
    levels = np.empty((2, len(train.meshes)))
    for j, (mesh, ratio) in enumerate(zip(train.meshes, train.frequency_ratios, strict=True)):
        stiffness_phases = train.coast_phases[mesh.name], train.phases[mesh.name]
        # At a jump of the stiffness, the tolerance selects the level after the jump.
        fraction = (phase_in_period + SAME_PHASE_TOLERANCE) / math.tau
        # The phase of this mesh, in mesh periods, is exact for whole periods of the reference mesh.
        mesh_phase = float(int(period) * ratio % 1) + fraction * float(ratio)
        is_low = is_at_lower_level(mesh, stiffness_phases, np.array([mesh_phase]))[:, 0]
        levels[:, j] = mesh.max_stiffness * np.where(is_low, mesh.stiffness_ratio, 1.0)
    return levels


class _Energy(NamedTuple):
    """Potential energy of a train, a convex, piecewise quadratic function of p modal amplitudes.

    Drive-side flanks touch at distances >= 0, coast-side flanks at distances <= 0. Forces are
    positive on the drive side and negative on the coast side.
    """

    elastic: np.ndarray  #: stiffness without the meshes, shape (p, p)
    jacobians: np.ndarray  #: derivatives of (coast, drive) distances by amplitudes, (2, m, p)
    stiffness: np.ndarray  #: stiffness of (coast, drive) flanks, N/m, shape (2, m)
    gaps: np.ndarray  #: (coast, drive) flank distances at zero amplitudes, m, shape (2, m)
    load: np.ndarray  #: modal load, shape (p,)

    def forces(self, distances: np.ndarray) -> np.ndarray:
        """Return the forces in N at (coast, drive) flank distances in m, shape (2, m)."""
        coast, drive = distances
        return self.stiffness * np.stack([np.minimum(coast, 0.0), np.maximum(drive, 0.0)])

    def gradient(self, amplitudes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the gradient of the energy and the summed magnitudes of its mesh force terms.

        `amplitudes` and both results have the shape (p,). The second result is a scale of the
        rounding errors of the gradient.
        """
        forces = self.forces(self.jacobians @ amplitudes + self.gaps)
        gradient = self.elastic @ amplitudes + _modal_forces(self.jacobians, forces) - self.load
        return gradient, _modal_forces(np.abs(self.jacobians), np.abs(forces))

    def hessian(self, distances: np.ndarray) -> np.ndarray:
        """Return the Hessian matrix of the energy, shape (p, p).

        It is the stiffness matrix with the flanks in contact, which follow from the (coast, drive)
        flank `distances`, shape (2, m).
        """
        touching = np.stack([distances[0] <= 0.0, distances[1] >= 0.0])
        sides = zip(self.jacobians, self.stiffness * touching, strict=True)
        return self.elastic + sum(
            jacobian.T @ (stiffness[:, None] * jacobian) for jacobian, stiffness in sides
        )


def _modal_forces(jacobians: np.ndarray, forces: np.ndarray) -> np.ndarray:
    """Transform the flank forces of m meshes to p modal forces, shape (p,).

    `jacobians`, shape (2, m, p), are the derivatives of the (coast, drive) flank distances with
    respect to the modal amplitudes, and `forces`, shape (2, m), are the forces on these flanks.
    """
    (coast_jacobian, drive_jacobian), (coast_forces, drive_forces) = jacobians, forces
    return coast_jacobian.T @ coast_forces + drive_jacobian.T @ drive_forces


def _minimize_energy(energy: _Energy, force_scale: float) -> np.ndarray | None:
    """Minimize the energy by Newton's method, and return the modal amplitudes, shape (p,).

    Returns None if there is no minimum, because a mesh opens without limit. `force_scale` is the
    scale of forces whose rounding errors are tolerated.
    """
    load, gaps = energy.load, energy.gaps
    amplitudes = load.copy()
    # If a distance exceeds this limit, a body moves away under its load.
    largest_gap = np.abs(gaps[np.isfinite(gaps)]).max(initial=0.0)
    deflection = np.abs(energy.jacobians @ load).max(initial=0.0)
    max_distance = 1e6 * (largest_gap + deflection) if deflection > 0.0 else math.inf
    for _ in range(_MAX_NEWTON_STEPS):
        hessian = energy.hessian(energy.jacobians @ amplitudes + gaps)
        if np.linalg.eigvalsh(hessian)[0] < 1e-11:
            # A body is loose. A small stiffness gives a long step, which the line search shortens.
            hessian = hessian + 1e-9 * np.eye(amplitudes.size)
        step = -np.linalg.solve(hessian, energy.gradient(amplitudes)[0])
        step_length = _line_search(energy, amplitudes, step)
        if step_length is None:
            return None
        amplitudes = amplitudes + step_length * step
        if -(energy.jacobians[1] @ amplitudes + gaps[1]).min() > max_distance:
            return None
        gradient, mesh_forces = energy.gradient(amplitudes)
        forces = load, energy.elastic @ amplitudes, mesh_forces
        scale = force_scale + sum(np.abs(force).max(initial=0.0) for force in forces)
        if np.abs(gradient).max(initial=0.0) <= 1e-14 * amplitudes.size * scale:
            break
    return amplitudes


def _balance_forces(energy: _Energy, force_scale: float) -> np.ndarray | None:
    """Solve for the modal amplitudes, shape (p,), at which all forces balance.

    This method also suits an unsymmetric stiffness, for which no energy exists; then
    `_Energy.gradient` is the residual of the forces. Each step of Newton's method is halved until
    the residual decreases. Returns None if the method does not converge. `force_scale` is the scale
    of forces whose rounding errors are tolerated.
    """
    amplitudes = energy.load.copy()
    for _ in range(_MAX_NEWTON_STEPS):
        residual, mesh_forces = energy.gradient(amplitudes)
        scale = force_scale + np.abs(energy.load).max(initial=0.0) + mesh_forces.max(initial=0.0)
        if np.abs(residual).max(initial=0.0) <= 1e-14 * amplitudes.size * scale:
            return amplitudes
        jacobian = energy.hessian(energy.jacobians @ amplitudes + energy.gaps)
        step = -np.linalg.lstsq(jacobian, residual)[0]
        step_length, residual_norm = 1.0, np.linalg.norm(residual)
        while np.linalg.norm(energy.gradient(amplitudes + step_length * step)[0]) >= residual_norm:
            step_length /= 2.0
            if step_length < 1e-12:
                # Only rounding errors remain; the caller checks the residual.
                return amplitudes
        amplitudes = amplitudes + step_length * step
    return None


def _line_search(energy: _Energy, amplitudes: np.ndarray, step: np.ndarray) -> float | None:
    """Return the step length that minimizes the energy of amplitudes + length * step.

    `amplitudes` and `step` have the shape (p,). Returns None if the energy decreases without limit.
    The slope of the energy is a piecewise linear, increasing function of the length, with
    breakpoints where flanks touch or separate. The first interval with a sign change is used.
    """
    distances, rates = energy.jacobians @ amplitudes + energy.gaps, energy.jacobians @ step
    with np.errstate(divide="ignore", invalid="ignore"):
        contact_lengths = -distances / rates
    is_ahead = np.isfinite(contact_lengths) & (contact_lengths > 0.0)
    contact_lengths = np.sort(contact_lengths[is_ahead])

    def slope(length: float) -> float:
        """Return the derivative of the energy with respect to the step length."""
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
    # The slope is linear beyond the last breakpoint.
    end = 2.0 * start + 1.0
    end_slope = slope(end)
    increase = end_slope - start_slope
    if increase <= 1e-13 * (abs(end_slope) + abs(start_slope)):
        # The slope stays negative: a load opens a mesh without limit. Without a load, the slope is
        # a rounding error.
        return None if energy.load.any() else start
    return start - start_slope * (end - start) / increase
