"""`scatter`: what a model does where its parameters scatter, and the same in shards.

Any cut into shards gives the same bytes: points are those of one sequence, every sample is worked
out by itself, and statistics are taken of all of them together.
"""

import functools
import json
import os
from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from gearlib import checks, notebook
from gearlib.data import provenance
from gearlib.data.result import result
from gearlib.data.variables import describe
from gearlib.runs.run_arguments import check_either, check_memory, check_speed, check_tuning
from gearlib.runs.sweeping import check_tunings
from gearlib.tolerances import bands
from gearlib.tolerances.designs import MOST, Designs, counted
from gearlib.tolerances.quantities import (
    CODES,
    NO_DESIGN,
    QUANTITIES,
    DesignQuantities,
    names_of,
    of_designs,
)

_FLAGS = {
    "flag_values": np.arange(NO_DESIGN, len(CODES), dtype=np.int8),
    "flag_meanings": " ".join(("no_design", *CODES)),
}
#: Where seeded starts lie unless told: displacement and dx/dtau, static deflections.
BOX = ((-6.0, 6.0), (-6.0, 6.0))


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
        `gearlib.tolerances.designs.DrawnPair`; or a function that returns a model and takes what
        scatters as keyword arguments.
    tolerances : mapping
        Name of a parameter -> ``{mean, std}``, ``{min, max}``, ``{nominal, upper, lower}`` with
        deviations from the nominal value, as drawings have them, or ``{distribution, ...}``, a name
        of `scipy.stats` and its parameters; SI units. Between limits all values are as likely.
        ``correlations``, a list of [name, name, rho], are those of a Gaussian copula.
    quantities : sequence of str
        Of each design, of `gearlib.tolerances.quantities.QUANTITIES`; () for none.
    n : int, default 1024
        Samples, points of a scrambled Sobol' sequence: of powers of two they are balanced.
    speed : float, optional
        Of the duty point, rpm, where quantities are asked for there.
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
    asked = Question(
        quantities, speed, speeds, tunings, directions, periods, record_periods, box, seed
    )
    n = checks.integer("n", n, 1, MOST)
    more = {"threads": threads, "progress": progress}
    return gather([shard(model, tolerances, n, 0, n, **asked._asdict(), **more)])


class Question(NamedTuple):
    """What is asked of every design, as of `scatter`."""

    quantities: tuple = ("jump_up", "jump_down")
    speed: float | None = None
    speeds: Any = None
    tunings: Any = None
    directions: tuple = ("up", "down")
    periods: int = 120
    record_periods: int = 20
    box: tuple = BOX
    seed: int = 0


def shard(model, tolerances, n, first, last, *, threads=None, progress=None, **question):
    """Return what `gather` takes of the samples first ... last - 1; arguments as of `scatter`."""
    asked = Question(**question)
    n = checks.integer("n", n, 1, MOST)
    first = checks.integer("first", first, 0, n - 1)
    last = checks.integer("last", last, first + 1, n)
    quantities = names_of("quantities", asked.quantities, tuple(QUANTITIES))
    threads = os.cpu_count() if threads is None else checks.integer("threads", threads, 1)
    designs = Designs(model, tolerances, asked.seed)
    runs = _runs(designs.nominal, asked)
    if runs is None and not quantities:
        raise checks.refusal("quantities", quantities, "one at least where no speeds are given")
    points = designs.points(first, last)
    values = designs.values(points)
    stages = (runs is not None) + bool(quantities)
    data, coords = _of_parameters(designs, values), {"sample": np.arange(first, last)}
    said = {"tolerances": json.loads(json.dumps(tolerances, default=float))}
    said |= {"samples": n, "seed": designs.seed}
    refusals = None
    with notebook.telling("samples", stages * (last - first), progress) as newly:
        if runs is not None:
            count = runs.rates.size * len(runs.directions)
            check_memory(f"{last - first:,} samples", last - first, 2 * count, "samples")
            ran, refusals = bands.run(designs, points, values, runs, threads, newly)
            over = "tuning" if designs.nominal.speed is None else "speed"
            data |= _of_points(ran, over)
            coords |= {"direction": list(runs.directions), over: runs.rates}
            said |= {"periods": runs.periods, "record_periods": runs.recorded, "box": runs.box}
        if quantities:
            duty = designs.at_duty(designs.tolerances.centres)
            search = DesignQuantities(designs.nominal, quantities, speed=asked.speed, at_duty=duty)
            found = of_designs(search, designs, values, newly)
            data |= _of_quantities(search, found)
            refusals = refusals or found[2]
            said |= {"quantities": list(quantities)}
            said |= {} if asked.speed is None else {"speed": asked.speed}
    data["refusal"] = (("sample",), np.array(refusals, dtype=object))
    title = "Scatter of a gear mesh by its tolerances"
    return result(title, designs.nominal, data, coords, method="scatter", **said)


