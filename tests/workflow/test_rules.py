"""The rules, against the functions that they call and the captions of what they write."""

import inspect
from pkgutil import resolve_name

import pytest
import yaml

from gearlib.config import overlay
from gearlib.config.configuration import RESULT_FOLDERS, TARGETS
from gearlib.config.targets import TRAIN_TARGETS
from tests.unit.test_gear_names import NAME, OWN, PLANETS, relieved
from tests.workflow.declared import declared
from tests.workflow.project import project_copy


@pytest.fixture(scope="module")
def project(tmp_path_factory):
    return project_copy(tmp_path_factory.mktemp("rules") / "project")


@pytest.fixture(scope="module")
def paper(project):
    return declared(project)


def with_gears(project, mapping):
    """Return the `Declared` of other gears than the paper's."""
    (project / "mine.yaml").write_text(yaml.safe_dump(mapping), encoding="utf-8")
    return declared(project, "--configfile", "mine.yaml")


#: A ratio of damping for the planetary set.
DAMPED = {"train": {"planetary_set": {"damping_ratio": 0.03}}}
#: Inputs of which functions get nothing: they only say when a job is to run again.
NO_DATASETS = {"sources", "kernels", "larger_kernels", "train_kernels"}


def function_and_arguments(name, rule):
    """Return the function that a rule calls and the names of the arguments it gets, else None."""
    params, datasets = rule["params"], {*rule["inputs"]} - NO_DATASETS
    if "draw" in params:
        # Settings of the scenes depend on wildcards.
        settings = params.get("settings", ["courses", "periods_shown"])
        return f"gearlib.figures.{params['draw']}", {*settings, *datasets}
    if "settings" in params and "gears" in params and "function" in params:
        return params["function"], {*params["settings"], *datasets}
    if "function" in params:
        # The files of a measured set are read by their path.
        datasets -= {"measured"} if name.startswith("measured") else set()
        return params["function"], {*rule["arguments"], *datasets} - {"function"}
    return None


def test_params_and_datasets_are_arguments_of_the_function(paper):
    calls = [function_and_arguments(*item) for item in paper.rules.items()]
    for function, arguments in filter(None, calls):
        takes = inspect.signature(resolve_name(function))
        takes.bind(**dict.fromkeys(arguments | {"threads"} & {*takes.parameters}))
    assert len([*filter(None, calls)]) > 60


def test_each_job_has_its_log_and_its_benchmark(paper):
    jobs = [rule for rule in paper.rules.values() if rule["benchmark"]]
    for rule in jobs:
        for path in [*rule["log"], rule["benchmark"]]:
            assert all(f"{{{wildcard}" in path for wildcard in rule["wildcards"])
    paths = [path for rule in jobs for path in [*rule["log"], rule["benchmark"]]]
    assert len(paths) == len({*paths})


def test_each_target_has_a_rule_and_each_figure_and_table_a_caption(paper):
    assert {*TARGETS} <= {*paper.rules}
    written = 0
    for name, rule in paper.rules.items():
        if name.startswith("draw_") or name.endswith("_table"):
            assert rule["captions"], name
        for path in rule["captions"]:
            assert paper.rendered(rule, path).endswith(".") and rule["params"]["gears"]
            written += 1
    assert written >= 40


def test_names_of_projects_are_none_of_the_folders_of_results(paper):
    paths = [path.split("/") for rule in paper.rules.values() for path in rule["outputs"]]
    assert {path[1] for path in paths if len(path) > 2} <= RESULT_FOLDERS


@pytest.mark.parametrize("name", ["mesh_stiffness", "harris_map"])
def test_gears_of_the_user_reach_the_studies_of_drawings(project, paper, name):
    quality = {"pinion": {**OWN["gears"]["pinion"], "quality": 6}}
    quality["wheel"] = {"teeth": 61, "quality": 6}
    mine = with_gears(project, OWN | {"gears": OWN["gears"] | quality})
    job, drawing = (repr(mine.rules[f"{kind}_{name}"]["params"]) for kind in ("compute", "draw"))
    assert "'teeth': 23" in job and "'torque': 85.0" in job and "'teeth': 16" not in job
    assert NAME in drawing
    # Those that a section draws itself stay, and are named.
    assert "'teeth': 16" in repr(paper.rules[f"compute_{name}"]["params"])
    assert "FZG type C" in paper.rules[f"draw_{name}"]["params"]["gears"]


def test_a_train_of_the_user_reaches_its_sweep_and_its_diagram(project):
    mine = with_gears(project, overlay(PLANETS, DAMPED))
    for name in TRAIN_TARGETS:
        assert mine.rules[f"draw_{name}"]["params"]["gears"] == "planetary set z 27/36/99, m 2 mm"
        job = repr(mine.rules[f"compute_{name}"]["params"])
        assert "'teeth': 99" in job and "[24, 36, 24, 36]" not in job
    assert "planetary set" in mine.caption("campbell")


def test_captions_of_relieved_gears_say_what_is_left_out(project):
    mine = with_gears(project, relieved())
    for name in ("fig3_resonance", "run_ups", "tolerance_bands"):
        assert "jumps by 1/kappa = " in mine.caption(name) and "not a K_v" in mine.caption(name)
    assert "without tip relief" in mine.caption("mesh_stiffness")
