"""What a notebook shows, in a kernel of Jupyter: bars of long calls, which go, and figures."""

import os
from contextlib import contextmanager
from dataclasses import replace

import pytest

from gearlib import basin_stability, bifurcation_diagram, lyapunov_exponents, notebook, sweep
from tests.paper import PAPER

CELLS = (
    """\
import threading
from gearlib import GearPair, notebook, plot, sweep
notebook.DELAY = notebook.STEP = 0.0
asked, enough = [], threading.Event()
def done():
    asked.append(len(asked))
    if len(asked) == 3:
        enough.set()
    return asked[-1]
with notebook.bar("things", 9, done):
    for _ in notebook.counted("inner things", range(2), 2):
        enough.wait(60)""",
    """\
ratios = dict(damping=0.1, contact_ratio=1.569, stiffness_ratio=0.5879, backlash=4)
notebook.DELAY = 1e3
found = sweep(GearPair.from_ratios(**ratios), [0.5, 0.6, 0.7], periods=99, record_periods=9)""",
    "plot.resonance(found);",
    "plot.resonance(found)",
)


def test_bars_count_and_go_and_figures_show_once():
    nbclient, nbformat = pytest.importorskip("nbclient"), pytest.importorskip("nbformat")
    pytest.importorskip("ipykernel")
    seen = []

    class Client(nbclient.NotebookClient):
        def process_message(self, message, cell, index):
            if message["msg_type"] in ("display_data", "update_display_data"):
                seen.append((index, message["content"]["data"]["text/plain"]))
            return super().process_message(message, cell, index)

    book = nbformat.v4.new_notebook(cells=[nbformat.v4.new_code_cell(cell) for cell in CELLS])
    environment = {name: text for name, text in os.environ.items() if name != "MPLBACKEND"}
    Client(book, timeout=600).execute(env=environment)
    texts = [text for index, text in seen if index == 0]
    assert [text.rpartition(",")[0] for text in texts[:3]] == [f"{i} of 9 things" for i in range(3)]
    assert texts[-1] == "" and not any("inner" in text for text in texts)
    assert not any(index == 1 for index, _ in seen)
    for cell in book.cells[2:]:
        pictures = [output for output in cell.outputs if "image/png" in output.get("data", {})]
        assert len(pictures) == 1


def test_long_calls_say_how_many_are_done(monkeypatch):
    seen = []

    @contextmanager
    def bar(words, total, done):
        seen.append((words, total, done()))
        yield
        seen.append(done())

    monkeypatch.setattr(notebook, "bar", bar)
    tunings, run = [0.6, 0.7, 0.9], {"periods": 9, "record_periods": 2}
    for direction in ("cold", "up", "down"):
        sweep(PAPER, tunings, direction=direction, **run)
    damped = replace(PAPER, material_damping=4e3, backlash_damping=4e3)
    basin_stability(damped, tunings, ((-1.0, 1.0), (-1.0, 1.0)), samples=4, periods=50)
    assert seen == [("tunings", 3, 0), 3] * 4
    del seen[:]
    lyapunov_exponents(PAPER, tunings, settle=1, periods=20)
    bifurcation_diagram(PAPER, tunings, settle=1, strobes=2)
    assert seen == [("values", 3, 0), 3] * 2
