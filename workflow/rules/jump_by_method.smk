"""The jump of the motion from rest, method by method, and its table."""


use rule job as jump_by_method with:
    pathvars:
        job="jump_by_method/{method}",
    input:
        kernels=rules.compile_kernels.output.stamp,
        sources=sources_with_method(
            function_sources, "gearlib.studies.trials.jump_by_method:compute"
        ),
    output:
        dataset="results/jump_by_method/{method}.nc",
    priority: LONG
    params:
        script="compute",
        function="gearlib.studies.trials.jump_by_method:compute",
        pair=canonical(CONFIG.pair_parameters(CONFIG.jump_by_method.damping)),
        settings=canonical(CONFIG.jump_by_method.model_dump(exclude={"methods", "damping"})),
        run=canonical(run_length()),
        tunings=grid_of(CONFIG.jump_by_method),
        slow_tunings=grid_of(CONFIG.jump_by_method.slow),
        method="{method}",


use rule job as jump_by_method_table with:
    pathvars:
        job="jump_by_method_table",
    input:
        datasets=jump_by_method_files(),
        sources=function_sources("gearlib.studies.trials.jump_by_method:write_csv", script="table"),
    output:
        csv="results/jump_by_method.csv",
        page=table_page("jump_by_method", "Jump from rest by method: table", METHODS),
    params:
        script="table",
        function="gearlib.studies.trials.jump_by_method:write_csv",
