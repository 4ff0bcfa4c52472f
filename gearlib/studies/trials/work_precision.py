"""Work-precision data: the errors of each method over its cost in evaluations and wall time.

A method is run with several values of its accuracy parameter, such as a tolerance or the number of
steps; in the datasets one setting is a `rung`, the parameter a `knob`. Errors and evaluations
repeat exactly, wall times do not and are kept in separate datasets. The errors of one method on one
problem, against `gearlib.studies.trials.references`:

``state_error``
    of the final state: the larger of displacement and dx/dtau;
``event_error``
    of the phases of the recorded events: the largest; NaN if there are none, or another number,
    or others;
``multiplier_error``
    of the largest |Floquet multiplier| of the settled orbit, from central differences of the
    method's own period map; NaN if the problem settles on no orbit of one mesh period.
"""

import math
import statistics
import time
from typing import NamedTuple

import numpy as np

from gearlib import integrators
from gearlib.data import status
from gearlib.data.files import canonical_json
from gearlib.data.result import result_of_many, stacked
from gearlib.engines.jit import kernel
from gearlib.engines.pair.motion import evolve, level
from gearlib.models.pair import GearPair
from gearlib.studies.trials import problems, references

#: Half width of the central differences, static deflections: rounding over it, 1e-10, and its
#: square times third derivatives, about the same, are the least error of a multiplier.
DIFFERENCE = 1e-6

# Steps that never end at a stiffness switch of the paper's contact ratio, 1.569: half its segment
# of C_max, 0.2845 periods, is a whole number of steps only if their number is a multiple of 2000.
_STEPS = tuple(25 * 2**k for k in range(10))
_RTOL = tuple(10.0**-k for k in range(2, 13))


class Line(NamedTuple):
    """A way to use a method, and the values of its accuracy parameter from coarse to fine."""

    name: str
    family: str  #: located (events), controlled (steps only), fixed, smoothed, other
    knob: str | None  #: name of the option; None: there is none
    values: tuple = (None,)
    options: dict = {}  #: other options, fixed
    follows: bool = False  #: whether an absolute tolerance, atol, is set in proportion

    def at(self, value):
        """Return the options of the method at a value of its accuracy parameter."""
        options = dict(self.options) if self.knob is None else self.options | {self.knob: value}
        if self.follows:
            # ode45's defaults keep this ratio of the two.
            options["atol"] = 1e-3 * value
        return options


_SCIPY = (1e-3, 1e-6, 1e-9, 1e-12, 2.3e-14)
_TOLERANCES = tuple(10.0**-k for k in range(3, 16, 2))

#: Methods of this library, compiled; the others are solvers of other packages.
OF_LIBRARY = ("exact", "taylor", "rk4", "rk45", "newmark", "generalised_alpha", "smoothed")

#: method -> its lines, each down to its smallest error, or to what its package accepts:
#: below 1e-12 LSODA stalls, below 100 times the last place of 1 scipy's pairs take that instead.
#: scipy's right-hand side is Python: few values, and of Radau none that takes minutes.
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
        Line("scipy RK45", "controlled", "rtol", _SCIPY[:4], {"solver": "RK45"}, True),
        Line("scipy LSODA", "controlled", "rtol", _SCIPY[:4], {"solver": "LSODA"}, True),
        Line("scipy Radau", "controlled", "rtol", _SCIPY[:2], {"solver": "Radau"}, True),
        Line(
            "scipy DOP853, split",
            "located",
            "rtol",
            _SCIPY,
            {"solver": "DOP853", "events": True},
            True,
        ),
    ],
    # From 2.2e-16 on its steps are the same.
    "heyoka": [Line("heyoka", "other", "tol", (*_TOLERANCES, 1e-16))],
}

#: Accuracy parameters of methods that are not in `LADDERS`: the first that a method has.
GENERIC = {
    "rtol": (1e-3, 1e-5, 1e-7, 1e-9, 1e-11),
    "tolerance": (1e-3, 1e-5, 1e-7, 1e-9, 1e-11),
    "tol": (1e-3, 1e-5, 1e-7, 1e-9, 1e-11),
    "steps_per_period": (50, 200, 800, 3200),
}

#: What is measured of a run, and the least that numbers can show of it, in the order of the calls.
_MEASURES = ("state_error", "event_error", "multiplier_error", "period_evaluations")
_FLOORS = ("state_floor", "event_floor", "multiplier_floor")

