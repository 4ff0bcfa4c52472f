"""Static transmission error of a mesh, and the tip relief that minimizes it."""

import itertools
import math
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike

from gearlib import checks
from gearlib.data.motions import float_array
from gearlib.data.variables import describe
from gearlib.models.geometry.gear import SHAPES, TipRelief
from gearlib.models.geometry.load_sharing import relief_gap, tooth_pairs

if TYPE_CHECKING:
    from gearlib.models.geometry.mesh import Mesh

#: A peak-to-peak error below this share of the deflection is a rounding error.
_FLATNESS_TOLERANCE = 1e-12
#: Decimals of the optimum; further ones depend on rounding and differ between machines.
_DECIMALS = 6
#: Grid of the search for the optimum relief: amounts over the deflection of a pair, lengths over
#: the long length.
_GRID_AMOUNTS = 0.25, 0.5, 0.75, 1.0, 1.25, 1.75
_GRID_LENGTHS = 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0
#: Number of best grid points from which a descent starts.
_DESCENT_COUNT = 2


def transmission_error(
    mesh: "Mesh", torque: ArrayLike, phases: int = 256, **options: Any
) -> xr.Dataset:
    """Return the static transmission error and the load sharing of a mesh as a dataset.

    `torque`, one or several of the pinion in N m, is at least 0; `phases` is the number of phases
    in each mesh period. Options and variables are those of `Mesh.transmission_error`.
    """
    torques = np.atleast_1d(float_array(torque))
    valid = torques.ndim == 1 and torques.size and ((torques >= 0.0) & (torques < math.inf)).all()
    checks.require(valid, "torque", torque, "a finite number >= 0, or at least one in a sequence")
    pairs = tooth_pairs(mesh, phases, **options)
    loads = mesh.load(torques)
    equilibrium = pairs.forces_under_loads(loads)
    # Without a load the forces are rounding errors, and load shares are undefined.
    load_share = np.full_like(equilibrium.force, math.nan)
    total_forces = loads[:, None, None]
    np.divide(equilibrium.force, total_forces, out=load_share, where=total_forces > 0.0)
    dims, pair_dims = ("torque", "phase"), ("phase", "tooth_pair")
    data = {
        "transmission_error": (dims, equilibrium.displacement),
        "load_share": ((*dims, "tooth_pair"), load_share),
        "pairs_in_contact": (dims, equilibrium.touching.sum(-1)),
        "mesh_stiffness": (dims, equilibrium.stiffness.sum(-1)),
        "path_position": (pair_dims, np.where(pairs.can_touch, pairs.position, math.nan)),
        "gap": (pair_dims, np.where(pairs.can_touch, pairs.gap, math.nan)),
        "peak_to_peak_error": ("torque", np.ptp(equilibrium.displacement, axis=1)),
        "effective_contact_ratio": ("torque", _contact_ratios(mesh, pairs, equilibrium, phases)),
        "mesh_force": ("torque", loads),
    }
    mesh_phase = math.tau * np.arange(pairs.pitches.size) / phases
    coords = {"torque": torques, "phase": mesh_phase, "tooth_pair": np.arange(pairs.gap.shape[1])}
    title = "Static transmission error and load sharing of a gear mesh"
    return describe(xr.Dataset(data, coords, {"title": title}))


