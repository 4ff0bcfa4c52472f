"""The public calls: consistency among the parts of their datasets, units, files."""

import math
import re

import numpy as np
import pint
import pytest
import xarray as xr

from gearlib import GearPair, simulate, sweep
from gearlib.data import storage
from tests.paper import PAPER

PAIR = GearPair.from_ratios(
    contact_ratio=1.569, stiffness_ratio=0.5879, damping=0.0617, backlash_damping=0.0617, backlash=4
)
CHAOTIC = PAIR.replace(material_damping=0.0, backlash_damping=0.0)
RUN, SAMPLES = {"periods": 60, "record_periods": 4}, 512


@pytest.fixture(scope="module")
def bouncing():
    """A motion with bounces; its last 4 of 60 periods are recorded, 512 samples in each."""
    return simulate(PAIR, 0.9, samples_per_period=SAMPLES, **RUN)


def test_time_history_agrees_with_the_summary(bouncing):
    periods_before_record = RUN["periods"] - RUN["record_periods"]
    assert bouncing.phase[0] == pytest.approx(2 * math.pi * periods_before_record, rel=1e-15)
    np.testing.assert_allclose(np.diff(bouncing.phase), 2 * math.pi / SAMPLES, rtol=1e-9)
    # The exact extrema lie beyond the samples by at most acc (d tau / 2)^2 / 2 < 1e-4.
    high, low = bouncing.displacement.max(), bouncing.displacement.min()
    assert 0 <= bouncing.displacement_max - high < 1e-4
    assert 0 <= low - bouncing.displacement_min < 1e-4
    assert 0 <= bouncing.dynamic_force_max - bouncing.dynamic_force.max() < 1e-4
    # A fraction counted on samples misses at most one sample per event.
    share = float((bouncing.contact == 0).mean())
    assert float(bouncing.fraction_backlash) == pytest.approx(share, abs=4 / SAMPLES)
    soft = (bouncing.contact != 0) & (bouncing.stiffness < 1.0)
    assert float(bouncing.fraction_min_stiffness) == pytest.approx(soft.mean(), abs=4 / SAMPLES)
    total = bouncing.fraction_normal + bouncing.fraction_backlash + bouncing.fraction_inverse
    assert float(total) == pytest.approx(1.0, abs=1e-13)


def test_equation_of_motion_holds_at_every_sample(bouncing):
    d = bouncing
    damping = np.where(d.contact == 0, PAIR.backlash_damping_ratio, PAIR.damping_ratio)
    residual = d.acceleration + 2 * damping / 0.9 * d.velocity + (d.dynamic_force - 1) / 0.81
    # Rounding of a sum of terms of order one.
    assert float(abs(residual).max()) < 1e-13
    assert np.array_equal(d.modified_stiffness, d.stiffness * (d.contact != 0))


@pytest.mark.parametrize(
    "call", [lambda pair: simulate(pair, 0.9, **RUN), lambda pair: sweep(pair, [0.7, 0.9], **RUN)]
)
def test_units_tell_what_scales_with_load_and_size(call):
    # The same pair in other units of length, mass and time: powers of two change no digit.
    length, mass, time = 2.0, 4.0, 2.0
    pair = PAPER.replace(material_damping=3953.7, backlash_damping=500.0)
    factors = {"max_stiffness": mass / time**2, "reduced_mass": mass, "backlash": length}
    factors |= {"load": mass * length / time**2}
    factors |= {"material_damping": mass / time, "backlash_damping": mass / time}
    changed = pair.replace(**{name: getattr(pair, name) * x for name, x in factors.items()})
    registry, scales = pint.UnitRegistry(), {"[length]": length, "[mass]": mass, "[time]": time}
    first, second = call(pair), call(changed)
    for name, variable in first.variables.items():
        if variable.dtype.kind in "fi":
            # CF writes powers without a sign for them.
            text = re.sub(r"(?<=[a-z])(-?[0-9])", r"**\1", variable.attrs["units"])
            unit = registry.Unit(text).dimensionality
            factor = math.prod(scales[part] ** power for part, power in unit.items())
            np.testing.assert_array_equal(second[name], factor * variable, err_msg=name)


def test_a_file_holds_the_run_and_the_same_run_has_the_same_bytes(bouncing, tmp_path):
    storage.write(bouncing, tmp_path / "a" / "one.nc")
    storage.write(simulate(PAIR, 0.9, samples_per_period=SAMPLES, **RUN), tmp_path / "two.nc")
    dataset = storage.read(tmp_path / "two.nc")
    # What the file alone says: who wrote it, from which sources.
    del dataset.attrs["history"], dataset.attrs["source_hash"]
    xr.testing.assert_identical(dataset, bouncing)
    assert (tmp_path / "a" / "one.nc").read_bytes() == (tmp_path / "two.nc").read_bytes()


@pytest.mark.parametrize(("direction", "step"), [("up", 1), ("down", -1)])
def test_each_run_of_a_sweep_up_or_down_starts_where_the_last_ended(direction, step):
    tunings = np.linspace(0.78, 0.86, 9)[::step]
    curve, state = sweep(PAIR, tunings, direction=direction, **RUN), (0.0, 0.0)
    for tuning in tunings:
        run = simulate(PAIR, tuning, initial_state=state, **RUN)
        state = tuple(run.final_state.values)
        np.testing.assert_array_equal(curve.final_state.sel(tuning=tuning), state)


def test_event_limit_is_a_status_not_a_number():
    stuck = simulate(CHAOTIC, 0.05, periods=3, max_events=5)
    assert int(stuck.status) == 1 and "raise max_events" in stuck.status.attrs["message"]
    assert stuck.displacement.isnull().all() and stuck.final_state.isnull().all()
    assert stuck.sizes["event"] == 0
    table = sweep(CHAOTIC, [0.05], periods=300, record_periods=1, max_events=5)
    assert table.status.values.tolist() == [1] and table.displacement_max.isnull().all()
