"""Drawn gears: their mesh stiffness by every method, and what its rectangle costs."""

DRAWN_PAIRS = canonical(CONFIG.mesh_stiffness.model_dump()["pairs"])


use rule job as mesh_stiffness with:
    pathvars:
        job="mesh_stiffness",
    input:
        sources=function_sources("gearlib.studies.mesh_stiffness:compute"),
    output:
        dataset="results/mesh_stiffness.nc",
    params:
        script="compute",
        function="gearlib.studies.mesh_stiffness:compute",
        pairs=DRAWN_PAIRS,
        samples=CONFIG.mesh_stiffness.samples,


use rule job as rectangle with:
    pathvars:
        job="rectangle",
    input:
        kernels=rules.compile_kernels.output.stamp,
        larger_kernels=rules.compile_larger_kernels.output.stamp,
        sources=function_sources("gearlib.studies.rectangle:compute"),
    output:
        dataset="results/rectangle.nc",
    params:
        script="compute",
        function="gearlib.studies.rectangle:compute",
        pairs=DRAWN_PAIRS,
        tunings=grid_of(CONFIG.rectangle),
        samples=CONFIG.mesh_stiffness.samples,
        settings=canonical(CONFIG.rectangle.model_dump(exclude=GRID)),


use rule job as mesh_stiffness_table with:
    pathvars:
        job="mesh_stiffness_table",
    input:
        stiffness=rules.mesh_stiffness.output.dataset,
        sources=function_sources("gearlib.studies.mesh_stiffness:write_csv", script="table"),
    output:
        csv="results/mesh_stiffness.csv",
        page=table_page("mesh_stiffness", "Mesh stiffness by every method, table", DRAWN),
    params:
        script="table",
        function="gearlib.studies.mesh_stiffness:write_csv",


use rule job as rectangle_table with:
    pathvars:
        job="rectangle_table",
    input:
        costs=rules.rectangle.output.dataset,
        sources=function_sources("gearlib.studies.rectangle:write_csv", script="table"),
    output:
        csv="results/rectangle.csv",
        page=table_page("rectangle", "What the rectangular stiffness costs, table", DRAWN),
    params:
        script="table",
        function="gearlib.studies.rectangle:write_csv",
