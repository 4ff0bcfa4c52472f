"""Numerical stability of fixed-step methods."""


use rule job as stability_chart with:
    pathvars:
        job="stability_chart",
    input:
        kernels=rules.compile_kernels.output.stamp,
        sources=script_sources(
            "stability_chart", *(m.method for m in CONFIG.stability_chart.methods.values())
        ),
    output:
        dataset="results/stability_chart.nc",
    params:
        script="stability_chart",
        pair=canonical(CONFIG.pair_parameters(CONFIG.stability_chart.damping)),
        settings=canonical(CONFIG.stability_chart.model_dump()),
