"""Captions and words of figures hold no numbers but those of their configuration and data."""

import ast
import re
from pathlib import Path

import pytest

from gearlib import config
from gearlib.config.studies import STUDIES
from gearlib.config.studies.study import text_of
from gearlib.figures import work_precision_figure
from gearlib.models.model import Model
from gearlib.studies.trials import problems, references
from tests.paper import CONFIG
from tests.unit.test_defaults import GEARS

ROOT = Path(__file__).resolve().parents[2]
#: Name of a figure or table -> its caption.
CAPTIONS = {
    name: caption
    for study in STUDIES.values()
    for drawing in study.drawings
    for name, (_, caption) in drawing.figures.items()
} | {f"{table.name}_table": table.caption for s in STUDIES.values() for table in s.tables}
FIGURES = sorted((ROOT / "gearlib/figures").glob("*.py"))
#: Names of figures and standards are no numbers, nor are powers, symbols with an index and options
#: of artists.
NUMBER = re.compile(r"(?<![\w.^{-])(?<!pad=)(?<!Fig\. )(?<!ISO )\d+(?:\.\d+)?(?:e-?\d+)?(?![\w}])")
#: Counts in words, from four on.
WORDS = re.compile(
    r"\b(four|five|six|seven|eight|nine|ten|eleven|twelve|dozen|hundred|tenth|fifth|quarter)\b"
)
#: Neither the gears nor anything else of the project's configuration.
LEAST = {
    "gear_pair": GEARS,
    "dampings": {"oil": {"material_damping": 0.0, "backlash_damping": 20.0}},
}


def shifted(value):
    """Return a configuration all of whose numbers are others, such as nobody types."""
    if isinstance(value, dict):
        return {key: shifted(one) for key, one in value.items()}
    if isinstance(value, list):
        return [shifted(one) for one in value]
    return value + 7351.125 if isinstance(value, int | float) else value


def numbers(text):
    """Return the numbers of a text; what counts up to three (τ = 0, 2/n, 1 %) is left out."""
    found = {float(one) for one in NUMBER.findall(text)}
    return found - {0.0, 1.0, 2.0, 3.0}


def values(settings):
    """Return all numbers of a configuration."""
    if isinstance(settings, dict):
        settings = [*settings.values()]
    if isinstance(settings, list):
        return set().union(*map(values, settings))
    return {float(settings)} if isinstance(settings, int | float) else set()


class Shifted(dict):
    """A configuration whose sections are attributes, as those of a checked one are."""

    __getattr__ = dict.__getitem__


def sections(value):
    """Return a dumped configuration as `Shifted`."""
    if isinstance(value, dict):
        return Shifted({key: sections(one) for key, one in value.items()})
    return [sections(one) for one in value] if isinstance(value, list) else value


def defined(name):
    """Return the numbers that belong to a caption whatever is computed: what it defines."""
    return {float(references.DIGITS[1])} if name.startswith("work_precision") else set()


@pytest.mark.parametrize("name", CAPTIONS)
@pytest.mark.parametrize("given", [LEAST, CONFIG], ids=["least", "project"])
def test_every_number_of_a_caption_is_its_configuration_s(name, given):
    settings = config.load(given).model_dump()
    # Methods are looked up by their names.
    methods = settings["work_precision"]["methods"]
    settings = shifted(settings) | {"gears": None}
    settings["work_precision"]["methods"] = methods
    text = text_of(CAPTIONS[name], sections(settings))
    assert numbers(text) <= values(settings) | defined(name)
    assert not WORDS.findall(text)


def test_the_page_of_the_report_has_no_number_of_a_configuration():
    text = (ROOT / "workflow/report/workflow.rst").read_text(encoding="utf-8")
    assert numbers(text) <= numbers(Model.references.replace("-", " "))


def words_of(path):
    """Return the texts of a module, without docstrings and formats."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    skipped = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.FormattedValue) and node.format_spec is not None:
            skipped |= {id(one) for one in ast.walk(node.format_spec)}
        elif isinstance(node, ast.Expr):
            skipped |= {id(node.value)}
    texts = [node for node in ast.walk(tree) if isinstance(node, ast.Constant)]
    return [one.value for one in texts if isinstance(one.value, str) and id(one) not in skipped]


@pytest.mark.parametrize("path", FIGURES, ids=lambda path: path.stem)
def test_no_tuning_is_typed_into_the_words_of_a_figure(path):
    for text in words_of(path):
        if text in work_precision_figure.PROBLEMS.values():
            continue
        typed = {found for found in numbers(text) if found % 1}
        # Ticks and colours of the axes, not words: they stand alone.
        assert not typed or NUMBER.fullmatch(text), text
        assert "paper" not in text, text


@pytest.mark.parametrize("name", problems.CASES)
def test_titles_of_problems_say_what_they_are(name):
    title, case = work_precision_figure.PROBLEMS[name], problems.CASES[name]
    assert numbers(title) == {case.tuning}
    damped = title.startswith("damped")
    assert damped == (case.kind == "linear" and any(case.damped))
    assert ("in contact" in title) == (case.damped == (True, False))
