"""Derivatives of what fits compare, against differences of second codes in 40 and 50 digits."""

import math

import mpmath as mp
import numpy as np
import pytest
import xarray as xr

import gearlib
from gearlib.analysis.orbits.main_resonance import Resonance
from gearlib.analysis.order_maps import summed
from gearlib.rig.orbit_at_speed import STATISTICS, OrbitAtSpeed
from gearlib.rig.order_observations import MeshOrders
from gearlib.rig.projection import projected
from gearlib.rig.run_up_observations import ORDERS, SAMPLES, RunUpOrders
from gearlib.rig.speed_observations import Speeds
from gearlib.rig.synthetic_rigs import synthetic_rig
from tests.physics.test_fits import TRUTH
from tests.references import reference_elimination, reference_pair_run_up, reference_slopes
from tests.references.described_models import describe
from tests.references.reference_equations import machine_of

NAMES = ("material_damping", "reduced_mass", "contact_ratio", "load", "max_stiffness")
#: What is measured to so many digits.
CLOSE = 1e-9
_STEP = mp.mpf(10) ** -10


def along(model, seed=0):
    """Return by what parameters change along one random direction."""
    rng = np.random.default_rng(seed)
    return {name: float(rng.uniform(-1.0, 1.0) * getattr(model, name)) for name in NAMES}


def sides(model, slopes, value):
    """Return the central difference of lists of numbers along a direction, in 50 digits."""
    ends = []
    for sign in (1, -1):
        other = describe(model)
        for name, slope in slopes.items():
            other, _, _ = reference_slopes.changed(other, 1.0, (0, 0), name, sign * _STEP * slope)
        ends.append(value(other))
    return np.array([float((a - b) / (2 * _STEP)) for a, b in zip(*ends, strict=True)])


def rate_of(description):
    """Return the speed in rpm of the tuning 1."""
    return machine_of(description, 1.0, mp).speed * 30 / (mp.pi * description["teeth"])


def test_the_speed_of_a_jump_changes_as_in_fifty_digits():
    y, slopes = Resonance(TRUTH).jump_down, along(TRUTH)
    speeds = {"jump_down": xr.DataArray(float(TRUTH.speed(y[2])), attrs={"noise_std": 1.0})}
    (own,) = Speeds(speeds).residuals(TRUTH, NAMES)[1] @ list(slopes.values())

    def speed(other):
        return [reference_slopes._fold(other, 1, y) * rate_of(other)]

    with mp.workdps(50):
        (wanted,) = sides(TRUTH, slopes, speed)
    assert abs(own - wanted) < CLOSE * abs(wanted)


@pytest.mark.parametrize("tuning", [0.7, 0.9])
def test_statistics_at_a_speed_change_as_in_fifty_digits(tuning):
    # On the upper branch, where contact is lost.
    tunings = np.linspace(tuning, 1.0, 8)
    run = gearlib.sweep(TRUTH, tunings, periods=300, record_periods=1, direction="down")
    speed, state = float(TRUTH.speed(tuning)), run.final_state.values[0]
    point, slopes = OrbitAtSpeed(TRUTH, speed, state, NAMES), along(TRUTH, 1)
    assert point.least[0] < 0.0

    def statistics(other):
        nu = mp.mpf(speed) / rate_of(other)
        z, _ = reference_slopes._orbit(other, nu, 1, point.orbit.state)
        machine = machine_of(other, nu, mp)
        found = reference_slopes.columns(other, nu, 1, list(z))
        scale = {"length": machine.length, "force": machine.length * machine.force_unit, "share": 1}
        return [found[name][0] * scale[kind] for name, kind in STATISTICS.items()]

    with mp.workdps(50):
        wanted = sides(TRUTH, slopes, statistics)
    for name, one in zip(STATISTICS, wanted, strict=True):
        value, own, _ = point.of(name)
        assert abs(own @ list(slopes.values()) - one) <= CLOSE * (abs(one) + abs(value)) + 1e-30, (
            name
        )


