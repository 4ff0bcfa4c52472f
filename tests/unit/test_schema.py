"""The JSON schema that editors read: from `make` and from `gearlib schema`."""

import copy
import json
import re

import jsonschema
import pytest
import yaml
from click.testing import CliRunner

from gearlib.cli import main
from tests.paper import CONFIG
from tests.workflow.project import ROOT


@pytest.fixture(scope="module")
def schema():
    return json.loads(CliRunner().invoke(main, ["schema"]).stdout)


def test_the_schema_is_valid_and_accepts_the_configurations_of_the_project(schema):
    jsonschema.Draft202012Validator.check_schema(schema)
    gallery = yaml.safe_load((ROOT / "gallery.yaml").read_text(encoding="utf-8"))
    for settings in (CONFIG, gallery):
        jsonschema.Draft202012Validator(schema).validate(settings)


@pytest.mark.parametrize(
    "change",
    [
        lambda settings: settings.pop("dampings"),
        lambda settings: settings.pop("gear_pair"),
        lambda settings: settings.update(damping={}),
        lambda settings: settings["gear_pair"].update(load=-1.0),
        lambda settings: settings["targets"].append("published"),
    ],
)
def test_the_schema_refuses_what_is_missing_unknown_or_out_of_range(schema, change):
    settings = copy.deepcopy(CONFIG)
    change(settings)
    assert not jsonschema.Draft202012Validator(schema).is_valid(settings)


def test_make_writes_the_schema_where_editors_look():
    target = re.search(r"^SCHEMA := (.*)$", (ROOT / "Makefile").read_text(encoding="utf-8"), re.M)
    for name in ("config.yaml", "gallery.yaml"):
        first = (ROOT / name).read_text(encoding="utf-8").splitlines()[0]
        assert first == f"# yaml-language-server: $schema={target[1]}"
