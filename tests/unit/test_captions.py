"""Captions and words of figures hold no numbers but those of their configuration and data."""

import ast
import re
from pathlib import Path

import pytest

from gearlib.figures import work_precision_figure
from gearlib.models.model import Model
from gearlib.studies.trials import problems, references

ROOT = Path(__file__).resolve().parents[2]
CAPTIONS = sorted((ROOT / "workflow/report").glob("*.rst"))
FIGURES = sorted((ROOT / "gearlib/figures").glob("*.py"))
#: Names of figures and standards are no numbers, nor are powers, symbols with an index and options
#: of artists.
NUMBER = re.compile(r"(?<![\w.^{-])(?<!pad=)(?<!Fig\. )(?<!ISO )\d+(?:\.\d+)?(?:e-?\d+)?(?![\w}])")
#: Counts in words, from four on.
WORDS = re.compile(
    r"\b(four|five|six|seven|eight|nine|ten|eleven|twelve|dozen|hundred|tenth|fifth|quarter)\b"
)


def numbers(text):
    """Return the numbers of a text; what counts up to three (τ = 0, 2/n, 1 %) is left out."""
    found = {float(one) for one in NUMBER.findall(text)}
    return found - {0.0, 1.0, 2.0, 3.0}


def defined(name):
    """Return the numbers that belong to a caption whatever is computed."""
    if name == "workflow":
        return numbers(Model.references.replace("-", " "))
    if name == "tolerance_bands":
        return {90.0}
    return {float(references.DIGITS[1])} if name.startswith("work_precision") else set()


@pytest.mark.parametrize("path", CAPTIONS, ids=lambda path: path.stem)
def test_every_number_of_a_caption_comes_from_the_configuration(path):
    text = re.sub(r"{{.*?}}|{%.*?%}", "", path.read_text(encoding="utf-8"), flags=re.S)
    assert numbers(text) <= defined(path.stem)
    assert not WORDS.findall(text)


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
    assert damped == (any(case.damped) and name not in ("six_degrees", "reducer"))
    assert ("in contact" in title) == (case.damped == (True, False))