def test_mesh_orders_of_a_run_up_change_as_in_forty_digits():
    pair = TRUTH.replace(teeth=5, backlash=1e-5)
    low, high = (float(pair.speed(nu)) for nu in (0.8, 1.0))
    rpm = 0.5 * (low + high) / 60.0
    course = [(0.0, high), (14.5 / rpm, low)]
    observation = RunUpOrders(pair, synthetic_rig(pair, course, 1))
    slopes = along(pair, 2)
    _, moved = observation.modelled(pair, NAMES)
    run = gearlib.run_up(pair, speed=course, samples_per_period=SAMPLES)
    events = np.column_stack([run[f"event_{one}"] for one in ("time", "from", "to")]).tolist()
    events = [(t, int(a), int(b)) for t, a, b in events]
    # Of one block, where the second code ends.
    per, block = SAMPLES * pair.teeth, 3
    own = slice(block * per, (block + 1) * per + 1)
    times, phase = run.time.values[own].tolist(), run.phase.values[own]
    after = run.time.values[own.stop]
    part = [course[0], (after, float(np.interp(after, *np.transpose(course))))]
    events = [one for one in events if one[0] < after]
    assert -1 in [one[2] for one in events]
    with mp.workdps(40):
        values = {name: getattr(pair, name) for name in (*NAMES, "stiffness_ratio", "backlash")}
        values |= {"backlash_damping": pair.backlash_damping, "teeth": pair.teeth, "speed": 1.0}
        values |= dict.fromkeys(
            ("driven_mass", "base_radius", "initial_displacement", "initial_velocity"), 0.0
        )
        ends = []
        for sign in (1, -1):
            step = {name: values[name] + sign * _STEP**2 * rate for name, rate in slopes.items()}
            rows = part, [(0.0, 1.0)], events, times
            ends.append(reference_pair_run_up.run_up(values | step, *rows)["displacement"])
        wanted = np.array([float((a - b) / (2 * _STEP**2)) for a, b in zip(*ends, strict=True)])
    phase = phase - phase[0]
    wanted = summed(phase, wanted, 1, math.tau * pair.teeth, 1.0, ORDERS + 1)[0][0, 1:]
    got = moved[block] @ list(slopes.values())
    assert np.abs(got - wanted).max() < CLOSE * np.abs(wanted).max()


class Waves(MeshOrders):
    """Orders, shape (6, 4), that are polynomials of two parameters; one block is left out."""

    def __init__(self, gain, phase):
        rng = np.random.default_rng(4)
        *self.parts, noise = rng.normal(size=(5, 6, 4)) + 1j * rng.normal(size=(5, 6, 4))
        self.gain, self.phase, self.deviation = gain, phase, 0.3
        self.share, self.kept = rng.uniform(0.1, 2.0, 6), np.arange(6) != 2
        turn = np.exp(0.8j * np.arange(1, 5))
        self.measured = 1.7 * turn * self.modelled((0.7, -0.4), ())[0] + 0.3 * noise

    def modelled(self, model, names):
        (a, b, c, d), (p, q) = self.parts, model
        slopes = np.stack([b + c * q, c * p + 3.0 * d * q**2], 2)
        return a + b * p + c * p * q + d * q**3, slopes[:, :, : len(names)]


def polynomials(parts, point):
    """Return the values of the same polynomials, lists as the parts, in many digits."""
    p, q = point
    terms = np.array([mp.mpf(1), p, p * q, q**3], object)
    return (np.array(parts, object) * terms.reshape(-1, *[1] * (np.ndim(parts) - 1))).sum(0)


def apart(value, rest, slopes, point):
    """Return the largest errors of residuals and derivatives, over the largest of these."""
    with mp.workdps(50):
        point, steps = [mp.mpf(x) for x in point], (_STEP * np.eye(2, dtype=int)).tolist()
        wanted = [np.array(value(point), float)]
        for step in steps:
            ends = [
                value([x + sign * h for x, h in zip(point, step, strict=True)]) for sign in (1, -1)
            ]
            wanted.append(
                np.array([(a - b) / (2 * _STEP) for a, b in zip(*ends, strict=True)], float)
            )
    found = [rest, *slopes.T]
    return [np.abs(a - b).max() / np.abs(b).max() for a, b in zip(found, wanted, strict=True)]


@pytest.mark.parametrize("gain", [False, True])
@pytest.mark.parametrize("phase", [None, 0.8])
def test_gain_and_shaft_phase_are_eliminated_as_in_fifty_digits(gain, phase):
    one, point = Waves(gain, phase), (0.6, -0.5)
    measured, parts = (np.array(x)[..., one.kept, :] for x in (one.measured, one.parts))
    sizes = [0.3 * mp.sqrt(mp.mpf(x) / 2) for x in one.share[one.kept]]

    def value(at):
        orders = polynomials(parts, at)
        return reference_elimination.left_of_orders(measured, orders, sizes, gain, phase)

    assert max(apart(value, *one.residuals(point, ("p", "q")), point)) < CLOSE


@pytest.mark.parametrize("gain", [False, True])
@pytest.mark.parametrize("columns", [0, 1, 3])
def test_gain_and_offset_are_eliminated_as_in_fifty_digits(gain, columns):
    rng = np.random.default_rng(5)
    measured, parts, point = rng.normal(size=12), rng.normal(size=(4, 12)), (0.7, -0.4)
    basis = np.vstack([np.ones(12), rng.normal(size=(2, 12))])[:columns]

    def value(at):
        return reference_elimination.left(measured, list(polynomials(parts, at)), basis, gain)

    a, b, c, d = parts
    (p, q), slopes = (
        point,
        np.column_stack([b + c * point[1], c * point[0] + 3.0 * d * point[1] ** 2]),
    )
    own = projected(measured, a + b * p + c * p * q + d * q**3, slopes, basis.T, gain)
    assert max(apart(value, *own[:2], point)) < CLOSE
