"""Compute motions of models with scattering parameters (`scatter`) and Sobol' indices.

Motions are computed in one call or in shards; the division into shards does not change the result.
Statistics never mix two motions: upward sweeps, downward sweeps and runs from random initial states
are kept separate.

Sobol' indices are fractions of the variance of a quantity. The first-order index of a parameter is
the fraction that vanishes on average if this parameter is fixed; the total index is the fraction
that remains on average if all others are fixed (Saltelli et al.: Comput. Phys. Comm. 181 (2010)
259-270).
"""

import functools
import itertools
import json
import os
import warnings
from concurrent.futures import ThreadPoolExecutor
from typing import Annotated, Any, NamedTuple

import numpy as np
import xarray as xr
from annotated_types import Ge, Gt, Le, Lt
from scipy.stats import bootstrap, qmc

from gearlib import checks
from gearlib.data.files import canonical_json
from gearlib.data.motions import largest_force
from gearlib.data.result import make_result
from gearlib.data.variables import add_metadata
from gearlib.parameters import INTEGER, Count, Limits, Speed, Unit, Values, WholeNumber, checked
from gearlib.progress import TimeLimit, with_progress_bar
from gearlib.runs.run_arguments import (
    MaxSeconds,
    Threads,
    check_memory,
    check_tuning,
    require_tuning_or_speed,
    tuning_at_speed,
)
from gearlib.runs.sweeping import check_tunings, sweep
from gearlib.uncertainty.designs import (
    FOUND,
    MAX_SAMPLES,
    NO_DESIGN,
    QUANTITIES,
    STATUS_MEANINGS,
    Designs,
    check_names,
    count_error_messages,
    quantity_evaluator,
)

#: Directions of sweeps; "cold" starts each speed from rest, "seeded" from a random state.
DIRECTIONS = ("up", "down", "cold", "seeded")
#: Default quantities.
_QUANTITIES = ("jump_up", "jump_down")
#: Quantiles of the bands.
QUANTILES = (0.05, 0.5, 0.95)
#: Motion on which a seeded run settles: the only motion of the upward and downward sweeps, the
#: lower or the higher of two motions, or another motion.
MOTIONS = ("only", "lower", "higher", "another")
#: Default limits of random initial states: displacement and dx/dtau, in units of the static
#: deflection.
DEFAULT_BOX = ((-6.0, 6.0), (-6.0, 6.0))
#: Motions are equal if the relative difference of their peak-to-peak displacements is below this.
_EQUAL_MOTION_TOLERANCE = 0.02
_STATUS_FLAGS = {
    "flag_values": np.arange(NO_DESIGN, len(STATUS_MEANINGS), dtype=np.int8),
    "flag_meanings": " ".join(("no_design", *STATUS_MEANINGS)),
}
#: Variable over (sample, direction, speed) -> its value if the design cannot be built.
_RUN_VARIABLES = {
    "height": np.float32(np.nan),  # peak-to-peak displacement
    "factor": np.float32(np.nan),  # dynamic factor
    "lost": np.int8(0),  # whether contact is lost
    "settled": np.int8(0),  # whether the motion repeats
    "run_status": np.int8(-1),
}


class SweepOptions(NamedTuple):
    """Options of the sweeps over speed that are computed for each design."""

    dimension: str  #: "speed", or "tuning" for models without rotational speed
    grid: np.ndarray  #: speeds in rpm or tunings, increasing
    directions: tuple  #: a subset of `DIRECTIONS`
    periods: int  #: mesh periods of each run
    record_periods: int  #: number of last periods that are evaluated
    box: tuple  #: limits of displacement and dx/dtau of random initial states


