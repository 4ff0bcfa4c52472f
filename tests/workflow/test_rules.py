"""Rules and captions for the paper's gears and for gears of a user."""

import pytest
import yaml

from gearlib.config import overlay
from gearlib.config.configuration import TARGETS
from gearlib.config.targets import TRAIN_TARGETS
from gearlib.models.from_values import build_models
from gearlib.studies import gear_table
from tests.unit.test_gear_names import (
    GEOMETRY_CONFIG,
    PAIR_NAME,
    PLANETARY_SET_CONFIG,
    config_with_tip_relief,
)
from tests.workflow.declared import read_declared_rules
from tests.workflow.project import project_copy


@pytest.fixture(scope="module")
def project(tmp_path_factory):
    """Return a copy of the project without results."""
    return project_copy(tmp_path_factory.mktemp("rules") / "project")


@pytest.fixture(scope="module")
def paper(project):
    """Return the rules for the paper's gear pair, the default configuration."""
    return read_declared_rules(project)


def rules_of(project, configuration):
    """Return the rules of the project for a user's configuration."""
    (project / "mine.yaml").write_text(yaml.safe_dump(configuration), encoding="utf-8")
    return read_declared_rules(project, "--configfile", "mine.yaml")


def test_each_target_has_a_rule_and_each_figure_and_table_a_caption(paper):
    """The report needs a caption for each figure and table, which must render without errors."""
    assert {*TARGETS} <= {*paper.rules}
    caption_count = 0
    for name, rule in paper.rules.items():
        if name.startswith("draw_") or name.endswith("_table"):
            assert rule["captions"], name
        for path in rule["captions"]:
            assert paper.render_caption(rule, path).endswith(".") and rule["params"]["gears"]
            caption_count += 1
    # The paper's configuration has more than 40 figures and tables.
    assert caption_count >= 40


def test_gears_of_the_user_reach_the_studies_of_gear_geometry(project, paper):
    """Studies of gear geometry must compute and name the user's gears, not the default ones."""
    quality = {"pinion": {**GEOMETRY_CONFIG["gears"]["pinion"], "quality": 6}}
    quality["wheel"] = {"teeth": 61, "quality": 6}
    user_rules = rules_of(project, GEOMETRY_CONFIG | {"gears": GEOMETRY_CONFIG["gears"] | quality})
    for name in ("mesh_stiffness", "harris_map", "dynamic_factor"):
        computation = repr(user_rules.rules[f"compute_{name}"]["params"])
        assert "'teeth': 23" in computation and "'torque': 85.0" in computation
        assert "'teeth': 16" not in computation
        assert PAIR_NAME in repr(user_rules.rules[f"draw_{name}"]["params"])
        # The default configuration uses FZG gears of type C in these studies.
        assert "'teeth': 16" in repr(paper.rules[f"compute_{name}"]["params"])
        assert "FZG type C" in paper.rules[f"draw_{name}"]["params"]["gears"]


def test_the_report_on_user_gears_has_their_table_and_no_paper_figures(project):
    """For other gears than the paper's its figures would be misleading."""
    user_rules = rules_of(project, GEOMETRY_CONFIG)
    table = user_rules.rules["gears_table"]
    rows = [row[:3] for row in gear_table.table_rows(**build_models(table["params"]["settings"]))]
    assert ["teeth", "wheel", "61"] in rows and ["damping_ratio", "light", "0.03"] in rows
    assert "stiffness" in user_rules.caption("gears_table")
    report_parts = {part for rule in user_rules.rules.values() for part in rule["parts"]}
    assert not any("paper's figures" in part for part in report_parts)


def test_a_train_of_the_user_reaches_its_sweep_and_its_diagram(project):
    """Studies of trains must compute and name the user's train instead of the default reducer."""
    damping = {"train": {"planetary_set": {"damping_ratio": 0.03}}}
    user_rules = rules_of(project, overlay(PLANETARY_SET_CONFIG, damping))
    for name in TRAIN_TARGETS:
        gears_text = user_rules.rules[f"draw_{name}"]["params"]["gears"]
        assert gears_text == "planetary set z 27/36/99, m 2 mm"
        computation = repr(user_rules.rules[f"compute_{name}"]["params"])
        # The default reducer has 24, 36, 24 and 36 teeth.
        assert "'teeth': 99" in computation and "[24, 36, 24, 36]" not in computation
    assert "planetary set" in user_rules.caption("campbell")


def test_captions_of_gears_with_relief_name_the_limits_of_the_model(project):
    """Captions must say which model a figure uses and which properties of the gears it ignores."""
    pitch_errors = {"gears": {"pinion": {"pitch_errors": ["1 um"] * 23}}}
    user_rules = rules_of(project, overlay(config_with_tip_relief(), pitch_errors))
    assert "pitch errors of the gears are left out" in user_rules.caption("harris_map")
    for name in ("fig3_resonance", "run_ups"):
        assert "pairs of teeth, energy method" in user_rules.caption(name)
    caption = user_rules.caption("tolerance_bands")
    assert "jumps by 1/kappa = " in caption and "not a K_v" in caption
    assert "without tip relief" in user_rules.caption("mesh_stiffness")
