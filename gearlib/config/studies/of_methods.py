"""Studies of the methods: analytic ones, numerical stability, failures, work and precision."""

from gearlib.config.experiments import AnalyticMethod
from gearlib.config.studies.study import (
    ALONE,
    LONG,
    METHODS,
    Drawing,
    Job,
    Study,
    Table,
    absent,
    bearings,
    each,
    grid_of,
    installed,
    listed,
    run_length,
    without,
)
from gearlib.config.trials import Failures, StabilityChart, WorkPrecision

_LARGER = ("kernels", "larger_kernels")


def _trial(c, wildcards):
    """Return the trial of a job."""
    (trial,) = (trial for trial in c.failures.trials if trial.name == wildcards.trial)
    return trial


def _trial_params(c):
    return {
        "name": "{trial}",
        "method": lambda wildcards: _trial(c, wildcards).method,
        "options": lambda wildcards: _trial(c, wildcards).options,
    }


def _trial_files(c):
    return each("failures/{}.nc", [t.name for t in c.failures.trials if installed(t.method)])


def _untried(c):
    return absent(dict.fromkeys(t.method for t in c.failures.trials))


def _method(wildcards):
    return [wildcards.method]


def _absent(section):
    """Return the function that gives the methods of a section that are left out."""
    return lambda c: absent(getattr(c, section).methods)


def _by_method(section, pattern):
    """Return the function that gives the files of all methods of a section."""
    return lambda c: each(pattern, filter(installed, getattr(c, section).methods))


def _problems(c):
    """Return what the test problems take from the configuration, without methods and repeats."""
    return {
        "pair": c.gear_pair.model_dump(),
        "six_degrees": c.six_degree_parameters(),
        "settings": without(c.work_precision, "methods", "problems", "repeats"),
    }


_ERRORS = _by_method("work_precision", "work_precision/errors_{method}.nc")
_TIMES = _by_method("work_precision", "work_precision/times_{method}.nc")


def _fastest_caption(c):
    left_out = _absent("work_precision")(c)
    missing = f"Not installed, and therefore not compared: {listed(left_out)}." if left_out else ""
    return f"""For each test problem and accuracy of the final state (displacement and dx/dtau, in
        static deflections): the fastest method of gearlib ("own"), the fastest solver of another
        package ("other"), the accuracy parameter of each, and how many times faster that of gearlib
        is. Errors are those against a run in 50 digits; times are those of one machine and one run
        on one thread, without compilation and start. {missing}"""


ANALYTIC_METHOD = Study(
    "analytic_method",
    AnalyticMethod,
    METHODS,
    Job(
        "analytic_method",
        "analytic_method:compute",
        lambda c: {
            "pair": c.pair_parameters(c.analytic_method.damping),
            "settings": c.analytic_method.model_dump(),
            "run": run_length(c),
            "tunings": grid_of(c.analytic_method),
        },
    ),
    Drawing(
        "analytic_method_figure.draw",
        {"data": "analytic_method.nc"},
        "analytic_method",
        "The paper's analytic method",
        """The paper's analytic method with the damping {c.analytic_method.damping}. Above:
        iterates from the static deflection; each application of the kernel corrects the
        remainder, and each dot is followed by a step of the degenerate part. Below: the factor
        by which an iteration contracts deviations from the exact orbit, over tuning and number
        of degenerate harmonics (those nearest to resonance first); crosses: no convergence from
        the lowest harmonics of the exact orbit. Line: the automatic choice, which relies on a
        bound.""",
        second=(
            "harmonic_balance",
            "Harmonic balance",
            """Above: largest errors over the period against the exact orbit, over the number of
            harmonics h. Dotted: the slopes with which a stiffness that jumps lets displacement
            and dx/dτ converge (Gibbs). E. Schmidt's method solves the same equations as
            harmonic balance. Below: extrema of harmonic balance of one mesh period, followed up
            and down in tuning, beside exact sweeps; open marks are unstable. Where marks end
            before a line, Newton's method found no motion from the neighbouring one, or one on
            another branch.""",
        ),
    ),
)

STABILITY_CHART = Study(
    "stability_chart",
    StabilityChart,
    METHODS,
    Job(
        "stability_chart",
        "trials.stability_of_methods:compute",
        lambda c: {
            "pair": c.pair_parameters(c.stability_chart.damping),
            "tunings": grid_of(c.stability_chart),
            "fine_tunings": grid_of(c.stability_chart, "fine_step"),
            "steps": c.stability_chart.steps,
            "methods": c.stability_chart.model_dump()["methods"],
        },
        methods=lambda c: [one.method for one in c.stability_chart.methods.values()],
    ),
    Drawing(
        "stability_figure.draw",
        {"chart": "stability_chart.nc"},
        "stability_chart",
        "Numerical stability of fixed steps",
        """Stability of fixed-step methods on the mesh without contact loss, over steps per
        period and tuning; below, the exact spectral radius of one mesh period. Invents motion:
        the numerical solution grows where the exact one does not; hides the instability: the
        exact solution grows, the numerical one does not. Dashed: limit of the stability
        interval of explicit Runge-Kutta steps.""",
    ),
)

