"""The paper's figures and statements."""

# Fig. 2: phase lag of the motion behind the stiffness.


use rule _compute as compute_phase_lag with:
    pathvars:
        job="phase_lag",
    input:
        kernels=KERNELS,
        sources=sources_of("compute", "studies.paper"),
    output:
        "results/phase_lag.nc",
    params:
        **select_keys(config["phase_lag"], "tuning", "harmonics", "periods"),
        function="gearlib.studies.paper:compute_phase_lag",
        pair=UNDAMPED,
        dampings=config["phase_lag"]["material_dampings"],
        tunings=tuning_grid(config["phase_lag"]),
        samples_per_period=config["run"]["samples_per_period"],


use rule _draw as draw_phase_lag with:
    pathvars:
        job="draw_phase_lag",
    input:
        teeth=TEETH_SWEEPS,
        lags="results/phase_lag.nc",
        sources=sources_of("draw", "figures.phase_shift_figure"),
    output:
        figure_files("fig2_phase_shift", "Fig. 2: phase lag, material damping", PAPER),
    params:
        draw="phase_shift_figure.draw",


# Fig. 3: resonance characteristics, in windows of tunings.


use rule _compute as sweep_window with:
    pathvars:
        job="resonance/{damping}/{direction}/{window}",
    input:
        kernels=KERNELS,
        sources=sources_of("compute", "studies.resonance"),
    output:
        "results/resonance/{damping}/{direction}/{window}.nc",
    params:
        **select_keys(config["resonance"], "step", "lowest"),
        function="gearlib.studies.resonance:sweep_window",
        model=lambda wildcards: MODELS[wildcards.damping],
        pair=lambda wildcards: PAIRS[wildcards.damping],
        window=lambda wildcards: tunings.parse_name(wildcards.window),
        run=GEARS_RUN,
        damping="{damping}",
        direction="{direction}",


use rule _compute as gather_resonance with:
    pathvars:
        job="gather_resonance",
    input:
        shards=[
            f"results/resonance/{damping}/{direction}/{tunings.format_name(*window)}.nc"
            for damping in CONFIG.dampings
            for direction in CONFIG.resonance.directions
            for window in CONFIG.resonance.windows(direction)
        ],
        sources=sources_of("compute", "data.gathering"),
    output:
        "results/resonance.nc",
    params:
        function="gearlib.data.gathering:gather_resonance",


use rule _draw as draw_resonance with:
    pathvars:
        job="draw_resonance",
    input:
        resonance="results/resonance.nc",
        labels=if_wanted("labels", per_damping("results/labels/{damping}.nc")),
        # The branches of gears given by geometry have the rectangular stiffness, another model than
        # the sweeps.
        branches=if_wanted(
            "branches", per_damping("results/branches/{damping}.nc"), pairs_only=True
        ),
        tongues=if_wanted("parametric_resonance", "results/tongues.nc", pairs_only=True),
        measured=expand("results/measured/{measured}.nc", measured=MEASURED_SETS),
        sources=sources_of("draw", "figures.resonance_figure"),
    output:
        figure_files("fig3_resonance", "Fig. 3: resonance characteristics, all dampings", PAPER),
    params:
        draw="resonance_figure.draw_resonance",
        gears=GEARS,
        # The paper's figure shows no forces.
        settings=COLOURS | ({} if IS_PAPER else {"forces": True}),


# Fig. 5: phase planes at several tunings.


use rule _compute as phase_plane with:
    pathvars:
        job="phase_planes/{damping}/{tuning}",
    input:
        kernels=KERNELS,
        sources=sources_of("compute", "studies.paper"),
    output:
        "results/phase_planes/{damping}/{tuning}.nc",
    params:
        function="gearlib.studies.paper:simulate_phase_portrait",
        model=lambda wildcards: to_plain_values(
            CONFIG.model_description(wildcards.damping, pitch_errors=True)
        ),
        pair=lambda wildcards: PAIRS[wildcards.damping],
        tuning=lambda wildcards: tunings.parse_name(wildcards.tuning)[0],
        run=GEARS_SAMPLED_RUN,
        damping="{damping}",


use rule _compute as gather_phase_planes with:
    pathvars:
        job="gather_phase_planes",
    input:
        shards=expand(
            "results/phase_planes/{damping}/{tuning}.nc",
            damping=CONFIG.dampings,
            tuning=[tunings.format_name(tuning) for tuning in CONFIG.phase_planes.tunings],
        ),
        sources=sources_of("compute", "data.gathering"),
    output:
        "results/phase_planes.nc",
    params:
        function="gearlib.data.gathering:gather_phase_planes",


use rule _draw as draw_phase_planes with:
    pathvars:
        job="draw_phase_planes",
    input:
        phase_planes="results/phase_planes.nc",
        sources=sources_of("draw", "figures.motions_figure"),
    output:
        figure_files("fig5_phase_planes", "Fig. 5: phase planes, all dampings", PAPER),
    params:
        draw="motions_figure.draw_phase_planes",
        gears=gear_names.gear_pair_name_with_stiffness(CONFIG, teeth=True, pitch_errors=True),
        settings=COLOURS,


# Figs. 4, 6, 7, 8: time histories of the scenes, by the smallest sufficient model.


use rule _compute as scene with:
    pathvars:
        job="scenes/{scene}",
    input:
        comparison="results/models/{scene}.nc",
        kernels=KERNELS,
        sources=sources_of("compute", "studies.scenes"),
    output:
        "results/scenes/{scene}.nc",
    params:
        function="gearlib.studies.scenes:simulate_scene_with_chosen_model",
        cases=scene_cases,
        six_degrees=SIX_DEGREES,
        run=SAMPLED_RUN,
        starts=select_keys(config["models"], *STARTS),


use rule _draw as draw_scene with:
    pathvars:
        job="draw_scene/{scene}",
    input:
        scene="results/scenes/{scene}.nc",
        sources=sources_of("draw", "figures.motions_figure"),
    output:
        figure_files("{scene}", scene_label, PAPER, caption="scene"),
    params:
        draw="motions_figure.draw_scene",
        settings=lambda wildcards: select_keys(
            config["scenes"][wildcards.scene], "courses", "periods_shown"
        ),


# Comparison of the paper's statements with the computed data.


rule compute_claims:
    input:
        resonance="results/resonance.nc",
        phase_planes="results/phase_planes.nc",
        phase_lag="results/phase_lag.nc",
        jump="results/jump.nc",
        scenes=expand(rules.scene.output, scene=CONFIG.scenes),
        sources=sources_of("claims"),
    output:
        **table_files("claims", "Statements, computed numbers, verdicts", CLAIMS),
        markdown="results/claims.md",
    params:
        gears=GEAR_PAIR,
        pair=UNDAMPED,
        dampings=config["dampings"],
    log:
        "results/logs/claims.log",
    benchmark:
        "results/benchmarks/claims.tsv"
    conda:
        "../envs/gearlib.yaml"
    script:
        "../scripts/claims.py"
