"""Compute a gearbox in a REXS file: each stage, and the whole box, in each load case."""

# STAGES has (stage, load case) of each job for a stage, BOXES the load cases of the whole box.
BOX = config["gearbox"] if "gearbox" in WANTED else None
STAGES, BOXES = list_gearbox_jobs()
NAME_OF_BOX = "{file}, damping ratio {damping_ratio:g}".format(**BOX) if BOX else "gearbox"


use rule _compute as compute_gearbox_stage with:
    pathvars:
        job="gearbox_stage_{number}",
    input:
        kernels=KERNELS,
        file=BOX["file"] if BOX else [],
        sources=sources_of("compute", "studies.gearboxes"),
    output:
        "results/gearbox/stage_{number}.nc",
    params:
        **select_keys(BOX or {}, "damping_ratio", "points"),
        function="gearlib.studies.gearboxes:sweep_stage",
        file=lambda w, input: input.file,
        stage=lambda w: STAGES[int(w.number)][0],
        load_case=lambda w: STAGES[int(w.number)][1],


use rule _table as gearbox_table with:
    pathvars:
        job="gearbox_table",
    input:
        stages=[f"results/gearbox/stage_{i}.nc" for i in range(len(STAGES))],
        file=BOX["file"] if BOX else [],
        sources=sources_of("table", "studies.gearboxes"),
    output:
        **table_files("gearbox_stages", "Stages of the gearbox, table", GEARBOX),
    params:
        function="gearlib.studies.gearboxes:stage_rows",
        settings={"file": BOX and BOX["file"]},
        gears=NAME_OF_BOX,


use rule _draw as draw_gearbox_stages with:
    pathvars:
        job="draw_gearbox_stages",
    input:
        stages=rules.gearbox_table.input.stages,
        sources=sources_of("draw", "figures.gearbox_figure"),
    output:
        figure_files("gearbox_stages", "Stages of the gearbox over the speed", GEARBOX),
    params:
        draw="gearbox_figure.draw_stages",
        gears=NAME_OF_BOX,


use rule _compute as compute_gearbox_outline with:
    pathvars:
        job="gearbox_outline",
    input:
        file=BOX["file"] if BOX else [],
        sources=sources_of("compute", "studies.gearboxes"),
    output:
        "results/gearbox/outline.nc",
    params:
        function="gearlib.studies.gearboxes:gearbox_outline",
        file=lambda w, input: input.file,


use rule _draw as draw_gearbox with:
    pathvars:
        job="draw_gearbox",
    input:
        outline="results/gearbox/outline.nc",
        sources=sources_of("draw", "figures.gearbox_figure"),
    output:
        figure_files("gearbox", "The gearbox from the side", GEARBOX),
    params:
        draw="gearbox_figure.draw_view",
        gears=NAME_OF_BOX,


use rule _compute as compute_gearbox with:
    pathvars:
        job="gearbox_{number}",
    input:
        file=BOX["file"] if BOX else [],
        sources=sources_of("compute", "studies.gearboxes"),
    output:
        "results/gearbox/box_{number}.nc",
    params:
        **select_keys(BOX or {}, "damping_ratio", "orders"),
        function="gearlib.studies.gearboxes:analyse_gearbox",
        file=lambda w, input: input.file,
        load_case=lambda w: BOXES[int(w.number)],


use rule _table as gearbox_modes_table with:
    pathvars:
        job="gearbox_modes_table",
    input:
        gearboxes=[f"results/gearbox/box_{i}.nc" for i in range(len(BOXES))],
        sources=sources_of("table", "studies.gearboxes"),
    output:
        **table_files("gearbox_modes", "Modes, load shares and frequencies, table", GEARBOX),
    params:
        function="gearlib.studies.gearboxes:gearbox_rows",
        gears=NAME_OF_BOX,


use rule _draw as draw_gearbox_modes with:
    pathvars:
        job="draw_gearbox_modes_{number}",
    input:
        box="results/gearbox/box_{number}.nc",
        sources=sources_of("draw", "figures.gearbox_figure"),
    output:
        figure_files(
            "gearbox/modes_{number}",
            gearbox_label("Campbell diagram and modes"),
            GEARBOX,
            "gearbox_modes",
        ),
    params:
        draw="gearbox_figure.draw_modes",
        gears=NAME_OF_BOX,


use rule _compute as compute_gearbox_run_up with:
    pathvars:
        job="gearbox/run_up_{number}",
    input:
        matrix_kernels=MATRIX_KERNELS,
        file=BOX["file"] if BOX else [],
        sources=sources_of("compute", "studies.gearboxes"),
    output:
        "results/gearbox/run_up_{number}.nc",
    params:
        **select_keys(BOX or {}, "damping_ratio", "revolutions"),
        function="gearlib.studies.gearboxes:compute_run_up_orders",
        file=lambda w, input: input.file,
        load_case=lambda w: BOXES[int(w.number)],


use rule _draw as draw_gearbox_run_up with:
    pathvars:
        job="draw_gearbox_run_up_{number}",
    input:
        spectrogram="results/gearbox/run_up_{number}.nc",
        frequencies="results/gearbox/box_{number}.nc",
        sources=sources_of("draw", "figures.gearbox_figure"),
    output:
        figure_files(
            "gearbox/run_up_{number}",
            gearbox_label("Order map of a run-up"),
            GEARBOX,
            "gearbox_run_up",
        ),
    params:
        draw="gearbox_figure.draw_run_up",
        gears=NAME_OF_BOX,


GEARBOX_FILES = [rules.gearbox_table.output.csv, rules.draw_gearbox.output] if BOX else []
if STAGES:
    GEARBOX_FILES.append(rules.draw_gearbox_stages.output)
if BOXES:
    numbers = range(len(BOXES))
    GEARBOX_FILES.append(rules.gearbox_modes_table.output.csv)
    GEARBOX_FILES.append(expand(rules.draw_gearbox_modes.output, number=numbers))
    GEARBOX_FILES.append(expand(rules.draw_gearbox_run_up.output, number=numbers))
