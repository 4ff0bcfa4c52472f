"""Explain the paper's figures by jumps, orbits, proofs, tongues, basins, models, run-ups."""

# Run-ups, for comparison with Fig. 3, and their order map.


use rule _compute as compute_run_ups with:
    pathvars:
        job="run_ups",
    input:
        kernels=KERNELS,
        matrix_kernels=MATRIX_KERNELS,
        sources=sources_of("compute", "studies.run_ups"),
    output:
        "results/run_ups.nc",
    params:
        **select_keys(config["run_ups"], "start", "stop", "damping", "revolutions"),
        function="gearlib.studies.run_ups:run_ups_at_several_rates",
        model=MODELS[config["run_ups"]["damping"]],
        pair=PAIRS[config["run_ups"]["damping"]],
        mesh_orders=config["run_ups"]["orders"],


use rule _draw as draw_run_ups with:
    pathvars:
        job="draw_run_ups",
    input:
        run_ups="results/run_ups.nc",
        resonance=if_wanted("resonance", "results/resonance.nc"),
        branches=if_wanted(
            "branches", f"results/branches/{config['run_ups']['damping']}.nc", pairs_only=True
        ),
        sources=sources_of("draw", "figures.orders_figure"),
    output:
        figure_files("run_ups", "Beside Fig. 3: run-ups, and their orders", EXPLANATIONS),
    params:
        draw="orders_figure.draw_run_ups",
        gears=GEARS,


# Tuning at which the motion from rest jumps, for comparison with Fig. 6.


use rule _compute as compute_jump with:
    pathvars:
        job="jump",
    input:
        kernels=KERNELS,
        sources=sources_of("compute", "studies.jump", methods=["rk45"]),
    output:
        "results/jump.nc",
    params:
        function="gearlib.studies.jump:compute_jump_and_shifts",
        pair=PAIRS[config["jump"]["damping"]],
        settings=exclude_keys(config["jump"], "marked"),
        run=RUN,
        tunings=tuning_grid(config["jump"]),


use rule _draw as draw_jump with:
    pathvars:
        job="draw_jump",
    input:
        teeth=TEETH_SWEEPS,
        jumps="results/jump.nc",
        sources=sources_of("draw", "figures.branches_figure"),
    output:
        figure_files("fig6_jump", "Beside Fig. 6: what moves the jump from rest", EXPLANATIONS),
    params:
        draw="branches_figure.draw_jump",
        settings=select_keys(config["jump"], "marked"),


# Classification of motions as periodic, quasi-periodic or chaotic: the strip of Fig. 3.


use rule _compute as label with:
    pathvars:
        job="labels/{damping}",
    input:
        kernels=KERNELS,
        sources=sources_of("compute", "studies.paper"),
    output:
        "results/labels/{damping}.nc",
    params:
        function="gearlib.studies.paper:classify_motions",
        model=lambda wildcards: MODELS[wildcards.damping],
        pair=lambda wildcards: PAIRS[wildcards.damping],
        tunings=tuning_grid(config["labels"]),
        settings=exclude_keys(config["labels"], *GRID),
        damping="{damping}",


# Stable and unstable periodic orbits with their folds and grazings.


use rule _compute as compute_branches with:
    pathvars:
        job="branches/{damping}",
    input:
        kernels=KERNELS,
        sources=sources_of("compute", "studies.resonance"),
    output:
        "results/branches/{damping}.nc",
    params:
        function="gearlib.studies.resonance:compute_branches",
        damping="{damping}",
        pair=lambda wildcards: PAIRS[wildcards.damping],
        settings=exclude_keys(config["branches"], "loci"),


use rule _compute as loci with:
    pathvars:
        job="loci",
    input:
        branches=f"results/branches/{CONFIG.branches.loci.damping}.nc",
        sources=sources_of("compute", "studies.resonance"),
    output:
        "results/loci.nc",
    params:
        **select_keys(config["branches"], "start", "stop"),
        **select_keys(config["branches"]["loci"], "lowest", "highest"),
        function="gearlib.studies.resonance:compute_loci",
        pair=PAIRS[CONFIG.branches.loci.damping],


use rule _draw as draw_branches with:
    pathvars:
        job="draw_branches",
    input:
        teeth=TEETH_SWEEPS,
        branches=rules.loci.input.branches,
        loci="results/loci.nc",
        sources=sources_of("draw", "figures.branches_figure"),
    output:
        figure_files(
            "branches", "Beside Fig. 3: folds and grazings, and what moves them", EXPLANATIONS
        ),
    params:
        draw="branches_figure.draw_branches",


# Proofs of orbits, as a file that an independent program can check, and as a table.