@checked
def scatter(
    model,
    tolerances,
    quantities=("jump_up", "jump_down"),
    n: Annotated[int, Ge(1), Le(MAX_SAMPLES), INTEGER] = 1024,
    *,
    speed: Speed | None = None,
    speeds=None,
    tunings=None,
    directions=("up", "down"),
    periods: Count = 120,
    record_periods: Count = 20,
    box: Annotated[tuple[Limits, ...], Values(2)] = DEFAULT_BOX,
    seed: WholeNumber = 0,
    threads: Threads = None,
    progress=None,
    max_seconds: MaxSeconds = None,
):
    """Compute how jumps, peaks and contact loss scatter with tolerances; return a dataset.

    Parameters
    ----------
    model : Model, StageDesign or callable
        A model with its `settable` parameters, a `gearlib.uncertainty.designs.StageDesign` of gears
        given by geometry, or a function that takes the parameters by name and returns a model.
    tolerances : mapping
        Name of a parameter -> ``{mean, std}``, ``{min, max}``, ``{nominal, upper, lower}`` with
        deviations from the nominal value, or ``{distribution, ...}``, a name of `scipy.stats`
        and its parameters; SI units. Values between limits are equally likely. ``correlations``, a
        list of [name, name, rho], are the correlations of a Gaussian copula.
    quantities : sequence of str
        Quantities of each design, names of `gearlib.uncertainty.designs.QUANTITIES`.
    n : int, default 1024
        Number of samples, points of a scrambled Sobol' sequence; powers of 2 are balanced.
    speed : float, optional
        Speed of the duty point, rpm, for quantities of the duty point.
    speeds, tunings : array_like of float, optional
        Speeds in rpm, or tunings of the nominal model, of the sweeps of each design.
    directions : sequence of {"up", "down", "cold", "seeded"}
        Directions of the sweeps; each run starts from rest ("cold") or a random state ("seeded").
    periods, record_periods : int
        Mesh periods of each run, and the number of last periods that are evaluated.
    box : pair of pairs of float
        Limits of displacement and dx/dtau of random initial states, in units of the static
        deflection.
    seed : int
        Seed of the scrambling.
    threads : int, optional
        Number of threads, by default of processors.
    progress : callable, optional
        Called with the number of samples finished since the last call.
    max_seconds : float, optional
        Time limit in seconds; the samples finished up to then are returned, see `gearlib.progress`.

    Returns
    -------
    xarray.Dataset
        Over ``sample``: parameters, quantities, their ``<quantity>_status`` (0: found), and
        ``refusal``, the reason why a design cannot be built. Scalars: ``<quantity>_nominal``, and
        ``_mean`` and ``_deviation`` of the values found. Over ``direction`` and ``speed``:
        contact_loss_probability, unsettled_share, run_count, failed_runs; with ``quantile``
        height_band and factor_band. Over ``speed``: two_motions_probability and, with seeded
        starts, motion_probability.

    Raises
    ------
    ValueError
        Naming the argument, its value and the allowed range.
    """
    run_options = {"quantities": quantities, "speed": speed, "seed": seed, "threads": threads}
    run_options |= {"progress": progress, "max_seconds": max_seconds}
    sweeps = {"speeds": speeds, "tunings": tunings, "directions": directions, "periods": periods}
    sweeps |= {"record_periods": record_periods, "box": box}
    return join_shards([shard(model, tolerances, n, 0, n, **run_options, **sweeps)])


def shard(
    model, tolerances, n, start, stop, *, quantities=_QUANTITIES, speed=None, seed=0, **options
) -> xr.Dataset:
    """Compute the designs with the indices `start` to `stop` - 1 of the n designs of a `scatter`.

    A design is the `model` with random values of its parameters within `tolerances`; `quantities`
    are computed for each design, at `speed` in rpm for a duty point. `options` are threads,
    progress, max_seconds and the arguments of the sweeps: speeds, tunings, directions, periods,
    record_periods and box. Return a dataset over these designs, without statistics.
    """
    threads, progress = options.pop("threads", None), options.pop("progress", None)
    checks.require(progress is None or callable(progress), "progress", progress, "a function")
    limit = TimeLimit(options.pop("max_seconds", None))
    quantities = check_names("quantities", quantities, tuple(QUANTITIES))
    designs = Designs(model, tolerances, seed)
    sweeps = _check_sweep_options(designs.nominal, **options)
    if sweeps is None and not quantities:
        raise checks.InputError("quantities", quantities, "at least one if no speeds are given")
    evaluator = quantity_evaluator(designs, quantities, speed) if quantities else None
    finished = np.zeros(stop - start, bool)
    options = {"threads": threads, "progress": progress, "limit": limit, "finished": finished}
    variables = _compute_samples(designs, sweeps, evaluator, range(start, stop), **options)
    coords: dict = {"sample": np.arange(start, stop)}
    attributes = {"tolerances": json.loads(json.dumps(tolerances, default=float))}
    attributes |= {"samples": n, "seed": designs.seed}
    if sweeps:
        coords |= {"direction": list(sweeps.directions), sweeps.dimension: sweeps.grid}
        attributes |= {name: getattr(sweeps, name) for name in ("periods", "record_periods", "box")}
    if evaluator:
        attributes["quantities"] = list(quantities)
        if speed is not None:
            attributes["speed"] = speed
    title = "Scatter of a gear mesh by its tolerances"
    dataset = make_result(title, designs.nominal, variables, coords, method="scatter", **attributes)
    return limit.record_missing(dataset, sample=finished)


