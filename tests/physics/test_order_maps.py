"""Order maps of run-ups: against spectra, the independent program, the balance of powers.

Order maps of signals of a rig: against the closed forms of ramps with known orders.
"""

import json
import math

import numpy as np
import pytest
import xarray as xr
from matplotlib.figure import Figure

import gearlib
from gearlib import plot
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
def test_orders_of_a_speed_ramp_match_integrals_of_the_independent_motion(name, tuning):
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
def test_blocks_at_constant_speed_match_the_spectrum(variable, name):
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


#: Orders of the signal of `ramp`, with their amplitudes.
WAVES_OF_RIG = {0: 0.5, 3: 1.0, 23: 2.0}
OPTIONS = {"variable": "acceleration", "amplitude": "peak", "highest": 40}


def ramp(first, last, seconds=6.0, rate=20_000.0, jitter=0.4):
    """Return a signal while the speed goes from `first` to `last`, and its revolutions over time.

    The samples lie at most `jitter` of a step beside equal times.
    """
    noise = np.random.default_rng(1).uniform(-jitter, jitter, int(seconds * rate))
    t = np.maximum(np.arange(noise.size) + noise, 0.0) / rate
    t[0] = 0.0

    def turns(t):
        return (first + 0.5 * (last - first) / seconds * t) * t / 60.0

    angle = math.tau * turns(t)
    x = 0.5 + np.cos(3.0 * angle + 0.2) + 2.0 * np.cos(23.0 * angle + 0.4)
    data = xr.Dataset({"acceleration": ("sample", x, {"units": "m s-2"})})
    speed = first + (last - first) / seconds * t
    return data.assign_coords(time=("sample", t), speed=("sample", speed)), turns


def assert_orders(found, tolerance=1e-4):
    """Assert that all blocks have the orders of the signal; its shortest wave has 29 samples."""
    exact = np.zeros(found.sizes["order"])
    exact[list(WAVES_OF_RIG)] = list(WAVES_OF_RIG.values())
    assert np.abs(found.amplitude.values - exact).max() < tolerance
    assert np.abs(np.exp(1j * found.phase.sel(order=[3, 23])) - np.exp([0.2j, 0.4j])).max() < 1e-3


@pytest.mark.parametrize("missing", ["rows", "time", "acceleration", "speed"])
@pytest.mark.parametrize("begin", [0.0, 2.0, 5.93])
def test_a_gap_removes_only_the_revolutions_that_it_touches(begin, missing):
    data, turns = ramp(600.0, 1800.0)
    is_gap = (data.time > begin) & (data.time < begin + 0.05)
    whole = data.drop_isel(sample=np.flatnonzero(is_gap)) if missing == "rows" else data.copy()
    if missing != "rows":
        whole[missing] = data[missing].where(~is_gap)
    found = gearlib.order_map(whole, **OPTIONS)
    assert_orders(found)
    touched = math.ceil(turns(begin + 0.05)) - math.floor(turns(begin))
    # The last whole revolution ends at 5.9996 s.
    assert found.sizes["time"] == 119 - min(touched, 119 - math.floor(turns(begin)))
    ((start, end),) = json.loads(found.attrs["left_out"])
    assert turns(start) == pytest.approx(math.floor(turns(begin)), abs=1e-3)
    assert end >= begin + 0.05 and "gap" in found.attrs["comment"]
    # The highest order by default is that of the signal without a gap.
    options = {"variable": "acceleration"}
    orders = [gearlib.order_map(d, **options).order[-1] for d in (data, whole)]
    assert orders[0] == orders[1] > 90.0


@pytest.mark.parametrize(
    ("first", "last", "blocks", "left_out"),
    [
        (1800, 600, 119, None),
        (0, 1800, 89, None),
        (1800, 0, 89, None),
        (-600, -1800, 119, None),
        # 22.5 revolutions forwards and 62.5 back: those between 22 and 22.5 are left out.
        (1140, -1900, None, "changes sign"),
    ],
)
def test_ramps_have_the_same_orders_from_standstill_and_backwards(first, last, blocks, left_out):
    data, turns = ramp(first, last)
    found = gearlib.order_map(data, **OPTIONS)
    assert_orders(found)
    speeds = first + (last - first) / 6.0 * found.time.values
    # The mean speed of a block is that in the middle of its time, apart from its first sample.
    np.testing.assert_allclose(found.rpm, speeds, atol=0.5)
    top = turns(data.time.values).max()
    expected = blocks or math.floor(top) + math.floor(top) - math.ceil(turns(data.time.values[-1]))
    assert found.sizes["time"] == expected
    assert (left_out or "") in found.attrs.get("comment", "")


@pytest.mark.parametrize("per_turn", [1, 2, 60])
@pytest.mark.parametrize("speeds", [(600.0, 1800.0), (1800.0, 600.0), (0.0, 1800.0)])
def test_single_irregular_tacho_pulses_are_repaired_and_reported(per_turn, speeds):
    data, turns = ramp(*speeds)
    grid = np.linspace(0.0, 6.0, 2_000_001)
    pulses = np.interp(np.arange(int(turns(6.0) * per_turn)), turns(grid) * per_turn, grid)
    data = data.drop_vars("speed")
    generator = np.random.default_rng(per_turn)
    tacho = {"pulses_per_revolution": per_turn}
    assert_orders(gearlib.order_map(data, tacho=pulses, **tacho, **OPTIONS), 1e-3)
    for share in (0.5, 0.02, generator.random()):
        missing, double = generator.permutation(np.arange(10, pulses.size - 10, 8))[:2]
        extra = pulses[double] + share * (pulses[double + 1] - pulses[double])
        wrong = np.sort([*np.delete(pulses, missing), extra])
        found = gearlib.order_map(data, tacho=wrong, **tacho, **OPTIONS)
        assert_orders(found, 1e-3)
        assert json.loads(found.attrs["double_pulses"]) == [extra]
        ((before, after),) = json.loads(found.attrs["missing_pulses"])
        assert before < pulses[missing] < after and "missing" in found.attrs["comment"]
    # Of three pulses in a row the message gives the time and the number.
    i = pulses.size // 2
    time = rf"tacho = {pulses[i + 3]:.6g} s \(pulse {i}\) is not allowed.* 4 pulses.* be 1"
    with pytest.raises(ValueError, match=time):
        gearlib.order_map(data, tacho=np.delete(pulses, [i, i + 1, i + 2]), **tacho, **OPTIONS)


def test_the_map_of_a_signal_stays_empty_in_a_gap():
    data, _ = ramp(600.0, 1800.0)
    data["acceleration"] = data.acceleration.where(np.abs(data.time - 3.0) > 0.2)
    figure = plot.order_map(gearlib.order_map(data, **OPTIONS), figure=Figure())
    mesh = figure.axes[0].collections[0]
    # The rows of the array are those of the blocks; their speeds are the first coordinate.
    empty = np.ma.getmaskarray(mesh.get_array()).all(axis=1)
    speeds = mesh.get_coordinates()[:-1, 0, 0][empty]
    assert empty.sum() == 2 and 1100.0 < speeds.min() < speeds.max() < 1300.0
