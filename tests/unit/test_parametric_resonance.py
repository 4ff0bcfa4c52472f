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
    damped, free = read_back(stability.rows(losses), tmp_path)
    assert [row["damping"] for row in (damped, free)] == list(PAIRS)
    assert [row["cause"] for row in (damped, free)] == causes
    assert {float(row["tuning"]) for row in (damped, free)} == {tuning}
    pair = GearPair(**PARAMETERS)
    tongue = meissner.tongue(meissner.equation_of(pair), int(free["order"]))
    assert float(free["tuning_from"]) == pytest.approx(tongue.start, abs=1e-9)
    assert float(free["tuning_to"]) == pytest.approx(tongue.stop, abs=1e-9)
    # That of the damped pair is closed: its damping ratio is above.
    assert (damped["tuning_from"] == "") == (damped["order"] == "3")
    if damped["tuning_from"] == "":
        assert float(damped["damping_ratio"]) > float(damped["closing_damping"])
    matrix = contact_map(pair.contact_ratio, pair.stiffness_ratio, 0, tuning)
    growth = np.abs(np.linalg.eigvals(np.array(matrix.tolist(), float))).max() - 1.0
    assert float(free["growth_percent"]) == pytest.approx(100.0 * growth, abs=1e-7)
    # The scan from 0.82 on ends before contact comes back.
    ends = [free[key] != "" for key in ("loss_from", "loss_to")]
    assert [free["lost"] == "yes", *ends] == [tuning != 0.64, tuning != 0.64, tuning == 0.66]