def _compute_samples(designs, sweeps, evaluator, samples, threads, progress, limit, finished):
    """Compute a range of samples; return variables: parameters, runs, quantities, error messages.

    A sample is a set of random parameters. `designs` are the `Designs` that build their models,
    `sweeps` the `SweepOptions` of the runs over speed, or None, and `evaluator` the
    `DesignQuantities` that computes quantities such as jump speeds, or None. `progress` is called
    with 1 after each sample. The mask `finished`, (samples,), is set for the samples that are
    finished before the `TimeLimit` is reached.
    """
    count = len(samples)
    tables: dict = {}  # name of a variable of the runs -> array (samples, directions, speeds)
    if sweeps:
        shape = count, len(sweeps.directions), sweeps.grid.size
        # The variables of a run need less memory than two numbers of 8 bytes.
        numbers_per_sample = 2 * shape[1] * shape[2]
        check_memory(f"{count:,} samples", count, numbers_per_sample, row_name="samples")
        tables = {name: np.full(shape, fill) for name, fill in _RUN_VARIABLES.items()}
    quantities = evaluator.quantities if evaluator else ()
    results = np.full((count, len(quantities)), np.nan)
    codes = np.full(results.shape, NO_DESIGN, np.int8)
    messages = np.full(count, "", object)
    points = designs.points(samples.start, samples.stop)
    values = designs.values(points)

    def compute_sample(i: int) -> None:
        """Store the results of sample i, or the reason why its model cannot be built.

        Nothing is stored after the time limit. Each call fills different rows of the arrays, so
        calls may run in parallel threads.
        """
        if limit.is_over():
            return
        try:
            design = designs.model(values[i])
        except ValueError as error:
            messages[i] = str(error)
        else:
            if sweeps:
                rows = {name: table[i] for name, table in tables.items()}
                _sweep_design(design, sweeps, points[i, len(designs.names) :], rows)
            if evaluator:
                build_duty_model = designs.duty_model_builder(values[i])
                results[i], codes[i] = evaluator.evaluate(design, build_duty_model)
        finished[i] = True
        if progress:
            progress(1)

    with ThreadPoolExecutor(threads or os.cpu_count()) as pool:
        list(with_progress_bar("samples", pool.map(compute_sample, range(count)), count))
    data: dict = {}
    for name, column in zip(designs.names, values.T, strict=True):
        # Names of netCDF variables may only have letters, digits and underscores.
        key = "".join(letter if letter.isalnum() else "_" for letter in name).strip("_")
        data[key] = _variable(("sample",), column.copy(), *designs.units(name))
    if sweeps:
        dims = "sample", "direction", sweeps.dimension
        data |= {name: (dims, table) for name, table in tables.items()}
    for i, name in enumerate(quantities):
        units, text = QUANTITIES[name]
        data[name] = _variable(("sample",), results[:, i], units, text)
        status_text = f"whether there is: {text}"
        data[f"{name}_status"] = _variable(
            ("sample",), codes[:, i], "1", status_text, **_STATUS_FLAGS
        )
        nominal = float(evaluator.nominal[i])
        data[f"{name}_nominal"] = _variable((), nominal, units, f"of the nominal design: {text}")
    return data | {"refusal": (("sample",), messages)}


