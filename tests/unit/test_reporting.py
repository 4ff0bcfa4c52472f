"""The report's pages: tables, and the page on which tunings are chosen."""

import os
import subprocess
import sys

import numpy as np
import pytest

from gearlib.gathering import gather_resonance
from gearlib.reporting import orbits, page, tables
from gearlib.simulation import simulate
from gearlib.sweeping import sweep
from tests.paper import PAPER

TUNINGS = [0.7, 0.8, 0.9]
RUN = {"periods": 40, "record_periods": 4}


def built():
    """Return the page of three tunings."""
    pair = PAPER.replace(material_damping=3953.7)
    ends = orbits.compute({"k1": pair.as_dict()}, TUNINGS, RUN | {"samples_per_period": 16}, 2)
    cold = sweep(pair, TUNINGS, direction="cold", **RUN)
    resonance = gather_resonance([cold.assign_coords(damping="k1", direction="cold")])
    return page.build(resonance, ends, {"k1": "#123456"})


def test_orbits_are_the_ends_of_the_runs():
    pair = PAPER.replace(material_damping=3953.7)
    found = orbits.compute({"k1": pair.as_dict()}, TUNINGS, RUN | {"samples_per_period": 16}, 2)
    run = simulate(pair, 0.9, samples_per_period=16, **RUN)
    one = found.sel(damping="k1", tuning=0.9)
    np.testing.assert_array_equal(one.displacement, np.float32(run.displacement[-32:]))
    assert one.phase[0] == 0.0
    assert float(one.displacement_max) == float(run.displacement_max)
    assert "loses contact" in str(one.motion.item())


def test_the_page_is_the_same_bytes_in_another_process():
    # Both in processes of their own, as in the workflow: what else a test run has loaded into
    # Bokeh (the models of Panel) would be part of the page. The second builds it twice, so that
    # Bokeh's numbers differ.
    code = "import hashlib; from tests.unit.test_reporting import built; {}"
    code += "print(hashlib.sha256(built().encode()).hexdigest())"
    hashes = [
        subprocess.run(
            [sys.executable, "-c", code.format(before)],
            env=os.environ | {"PYTHONHASHSEED": seed, "PYTHONPATH": os.pathsep.join(sys.path)},
            capture_output=True,
            text=True,
            check=True,
        ).stdout
        for seed, before in (("7", ""), ("8", "built(); "))
    ]
    assert hashes[0] == hashes[1]


def test_the_page_has_its_colours_and_refers_to_nothing_outside():
    text = built()
    assert "#123456" in text
    head = text.split("<script>")[0]
    assert "src=" not in head and "href=" not in head
    assert text.count("<script") == text.count("</script>") == 3


@pytest.mark.parametrize("cell", ["a, b", "x < 1 & y", "line\nbreak"])
def test_a_table_shows_what_the_csv_holds(tmp_path, cell):
    source, path = tmp_path / "some_table.csv", tmp_path / "some_table.html"
    source.write_text(f'first_column,second\n"{cell}",2\n', encoding="utf-8")
    tables.write_table_page(source, path)
    text = path.read_text(encoding="utf-8")
    escaped = cell.replace("&", "&amp;").replace("<", "&lt;")
    assert f"<td>{escaped}</td><td>2</td>" in text
    assert "<th>first column</th>" in text


def test_a_text_is_escaped(tmp_path):
    tables.write_text_page("nu < 1", tmp_path / "words.html")
    assert "<p>nu &lt; 1</p>" in (tmp_path / "words.html").read_text(encoding="utf-8")
