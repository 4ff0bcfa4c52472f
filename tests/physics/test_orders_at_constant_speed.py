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


def test_all_methods_have_the_same_orders():
    exact = gearlib.order_map(gearlib.simulate(PAIR, 0.9, **FAR), highest=48)
    size = float(exact.overall[0])
    for model, method in ((gearlib.OneDegreePair(pair=PAIR), "exact"), (PAIR, "taylor")):
        found = gearlib.order_map(gearlib.simulate(model, 0.9, method=method, **FAR), highest=48)
        assert np.abs(found.amplitude - exact.amplitude).max() < 1e-9 * size


def test_orders_of_whole_revolutions_are_whole_numbers():
    run = gearlib.simulate(PAIR.replace(teeth=49), 0.9, periods=150, record_periods=49)
    assert gearlib.orders(run, count=2).order.values.tolist() == list(range(99))


def test_orders_of_a_train_are_those_of_its_meshes():
    train = gearlib.planetary(planets=2, stiffness_ratio=(0.7, 0.8))
    run = gearlib.simulate(train, 0.6, periods=70, record_periods=60, samples_per_period=32)
    found = gearlib.order_map(run)
    assert found.mesh.values.tolist() == list(train.mesh_names)


def test_what_does_not_turn_has_no_orders():
    model = gearlib.DeadZoneOscillator(upper_stiffness=1.0, lower_stiffness=1.0, load=0.3)
    with pytest.raises(ValueError, match=r"or of gearlib\.simulate"):
        gearlib.order_map(gearlib.simulate(model, 1.0, periods=3))
