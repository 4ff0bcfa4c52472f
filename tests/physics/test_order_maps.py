"""Order maps of run-ups: against spectra, the independent program, the balance of powers."""

import math

import numpy as np
import pytest

import gearlib
from gearlib.models import acceleration
from tests.paper import PAPER
from tests.physics.test_run_up import RUN_OUT, SIX, WAVES, reference

#: A gear of few teeth turns often.
FEW = PAPER.replace(teeth=3, material_damping=700.0, backlash_damping=300.0)


#: Pairs and trains in which all meshes turn by whole teeth in a few mesh periods.
OTHERS = {
    "pair": FEW,
    "six": SIX.replace(pair=FEW),
    "run-out": RUN_OUT.replace(pair=FEW, teeth=(3, 5)),
    "idler": gearlib.idler(FEW),
    "waves": gearlib.OneDegreePair(pair=FEW, **WAVES),
}


def by_quadrature(model, run, speed, load, orders):
    """Return coefficients of the first revolution, of `tests.independent` at Gauss's nodes."""
    train, teeth = model.train or model, float(model.periods_per_revolution)
    push = (
        [0.0]
        if model.size == 2
        else acceleration.train_accelerations(train) * model.static_deflection
    )
    code = reference(model, speed, load, push)
    (_, first), (end, last) = speed[:2]
    turn = float(model.mesh_frequency(1.0)) / float(model.speed(1.0))
    rate, slope = first * turn, (last - first) * turn / end
    span = math.tau * teeth
    stop = 2.0 * span / (rate + math.sqrt(rate**2 + 2.0 * slope * span))
    marks = [t for piece in code.pieces for t in (piece.begin, *code.cuts(piece))]
    marks = np.array(marks) / code.system.speed
    marks = np.unique([*marks, stop, *run.event_time.values])
    # An arc may be long for the modes of bearings.
    marks = np.unique(np.concatenate([marks[:-1], marks[1:], 0.5 * (marks[1:] + marks[:-1])]))
    marks = marks[marks <= stop]
    nodes, weights = np.polynomial.legendre.leggauss(24)
    begins, lengths = marks[:-1, None], np.diff(marks)[:, None]
    t = (begins + 0.5 * lengths * (1.0 + nodes)).ravel()
    w = (0.5 * lengths * weights).ravel()
    moved, _ = code.move(*np.zeros((2, model.size // 2)), t)
    phase, share = (rate + 0.5 * slope * t) * t, w * (rate + slope * t) / span
    return np.exp(-1j * np.outer(orders, phase) / teeth) @ (share[:, None] * moved)


@pytest.mark.parametrize(("name", "tuning"), [("pair", 0.45), *((one, 0.85) for one in OTHERS)])
def test_a_ramp_agrees_with_a_quadrature_of_the_independent_program(name, tuning):
    model = OTHERS[name]
    rpm = float(model.speed(tuning))
    seconds = math.tau / float(model.mesh_frequency(tuning)) * 2.2 * model.periods_per_revolution
    speed, load = [(0.0, rpm), (seconds, 1.3 * rpm)], [(0.0, 1.0), (seconds / 4.0, 1.0)]
    # The load of a pair steps, elsewhere it falls by and by.
    load += [(seconds / (4.0 if name == "pair" else 2.0), 0.7)]
    start = (0.0,) * max(model.size, 2)
    run = gearlib.run_up(model, speed=speed, load=load, initial_state=start, samples_per_period=256)
    found = gearlib.order_map(run, highest=15, amplitude="peak")
    orders = found.order.values
    assert found.sizes["time"] == 2 and run.event_time.size > 5
    exact = by_quadrature(model, run, speed, load, orders).reshape(found.amplitude[0].shape)
    size = np.abs(exact)
    size[orders > 0] *= 2.0
    assert np.abs(found.amplitude[0].values - size).max() < 1e-6 * size.max()
    turned = np.exp(1j * (found.phase[0].values - np.angle(exact)))
    assert np.abs((turned - 1.0) * size).max() < 1e-6 * size.max()
    assert found.amplitude_error.max() < 1e-4 * size.max()


@pytest.mark.parametrize("tuning", [0.6, 0.9])
def test_at_constant_speed_it_is_the_spectrum(tuning):
    rpm = PAPER.speed(tuning)
    pair = PAPER.replace(material_damping=3953.7, backlash_damping=3953.7)
    once = gearlib.simulate(pair, tuning, periods=240, record_periods=24, samples_per_period=256)
    spectrum = gearlib.orders(once, count=5)
    run = gearlib.run_up(pair, rpm, rpm, duration=600.02 / rpm, samples_per_period=256)
    for variable, name in (("displacement", "error"), ("dynamic_force", "force")):
        found = gearlib.order_map(run, variable=variable, amplitude="peak").isel(time=-1)
        exact = spectrum[f"{name}_amplitude"].values
        # What has not died out in nine revolutions is far smaller.
        assert np.abs(found.amplitude.values - exact).max() < 1e-7 * exact.max()
        assert float(found.rpm) == pytest.approx(rpm, rel=1e-12)


def test_powers_of_all_orders_make_the_overall_level():
    rpm = FEW.speed(0.8)
    run = gearlib.run_up(FEW, rpm, 1.1 * rpm, duration=0.4, samples_per_period=1024)
    whole = {"resolution": 0.3, "highest": 400.0}
    power = gearlib.order_map(run, amplitude="power", **whole)
    assert float(power.order_resolution) == 0.25 and float(power.order[1]) == 0.25
    total = np.sqrt(power.amplitude[:, 1:].sum("order"))
    # A block does not end as it begins: orders fall as its wave with a step does.
    np.testing.assert_allclose(total, power.overall, rtol=1e-4)
    rms = gearlib.order_map(run, **whole)
    np.testing.assert_allclose(rms.amplitude[:, 1:] ** 2, power.amplitude[:, 1:], rtol=1e-12)
    single = gearlib.order_map(run, orders=[3.0, 1.5], resolution=0.25)
    assert single.order.values.tolist() == [3.0, 1.5]
    np.testing.assert_allclose(single.overall, rms.overall, rtol=1e-12)
    track = rms.amplitude.sel(order=single.order)
    np.testing.assert_allclose(single.amplitude, track, rtol=1e-9, atol=1e-18)


@pytest.mark.parametrize("variable", ["displacement", "dynamic_force"])
def test_errors_fall_with_the_samples_and_are_estimated(variable):
    rpm = FEW.speed(0.85)
    course = {"start": rpm, "stop": 1.2 * rpm, "duration": 0.2}
    found = [
        gearlib.order_map(
            gearlib.run_up(FEW, samples_per_period=samples, **course), highest=9, variable=variable
        )
        for samples in (64, 256, 2048)
    ]
    errors = [float(np.abs(one.amplitude - found[-1].amplitude).max()) for one in found[:2]]
    assert errors[1] < 0.1 * errors[0] < 1e-3 * float(found[-1].overall.max())
    for error, one in zip(errors, found, strict=False):
        assert error < float(one.amplitude_error.max())


def test_a_course_from_rest_to_rest_has_orders():
    top = float(FEW.speed(0.6))
    course = {"speed": [(0.0, 0.0), (0.1, top), (0.15, top), (0.25, 0.0), (0.3, 0.0)]}
    course |= {"samples_per_period": 64}
    models = FEW, gearlib.OneDegreePair(pair=FEW)
    found, same = (gearlib.order_map(gearlib.run_up(one, **course), highest=9) for one in models)
    assert np.isfinite(found.amplitude).all()
    gap = np.abs(same.amplitude - found.amplitude)
    assert gap.max() < 1e-9 * found.amplitude.max()


def test_a_coast_side_has_the_orders_of_the_drive_side():
    rpm = float(FEW.speed(0.85))
    course = {"start": rpm, "stop": 1.2 * rpm, "duration": 0.2, "samples_per_period": 64}
    drive = gearlib.order_map(gearlib.run_up(FEW, **course), highest=9)
    start = -FEW.backlash_ratio, 0.0
    coast = gearlib.run_up(FEW, load=[(0.0, -1.0)], initial_state=start, **course)
    own = gearlib.order_map(coast, highest=9)
    # The mean is measured from the other flank.
    gap = np.abs(own.amplitude - drive.amplitude)[:, 1:]
    assert gap.max() < 1e-5 * drive.overall.max()
