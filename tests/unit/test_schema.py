"""The JSON schema that editors read: from `make` and from `gearlib schema`."""

import copy
import json
import re
import subprocess
import sys

import jsonschema
import pytest
import yaml

from gearlib.config import ConfigError, load
from tests.paper import CONFIG
from tests.workflow.project import ROOT

GALLERY = yaml.safe_load((ROOT / "gallery.yaml").read_text(encoding="utf-8"))


@pytest.fixture(scope="module")
def printed():
    """The schema that the command prints, as a dict."""
    command = [sys.executable, "-m", "gearlib", "schema"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True)
    return json.loads(done.stdout)


def test_the_command_prints_a_valid_schema(printed):
    jsonschema.Draft202012Validator.check_schema(printed)
    validator = jsonschema.Draft202012Validator(printed)
    for accepted in (CONFIG, GALLERY):
        assert not [error.message for error in validator.iter_errors(accepted)]


@pytest.mark.parametrize(
    "change",
    [
        lambda settings: settings.pop("dampings"),
        lambda settings: settings.pop("gear_pair"),
        lambda settings: settings.update(damping={}),
        lambda settings: settings["gear_pair"].update(load=-1.0),
        lambda settings: settings["gear_pair"].update(backlash="wide"),
        lambda settings: settings["targets"].append("published"),
        lambda settings: settings["work_precision"]["methods"].append("numbalsoda"),
    ],
)
def test_what_is_refused_the_schema_refuses_too(printed, change):
    settings = copy.deepcopy(CONFIG)
    change(settings)
    assert not jsonschema.Draft202012Validator(printed).is_valid(settings)
    with pytest.raises(ConfigError):
        load(settings)


def test_make_writes_it_where_editors_look():
    target = re.search(r"^SCHEMA := (.*)$", (ROOT / "Makefile").read_text(encoding="utf-8"), re.M)
    for name in ("config.yaml", "gallery.yaml"):
        first = (ROOT / name).read_text(encoding="utf-8").splitlines()[0]
        assert first == f"# yaml-language-server: $schema={target[1]}"
