"""What the rules share: the checked configuration, and names of files and parameters.

Rules see the configuration through these functions only: a job's `params` hold exactly the
values that it uses, with sorted keys, so that order and spelling of numbers in config.yaml (2 or
2.0) rerun nothing.
"""

import json
import os
import re
from importlib.util import find_spec
from pathlib import Path

from snakemake.exceptions import WorkflowError

from gearlib import config as configuration
from gearlib import integrators
from gearlib import tunings
from gearlib.config import yaml_keys
from gearlib.config.trials import PEERS
from workflow.sources import sources

ROOT = Path(workflow.basedir)

#: Fig. 2 to 8 and the table of statements.
PAPER_TARGETS = ["phase_lag", "resonance", "phase_planes", "scenes", "jump", "claims"]

#: The parts of the report, numbered because its menu is in the order of the alphabet.
PAPER, CLAIMS = "1 The paper's figures", "2 The paper's statements"
EXPLANATIONS, METHODS = "3 Explanations", "4 Methods"
TRAINS = "5 Gear trains"
DRAWN = "6 From the drawing"

#: The numbers of the reasons that the documentation gives for the verdicts.
WHY = ["results/parametric_resonance.csv", "results/certificates.csv"]

#: The keys of a grid of tunings.
GRID = {"start", "stop", "step"}
#: Those of the starts of every motion.
STARTS = {"starts", "first_starts", "seed", "spread"}

#: Priority of jobs that take long: at the end of a build none of them runs alone.
LONG = 1

#: What the report shows of a figure, the first that there is; browsers zoom pixels best.
SHOWN_FORMATS = ["png", "svg", "pdf"]

# What a first job has to compile is kept for all others, also where Python is told to keep nothing.
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)

# Scripts import the library beside this Snakefile, whatever else is installed.
os.environ.update(
    PYTHONPATH=os.pathsep.join(filter(None, [str(ROOT), os.environ.get("PYTHONPATH")]))
)

# With --replace-workflow-config that of the workflow itself is not read.
replacing = workflow.config_settings.replace_workflow_config
read = workflow.overwrite_configfiles if replacing else workflow.configfiles
repeated = [text for path in read for text in yaml_keys.read(path)[1]]
try:
    if repeated:
        raise configuration.ConfigError("\n".join(repeated))
    CONFIG = configuration.load(config)
    # Captions of the report read this, and find what the configuration leaves out as well.
    config.update(CONFIG.model_dump())
except configuration.ConfigError as error:
    raise WorkflowError(f"The configuration is refused.\n{error}") from None


wildcard_constraints:
    damping=r"[A-Za-z0-9+_-]+",
    direction="cold|up|down",
    window=r"\d+\.\d+-\d+\.\d+",
    tuning=r"\d+\.\d+",
    scene=r"[A-Za-z0-9+_-]+",
    method=r"[a-z0-9_]+",
    place="material|oil",
    power="linear|quadratic|cubic",
    trial=r"[A-Za-z0-9+_-]+",


def script_sources(name, *methods, loaded=()):
    """Return the source files on which the results of a script depend.

    It is told to run these methods, and to load these modules; of those that are always loaded a
    script says so itself, see `workflow.sources`.
    """
    methods = [f"gearlib.integrators.{integrators.METHODS.data[method]}" for method in methods]
    files = sources(ROOT / "workflow" / "scripts" / f"{name}.py", ROOT, [*methods, *loaded])
    return [os.path.relpath(path) for path in files]


def function_sources(function, *methods, script="compute"):
    """Return the source files of a function that a script calls."""
    return script_sources(script, *methods, loaded=[function.split(":")[0]])


def sources_with_method(sources, name):
    """Return the input function of a rule that runs the method in the name of its output."""
    return lambda wildcards: sources(name, wildcards.method)


def grid_of(section, step="step"):
    """Return the tunings of a section."""
    return tunings.grid(section.start, section.stop, getattr(section, step))


def figure_files(name):
    """Return the files of one figure, one for each format."""
    return expand("results/figures/{name}.{format}", name=name, format=CONFIG.figures.formats)


def figure(name, label, part):
    """Return the files of one figure, of which one is shown in the report.

    One label only: of two, where a part has two results, the report makes a switch that breaks.
    """
    shown = f".{min(CONFIG.figures.formats, key=SHOWN_FORMATS.index)}"
    in_report = dict(
        caption=f"../report/{name.strip('{}')}.rst",
        category=part,
        labels=label if callable(label) else {"figure": label},
    )
    files = figure_files(name)
    return [report(path, **in_report) if path.endswith(shown) else path for path in files]


def table_page(name, label, part):
    """Return the page of a table, for the report: browsers do not show CSV."""
    return report(
        f"results/tables/{name}.html",
        caption=f"../report/{name}_table.rst",
        category=part,
        labels={"figure": label},
    )


def label_of_scene(wildcards):
    """Return the label of a scene in the report: its name in words, its dampings."""
    words = re.sub(r"^fig(\d+)_", r"Fig. \1: ", wildcards.scene).replace("_", " ")
    dampings = dict.fromkeys(case.damping for case in CONFIG.scenes[wildcards.scene].cases)
    return {"figure": f"{words}, damping {', '.join(dampings)}"}


def resonance_shards():
    """Return the files of all windows of the resonance characteristic."""
    return [
        f"results/resonance/{damping}/{direction}/{tunings.name_of(*window)}.nc"
        for damping in CONFIG.dampings
        for direction in CONFIG.resonance.directions
        for window in CONFIG.resonance.windows(direction)
    ]


