"""The planetary train: its stability chart, and where its symmetric motion breaks."""


use rule job as train_chart with:
    pathvars:
        job="train_chart",
    input:
        kernels=rules.compile_kernels.output.stamp,
        sources=function_sources("gearlib.studies.trains.stability:compute"),
    output:
        dataset="results/train_chart.nc",
    params:
        script="compute",
        function="gearlib.studies.trains.stability:compute",
        train=canonical(CONFIG.planetary.model_dump()),
        tunings=grid_of(CONFIG.train_chart),
        settings=canonical(CONFIG.train_chart.model_dump(exclude=GRID)),


use rule job as symmetry_breaking with:
    pathvars:
        job="symmetry_breaking",
    input:
        kernels=rules.compile_kernels.output.stamp,
        sources=function_sources("gearlib.studies.trains.symmetry:compute"),
    output:
        dataset="results/symmetry_breaking.nc",
    params:
        script="compute",
        function="gearlib.studies.trains.symmetry:compute",
        train=canonical(CONFIG.planetary.model_dump()),
        tunings=grid_of(CONFIG.symmetry_breaking),
        settings=canonical(CONFIG.symmetry_breaking.model_dump(exclude={*GRID, "periods_shown"})),
