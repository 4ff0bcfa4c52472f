"""Draw: all figures, a row for each rule, which draws all formats at once."""

from typing import NamedTuple


class Drawing(NamedTuple):
    """One rule ``draw_<name>``."""

    #: The function of gearlib.figures that draws; where there are several figures it returns them
    #: by their names.
    function: str
    #: Name of an argument -> file of its dataset, or list of files.
    data: dict
    #: Name of a figure -> what the report calls it, or a function of the wildcards.
    figures: dict
    #: Part of the report.
    part: str
    #: Its other arguments, or a function that returns them for the wildcards.
    settings: object = {}
    #: Methods that a note calls left out.
    absent: list = []
    #: Target of the configuration, where it has another name.
    target: str = ""
    #: What tells its jobs apart.
    wildcards: tuple = ()


COLOURS = canonical({"colours": CONFIG.figures.colours})
MARKED = canonical({"marked": CONFIG.jump.marked})
SCENES = [f"results/models/{name}.nc" for name in CONFIG.scenes]

DRAWINGS = {
    "phase_lag": Drawing(
        "phase_shift.draw",
        {"lags": rules.phase_lag.output.dataset},
        {"fig2_phase_shift": "Fig. 2: phase lag, material damping"},
        PAPER,
    ),
    "resonance": Drawing(
        "resonance.draw",
        {"resonance": rules.gather_resonance.output.dataset, **beside_resonance()},
        {"fig3_resonance": "Fig. 3: resonance characteristics, all dampings"},
        PAPER,
        COLOURS,
    ),
    "phase_planes": Drawing(
        "phase_planes.draw",
        {"phase_planes": rules.gather_phase_planes.output.dataset},
        {"fig5_phase_planes": "Fig. 5: phase planes, all dampings"},
        PAPER,
        COLOURS,
    ),
    "scene": Drawing(
        "time_courses.draw",
        {"scene": rules.scene.output.dataset},
        {"{scene}": label_of_scene},
        PAPER,
        look_of,
        target="scenes",
        wildcards=("{scene}",),
    ),
    "jump": Drawing(
        "jump.draw",
        {"jumps": rules.jump.output.dataset},
        {"fig6_jump": "Beside Fig. 6: what moves the jump from rest"},
        EXPLANATIONS,
        MARKED,
    ),
    "branches": Drawing(
        "branches.draw",
        {"branches": rules.loci.input.branches, "loci": rules.loci.output.dataset},
        {"branches": "Beside Fig. 3: folds and grazings, and what moves them"},
        EXPLANATIONS,
    ),
    "nonlinear_damping": Drawing(
        "nonlinear_damping.draw",
        {"studies": nonlinear_damping_files()},
        {"nonlinear_damping": "Nonlinear damping of equal work"},
        EXPLANATIONS,
    ),
    "models": Drawing(
        "models.draw",
        {"comparisons": SCENES},
        {"models": "Models: what larger ones would change"},
        EXPLANATIONS,
        canonical({"scenes": list(CONFIG.scenes)}),
    ),
    "parametric_resonance": Drawing(
        "parametric_resonance.draw",
        {"chart": rules.parametric_resonance.output.dataset, "facts": rules.tongues.output.dataset},
        {"parametric_resonance": "Parametric resonance: tongues"},
        EXPLANATIONS,
    ),
    "basins": Drawing(
        "basins.draw",
        {"data": rules.basins.output.dataset},
        {"basins": "Basins of attraction"},
        EXPLANATIONS,
    ),
    "bifurcation": Drawing(
        "bifurcation.draw",
        {
            "diagram": rules.bifurcation.output.diagram,
            "shares": rules.bifurcation.output.shares,
            "branches": rules.bifurcation_branches.output.dataset,
        },
        {"bifurcation": "Bifurcation diagram, exponents, shares of the basins"},
        EXPLANATIONS,
    ),
    "poincare": Drawing(
        "poincare.draw",
        {"data": rules.poincare.output.dataset},
        {"poincare": "Poincaré sections"},
        EXPLANATIONS,
    ),
    "analytic_method": Drawing(
        "analytic_method.draw",
        {"data": rules.analytic_method.output.dataset},
        {"analytic_method": "The paper's analytic method", "harmonic_balance": "Harmonic balance"},
        METHODS,
    ),
    "stability_chart": Drawing(
        "stability.draw",
        {"chart": rules.stability_chart.output.dataset},
        {"stability_chart": "Numerical stability of fixed steps"},
        METHODS,
    ),
    "failures": Drawing(
        "failures.draw",
        {
            "matrix": rules.gather_failures.output.dataset,
            "gradients": rules.gradients.output.dataset,
        },
        {"failures": "Failures: difficult problems against methods"},
        METHODS,
        absent=absent(
            dict.fromkeys([t.method for t in CONFIG.failures.trials] + CONFIG.failures.gradients)
        ),
    ),
    "work_precision": Drawing(
        "work_precision.draw",
        {"errors": work_precision_files("errors")},
        {
            "work_precision_evaluations": "Work and precision: evaluations",
            "work_precision_measures": "Work and precision: events, multipliers",
        },
        METHODS,
        absent=absent(CONFIG.work_precision.methods),
    ),
    "work_precision_time": Drawing(
        "work_precision.draw_time",
        {"errors": work_precision_files("errors"), "times": work_precision_files("times")},
        {"work_precision_time": "Work and precision: wall time"},
        METHODS,
        absent=absent(CONFIG.work_precision.methods),
        target="work_precision",
    ),
    "jump_by_method": Drawing(
        "jump_by_method.draw",
        {"jumps": jump_by_method_files()},
        {"jump_by_method": "Jump from rest by method"},
        METHODS,
        MARKED,
        absent(CONFIG.jump_by_method.methods),
    ),
    "reducer": Drawing(
        "reducer.draw",
        {"characteristics": rules.reducer.output.dataset},
        {"reducer": "Fig. 1: all meshes of the reducer over speed"},
        EXPLANATIONS,
    ),
    "one_mesh": Drawing(
        "one_mesh.draw",
        {"comparison": rules.one_mesh.output.dataset},
        {"one_mesh": "Fig. 1: does one mesh stand for the reducer?"},
        EXPLANATIONS,
    ),
    "campbell": Drawing(
        "campbell.draw",
        {"diagram": rules.campbell.output.dataset},
        {"campbell": "Fig. 1: Campbell diagram of the reducer"},
        EXPLANATIONS,
    ),
    "train_chart": Drawing(
        "train_chart.draw",
        {"chart": rules.train_chart.output.dataset},
        {"train_chart": "Planetary train: instability tongues"},
        TRAINS,
    ),
    "train_sweep": Drawing(
        "train_sweep.draw",
        {"curves": rules.train_sweep.output.dataset},
        {"train_sweep": "The train of the configuration over speed"},
        TRAINS,
    ),
    "dynamic_factor": Drawing(
        "dynamic_factor.draw",
        {"factors": rules.dynamic_factor.output.dataset},
        {"dynamic_factor": "Dynamic factor of drawn gears, beside ISO 6336-1"},
        DRAWN,
    ),
    "symmetry_breaking": Drawing(
        "symmetry_breaking.draw",
        {"data": rules.symmetry_breaking.output.dataset},
        {"symmetry_breaking": "Planetary train: symmetry breaking"},
        TRAINS,
        CONFIG.symmetry_breaking.model_dump(include={"periods_shown"}),
    ),
    "mesh_stiffness": Drawing(
        "mesh_stiffness.draw",
        {"stiffness": rules.mesh_stiffness.output.dataset},
        {"mesh_stiffness": "Mesh stiffness by every method"},
        DRAWN,
    ),
    "rectangle": Drawing(
        "rectangle.draw",
        {"costs": rules.rectangle.output.dataset},
        {"rectangle": "What the rectangular stiffness costs"},
        DRAWN,
    ),
    "harris_map": Drawing(
        "harris_map.draw",
        {"data": rules.harris_map.output.dataset},
        {"harris_map": "Tip relief: Harris maps"},
        DRAWN,
    ),
    "relief_dynamics": Drawing(
        "relief_dynamics.draw",
        {"data": rules.relief_dynamics.output.dataset},
        {"relief_dynamics": "Tip relief: dynamic force by two models"},
        DRAWN,
    ),
}


for name, drawing in DRAWINGS.items():
    job = os.path.join(f"draw_{name}", *drawing.wildcards)

    rule:
        name:
            f"draw_{name}"
        input:
            **drawing.data,
            sources=script_sources(
                "draw", loaded=[f"gearlib.figures.{drawing.function.split('.')[0]}"]
            ),
        output:
            [figure(file, label, drawing.part) for file, label in drawing.figures.items()],
        log:
            f"results/logs/{job}.log",
        benchmark:
            f"results/benchmarks/{job}.tsv"
        params:
            draw=drawing.function,
            settings=drawing.settings,
            absent=drawing.absent,
            dpi=CONFIG.figures.dpi,
        conda:
            "../envs/gearlib.yaml"
        script:
            "../scripts/draw.py"