def _check_sweep_options(
    model,
    speeds=None,
    tunings=None,
    directions=("up", "down"),
    periods=120,
    record_periods=20,
    box=DEFAULT_BOX,
) -> SweepOptions | None:
    """Check the arguments of `scatter` that concern sweeps; return them as `SweepOptions`.

    In a sweep the model is run at each of the `speeds` in rpm, or at the `tunings` (mesh frequency
    over natural frequency) of the nominal `model`, over `periods` mesh periods, of which the last
    `record_periods` are evaluated. `box` has the limits of random initial states. Return None if
    neither speeds nor tunings are given.
    """
    if speeds is None and tunings is None:
        return None
    require_tuning_or_speed(model, "tunings", tunings, "speeds", speeds)
    if speeds is None:
        grid = check_tunings("tunings", tunings, check_tuning)
        if model.speed is not None:
            grid = np.asarray(model.speed(grid))
    else:
        check_speed = functools.partial(tuning_at_speed, model)
        grid = check_tunings("speeds", speeds, check_speed, tuning_at=model.tuning_at)
    directions = check_names("directions", directions, DIRECTIONS)
    checks.require(directions, "directions", directions, "at least one")
    allowed = "without 'seeded' for models with more than one degree of freedom"
    checks.require("seeded" not in directions or model.size <= 2, "directions", directions, allowed)
    allowed = f"an integer from 1 to {periods}"
    checks.require(record_periods <= periods, "record_periods", record_periods, allowed)
    checks.require(all(low < high for low, high in box), "box", box, "increasing limits")
    dimension = "tuning" if model.speed is None else "speed"
    return SweepOptions(dimension, np.sort(grid), directions, periods, record_periods, box)


def _sweep_design(model: Any, sweeps: SweepOptions, unit_point: np.ndarray, rows: dict) -> None:
    """Sweep the `model` of one design over speed in all directions and store the results.

    `sweeps` are the `SweepOptions`. `rows` maps "height" (peak-to-peak displacement), "factor"
    (dynamic factor), "lost" (contact), "settled" and "run_status" to arrays (directions, speeds),
    which are filled. `unit_point`, (2,), gives the random initial state of the direction "seeded"
    in the unit square, where 0 and 1 correspond to the limits of displacement and velocity.
    """
    lower, upper = np.transpose(sweeps.box)
    random_state = tuple((lower + (upper - lower) * unit_point).tolist())
    for k, direction in enumerate(sweeps.directions):
        is_seeded = direction == "seeded"
        curve = sweep(
            model,
            **{f"{sweeps.dimension}s": sweeps.grid},
            periods=sweeps.periods,
            record_periods=sweeps.record_periods,
            direction="cold" if is_seeded else direction,
            initial_state=random_state if is_seeded else (0.0, 0.0),
            threads=1,
        )
        peak_to_peak = curve.displacement_max - curve.displacement_min
        factor = model.force_ratios(largest_force(curve))
        loses_contact = curve.contact_loss_fraction > 0.0
        if model.mesh_names:
            peak_to_peak = peak_to_peak.max("mesh")
            factor = factor.max("mesh")
            loses_contact = loses_contact.max("mesh")
        rows["height"][k] = peak_to_peak * (model.static_deflection or 1.0)
        rows["factor"][k] = factor
        rows["lost"][k] = loses_contact
        rows["settled"][k] = curve.period > 0
        rows["run_status"][k] = curve.status


def _variable(dims, values, units: str, long_name: str, **attributes: Any) -> xr.Variable:
    """Create an xarray variable with units, description and further attributes."""
    return xr.Variable(dims, values, {"units": units, "long_name": long_name, **attributes})


def join_shards(shards: Any) -> xr.Dataset:
    """Join all shards of a scatter, in any order, into the dataset of `scatter`.

    `shards` are datasets from `shard`, each for a range of samples. Statistics over all samples are
    added. Raise ValueError if a shard is missing or belongs to a different scatter.
    """
    shards = sorted(shards, key=lambda dataset: int(dataset.sample[0]))
    attributes = shards[0].attrs
    if any(dataset.attrs["parameters"] != attributes["parameters"] for dataset in shards):
        raise ValueError("shards are not allowed: they must be parts of one scatter")
    n = json.loads(attributes["parameters"])["samples"]
    samples = np.concatenate([dataset.sample.values for dataset in shards])
    if "complete" not in shards[0] and not np.array_equal(samples, np.arange(n)):
        raise ValueError(
            f"shards are not allowed: they must contain each of the samples 0 to {n - 1} once"
        )
    options: dict = {"data_vars": "minimal", "coords": "minimal", "compat": "override"}
    data = xr.concat(shards, "sample", join="override", combine_attrs="override", **options)
    if "height" in data:  # there were sweeps
        data = _add_statistics(data)
    for name in QUANTITIES:
        if name not in data:
            continue
        values = data[name].values[data[f"{name}_status"].values == FOUND]
        units, text = data[name].attrs["units"], data[name].attrs["long_name"]
        mean = float(values.mean()) if values.size else np.nan
        std = float(values.std(ddof=1)) if values.size > 1 else np.nan
        data[f"{name}_mean"] = _variable((), mean, units, f"mean: {text}")
        data[f"{name}_deviation"] = _variable((), std, units, f"standard deviation: {text}")
    # Shards read from files have a hash of the sources. It must remain the last attribute, so that
    # the file of a result does not depend on the division into shards.
    source_hash = {name: text for name, text in attributes.items() if name == "source_hash"}
    omitted = "source_hash", "history"
    attributes = {name: value for name, value in attributes.items() if name not in omitted}
    attributes["refused"] = canonical_json(count_error_messages(data.refusal.values))
    # Shards read from files have encodings, which must not be kept in the result.
    data = data.drop_encoding().drop_attrs(deep=False)
    return add_metadata(data).assign_attrs(attributes | source_hash)


