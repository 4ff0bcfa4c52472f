"""`scatter`: motions of a model whose parameters scatter, computed at once or in shards.

Each sample is computed on its own by public functions, so all divisions into shards give the same
bytes. Statistics never mix two motions: rising sweeps, falling sweeps and runs from other starts
are kept apart.
"""

import functools
import json
import os
import warnings
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from gearlib import checks, notebook
from gearlib.data.files import canonical_json
from gearlib.data.result import result
from gearlib.data.variables import describe
from gearlib.runs.run_arguments import check_either, check_memory, check_speed, check_tuning
from gearlib.runs.sweeping import check_tunings, sweep
from gearlib.uncertainty.design_quantities import (
    CODES,
    NO_DESIGN,
    QUANTITIES,
    DesignQuantities,
    names_of,
    search_of,
)
from gearlib.uncertainty.designs import MAX_SAMPLES, Designs, counted

#: Directions of sweeps; "cold" starts each speed from rest, "seeded" from a random state.
DIRECTIONS = ("up", "down", "cold", "seeded")
#: Quantiles of the bands.
QUANTILES = (0.05, 0.5, 0.95)
#: Motion on which a seeded run settles: on the only motion of the sweeps up and down, on the lower
#: or on the higher of two motions, or on another one.
MOTIONS = ("only", "lower", "higher", "another")
#: Default limits of seeded starts: displacement and dx/dtau, static deflections.
BOX = ((-6.0, 6.0), (-6.0, 6.0))
#: Motions with peak-to-peak displacements within this share of the larger one count as equal.
_SAME_HEIGHT_TOLERANCE = 0.02
_FLAGS = {
    "flag_values": np.arange(NO_DESIGN, len(CODES), dtype=np.int8),
    "flag_meanings": " ".join(("no_design", *CODES)),
}
#: Variables over (sample, direction, speed) -> their values if the design cannot be built.
_POINT_VARIABLES = {
    "height": np.float32(np.nan),
    "factor": np.float32(np.nan),
    "lost": np.int8(0),
    "settled": np.int8(0),
    "run_status": np.int8(-1),
}


class SweepSettings(NamedTuple):
    """Settings of the sweeps over speed that are made for each design."""

    key: str  #: argument of `sweep`: "speeds", or "tunings" if nothing turns
    rates: np.ndarray  #: speeds or tunings, rising
    directions: tuple  #: some of `DIRECTIONS`
    periods: int
    record_periods: int
    box: tuple  #: limits of displacement and of dx/dtau of seeded starts


