"""What a notebook shows, in a kernel of Jupyter: bars of long calls, which go."""

import os
from contextlib import contextmanager
from dataclasses import replace

import pytest

from gearlib import basin_stability, bifurcation_diagram, lyapunov_exponents, notebook, sweep
from tests.paper import PAPER

CELLS = (
    """\
import threading
from gearlib import GearPair, notebook, sweep
notebook.DELAY = notebook.STEP = 0.0
calls, enough = [], threading.Event()
def finished():
    calls.append(len(calls))
    if len(calls) == 3:
        enough.set()
    return calls[-1]
with notebook.bar("things", 9, finished):
    for _ in notebook.with_bar("inner things", range(2), 2):
        enough.wait(60)""",
    """\
ratios = dict(damping=0.1, contact_ratio=1.569, stiffness_ratio=0.5879, backlash=4)
notebook.DELAY = 1e3
curve = sweep(GearPair.from_ratios(**ratios), [0.5, 0.6, 0.7], periods=99, record_periods=9)""",
)


def test_a_bar_counts_and_goes_and_short_calls_show_none():
    nbclient, nbformat = pytest.importorskip("nbclient"), pytest.importorskip("nbformat")
    pytest.importorskip("ipykernel")
    displayed = []

    class Client(nbclient.NotebookClient):
        def process_message(self, message, cell, index):
            if message["msg_type"] in ("display_data", "update_display_data"):
                displayed.append((index, message["content"]["data"]["text/plain"]))
            return super().process_message(message, cell, index)

    book = nbformat.v4.new_notebook(cells=[nbformat.v4.new_code_cell(cell) for cell in CELLS])
    environment = {name: text for name, text in os.environ.items() if name != "MPLBACKEND"}
    Client(book, timeout=600).execute(env=environment)
    texts = [text for index, text in displayed if index == 0]
    assert [text.rpartition(",")[0] for text in texts[:3]] == [f"{i} of 9 things" for i in range(3)]
    assert texts[-1] == "" and not any("inner" in text for text in texts)
    assert not any(index == 1 for index, _ in displayed)


def test_long_calls_say_how_many_are_finished(monkeypatch):
    counts = []

    @contextmanager
    def bar(words, total, finished):
        counts.append((words, total, finished()))
        yield
        counts.append(finished())

    monkeypatch.setattr(notebook, "bar", bar)
    tunings, run = [0.6, 0.7, 0.9], {"periods": 9, "record_periods": 2}
    for direction in ("cold", "up", "down"):
        sweep(PAPER, tunings, direction=direction, **run)
    damped = replace(PAPER, material_damping=4e3, backlash_damping=4e3)
    basin_stability(damped, tunings, ((-1.0, 1.0), (-1.0, 1.0)), samples=4, periods=50)
    assert counts == [("tunings", 3, 0), 3] * 4
    del counts[:]
    lyapunov_exponents(PAPER, tunings, settle=1, periods=20)
    bifurcation_diagram(PAPER, tunings, settle=1, strobes=2)
    assert counts == [("values", 3, 0), 3] * 2