FAILURES = Study(
    "failures",
    Failures,
    METHODS,
    Job(
        "trial",
        "trials.failures:compute",
        _trial_params,
        files=("failures/{trial}.nc",),
        kernels=_LARGER,
        methods=lambda c: lambda wildcards: [_trial(c, wildcards).method],
        priority=LONG,
    ),
    Job(
        "gather_failures",
        "gearlib.data.gathering:gather_failures",
        data={"columns": _trial_files},
        files=("failures.nc",),
        kernels=(),
    ),
    Drawing(
        "failures_figure.draw",
        {"matrix": "failures.nc"},
        "failures",
        "Failures: difficult problems against methods",
        """Difficult problems (rows) and methods (columns). Letter and colour: the first rule of
        `gearlib/studies/trials/failures.py` that applies; number: error in the quantity that
        the problem compares (contact events: how many are missing, spurious or out of order).
        Star: fewer mesh periods than the other methods, because the steps of the solver are
        interpreted. The references are independent of the method that is judged.""",
        absent=_untried,
    ),
    gears=lambda c: "paper's pair and others, in problems of its own",
    refusal=lambda c: (
        "gears is not allowed: its problems have gears of their own, it must be left out"
        if c.gears
        else ""
    ),
)

WORK_PRECISION = Study(
    "work_precision",
    WorkPrecision,
    METHODS,
    # The kernels are those of long runs, which say where Newton's method starts.
    Job(
        "work_precision_references",
        "trials.references:compute",
        lambda c: _problems(c) | {"names": c.work_precision.problems},
        files=("work_precision/references.nc",),
        kernels=_LARGER,
        priority=LONG,
    ),
    Job(
        "work_precision_errors",
        "trials.work_precision:errors",
        lambda c: _problems(c) | {"method": "{method}"},
        {"known": "work_precision/references.nc"},
        files=("work_precision/errors_{method}.nc",),
        methods=lambda c: _method,
        priority=LONG,
    ),
    # Wall times: no two runs give the same, so nothing but the figure and the table of times may
    # depend on this dataset, and no job runs beside, whose load would be measured along.
    Job(
        "work_precision_times",
        "trials.work_precision:times",
        lambda c: _problems(c) | {"method": "{method}", "repeats": c.work_precision.repeats},
        {"known": "work_precision/references.nc"},
        files=("work_precision/times_{method}.nc",),
        methods=lambda c: _method,
        script="compute_alone",
        threads=ALONE,
    ),
    Table(
        "work_precision",
        "trials.fastest:rows",
        {"errors": _ERRORS, "times": _TIMES},
        "Work and precision: table of the fastest",
        _fastest_caption,
    ),
    Drawing(
        "work_precision_figure.draw",
        {"errors": _ERRORS},
        "work_precision_evaluations",
        "Work and precision: evaluations",
        """Error of the final state, against a run in 50 digits, over evaluations of the
        right-hand side per mesh period: one panel for each test problem, one line for each
        method, from coarse to fine values of its accuracy parameter. Marks at the left edge:
        closed forms, which evaluate no right-hand side. Grey: half the last place of the state.""",
        second=(
            "work_precision_measures",
            "Work and precision: events, multipliers",
            """Errors of the phases of the last events, and of the largest absolute Floquet
            multiplier of the settled orbit, over evaluations of the right-hand side per mesh
            period. A method whose events differ in number from those of the reference has no
            point. Multipliers are those of central differences; grey: rounding.""",
        ),
        absent=_absent("work_precision"),
    ),
    Drawing(
        "work_precision_figure.draw_time",
        {"errors": _ERRORS, "times": _TIMES},
        "work_precision_time",
        "Work and precision: wall time",
        """Error of the final state, against a run in 50 digits, over wall time per mesh period,
        one thread, without compilation and start, the shortest of up to
        {c.work_precision.repeats} runs: one panel for each test problem, one line for each
        method. Grey: below half the last place of the state, and quicker than one evaluation of
        the closed form of contact. Times are those of one machine and one run.""",
        absent=_absent("work_precision"),
        name="work_precision_time",
    ),
    refusal=lambda c: ("six_degrees" in c.work_precision.problems and bearings(c)) or "",
)