rule compute_certificates:
    input:
        kernels=KERNELS,
        matrix_kernels=MATRIX_KERNELS,
        branches=per_damping(rules.compute_branches.output),
        sources=sources_of("certificates"),
    output:
        **table_files("certificates", "Proven orbits: table", EXPLANATIONS),
        json="results/certificates.json",
    params:
        gears=GEAR_PAIR,
        # Without python-flint nothing is proven, and the list in the file is empty.
        flint=find_spec("flint") is not None,
        pairs=PAIRS,
        tunings=config["phase_planes"]["tunings"],
        all_points=config["certificates"]["all_points"],
    log:
        "results/logs/certificates.log",
    benchmark:
        "results/benchmarks/certificates.tsv"
    conda:
        "../envs/gearlib.yaml"
    script:
        "../scripts/certificates.py"


# Linear, quadratic and cubic damping of equal dissipation, the subject of the paper.


use rule _compute as compute_nonlinear_damping with:
    pathvars:
        job="nonlinear_damping/{place}_{power}",
    input:
        kernels=KERNELS,
        taylor_kernels=TAYLOR_KERNELS,
        sources=sources_of("compute", "studies.nonlinear_damping"),
    output:
        "results/nonlinear_damping/{place}_{power}.nc",
    params:
        function="gearlib.studies.nonlinear_damping:compute_damping_study",
        pair=UNDAMPED,
        settings=config["nonlinear_damping"],
        run=RUN,
        samples_per_period=config["run"]["samples_per_period"],
        tunings=tuning_grid(config["nonlinear_damping"]),
        place="{place}",
        power="{power}",


PLACES_AND_POWERS = expand(
    rules.compute_nonlinear_damping.output,
    place=["material", "oil"],
    power=["linear", "quadratic", "cubic"],
)


use rule _table as nonlinear_damping_table with:
    pathvars:
        job="nonlinear_damping_table",
    input:
        studies=PLACES_AND_POWERS,
        sources=sources_of("table", "studies.nonlinear_damping"),
    output:
        **table_files("nonlinear_damping", "Nonlinear damping: table", EXPLANATIONS),
    params:
        function="gearlib.studies.nonlinear_damping:table_rows",


use rule _draw as draw_nonlinear_damping with:
    pathvars:
        job="draw_nonlinear_damping",
    input:
        teeth=TEETH_SWEEPS,
        studies=PLACES_AND_POWERS,
        sources=sources_of("draw", "figures.resonance_figure"),
    output:
        figure_files("nonlinear_damping", "Nonlinear damping of equal work", EXPLANATIONS),
    params:
        draw="resonance_figure.draw_nonlinear_damping",


# Comparison of the models for each scene.


use rule _compute as compare_models with:
    pathvars:
        job="models/{scene}",
    input:
        kernels=KERNELS,
        matrix_kernels=MATRIX_KERNELS,
        taylor_kernels=TAYLOR_KERNELS,
        sources=sources_of("compute", "studies.scenes"),
    output:
        "results/models/{scene}.nc",
    params:
        function="gearlib.studies.scenes:compare_models",
        cases=scene_cases,
        criteria=scene_criteria,
        six_degrees=SIX_DEGREES,
        harmonics=config["models"]["harmonics"],
        run=RUN,
        starts=select_keys(config["models"], *STARTS),


use rule _table as model_table with:
    pathvars:
        job="model_table",
    input:
        comparisons=expand(rules.compare_models.output, scene=CONFIG.scenes),
        sources=sources_of("table", "studies.scenes"),
    output:
        **table_files("models", "Models: table", EXPLANATIONS),
    params:
        function="gearlib.studies.scenes:table_rows",
        settings={"scenes": list(CONFIG.scenes)},


use rule _draw as draw_models with:
    pathvars:
        job="draw_models",
    input:
        teeth=TEETH_SWEEPS,
        comparisons=expand(rules.compare_models.output, scene=CONFIG.scenes),
        sources=sources_of("draw", "figures.motions_figure"),
    output:
        figure_files("models", "Models: what larger ones would change", EXPLANATIONS),
    params:
        draw="motions_figure.draw_models",
        settings={"scenes": list(CONFIG.scenes)},


# Instability tongues of the motion without contact loss.


use rule _compute as compute_parametric_resonance with:
    pathvars:
        job="parametric_resonance",
    input:
        kernels=KERNELS,
        sources=sources_of("compute", "studies.stability"),
    output:
        "results/parametric_resonance.nc",
    params:
        function="gearlib.studies.stability:compute_stability_chart",
        pair=UNDAMPED,
        settings=exclude_keys(config["parametric_resonance"], "asked", *GRID),
        tunings=tuning_grid(config["parametric_resonance"]),


