"""Numerical stability of fixed-step methods."""


use rule job as stability_chart with:
    pathvars:
        job="stability_chart",
    input:
        kernels=rules.compile_kernels.output.stamp,
        sources=function_sources(
            "gearlib.studies.trials.stability:compute",
            *(m.method for m in CONFIG.stability_chart.methods.values()),
        ),
    output:
        dataset="results/stability_chart.nc",
    params:
        script="compute",
        function="gearlib.studies.trials.stability:compute",
        pair=canonical(CONFIG.pair_parameters(CONFIG.stability_chart.damping)),
        tunings=grid_of(CONFIG.stability_chart),
        fine_tunings=grid_of(CONFIG.stability_chart, "fine_step"),
        steps=CONFIG.stability_chart.steps,
        methods=canonical(CONFIG.stability_chart.model_dump()["methods"]),
