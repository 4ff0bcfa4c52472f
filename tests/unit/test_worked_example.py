"""The worked example runs as it stands, and its text says what it computes."""

import copy
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
    assert len(printed) == 6
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
    assert names["epsilon"] == pytest.approx(1.44, abs=0.005)
    assert names["alpha_w"] * 180.0 / names["np"].pi == pytest.approx(22.44, abs=0.005)
    assert names["x_sum"] == pytest.approx(names["x"].sum(), abs=5e-5)


def test_the_mean_stiffness_is_that_of_the_page(example):
    _, names, _ = example
    single = names["c"] * names["b"] * 1e6
    assert names["pair"].mean_stiffness == pytest.approx(single * names["epsilon"], rel=1e-12)
    assert names["pair"].damping_ratio == pytest.approx(0.06, rel=1e-12)


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
    settings = yaml.safe_load((ROOT / "config.yaml").read_text(encoding="utf-8"))
    for section, values in copy.deepcopy(yaml.safe_load(block)).items():
        if isinstance(values, dict):
            assert values.keys() <= settings[section].keys()
            settings[section].update(values)
        else:
            settings[section] = values
    config = load(settings)
    assert config.targets == ["resonance", "phase_planes"]
    assert config.periods >= 300
    configured = GearPair(**config.pair_parameters("k1+k1m"))
    for name, value in names["pair"].as_dict().items():
        assert getattr(configured, name) == pytest.approx(value, rel=5e-5), name
