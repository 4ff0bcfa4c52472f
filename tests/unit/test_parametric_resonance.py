"""Parametric resonance: the chart, the table on a tuning, and what is drawn of them."""

import numpy as np
import pytest

from gearlib import GearPair, sweep
from gearlib.analysis.tongues import meissner
from gearlib.data.storage import read, write
from gearlib.figures import parametric_resonance_figure as picture
from gearlib.studies import stability
from tests.paper import PARAMETERS
from tests.references import map_of_contact
from tests.tables import read_back

PAIRS = {"k1": PARAMETERS | {"material_damping": 3953.7}, "conservative": PARAMETERS}
RUN = {"periods": 120, "initial_state": [0.0, 0.0]}
SETTINGS = {"damping_ratios": [0.0, 0.03], "least_stiffness_ratio": 0.3, "values": 9}


@pytest.fixture(scope="module")
def facts():
    return stability.contact_loss(PAIRS, 0.66, 0.6, 1.1, RUN)


def test_the_singular_region_is_a_tongue(facts):
    free, damped = facts.sel(damping="conservative"), facts.sel(damping="k1")
    assert free.cause == stability.PARAMETRIC and damped.cause == stability.NONE
    assert free.nearest_order == 3 and free.tuning_from.sel(order=3) < 0.66
    assert 0.66 < free.tuning_to.sel(order=3) < free.loss_to < 0.68
    # From the first to the last tuning from rest, and no further than a step of the scan.
    ends = [float(free.loss_from), float(free.loss_to)]
    beside = [ends[0] - 0.1 * (ends[1] - ends[0]), ends[1] + 0.1 * (ends[1] - ends[0])]
    for tunings, lost in ((ends, True), (beside, False)):
        run = sweep(GearPair(**PARAMETERS), tunings, record_periods=RUN["periods"], **RUN)
        assert ((run.displacement_min < -1e-9) == lost).all()
    # Contact is lost although the orbit without loss keeps it.
    assert free.growth > 0.0 and free.orbit_min > 0.2 and free.lost
    assert not damped.lost and damped.damping_ratio > facts.closing_damping.sel(order=3)
    assert stability.orbit_min(GearPair(**PARAMETERS), 0.8) < 0.0 < free.forced_from < 0.8


def test_an_orbit_that_touches_the_flank_does_not_leave_it(facts):
    touch = float(facts.forced_from.sel(damping="conservative"))
    pair = GearPair(**PARAMETERS)
    assert abs(stability.orbit_min(pair, touch)) < 1e-10
    for tuning, cause in ((touch, stability.NONE), (touch + 1e-5, stability.FORCED)):
        found = stability.contact_loss({"conservative": PARAMETERS}, tuning, 0.6, 1.1, RUN)
        assert found.cause == cause


@pytest.mark.parametrize(
    ("tuning", "causes"),
    [
        (0.66, ["none", "parametric instability"]),
        (0.64, ["none", "none"]),
        (0.82, ["forced response", "forced response"]),
    ],
)
def test_what_happens_at_a_tuning_stands_in_a_table(facts, tmp_path, tuning, causes):
    if tuning != 0.66:
        facts = stability.contact_loss(PAIRS, tuning, 0.6, 1.1, RUN)
    damped, free = read_back(stability.rows(facts), tmp_path)
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
    assert float(free["growth_percent"]) == pytest.approx(growth_percent(pair, tuning), abs=1e-7)
    assert (free["lost"] == "yes") == (tuning != 0.64)
    # The scan from 0.82 on ends before contact comes back.
    assert (free["loss_from"] != "") == (tuning != 0.64) and (free["loss_to"] != "") == (
        tuning == 0.66
    )


def growth_percent(pair, tuning):
    """Return by how much undamped deviations grow per mesh period."""
    matrix = map_of_contact(pair.contact_ratio, pair.stiffness_ratio, 0, tuning)
    found = np.linalg.eigvals(np.array(matrix.tolist(), float))
    return 100.0 * (np.abs(found).max() - 1.0)


def test_damping_narrows_every_tongue_of_the_chart():
    data = stability.chart(PARAMETERS, np.linspace(0.6, 2.4, 19), SETTINGS)
    width = data.tuning_to - data.tuning_from
    # Circles of the stiffness ratio at this contact ratio, as of the closed form.
    circles = zip(data.point_value.values, data.point_tuning.values, strict=True)
    shown = [
        point
        for point, plane in zip(circles, data.point_plane, strict=True)
        if plane == "stiffness_ratio"
    ]
    pair, orders = GearPair(**PARAMETERS), data.order.values
    every = [meissner.coexistence(n, contact_ratio=pair.contact_ratio) for n in orders]
    assert shown == [tuple(point) for point in np.vstack(every) if point[0] >= 0.3] != []
    narrower = width.isel(damping=1) <= width.isel(damping=0)
    assert (narrower | np.isnan(width.isel(damping=1))).all()


def test_a_chart_without_tongues_is_drawn(facts, tmp_path):
    settings = SETTINGS | {"damping_ratios": [0.3], "least_stiffness_ratio": 0.9, "values": 2}
    write(stability.chart(PARAMETERS, [2.5, 2.6], settings), tmp_path / "chart.nc")
    assert picture.draw(read(tmp_path / "chart.nc"), facts).axes
