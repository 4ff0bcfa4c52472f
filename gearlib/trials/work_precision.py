"""Errors of methods against what they cost, knob by knob: evaluations, and wall time.

Errors and evaluations are the same in every run; wall times are not, and keep to datasets of
their own. Errors of one method on one problem:

``state_error``
    of the final state: the larger of displacement and dx/dtau;
``event_error``
    of the phases of the recorded events: the largest; NaN if there are none, or another number,
    or others;
``multiplier_error``
    of the largest |Floquet multiplier| of the settled orbit, from central differences of the
    method's own period map; NaN if the problem has no orbit of one mesh period.
"""

import csv
import math
import statistics
import time
from typing import NamedTuple

import numpy as np
import xarray as xr

from gearlib import integrators, status
from gearlib.core.jit import kernel
from gearlib.core.oscillator import evolve, level
from gearlib.files import replacing
from gearlib.provenance import canonical_json
from gearlib.trials import problems
from gearlib.variables import describe
from gearlib.version import __version__

#: Half width of the central differences, static deflections: rounding over it, 1e-10, and its
#: square times third derivatives, about the same, are the least error of a multiplier.
DIFFERENCE = 1e-6

# Steps that never end at a stiffness switch of the paper's contact ratio, 1.569: its half stretch
# of 0.2845 periods is a whole number of steps only if their number is a multiple of 2000.
_STEPS = tuple(25 * 2**k for k in range(10))
_RTOL = tuple(10.0**-k for k in range(2, 13))


class Line(NamedTuple):
    """A way to use a method, and the values of its accuracy knob from coarse to fine."""

    name: str
    family: str  #: located (events), controlled (steps only), fixed, smoothed, other
    knob: str | None  #: name of the option; None: there is none
    values: tuple = (None,)
    options: dict = {}  #: other options, fixed
    follows: bool = False  #: whether an absolute tolerance, atol, follows the knob

    def at(self, value):
        """Return the options of the method at a value of the knob."""
        options = dict(self.options) if self.knob is None else self.options | {self.knob: value}
        if self.follows:
            # ode45's defaults keep this ratio of the two.
            options["atol"] = 1e-3 * value
        return options


#: method -> its lines. scipy's right-hand side is Python: few values.
LADDERS = {
    "exact": [Line("exact", "located", None)],
    "taylor": [Line("taylor", "located", "tolerance", (1e-2, 1e-4, 1e-6, 1e-8, 1e-12, 1e-16))],
    "rk4": [Line("rk4", "fixed", "steps_per_period", _STEPS)],
    "newmark": [Line("newmark", "fixed", "steps_per_period", _STEPS)],
    "generalised_alpha": [Line("generalised alpha", "fixed", "steps_per_period", _STEPS)],
    "rk45": [Line("rk45", "controlled", "rtol", _RTOL, follows=True)],
    "smoothed": [
        Line(
            "smoothed",
            "smoothed",
            "sharpness",
            (10.0, 30.0, 100.0, 300.0, 1e3, 3e3, 1e4),
            {"rtol": 1e-11},
        )
    ],
    "scipy": [
        Line("scipy RK45", "controlled", "rtol", (1e-3, 1e-6), {"solver": "RK45"}, True),
        Line("scipy LSODA", "controlled", "rtol", (1e-3, 1e-6, 1e-9), {"solver": "LSODA"}, True),
        Line("scipy Radau", "controlled", "rtol", (1e-3,), {"solver": "Radau"}, True),
        Line(
            "scipy DOP853, split",
            "located",
            "rtol",
            (1e-3, 1e-6, 1e-9, 1e-12),
            {"solver": "DOP853", "events": True},
            True,
        ),
    ],
}

#: Knobs of methods without lines of their own: the first that a method has.
GENERIC = {
    "rtol": (1e-3, 1e-5, 1e-7, 1e-9, 1e-11),
    "tolerance": (1e-3, 1e-5, 1e-7, 1e-9, 1e-11),
    "tol": (1e-3, 1e-5, 1e-7, 1e-9, 1e-11),
    "steps_per_period": (50, 200, 800, 3200),
}

# Span of a timed run, seconds: far above the clock's resolution and the start of a run.
_SPAN = 4e-3
_LONGEST = 2**18
# Runs longer than this, seconds, are timed three times at most: Python's, and no interruption
# is long against them.
_LONG = 0.04


def lines_of(method):
    """Return the lines of a method; of one without an entry in `LADDERS` by its options.

    Raises
    ------
    ValueError
        If there is no such method here.
    """
    if method not in integrators.METHODS or not integrators.about(method).available:
        raise ValueError(
            f"method = {method!r} is not allowed: it must be one of "
            f"{', '.join(map(repr, integrators.METHODS))}, and installed"
        )
    if method in LADDERS:
        return LADDERS[method]
    options = integrators.about(method).options
    knob = next((name for name in GENERIC if name in options), None)
    follows = knob == "rtol" and "atol" in options
    line = Line(method, "other", knob, GENERIC.get(knob, (None,)), follows=follows)
    return [line]


