"""`scatter`: motions of a model whose parameters scatter, computed at once or in shards.

Each sample is worked out by itself, by the public functions, so any cut into shards gives the same
bytes. Statistics never mix two motions: those met on the way up, on the way down and from other
starts stand side by side.
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

#: How each speed is reached: carried up or down from the one before, from rest, or seeded.
DIRECTIONS = ("up", "down", "cold", "seeded")
#: Quantiles of the bands.
QUANTILES = (0.05, 0.5, 0.95)
#: Where a seeded start ends: on the only motion that up and down have, on that of the two with the
#: lower or higher course, on neither.
MOTIONS = ("only", "lower", "higher", "another")
#: Where seeded starts lie by default: displacement and dx/dtau, static deflections.
BOX = ((-6.0, 6.0), (-6.0, 6.0))
#: Motions whose heights differ by more, as a share of the larger, are two.
_SAME_HEIGHT = 0.02
_FLAGS = {
    "flag_values": np.arange(NO_DESIGN, len(CODES), dtype=np.int8),
    "flag_meanings": " ".join(("no_design", *CODES)),
}
#: Variables over (sample, direction, speed) -> their values where there is no such design.
_POINTS = {
    "height": np.float32(np.nan),
    "factor": np.float32(np.nan),
    "lost": np.int8(0),
    "settled": np.int8(0),
    "run_status": np.int8(-1),
}


class Runs(NamedTuple):
    """The runs of each design over speed."""

    key: str  #: argument of `sweep`: speeds, or tunings where nothing turns
    rates: np.ndarray  #: its values, rising
    directions: tuple  #: some of `DIRECTIONS`
    periods: int
    recorded: int
    box: tuple  #: of the seeded starts: ends of displacement and of dx/dtau


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
    """Say how jumps, peaks and contact scatter with the tolerances of a drawing.

    Parameters
    ----------
    model : Model, DrawnPair or callable
        A model whose parameters scatter by the names of its `settable`; two drawn gears, see
        `gearlib.uncertainty.designs.DrawnPair`; or a function that returns a model and takes what
        scatters as keyword arguments.
    tolerances : mapping
        Name of a parameter -> ``{mean, std}``, ``{min, max}``, ``{nominal, upper, lower}`` with
        deviations from the nominal value, as drawings have them, or ``{distribution, ...}``, a name
        of `scipy.stats` and its parameters; SI units. Between limits all values are as likely.
        ``correlations``, a list of [name, name, rho], are those of a Gaussian copula.
    quantities : sequence of str
        Of each design, of `gearlib.uncertainty.design_quantities.QUANTITIES`; () for none.
    n : int, default 1024
        Samples, points of a scrambled Sobol' sequence: of powers of two they are balanced.
    speed : float, optional
        Of the duty point, rpm, where quantities are wanted there.
    speeds, tunings : array_like of float, optional
        In rpm, or tunings of the nominal model, at which every design is run: bands over speed.
        Tunings become speeds, which all designs share, where anything turns.
    directions : sequence of {"up", "down", "cold", "seeded"}
        How each speed is come to: carried up or down, from rest, from a seeded start.
    periods, record_periods : int
        Mesh periods of each run, and how many of them, at the end, are told of.
    box : pair of pairs of float
        Ends of displacement and dx/dtau of seeded starts, static deflections.
    seed : int
        Of the scrambling.
    threads : int, optional
        All processors by default. The result does not depend on it.
    progress : callable, optional
        Called with the number of samples that are newly done.

    Returns
    -------
    xarray.Dataset
        Over ``sample``: parameters, quantities, their ``<quantity>_status`` (0: found), and
        ``refusal``, why there is no such design. Scalars ``<quantity>_nominal``, ``_mean`` and
        ``_deviation`` of those found. Over ``direction`` and ``speed``: contact_loss_probability,
        unsettled_share, run_count, failed_runs; with ``quantile`` height_band and factor_band. Over
        ``speed``: two_motions_probability, with seeded starts motion_probability.

    Raises
    ------
    ValueError
        Naming the argument, its value and the allowed range.
    """
    n = checks.integer("n", n, 1, MAX_SAMPLES)
    settings = {"speed": speed, "seed": seed, "threads": threads, "progress": progress}
    runs = {"speeds": speeds, "tunings": tunings, "directions": directions, "periods": periods}
    runs |= {"record_periods": record_periods, "box": box}
    part = shard(model, tolerances, n, 0, n, quantities=quantities, **settings, **runs)
    return gather([part])


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
    """Return the samples first ... last - 1 of a `scatter` with its other settings."""
    threads, progress = settings.pop("threads", None), settings.pop("progress", None)
    n = checks.integer("n", n, 1, MAX_SAMPLES)
    first = checks.integer("first", first, 0, n - 1)
    last = checks.integer("last", last, first + 1, n)
    quantities = names_of("quantities", quantities, tuple(QUANTITIES))
    threads = os.cpu_count() if threads is None else checks.integer("threads", threads, 1)
    designs = Designs(model, tolerances, seed)
    runs = _runs(designs.nominal, **settings)
    if runs is None and not quantities:
        raise checks.refusal("quantities", quantities, "one at least where no speeds are given")
    search = search_of(designs, quantities, speed) if quantities else None
    variables = _samples(designs, runs, search, range(first, last), threads, progress)
    coords: dict = {"sample": np.arange(first, last)}
    attributes = {"tolerances": json.loads(json.dumps(tolerances, default=float))}
    attributes |= {"samples": n, "seed": designs.seed}
    if runs:
        coords |= {"direction": list(runs.directions), runs.key.removesuffix("s"): runs.rates}
        attributes |= {"periods": runs.periods, "record_periods": runs.recorded, "box": runs.box}
    if search:
        attributes |= {"quantities": list(quantities)}
        attributes |= {} if speed is None else {"speed": speed}
    title = "Scatter of a gear mesh by its tolerances"
    return result(title, designs.nominal, variables, coords, method="scatter", **attributes)


def _samples(
    designs: Designs,
    runs: Runs | None,
    search: DesignQuantities | None,
    samples: range,
    threads: int | None,
    progress: Callable | None,
) -> dict:
    """Return the variables of samples: parameters, runs, quantities, refusals."""
    count, rows = len(samples), {}
    if runs:
        shape = count, len(runs.directions), runs.rates.size
        check_memory(f"{count:,} samples", count, 2 * shape[1] * shape[2], "samples")
        rows = {name: np.full(shape, fill) for name, fill in _POINTS.items()}
    results = np.full((count, len(search.quantities) if search else 0), np.nan)
    codes, refusals = np.full(results.shape, NO_DESIGN, np.int8), np.full(count, "", object)
    points = designs.points(samples.start, samples.stop)
    values = designs.values(points)

    def work(i: int) -> None:
        try:
            design = designs.model(values[i])
        except ValueError as error:
            refusals[i] = str(error)
        else:
            if runs:
                _sweep(design, runs, points[i, -2:], {name: x[i] for name, x in rows.items()})
            if search:
                results[i], codes[i] = search(design, designs.at_duty(values[i]))
        newly(1)

    with notebook.telling("samples", count, progress) as newly, ThreadPoolExecutor(threads) as pool:
        list(pool.map(work, range(count)))
    data: dict = {
        variable_of(name): _described(("sample",), column.copy(), *designs.units(name))
        for name, column in zip(designs.names, values.T, strict=True)
    }
    if runs:
        dims = "sample", "direction", runs.key.removesuffix("s")
        data |= {name: (dims, x) for name, x in rows.items()}
    for i, name in enumerate(search.quantities) if search else ():
        units, words = QUANTITIES[name]
        data[name] = _described(("sample",), results[:, i], units, words)
        status = _described(("sample",), codes[:, i], "1", f"whether there is: {words}", **_FLAGS)
        data[f"{name}_status"] = status
        nominal = float(search.nominal[i]) if search else np.nan
        data[f"{name}_nominal"] = _described((), nominal, units, f"of the nominal design: {words}")
    return data | {"refusal": (("sample",), refusals)}


def _runs(
    model: Any,
    speeds: Any = None,
    tunings: Any = None,
    directions: Any = ("up", "down"),
    periods: int = 120,
    record_periods: int = 20,
    box: Any = BOX,
) -> Runs | None:
    """Return the runs over speed, checked; None without speeds."""
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
    recorded = checks.integer("record_periods", record_periods, 1, periods)
    ends = tuple(tuple(checks.numbers("box", row, 2)) for row in checks.many("box", box, 2))
    for low, high in ends:
        checks.require(-np.inf < low < high < np.inf, "box", box, "finite ends, rising")
    key = "tunings" if model.speed is None else "speeds"
    return Runs(key, np.sort(rates), directions, periods, recorded, ends)


def _sweep(model: Any, runs: Runs, start: np.ndarray, rows: dict) -> None:
    """Sweep one design in all directions; `start` is in the unit square, `rows` are filled."""
    low, high = np.transpose(runs.box)
    seeded_state = tuple((low + (high - low) * start).tolist())
    for k, direction in enumerate(runs.directions):
        seeded = direction == "seeded"
        curve = sweep(
            model,
            **{runs.key: runs.rates},
            periods=runs.periods,
            record_periods=runs.recorded,
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


def variable_of(name: str) -> str:
    """Return the name of a parameter as netCDF and CF take it."""
    return "".join(letter if letter.isalnum() else "_" for letter in name).strip("_")


def _described(dims: Any, values: Any, units: str, long_name: str, **more: Any) -> xr.Variable:
    """Return a variable with its units and description."""
    return xr.Variable(dims, values, {"units": units, "long_name": long_name, **more})


def gather(shards: Any) -> xr.Dataset:
    """Return the dataset of `scatter` from its shards, in any order; refuse other shards."""
    shards = sorted(shards, key=lambda part: int(part.sample[0]))
    attributes = shards[0].attrs
    if any(part.attrs["parameters"] != attributes["parameters"] for part in shards):
        raise ValueError("shards are not allowed: they must be of one scatter")
    n = json.loads(attributes["parameters"])["samples"]
    if not np.array_equal(np.concatenate([part.sample.values for part in shards]), np.arange(n)):
        raise ValueError(
            f"shards are not allowed: they must have the samples 0 to {n - 1}, each once"
        )
    how: dict = {"data_vars": "minimal", "coords": "minimal", "compat": "override"}
    data = xr.concat(shards, "sample", join="override", combine_attrs="override", **how)
    if "height" in data:
        over = "tuning" if "tuning" in data.dims else "speed"
        points = {name: data[name].values for name in _POINTS}
        data = data.drop_vars([*_POINTS]).assign_coords(quantile=list(QUANTILES))
        data = data.assign(_statistics(points, data.direction.values.tolist(), over))
        if "motion_probability" in data:
            data = data.assign_coords(motion=list(MOTIONS))
        if over == "tuning":
            words = "quantiles of the peak-to-peak displacement, in the length unit of the model"
            data.height_band.attrs |= {"units": "1", "long_name": words}
    for name in filter(data.__contains__, QUANTITIES):
        values = data[name].values[data[f"{name}_status"].values == 0]
        units, words = data[name].attrs["units"], data[name].attrs["long_name"]
        mean = float(values.mean()) if values.size else np.nan
        deviation = float(values.std(ddof=1)) if values.size > 1 else np.nan
        data[f"{name}_mean"] = _described((), mean, units, f"mean: {words}")
        words = f"standard deviation: {words}"
        data[f"{name}_deviation"] = _described((), deviation, units, words)
    # Those of a file come last, where a file has them.
    kept = {name: x for name, x in attributes.items() if name not in ("source_hash", "history")}
    kept["refused"] = canonical_json(counted(data.refusal.values))
    if "source_hash" in attributes:
        kept["source_hash"] = attributes["source_hash"]
    # Shards that come from files have encodings of theirs.
    return describe(data.drop_encoding().drop_attrs(deep=False)).assign_attrs(kept)


def _share(part: np.ndarray, whole: np.ndarray) -> np.ndarray:
    """Return the share of the samples in `whole` that are in `part`, NaN where there are none."""
    count = whole.sum(axis=0)
    return (part & whole).sum(axis=0) / np.where(count > 0, count, np.nan)


def _statistics(points: dict, directions: list, over: str) -> dict:
    """Return name -> (dims, values) of the points of all designs over "speed" or "tuning"."""
    status, both = points["run_status"], ("direction", over)
    ran = status == 0
    data: dict = {
        "run_count": (both, ran.sum(axis=0).astype(np.int32)),
        "failed_runs": (both, (status > 0).sum(axis=0).astype(np.int32)),
        "contact_loss_probability": (both, _share(points["lost"] > 0, ran)),
        "unsettled_share": (both, _share(points["settled"] == 0, ran)),
    }
    with warnings.catch_warnings():
        # Where no run could go on there are no quantiles.
        warnings.simplefilter("ignore", RuntimeWarning)
        for name in ("height", "factor"):
            values = np.where(ran, points[name].astype(float), np.nan)
            data[f"{name}_band"] = ("quantile", *both), np.nanquantile(values, QUANTILES, axis=0)
    if not {"up", "down"} <= set(directions):
        return data
    heights = {word: points["height"][:, k] for k, word in enumerate(directions)}
    up, down = heights["up"], heights["down"]
    of_both = ran[:, directions.index("up")] & ran[:, directions.index("down")]
    two = of_both & ~_same(up, down)
    data["two_motions_probability"] = (over,), _share(two, of_both)
    if "seeded" in heights:
        motions = _motions(heights["seeded"], np.minimum(up, down), np.maximum(up, down), two)
        runs = of_both & ran[:, directions.index("seeded")]
        shares = np.array([_share(motion, runs) for motion in motions])
        data["motion_probability"] = ("motion", over), shares
    return data


def _motions(height: np.ndarray, low: np.ndarray, high: np.ndarray, two: np.ndarray) -> tuple:
    """Return masks of `MOTIONS`, on which seeded starts end; `two`: where low and high differ."""
    on_low, on_high = _same(height, low), _same(height, high)
    # Of both the nearer one: within its tolerance the other may lie as well.
    nearer = np.abs(height - low) <= np.abs(height - high)
    return (
        ~two & (on_low | on_high),
        two & on_low & (nearer | ~on_high),
        two & on_high & (~nearer | ~on_low),
        ~(on_low | on_high),
    )


def _same(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Return where two heights are those of one motion."""
    with np.errstate(invalid="ignore"):
        return np.abs(a - b) <= _SAME_HEIGHT * np.maximum(a, b)


def refused(dataset: xr.Dataset) -> list[str]:
    """Return the sentences that say how many samples of `scatter` are no designs, and why."""
    rows = json.loads(dataset.attrs["refused"])
    total = dataset.sizes["sample"]
    return [f"{count} of {total} samples cannot be built, such as: {why}" for count, why in rows]
