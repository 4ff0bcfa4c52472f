"""Compute gears given by geometry: mesh stiffness, Harris maps, dynamic factors, a table."""

if not IS_PAPER:

    use rule _table as gears_table with:
        pathvars:
            job="gears_table",
        input:
            sources=sources_of("table", "studies.gear_table"),
        output:
            **table_files("gears", "The gears: table", PAPER),
        params:
            function="gearlib.studies.gear_table:table_rows",
            settings={
                "pairs": PAIRS,
                "gears": to_plain_values(CONFIG.gears and CONFIG.gears.geometry_dict()),
            },
            gears=GEAR_PAIR,


use rule _compute as compute_mesh_stiffness with:
    pathvars:
        job="mesh_stiffness",
    input:
        sources=sources_of("compute", "studies.gear_geometry"),
    output:
        "results/mesh_stiffness.nc",
    params:
        function="gearlib.studies.gear_geometry:mesh_stiffness",
        pairs=stage_descriptions("mesh_stiffness"),
        samples=config["mesh_stiffness"]["samples"],


use rule _table as mesh_stiffness_table with:
    pathvars:
        job="mesh_stiffness_table",
    input:
        stiffness="results/mesh_stiffness.nc",
        sources=sources_of("table", "studies.gear_geometry"),
    output:
        **table_files("mesh_stiffness", "Mesh stiffness by every method, table", GEOMETRY),
    params:
        function="gearlib.studies.gear_geometry:stiffness_rows",
        gears=stage_names("mesh_stiffness"),


use rule _draw as draw_mesh_stiffness with:
    pathvars:
        job="draw_mesh_stiffness",
    input:
        stiffness="results/mesh_stiffness.nc",
        sources=sources_of("draw", "figures.gear_geometry_figure"),
    output:
        figure_files("mesh_stiffness", "Mesh stiffness by every method", GEOMETRY),
    params:
        draw="gear_geometry_figure.draw_mesh_stiffness",
        gears=stage_names("mesh_stiffness"),


use rule _compute as compute_harris_map with:
    pathvars:
        job="harris_map",
    input:
        sources=sources_of("compute", "studies.gear_geometry"),
    output:
        "results/harris_map.nc",
    params:
        **select_keys(config["harris_map"], "loads", "stiffness", "phases"),
        function="gearlib.studies.gear_geometry:harris_map",
        gears=exclude_keys(*stage_descriptions("harris_map").values(), "published"),


use rule _draw as draw_harris_map with:
    pathvars:
        job="draw_harris_map",
    input:
        data="results/harris_map.nc",
        sources=sources_of("draw", "figures.gear_geometry_figure"),
    output:
        figure_files("harris_map", "Tip relief: Harris maps", GEOMETRY),
    params:
        draw="gear_geometry_figure.draw_harris_maps",
        gears=stage_names("harris_map", teeth=True),


use rule _compute as compute_dynamic_factor with:
    pathvars:
        job="dynamic_factor",
    input:
        kernels=KERNELS,
        sources=sources_of("compute", "studies.teeth_over_speed"),
    output:
        "results/dynamic_factor.nc",
    params:
        **select_keys(config["dynamic_factor"], "points", "start", "stop"),
        **teeth_over_speed(),
        function="gearlib.studies.teeth_over_speed:sweep_speed_range",


use rule _draw as draw_dynamic_factor with:
    pathvars:
        job="draw_dynamic_factor",
    input:
        curves="results/dynamic_factor.nc",
        sources=sources_of("draw", "figures.gear_geometry_figure"),
    output:
        figure_files("dynamic_factor", "Dynamic factor and transmission error over speed", GEOMETRY),
    params:
        draw="gear_geometry_figure.draw_dynamic_factor",
        gears=stage_names("dynamic_factor", teeth=True),
