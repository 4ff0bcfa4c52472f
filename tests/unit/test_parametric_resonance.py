"""Parametric resonance: the table on a tuning."""

import numpy as np
import pytest

from gearlib import GearPair
from gearlib.analysis.tongues import meissner
from gearlib.studies import stability
from tests.paper import PARAMETERS
from tests.references import contact_map
from tests.tables import read_back

PAIRS = {"k1": PARAMETERS | {"material_damping": 3953.7}, "conservative": PARAMETERS}
RUN = {"periods": 120, "initial_state": [0.0, 0.0]}


@pytest.mark.parametrize(
    ("tuning", "causes"),
    [
        (0.66, ["none", "parametric instability"]),
        (0.64, ["none", "none"]),
        (0.82, ["forced response", "forced response"]),
    ],
)
def test_the_table_has_cause_tongue_and_growth(tmp_path, tuning, causes):
    losses = stability.contact_loss(PAIRS, tuning, 0.6, 1.1, RUN)
    rows = damped, free = read_back(stability.rows(losses), tmp_path)
    assert [row["damping"] for row in rows] == ["k1", "conservative"]
    assert [row["cause"] for row in rows] == causes
    assert [float(row["tuning"]) for row in rows] == [tuning, tuning]
    pair = GearPair(**PARAMETERS)
    tongue = meissner.tongue(meissner.equation_of(pair), int(free["order"]))
    assert float(free["tuning_from"]) == pytest.approx(tongue.start, abs=1e-9)
    assert float(free["tuning_to"]) == pytest.approx(tongue.stop, abs=1e-9)
    # Damping closes the tongue of order 3 alone, which then has no edges.
    is_closed = damped["order"] == "3"
    assert (damped["tuning_from"] == "") == is_closed
    assert not is_closed or float(damped["damping_ratio"]) > float(damped["closing_damping"])
    matrix = contact_map(pair.contact_ratio, pair.stiffness_ratio, damping=0, tuning=tuning)
    growth = np.abs(np.linalg.eigvals(np.array(matrix.tolist(), float))).max() - 1.0
    assert float(free["growth_percent"]) == pytest.approx(100.0 * growth, abs=1e-7)
    # The undamped motion from rest loses contact at 0.66 and at 0.82; from 0.82 on the scan ends
    # before contact lasts again.
    assert (free["lost"] == "yes") == (free["loss_from"] != "") == (tuning != 0.64)
    assert (free["loss_to"] != "") == (tuning == 0.66)
