"""Work and precision: references, errors and evaluations of each method, their wall times apart."""


# The kernels are those of long runs, which say where Newton's method starts.
use rule job as work_precision_references with:
    pathvars:
        job="work_precision/references",
    input:
        kernels=rules.compile_kernels.output.stamp,
        larger_kernels=rules.compile_larger_kernels.output.stamp,
        sources=function_sources("gearlib.studies.trials.references:compute"),
    output:
        dataset="results/work_precision/references.nc",
    priority: LONG
    params:
        script="compute",
        function="gearlib.studies.trials.references:compute",
        names=CONFIG.work_precision.problems,
        pair=canonical(CONFIG.gear_pair.model_dump()),
        six_degrees=canonical(CONFIG.six_degrees.model_dump()),
        settings=work_precision_settings(),


use rule job as work_precision_errors with:
    pathvars:
        job="work_precision/errors_{method}",
    input:
        kernels=rules.compile_kernels.output.stamp,
        known=rules.work_precision_references.output.dataset,
        sources=sources_with_method(
            function_sources, "gearlib.studies.trials.work_precision:errors"
        ),
    output:
        dataset="results/work_precision/errors_{method}.nc",
    priority: LONG
    params:
        script="compute",
        function="gearlib.studies.trials.work_precision:errors",
        pair=canonical(CONFIG.gear_pair.model_dump()),
        six_degrees=canonical(CONFIG.six_degrees.model_dump()),
        settings=work_precision_settings(),
        method="{method}",


# Wall times: no two runs give the same, so nothing but the figure and the table of times may
# depend on this dataset. It asks for more threads than there are: Snakemake then gives it all
# cores of the call and starts no job beside it, whose load would be measured along.
use rule job as work_precision_times with:
    pathvars:
        job="work_precision/times_{method}",
    input:
        kernels=rules.compile_kernels.output.stamp,
        references=rules.work_precision_references.output.dataset,
        sources=sources_with_method(script_sources, "work_precision_times"),
    output:
        dataset="results/work_precision/times_{method}.nc",
    threads: 1024
    params:
        script="work_precision_times",
        pair=canonical(CONFIG.gear_pair.model_dump()),
        six_degrees=canonical(CONFIG.six_degrees.model_dump()),
        settings=work_precision_settings(),
        repeats=CONFIG.work_precision.repeats,


use rule job as work_precision_table with:
    pathvars:
        job="work_precision_table",
    input:
        errors=work_precision_files("errors"),
        times=work_precision_files("times"),
        sources=function_sources("gearlib.studies.trials.fastest:write_csv", script="table"),
    output:
        csv="results/work_precision.csv",
        page=table_page("work_precision", "Work and precision: table of the fastest", METHODS),
    params:
        script="table",
        function="gearlib.studies.trials.fastest:write_csv",
        # The caption names them.
        absent=absent(CONFIG.work_precision.methods),
