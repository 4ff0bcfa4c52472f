"""What a notebook shows, in a kernel of Jupyter: bars of long calls, which go."""

import pytest

#: A call with progress of 9 things, and another call inside; then a call shorter than the delay.
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


def test_a_progress_bar_counts_and_disappears_and_short_calls_show_none():
    nbclient, nbformat = pytest.importorskip("nbclient"), pytest.importorskip("nbformat")
    pytest.importorskip("ipykernel")
    displayed = []

    class Client(nbclient.NotebookClient):
        def process_message(self, message, cell, index):
            if message["msg_type"] in ("display_data", "update_display_data"):
                displayed.append((index, message["content"]["data"]["text/plain"]))
            return super().process_message(message, cell, index)

    book = nbformat.v4.new_notebook(cells=[nbformat.v4.new_code_cell(cell) for cell in CELLS])
    Client(book, timeout=600).execute()
    texts = [text for index, text in displayed if index == 0]
    assert [text.rpartition(",")[0] for text in texts[:3]] == [f"{i} of 9 things" for i in range(3)]
    assert texts[-1] == "" and not any("inner" in text for text in texts)
    assert not any(index == 1 for index, _ in displayed)
