"""Gear trains: the reducer over speed, what stands for it, and its Campbell diagram."""


use rule job as reducer with:
    pathvars:
        job="reducer",
    input:
        train_kernels=rules.compile_train_kernels.output.stamp,
        sources=function_sources("gearlib.studies.trains.reducer:compute"),
    output:
        dataset="results/reducer.nc",
    params:
        script="compute",
        function="gearlib.studies.trains.reducer:compute",
        pair=canonical(CONFIG.pair_parameters(CONFIG.reducer.damping)),
        tunings=grid_of(CONFIG.reducer),
        settings=canonical(CONFIG.reducer.model_dump(exclude={"damping", *GRID})),


use rule job as one_mesh with:
    pathvars:
        job="one_mesh",
    input:
        kernels=rules.compile_kernels.output.stamp,
        train_kernels=rules.compile_train_kernels.output.stamp,
        sources=function_sources("gearlib.studies.trains.one_mesh:compute"),
    output:
        dataset="results/one_mesh.nc",
    params:
        script="compute",
        function="gearlib.studies.trains.one_mesh:compute",
        pair=canonical(CONFIG.pair_parameters(CONFIG.reducer.damping)),
        tunings=grid_of(CONFIG.one_mesh),
        settings=canonical(
            CONFIG.reducer.model_dump(exclude={"damping", "backlashes", *GRID, *STARTS})
        ),
        changes=canonical(CONFIG.one_mesh.model_dump(exclude=GRID)),


use rule job as reducer_table with:
    pathvars:
        job="reducer_table",
    input:
        characteristics=rules.reducer.output.dataset,
        sources=function_sources("gearlib.studies.trains.reducer:write_csv", script="table"),
    output:
        csv="results/reducer.csv",
        page=table_page("reducer", "Fig. 1: the reducer, table", EXPLANATIONS),
    params:
        script="table",
        function="gearlib.studies.trains.reducer:write_csv",


use rule job as one_mesh_table with:
    pathvars:
        job="one_mesh_table",
    input:
        comparison=rules.one_mesh.output.dataset,
        sources=function_sources("gearlib.studies.trains.one_mesh:write_csv", script="table"),
    output:
        csv="results/one_mesh.csv",
        page=table_page("one_mesh", "Fig. 1: one mesh, table", EXPLANATIONS),
    params:
        script="table",
        function="gearlib.studies.trains.one_mesh:write_csv",


use rule job as train_sweep with:
    pathvars:
        job="train_sweep",
    input:
        train_kernels=rules.compile_train_kernels.output.stamp,
        sources=function_sources("gearlib.studies.trains.over_speed:compute"),
    output:
        dataset="results/train_sweep.nc",
    params:
        script="compute",
        function="gearlib.studies.trains.over_speed:compute",
        train=canonical(CONFIG.train_parameters(CONFIG.train_sweep.damping)),
        tunings=grid_of(CONFIG.train_sweep),
        settings=canonical(CONFIG.train_sweep.model_dump(exclude={"damping", *GRID})),


# Apart from the paper's statements, which need no gear train.
use rule job as assumption with:
    pathvars:
        job="assumption",
    input:
        comparison=rules.one_mesh.output.dataset,
        sources=function_sources("gearlib.studies.claims.machine:write_csv", script="table"),
    output:
        csv="results/assumption.csv",
        page=table_page("assumption", "What the paper assumes", CLAIMS),
    params:
        script="table",
        function="gearlib.studies.claims.machine:write_csv",


use rule job as campbell with:
    pathvars:
        job="campbell",
    input:
        characteristics=rules.reducer.output.dataset,
        sources=function_sources("gearlib.studies.trains.campbell:compute"),
    output:
        dataset="results/campbell.nc",
    params:
        script="compute",
        function="gearlib.studies.trains.campbell:compute",
        pair=canonical(CONFIG.pair_parameters(CONFIG.reducer.damping)),
        settings=canonical(CONFIG.reducer.model_dump(exclude={"damping", *GRID, *STARTS})),
        orders=CONFIG.campbell.orders,


use rule job as campbell_table with:
    pathvars:
        job="campbell_table",
    input:
        diagram=rules.campbell.output.dataset,
        sources=function_sources("gearlib.studies.trains.campbell:write_csv", script="table"),
    output:
        csv="results/campbell.csv",
        page=table_page("campbell", "Fig. 1: Campbell diagram, table", EXPLANATIONS),
    params:
        script="table",
        function="gearlib.studies.trains.campbell:write_csv",