def scatter(
    model,
    tolerances,
    quantities=("jump_up", "jump_down"),
    n=1024,
    *,
    speed=None,
    speeds=None,
    tunings=None,
    directions=("up", "down"),
    periods=120,
    record_periods=20,
    box=BOX,
    seed=0,
    threads=None,
    progress=None,
):
    """Compute how jumps, peaks and contact loss scatter with tolerances; return a dataset.

    Parameters
    ----------
    model : Model, DrawnPair or callable
        A model, whose parameters are the names of its `settable`; two drawn gears, a
        `gearlib.uncertainty.designs.DrawnPair`; or a function that takes the parameters as keyword
        arguments and returns a model.
    tolerances : mapping
        Name of a parameter -> ``{mean, std}``, ``{min, max}``, ``{nominal, upper, lower}`` with
        deviations from the nominal value, as on drawings, or ``{distribution, ...}``, a name
        of `scipy.stats` and its parameters; SI units. Values between limits are equally likely.
        ``correlations``, a list of [name, name, rho], are those of a Gaussian copula.
    quantities : sequence of str
        Quantities of each design, names of `gearlib.uncertainty.design_quantities.QUANTITIES`.
    n : int, default 1024
        Number of samples, points of a scrambled Sobol' sequence; powers of 2 are balanced.
    speed : float, optional
        Speed of the duty point, rpm, for quantities of the duty point.
    speeds, tunings : array_like of float, optional
        Speeds in rpm, or tunings of the nominal model, of sweeps of each design. Tunings are
        converted to speeds, which all designs share, if anything turns.
    directions : sequence of {"up", "down", "cold", "seeded"}
        Directions of the sweeps; each run starts from rest ("cold") or a random state ("seeded").
    periods, record_periods : int
        Mesh periods of each run, and the number of last periods that are evaluated.
    box : pair of pairs of float
        Limits of displacement and dx/dtau of seeded starts, static deflections.
    seed : int
        Seed of the scrambling.
    threads : int, optional
        Number of threads, by default of processors. The result does not depend on it.
    progress : callable, optional
        Called with the number of samples finished since the last call.

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
    n = checks.integer("n", n, 1, MAX_SAMPLES)
    settings = {"speed": speed, "seed": seed, "threads": threads, "progress": progress}
    sweeps = {"speeds": speeds, "tunings": tunings, "directions": directions, "periods": periods}
    sweeps |= {"record_periods": record_periods, "box": box}
    samples = shard(model, tolerances, n, 0, n, quantities=quantities, **settings, **sweeps)
    return gather([samples])


def shard(
    model: Any,
    tolerances: Any,
    n: int,
    first: int,
    last: int,
    *,
    quantities: Any = ("jump_up", "jump_down"),
    speed: float | None = None,
    seed: int = 0,
    **settings: Any,
) -> xr.Dataset:
    """Return the dataset of the samples first ... last - 1 of n designs, a shard of `scatter`.

    The other arguments, with `settings` of sweeps, threads and progress, are those of `scatter`.
    """
    threads, progress = settings.pop("threads", None), settings.pop("progress", None)
    n = checks.integer("n", n, 1, MAX_SAMPLES)
    first = checks.integer("first", first, 0, n - 1)
    last = checks.integer("last", last, first + 1, n)
    quantities = names_of("quantities", quantities, tuple(QUANTITIES))
    threads = os.cpu_count() if threads is None else checks.integer("threads", threads, 1)
    designs = Designs(model, tolerances, seed)
    sweeps = _sweep_settings(designs.nominal, **settings)
    if sweeps is None and not quantities:
        raise checks.refusal("quantities", quantities, "one at least where no speeds are given")
    search = search_of(designs, quantities, speed) if quantities else None
    variables = _sample_variables(designs, sweeps, search, range(first, last), threads, progress)
    coords: dict = {"sample": np.arange(first, last)}
    attributes = {"tolerances": json.loads(json.dumps(tolerances, default=float))}
    attributes |= {"samples": n, "seed": designs.seed}
    if sweeps:
        coords |= {"direction": list(sweeps.directions), sweeps.key.removesuffix("s"): sweeps.rates}
        attributes |= {name: getattr(sweeps, name) for name in ("periods", "record_periods", "box")}
    if search:
        attributes |= {"quantities": list(quantities)}
        attributes |= {} if speed is None else {"speed": speed}
    title = "Scatter of a gear mesh by its tolerances"
    return result(title, designs.nominal, variables, coords, method="scatter", **attributes)


def _sample_variables(
    designs: Designs,
    sweeps: SweepSettings | None,
    search: DesignQuantities | None,
    samples: range,
    threads: int | None,
    progress: Callable | None,
) -> dict:
    """Return the variables of samples: parameters, results of sweeps, quantities, refusals.

    `sweeps` and `search` are None without sweeps or quantities; `samples` is a range of numbers of
    designs, which run in `threads` threads.
    """
    count, tables = len(samples), {}
    if sweeps:
        shape = count, len(sweeps.directions), sweeps.rates.size
        check_memory(f"{count:,} samples", count, 2 * shape[1] * shape[2], "samples")
        tables = {name: np.full(shape, fill) for name, fill in _POINT_VARIABLES.items()}
    results = np.full((count, len(search.quantities) if search else 0), np.nan)
    codes, refusals = np.full(results.shape, NO_DESIGN, np.int8), np.full(count, "", object)
    points = designs.points(samples.start, samples.stop)
    values = designs.values(points)

    def compute_sample(i: int) -> None:
        try:
            design = designs.model(values[i])
        except ValueError as error:
            refusals[i] = str(error)
        else:
            if sweeps:
                rows = {name: table[i] for name, table in tables.items()}
                _fill_sweeps(design, sweeps, points[i, -2:], rows)
            if search:
                results[i], codes[i] = search(design, designs.at_duty(values[i]))
        report(1)

    telling = notebook.telling("samples", count, progress)
    with telling as report, ThreadPoolExecutor(threads) as pool:
        list(pool.map(compute_sample, range(count)))
    data: dict = {
        variable_name(name): _variable(("sample",), column.copy(), *designs.units(name))
        for name, column in zip(designs.names, values.T, strict=True)
    }
    if sweeps:
        dims = "sample", "direction", sweeps.key.removesuffix("s")
        data |= {name: (dims, table) for name, table in tables.items()}
    for i, name in enumerate(search.quantities) if search else ():
        units, text = QUANTITIES[name]
        data[name] = _variable(("sample",), results[:, i], units, text)
        status = _variable(("sample",), codes[:, i], "1", f"whether there is: {text}", **_FLAGS)
        data[f"{name}_status"] = status
        nominal = float(search.nominal[i]) if search else np.nan
        data[f"{name}_nominal"] = _variable((), nominal, units, f"of the nominal design: {text}")
    return data | {"refusal": (("sample",), refusals)}


def _sweep_settings(
    model: Any,
    speeds: Any = None,
    tunings: Any = None,
    directions: Any = ("up", "down"),
    periods: int = 120,
    record_periods: int = 20,
    box: Any = BOX,
) -> SweepSettings | None:
    """Return the checked settings of sweeps, None without speeds and tunings."""
    if speeds is None and tunings is None:
        return None
    check_either(model, "tunings", tunings, "speeds", speeds)
    if speeds is None:
        rates = check_tunings("tunings", tunings, check_tuning)
        rates = rates if model.speed is None else np.asarray(model.speed(rates))
    else:
        check = functools.partial(check_speed, model)
        rates = check_tunings("speeds", speeds, check, model.tuning_at)
    directions = names_of("directions", directions, DIRECTIONS)
    checks.require(directions, "directions", directions, "one at least")
    if "seeded" in directions and model.size > 2:
        raise checks.refusal("directions", directions, "without 'seeded' for more coordinates")
    periods = checks.integer("periods", periods, 1)
    record_periods = checks.integer("record_periods", record_periods, 1, periods)
    limits = tuple(tuple(checks.numbers("box", row, 2)) for row in checks.many("box", box, 2))
    for low, high in limits:
        checks.require(-np.inf < low < high < np.inf, "box", box, "finite ends, rising")
    key = "tunings" if model.speed is None else "speeds"
    return SweepSettings(key, np.sort(rates), directions, periods, record_periods, limits)


def _fill_sweeps(model: Any, sweeps: SweepSettings, start: np.ndarray, rows: dict) -> None:
    """Sweep one design in all directions and fill its rows of the variables over speed.

    `start` is the seeded start as a point of the unit square; `rows` maps names of variables to
    arrays, (directions, speeds), that are filled.
    """
    lower, upper = np.transpose(sweeps.box)
    seeded_state = tuple((lower + (upper - lower) * start).tolist())
    for k, direction in enumerate(sweeps.directions):
        seeded = direction == "seeded"
        curve = sweep(
            model,
            **{sweeps.key: sweeps.rates},
            periods=sweeps.periods,
            record_periods=sweeps.record_periods,
            direction="cold" if seeded else direction,
            initial_state=seeded_state if seeded else (0.0, 0.0),
            threads=1,
        )
        height = curve.displacement_max - curve.displacement_min
        factor = curve.dynamic_factor if "dynamic_factor" in curve else curve.dynamic_force_max
        lost = curve.fraction_backlash + curve.fraction_inverse > 0.0
        if model.mesh_names:
            height, factor, lost = (x.max("mesh") for x in (height, factor, lost))
        rows["height"][k] = height * (model.static_deflection or 1.0)
        rows["factor"][k], rows["lost"][k] = factor, lost
        rows["settled"][k], rows["run_status"][k] = curve.period > 0, curve.status


def variable_name(name: str) -> str:
    """Return the name of a parameter as a valid name of a netCDF variable."""
    return "".join(letter if letter.isalnum() else "_" for letter in name).strip("_")


def _variable(
    dims: tuple, values: Any, units: str, long_name: str, **attributes: Any
) -> xr.Variable:
    """Return an xarray variable with its units, description and further attributes."""
    return xr.Variable(dims, values, {"units": units, "long_name": long_name, **attributes})


def gather(shards: Any) -> xr.Dataset:
    """Return the dataset of `scatter` from all its shards, in any order, or raise ValueError."""
    shards = sorted(shards, key=lambda dataset: int(dataset.sample[0]))
    attributes = shards[0].attrs
    if any(dataset.attrs["parameters"] != attributes["parameters"] for dataset in shards):
        raise ValueError("shards are not allowed: they must be of one scatter")
    n = json.loads(attributes["parameters"])["samples"]
    samples = np.concatenate([dataset.sample.values for dataset in shards])
    if not np.array_equal(samples, np.arange(n)):
        raise ValueError(
            f"shards are not allowed: they must have the samples 0 to {n - 1}, each once"
        )
    options: dict = {"data_vars": "minimal", "coords": "minimal", "compat": "override"}
    data = xr.concat(shards, "sample", join="override", combine_attrs="override", **options)
    if "height" in data:
        data = _with_statistics(data)
    for name in filter(data.__contains__, QUANTITIES):
        values = data[name].values[data[f"{name}_status"].values == 0]
        units, text = data[name].attrs["units"], data[name].attrs["long_name"]
        mean = float(values.mean()) if values.size else np.nan
        deviation = float(values.std(ddof=1)) if values.size > 1 else np.nan
        data[f"{name}_mean"] = _variable((), mean, units, f"mean: {text}")
        data[f"{name}_deviation"] = _variable((), deviation, units, f"standard deviation: {text}")
    # The hash of the sources, which only files have, comes last.
    source_hash = {name: x for name, x in attributes.items() if name == "source_hash"}
    attributes = {n: x for n, x in attributes.items() if n not in ("source_hash", "history")}
    attributes["refused"] = canonical_json(counted(data.refusal.values))
    # Shards read from files have encodings, which must not reach the result.
    data = data.drop_encoding().drop_attrs(deep=False)
    return describe(data).assign_attrs(attributes | source_hash)


def _with_statistics(data: xr.Dataset) -> xr.Dataset:
    """Return a dataset of `scatter` with statistics of all samples in place of their results."""
    rate = "tuning" if "tuning" in data.dims else "speed"
    points = {name: data[name].values for name in _POINT_VARIABLES}
    data = data.drop_vars([*_POINT_VARIABLES]).assign_coords(quantile=list(QUANTILES))
    data = data.assign(_statistics(points, data.direction.values.tolist(), rate))
    if "motion_probability" in data:
        data = data.assign_coords(motion=list(MOTIONS))
    if rate == "tuning":
        text = "quantiles of the peak-to-peak displacement, in the length unit of the model"
        data.height_band.attrs |= {"units": "1", "long_name": text}
    return data


def _share(subset: np.ndarray, samples: np.ndarray) -> np.ndarray:
    """Return the share of the samples that are in the subset, NaN without samples.

    Both are masks over (samples, ...); shares are those along the first axis.
    """
    count = samples.sum(axis=0)
    return (subset & samples).sum(axis=0) / np.where(count > 0, count, np.nan)


def _statistics(points: dict, directions: list, rate: str) -> dict:
    """Return statistics over all designs: name of a variable -> (dims, values).

    `points` has arrays (sample, direction, rate); `rate` is "speed" or "tuning".
    """
    status, dims = points["run_status"], ("direction", rate)
    finished = status == 0
    data: dict = {
        "run_count": (dims, finished.sum(axis=0).astype(np.int32)),
        "failed_runs": (dims, (status > 0).sum(axis=0).astype(np.int32)),
        "contact_loss_probability": (dims, _share(points["lost"] > 0, finished)),
        "unsettled_share": (dims, _share(points["settled"] == 0, finished)),
    }
    with warnings.catch_warnings():
        # Quantiles are NaN if all runs at a speed failed.
        warnings.simplefilter("ignore", RuntimeWarning)
        for name in ("height", "factor"):
            values = np.where(finished, points[name].astype(float), np.nan)
            data[f"{name}_band"] = ("quantile", *dims), np.nanquantile(values, QUANTILES, axis=0)
    if not {"up", "down"} <= set(directions):
        return data
    heights = {direction: points["height"][:, k] for k, direction in enumerate(directions)}
    up, down = heights["up"], heights["down"]
    both_finished = finished[:, directions.index("up")] & finished[:, directions.index("down")]
    two = both_finished & ~_same_height(up, down)
    data["two_motions_probability"] = (rate,), _share(two, both_finished)
    if "seeded" in heights:
        motions = _motions(heights["seeded"], np.minimum(up, down), np.maximum(up, down), two)
        all_finished = both_finished & finished[:, directions.index("seeded")]
        shares = np.array([_share(motion, all_finished) for motion in motions])
        data["motion_probability"] = ("motion", rate), shares
    return data


def _motions(height: np.ndarray, low: np.ndarray, high: np.ndarray, two: np.ndarray) -> tuple:
    """Return masks of the runs that settled on the only, lower, higher or another motion.

    `height` is the peak-to-peak displacement of each run, `low` and `high` are those of the motions
    of both sweeps, and the mask `two` tells where they differ.
    """
    on_low, on_high = _same_height(height, low), _same_height(height, high)
    # A run within the tolerance of both motions counts for the nearer one.
    nearer_low = np.abs(height - low) <= np.abs(height - high)
    return (
        ~two & (on_low | on_high),
        two & on_low & (nearer_low | ~on_high),
        two & on_high & (~nearer_low | ~on_low),
        ~(on_low | on_high),
    )


def _same_height(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Return a mask of peak-to-peak displacements a and b that are equal within 2 %."""
    with np.errstate(invalid="ignore"):
        return np.abs(a - b) <= _SAME_HEIGHT_TOLERANCE * np.maximum(a, b)


def refused(dataset: xr.Dataset) -> list[str]:
    """Return a sentence on the number of samples that cannot be built for each kind of refusal."""
    rows = json.loads(dataset.attrs["refused"])
    total = dataset.sizes["sample"]
    return [f"{count} of {total} samples cannot be built, such as: {text}" for count, text in rows]
