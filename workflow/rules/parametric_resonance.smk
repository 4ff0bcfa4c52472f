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
        sources=script_sources("tongues"),
        kernels=rules.compile_kernels.output.stamp,
    output:
        dataset="results/tongues.nc",
        sentence="results/parametric_resonance.txt",
    params:
        script="tongues",
        pairs=canonical({name: CONFIG.pair_parameters(name) for name in CONFIG.dampings}),
        asked=CONFIG.parametric_resonance.asked,
        tunings=canonical([CONFIG.parametric_resonance.start, CONFIG.parametric_resonance.stop]),
        run=canonical(run_length()),


use rule job as parametric_resonance_page with:
    pathvars:
        job="parametric_resonance_page",
    input:
        sentence=rules.tongues.output.sentence,
        sources=script_sources("text_page"),
    output:
        page=table_page(
            "parametric_resonance",
            "Parametric resonance: the tuning in question, in words",
            EXPLANATIONS,
        ),
    params:
        script="text_page",