def _contact_ratios(mesh, pairs, equilibrium, phases) -> list[float]:
    """Return the mean number of touching pairs at each load, with `phases` phases per period."""
    # Positive if a pair touches.
    overlap = np.where(pairs.can_touch, pairs.overlap(equilibrium), -math.inf)
    phase_count, pair_count = pairs.gap.shape
    # Each pair is followed along its path, from the first phase at which it is in mesh.
    offsets = pairs.pitches[:phases] % 1.0
    start = int(np.argmin(offsets))
    steps = np.arange(pair_count * phases)
    pitches = (np.sort(offsets) + np.arange(pair_count)[:, None]).ravel()
    steps = steps[pitches < mesh.contact_ratio]
    pitches = pitches[: steps.size]
    remaining_path = mesh.contact_ratio - pitches[-1]
    ratios = []
    for overlap_at_load in overlap:
        length = 0.0  # of all contacts, in base pitches
        for first_phase in range(start, start + phase_count, phases):
            # After one mesh period a pair has the next index.
            path_overlap = overlap_at_load[(first_phase + steps) % phase_count, steps // phases]
            positive, negative = np.maximum(path_overlap, 0.0), np.maximum(-path_overlap, 0.0)
            positive, negative = positive[:-1] + positive[1:], negative[:-1] + negative[1:]
            # In a step with a change of sign, linear interpolation gives the part in contact.
            length += positive / (positive + negative) @ np.diff(pitches)
            start_length = pitches[0] * (path_overlap[0] > 0.0)
            length += start_length + remaining_path * (path_overlap[-1] > 0.0)
        ratios.append(length * phases / phase_count)
    return ratios


def optimum_relief(
    mesh: "Mesh",
    torque: float,
    *,
    length: str | float | None = None,
    shape: str = "linear",
    phases: int = 256,
    **options: Any,
) -> "Mesh":
    """Return the mesh with the tip reliefs of least peak-to-peak transmission error at a load.

    If all pairs of teeth have the same constant compliance q, there is a relief without any error:
    it is linear over the whole segment with n + 1 pairs in mesh and has the amount of the
    deflection of n pairs, C_a = q F / n (Harris 1958, n = 1). Otherwise amounts up to four times
    that value are searched by sequential quadratic programming from the best points of a grid.
    The optimum is not always unique, and another relief may be some percent better.

    Parameters
    ----------
    mesh : gearlib.geometry.Mesh
        Spur gears; their tip reliefs are replaced.
    torque : float
        Design torque of the pinion, N m; finite, > 0.
    length : {"long", "short"} or float, optional
        Length of both reliefs: "long" is the whole segment with the most pairs in mesh, which is
        (eps_alpha - 1) p_bt for contact ratios below 2; "short" is half of it; or a length in m. By
        default the length is optimized too, up to the long one.
    shape : {"linear", "parabolic"}, default "linear"
        Shape of both reliefs.
    phases, stiffness, coupling, deviation, pitch_errors
        Options of `Mesh.transmission_error`.

    Returns
    -------
    gearlib.geometry.Mesh
        Mesh whose gears have the optimum `TipRelief`.

    Raises
    ------
    ValueError
        If a value is not allowed; the message names parameter, value and range.
    """
    checks.one_of("shape", shape, tuple(SHAPES))
    load = checks.gear_mesh(mesh).load(checks.finite_positive("torque", torque))
    pair_count = math.floor(mesh.contact_ratio)
    long_length = (mesh.contact_ratio - pair_count) * mesh.base_pitch
    limit = mesh.longest_relief
    named_lengths = {"long": long_length, "short": long_length / 2.0}
    fixed_length = named_lengths[length] if checks.is_one_of(length, named_lengths) else length
    if fixed_length is not None:
        allowed = f"'long', 'short' or > 0 and <= {limit:.6g} m, (eps_alpha - 1) p_bt"
        fixed_length = checks.number("length", fixed_length, allowed, lambda v: 0.0 < v <= limit)
    mesh = mesh.with_reliefs(None, None)
    pairs = tooth_pairs(mesh, phases, **options)
    # Deflections of single pairs under the load at the end and at the start of contact.
    compliance = np.einsum("mii->mi", pairs.compliance) - pairs.compliance[:, 0, -1, None]
    compliance, position = compliance[pairs.can_touch], pairs.position[pairs.can_touch]
    ends = position.argmax(), position.argmin()
    deflections = [compliance[end] * load / pair_count for end in ends]

    def reliefs(variables):
        """Return both tip reliefs from their amounts divided by `deflections`.

        Without a `fixed_length`, their length divided by `long_length` is the third variable.
        """
        relief_length = fixed_length if fixed_length is not None else long_length * variables[2]
        return [
            TipRelief(amount=amount * deflection, length=relief_length, shape=shape)
            for amount, deflection in zip(variables[:2], deflections, strict=True)
        ]

    def error(variables):
        """Return the transmission error at all phases, over the sum of both deflections."""
        relieved = mesh.with_reliefs(*reliefs(variables))
        gap = pairs.gap + relief_gap(relieved, pairs.position)
        equilibrium = replace(pairs, gap=gap).forces_under_loads([load])
        return equilibrium.displacement[0] / sum(deflections)

    bounds = [(0.0, 4.0)] * 2 + [(0.2, 1.0)] * (fixed_length is None)
    optimum = np.ones(len(bounds))
    if np.ptp(error(optimum)) > _FLATNESS_TOLERANCE:
        # There are several local minima, so a grid comes before the descents.
        axes = [_GRID_AMOUNTS] * 2 + [_GRID_LENGTHS] * (fixed_length is None)
        grid = sorted(itertools.product(*axes), key=lambda point: np.ptp(error(point)))
        starts = (optimum, *grid[:_DESCENT_COUNT])
        minima = [_minimize_range(error, start, bounds) for start in starts]

        candidates = [optimum, *minima, grid[0]]
        optimum = min(candidates, key=lambda point: round(float(np.ptp(error(point))), _DECIMALS))
    return mesh.with_reliefs(*reliefs(np.round(optimum, _DECIMALS)))


def _minimize_range(function, start, bounds) -> np.ndarray:
    """Return the variables that minimize the range, max - min, of the values of a function.

    `function` returns a vector of values from the variables; `bounds` are (lower, upper) of each
    variable. The descent by SLSQP begins at `start`.
    """
    from scipy.optimize import minimize

    # SLSQP minimizes upper - lower, two more variables between which all values must lie.
    def constraints(extended):
        *variables, lower, upper = extended
        distances = function(np.array(variables)) - lower
        return np.concatenate([distances, upper - lower - distances])

    values = function(start)
    minimum = minimize(
        lambda extended: extended[-1] - extended[-2],
        [*start, values.min(), values.max()],
        method="SLSQP",
        bounds=[*bounds, (None, None), (None, None)],
        constraints={"type": "ineq", "fun": constraints},
        options={"maxiter": 50, "ftol": 1e-9},
    )
    return np.clip(minimum.x[:-2], *np.transpose(bounds))
