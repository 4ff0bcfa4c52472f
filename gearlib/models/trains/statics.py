"""Static equilibrium of a train with gaps and errors: how the meshes share the load.

In every mesh at most one of two conditions holds with a force, drive side or coast side,

    P >= 0, d <= P / C, P (d - P / C) = 0        and the same for Q at the far flank:

a linear complementarity problem. Its solutions are the minima of a convex, piecewise quadratic
energy, so the forces are unique. Newton's method on the set of touching flanks, with an exact
search along each step, ends after finitely many steps; what it returns is checked against all
conditions.
"""

import math
from typing import NamedTuple

import numpy as np
import xarray as xr

from gearlib.data import status
from gearlib.data.variables import describe
from gearlib.models.trains.waves import SAME_PHASE, at_lower_level

_MAX_STEPS = 200
#: Of the forces: residual of a solution. Loose gears may lie far off, with the rounding of that.
_BALANCED = 1e-9


class Equilibrium(NamedTuple):
    """A proven solution: n coordinates, m meshes."""

    q: np.ndarray  #: m, shape (n,); no part in free motions
    force: np.ndarray  #: N, of drive sides positive, of coast sides negative, shape (m,)
    contact: np.ndarray  #: 1, 0, -1 as of `contact_states`, shape (m,)
    wedged: np.ndarray  #: bool, whether both flanks touch, each with a force of its own, shape (m,)


def equilibrium(train, phase=0.0):
    """Return the `Equilibrium` under the stiffness, errors and run-out at a reference mesh phase.

    There is none, a ValueError, where the load opens a mesh without a far flank for good.
    """
    frequencies, waves, constants = train.excitation
    harmonics = np.stack([np.cos(frequencies * phase), np.sin(frequencies * phase)], axis=1)
    # Distances without motion of (coast, drive) flanks.
    gaps = constants + waves @ harmonics.ravel()
    gaps[0] += [mesh.backlash for mesh in train.meshes]
    stiffness = _levels(train, phase)
    # In coordinates in which the linear train has unit stiffness; free motions take no part.
    squares, shapes = train.linear_modes
    basis = shapes / np.sqrt(squares)
    near = train.linear_stretches / np.sqrt(squares)
    moving = np.array([[mesh.moving_backlash] for mesh in train.meshes])
    # Of coast and drive side.
    lines = np.stack([np.where(moving, train.far_lines @ basis, near), near])
    strains = train.strains[: -len(train.meshes)]
    load = basis.T @ train.structure.load
    energy = _Energy(strains.T @ strains, lines, stiffness, gaps, load)
    # What rounding of the gaps makes of the forces, where there is no load.
    finite = np.where(np.isfinite(gaps), np.abs(gaps), 0.0)
    floor = (np.abs(near.T) @ (stiffness * finite).max(axis=0)).max(initial=0.0)
    a = _minimum(energy, floor)
    if a is None:
        raise ValueError(
            "the train has no static equilibrium: its torques or errors open a mesh without a far "
            "flank for good; a finite backlash would close"
        )
    distances = lines @ a + gaps
    forces, (residual, sizes) = energy.forces(distances), energy.slope(a)
    scale = floor + np.abs(load).sum() + sizes.sum()
    if not np.abs(residual).max(initial=0.0) <= _BALANCED * scale:
        raise ValueError("the static equilibrium is not found to rounding; no result")
    contact = np.where(distances[1] >= 0.0, 1, np.where(distances[0] <= 0.0, -1, 0))
    # Less than rounding of a distance is no overlap.
    wedged = (contact == 1) & (distances[0] < -1e-12 * (finite.max() + np.abs(near @ a)))
    return Equilibrium(basis @ a, forces.sum(axis=0), contact.astype(np.int8), wedged)


def static(train, phase=0.0):
    """Return the load sharing of a train, see `GearTrain.static`."""
    balance = equilibrium(train, phase)
    code = status.JAMMED if balance.wedged.any() else status.OK
    dataset = xr.Dataset(
        {
            "mesh_force": ("mesh", balance.force),
            "contact": ("mesh", balance.contact),
            "load_sharing": ("mesh", load_shares(train, balance.force)),
            "body_displacement": (("body", "axis"), train.structure.motions @ balance.q),
            "reference_phase": ((), float(phase)),
            "status": ((), np.int8(code)),
        },
        coords=train.names,
        attrs={"title": "Static equilibrium of a gear train"},
    )
    dataset = describe(dataset)
    dataset["status"].attrs["message"] = status.MESSAGES[code]
    return dataset


def branches(train):
    """Return the branch group of every mesh: of meshes that share a pinion or a wheel, one."""
    pinions = [mesh.pinion for mesh in train.meshes]
    wheels = [mesh.wheel for mesh in train.meshes]
    groups = []
    for mesh in train.meshes:
        shared = [("pinion", mesh.pinion)] if pinions.count(mesh.pinion) > 1 else []
        shared += [("wheel", mesh.wheel)] if wheels.count(mesh.wheel) > 1 else []
        groups.append((*shared, ("mesh", mesh.name))[0])
    return groups


def load_shares(train, forces):
    """Return forces over their mean in the branches of a train, shape (..., m); NaN without any."""
    groups = np.array(["/".join(group) for group in branches(train)])
    shares = np.empty_like(forces)
    with np.errstate(divide="ignore", invalid="ignore"):
        for group in set(groups):
            alike = groups == group
            total = forces[..., alike].sum(axis=-1, keepdims=True)
            shares[..., alike] = forces[..., alike] * alike.sum() / np.where(total, total, math.nan)
    return shares


