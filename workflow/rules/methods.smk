"""Compare methods: the paper's analytic one, fixed steps, difficult problems, work and precision."""


use rule _compute as compute_analytic_method with:
    pathvars:
        job="analytic_method",
    input:
        kernels=KERNELS,
        sources=sources_of("compute", "studies.analytic_method"),
    output:
        "results/analytic_method.nc",
    params:
        function="gearlib.studies.analytic_method:analytic_method_study",
        pair=PAIRS[config["analytic_method"]["damping"]],
        settings=config["analytic_method"],
        run=RUN,
        tunings=tuning_grid(config["analytic_method"]),


use rule _draw as draw_analytic_method with:
    pathvars:
        job="draw_analytic_method",
    input:
        teeth=TEETH_SWEEPS,
        data="results/analytic_method.nc",
        sources=sources_of("draw", "figures.analytic_method_figure"),
    output:
        figure_files("analytic_method", "The paper's analytic method", METHODS),
        figure_files("harmonic_balance", "Harmonic balance", METHODS),
    params:
        draw="analytic_method_figure.draw",


# Numerical stability of fixed steps on the mesh without contact loss.


use rule _compute as compute_stability_chart with:
    pathvars:
        job="stability_chart",
    input:
        kernels=KERNELS,
        sources=sources_of(
            "compute",
            "studies.trials.stability_of_methods",
            methods=[entry.method for entry in CONFIG.stability_chart.methods.values()],
        ),
    output:
        "results/stability_chart.nc",
    params:
        **select_keys(config["stability_chart"], "steps", "methods"),
        function="gearlib.studies.trials.stability_of_methods:compute_spectral_radii",
        pair=PAIRS[config["stability_chart"]["damping"]],
        tunings=tuning_grid(config["stability_chart"]),
        fine_tunings=tuning_grid(config["stability_chart"], "fine_step"),


use rule _draw as draw_stability_chart with:
    pathvars:
        job="draw_stability_chart",
    input:
        teeth=TEETH_SWEEPS,
        chart="results/stability_chart.nc",
        sources=sources_of("draw", "figures.methods_figure"),
    output:
        figure_files("stability_chart", "Numerical stability of fixed steps", METHODS),
    params:
        draw="methods_figure.draw_stability",


# All methods on difficult problems, except for those whose packages are not installed.

#: Name of a trial -> method with options.
TRIALS = {trial["name"]: trial for trial in config["failures"]["trials"]}
TRIAL_SOURCES = sources_by_method("compute", "studies.trials.failures", "scipy")


use rule _compute as trial with:
    pathvars:
        job="failures/{trial}",
    input:
        kernels=KERNELS,
        matrix_kernels=MATRIX_KERNELS,
        taylor_kernels=TAYLOR_KERNELS,
        sources=lambda wildcards: TRIAL_SOURCES[TRIALS[wildcards.trial]["method"]],
    output:
        "results/failures/{trial}.nc",
    priority: LONG
    params:
        function="gearlib.studies.trials.failures:judge_method",
        name="{trial}",
        method=lambda wildcards: TRIALS[wildcards.trial]["method"],
        options=lambda wildcards: TRIALS[wildcards.trial]["options"],


use rule _compute as gather_failures with:
    pathvars:
        job="gather_failures",
    input:
        columns=[
            f"results/failures/{name}.nc"
            for name, trial in TRIALS.items()
            if targets.is_installed(trial["method"])
        ],
        sources=sources_of("compute", "data.gathering"),
    output:
        "results/failures.nc",
    params:
        function="gearlib.data.gathering:gather_failures",


use rule _draw as draw_failures with:
    pathvars:
        job="draw_failures",
    input:
        matrix="results/failures.nc",
        sources=sources_of("draw", "figures.methods_figure"),
    output:
        figure_files("failures", "Failures: difficult problems against methods", METHODS),
    params:
        draw="methods_figure.draw_failures",
        gears="paper's pair and others, in problems of its own",
        absent=select_missing_packages(trial["method"] for trial in TRIALS.values()),


# Errors of the methods on test problems, over evaluations and wall time.

PROBLEMS = {
    "pair": UNDAMPED,
    "six_degrees": SIX_DEGREES,
    "settings": exclude_keys(config["work_precision"], "methods", "problems", "repeats"),
}
INSTALLED = [*filter(targets.is_installed, config["work_precision"]["methods"])]
WORK_PRECISION_SOURCES = sources_by_method("compute", "studies.trials.work_precision")
TIMES_SOURCES = sources_by_method("compute_alone", "studies.trials.work_precision")


# Newton's method starts from long runs, which need the kernels.
use rule _compute as work_precision_references with:
    pathvars:
        job="work_precision_references",
    input:
        kernels=KERNELS,
        matrix_kernels=MATRIX_KERNELS,
        taylor_kernels=TAYLOR_KERNELS,
        sources=sources_of("compute", "studies.trials.references"),
    output:
        "results/work_precision/references.nc",
    priority: LONG
    params:
        **PROBLEMS,
        function="gearlib.studies.trials.references:compute_references",
        names=config["work_precision"]["problems"],


use rule _compute as work_precision_errors with:
    pathvars:
        job="work_precision/errors_{method}",
    input:
        reference_data="results/work_precision/references.nc",
        kernels=KERNELS,
        sources=lambda wildcards: WORK_PRECISION_SOURCES[wildcards.method],
    output:
        "results/work_precision/errors_{method}.nc",
    priority: LONG
    params:
        **PROBLEMS,
        function="gearlib.studies.trials.work_precision:compute_errors",
        method="{method}",


# Wall times differ between runs, so only figures and a table may depend on this dataset. No other
# job runs at the same time, because it would change the times.
use rule _compute_alone as work_precision_times with:
    pathvars:
        job="work_precision/times_{method}",
    input:
        kernels=KERNELS,
        sources=lambda wildcards: TIMES_SOURCES[wildcards.method],
    output:
        "results/work_precision/times_{method}.nc",
    params:
        **PROBLEMS,
        function="gearlib.studies.trials.work_precision:measure_times",
        method="{method}",
        names=config["work_precision"]["problems"],
        repeats=config["work_precision"]["repeats"],


use rule _table as work_precision_table with:
    pathvars:
        job="work_precision_table",
    input:
        errors=expand(rules.work_precision_errors.output, method=INSTALLED),
        times=expand(rules.work_precision_times.output, method=INSTALLED),
        sources=sources_of("table", "studies.trials.fastest"),
    output:
        **table_files("work_precision", "Work and precision: table of the fastest", METHODS),
    params:
        function="gearlib.studies.trials.fastest:table_rows",


use rule _draw as draw_work_precision with:
    pathvars:
        job="draw_work_precision",
    input:
        errors=rules.work_precision_table.input.errors,
        times=rules.work_precision_table.input.times,
        sources=sources_of("draw", "figures.methods_figure"),
    output:
        figure_files("work_precision_evaluations", "Work and precision: evaluations", METHODS),
        figure_files("work_precision_measures", "Work and precision: events, multipliers", METHODS),
        figure_files("work_precision_time", "Work and precision: wall time", METHODS),
    params:
        draw="methods_figure.draw_work_precision",
        absent=select_missing_packages(config["work_precision"]["methods"]),
