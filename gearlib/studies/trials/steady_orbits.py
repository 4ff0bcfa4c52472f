"""Errors of settled orbits over their cost: time integration beside the frequency domain.

Methods behind ``method=`` run from rest until the slowest problem has settled; harmonic balance
and E. Schmidt's method seek the periodic motion at once, from no guess. All are compared with the
orbit in 50 digits of `gearlib.studies.trials.references`. Multipliers of time integration come from
central differences of its own period map. Shooting for the same orbit is timed beside them.
"""

import math
import statistics

import numpy as np
import xarray as xr

from gearlib.analysis.harmonics.harmonic_balance import harmonic_balance
from gearlib.analysis.harmonics.schmidt import schmidt
from gearlib.analysis.orbits.shooting import NoOrbit, periodic_orbit
from gearlib.data import status
from gearlib.data.provenance import canonical_json
from gearlib.data.variables import describe
from gearlib.studies.trials import problems, references, work_precision
from gearlib.studies.trials.work_precision import DIFFERENCE, Line
from gearlib.version import __version__

_REST = (0.0, 0.0)
#: Calls that take longer, seconds, are timed once, without one before.
_LONG = 0.1
#: The frequency domain: method -> its lines, the accuracy parameter is the number of harmonics.
SOLVERS = {"harmonic_balance": harmonic_balance, "schmidt": schmidt}
LADDERS = {
    "harmonic_balance": [
        Line("harmonic balance", "harmonics", "harmonics", (4, 8, 16, 32, 64, 128, 256))
    ],
    "schmidt": [Line("E. Schmidt", "harmonics", "harmonics", (8, 32, 128, 512, 2048, 8192))],
}


def rungs(methods):
    """Return (method, line, text of the accuracy parameter, options) of all settings."""
    return [
        (method, *rung)
        for method in methods
        for rung in (
            work_precision.rungs_of(LADDERS[method])
            if method in LADDERS
            else work_precision.rungs(method)
        )
    ]


def errors(methods, names, pair, settings):
    """Return the errors of settled orbits, and the evaluations they took.

    Parameters
    ----------
    methods : list of str
        Of `gearlib.methods`, or "harmonic_balance", "schmidt".
    names : list of str
        Of `gearlib.studies.trials.problems.CASES`, those with one degree of freedom that settle.
    pair : dict
        Keyword arguments of `GearPair`, without damping.
    settings : dict
        As of `gearlib.studies.trials.problems.build`.

    Returns
    -------
    xarray.Dataset
        Over (problem, rung): state_error, event_error, multiplier_error, orbit_evaluations, NaN
        where the method does not take the model or found no orbit. Over (rung,): line, family,
        knob, options. Over (problem,): state_floor, event_floor, multiplier_floor.
    """
    table = rungs(methods)
    measures = np.full((4, len(names), len(table)), math.nan)
    floors = np.empty((3, len(names)))
    for i, name in enumerate(names):
        problem = problems.build(name, pair, {}, settings)
        orbit, largest = references.settled(problem)
        half = np.spacing(np.abs(orbit.state).max()) / 2.0
        phase = np.spacing(2.0 * math.pi) / 2.0 if orbit.phases.size else math.nan
        floors[:, i] = half, phase, half
        for j, (method, _, _, options) in enumerate(table):
            if method in SOLVERS:
                measures[:, i, j] = _solved(problem, orbit, largest, method, options)
            elif problems.takes(method, problem.model):
                measures[:, i, j] = _settled_run(problem, orbit, largest, method, options)
    columns = ("state_error", "event_error", "multiplier_error", "orbit_evaluations")
    data: dict = {
        name: (("problem", "rung"), values) for name, values in zip(columns, measures, strict=True)
    }
    floor_names = ("state_floor", "event_floor", "multiplier_floor")
    data |= {name: ("problem", v) for name, v in zip(floor_names, floors, strict=True)}
    title = "Errors of settled orbits and what they cost in evaluations"
    return _dataset(title, methods, names, table, data, pair, {"settings": settings})


