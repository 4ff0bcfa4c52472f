"""Captions of figures hold no numbers but those of their configuration and data."""

import re
from pathlib import Path

import pytest

from gearlib.models.model import Model
from gearlib.studies.trials import references

ROOT = Path(__file__).resolve().parents[2]
CAPTIONS = sorted((ROOT / "workflow/report").glob("*.rst"))
#: Names of figures and standards are no numbers, nor are powers, symbols with an index and options
#: of artists.
NUMBER = re.compile(r"(?<![\w.^{-])(?<!pad=)(?<!Fig\. )(?<!ISO )\d+(?:\.\d+)?(?:e-?\d+)?(?![\w}])")
#: Counts in words, from four on.
WORDS = re.compile(
    r"\b(four|five|six|seven|eight|nine|ten|eleven|twelve|dozen|hundred|tenth|fifth|quarter)\b"
)


def numbers(text):
    """Return the numbers of a text; what counts up to three (τ = 0, 2/n, 1 %) is left out."""
    return {float(number) for number in NUMBER.findall(text)} - {0.0, 1.0, 2.0, 3.0}


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
