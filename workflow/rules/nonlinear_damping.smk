"""Nonlinear damping: one job for each place and power, one table."""


use rule job as nonlinear_damping with:
    pathvars:
        job="nonlinear_damping/{place}_{power}",
    input:
        kernels=rules.compile_kernels.output.stamp,
        sources=function_sources("gearlib.studies.nonlinear_damping:compute"),
    output:
        dataset="results/nonlinear_damping/{place}_{power}.nc",
    params:
        script="compute",
        function="gearlib.studies.nonlinear_damping:compute",
        pair=canonical(CONFIG.gear_pair.model_dump()),
        settings=canonical(CONFIG.nonlinear_damping.model_dump()),
        run=canonical(run_length()),
        samples_per_period=CONFIG.run.samples_per_period,
        tunings=grid_of(CONFIG.nonlinear_damping),
        place="{place}",
        power="{power}",


use rule job as nonlinear_damping_table with:
    pathvars:
        job="nonlinear_damping_table",
    input:
        studies=nonlinear_damping_files(),
        sources=function_sources("gearlib.studies.nonlinear_damping:write_csv", script="table"),
    output:
        csv="results/nonlinear_damping.csv",
        page=table_page("nonlinear_damping", "Nonlinear damping: table", EXPLANATIONS),
    params:
        script="table",
        function="gearlib.studies.nonlinear_damping:write_csv",
