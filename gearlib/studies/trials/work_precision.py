"""Compute the error of each method and its cost in evaluations and wall time.

Each method is run with several values of its accuracy parameter, e.g. a tolerance or the number of
steps. In the datasets, the dimension `rung` is the index of the setting, `line` the label of the
method, and `knob` the parameter with its value. Wall times are not reproducible, so they are stored
in separate datasets. Errors relative to `gearlib.studies.trials.references` are:

``state_error``
    the larger error of displacement and dx/dtau in the final state;
``event_error``
    the largest error of the phases of the recorded contact events; NaN if there are none, or if
    they differ in number or kind;
``multiplier_error``
    the error of the largest absolute Floquet multiplier of the settled orbit, by central
    differences of the period map of the method; NaN if the problem does not settle on an orbit of
    one mesh period.
"""

import math
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from timeit import repeat as timeit
from typing import NamedTuple

import numpy as np
import xarray as xr

from gearlib import integrators
from gearlib.data.files import canonical_json
from gearlib.data.result import evaluate_on_grid, make_study_result
from gearlib.engines.jit import kernel
from gearlib.engines.orbit import Span
from gearlib.engines.pair.motion import evolve, stiffness_level_at_tuning
from gearlib.models.pair import GearPair
from gearlib.runs.run_arguments import MAX_EVENTS
from gearlib.studies.trials import problems, references

#: Half width of central differences, in static deflections. Rounding and truncation errors of a
#: multiplier are then about equal (1e-10).
DIFFERENCE = 1e-6

# With these numbers of steps per mesh period, no step ends where the stiffness of the paper's pair
# jumps: half the segment of maximum stiffness, 0.2845 periods at the contact ratio 1.569, is a
# whole number of steps only if the number of steps is a multiple of 2000.
_STEPS = tuple(25 * 2**k for k in range(10))
_RTOL = tuple(10.0**-k for k in range(2, 13))
_SCIPY = (1e-3, 1e-6, 1e-9, 1e-12, 2.3e-14)


class MethodVariant(NamedTuple):
    """A method with options and several values of its accuracy parameter (a line in figures)."""

    method: str
    label: str
    #: "located" (events are located), "controlled" (only the step size is controlled), "fixed",
    #: "smoothed" or "other".
    family: str
    parameter: str  #: name of the option that sets the accuracy, or ""
    values: tuple = (None,)  #: from coarse to fine
    options: dict = {}  #: other options


#: Compiled methods of this library; the others are solvers of other packages.
LIBRARY_METHODS = ("exact", "taylor", "rk4", "rk45", "newmark", "generalised_alpha", "smoothed")

#: All variants, with parameters down to the smallest error or the smallest allowed value. LSODA
#: stalls below 1e-9 on gear trains, scipy's Runge-Kutta methods do not accept tolerances below 100
#: times the spacing of floats at 1, and heyoka's steps do not change below 2.2e-16. scipy is run
#: with only a few values, because its right-hand side is interpreted, and Radau with none that
#: takes minutes.
METHOD_VARIANTS = (
    MethodVariant("exact", "exact", "located", ""),
    MethodVariant(
        "taylor", "taylor", "located", "tolerance", (1e-2, 1e-4, 1e-6, 1e-8, 1e-12, 1e-16)
    ),
    MethodVariant("rk4", "rk4", "fixed", "steps_per_period", _STEPS),
    MethodVariant("newmark", "newmark", "fixed", "steps_per_period", _STEPS),
    MethodVariant("generalised_alpha", "generalised alpha", "fixed", "steps_per_period", _STEPS),
    MethodVariant("rk45", "rk45", "controlled", "rtol", _RTOL),
    MethodVariant(
        *("smoothed", "smoothed", "smoothed", "sharpness"),
        (10.0, 30.0, 100.0, 300.0, 1e3, 3e3, 1e4),
        {"rtol": 1e-11},
    ),
    MethodVariant("scipy", "scipy RK45", "controlled", "rtol", _SCIPY[:4], {"solver": "RK45"}),
    MethodVariant("scipy", "scipy LSODA", "controlled", "rtol", _SCIPY[:3], {"solver": "LSODA"}),
    MethodVariant("scipy", "scipy Radau", "controlled", "rtol", _SCIPY[:2], {"solver": "Radau"}),
    MethodVariant(
        *("scipy", "scipy DOP853, split", "located", "rtol", _SCIPY),
        {"solver": "DOP853", "events": True},
    ),
    MethodVariant(
        "heyoka", "heyoka", "other", "tol", (*(10.0**-k for k in range(3, 16, 2)), 1e-16)
    ),
)

