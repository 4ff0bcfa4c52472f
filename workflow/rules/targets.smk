"""Define a rule for each target of the configuration, with its files."""

TARGET_FILES = {
    # The paper's figures and statements.
    "phase_lag": [rules.draw_phase_lag.output],
    "resonance": [rules.draw_resonance.output],
    "phase_planes": [rules.draw_phase_planes.output],
    "scenes": [expand(rules.draw_scene.output, scene=CONFIG.scenes)],
    "claims": [rules.compute_claims.output.csv, rules.compute_claims.output.markdown],
    # Explanations.
    "run_ups": [rules.draw_run_ups.output],
    "jump": [rules.draw_jump.output],
    "labels": [per_damping(rules.label.output)],
    "branches": [rules.draw_branches.output],
    "certificates": [rules.compute_certificates.output.csv, rules.compute_certificates.output.json],
    "nonlinear_damping": [
        rules.draw_nonlinear_damping.output,
        rules.nonlinear_damping_table.output.csv,
    ],
    # Without scenes there is nothing to compare.
    "models": [rules.draw_models.output, rules.model_table.output.csv] if CONFIG.scenes else [],
    "parametric_resonance": [
        rules.draw_parametric_resonance.output,
        rules.parametric_resonance_table.output.csv,
    ],
    "basins": [rules.draw_basins.output],
    "bifurcation": [rules.draw_bifurcation.output],
    "poincare": [rules.draw_poincare.output],
    # Methods.
    "analytic_method": [rules.draw_analytic_method.output],
    "stability_chart": [rules.draw_stability_chart.output],
    "failures": [rules.draw_failures.output],
    "work_precision": [rules.draw_work_precision.output, rules.work_precision_table.output.csv],
    # Gear trains.
    "reducer": [rules.draw_reducer.output, rules.reducer_table.output.csv],
    "train_sweep": [rules.draw_train_sweep.output],
    "campbell": [rules.draw_campbell.output, rules.campbell_table.output.csv],
    # Gears given by geometry.
    "mesh_stiffness": [rules.draw_mesh_stiffness.output, rules.mesh_stiffness_table.output.csv],
    "harris_map": [rules.draw_harris_map.output],
    "dynamic_factor": [rules.draw_dynamic_factor.output],
    # Measured sets and tolerances.
    "measured": [
        rules.measured_table.output.csv,
        rules.draw_measured_courses.output if MEASURED_COURSES else [],
        rules.draw_measured_orders.output if MEASURED_RUN_UPS else [],
    ],
    "gearbox": GEARBOX_FILES,
    "tolerances": [rules.draw_tolerances.output, rules.tolerance_table.output.csv],
}

for target, files in TARGET_FILES.items():

    rule:
        name:
            target
        input:
            target_files(target, *files),