def rungs(method):
    """Return (line, text of the knob, options) of every value of every line of a method."""
    return rungs_of(lines_of(method))


def rungs_of(lines):
    """Return (line, text of the knob, options) of every value of lines."""
    return [
        (line, "" if value is None else f"{line.knob} = {value:g}", line.at(value))
        for line in lines
        for value in line.values
    ]


def rung_variables(table):
    """Return the variables line, family, knob, options over (rung,) of what `rungs` returns."""
    columns = {
        "line": [line.name for line, _, _ in table],
        "family": [line.family for line, _, _ in table],
        "knob": [text for _, text, _ in table],
        "options": [canonical_json(options) for _, _, options in table],
    }
    return {name: ("rung", np.array(values, object)) for name, values in columns.items()}


def state_error(found, expected):
    """Return the larger error of displacement and dx/dtau; NaN for a run that could not go on."""
    return float(np.abs(found.state - expected.state).max())


def event_error(found, expected):
    """Return the largest error of the phases of events; NaN if there is nothing to compare."""
    same = found.kinds.shape == expected.kinds.shape and (found.kinds == expected.kinds).all()
    if not same or found.phases.size == 0:
        return math.nan
    return float(np.abs(found.phases - expected.phases).max())


def errors(method, names, pair, six_degrees, settings):
    """Return the errors and evaluations of a method on the problems.

    Parameters
    ----------
    method : str
    names : list of str
        Of `gearlib.trials.problems.CASES`.
    pair, six_degrees, settings
        As of `gearlib.trials.problems.build`.

    Returns
    -------
    xarray.Dataset
        Over (problem, rung): state_error, event_error, multiplier_error, period_evaluations, NaN
        where the method does not take the model or could not go on. Over (rung,): line, family,
        knob, options. Over (problem,): state_floor, event_floor, half the last place of the
        reference, and multiplier_floor, rounding over the width of the differences.
    """
    table = rungs(method)
    measures = np.full((4, len(names), len(table)), math.nan)
    floors = np.full((3, len(names)), math.nan)
    for i, name in enumerate(names):
        problem = problems.build(name, pair, six_degrees, settings)
        # Floors belong to the problem, whatever the methods: from the common reference.
        common = problems.reference(problem)
        floors[:, i] = _floors(problem, common)
        if problems.takes(method, problem.model):
            expected = problems.reference(problem, method)
            orbit = problems.steady_orbit(problem) if problem.steady else None
            measures[:, i] = np.transpose(
                [_measures(problem, expected, orbit, method, options) for _, _, options in table]
            )
    columns = ("state_error", "event_error", "multiplier_error", "period_evaluations")
    data: dict = {
        name: (("problem", "rung"), values) for name, values in zip(columns, measures, strict=True)
    }
    floor_names = ("state_floor", "event_floor", "multiplier_floor")
    data |= {name: ("problem", v) for name, v in zip(floor_names, floors, strict=True)}
    title = f"Errors of method {method} and what they cost in evaluations"
    parameters = {"settings": settings, "six_degrees": six_degrees, "difference": DIFFERENCE}
    return _dataset(title, method, names, table, data, pair, parameters)


def _floors(problem, expected):
    """Return the least errors of state, event phases and multiplier that numbers can show."""
    phase = np.spacing(expected.phases.max()) / 2.0 if expected.phases.size else math.nan
    size = np.abs(expected.state).max()
    quotient = np.spacing(size) / (2.0 * DIFFERENCE) if problem.steady else math.nan
    return np.spacing(size) / 2.0, phase, quotient


def _measures(problem, expected, orbit, method, options):
    """Return the three errors of a method, and its evaluations per mesh period."""
    found = problems.attempt(problem, method, options)
    multiplier = math.nan
    if orbit is not None:
        start, exact = orbit
        matrix = problems.difference_map(problem, start, DIFFERENCE, method, options)
        multiplier = abs(problems.largest_multiplier(matrix) - exact)
    evaluations = found.evaluations / problem.periods if found.code == status.OK else math.nan
    return state_error(found, expected), event_error(found, expected), multiplier, evaluations


def _dataset(title, method, names, table, data, pair, parameters):
    """Return a dataset over problem and rung, described."""
    data = data | rung_variables(table)
    coords = {"problem": list(names), "rung": np.arange(len(table), dtype=np.int32)}
    dataset = xr.Dataset(data, coords)
    dataset.attrs = {
        "Conventions": "CF-1.11",
        "title": title,
        "source": f"gearlib {__version__}, method {method}",
        "references": "Hortel, Skuderova: Engineering Mechanics 14 (2007) 91-104",
        "gear_pair": canonical_json(pair),
        "parameters": canonical_json(parameters),
    }
    return describe(dataset)