#: Minimum timed interval (s), maximum length of a run (mesh periods), maximum number of calls.
MIN_SPAN, MAX_PERIODS, MAX_CALLS = 2e-3, 2**18, 2**14
#: Runs that take longer (s) are timed once, because interruptions are short in comparison.
MAX_REPEATED = 0.02


def method_settings(method: str) -> list[tuple[MethodVariant, str, dict]]:
    """Return all settings of a method: each variant with each value of its accuracy parameter.

    A variant is a method with fixed options. A setting is a tuple (variant, text such as
    "rtol = 1e-06", dict of all options).
    """
    settings = []
    for variant in METHOD_VARIANTS:
        if variant.method != method:
            continue
        parameter = variant.parameter
        for value in variant.values:
            options = dict(variant.options)
            text = ""
            if parameter:
                options[parameter] = value
                text = f"{parameter} = {value:g}"
            if parameter == "rtol":
                # The ratio of the tolerances is the default of MATLAB's ode45.
                options["atol"] = 1e-3 * value
            settings.append((variant, text, options))
    return settings


def state_error(motion: problems.Motion, reference: problems.Motion) -> float:
    """Return the maximum error of the final displacement x and of dx/dtau (tau: mesh phase).

    `motion` is the result of the method under test, and `reference` the exact motion. The error is
    NaN if a run stopped early.
    """
    return float(np.abs(motion.state - reference.state).max())


def event_error(motion: problems.Motion, reference: problems.Motion) -> float:
    """Return the maximum error of the phases of contact events, in rad.

    `motion` is the result of the method under test, and `reference` the exact motion. The error is
    NaN if there are no events or if the contact states of the events differ.
    """
    if not np.array_equal(motion.codes, reference.codes) or not len(reference.codes):
        return math.nan
    return float(np.abs(motion.phases - reference.phases).max())


def compute_errors(
    method: str, reference_data: xr.Dataset, pair: GearPair, six_degrees: dict, settings: dict
) -> xr.Dataset:
    """Compute the errors and evaluations of a method on the test problems, for all its settings.

    A setting is a value of the accuracy parameter of the method; the dimension "rung" is its index.
    `reference_data` is a result of `gearlib.studies.trials.references.compute_references`;
    `pair`, `six_degrees` (arguments of `SixDegreePair`) and `settings` (damping and numbers of mesh
    periods) are arguments of `gearlib.studies.trials.problems.build_problem`. Values are NaN if the
    method cannot run the model or stops early.
    """
    names = reference_data.problem.values.tolist()
    built = {name: problems.build_problem(name, pair, six_degrees, settings) for name in names}
    motions = {name: references.select_motion(reference_data, name) for name in names}

    def setting_errors(name: str, setting: tuple) -> dict:
        """Return the errors of a setting (variant, text, options) on the problem `name`."""
        _, _, options = setting
        reference = reference_data.sel(problem=name)
        return _compute_setting_errors(method, options, built[name], motions[name], reference)

    data = evaluate_on_grid({"problem": names, "rung": method_settings(method)}, setting_errors)
    data |= evaluate_on_grid(
        {"problem": names}, lambda name: _rounding_error_floors(built[name], motions[name])
    )
    title = f"Errors of method {method} and what they cost in evaluations"
    parameters = {"settings": settings, "six_degrees": six_degrees, "difference": DIFFERENCE}
    return _build_dataset(title, method, names, data, pair, parameters)