def _add_statistics(data: xr.Dataset) -> xr.Dataset:
    """Replace the results of single runs in a dataset by statistics over the samples.

    They are quantiles of the peak-to-peak displacement and the dynamic factor, probabilities of
    contact loss and of two motions at the same speed, and with random initial states the
    probability of each motion, over (direction, speed) or over speed.
    """
    grid_dim = "tuning" if "tuning" in data.dims else "speed"
    dims, directions = ("direction", grid_dim), data.direction.values.tolist()
    runs = {name: data[name].values for name in _RUN_VARIABLES}  # (sample, *dims)
    data = data.drop_vars([*_RUN_VARIABLES]).assign_coords(quantile=list(QUANTILES))
    finished = runs["run_status"] == 0
    statistics: dict = {
        "run_count": (dims, finished.sum(axis=0).astype(np.int32)),  # finished runs
        "failed_runs": (dims, (runs["run_status"] > 0).sum(axis=0).astype(np.int32)),
        "contact_loss_probability": (dims, _fraction(runs["lost"] > 0, finished)),
        "unsettled_share": (dims, _fraction(runs["settled"] == 0, finished)),
    }
    with warnings.catch_warnings():
        # Quantiles are NaN if all runs at a speed failed.
        warnings.simplefilter("ignore", RuntimeWarning)
        for name in ("height", "factor"):
            values = np.where(finished, runs[name].astype(float), np.nan)
            quantiles = np.nanquantile(values, QUANTILES, axis=0)
            statistics[f"{name}_band"] = ("quantile", *dims), quantiles
    if {"up", "down"} <= set(directions):
        i_up, i_down = directions.index("up"), directions.index("down")
        # Peak-to-peak displacements, (samples, speeds).
        up, down = runs["height"][:, i_up], runs["height"][:, i_down]
        both_finished = finished[:, i_up] & finished[:, i_down]
        has_two_motions = both_finished & ~_nearly_equal(up, down)
        fraction = _fraction(has_two_motions, both_finished)
        statistics["two_motions_probability"] = (grid_dim,), fraction
        if "seeded" in directions:
            i_seeded = directions.index("seeded")
            seeded = runs["height"][:, i_seeded]
            low, high = np.minimum(up, down), np.maximum(up, down)
            masks = _classify_motions(seeded, low, high, has_two_motions)
            all_finished = both_finished & finished[:, i_seeded]
            fractions = np.array([_fraction(mask, all_finished) for mask in masks])
            statistics["motion_probability"] = ("motion", grid_dim), fractions
    data = data.assign(statistics)
    if "motion_probability" in data:
        data = data.assign_coords(motion=list(MOTIONS))
    if grid_dim == "tuning":  # a model without rotational speed may have any unit of length
        text = "quantiles of the peak-to-peak displacement, in the length unit of the model"
        data.height_band.attrs |= {"units": "1", "long_name": text}
    return data


def _fraction(subset: np.ndarray, samples: np.ndarray) -> np.ndarray:
    """Return the fraction of the samples that belong to a subset, NaN if there are no samples.

    `subset` and `samples` are masks of shape (n, ...); the fraction is taken over the first axis.
    """
    count = samples.sum(axis=0)
    return (subset & samples).sum(axis=0) / np.where(count > 0, count, np.nan)


