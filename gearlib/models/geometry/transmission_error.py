"""Static transmission error of a mesh, and the tip relief that minimizes it."""

import itertools
import math
from dataclasses import fields, replace
from numbers import Real
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike

from gearlib import checks
from gearlib.data.motions import as_float_array
from gearlib.data.variables import add_metadata
from gearlib.models.geometry.gear import Shape, TipRelief, tip_relief_gap
from gearlib.models.geometry.iso import pair_stiffness
from gearlib.models.geometry.load_sharing import (
    MIN_SLICES,
    LoadSharing,
    ToothPairs,
    check_pitch_errors,
    tooth_pairs,
)
from gearlib.models.harmonics import Harmonics
from gearlib.parameters import DrivingTorque, Phases, checked

if TYPE_CHECKING:
    from gearlib.models.geometry.gear_stage import GearStage

#: Maximum of (number of slices) * (number of phases) for helical faces, about 0.3 GB.
_MAX_SLICES_AT_PHASES = 600_000
#: Deflection, in modules, under the small load that replaces a load of 0 on helical gears.
_LIGHT_DEFLECTION = 1e-9
#: Peak-to-peak errors below this fraction of the deflection are rounding errors.
_FLATNESS_TOLERANCE = 1e-12
#: Number of decimals of the optimum; further decimals are affected by rounding errors.
_DECIMALS = 6
#: Search grid and bounds for the optimum relief, in the scaled variables of `optimum_relief`.
_GRID_AMOUNTS = *(n / 10 for n in range(1, 11)), 1.25, 1.6, 2.0, 2.5, 3.0
_GRID_LENGTHS = 0.4, 0.5, *(n / 20 for n in range(12, 21))
_MAX_AMOUNT, _MIN_LENGTH = 4.0, 0.01
#: Numbers of minimizations from grid minima over all variables, and over the amounts alone.
_START_COUNTS = 2, 4
#: Shifts of the length from the best minimum, at which further minimizations start.
_LENGTH_SHIFTS = -0.05, -0.025, 0.025, 0.05
#: Initial steps of the simplex method, and maximum number of evaluations.
_INITIAL_STEPS, _MAX_EVALUATIONS = (0.1, 0.1, -0.05), 200
#: Search grid for helical gears: amounts over the mean deflection, lengths over the longest relief,
#: and maximum number of phases.
_HELICAL_AMOUNTS, _HELICAL_LENGTHS = (0.0, 0.25, 0.5, 1.0, 2.0), (0.25, 0.5, 0.75, 1.0)
_HELICAL_PHASES = 64
#: Maximum numbers of phases for the search grid and for the minimizations that start there.
_GRID_PHASES, _SIMPLEX_PHASES = 64, 512
#: Number of phases and maximum number of harmonics of the transmission error that excites a train.
#: Twice as many harmonics change dynamic factors by less than 1 %; below a fifteenth of the main
#: resonance speed, where these are at most 1.1, by up to 2 %.
_ERROR_PHASES, _ERROR_HARMONICS = 256, 32
#: Harmonics after the last one above this fraction of the mean error are omitted.
_MIN_ERROR_AMPLITUDE = 1e-4


