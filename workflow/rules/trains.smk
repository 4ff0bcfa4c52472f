"""Compute gear trains: the paper's reducer, the configured train, and Campbell diagrams."""

# All meshes of the reducer over speed: equal branches, a displaced pin, unequal backlash.

REDUCER = gear_names.reducer_name(CONFIG)


use rule _compute as compute_reducer with:
    pathvars:
        job="reducer",
    input:
        matrix_kernels=MATRIX_KERNELS,
        sources=sources_of("compute", "studies.trains"),
    output:
        "results/reducer.nc",
    params:
        function="gearlib.studies.trains:sweep_reducer",
        pair=PAIRS[config["reducer"]["damping"]],
        tunings=tuning_grid(config["reducer"]),
        settings=exclude_keys(config["reducer"], "damping", *GRID),


use rule _table as reducer_table with:
    pathvars:
        job="reducer_table",
    input:
        characteristics="results/reducer.nc",
        sources=sources_of("table", "studies.trains"),
    output:
        **table_files("reducer", "Fig. 1: the reducer, table", EXPLANATIONS),
    params:
        function="gearlib.studies.trains:reducer_rows",
        gears=REDUCER,


use rule _draw as draw_reducer with:
    pathvars:
        job="draw_reducer",
    input:
        characteristics="results/reducer.nc",
        sources=sources_of("draw", "figures.trains_figure"),
    output:
        figure_files("reducer", "Fig. 1: all meshes of the reducer over speed", EXPLANATIONS),
    params:
        draw="trains_figure.draw_reducer",
        gears=REDUCER,


# All meshes of the configured train over speed.

TRAIN = gear_names.train_name(CONFIG)
TRAIN_PARAMETERS = to_plain_values(CONFIG.model_description(CONFIG.train_sweep.damping, "train"))


use rule _compute as compute_train_sweep with:
    pathvars:
        job="train_sweep",
    input:
        matrix_kernels=MATRIX_KERNELS,
        sources=sources_of("compute", "studies.trains"),
    output:
        "results/train_sweep.nc",
    params:
        function="gearlib.studies.trains:sweep_train",
        train=TRAIN_PARAMETERS,
        tunings=tuning_grid(config["train_sweep"]),
        settings=exclude_keys(config["train_sweep"], "damping", *GRID),


use rule _draw as draw_train_sweep with:
    pathvars:
        job="draw_train_sweep",
    input:
        curves="results/train_sweep.nc",
        sources=sources_of("draw", "figures.trains_figure"),
    output:
        figure_files("train_sweep", "The train of the configuration over speed", TRAINS),
    params:
        draw="trains_figure.draw_sweep",
        gears=TRAIN,


# Natural frequencies and mesh frequencies of the configured train, else of the reducer.

HAS_OWN_TRAIN = targets.has_custom_train(CONFIG)


use rule _compute as compute_campbell with:
    pathvars:
        job="campbell",
    input:
        characteristics=f"results/{'train_sweep' if HAS_OWN_TRAIN else 'reducer'}.nc",
        sources=sources_of("compute", "studies.trains"),
    output:
        "results/campbell.nc",
    params:
        **(
            {"train": TRAIN_PARAMETERS}
            if HAS_OWN_TRAIN
            else {
                "pair": PAIRS[config["reducer"]["damping"]],
                "settings": exclude_keys(config["reducer"], "damping", *GRID, *STARTS),
            }
        ),
        function="gearlib.studies.trains:compute_campbell_diagram",
        orders=config["campbell"]["orders"],


use rule _table as campbell_table with:
    pathvars:
        job="campbell_table",
    input:
        diagram="results/campbell.nc",
        sources=sources_of("table", "studies.trains"),
    output:
        **table_files("campbell", "Campbell diagram, table", EXPLANATIONS),
    params:
        function="gearlib.studies.trains:campbell_rows",
        gears=TRAIN if HAS_OWN_TRAIN else REDUCER,


use rule _draw as draw_campbell with:
    pathvars:
        job="draw_campbell",
    input:
        diagram="results/campbell.nc",
        sources=sources_of("draw", "figures.trains_figure"),
    output:
        figure_files("campbell", "Campbell diagram", EXPLANATIONS),
    params:
        draw="trains_figure.draw_campbell",
        gears=TRAIN if HAS_OWN_TRAIN else REDUCER,
