"""Order maps of run-ups: against spectra, the independent program, the balance of powers."""

import math

import numpy as np
import pytest

import gearlib
from tests.paper import PAPER
from tests.physics.test_run_up import RUN_OUT, SIX, WAVES, reference

#: A gear of few teeth turns often.
FEW = PAPER.replace(teeth=3, material_damping=700.0, backlash_damping=300.0)


#: Pairs and trains in which all meshes turn by whole teeth in a few mesh periods.
OTHERS = {
    "pair": FEW,
    "six": SIX.replace(pair=FEW.replace(backlash=120e-6)),
    "run-out": RUN_OUT.replace(pair=FEW, teeth=(3, 5)),
    "idler": gearlib.idler(FEW),
    "waves": gearlib.OneDegreePair(pair=FEW, **WAVES),
}


def by_quadrature(model, run, speed, load, orders):
    """Return Fourier coefficients of the displacement over the first revolution, (orders, meshes).

    The displacement is that of the code of `tests.independent`, integrated by Gauss's quadrature.
    """
    code, teeth = reference(model, speed, load), float(model.periods_per_revolution)
    (_, first), (end, last) = speed[:2]
    turn = float(model.mesh_frequency(1.0)) / float(model.speed(1.0))
    rate, slope = first * turn, (last - first) * turn / end
    span = math.tau * teeth
    stop = 2.0 * span / (rate + math.sqrt(rate**2 + 2.0 * slope * span))
    bounds = [t for piece in code.pieces for t in (piece.begin, *code.cuts(piece))]
    bounds = np.array(bounds) / code.system.speed
    bounds = np.unique([*bounds, stop, *run.event_time.values])
    # Halved, since bearings may vibrate often between two bounds.
    bounds = np.unique(np.concatenate([bounds[:-1], bounds[1:], 0.5 * (bounds[1:] + bounds[:-1])]))
    bounds = bounds[bounds <= stop]
    nodes, weights = np.polynomial.legendre.leggauss(24)
    begins, lengths = bounds[:-1, None], np.diff(bounds)[:, None]
    t = (begins + 0.5 * lengths * (1.0 + nodes)).ravel()
    w = (0.5 * lengths * weights).ravel()
    displacements, _ = code.move(*np.zeros((2, model.size // 2)), t)
    phase, share = (rate + 0.5 * slope * t) * t, w * (rate + slope * t) / span
    return np.exp(-1j * np.outer(orders, phase) / teeth) @ (share[:, None] * displacements)


@pytest.mark.parametrize(("name", "tuning"), [("pair", 0.45), *((name, 0.85) for name in OTHERS)])
def test_orders_of_a_speed_ramp_are_integrals_of_the_independent_motion(name, tuning):
    model = OTHERS[name]
    rpm = float(model.speed(tuning))
    # The time of 2.2 revolutions at the first speed; with the ramp this is less than three.
    seconds = math.tau / float(model.mesh_frequency(tuning)) * 2.2 * model.periods_per_revolution
    speed, load = [(0.0, rpm), (seconds, 1.3 * rpm)], [(0.0, 1.0), (seconds / 4.0, 1.0)]
    # The load of the pair steps; in the other models it falls linearly.
    load += [(seconds / (4.0 if name == "pair" else 2.0), 0.7)]
    start = (0.0,) * max(model.size, 2)
    run = gearlib.run_up(model, speed=speed, load=load, initial_state=start, samples_per_period=256)
    result = gearlib.order_map(run, highest=15, amplitude="peak")
    orders = result.order.values
    assert result.sizes["time"] == 2 and run.event_time.size > 5
    exact = by_quadrature(model, run, speed, load, orders).reshape(result.amplitude[0].shape)
    expected = np.abs(exact)
    expected[orders > 0] *= 2.0
    assert np.abs(result.amplitude[0].values - expected).max() < 1e-6 * expected.max()
    rotation = np.exp(1j * (result.phase[0].values - np.angle(exact)))
    assert np.abs((rotation - 1.0) * expected).max() < 1e-6 * expected.max()
    assert result.amplitude_error.max() < 1e-4 * expected.max()


def assert_block_has(block, amplitudes, rpm):
    """Assert that a block of an order map has these amplitudes and this speed."""
    # What has not died out in nine revolutions is far smaller.
    assert np.abs(block.amplitude.values - amplitudes).max() < 1e-7 * amplitudes.max()
    assert float(block.rpm) == pytest.approx(rpm, rel=1e-12)


@pytest.mark.parametrize(
    ("variable", "name"), [("displacement", "error"), ("dynamic_force", "force")]
)
def test_blocks_at_constant_speed_have_the_spectrum_of_their_revolutions(variable, name):
    pair = PAPER.replace(material_damping=3953.7, backlash_damping=3953.7)
    once = gearlib.simulate(pair, 0.9, periods=240, record_periods=24, samples_per_period=256)
    rpm = float(once.speed)
    run = gearlib.run_up(pair, rpm, rpm, duration=600.02 / rpm, samples_per_period=256)
    result = gearlib.order_map(run, variable=variable, amplitude="peak")
    exact = gearlib.orders(once, count=5)[f"{name}_amplitude"].values
    assert_block_has(result.isel(time=-1), exact, rpm)
    # Three mesh periods with all phases of contact, from the first period of the record on.
    settings = {"periods": 1507, "record_periods": 48, "samples_per_period": 256}
    run = gearlib.simulate(
        PAPER.replace(material_damping=1000.0), 1.055, initial_state=(-2.0, 1.0), **settings
    )
    spectrum = gearlib.orders(run, count=4)
    orders = gearlib.order_map(run, variable=variable, amplitude="peak", resolution=0.5, highest=96)
    assert orders.order.values == pytest.approx(spectrum.order.values, rel=1e-14)
    exact = spectrum[f"{name}_amplitude"].values
    assert_block_has(orders.isel(time=0), exact, float(run.speed))
    # The spectrum counts phases from the mesh phase 0, the map from the first sample.
    begin = orders.order.values / PAPER.teeth * float(run.phase[0])
    rotation = np.exp(1j * (orders.phase[0].values - spectrum[f"{name}_phase"].values - begin))
    assert np.abs(exact * (rotation - 1.0)).max() < 1e-7 * exact.max()
    # Of each revolution there is a block; both are the same motion.
    halves = gearlib.order_map(run, orders=[24, 48], variable=variable)
    assert halves.sizes == {"time": 2, "order": 2}
    assert halves.amplitude[0].values == pytest.approx(halves.amplitude[1].values, rel=1e-9)