#: Methods whose runs end early when they have provably settled: only the run is timed whose error
#: is known, which has not settled.
_EARLY = ("exact",)
# Runs that take this long, seconds, are repeated little: interruptions change them little.
_SLOW = 0.05
# Starts that take this long, seconds: of such runs one repeat is enough.
_TABLES = 0.3
# Periods until all has been compiled: heyoka compiles a contact when it first comes.
_STARTS = {"heyoka": 64}
# Span of the timed runs without their starts, seconds: far above the clock's resolution.
_SPAN = 2e-3
_LONGEST, _MOST = 2**18, 2**11  #: periods of a run, and runs timed together
# Seconds for the repeats of a run: a long one is timed once, no interruption is long against it.
_ALL = 0.02


def lines_of(method):
    """Return the lines of a method; of one without an entry in `LADDERS` by its options.

    ValueError if there is no such method here.
    """
    if method not in integrators.METHODS or not integrators.about(method).available:
        raise ValueError(
            f"method = {method!r} is not allowed: it must be one of "
            f"{', '.join(map(repr, integrators.METHODS))}, and installed"
        )
    return LADDERS[method] if method in LADDERS else [generic_line(method)]


def generic_line(method):
    """Return the line of a method that its options suggest."""
    options = integrators.about(method).options
    knob = next((name for name in GENERIC if name in options), None)
    follows = knob == "rtol" and "atol" in options
    return Line(method, "other", knob, GENERIC.get(knob, (None,)), follows=follows)


