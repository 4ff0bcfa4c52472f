"""The report's pages: tables, and the page on which tunings are chosen."""

import json
import re

import numpy as np
import pytest
from bokeh.document import Document
from bokeh.models import BoxAnnotation, Plot

from gearlib.data.gathering import gather_resonance
from gearlib.data.summary import in_words
from gearlib.figures import style
from gearlib.pages.report import ends_from_rest, page, tables
from gearlib.runs.simulation import simulate
from gearlib.runs.sweeping import sweep
from tests.paper import PAPER

TUNINGS = [0.7, 0.8, 0.9]
RUN = {"periods": 40, "record_periods": 4}


def built():
    """Return the page of three tunings."""
    pair = PAPER.replace(material_damping=3953.7)
    ends = ends_from_rest.compute(
        {"k1": pair.as_dict()}, TUNINGS, RUN | {"samples_per_period": 16}, 2
    )
    cold = sweep(pair, TUNINGS, direction="cold", **RUN)
    resonance = gather_resonance([cold.assign_coords(damping="k1", direction="cold")])
    return page.build(resonance, ends, {"k1": "#123456"})


WAYS = {"from rest": "cold", "sweep up": "up", "sweep down": "down"}
PAIRS = {
    "k1": PAPER.replace(material_damping=3953.7),
    "k1m": PAPER.replace(backlash_damping=3953.7),
}


@pytest.fixture(scope="module")
def whole():
    """Two dampings around the folds: what the sweeps and runs gave, and the page's own models."""
    tunings = np.linspace(0.78, 0.84, 13)
    sweeps = {
        (name, way): sweep(pair, tunings, direction=way, **RUN)
        for name, pair in PAIRS.items()
        for way in WAYS.values()
    }
    pairs = {name: pair.as_dict() for name, pair in PAIRS.items()}
    ends = ends_from_rest.compute(pairs, tunings, RUN | {"samples_per_period": 16}, 2)
    data = [one.assign_coords(damping=d, direction=w) for (d, w), one in sweeps.items()]
    text = page.build(gather_resonance(data), ends)
    (item,) = re.findall(r'id="item">(.*?)</script>', text, re.S)
    return sweeps, ends, Document.from_json(json.loads(item)["doc"])


def _plain(given):
    """Return a colour, or the name of a column, as it is after the way through JSON or before."""
    return getattr(given, "value", getattr(given, "field", given))


def _points(renderer):
    """Return what a glyph draws, as array of x and y; without gaps."""
    data, glyph = renderer.data_source.data, renderer.glyph
    points = np.array([data[_plain(glyph.x)], data[_plain(glyph.y)]])
    return points[:, np.isfinite(points[1])]


def test_each_glyph_of_the_page_holds_what_the_legend_says(whole):
    sweeps, ends, document = whole
    up, down = sweeps["k1", "up"], sweeps["k1", "down"]
    assert np.abs(up.displacement_max - down.displacement_max).max() > 0.5
    shown = document.get_model_by_name("choose").args["shown"]
    looks = style.looks(PAIRS)
    for number, (models, name) in enumerate(zip(shown, PAIRS, strict=True)):
        assert {model.visible for model in models} == {number == 0}
        for k, (words, way) in enumerate(WAYS.items()):
            # Line and dots of the largest displacement, of the smallest, and the legend's entry.
            *renderers, entry = models[5 * k : 5 * k + 5]
            assert entry.label.value == words and entry.renderers == renderers[:1]
            swept = sweeps[name, way]
            assert renderers[0].glyph.line_dash == ([7, 4] if way == "down" else [])
            colour = "#8C8C8C" if way == "cold" else looks[name].colour
            assert {_plain(one.glyph.line_color) for one in renderers} == {colour}
            for i, extremum in enumerate(("displacement_max", "displacement_min")):
                line, dots = _points(renderers[2 * i]), _points(renderers[2 * i + 1])
                drawn = np.concatenate([line, dots], axis=1)
                drawn = drawn[:, np.argsort(drawn[0])]
                expected = np.array([swept.tuning, swept[extremum]], np.float32)
                np.testing.assert_array_equal(drawn, expected)
                # Lines are orbits that repeat.
                steady = np.float32(swept.tuning[swept.period > 0])
                assert set(line[0]) <= set(steady)


def test_what_the_page_cuts_orbits_from(whole):
    _, ends, document = whole
    slider = document.get_model_by_name("tuning")
    assert (slider.start, slider.end) == tuple(ends.tuning.values[[0, -1]])
    arguments = document.get_model_by_name("choose").args
    planes, courses, last = (arguments[name].data for name in ("planes", "courses", "ends"))
    number = 0
    for pair in PAIRS.values():
        for nu in ends.tuning.values:
            run = simulate(pair, nu, samples_per_period=16, **RUN).isel(phase=slice(-32, None))
            for key, name, end in (("x", "displacement", 0), ("y", "velocity", 1)):
                closed = np.float32(np.append(run[name], run.final_state[end]))
                np.testing.assert_array_equal(planes[key][33 * number :][:33], closed)
            for key, name in (("displacement", "displacement"), ("force", "dynamic_force")):
                np.testing.assert_array_equal(
                    courses[key][32 * number :][:32], np.float32(run[name])
                )
            assert last["high"][number] == np.float32(run.displacement_max)
            assert last["low"][number] == np.float32(run.displacement_min)
            assert arguments["motions"][last["motion"][number]] == in_words(run)
            number += 1
    assert arguments["dampings"].labels == list(PAIRS)
    assert arguments["tunings"] == list(ends.tuning.values)
    # Single precision, from the start of a mesh period, 16 samples in each.
    np.testing.assert_allclose(arguments["phase"], np.arange(32) * np.pi / 8.0, rtol=1e-6)


def test_the_plots_of_the_page_draw_what_is_chosen(whole):
    _, ends, document = whole
    arguments = document.get_model_by_name("choose").args
    plots = {
        plot.title.text if plot.title else "": plot for plot in document.select({"type": Plot})
    }
    axes = {name: [axis.axis_label for axis in plot.axis] for name, plot in plots.items()}
    assert axes["Phase plane"] == ["displacement y", "velocity dy/dτ"]
    assert axes["Dynamic force"] == ["mesh phase τ, rad", "dynamic force / load"]
    for name, source, columns in (
        ("Phase plane", "plane", ("x", "y")),
        ("Displacement", "course", ("phase", "displacement")),
        ("Dynamic force", "course", ("phase", "force")),
    ):
        (line,) = plots[name].renderers
        assert line.data_source is arguments[source]
        assert (_plain(line.glyph.x), _plain(line.glyph.y)) == columns
    # Backlash, from -backlash to contact, and beyond it inverse mesh.
    backlash = float(ends.backlash_ratio)
    for name, low, high in (("", "bottom", "top"), ("Phase plane", "left", "right")):
        near, far = (one for one in plots[name].center if isinstance(one, BoxAnnotation))
        assert (getattr(near, low), getattr(near, high)) == (-backlash, 0.0)
        assert getattr(far, high) == -backlash


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