def transmission_error(
    stage: "GearStage", torque: ArrayLike, phases: int = 256, **options: Any
) -> xr.Dataset:
    """Compute the static transmission error and the load sharing of a mesh as a dataset.

    `torque` is the pinion torque in N m, a number >= 0 or a sequence, and `phases` is the number of
    phases per mesh period. `GearStage.transmission_error` describes `options`, such as the
    stiffness method, and the variables. For helical gears, slices are linearized at each load, and
    gaps are omitted.
    """
    torques = np.atleast_1d(as_float_array(torque))
    valid = torques.ndim == 1 and torques.size and ((torques >= 0.0) & (torques < math.inf)).all()
    checks.require(valid, "torque", torque, "a finite number >= 0, or at least one in a sequence")
    loads = stage.load(torques)
    is_spur = stage.overlap_ratio == 0.0
    if is_spur:
        pairs = tooth_pairs(stage, phases, **options)
        equilibrium = pairs.solve_for_loads(loads)
    else:
        pairs, equilibrium = _solve_helical_equilibrium(stage, phases, loads, options)
    # Without load, the forces are rounding errors, and load shares are undefined.
    load_share = np.full_like(equilibrium.force, math.nan)
    total_forces = loads[:, None, None]
    np.divide(equilibrium.force, total_forces, out=load_share, where=total_forces > 0.0)
    dims, pair_dims = ("torque", "phase"), ("phase", "tooth_pair")
    data = {
        "transmission_error": (dims, equilibrium.displacement),
        "load_share": ((*dims, "tooth_pair"), load_share),
        "pairs_in_contact": (dims, equilibrium.touching.sum(-1)),
        "mesh_stiffness": (dims, equilibrium.stiffness.sum(-1)),
        "path_position": (pair_dims, pairs.position),
        "peak_to_peak_error": ("torque", np.ptp(equilibrium.displacement, axis=1)),
        "mesh_force": ("torque", loads),
    }
    if is_spur:
        data["path_position"] = pair_dims, np.where(pairs.can_touch, pairs.position, math.nan)
        data["gap"] = pair_dims, np.where(pairs.can_touch, pairs.gap, math.nan)
        contact_ratios = _effective_contact_ratios(stage, pairs, equilibrium, phases)
    else:
        contact_ratios = equilibrium.touching.sum(-1).mean(-1)
    data["effective_contact_ratio"] = "torque", contact_ratios
    mesh_phase = math.tau * np.arange(pairs.pitches.size) / phases
    coords = {"torque": torques, "phase": mesh_phase, "tooth_pair": np.arange(pairs.gap.shape[1])}
    title = "Static transmission error and load sharing of a gear mesh"
    return add_metadata(xr.Dataset(data, coords, {"title": title}))


def transmission_error_harmonics(stage: "GearStage", load: float, **options: Any) -> Harmonics:
    """Compute the harmonics of the transmission error in m, without its mean, under a load in N.

    They are harmonics of the mesh phase if the pinion drives. Corner contact is included, and pitch
    errors are ignored. `options` are fields of `PairOptions`: stiffness ("energy" or "iso"),
    coupling and twist.
    """
    pairs = tooth_pairs(
        stage, _ERROR_PHASES, pitch_errors=(0.0,), corners=True, load=load, **options
    )
    (error,) = pairs.solve_for_loads([load]).displacement
    phase = math.tau * np.arange(_ERROR_PHASES) / _ERROR_PHASES
    harmonics = Harmonics.from_table(phase, error, _ERROR_HARMONICS)
    # Omit the harmonics after the last significant one.
    amplitudes = np.hypot(harmonics.cosines, harmonics.sines)
    significant = np.flatnonzero(amplitudes > _MIN_ERROR_AMPLITUDE * error.mean())
    count = int(significant.max(initial=-1)) + 1
    return Harmonics(harmonics.cosines[:count], harmonics.sines[:count])


def _solve_helical_equilibrium(stage, phases, loads, options) -> tuple[ToothPairs, LoadSharing]:
    """Compute the equilibrium of helical gears; return (pairs at the first load, equilibrium).

    `phases` is the number of phases per mesh period, `loads`, shape (n,), is in N, and `options` is
    a dict of options of `tooth_pairs_at`, such as pitch_errors. Since the slices are linearized at
    a load > 0, a load of 0 is replaced by a very small one.
    """
    period_count = check_pitch_errors(
        stage, options.get("pitch_errors")
    ).size  # one error per period
    max_slices = _MAX_SLICES_AT_PHASES / period_count
    max_phases = min(max_slices / MIN_SLICES, math.sqrt(max_slices / stage.overlap_ratio))
    allowed = f"at most {max_phases:.0f}, where the faces of helical gears are divided into slices"
    checks.require(phases <= max_phases, "phases", phases, allowed)
    light_load = _LIGHT_DEFLECTION * stage.pinion.module * pair_stiffness(stage)
    pair_options = {"intervals": phases, **options}
    pairs_at_loads, equilibria = [], []
    for load in loads:
        pairs = tooth_pairs(stage, phases, load=max(load, light_load), **pair_options)
        pairs_at_loads.append(pairs)
        equilibria.append(pairs.solve_for_loads([load]))
    # Concatenate the fields of the equilibria along the axis of the loads.
    arrays = [
        [getattr(sharing, field.name) for sharing in equilibria] for field in fields(LoadSharing)
    ]
    return pairs_at_loads[0], LoadSharing(*map(np.concatenate, arrays))


