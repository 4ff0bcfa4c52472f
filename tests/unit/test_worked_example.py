"""The worked example runs as it stands, and its text says what it computes."""

import re
from pathlib import Path

import pytest
import yaml

from gearlib import GearPair
from gearlib.config import load

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "docs" / "worked_example.md"
TEXT = PAGE.read_text(encoding="utf-8")


def blocks(language):
    return re.findall(rf"^```{language}\n(.*?)^```", TEXT, re.S | re.M)


@pytest.fixture(scope="module")
def example(tmp_path_factory):
    """Run the page in an empty folder: the folder, the names, what each block printed."""
    folder = tmp_path_factory.mktemp("worked_example")
    names, printed = {}, []
    # `print` of the page writes into a list; the page itself has no idea of that.
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        for block in blocks("python"):
            lines = []
            names["print"] = lambda text, end="\n", lines=lines: lines.append(text + end)
            exec(compile(block, PAGE.name, "exec"), names)
            printed.append("".join(lines))
    names["plt"].close(names["figure"])
    return folder, names, printed


def test_every_block_prints_what_stands_below_it(example):
    _, _, printed = example
    assert len(printed) == 4
    assert printed == blocks("text")


def test_numbers_in_the_text_are_printed_ones(example):
    _, _, printed = example
    prose = re.sub(r"^```.*?^```", "", TEXT, flags=re.S | re.M)
    quoted = re.findall(r"\*\*([^*]+)\*\*", prose)
    known = set(re.findall(r"[\d.]+\d|\d", "".join(printed)))
    assert len(quoted) > 10
    assert set(quoted) <= known


def test_the_drawing_gives_the_published_geometry(example):
    _, names, _ = example
    mesh = names["mesh"]
    assert mesh.contact_ratio == pytest.approx(1.44, abs=0.005)
    assert names["degrees"](mesh.working_pressure_angle) == pytest.approx(22.44, abs=0.005)
    # Shifts of four digits.
    assert names["nominal"].centre_distance == pytest.approx(mesh.centre_distance, abs=5e-7)


def test_the_figure_is_drawn(example):
    folder, _, _ = example
    (figure,) = folder.iterdir()
    assert figure.name == "fzg_resonance.png"
    assert figure.stat().st_size > 10_000
    (shown,) = re.findall(r"!\[[^]]*\]\(([^)]+)\)", TEXT)
    assert (PAGE.parent / shown).is_file()
    assert Path(shown).name == figure.name


def test_the_configuration_is_accepted_and_the_same_pair(example):
    _, names, _ = example
    (block,) = blocks("yaml")
    # It stands by itself.
    config = load(yaml.safe_load(block))
    assert config.targets == ["resonance", "phase_planes"]
    assert config.periods >= 300
    configured = GearPair(**config.pair_parameters("k1+k1m"))
    for name, value in names["pair"].as_dict().items():
        # The backlash has four digits in the block.
        tolerance = 1e-4 if name == "backlash" else 1e-11
        assert getattr(configured, name) == pytest.approx(value, rel=tolerance), name