def times(methods, names, pair, settings, repeats):
    """Return the wall times of settled orbits; parameters as of `errors`, nothing may run beside.

    Returns
    -------
    xarray.Dataset
        Over (problem, rung): orbit_time, median of `repeats` runs, of a long run one; NaN as of
        `errors`. Over (problem,): shooting_time, of the orbit by shooting from its own guess.
    """
    table = rungs(methods)
    values = np.full((len(names), len(table)), math.nan)
    shooting = np.empty(len(names))
    for i, name in enumerate(names):
        problem = problems.build(name, pair, {}, settings)
        shooting[i] = _median(
            lambda problem=problem: periodic_orbit(problem.model, problem.tuning), repeats, True
        )
        known = set()
        for j, (method, _, _, options) in enumerate(table):
            if method in SOLVERS or problems.takes(method, problem.model):
                values[i, j] = _median(
                    lambda problem=problem, method=method, options=options: _orbit(
                        problem, method, options
                    ),
                    repeats,
                    method not in known,
                )
            known.add(method)
    data = {"orbit_time": (("problem", "rung"), values), "shooting_time": ("problem", shooting)}
    title = "Wall times of settled orbits"
    parameters = {"settings": settings, "repeats": repeats}
    return _dataset(title, methods, names, table, data, pair, parameters)


def _orbit(problem, method, options):
    """Return what a method finds: a solution, or the `Run` of its last period; None: nothing."""
    if method not in SOLVERS:
        bound = problems.Bound(problem.model, problem.tuning, method, options)
        found = bound.run(_REST, problems.SETTLING)
        return found if found.code == status.OK else None
    try:
        found = SOLVERS[method](problem.model, problem.tuning, **options)
    except NoOrbit:
        return None
    return found if getattr(found, "converged", True) else None


def _solved(problem, expected, largest, method, options):
    """Return the errors of a solution over harmonics, and its evaluations."""
    solution = _orbit(problem, method, options)
    if solution is None:
        return (math.nan,) * 4
    phases, kinds = solution.crossings()
    found = expected._replace(state=solution.state, phases=phases, kinds=kinds)
    return (
        work_precision.state_error(found, expected),
        work_precision.event_error(found, expected),
        abs(np.abs(solution.multipliers).max() - largest),
        solution.evaluations,
    )


def _settled_run(problem, expected, largest, method, options):
    """Return the errors of a settled run, and its evaluations."""
    found = _orbit(problem, method, options)
    if found is None:
        return (math.nan,) * 4
    # Phases count from the start of the run: those of the last period from its own.
    phases = found.phases - 2.0 * math.pi * (problems.SETTLING - 1)
    found = found._replace(phases=phases)
    matrix = problems.difference_map(problem, expected.state, DIFFERENCE, method, options)
    return (
        work_precision.state_error(found, expected),
        work_precision.event_error(found, expected),
        abs(problems.largest_multiplier(matrix) - largest),
        found.evaluations,
    )


def _median(call, repeats, loads):
    """Return the median wall time of a call, after another one if it is short, or loads its code.

    The first value of a knob is the coarsest: what a method has to load comes with a short call.
    """
    seconds = [work_precision.seconds_of(call)]
    if loads or seconds[0] < _LONG:
        seconds = [work_precision.seconds_of(call) for _ in range(repeats)]
    return statistics.median(seconds)


def _dataset(title, methods, names, table, data, pair, parameters):
    data = data | work_precision.rung_variables([rung[1:] for rung in table])
    coords = {"problem": list(names), "rung": np.arange(len(table), dtype=np.int32)}
    dataset = xr.Dataset(data, coords)
    dataset.attrs = {
        "Conventions": "CF-1.11",
        "title": title,
        "source": f"gearlib {__version__}, methods {', '.join(methods)}",
        "references": "Hortel, Skuderova: Engineering Mechanics 14 (2007) 91-104",
        "gear_pair": canonical_json(pair),
        "parameters": canonical_json(parameters),
    }
    return describe(dataset)