def _runs(model, asked):
    """Return what is run, a `bands.Asked`; None without speeds."""
    speeds, tunings, box = asked.speeds, asked.tunings, asked.box
    if speeds is None and tunings is None:
        return None
    check_either(model, "tunings", tunings, "speeds", speeds)
    if speeds is None:
        rates = check_tunings("tunings", tunings, check_tuning)
        rates = rates if model.speed is None else model.speed(rates)
    else:
        check = functools.partial(check_speed, model)
        rates = check_tunings("speeds", speeds, check, model.tuning_at)
    directions = names_of("directions", asked.directions, bands.DIRECTIONS)
    checks.require(directions, "directions", directions, "one at least")
    if "seeded" in directions and model.size > 2:
        raise checks.refusal("directions", directions, "without 'seeded' for more coordinates")
    periods = checks.integer("periods", asked.periods, 1)
    recorded = checks.integer("record_periods", asked.record_periods, 1, periods)
    ends = [checks.numbers("box", one, 2) for one in checks.many("box", box, 2)]
    for low, high in ends:
        checks.require(-np.inf < low < high < np.inf, "box", box, "finite ends, rising")
    return bands.Asked(np.sort(rates), directions, periods, recorded, tuple(map(tuple, ends)))


def variable_of(name):
    """Return the name of a parameter as netCDF and CF take it."""
    return "".join(one if one.isalnum() else "_" for one in name).strip("_")


def _described(dims, values, units, long_name, **more):
    return xr.Variable(dims, values, {"units": units, "long_name": long_name, **more})


def _of_parameters(designs, values):
    found = {}
    for name, column in zip(designs.names, values.T, strict=True):
        units, words = designs.units(name)
        found[variable_of(name)] = _described(("sample",), column.copy(), units, words)
    return found


def _of_points(ran, over):
    dims = ("sample", "direction", over)
    names = ("height", "factor", "lost", "settled", "run_status")
    return {name: (dims, one) for name, one in zip(names, ran, strict=True)}


def _of_quantities(search, found):
    """Return the variables of quantities from the values and codes that `of_designs` returns."""
    values, codes, _ = found
    data = {}
    for i, name in enumerate(search.quantities):
        units, words = QUANTITIES[name]
        data[name] = _described(("sample",), values[:, i], units, words)
        status = _described(("sample",), codes[:, i], "1", f"whether there is: {words}", **_FLAGS)
        data[f"{name}_status"] = status
        nominal = float(search.nominal[i])
        data[f"{name}_nominal"] = _described((), nominal, units, f"of the nominal design: {words}")
    return data


def gather(shards):
    """Return the dataset of `scatter` from its shards, in any order.

    ValueError where they do not belong together, or samples are missing.
    """
    shards = sorted(shards, key=lambda one: int(one.sample[0]))
    attributes = shards[0].attrs
    if any(one.attrs["parameters"] != attributes["parameters"] for one in shards):
        raise ValueError("shards are not allowed: they must be of one scatter")
    n = json.loads(attributes["parameters"])["samples"]
    found = np.concatenate([one.sample.values for one in shards])
    if not np.array_equal(found, np.arange(n)):
        raise ValueError(
            f"shards are not allowed: they must have the samples 0 to {n - 1}, each once"
        )
    first = shards[0]
    data = {}
    for name, one in first.variables.items():
        if one.dims[:1] == ("sample",):
            parts = [each[name].values for each in shards]
            data[name] = (one.dims, np.concatenate(parts), one.attrs)
        elif name not in first.dims:
            data[name] = one
    coords = {name: first[name].variable for name in first.dims if name != "sample"}
    coords["sample"] = data.pop("sample")
    if "height" in data:
        names = ("height", "factor", "lost", "settled", "run_status")
        points = bands.Points(*(data.pop(name)[1] for name in names))
        over = "tuning" if "tuning" in first.dims else "speed"
        data |= bands.statistics(points, first.direction.values.tolist(), over)
        coords["quantile"] = list(bands.QUANTILES)
        if "motion_probability" in data:
            coords["motion"] = list(bands.MOTIONS)
        if over == "tuning":
            words = "quantiles of the peak-to-peak displacement, in the length unit of the model"
            data["height_band"] = _described(*data["height_band"][:2], "1", words)
    for name in QUANTITIES:
        if name in data:
            data |= _moments(name, data)
    refused = counted(data["refusal"][1])
    dataset = xr.Dataset(data, coords)
    describe(dataset)
    # Those of a file come last, where a file has them.
    apart = ("source_hash", "history")
    kept = {name: text for name, text in attributes.items() if name not in apart}
    own = {name: attributes[name] for name in apart[:1] if name in attributes}
    dataset.attrs = kept | {"refused": provenance.canonical_json(refused)} | own
    return dataset


def _moments(name, data):
    """Return mean and standard deviation of a quantity over the samples in which it is found."""
    _, values, attributes = data[name]
    own = values[data[f"{name}_status"][1] == 0]
    units, words = attributes["units"], attributes["long_name"]
    mean = float(own.mean()) if own.size else np.nan
    spread = float(own.std(ddof=1)) if own.size > 1 else np.nan
    return {
        f"{name}_mean": _described((), mean, units, f"mean: {words}"),
        f"{name}_deviation": _described((), spread, units, f"standard deviation: {words}"),
    }


def refused(dataset):
    """Return the sentences that say how many samples of `scatter` are no designs, and why."""
    rows = json.loads(dataset.attrs["refused"])
    total = dataset.sizes["sample"]
    return [f"{count} of {total} samples cannot be built, such as: {why}" for count, why in rows]
