"""Static transmission error of a mesh over phase and load, and the tip relief that flattens it."""

import itertools
import math
from dataclasses import replace

import numpy as np
import xarray as xr

from gearlib import checks
from gearlib.data.variables import describe
from gearlib.models.geometry.gear import SHAPES, TipRelief
from gearlib.models.geometry.load_sharing import relief_gap, tooth_pairs

#: Over the deflection: an error below is flat up to rounding.
_FLAT = 1e-12
#: Decimals of the optimum: further ones follow from rounding and differ between machines.
_DIGITS = 6
#: Grid of the search for the optimum relief: amounts over the deflection of a pair, lengths over
#: the long one. The descent starts from so many of its best points.
_AMOUNTS = 0.25, 0.5, 0.75, 1.0, 1.25, 1.75
_LENGTHS = 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0
_STARTS = 2


def transmission_error(mesh, torque, phases=256, **options):
    """Return the static transmission error as a dataset; see `Mesh.transmission_error`."""
    values = np.atleast_1d(torque).tolist()
    torques = np.array([checks.finite_nonnegative("torque", value) for value in values])
    if not values:
        raise ValueError("torque = [] is not allowed: it must have at least one value")
    pairs = tooth_pairs(mesh, phases, **options)
    loads = mesh.load(torques)
    sharing = pairs.share(loads)
    # Without load rounding leaves forces, of which no pair has a share.
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
    """Return the mean number of pairs that touch: the length of contact in base pitches."""
    overlap = np.where(pairs.inside, pairs.overlap(sharing), -math.inf)
    m, k = pairs.gap.shape
    # Each pair along its way, from the first phase at which it is in mesh.
    since = pairs.pitches[:phases] % 1.0
    start = int(np.argmin(since))
    steps = np.arange(k * phases)
    way = (np.sort(since) + np.arange(k)[:, None]).ravel()
    steps = steps[way < mesh.contact_ratio]
    way = way[: steps.size]
    ratios = []
    for course in overlap:
        total = 0.0
        for first in range(start, start + m, phases):
            # Behind the last phase of a mesh period it is the next one of the pairs.
            at = course[(first + steps) % m, steps // phases]
            above, below = np.maximum(at, 0.0), np.maximum(-at, 0.0)
            above, below = above[:-1] + above[1:], below[:-1] + below[1:]
            # Where it changes its sign, the part of the step that a straight line spends above 0.
            total += above / (above + below) @ np.diff(way)
            total += way[0] * (at[0] > 0.0) + (mesh.contact_ratio - way[-1]) * (at[-1] > 0.0)
        ratios.append(total * phases / m)
    return ratios


def optimum_relief(mesh, torque, *, length=None, shape="linear", phases=256, **options):
    """Return the mesh with the tip reliefs of least peak-to-peak transmission error at a load.

    Where the compliance q of pairs of teeth is the same all along the path, linear relief over all
    of the segment with n + 1 pairs in mesh that takes back the tip by the deflection of n pairs
    leaves no error at all: C_a = q F / n (Harris 1958, n = 1). Else amounts up to four
    times that are sought, from the best of a grid by sequential quadratic programming. Other
    reliefs may leave as little, or some percent less.

    Parameters
    ----------
    mesh : gearlib.geometry.Mesh
        Of spur gears; tip reliefs that it has are replaced.
    torque : float
        Design load of the pinion, N m; finite, > 0.
    length : {"long", "short"} or float, optional
        Of both reliefs: "long", all of the segment with the most pairs in mesh, below a contact
        ratio of 2 (eps_alpha - 1) p_bt; "short", half of it; m. By default it is sought too, up to
        the long one.
    shape : {"linear", "parabolic"}, default "linear"
    phases, stiffness, coupling, deviation, pitch_errors
        As of `Mesh.transmission_error`.

    Returns
    -------
    gearlib.geometry.Mesh
        Its gears have the optimum `TipRelief`, each with its amount.

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
    # Deflection of single pairs under the load where contact ends and where it begins.
    compliance = np.einsum("mii->mi", pairs.compliance) - pairs.compliance[:, 0, -1, None]
    compliance, position = compliance[pairs.inside], pairs.position[pairs.inside]
    start = [compliance[at] * load / count for at in (position.argmax(), position.argmin())]

    def reliefs(values):
        span = fixed if fixed is not None else long * values[2]
        return [
            TipRelief(amount=value * unit, length=span, shape=shape)
            for value, unit in zip(values[:2], start, strict=True)
        ]

    def course(values):
        changed = mesh.with_reliefs(*reliefs(values))
        gap = pairs.gap + relief_gap(changed, pairs.position)
        return replace(pairs, gap=gap).share([load]).error[0] / sum(start)

    bounds = [(0.0, 4.0)] * 2 + [(0.2, 1.0)] * (fixed is None)
    guess = np.ones(len(bounds))
    if np.ptp(course(guess)) > _FLAT:
        # There are several valleys: a grid comes before the descent.
        grid = [_AMOUNTS] * 2 + [_LENGTHS] * (fixed is None)
        tried = sorted(itertools.product(*grid), key=lambda values: np.ptp(course(values)))
        minima = [_least_range(course, first, bounds) for first in (guess, *tried[:_STARTS])]
        # Of equals the first, where single contact alone decides.
        best = [guess, *minima, tried[0]]
        guess = min(best, key=lambda values: round(float(np.ptp(course(values))), _DIGITS))
    return mesh.with_reliefs(*reliefs(np.round(guess, _DIGITS)))


def _least_range(course, first, bounds):
    """Return the values at which the range of a course is least, by a descent from a start."""
    from scipy.optimize import minimize

    values = course(first)
    minimum = minimize(
        lambda at: at[-1] - at[-2],
        [*first, values.min(), values.max()],
        method="SLSQP",
        bounds=[*bounds, (None, None), (None, None)],
        constraints={
            "type": "ineq",
            "fun": lambda at: np.concatenate([c := course(at[:-2]) - at[-2], at[-1] - at[-2] - c]),
        },
        options={"maxiter": 50, "ftol": 1e-9},
    )
    return np.clip(minimum.x[:-2], *np.transpose(bounds))
