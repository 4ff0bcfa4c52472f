"""The JSON schema that editors read: in the wheel, from `make` and from `gearlib schema`."""

import copy
import json
import re
import subprocess
import sys
import zipfile

import jsonschema
import pytest
import yaml

from gearlib.config import ConfigError, load
from tests.paper import CONFIG
from tests.workflow.project import ROOT

GALLERY = yaml.safe_load((ROOT / "gallery.yaml").read_text(encoding="utf-8"))


@pytest.fixture(scope="module")
def built(tmp_path_factory):
    """The schema in a wheel that is built here, as a dict."""
    folder = tmp_path_factory.mktemp("wheel")
    words = ["-m", "hatchling", "build", "--target", "wheel", "--directory", folder]
    done = subprocess.run([sys.executable, *words], cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    (path,) = folder.glob("*.whl")
    with zipfile.ZipFile(path) as wheel:
        return json.loads(wheel.read("gearlib/config/config.schema.json"))


def test_the_wheel_holds_a_valid_schema(built):
    jsonschema.Draft202012Validator.check_schema(built)
    validator = jsonschema.Draft202012Validator(built)
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
def test_what_is_refused_the_schema_refuses_too(built, change):
    settings = copy.deepcopy(CONFIG)
    change(settings)
    assert not jsonschema.Draft202012Validator(built).is_valid(settings)
    with pytest.raises(ConfigError):
        load(settings)


def test_make_writes_it_where_editors_look(built):
    target = re.search(r"^SCHEMA := (.*)$", (ROOT / "Makefile").read_text(encoding="utf-8"), re.M)
    for name in ("config.yaml", "gallery.yaml"):
        first = (ROOT / name).read_text(encoding="utf-8").splitlines()[0]
        assert first == f"# yaml-language-server: $schema={target[1]}"
    command = [sys.executable, "-m", "gearlib", "schema"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True)
    assert json.loads(done.stdout) == built
