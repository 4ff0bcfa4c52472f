"""Compare measured sets with computed curves, and scatter designs within tolerances."""


use rule _compute as measured_curve with:
    pathvars:
        job="measured/{measured}",
    input:
        measured=measured_set_files,
        resonance="results/resonance.nc",
        sources=sources_of("compute", "studies.measured"),
    output:
        "results/measured/{measured}.nc",
    params:
        function="gearlib.studies.measured:read_response_curve",
        path=lambda wildcards: MEASURED_SETS[wildcards.measured][0],


use rule _compute as measured_course with:
    pathvars:
        job="measured/courses/{measured}",
    input:
        measured=measured_set_files,
        kernels=KERNELS,
        sources=sources_of("compute", "studies.measured"),
    output:
        "results/measured/courses/{measured}.nc",
    params:
        function="gearlib.studies.measured:compare_time_histories",
        path=lambda wildcards: MEASURED_SETS[wildcards.measured][0],
        models=MODELS,
        run=GEARS_SAMPLED_RUN,


use rule _compute as measured_orders with:
    pathvars:
        job="measured/orders/{measured}",
    input:
        measured=measured_set_files,
        kernels=KERNELS,
        matrix_kernels=MATRIX_KERNELS,
        sources=sources_of("compute", "studies.measured"),
    output:
        "results/measured/orders/{measured}.nc",
    params:
        function="gearlib.studies.measured:compare_run_ups",
        path=lambda wildcards: MEASURED_SETS[wildcards.measured][0],
        models=MODELS,


MEASURED_COURSES = [name for name, (_, data) in MEASURED_SETS.items() if data.has_time_histories()]
MEASURED_RUN_UPS = [name for name, (_, data) in MEASURED_SETS.items() if data.has_run_ups()]


use rule _table as measured_table with:
    pathvars:
        job="measured_table",
    input:
        curves=expand(rules.measured_curve.output, measured=MEASURED_SETS),
        courses=expand(rules.measured_course.output, measured=MEASURED_COURSES),
        orders=expand(rules.measured_orders.output, measured=MEASURED_RUN_UPS),
        resonance="results/resonance.nc",
        sources=sources_of("table", "studies.measured"),
    output:
        **table_files("measured", "Measured and computed, in numbers", MEASURED),
    params:
        function="gearlib.studies.measured:comparison_rows",


use rule _draw as draw_measured_courses with:
    pathvars:
        job="draw_measured_courses",
    input:
        courses=rules.measured_table.input.courses,
        sources=sources_of("draw", "figures.measured_figure"),
    output:
        figure_files("measured_courses", "Measured time courses", MEASURED),
    params:
        draw="measured_figure.draw_courses",
        settings=COLOURS,


use rule _draw as draw_measured_orders with:
    pathvars:
        job="draw_measured_orders",
    input:
        orders=rules.measured_table.input.orders,
        sources=sources_of("draw", "figures.measured_figure"),
    output:
        figure_files("measured_orders", "Mesh orders of measured run-ups", MEASURED),
    params:
        draw="measured_figure.draw_orders",
        settings=COLOURS,


# Designs at the points of a Sobol' sequence, in shards.


use rule _compute as tolerance_shard with:
    pathvars:
        job="tolerances/{samples}",
    input:
        kernels=KERNELS,
        sources=sources_of("compute", "studies.tolerance_study"),
    output:
        "results/tolerances/{samples}.nc",
    params:
        **DESIGNS,
        **select_keys(config["tolerances"], "samples", "directions", "periods", "record_periods"),
        function="gearlib.studies.tolerance_study:compute_scatter_shard",
        tunings=tuning_grid(config["tolerances"]),
        box=[[-end, end] for end in config["tolerances"]["box"]],
        shard="{samples}",


use rule _compute as gather_tolerances with:
    pathvars:
        job="gather_tolerances",
    input:
        shards=expand(rules.tolerance_shard.output, samples=CONFIG.tolerances.shard_names()),
        sources=sources_of("compute", "uncertainty.scatter"),
    output:
        "results/tolerances.nc",
    params:
        function="gearlib.uncertainty.scatter:join_shards",


use rule _compute as tolerance_indices with:
    pathvars:
        job="tolerance_indices",
    input:
        kernels=KERNELS,
        sources=sources_of("compute", "studies.tolerance_study"),
    output:
        "results/tolerance_indices.nc",
    params:
        **DESIGNS,
        function="gearlib.studies.tolerance_study:compute_sobol_indices",
        samples=config["tolerances"]["index_samples"],


use rule _table as tolerance_table with:
    pathvars:
        job="tolerance_table",
    input:
        scattered="results/tolerances.nc",
        sources=sources_of("table", "studies.tolerance_study"),
    output:
        **table_files("tolerances", "Tolerances: table", TOLERANCES),
    params:
        function="gearlib.studies.tolerance_study:table_rows",


use rule _draw as draw_tolerances with:
    pathvars:
        job="draw_tolerances",
    input:
        teeth=TEETH_SWEEPS,
        scattered="results/tolerances.nc",
        # Sobol' indices need independent parameters.
        indices=[] if config["tolerances"]["correlations"] else "results/tolerance_indices.nc",
        sources=sources_of("draw", "figures.scatter_figure"),
    output:
        figure_files(
            "tolerance_bands", "Bands over speed, and the probability of contact loss", TOLERANCES
        ),
        figure_files(
            "tolerance_quantities", "Jumps and peaks: how they scatter, and by what", TOLERANCES
        ),
    params:
        draw="scatter_figure.draw",