def _classify_motions(peak_to_peak, low, high, has_two_motions) -> tuple:
    """Return masks of the runs that ended on the only, lower, higher or another motion.

    `peak_to_peak` has the peak-to-peak displacements of runs from random initial states. `low` and
    `high` are the smaller and the larger of those of the upward and downward sweeps, and
    `has_two_motions` is a mask where these differ. All have shape (samples, speeds), as do the four
    masks.
    """
    on_low, on_high = _nearly_equal(peak_to_peak, low), _nearly_equal(peak_to_peak, high)
    # A run within the tolerance of both motions is assigned to the closer one.
    closer_to_low = np.abs(peak_to_peak - low) <= np.abs(peak_to_peak - high)
    return (
        ~has_two_motions & (on_low | on_high),
        has_two_motions & on_low & (closer_to_low | ~on_high),
        has_two_motions & on_high & (~closer_to_low | ~on_low),
        ~(on_low | on_high),
    )


def _nearly_equal(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Return a mask where peak-to-peak displacements are equal within a relative tolerance."""
    with np.errstate(invalid="ignore"):
        return np.abs(a - b) <= _EQUAL_MOTION_TOLERANCE * np.maximum(a, b)


def refused(dataset: xr.Dataset) -> list[str]:
    """Describe the errors that prevented designs in a result of `scatter`, one line per type.

    Each line has the number of samples with this error and an example of its message.
    """
    rows, total = json.loads(dataset.attrs["refused"]), dataset.sizes["sample"]
    return [f"{count} of {total} samples cannot be built, e.g.: {text}" for count, text in rows]


_BOOTSTRAP_RESAMPLES = 200


@checked
def sobol_indices(
    model,
    tolerances,
    quantities=("jump_up", "jump_down"),
    n: Annotated[int, Ge(2), Le(2**24), INTEGER] = 1024,
    *,
    speed: Speed | None = None,
    confidence: Annotated[float, Gt(0), Lt(1), Unit("1")] = 0.95,
    seed: WholeNumber = 0,
    progress=None,
    max_seconds: MaxSeconds = None,
):
    """Compute the Sobol' indices of quantities, the effect of each tolerance on their variance.

    Parameters
    ----------
    model, tolerances, quantities, seed, progress, max_seconds
        Arguments of `gearlib.scatter`; correlations are not allowed.
    n : int, default 1024
        Number of samples, a power of 2; n (k + 2) designs are computed for k parameters.
    speed : float, optional
        Speed of the duty point, rpm, for quantities of the duty point.
    confidence : float, default 0.95
        Confidence level of the bootstrapped intervals.

    Returns
    -------
    xarray.Dataset
        Over ``quantity`` and ``parameter``: first_index, total_index, and with ``bound`` their
        intervals first_index_interval, total_index_interval. Over ``quantity``: missing_designs,
        the number of designs that cannot be built or do not have the quantity. They are replaced
        by other designs, so the indices hold for designs that have the quantity.

    Raises
    ------
    ValueError
        Naming the argument, its value and the allowed range.
    """
    checks.require(n & (n - 1) == 0, "n", n, "a power of 2")
    checks.require(progress is None or callable(progress), "progress", progress, "a function")
    designs = Designs(model, tolerances, seed)
    if designs.tolerances.correlations:
        raise ValueError(
            "tolerances.correlations is not allowed: Sobol' indices need independent parameters"
        )
    quantities = check_names("quantities", quantities, tuple(QUANTITIES))
    checks.require(quantities, "quantities", quantities, "at least one")
    evaluator = quantity_evaluator(designs, quantities, speed)
    limit = TimeLimit(max_seconds)
    tables = _compute_tables(designs, evaluator, n, progress, limit)
    indices = [
        _estimate_indices(table, confidence, seed, name)
        for table, name in zip(tables, quantities, strict=True)
    ]
    dims, data = ("quantity", "parameter"), {}
    for i, name in enumerate(("first_index", "total_index")):
        data[name] = dims, [values[i] for values, _ in indices]
        data[f"{name}_interval"] = (*dims, "bound"), [intervals[i] for _, intervals in indices]
    data["missing_designs"] = "quantity", np.isnan(tables).sum(axis=(1, 2)).astype(np.int32)
    coords = {"quantity": [*quantities], "parameter": [*designs.names], "bound": ["low", "high"]}
    attributes = {"tolerances": tolerances, "samples": n, "seed": seed, "confidence": confidence}
    title = "Sobol' indices of a gear mesh by its tolerances"
    dataset = make_result(
        title, designs.nominal, data, coords, method="Saltelli 2010", **attributes
    )
    return limit.record_missing(dataset, list(range(tables.shape[2], n)))


def _compute_tables(designs: Designs, evaluator, n: int, progress, limit: TimeLimit) -> Any:
    """Compute the q quantities for the designs of Saltelli's method, shape (q, k + 2, n).

    The k + 2 rows belong to two independent sets A and B of n samples of the k parameters, and to k
    copies of A in which one parameter is taken from B. Values are NaN for designs that do not have
    the quantity. `designs` build the models, and `evaluator` is the `DesignQuantities` that
    computes the quantities; `progress`, a function or None, is called with 1 after each design. If
    the `TimeLimit` is reached, fewer than n samples are returned.
    """
    k = len(designs.names)
    cube = qmc.Sobol(2 * k, rng=designs.seed).random(n)
    a, b = cube[:, :k], cube[:, k:]
    mixed = [np.where(np.arange(k) == i, b, a) for i in range(k)]
    points = np.stack([a, b, *mixed])
    parameters = designs.tolerances.values(points.reshape(-1, k)).reshape(k + 2, n, -1)
    values = np.full((k + 2, n, len(evaluator.quantities)), np.nan)
    # Samples are computed in pairs, because a single sample has no variance.
    for i in limit.iterate(with_progress_bar("pairs of samples", range(0, n, 2), n // 2)):
        for index in itertools.product(range(k + 2), (i, i + 1)):
            design_parameters = parameters[index]
            try:
                design = designs.model(design_parameters)
            except ValueError:
                pass
            else:
                build_duty_model = designs.duty_model_builder(design_parameters)
                values[index], _ = evaluator.evaluate(design, build_duty_model)
            if progress:
                progress(1)
    return np.moveaxis(values[:, : i + 2], 2, 0)


def _estimate_indices(table: np.ndarray, level: float, seed: int, name: str) -> tuple:
    """Return (first-order and total Sobol' indices, (2, k), their intervals, (2, k, 2)).

    Sobol' indices are the fractions of the variance of a quantity due to each of k parameters.
    `table`, (k + 2, n), has the values of the quantity for two independent sets of n designs and
    for k copies of the first set with one parameter taken from the second, NaN if a design does not
    have it. `level` is the confidence level, `seed` the seed of the bootstrap, and `name` the
    quantity in messages.
    """
    n = table.shape[1]
    complete = np.flatnonzero(np.isfinite(table).all(axis=0))
    count = complete.size
    if count < 2:
        raise ValueError(
            f"quantities = {name!r} is not allowed with these tolerances: only {count} of {n} "
            "samples have it in all designs that are compared"
        )
    # Incomplete samples are replaced by complete samples at equal distances, because all n Sobol'
    # points are needed.
    missing_count = n - count
    replacements = np.arange(missing_count) * count // max(missing_count, 1) % count
    samples = np.arange(n)
    samples[np.isnan(table).any(axis=0)] = complete[replacements]
    table = table[:, samples]

    def indices(columns):
        """Return the first-order and total indices, (2, k), for selected columns of the table.

        The estimators are those of Saltelli (2010) for the first-order and Jansen (1999) for the
        total index. The bootstrap calls this function with random columns.
        """
        centred = table[:, columns] - table[:2, columns].mean()
        a, b, mixed = centred[0], centred[1], centred[2:]
        first_order = (b * (mixed - a)).mean(axis=1)
        total = 0.5 * ((mixed - a) ** 2).mean(axis=1)
        # The indices of a constant quantity are 0.
        return np.array([first_order, total]) / (centred[:2].var() or np.inf)

    interval = bootstrap(
        (np.arange(n),),
        indices,
        n_resamples=_BOOTSTRAP_RESAMPLES,
        vectorized=False,
        confidence_level=level,
        method="percentile",
        rng=np.random.default_rng(seed),
    ).confidence_interval
    return indices(np.arange(n)), np.stack([interval.low, interval.high], axis=-1)
