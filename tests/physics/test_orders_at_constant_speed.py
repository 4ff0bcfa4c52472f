"""Order maps of runs at constant speed: those of `gearlib.orders`, block by block."""

import numpy as np
import pytest

import gearlib
from tests.paper import PAPER

PAIR = PAPER.replace(material_damping=1000.0)
#: Three mesh periods with all phases of contact, from the first period of the record on.
FAR = {"periods": 1507, "initial_state": (-2.0, 1.0), "record_periods": 48}
FAR["samples_per_period"] = 256


@pytest.mark.parametrize("tuning", [0.66, 1.055])
def test_a_block_has_the_spectrum_of_its_revolutions(tuning):
    run = gearlib.simulate(PAIR, tuning, **FAR)
    spectrum = gearlib.orders(run, count=4)
    for variable, name in (("displacement", "error"), ("dynamic_force", "force")):
        found = gearlib.order_map(
            run, variable=variable, amplitude="peak", resolution=0.5, highest=96
        )
        assert found.order.values == pytest.approx(spectrum.order.values, rel=1e-14)
        exact = spectrum[f"{name}_amplitude"].values
        assert np.abs(found.amplitude[0].values - exact).max() < 1e-7 * exact.max()
        # The spectrum counts phases from the mesh phase 0, the map from the first sample.
        begin = found.order.values / PAIR.teeth * float(run.phase[0])
        turned = np.exp(1j * (found.phase[0].values - spectrum[f"{name}_phase"].values - begin))
        assert np.abs(exact * (turned - 1.0)).max() < 1e-7 * exact.max()
        assert float(found.rpm[0]) == pytest.approx(float(run.speed), rel=1e-12)
    # Of each revolution there is a block; both are the same motion.
    halves = gearlib.order_map(run, orders=[24, 48], variable="dynamic_force")
    assert halves.sizes == {"time": 2, "order": 2}
    assert halves.amplitude[0].values == pytest.approx(halves.amplitude[1].values, rel=1e-9)


def test_orders_of_whole_revolutions_are_whole_numbers():
    run = gearlib.simulate(PAIR.replace(teeth=49), 0.9, periods=150, record_periods=49)
    assert gearlib.orders(run, count=2).order.values.tolist() == list(range(99))