def _levels(train, phase):
    """Return the stiffness of coast and drive sides just after a phase, N/m, shape (2, m)."""
    period, local = divmod(phase % (math.tau * train.repeats), math.tau)
    levels = np.empty((2, len(train.meshes)))
    for j, (mesh, rate) in enumerate(zip(train.meshes, train.rates, strict=True)):
        shifts = train.inverse_phases[mesh.name], train.phases[mesh.name]
        turns = float(int(period) * rate % 1) + (local + SAME_PHASE) / math.tau * float(rate)
        low = at_lower_level(mesh, shifts, np.array([turns]))[:, 0]
        levels[:, j] = mesh.max_stiffness * np.where(low, mesh.stiffness_ratio, 1.0)
    return levels


class _Energy(NamedTuple):
    """The energy by amplitudes of the elastic modes, shape (p,), convex and piecewise quadratic."""

    elastic: np.ndarray  #: stiffness of all but the meshes, shape (p, p)
    lines: np.ndarray  #: distances of (coast, drive) flanks by amplitudes, shape (2, m, p)
    stiffness: np.ndarray  #: of the same, shape (2, m)
    gaps: np.ndarray  #: distances without motion, shape (2, m)
    load: np.ndarray  #: shape (p,)

    def forces(self, distances: np.ndarray) -> np.ndarray:
        """Return the forces of the flanks at distances, positive on the drive side, (2, m)."""
        coast, drive = distances
        return self.stiffness * np.stack([np.minimum(coast, 0.0), np.maximum(drive, 0.0)])

    def slope(self, amplitudes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the slope, and the sum of the sizes of the mesh forces in it, (p,) each."""
        forces = self.forces(self.lines @ amplitudes + self.gaps)
        slope = self.elastic @ amplitudes + _sum_along(self.lines, forces) - self.load
        return slope, _sum_along(np.abs(self.lines), np.abs(forces))

    def hessian(self, distances: np.ndarray) -> np.ndarray:
        """Return the stiffness with the flanks that touch at distances, shape (p, p)."""
        touching = self.stiffness * np.stack([distances[0] <= 0.0, distances[1] >= 0.0])
        sides = zip(self.lines, touching, strict=True)
        return self.elastic + sum(side.T @ (c[:, None] * side) for side, c in sides)


def _sum_along(lines: np.ndarray, forces: np.ndarray) -> np.ndarray:
    """Return the sum of forces of (coast, drive) sides along their lines, shape (p,)."""
    return lines[0].T @ forces[0] + lines[1].T @ forces[1]


def _minimum(energy: _Energy, floor: float) -> np.ndarray | None:
    """Return the amplitudes of least energy, or None if it falls for ever."""
    a, load, gaps = energy.load.copy(), energy.load, energy.gaps
    # Far beyond all gaps and deflections a load drives on what touches nothing.
    largest_gap = np.abs(gaps[np.isfinite(gaps)]).max(initial=0.0)
    deflection = np.abs(energy.lines @ load).max(initial=0.0)
    horizon = 1e6 * (largest_gap + deflection) if deflection > 0.0 else math.inf
    for _ in range(_MAX_STEPS):
        hessian = energy.hessian(energy.lines @ a + gaps)
        if np.linalg.eigvalsh(hessian)[0] < 1e-11:
            # A part is loose: a step that is long in its direction, for the search to cut.
            hessian = hessian + 1e-9 * np.eye(a.size)
        step = -np.linalg.solve(hessian, energy.slope(a)[0])
        length = _search(energy, a, step)
        if length is None:
            return None
        a = a + length * step
        if -(energy.lines[1] @ a + gaps[1]).min() > horizon:
            return None
        slope, sizes = energy.slope(a)
        scale = floor + sum(np.abs(x).max(initial=0.0) for x in (load, energy.elastic @ a, sizes))
        if np.abs(slope).max(initial=0.0) <= 1e-14 * a.size * scale:
            break
    return a


def _search(energy: _Energy, a: np.ndarray, step: np.ndarray) -> float | None:
    """Return where the energy along a step is least: its slope is piecewise linear and rises."""
    distances, rates = energy.lines @ a + energy.gaps, energy.lines @ step
    with np.errstate(divide="ignore", invalid="ignore"):
        breaks = -distances / rates
    breaks = np.sort(breaks[np.isfinite(breaks) & (breaks > 0.0)])

    def slope(t):
        forces = energy.forces(distances + t * rates)
        return step @ (energy.elastic @ (a + t * step) - energy.load) + (rates * forces).sum()

    before, value = 0.0, slope(0.0)
    if value >= 0.0:
        return 0.0
    for t in breaks:
        at = slope(t)
        if at >= 0.0:
            return before + (t - before) * value / (value - at)
        before, value = t, at
    # Beyond the last flank the slope is linear.
    ahead = 2.0 * before + 1.0
    at = slope(ahead)
    rise = at - value
    if rise <= 1e-13 * (abs(at) + abs(value)):
        # Without load nothing drives on, and what is left of the slope is rounding.
        return None if energy.load.any() else before
    return before - value * (ahead - before) / rise