def times(method, names, pair, six_degrees, settings, repeats):
    """Return the wall times of a method on the problems; nothing else may run beside.

    Parameters as of `errors`; `repeats` runs are timed (long ones three times at most), of which
    the median counts.

    Returns
    -------
    xarray.Dataset
        Over (problem, rung): period_time, the slope between a short and a long run from the state
        at the end of the problem, so that start, record and compilation do not count; NaN as of
        `errors`. closed_form_time: of one evaluation of the closed form of contact;
        warm_up_time: of the first run of the method in this process, which compiles its kernels
        or loads them. The other variables as of `errors`.
    """
    table = rungs(method)
    values = np.full((len(names), len(table)), math.nan)
    first = math.nan
    for i, name in enumerate(names):
        problem = problems.build(name, pair, six_degrees, settings)
        if not problems.takes(method, problem.model):
            continue
        start = tuple(problems.reference(problem).state)
        for j, (_, _, options) in enumerate(table):
            run = problems.Bound(problem.model, problem.tuning, method, options)
            if math.isnan(first):
                first = _seconds(lambda run=run, start=start: run.raw(start, 1))
            if run.run(start, problem.periods).code == status.OK:
                call = _call(run, start)
                values[i, j] = seconds_per_period(call, repeats)
    data = {
        "period_time": (("problem", "rung"), values),
        "closed_form_time": closed_form_time(repeats),
        "warm_up_time": first,
    }
    title = f"Wall times of method {method}"
    parameters = {"settings": settings, "six_degrees": six_degrees, "repeats": repeats}
    return _dataset(title, method, names, table, data, pair, parameters)


def _call(run, start):
    return lambda periods: run.raw(start, periods)


def _seconds(call):
    start = time.perf_counter()
    call()
    return time.perf_counter() - start


def seconds_per_period(call, repeats):
    """Return the time of ``call(periods)`` per period: median, without the start of a run."""
    short, long = 1, 6

    def once(periods):
        return _seconds(lambda: call(periods))

    call(short)
    # The lesser of two: an interruption must not pass for a long run.
    while min(once(long), once(long)) - once(short) < _SPAN and long < _LONGEST:
        long *= 2
    if once(long) > _LONG:
        repeats = min(repeats, 3)
    whole = statistics.median([once(long) for _ in range(repeats)])
    base = statistics.median([once(short) for _ in range(repeats)])
    return (whole - base) / (long - short)


@kernel
def _evolve_again(lev, u, v, t, n):
    for _ in range(n):
        u, v = evolve(lev, u, v, t)
    return u, v


def closed_form_time(repeats, count=100_000):
    """Return the median time of one evaluation of the closed form of contact, seconds."""
    lev = level(1.0, 0.06, 0.9)
    _evolve_again(lev, 1.0, 0.0, 1.0, 1)
    times = [_seconds(lambda: _evolve_again(lev, 1.0, 0.0, 1.0, count)) for _ in range(repeats)]
    return statistics.median(times) / count


class Row(NamedTuple):
    """The fastest method of one problem within one accuracy."""

    problem: str
    decade: int  #: state error <= 10^-decade
    line: str
    knob: str
    time: float  #: per mesh period, s
    evaluations: float  #: per mesh period
    error: float


def fastest(error, seconds):
    """Return (decade, index) of the fastest with an error <= 10^-decade, for every decade.

    Parameters
    ----------
    error, seconds : ndarray, shape (n,)
        NaN: no candidate.

    Returns
    -------
    list of (int, int)
        From 10^0 on, up to the last decade that anyone reaches, 10^-15 at most.
    """
    rows = []
    for decade in range(16):
        # A decade is reached with its bound, rounding of the power included.
        able = np.flatnonzero((error <= 10.0**-decade * (1.0 + 1e-9)) & np.isfinite(seconds))
        if able.size == 0:
            break
        rows.append((decade, int(able[np.argmin(seconds[able])])))
    return rows


def joined(datasets, name):
    """Return a variable over (problem, rung) or (rung,) of all methods, end to end."""
    return np.concatenate([data[name].values for data in datasets], axis=-1)


def table(error_datasets, time_datasets):
    """Return the `Row` of every problem and decade, from the datasets of the same methods."""
    line, knob = joined(error_datasets, "line"), joined(error_datasets, "knob")
    error, evaluations = (
        joined(error_datasets, name) for name in ("state_error", "period_evaluations")
    )
    seconds = joined(time_datasets, "period_time")
    return [
        Row(str(problem), decade, line[k], knob[k], seconds[i, k], evaluations[i, k], error[i, k])
        for i, problem in enumerate(error_datasets[0].problem.values)
        for decade, k in fastest(error[i], seconds[i])
    ]


def write_csv(rows, path):
    """Write `Row`s as a table, replacing the file in one step."""
    with replacing(path) as temporary, open(temporary, "w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        names = ("seconds_per_period", "evaluations_per_period", "state_error")
        writer.writerow(["problem", "accuracy", "fastest", "knob", *names])
        for row in rows:
            numbers = [f"{value:.3g}" for value in (row.time, row.evaluations, row.error)]
            writer.writerow([row.problem, f"1e-{row.decade:02d}", row.line, row.knob, *numbers])
