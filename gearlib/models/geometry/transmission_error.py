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
from gearlib.models.geometry.gear import SHAPES, TipRelief, gap_of_relief
from gearlib.models.geometry.load_sharing import tooth_pairs

if TYPE_CHECKING:
    from gearlib.models.geometry.mesh import Mesh

#: A peak-to-peak error below this share of the deflection is a rounding error.
_FLATNESS_TOLERANCE = 1e-12
#: Decimals of the optimum; further ones depend on rounding and differ between machines.
_DECIMALS = 6
#: Grid of the search for the optimum relief: amounts over the deflection of a pair, lengths over
#: the longest one.
_GRID_AMOUNTS = tuple(n / 8 for n in range(1, 13))
_GRID_LENGTHS = 0.4, 0.5, 0.6, 0.65, 0.7, 0.75, 0.8, 0.85, 0.9, 0.95, 1.0
#: Bounds of amounts and lengths on the same scales, and first steps of a descent.
_MAX_AMOUNT, _MIN_LENGTH, _STEPS = 4.0, 0.01, (0.1, 0.1, -0.05)
#: Number of grid points from which a descent starts, and its largest number of evaluations.
_DESCENT_COUNTS, _RESTARTS, _MAX_EVALUATIONS = (3, 5), 2, 200
#: Largest numbers of phases in the grid and in its descents.
_GRID_PHASES, _DESCENT_PHASES = 64, 2048


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
    that value are searched from the best points of a grid by the simplex of Nelder and Mead, and
    the best one by sequential quadratic programming. There are many local minima, because the
    error is the range at discrete phases: another relief may be a percent better.

    Parameters
    ----------
    mesh : gearlib.geometry.Mesh
        Spur gears; their tip reliefs are replaced.
    torque : float
        Design torque of the pinion, N m; finite, > 0.
    length : {"long", "short"} or float, optional
        Length of both reliefs: "long" is the whole segment with the most pairs in mesh, which is
        (eps_alpha - 1) p_bt for contact ratios below 2; "short" is half of it; or a length in m. By
        default the length is optimized too, up to (eps_alpha - 1) p_bt.
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
    from scipy.ndimage import minimum_filter

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
    deflections = [compliance[end] * load for end in ends]

    def values_in_m(points):
        """Return both amounts and the length, m, of n points in the space of the variables, (n,).

        Variables are amounts over `deflections` and, without `fixed_length`, length over `limit`.
        """
        pinion_amount, wheel_amount, *lengths = np.transpose(points)
        length = limit * lengths[0] if lengths else np.full(len(points), fixed_length)
        return pinion_amount * deflections[0], wheel_amount * deflections[1], length

    def errors(points, pairs=pairs):
        """Return the transmission errors at m phases over the sum of both deflections, (n, m)."""
        *amounts, length = (values[:, None, None] for values in values_in_m(points))
        distances = mesh.path[1] - pairs.position, pairs.position - mesh.path[0]  # from both tips
        gap = pairs.gap
        for distance, amount in zip(distances, amounts, strict=True):
            gap = gap + gap_of_relief(distance, amount, length, shape)
        repeated = pairs.at_phases(np.tile(np.arange(len(pairs.gap)), len(points)))
        repeated = replace(repeated, gap=gap.reshape(repeated.gap.shape))
        displacement = repeated.forces_under_loads([load]).displacement
        return displacement.reshape(len(points), -1) / sum(deflections)

    # A tip relief is less than half of the thickness of the tip.
    tips = [0.499 * gear.thickness_at(gear.tip_diameter) for gear in (mesh.pinion, mesh.wheel)]
    upper = [min(_MAX_AMOUNT, tip / d) for tip, d in zip(tips, deflections, strict=True)]
    bounds = [(0.0, amount) for amount in upper] + [(_MIN_LENGTH, 1.0)] * (fixed_length is None)
    optimum = np.array([*np.minimum(1.0 / pair_count, upper), long_length / limit][: len(bounds)])
    if np.ptp(errors([optimum])) > _FLATNESS_TOLERANCE:
        coarse_pairs, fine_pairs = (
            pairs.at_phases(np.arange(0, pairs.pitches.size, math.ceil(pairs.pitches.size / count)))
            for count in (_GRID_PHASES, _DESCENT_PHASES)
        )
        axes = [_GRID_AMOUNTS] * 2 + [_GRID_LENGTHS] * (fixed_length is None)
        points = list(itertools.product(*axes))
        ranges = np.ptp(errors(points, coarse_pairs), axis=1)
        starts: dict[int, None] = {}
        # There is a minimum over the amounts at most lengths, with many more between them.
        for size, count in ((3, _DESCENT_COUNTS[0]), ((3, 3, 1)[: len(axes)], _DESCENT_COUNTS[1])):
            lowest = minimum_filter(ranges.reshape([len(axis) for axis in axes]), size)
            minima = np.flatnonzero(ranges == lowest.ravel())
            starts |= dict.fromkeys(sorted(minima, key=lambda index: ranges[index])[:count])

        def range_of_error(variables):
            return float(np.ptp(errors([variables], fine_pairs)))

        minima = [_descend(range_of_error, points[index], bounds) for index in starts]
        for _ in range(_RESTARTS):
            minima.append(_descend(range_of_error, min(minima, key=range_of_error), bounds))
        minimum = min(minima, key=range_of_error)
        minimax = _minimize_range(lambda variables: errors([variables])[0], minimum, bounds)
        candidates = [optimum, minimum, minimax]
        optimum = min(candidates, key=lambda point: round(np.ptp(errors([point])), _DECIMALS))
    *amounts, length = (values.item() for values in values_in_m([np.round(optimum, _DECIMALS)]))
    return mesh.with_reliefs(*(TipRelief(amount=a, length=length, shape=shape) for a in amounts))


def _descend(function, start, bounds) -> np.ndarray:
    """Return the variables at a minimum of a function near `start`, by Nelder and Mead."""
    from scipy.optimize import minimize

    start = np.clip(start, *np.transpose(bounds))
    simplex = start + np.vstack([np.zeros(len(bounds)), np.diag(_STEPS[: len(bounds)])])
    options = {"initial_simplex": simplex, "maxfev": _MAX_EVALUATIONS, "xatol": 1e-4, "fatol": 1e-6}
    return minimize(function, start, method="Nelder-Mead", bounds=bounds, options=options).x


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
