"""Parametric resonance: the chart, and the tongues of the dampings."""


use rule job as parametric_resonance with:
    pathvars:
        job="parametric_resonance",
    input:
        sources=function_sources("gearlib.analysis.tongues.chart:compute"),
        kernels=rules.compile_kernels.output.stamp,
    output:
        dataset="results/parametric_resonance.nc",
    params:
        script="compute",
        function="gearlib.analysis.tongues.chart:compute",
        pair=canonical(CONFIG.gear_pair.model_dump()),
        settings=canonical(CONFIG.parametric_resonance.model_dump(exclude={"asked", *GRID})),
        tunings=grid_of(CONFIG.parametric_resonance),


use rule job as tongues with:
    pathvars:
        job="tongues",
    input:
        sources=function_sources("gearlib.studies.contact_loss:compute"),
        kernels=rules.compile_kernels.output.stamp,
    output:
        dataset="results/tongues.nc",
    params:
        script="compute",
        function="gearlib.studies.contact_loss:compute",
        pairs=canonical({name: CONFIG.pair_parameters(name) for name in CONFIG.dampings}),
        tuning=CONFIG.parametric_resonance.asked,
        start=CONFIG.parametric_resonance.start,
        stop=CONFIG.parametric_resonance.stop,
        run=canonical({key: run_length()[key] for key in ("periods", "initial_state")}),


use rule job as parametric_resonance_table with:
    pathvars:
        job="parametric_resonance_table",
    input:
        tongues=rules.tongues.output.dataset,
        sources=function_sources("gearlib.studies.contact_loss:write_csv", script="table"),
    output:
        csv="results/parametric_resonance.csv",
        page=table_page(
            "parametric_resonance",
            "Parametric resonance: the tuning in question",
            EXPLANATIONS,
        ),
    params:
        script="table",
        function="gearlib.studies.contact_loss:write_csv",