def _compute_setting_errors(method, options, problem, expected, reference) -> dict[str, float]:
    """Compute the errors of a method with these options on a problem, and its evaluations.

    `expected` is the exact motion, and `reference` a dataset with the exact periodic orbit and its
    largest Floquet multiplier. Evaluations of the right-hand side are per mesh period. All values
    are NaN if the method does not support the model.
    """
    state = event = multiplier = evaluations = math.nan
    if integrators.METHODS[method].supports(problem.model):
        motion = problems.run_problem(problem, method, options)
        # The reference of a gear train has a limited accuracy.
        accuracy = references.TRAIN_ACCURACY if problem.model.mesh_names else 0.0
        state = np.maximum(state_error(motion, expected), accuracy)
        event = np.maximum(event_error(motion, expected), accuracy)
        if np.isfinite(motion.state).all():
            evaluations = motion.evaluations / problem.periods
        if problem.settles:

            def period_map(start: np.ndarray) -> np.ndarray:
                """Return the state, (2,), one mesh period later, computed by the method."""
                return problems.run_problem(problem, method, options, start, periods=1).state

            orbit_state = reference.orbit_state.values
            matrix = problems.period_map_jacobian(period_map, orbit_state, DIFFERENCE)
            multiplier = abs(problems.largest_multiplier(matrix) - reference.largest_multiplier)
    return {
        "state_error": float(state),
        "event_error": float(event),
        "multiplier_error": float(multiplier),
        "period_evaluations": evaluations,
    }


def _rounding_error_floors(
    problem: problems.Problem, reference: problems.Motion
) -> dict[str, float]:
    """Return the errors of state, event phase and multiplier that are caused by rounding alone.

    The errors of state and phase are half the spacing of floating-point numbers at the largest
    value of the `reference` motion. The multiplier results from central differences, whose half
    width divides the error. For gear trains, the accuracy of the reference is returned.
    """
    state = phase = references.TRAIN_ACCURACY
    multiplier = math.nan
    if not problem.model.mesh_names:
        state = np.spacing(np.abs(reference.state).max()) / 2.0
        phase = np.spacing(reference.phases.max()) / 2.0 if reference.phases.size else math.nan
        multiplier = state / DIFFERENCE if problem.settles else math.nan
    return {"state_floor": state, "event_floor": phase, "multiplier_floor": multiplier}


def _build_dataset(title, method, names, data, pair, parameters) -> xr.Dataset:
    """Build a dataset from `data`, the variables of a method over problem and setting.

    The dimension "rung" is the index of a setting, which is described by the label of the method
    variant ("line"), its family, the accuracy parameter with its value ("knob") and all options.
    `names` are the names of the problems; `pair` and `parameters` become attributes.
    """
    variants, parameter_texts, options = zip(*method_settings(method), strict=True)
    columns = {
        "line": [variant.label for variant in variants],
        "family": [variant.family for variant in variants],
        "knob": parameter_texts,
        "options": [canonical_json(values) for values in options],
    }
    data |= {name: ("rung", np.array(values, object)) for name, values in columns.items()}
    coords = {"problem": names, "rung": np.arange(len(variants), dtype=np.int32)}
    attrs = {"method": method, "references": GearPair.references}
    attrs |= {"gear_pair": pair.as_dict(), "parameters": parameters}
    return make_study_result(title, data, coords, method, **attrs)


def measure_times(
    method: str,
    names: Sequence[str],
    pair: GearPair,
    six_degrees: dict,
    settings: dict,
    repeats: int,
) -> xr.Dataset:
    """Measure the wall time of a method per mesh period, for all its settings and problems.

    A setting is a value of the accuracy parameter; the dimension "rung" is its index. `names` are
    the names of the problems; `pair`, `six_degrees` (arguments of `SixDegreePair`) and
    `settings` (damping and numbers of mesh periods) are arguments of
    `gearlib.studies.trials.problems.build_problem`. The minimum of `repeats` runs is taken; long
    runs are timed once. No other program may run at the same time. period_time, in seconds,
    excludes the start of a run and is NaN if the method cannot run the model; closed_form_time is
    the time of one evaluation of the exact solution in contact.
    """

    def setting_time(name: str, setting: tuple) -> dict:
        """Measure the wall time of a setting (variant, text, options) on the problem `name`."""
        _, _, options = setting
        problem = problems.build_problem(name, pair, six_degrees, settings)
        return {"period_time": _measure_period_time(problem, method, options, repeats)}

    data = evaluate_on_grid({"problem": names, "rung": method_settings(method)}, setting_time)
    data["closed_form_time"] = measure_closed_form_time(repeats)
    parameters = {"settings": settings, "six_degrees": six_degrees, "repeats": repeats}
    return _build_dataset(f"Wall times of method {method}", method, names, data, pair, parameters)


