"""Static transmission error of a mesh, and the tip relief that minimizes it."""

import itertools
import math
from dataclasses import replace

import numpy as np
import xarray as xr

from gearlib import checks
from gearlib.data.variables import describe
from gearlib.models.geometry.gear import SHAPES, TipRelief
from gearlib.models.geometry.load_sharing import relief_gap, tooth_pairs

#: A peak-to-peak error below this share of the deflection is a rounding error.
_FLATNESS_TOLERANCE = 1e-12
#: Decimals of the optimum; further ones depend on rounding and differ between machines.
_DIGITS = 6
#: Grid of the search for the optimum relief: amounts over the deflection of a pair, lengths over
#: the long one.
_GRID_AMOUNTS = 0.25, 0.5, 0.75, 1.0, 1.25, 1.75
_GRID_LENGTHS = 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0
#: Number of best grid points from which a descent starts.
_DESCENTS = 2


def transmission_error(mesh, torque, phases=256, **options):
    """Return the static transmission error and the load sharing as a dataset.

    Arguments and variables are those of `Mesh.transmission_error`.
    """
    values = np.atleast_1d(torque).tolist()
    torques = np.array([checks.finite_nonnegative("torque", value) for value in values])
    if not values:
        raise ValueError("torque = [] is not allowed: it must have at least one value")
    pairs = tooth_pairs(mesh, phases, **options)
    loads = mesh.load(torques)
    sharing = pairs.share(loads)
    # Without a load the forces are rounding errors, and load shares are undefined.
    share = np.full_like(sharing.force, math.nan)
    np.divide(sharing.force, loads[:, None, None], out=share, where=loads[:, None, None] > 0.0)
    grid, grid_of_pairs = ("torque", "phase"), ("phase", "tooth_pair")
    data = {
        "transmission_error": (grid, sharing.error),
        "load_share": ((*grid, "tooth_pair"), share),
        "pairs_in_contact": (grid, sharing.touching.sum(-1)),
        "mesh_stiffness": (grid, sharing.stiffness.sum(-1)),
        "path_position": (grid_of_pairs, np.where(pairs.inside, pairs.position, math.nan)),
        "gap": (grid_of_pairs, np.where(pairs.inside, pairs.gap, math.nan)),
        "peak_to_peak_error": ("torque", np.ptp(sharing.error, axis=1)),
        "effective_contact_ratio": ("torque", _contact_ratios(mesh, pairs, sharing, phases)),
        "mesh_force": ("torque", loads),
    }
    turns = math.tau * np.arange(pairs.pitches.size) / phases
    coords = {"torque": torques, "phase": turns, "tooth_pair": np.arange(pairs.gap.shape[1])}
    title = "Static transmission error and load sharing of a gear mesh"
    return describe(xr.Dataset(data, coords, {"title": title}))


def _contact_ratios(mesh, pairs, sharing, phases):
    """Return the effective contact ratio, the mean number of touching pairs, at each load."""
    overlap = np.where(pairs.inside, pairs.overlap(sharing), -math.inf)
    m, k = pairs.gap.shape
    # Follow each pair along its path, from the first phase at which it is in mesh.
    offsets = pairs.pitches[:phases] % 1.0
    start = int(np.argmin(offsets))
    steps = np.arange(k * phases)
    pitches = (np.sort(offsets) + np.arange(k)[:, None]).ravel()
    steps = steps[pitches < mesh.contact_ratio]
    pitches = pitches[: steps.size]
    ratios = []
    for load_overlap in overlap:
        length = 0.0
        for first in range(start, start + m, phases):
            # After one mesh period a pair has the next index.
            values = load_overlap[(first + steps) % m, steps // phases]
            above, below = np.maximum(values, 0.0), np.maximum(-values, 0.0)
            above, below = above[:-1] + above[1:], below[:-1] + below[1:]
            # In a step with a change of sign, linear interpolation gives the part in contact.
            length += above / (above + below) @ np.diff(pitches)
            end = mesh.contact_ratio - pitches[-1]
            length += pitches[0] * (values[0] > 0.0) + end * (values[-1] > 0.0)
        ratios.append(length * phases / m)
    return ratios


def optimum_relief(mesh, torque, *, length=None, shape="linear", phases=256, **options):
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
    load = checks.drawn_mesh(mesh).load(checks.finite_positive("torque", torque))
    count = math.floor(mesh.contact_ratio)
    long = (mesh.contact_ratio - count) * mesh.base_pitch
    longest = mesh.longest_relief
    fixed = {"long": long, "short": long / 2.0}.get(length, length)
    if fixed is not None:
        allowed = f"'long', 'short' or > 0 and <= {longest:.6g} m, (eps_alpha - 1) p_bt"
        fixed = checks.number("length", fixed, allowed, lambda v: 0.0 < v <= longest)
    mesh = mesh.with_reliefs(None, None)
    pairs = tooth_pairs(mesh, phases, **options)
    # Deflections of single pairs under the load at the end and at the start of contact.
    compliance = np.einsum("mii->mi", pairs.compliance) - pairs.compliance[:, 0, -1, None]
    compliance, position = compliance[pairs.inside], pairs.position[pairs.inside]
    ends = position.argmax(), position.argmin()
    deflections = [compliance[end] * load / count for end in ends]

    def reliefs(variables):
        """Return both reliefs of variables: amounts over deflections, length over the long one."""
        relief_length = fixed if fixed is not None else long * variables[2]
        return [
            TipRelief(amount=amount * deflection, length=relief_length, shape=shape)
            for amount, deflection in zip(variables[:2], deflections, strict=True)
        ]

    def error(variables):
        """Return the dimensionless transmission error over the phases."""
        relieved = mesh.with_reliefs(*reliefs(variables))
        gap = pairs.gap + relief_gap(relieved, pairs.position)
        return replace(pairs, gap=gap).share([load]).error[0] / sum(deflections)

    bounds = [(0.0, 4.0)] * 2 + [(0.2, 1.0)] * (fixed is None)
    optimum = np.ones(len(bounds))
    if np.ptp(error(optimum)) > _FLATNESS_TOLERANCE:
        # There are several local minima, so a grid comes before the descents.
        axes = [_GRID_AMOUNTS] * 2 + [_GRID_LENGTHS] * (fixed is None)
        grid = sorted(itertools.product(*axes), key=lambda point: np.ptp(error(point)))
        starts = (optimum, *grid[:_DESCENTS])
        minima = [_minimum_range(error, start, bounds) for start in starts]
        # The first of equal candidates is taken.
        candidates = [optimum, *minima, grid[0]]
        optimum = min(candidates, key=lambda point: round(float(np.ptp(error(point))), _DIGITS))
    return mesh.with_reliefs(*reliefs(np.round(optimum, _DIGITS)))


def _minimum_range(function, start, bounds):
    """Return the variables that minimize max - min of a vector function, by SLSQP from a start."""
    from scipy.optimize import minimize

    def constraints(extended):
        """Return the distances of the values from their bounds, the last two variables."""
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
