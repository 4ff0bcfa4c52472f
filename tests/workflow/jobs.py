"""How many jobs each part of the workflow has in the small configuration: the one table of them.

A new experiment is one row in `EXPERIMENTS`.
"""

from dataclasses import dataclass, field

from gearlib.config.configuration import TARGETS

DAMPINGS = 4
SCENES = 4


@dataclass(frozen=True)
class Experiment:
    """Rule -> number of jobs of one experiment."""

    #: Jobs that compute or gather, and those that draw.
    computes: dict
    draws: dict = field(default_factory=dict)
    #: Whether an edit of `simulate` reruns all of `computes`.
    simulates: bool = False
    #: What another value of damping k1 reruns, where it reruns something: `draws` and these.
    with_k1: dict = field(default_factory=dict)


EXPERIMENTS = {
    # One window for each of three directions.
    "resonance": Experiment(
        {"sweep_window": DAMPINGS * 3, "gather_resonance": 1},
        {"draw_resonance": 1},
        with_k1={"sweep_window": 3, "gather_resonance": 1},
    ),
    "labels": Experiment(
        {"label": DAMPINGS}, {"draw_resonance": 1}, simulates=True, with_k1={"label": 1}
    ),
    "parametric_resonance": Experiment(
        {"parametric_resonance": 1, "tongues": 1, "parametric_resonance_table": 1},
        {"draw_parametric_resonance": 1, "draw_resonance": 1},
        with_k1={"tongues": 1, "parametric_resonance_table": 1},
    ),
    "branches": Experiment(
        {"branches": DAMPINGS, "loci": 1},
        {"draw_branches": 1, "draw_resonance": 1},
        with_k1={"branches": 1, "loci": 1},
    ),
    "certificates": Experiment({"certificates": 1}, with_k1={"certificates": 1}),
    "phase_planes": Experiment(
        {"phase_plane": DAMPINGS, "gather_phase_planes": 1},
        {"draw_phase_planes": 1},
        simulates=True,
        with_k1={"phase_plane": 1, "gather_phase_planes": 1},
    ),
    # Two of the scenes have a case with k1.
    "models": Experiment(
        {"compare_models": SCENES, "model_table": 1},
        {"draw_models": 1},
        simulates=True,
        with_k1={"compare_models": 2, "model_table": 1},
    ),
    "scenes": Experiment(
        {"scene": SCENES},
        {"draw_scene": SCENES},
        simulates=True,
        with_k1={"scene": 2, "draw_scene": 2},
    ),
    "claims": Experiment({"claims": 1}, simulates=True, with_k1={"claims": 1}),
    "phase_lag": Experiment({"phase_lag": 1}, {"draw_phase_lag": 1}, simulates=True),
    "run_ups": Experiment({"run_ups": 1}, {"draw_run_ups": 1}, with_k1={"run_ups": 1}),
    # Two shards.
    "tolerances": Experiment(
        {
            "tolerance_shard": 2,
            "gather_tolerances": 1,
            "tolerance_indices": 1,
            "tolerance_table": 1,
        },
        {"draw_tolerances": 1},
        with_k1={
            "tolerance_shard": 2,
            "gather_tolerances": 1,
            "tolerance_indices": 1,
            "tolerance_table": 1,
        },
    ),
    "jump": Experiment({"jump": 1}, {"draw_jump": 1}, with_k1={"jump": 1}),
    "nonlinear_damping": Experiment(
        {"nonlinear_damping": 6, "nonlinear_damping_table": 1},
        {"draw_nonlinear_damping": 1},
        simulates=True,
        # Its damping is the largest of all.
        with_k1={"nonlinear_damping": 6, "nonlinear_damping_table": 1},
    ),
    "stability_chart": Experiment({"stability_chart": 1}, {"draw_stability_chart": 1}),
    "reducer": Experiment(
        {"reducer": 1, "reducer_table": 1},
        {"draw_reducer": 1},
        with_k1={"reducer": 1, "reducer_table": 1},
    ),
    "train_sweep": Experiment(
        {"train_sweep": 1}, {"draw_train_sweep": 1}, with_k1={"train_sweep": 1}
    ),
    "campbell": Experiment(
        {"campbell": 1, "campbell_table": 1},
        {"draw_campbell": 1},
        with_k1={"campbell": 1, "campbell_table": 1},
    ),
    "mesh_stiffness": Experiment(
        {"mesh_stiffness": 1, "mesh_stiffness_table": 1}, {"draw_mesh_stiffness": 1}
    ),
    "harris_map": Experiment({"harris_map": 1}, {"draw_harris_map": 1}),
    # Two methods each.
    "failures": Experiment(
        {"trial": 2, "gather_failures": 1}, {"draw_failures": 1}, simulates=True
    ),
    "work_precision": Experiment(
        {
            "work_precision_references": 1,
            "work_precision_errors": 2,
            "work_precision_times": 2,
            "work_precision_table": 1,
        },
        {"draw_work_precision": 1, "draw_work_precision_time": 1},
        simulates=True,
        # So is that of its damped problems.
        with_k1={
            "work_precision_references": 1,
            "work_precision_errors": 2,
            "work_precision_times": 2,
            "work_precision_table": 1,
        },
    ),
    "analytic_method": Experiment(
        {"analytic_method": 1},
        {"draw_analytic_method": 1},
        simulates=True,
        with_k1={"analytic_method": 1},
    ),
    "basins": Experiment({"basins": 1}, {"draw_basins": 1}),
    "bifurcation": Experiment({"bifurcation": 1}, {"draw_bifurcation": 1}),
    "bifurcation_branches": Experiment({"bifurcation_branches": 1}, {"draw_bifurcation": 1}),
    "poincare": Experiment({"poincare": 1}, {"draw_poincare": 1}),
}


def rule_of(job):
    """Return the name of the rule of a job: that of a target is the target itself."""
    return f"compute_{job}" if job in TARGETS else job


def union(tables):
    """Return tables of jobs as one; of a rule that is in several the last number counts."""
    return {rule_of(job): count for table in tables for job, count in table.items()}


def drawn(*names):
    """Return the jobs that draw the experiments of these names, without names those of all."""
    return union(EXPERIMENTS[name].draws for name in names or EXPERIMENTS)


def jobs(*names):
    """Return all jobs of the experiments of these names."""
    return union([*(EXPERIMENTS[name].computes for name in names), drawn(*names)])


def after_an_edit_of_simulate():
    """Return the jobs that an edit of `simulate` reruns."""
    return jobs(*(name for name, row in EXPERIMENTS.items() if row.simulates))


def after_another_k1():
    """Return the jobs that another value of damping k1 reruns."""
    rows = [row for row in EXPERIMENTS.values() if row.with_k1]
    return union([row.draws for row in rows] + [row.with_k1 for row in rows])


COMPILED = ("compile_kernels", "compile_larger_kernels", "compile_train_kernels")
EVERYTHING = {**dict.fromkeys(COMPILED, 1), **jobs(*EXPERIMENTS)}