def beside_resonance():
    """Return the files of what Fig. 3 shows below its curves: those that are targets too."""
    shown = {
        "labels": {"labels": expand("results/labels/{damping}.nc", damping=CONFIG.dampings)},
        "branches": {"branches": expand("results/branches/{damping}.nc", damping=CONFIG.dampings)},
        "parametric_resonance": {"tongues": "results/tongues.nc"},
    }
    wanted = [shown[target] for target in shown if target in CONFIG.targets]
    return {name: files for data in wanted for name, files in data.items()}


def nonlinear_damping_files():
    """Return the files of all models of the study of nonlinear damping."""
    return expand(
        "results/nonlinear_damping/{place}_{power}.nc",
        place=["material", "oil"],
        power=["linear", "quadratic", "cubic"],
    )


def trial_named(name):
    """Return a trial of the configuration."""
    (trial,) = (trial for trial in CONFIG.failures.trials if trial.name == name)
    return trial


def trial_of(wildcards):
    """Return method and options of a trial."""
    trial = trial_named(wildcards.trial)
    return canonical({"method": trial.method, "options": trial.options})


def installed(method):
    """Return whether the package of a method is there; only peers need one."""
    return method not in PEERS or find_spec(PEERS[method]) is not None


def absent(methods):
    """Return the methods that are left out because their packages are not installed."""
    return canonical([name for name in methods if not installed(name)])


def trial_names():
    """Return the names of the trials whose methods are installed."""
    return [trial.name for trial in CONFIG.failures.trials if installed(trial.method)]


def gradient_ways():
    """Return the ways to differentiate whose packages are installed."""
    return [way for way in CONFIG.failures.gradients if installed(way)]


def jump_by_method_files():
    """Return the files of all methods."""
    methods = CONFIG.jump_by_method.methods
    return [f"results/jump_by_method/{name}.nc" for name in methods if installed(name)]


def work_precision_files(kind):
    """Return the files of all methods: kind is errors or times."""
    methods = CONFIG.work_precision.methods
    return [f"results/work_precision/{kind}_{name}.nc" for name in methods if installed(name)]


def work_precision_settings():
    """Return what the test problems take from the configuration, without methods and repeats."""
    apart = {"methods", "problems", "repeats"}
    return canonical(CONFIG.work_precision.model_dump(exclude=apart))


def drawn(target):
    """Return the files of the figures of a target."""
    rows = [row for name, row in DRAWINGS.items() if target == (row.target or name)]
    names = [name for row in rows for name in row.figures]
    names = CONFIG.scenes if names == ["{scene}"] else names
    return [path for name in names for path in figure_files(name)]


def target_files(targets):
    """Return the files of targets of the configuration."""
    beside = {
        "labels": expand("results/labels/{damping}.nc", damping=CONFIG.dampings),
        "nonlinear_damping": ["results/nonlinear_damping.csv"],
        "models": ["results/models.csv"],
        "parametric_resonance": ["results/parametric_resonance.csv"],
        "work_precision": ["results/work_precision.csv"],
        "jump_by_method": ["results/jump_by_method.csv"],
        "reducer": ["results/reducer.csv"],
        "one_mesh": ["results/one_mesh.csv", "results/assumption.csv"],
        "campbell": ["results/campbell.csv"],
        "mesh_stiffness": ["results/mesh_stiffness.csv"],
        "rectangle": ["results/rectangle.csv"],
        "certificates": ["results/certificates.json", "results/certificates.csv"],
        "claims": ["results/claims.csv", "results/claims.md", *WHY],
        "report_page": ["results/report/index.html"],
    }
    wanted = [name for name in targets if name != "models" or CONFIG.scenes]
    return [path for name in wanted for path in drawn(name) + beside.get(name, [])]


def phase_plane_shards():
    """Return the files of all phase planes."""
    return [
        f"results/phase_planes/{damping}/{tunings.name_of(tuning)}.nc"
        for damping in CONFIG.dampings
        for tuning in CONFIG.phase_planes.tunings
    ]


def canonical(value):
    """Return a value as it stands in `params`: Snakemake compares texts, in which order counts."""
    return json.loads(json.dumps(value, sort_keys=True))


def pair_of(wildcards):
    """Return the parameters of the gear pair with the damping of a job."""
    return canonical(CONFIG.pair_parameters(wildcards.damping))


def run_length():
    """Return the arguments that `sweep` and `simulate` share, as a dict."""
    state = CONFIG.run.initial_state
    return {
        "periods": CONFIG.periods,
        "record_periods": CONFIG.record_periods,
        "initial_state": [state.displacement, state.velocity],
    }


def cases_of(wildcards):
    """Return the cases of a scene, with the parameters of their gear pairs."""
    return canonical(
        [
            {"title": case.title, "tuning": case.tuning, "pair": CONFIG.case_parameters(case)}
            for case in CONFIG.scenes[wildcards.scene].cases
        ]
    )


def global_cases(section):
    """Return the cases of basins or Poincare sections, with the parameters of their gear pairs."""
    return canonical(
        [
            case.model_dump(exclude={"damping", "change"})
            | {"pair": CONFIG.global_parameters(case)}
            for case in section.cases
        ]
    )


def question_of(wildcards):
    """Return what the comparison of models asks of a scene."""
    scene = CONFIG.scenes[wildcards.scene]
    return canonical(
        {
            "observables": scene.observables,
            "tolerance": scene.tolerance,
            "candidates": CONFIG.candidates(scene),
        }
    )


def look_of(wildcards):
    """Return what the figure of a scene shows."""
    scene = CONFIG.scenes[wildcards.scene]
    return canonical({"courses": scene.courses, "periods_shown": scene.periods_shown})