def _effective_contact_ratios(stage, pairs, equilibrium, phases) -> list[float]:
    """Return the effective contact ratio, i.e. the mean number of pairs in contact, at each load.

    `pairs` are the `ToothPairs` of spur gears at equally spaced phases, `phases` of them per mesh
    period, and `equilibrium` is their `LoadSharing` under the loads.
    """
    # The overlap is positive for pairs in contact.
    overlap = np.where(pairs.can_touch, pairs.overlap(equilibrium), -math.inf)
    phase_count, pair_count = pairs.gap.shape
    # Follow each pair along the path of contact, from the first phase at which it is in mesh.
    offsets = pairs.pitches[:phases] % 1.0
    start = int(np.argmin(offsets))
    steps = np.arange(pair_count * phases)
    pitches = (np.sort(offsets) + np.arange(pair_count)[:, None]).ravel()
    steps = steps[pitches < stage.contact_ratio]
    pitches = pitches[: steps.size]
    remaining_path = stage.contact_ratio - pitches[-1]
    ratios = []
    for overlap_at_load in overlap:
        length = 0.0  # total length of contact of all pairs, in base pitches
        for first_phase in range(start, start + phase_count, phases):
            # The index of a pair increases by 1 in each mesh period.
            path_overlap = overlap_at_load[(first_phase + steps) % phase_count, steps // phases]
            positive, negative = np.maximum(path_overlap, 0.0), np.maximum(-path_overlap, 0.0)
            positive, negative = positive[:-1] + positive[1:], negative[:-1] + negative[1:]
            # Fraction of each interval in contact, with linear interpolation of the overlap.
            length += positive / (positive + negative) @ np.diff(pitches)
            start_length = pitches[0] * (path_overlap[0] > 0.0)
            length += start_length + remaining_path * (path_overlap[-1] > 0.0)
        ratios.append(length * phases / phase_count)
    return ratios


@checked
def optimum_relief(
    stage: "GearStage",
    torque: DrivingTorque,
    *,
    length: str | float | None = None,
    shape: Shape = "linear",
    phases: Phases = 256,
    **options: Any,
) -> "GearStage":
    """Optimize the tip reliefs of a stage for the smallest peak-to-peak transmission error.

    If all tooth pairs have the same constant compliance q, there is a relief with zero error: it is
    linear over the whole segment with n + 1 pairs in mesh, and its amount is the deflection of n
    pairs, C_a = q F / n, under the load F (Harris 1958, n = 1). Otherwise, the simplex method of
    Nelder and Mead starts from the best points of a grid, and sequential quadratic programming
    (SLSQP) from the best of these minima. The error over discrete phases has many local minima, so
    that another relief may be about one percent better. For helical gears, whose face is divided
    into slices, only the simplex method is used, at few phases and from the best point of a coarse
    grid.

    Parameters
    ----------
    stage : gearlib.geometry.GearStage
        Gears; their tip reliefs are replaced.
    torque : float
        Design torque of the pinion, N m; finite, > 0.
    length : {"long", "short"} or float, optional
        Length of both reliefs: "long" is the whole segment with the most pairs in mesh, which is
        (eps_alpha - 1) p_bt for contact ratios below 2; "short" is half of it; or a length in m. By
        default the length is optimized too, up to (eps_alpha - 1) p_bt.
    shape : {"linear", "parabolic"}, default "linear"
        Shape of both reliefs.
    phases, stiffness, coupling, deviation, pitch_errors
        Options of `GearStage.transmission_error`.

    Returns
    -------
    gearlib.geometry.GearStage
        The stage whose gears have the optimum `TipRelief`.

    Raises
    ------
    ValueError
        If a value is not allowed; the message names parameter, value and range.
    """
    from scipy.ndimage import minimum_filter

    load = checks.check_gear_stage(stage).load(torque)
    stage = stage.with_reliefs(None, None)
    pair_count = math.floor(stage.contact_ratio)
    max_length = stage.longest_relief
    long_length = min((stage.contact_ratio - pair_count) * stage.base_pitch, max_length)
    named_lengths = {"long": long_length, "short": long_length / 2.0}
    fixed_length = named_lengths[length] if checks.is_one_of(length, named_lengths) else length
    if fixed_length is not None:
        allowed = f"'long', 'short' or > 0 and <= {max_length:.6g} m, (eps_alpha - 1) p_bt"
        is_valid = isinstance(fixed_length, Real) and 0.0 < fixed_length <= max_length
        checks.require(is_valid and fixed_length is not True, "length", fixed_length, allowed)
    # The amount of a tip relief must be less than half of the tooth thickness at the tip.
    gears = (stage.pinion, stage.wheel)
    max_amounts = [0.499 * gear.thickness_at(gear.tip_diameter) for gear in gears]
    if stage.overlap_ratio > 0.0:
        return _optimize_helical_relief(
            stage, torque, fixed_length, shape, max_amounts, phases, options
        )
    pairs = tooth_pairs(stage, phases, **options)
    # Deflections of single pairs under the load, at the end and at the start of contact.
    compliance = np.einsum("mii->mi", pairs.compliance) - pairs.compliance[:, 0, -1, None]
    compliance, position = compliance[pairs.can_touch], pairs.position[pairs.can_touch]
    ends = position.argmax(), position.argmin()
    deflections = [compliance[end] * load for end in ends]

    def unscale_variables(points):
        """Convert n points of scaled variables to the amounts of both reliefs and their length, m.

        Unless there is a `fixed_length`, the last variable is the length over `max_length`. The
        first two are the amounts over `deflections`, times the square of this relative length, so
        that the valley of small errors is parallel to the axis of the length.
        """
        *scaled_amounts, length = np.transpose(points)
        if fixed_length is not None:
            scaled_amounts.append(length)
            length = np.full(len(points), fixed_length / max_length)
        amounts = []
        for i, scaled_amount in enumerate(scaled_amounts):
            amount = scaled_amount / length**2 * deflections[i]
            amounts.append(np.minimum(amount, max_amounts[i]))
        return *amounts, max_length * length

    def relative_errors(points, pairs=pairs):
        """Return the transmission errors, over the sum of `deflections`, of n points at m phases.

        A point consists of scaled variables; `pairs` are the `ToothPairs` at the m phases. The
        result has the shape (n, m).
        """
        *amounts, length = (values[:, None, None] for values in unscale_variables(points))
        tip_distances = stage.path[1] - pairs.position, pairs.position - stage.path[0]
        gap = pairs.gap
        for tip_distance, amount in zip(tip_distances, amounts, strict=True):
            gap = gap + tip_relief_gap(tip_distance, amount, length, shape)
        # The phases are repeated for each point, so that all points are solved at once.
        repeated = pairs.select_phases(np.tile(np.arange(len(pairs.gap)), len(points)))
        repeated = replace(repeated, gap=gap.reshape(repeated.gap.shape))
        displacement = repeated.solve_for_loads([load]).displacement
        return displacement.reshape(len(points), -1) / sum(deflections)

    def select_pairs(count):
        """Return the `ToothPairs` at no more than `count` equally spaced phases."""
        return pairs.select_phases(np.arange(0, len(pairs.gap), math.ceil(len(pairs.gap) / count)))

    is_length_free = fixed_length is None
    length = (long_length if is_length_free else fixed_length) / max_length
    optimum = np.array([length**2 / pair_count] * 2 + [length] * is_length_free)
    if np.ptp(relative_errors([optimum])) > _FLATNESS_TOLERANCE:
        scale = 1.0 if is_length_free else length**2
        bounds = [(0.0, _MAX_AMOUNT * scale)] * 2 + [(_MIN_LENGTH, 1.0)] * is_length_free
        axes = [np.array(_GRID_AMOUNTS) * scale] * 2 + [_GRID_LENGTHS] * is_length_free
        points = list(itertools.product(*axes))
        ranges = np.ptp(relative_errors(points, select_pairs(_GRID_PHASES)), axis=1)
        start_indices: dict[int, None] = {}  # used as an ordered set
        # A grid point is a local minimum if no point in its neighbourhood has a smaller error.
        neighbourhoods = 3, (3, 3, 1)[: len(axes)]
        for neighbourhood, count in zip(neighbourhoods, _START_COUNTS, strict=True):
            grid_ranges = ranges.reshape([len(axis) for axis in axes])
            local_minima = minimum_filter(grid_ranges, neighbourhood)
            minima = np.flatnonzero(ranges == local_minima.ravel())
            best_minima = sorted(minima, key=lambda index: ranges[index])[:count]
            start_indices |= dict.fromkeys(best_minima)
        fine_pairs = select_pairs(_SIMPLEX_PHASES)

        def peak_to_peak_error(variables):
            """Return the relative peak-to-peak error of one point of scaled variables."""
            return float(np.ptp(relative_errors([variables], fine_pairs)))

        minima = [
            _minimize_nelder_mead(peak_to_peak_error, points[index], bounds)
            for index in start_indices
        ]
        minimum = min(minima, key=peak_to_peak_error)
        # The valley has a local minimum wherever the reliefs begin at one of the phases.
        shifted_points = [minimum + [0.0, 0.0, shift] for shift in _LENGTH_SHIFTS * is_length_free]
        minima = [
            minimum,
            *(_minimize_nelder_mead(peak_to_peak_error, start, bounds) for start in shifted_points),
        ]
        minimum = min(minima, key=peak_to_peak_error)
        # If only single contact determines the error, many reliefs are equally good. The one near
        # the relief of Harris, the first candidate, is preferred.
        candidates: list[Any] = [optimum]
        for start in (optimum, minimum):
            candidates += [
                _minimize_range(lambda point: relative_errors([point])[0], start, bounds),
                start,
            ]
        optimum = min(
            candidates, key=lambda point: round(np.ptp(relative_errors([point])), _DECIMALS)
        )
        optimum = np.round(optimum, _DECIMALS)
    *amounts, length = (values.item() for values in unscale_variables([optimum]))
    reliefs = [TipRelief(amount=amount, length=length, shape=shape) for amount in amounts]
    return stage.with_reliefs(*reliefs)


def _optimize_helical_relief(
    stage: "GearStage",
    torque: float,
    fixed_length,
    shape: str,
    max_amounts: list,
    phases: int,
    options: dict,
) -> "GearStage":
    """Optimize the tip reliefs of helical gears for the smallest peak-to-peak transmission error.

    `torque` is the pinion torque in N m. `fixed_length` is the length of both reliefs in m, or None
    to optimize it, and `shape` is their shape, "linear" or "parabolic". `max_amounts` are the
    largest amounts for (pinion, wheel) in m. No more than `phases` phases per mesh period are used;
    `options` is a dict of options of `GearStage.transmission_error`, such as the stiffness method.
    """
    phases = min(phases, _HELICAL_PHASES)
    max_length = stage.longest_relief
    unrelieved = stage.transmission_error(torque, phases=phases, **options)
    deflection = float(unrelieved.transmission_error.mean())

    def relieved_stage(variables):
        """Return the stage with the tip reliefs given by scaled variables.

        The first two are the amounts for (pinion, wheel) over the mean `deflection`. Unless there
        is a `fixed_length`, the third is the length of both reliefs over `max_length`.
        """
        length = float(max_length * variables[2]) if fixed_length is None else fixed_length
        reliefs = []
        for relative_amount, max_amount in zip(variables[:2], max_amounts, strict=True):
            amount = min(float(relative_amount) * deflection, max_amount)
            reliefs.append(TipRelief(amount=amount, length=length, shape=shape))
        return stage.with_reliefs(*reliefs)

    def relative_error(variables):
        """Return the peak-to-peak transmission error over the mean `deflection`."""
        relieved = relieved_stage(variables).transmission_error(torque, phases=phases, **options)
        return relieved.peak_to_peak_error.item() / deflection

    lengths = [(length,) for length in _HELICAL_LENGTHS] if fixed_length is None else [()]
    points = []
    for amount, length in itertools.product(_HELICAL_AMOUNTS, lengths):
        points.append((amount, amount, *length))
    start = min(points, key=relative_error)
    bounds = [(0.0, _MAX_AMOUNT)] * 2 + [(_MIN_LENGTH, 1.0)] * len(lengths[0])
    return relieved_stage(np.round(_minimize_nelder_mead(relative_error, start, bounds), _DECIMALS))


def _minimize_nelder_mead(function, start, bounds) -> np.ndarray:
    """Minimize a function of several variables by the simplex method of Nelder and Mead.

    `function` takes the variables and returns a float, `start` is the initial point, and `bounds`
    are (lower, upper) for each variable. Return the variables at the minimum.
    """
    from scipy.optimize import minimize

    # Vertices of the initial simplex: the start, and one step from it in each variable.
    start = np.clip(start, *np.transpose(bounds))
    simplex = start + np.vstack([np.zeros(len(bounds)), np.diag(_INITIAL_STEPS[: len(bounds)])])
    options = {"initial_simplex": simplex, "maxfev": _MAX_EVALUATIONS, "xatol": 1e-4, "fatol": 1e-6}
    return minimize(function, start, method="Nelder-Mead", bounds=bounds, options=options).x


def _minimize_range(function, start, bounds) -> np.ndarray:
    """Minimize the range, max - min, of a vector function by sequential quadratic programming.

    `function` takes the variables and returns a vector, `start` is the initial point, and `bounds`
    are (lower, upper) for each variable. Return the variables at the minimum.
    """
    from scipy.optimize import minimize

    # SLSQP minimizes upper - lower, where lower and upper are two additional variables. The
    # constraints, which must be >= 0, keep all values of the function between them.
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
