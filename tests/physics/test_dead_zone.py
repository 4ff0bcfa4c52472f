"""Oscillators with a dead zone: closed forms, gear pairs in other symbols, another solver."""

import math

import numpy as np
import pytest

from gearlib import (
    DeadZoneOscillator,
    Harmonics,
    Series,
    Steps,
    periodic_orbit,
    simulate,
)
from gearlib.analysis.lyapunov import largest
from gearlib.data import storage
from tests.physics import published
from tests.properties.known_models import UNEQUAL


def test_the_soft_stop_has_chaos_beside_the_motion_without_impact():
    model, frequency = published.PROBLEMS["soft_impact"]
    steady = 0.5 / (1.0 - frequency**2 + 0.04j * frequency)
    orbit = periodic_orbit(model, frequency, guess=(0.6, 0.0))
    assert orbit.pattern == (0,)
    assert orbit.state == pytest.approx([steady.real, -steady.imag], abs=1e-12)
    assert orbit.multipliers.prod().real == pytest.approx(
        math.exp(-0.08 * math.pi / frequency), abs=1e-12
    )
    chaos = largest(model, frequency, state=(0.0, 0.0), settle=400, periods=600)
    assert chaos.value > 10.0 * chaos.uncertainty
    # It ends where it grazes the stop: just beyond its amplitude the stop is out of reach.
    grazing = periodic_orbit(published.soft_impact(abs(steady))[0], frequency, guess=(0.6, 0.0))
    assert grazing.grazing


def test_a_run_says_in_its_own_words_what_it_holds(tmp_path):
    run = simulate(UNEQUAL, 1.3, periods=2)
    assert run.attrs["title"] == "Time course of a dead-zone oscillator"
    assert "Series" not in run.attrs["model"] and '"kind":"steps"' in run.attrs["model"]
    names = {variable.attrs["long_name"] for variable in run.variables.values()}
    assert not [name for name in names if "mesh" in name or "static deflection" in name]
    assert "static_deflection" not in run
    storage.write(run, tmp_path / "run.nc")
    for stiffness in (Series(2.0, Harmonics((0.5,))), 3.0):
        model = DeadZoneOscillator(upper_stiffness=stiffness, upper_edge=0.1)
        storage.write(simulate(model, 1.3, periods=2), tmp_path / "run.nc")


ONE = {"upper_stiffness": 1.0}


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda: DeadZoneOscillator(upper_stiffness=0.0), "upper_stiffness = 0.0 is not allowed"),
        (
            lambda: DeadZoneOscillator(upper_stiffness=0, lower_stiffness=0.0, lower_edge=-1.0),
            "upper_stiffness = 0.0 and lower_stiffness = 0.0 is not allowed: one contact must",
        ),
        (lambda: Series(1.0, Harmonics((-0.8, -0.4))), "the stiffness falls to -0.2"),
        # In the middle of the period only, and just behind its start.
        (lambda: Series(1.0, Harmonics((1.25,))), "the stiffness falls to -0.25"),
        (lambda: Series(1.0, Harmonics((), (-0.9, -0.9))), "the stiffness falls to -0.5"),
        (lambda: Steps((0.0, 0.0), (1.0, 2.0)), "it must increase strictly"),
        (
            lambda: simulate(DeadZoneOscillator(**ONE), 1.0, periods=1, method="rk4"),
            "method = 'rk4' is not allowed for this DeadZoneOscillator",
        ),
    ],
)
def test_what_is_impossible_is_refused_in_one_sentence(make, says):
    with pytest.raises(ValueError) as error:
        make()
    assert says in str(error.value)
    assert "\n" not in str(error.value)


def test_a_start_at_rest_without_backlash_or_damping_is_a_cosine():
    # Rounding hides in which order the mesh leaves one flank and meets the other: many cases.
    rng = np.random.default_rng(5)
    for _ in range(100):
        upper, lower = 10.0 ** rng.uniform(-2.0, 2.0, 2)
        load = rng.choice((-1.0, 1.0)) * 10.0 ** rng.uniform(-9.0, 2.0)
        model = DeadZoneOscillator(
            upper_stiffness=upper, lower_edge=0.0, lower_stiffness=lower, load=load
        )
        run = simulate(model, 0.8, periods=1, samples_per_period=16)
        k = upper if load > 0.0 else lower
        exact = load / k * (1.0 - np.cos(math.sqrt(k) * run.phase.values / 0.8))
        np.testing.assert_allclose(run.displacement, exact, rtol=0, atol=1e-12 * abs(load / k))