def rungs(method):
    """Return (line, text of the accuracy parameter, options) of every setting of a method."""
    return [
        (line, "" if value is None else f"{line.knob} = {value:g}", line.at(value))
        for line in lines_of(method)
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
    """Return the larger error of displacement and dx/dtau; NaN for a run that stopped early."""
    return float(np.abs(found.state - expected.state).max())


def event_error(found, expected):
    """Return the largest error of the phases of events; NaN if there is nothing to compare."""
    same = found.kinds.shape == expected.kinds.shape and (found.kinds == expected.kinds).all()
    if not same or found.phases.size == 0:
        return math.nan
    return float(np.abs(found.phases - expected.phases).max())


def errors(method, known, pair, six_degrees, settings):
    """Return the errors and evaluations of a method on the problems.

    known: of `gearlib.studies.trials.references.compute`, of the same parameters; pair,
    six_degrees, settings: as in `gearlib.studies.trials.problems.build`.

    NaN where the method does not take the model or stopped early.
    """
    names = known.problem.values.tolist()
    built = {name: problems.build(name, pair, six_degrees, settings) for name in names}
    expected = {name: references.run_of(known, name) for name in names}

    def measured(name, rung):
        values = [math.nan] * len(_MEASURES)
        if problems.takes(method, built[name].model):
            orbit, (_, _, options) = references.orbit_of(known, name), rung
            values = _measures(built[name], expected[name], orbit, method, options)
        return dict(zip(_MEASURES, values, strict=True))

    def floors(name):
        return dict(zip(_FLOORS, _floors(built[name], expected[name]), strict=True))

    table, each = rungs(method), {"problem": names}
    data = stacked(each | {"rung": table}, measured) | stacked(each, floors)
    title = f"Errors of method {method} and what they cost in evaluations"
    parameters = {"settings": settings, "six_degrees": six_degrees, "difference": DIFFERENCE}
    return _dataset(title, method, table, data, each, {"gear_pair": pair, "parameters": parameters})


def _floors(problem, expected):
    """Return the least errors of state, event phases and multiplier that numbers can show."""
    if problem.model.mesh_names:
        return references.TRAINS, references.TRAINS, math.nan
    phase = np.spacing(expected.phases.max()) / 2.0 if expected.phases.size else math.nan
    size = np.abs(expected.state).max()
    quotient = np.spacing(size) / (2.0 * DIFFERENCE) if problem.steady else math.nan
    return np.spacing(size) / 2.0, phase, quotient


def _measures(problem, expected, orbit, method, options):
    """Return the three errors of a method, and its evaluations per mesh period."""
    found = problems.attempt(problem, method, options)
    multiplier = math.nan
    start, exact = orbit
    if not math.isnan(exact):
        matrix = problems.difference_map(problem, start, DIFFERENCE, method, options)
        multiplier = abs(problems.largest_multiplier(matrix) - exact)
    evaluations = found.evaluations / problem.periods if found.code == status.OK else math.nan
    found_errors = np.array([state_error(found, expected), event_error(found, expected)])
    if problem.model.mesh_names:
        # Below, nothing is known of the reference.
        found_errors = np.maximum(found_errors, references.TRAINS)
    return *found_errors, multiplier, evaluations


def _dataset(title, method, table, data, each, said):
    """Return a dataset over problem, of `each`, and rung, described."""
    coords = each | {"rung": np.arange(len(table), dtype=np.int32)}
    said = {"method": method, "references": GearPair.references} | said
    return result_of_many(title, data | rung_variables(table), coords, method, **said)


def times(method, known, pair, six_degrees, settings, repeats):
    """Return the wall times of a method on the problems; nothing else may run beside.

    Parameters as in `errors`; `repeats` runs are timed (of long ones fewer), of which the shortest
    counts.

    Over (problem, rung): period_time, the slope between a short and a long run from rest, so that
    start, tables, record and compilation do not count; NaN where the method does not take the model
    or stopped early. closed_form_time: of one evaluation of the closed form of contact;
    warm_up_time: of the first run of the method in this process, which compiles its kernels or
    loads them. The other variables as in `errors`.
    """
    names, first = known.problem.values.tolist(), []
    built = {name: problems.build(name, pair, six_degrees, settings) for name in names}

    def timed(name, rung):
        problem, (_, _, options) = built[name], rung
        if not problems.takes(method, problem.model):
            return {"period_time": math.nan}
        run = problems.Bound(problem.model, problem.tuning, method, options)
        if not first:
            first.append(seconds_of(lambda: run.record(problems.START, 1)))
        codes: set = set()
        early = method in _EARLY
        # Half the run: what prepares tables lies in the first half.
        short = max(1, problem.periods // 2) if early else _STARTS.get(method, 1)
        longest = problem.periods if early and problem.steady else _LONGEST
        seconds = seconds_per_period(_call(run, codes), short, longest, repeats)
        return {"period_time": seconds if codes == {status.OK} else math.nan}

    table, each = rungs(method), {"problem": names}
    data = stacked(each | {"rung": table}, timed)
    data |= {"closed_form_time": closed_form_time(repeats), "warm_up_time": [*first, math.nan][0]}
    title = f"Wall times of method {method}"
    parameters = {"settings": settings, "six_degrees": six_degrees, "repeats": repeats}
    return _dataset(title, method, table, data, each, {"gear_pair": pair, "parameters": parameters})


def _call(run, codes):
    """Return a call that runs some periods from rest, and adds its status to `codes`."""
    return lambda periods: codes.add(run.record(problems.START, periods).status)


def seconds_of(call):
    """Return the wall time of a call."""
    start = time.perf_counter()
    call()
    return time.perf_counter() - start


def seconds_per_period(call, short, longest, repeats):
    """Return the time of ``call(periods)`` per period, without the start of a run.

    It is the difference of a long run, of at most `longest` periods, and a short one. If that is
    too quick, many runs are timed together. The shortest of `repeats` times counts, since other
    work on the machine can only lengthen them.
    """
    longest = max(longest, short + 1)
    long, count = short + 1, 1

    def once(periods):
        return seconds_of(lambda: [call(periods) for _ in range(count)])

    def least(repeats):
        pairs = [(once(long), once(short)) for _ in range(repeats)]
        return [min(times) for times in zip(*pairs, strict=True)]

    call(short)
    base = once(short)
    if base > _SLOW:
        whole = once(long)
        if whole - base < 0.5 * base:
            # Solvers that compile at each start take as long for it as for thousands of periods,
            # fixed steps of trains, for their tables, as for hundreds.
            few = base > _TABLES
            while whole - base < (0.4 if few else 2.0) * base and long < longest:
                long = min((16 if whole - base < 0.1 * base else 4) * long, longest)
                whole = once(long)
            again = least(1 if few or whole > 4.0 * _SLOW else 3)
            whole, base = min(whole, again[0]), min(base, again[1])
        return (whole - base) / (long - short)
    # The least of three: an interruption must not pass for a long run.
    whole, base = least(1 if base > _SPAN else 3)
    # Starts of trains, with all their tables, take as long as hundreds of their periods.
    while whole - base < max(_SPAN, 0.5 * base) and count < _MOST:
        if long < longest:
            long = min(2 * long, longest)
        else:
            count *= 2
        whole, base = least(3)
    more = least(min(repeats, max(1, round(_ALL * count / whole))))
    return (min(whole, more[0]) - min(base, more[1])) / (count * (long - short))


@kernel
def _evolve_again(lev, u, v, t, n):
    for _ in range(n):
        u, v = evolve(lev, u, v, t)
    return u, v


def closed_form_time(repeats, count=100_000):
    """Return the median time of one evaluation of the closed form of contact, seconds."""
    lev = level(1.0, 0.06, 0.9)
    _evolve_again(lev, 1.0, 0.0, 1.0, 1)
    times = [seconds_of(lambda: _evolve_again(lev, 1.0, 0.0, 1.0, count)) for _ in range(repeats)]
    return statistics.median(times) / count