def _measure_period_time(
    problem: problems.Problem, method: str, options: dict, repeats: int
) -> float:
    """Measure the wall time of a method per mesh period of a problem, in seconds.

    The minimum of `repeats` measurements is returned, or NaN if the method does not support the
    model or stops early. `options` are the options of the method.
    """
    if not integrators.METHODS[method].supports(problem.model):
        return math.nan
    _, integrator, options = integrators.choose_method(problem.model, method, options)

    def run(periods: int, calls: int) -> bool:
        """Run the method `calls` times over `periods` mesh periods.

        Return whether any run stopped early.
        """
        if method == "exact":
            # Exact runs are so short that they are repeated in a single call, by a compiled loop.
            propagator = problem.model.propagator(problem.tuning, method)
            starts = np.tile(propagator.initial_state((0.0, 0.0)), (calls, 1))
            _, statuses = propagator.propagate_many(starts, periods, MAX_EVENTS)
            return statuses.any()
        span = Span(periods, recorded=1, max_events=MAX_EVENTS)
        arguments = problem.model, problem.tuning, (0.0, 0.0), span
        return any(integrator.run(*arguments, **options).status for _ in range(calls))

    short_periods = 1
    max_periods = MAX_PERIODS
    if method == "heyoka":
        # The short run must be long enough to compile heyoka's steps for all contact states.
        short_periods = 64
    elif method == "exact":
        # The exact method stops when the motion has settled, so timed runs must not be longer than
        # the problem.
        short_periods = max(1, problem.periods // 2)
        if problem.settles:
            max_periods = problem.periods
    if run(short_periods, calls=1):
        return math.nan
    return measure_seconds_per_period(run, short_periods, max_periods, repeats)


def measure_seconds_per_period(
    run: Callable, short_periods: int, max_periods: int, repeats: int
) -> float:
    """Measure the wall time per mesh period of ``run(periods, calls)``, without its startup.

    ``run`` makes `calls` runs over `periods` mesh periods. The result is computed from the
    difference between a long run (up to `max_periods`) and a run of `short_periods`. Short
    measurements are repeated and the minimum of `repeats` is used, because other programs can only
    slow a run down. The result is NaN if a measurement was disturbed.
    """
    long_periods = short_periods + 1
    calls = 1

    def shortest_times(repeats: int) -> Iterator[float]:
        """Yield the minimum time of the short run, then of the long run, in `repeats` runs."""
        for periods in (short_periods, long_periods):
            yield min(timeit(partial(run, periods, calls), number=1, repeat=repeats))

    short_time, long_time = shortest_times(1)
    # Extend the runs until their difference is long enough to be measured.
    while long_time - short_time < max(MIN_SPAN, 0.5 * short_time) and calls < MAX_CALLS:
        if long_periods < max_periods:
            long_periods = min(4 * long_periods, max_periods)
        else:
            calls *= 2
        short_time, long_time = shortest_times(1)
    if long_time < MAX_REPEATED:
        short_time, long_time = shortest_times(repeats)
    if long_time <= short_time:
        return math.nan  # other programs have disturbed the measurement
    return (long_time - short_time) / (calls * (long_periods - short_periods))


@kernel
def _evolve_repeatedly(level, u, v, t, count):
    """Advance displacement u and velocity v by `count` steps of length t; return both.

    `level` has the coefficients of the exact solution at a constant stiffness.
    """
    for _ in range(count):
        u, v = evolve(level, u, v, t)
    return u, v


def measure_closed_form_time(repeats: int) -> float:
    """Measure the time of one evaluation of the exact solution in contact, in seconds.

    Many evaluations (steps at constant stiffness) are timed together. The minimum of `repeats`
    measurements is used, because other programs can only slow them down.
    """
    # Any underdamped contact takes the same time.
    level = stiffness_level_at_tuning(1.0, 0.06, 0.9)
    count = 100_000
    _evolve_repeatedly(level, 1.0, 0.0, 1.0, 1)  # compiles the kernel
    evaluate = partial(_evolve_repeatedly, level, 1.0, 0.0, 1.0, count)
    return min(timeit(evaluate, number=1, repeat=repeats)) / count