use rule _compute as tongues with:
    pathvars:
        job="tongues",
    input:
        kernels=KERNELS,
        sources=sources_of("compute", "studies.stability"),
    output:
        "results/tongues.nc",
    params:
        **select_keys(config["parametric_resonance"], "start", "stop"),
        function="gearlib.studies.stability:find_contact_loss_causes",
        pairs=PAIRS,
        tuning=config["parametric_resonance"]["asked"],
        run=select_keys(RUN, "periods", "initial_state"),


use rule _table as parametric_resonance_table with:
    pathvars:
        job="parametric_resonance_table",
    input:
        tongues="results/tongues.nc",
        sources=sources_of("table", "studies.stability"),
    output:
        **table_files(
            "parametric_resonance", "Parametric resonance: the tuning in question", EXPLANATIONS
        ),
    params:
        function="gearlib.studies.stability:table_rows",


use rule _draw as draw_parametric_resonance with:
    pathvars:
        job="draw_parametric_resonance",
    input:
        teeth=TEETH_SWEEPS,
        chart="results/parametric_resonance.nc",
        contact_loss="results/tongues.nc",
        sources=sources_of("draw", "figures.parametric_resonance_figure"),
    output:
        figure_files("parametric_resonance", "Parametric resonance: tongues", EXPLANATIONS),
    params:
        draw="parametric_resonance_figure.draw",


# Global dynamics: basins of attraction, bifurcation diagram and Poincaré sections.


use rule _compute as compute_basins with:
    pathvars:
        job="basins",
    input:
        kernels=KERNELS,
        sources=sources_of("compute", "studies.global_picture"),
    output:
        "results/basins.nc",
    priority: LONG
    params:
        function="gearlib.studies.global_picture:compute_basins",
        cases=add_gear_pairs(CONFIG.basins.cases),
        settings=exclude_keys(config["basins"], "cases"),


use rule _draw as draw_basins with:
    pathvars:
        job="draw_basins",
    input:
        teeth=TEETH_SWEEPS,
        data="results/basins.nc",
        sources=sources_of("draw", "figures.global_picture_figure"),
    output:
        figure_files("basins", "Basins of attraction", EXPLANATIONS),
    params:
        draw="global_picture_figure.draw_basins",


BIFURCATION_PAIR = to_plain_values(CONFIG.pair_description(CONFIG.bifurcation.damping))


use rule _compute as compute_bifurcation with:
    pathvars:
        job="bifurcation",
    input:
        kernels=KERNELS,
        sources=sources_of("compute", "studies.global_picture"),
    output:
        diagram="results/bifurcation.nc",
        shares="results/basin_stability.nc",
    priority: LONG
    params:
        function="gearlib.studies.global_picture:compute_bifurcation",
        pair=BIFURCATION_PAIR,
        tunings=tuning_grid(config["bifurcation"]),
        coarse=tuning_grid(config["bifurcation"], "share_step"),
        settings=exclude_keys(config["bifurcation"], "damping"),


use rule _compute as bifurcation_branches with:
    pathvars:
        job="bifurcation_branches",
    input:
        kernels=KERNELS,
        sources=sources_of("compute", "studies.resonance"),
    output:
        "results/bifurcation_branches.nc",
    params:
        function="gearlib.studies.resonance:compute_branches",
        damping="of the bifurcation diagram",
        pair=BIFURCATION_PAIR,
        settings=exclude_keys(config["branches"], "loci")
        | select_keys(config["bifurcation"], "start", "stop"),


use rule _draw as draw_bifurcation with:
    pathvars:
        job="draw_bifurcation",
    input:
        teeth=TEETH_SWEEPS,
        diagram=rules.compute_bifurcation.output.diagram,
        shares=rules.compute_bifurcation.output.shares,
        branches="results/bifurcation_branches.nc",
        sources=sources_of("draw", "figures.global_picture_figure"),
    output:
        figure_files(
            "bifurcation", "Bifurcation diagram, exponents, shares of the basins", EXPLANATIONS
        ),
    params:
        draw="global_picture_figure.draw_bifurcation",


use rule _compute as compute_poincare with:
    pathvars:
        job="poincare",
    input:
        kernels=KERNELS,
        sources=sources_of("compute", "studies.global_picture"),
    output:
        "results/poincare.nc",
    params:
        function="gearlib.studies.global_picture:compute_poincare_sections",
        cases=add_gear_pairs(CONFIG.poincare.cases),
        settings=exclude_keys(config["poincare"], "cases"),


use rule _draw as draw_poincare with:
    pathvars:
        job="draw_poincare",
    input:
        teeth=TEETH_SWEEPS,
        data="results/poincare.nc",
        sources=sources_of("draw", "figures.global_picture_figure"),
    output:
        figure_files("poincare", "Poincaré sections", EXPLANATIONS),
    params:
        draw="global_picture_figure.draw_sections",
