"""Every fault of the list can be planted, and the tests that it names are there; `make faults`."""

import ast
from collections import Counter

import pytest

from tests.faults.__main__ import verdict
from tests.faults.faults import ROOT, Fault, faults

FAULTS = faults()
#: At least as many in each part: what is seen, what reruns, what is proved.
ROOMS = {"drawing": 15, "workflow": 10, "proofs": 5}


@pytest.mark.parametrize("fault", FAULTS, ids=lambda fault: fault.name)
def test_a_fault_can_be_planted(fault):
    planted = fault.planted()
    if fault.file.endswith(".py"):
        ast.parse(planted)
    for test in fault.tests:
        path, _, name = test.partition("::")
        text = (ROOT / path).read_text(encoding="utf-8")
        assert not name or f"def {name.split('[')[0]}(" in text, test


def test_there_are_enough():
    counted = Counter(fault.room for fault in FAULTS)
    assert len(FAULTS) >= 60 and len({fault.name for fault in FAULTS}) == len(FAULTS)
    assert all(counted[room] >= least for room, least in ROOMS.items()), counted


def test_what_becomes_of_a_fault(tmp_path):
    (tmp_path / "sums.py").write_text("def double(x):\n    return 2 * x\n")
    (tmp_path / "test_sums.py").write_text(
        "from sums import double\n\n\ndef test_two():\n    assert double(2) == 4\n"
    )

    def planted(old, new):
        return verdict(Fault("", "", "sums.py", old, new, ("test_sums.py",)), tmp_path)[0]

    assert planted("2 * x", "3 * x") == "caught"
    assert planted("2 * x", "x ** 2") == "not caught"
    # What does not run at all proves nothing.
    assert planted("return", "retrun") == "not caught"
    assert planted("4 * x", "3 * x") == planted("x", "y") == "not plantable"
    assert "2 * x" in (tmp_path / "sums.py").read_text()
