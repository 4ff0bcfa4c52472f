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
    schema = json.loads(CliRunner().invoke(main, ["schema"]).stdout)
    jsonschema.Draft202012Validator.check_schema(schema)
    return jsonschema.Draft202012Validator(schema)


@pytest.mark.parametrize("name", ["config.yaml", "gallery.yaml"])
def test_editors_find_the_schema_which_accepts_the_configurations_of_the_project(schema, name):
    target = re.search(r"^SCHEMA := (.*)$", (ROOT / "Makefile").read_text(encoding="utf-8"), re.M)
    text = (ROOT / name).read_text(encoding="utf-8")
    assert text.startswith(f"# yaml-language-server: $schema={target[1]}\n")
    schema.validate(yaml.safe_load(text))


@pytest.mark.parametrize(
    "change",
    [
        lambda settings: settings.pop("dampings"),
        lambda settings: settings.update(damping={}),
        lambda settings: settings["gear_pair"].update(load=-1.0),
        lambda settings: settings["targets"].append("published"),
    ],
)
def test_the_schema_refuses_what_is_missing_unknown_or_out_of_range(schema, change):
    settings = copy.deepcopy(CONFIG)
    change(settings)
    assert not schema.is_valid(settings)
