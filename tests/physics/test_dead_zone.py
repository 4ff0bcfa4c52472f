"""Oscillators with a dead zone: closed forms, gear pairs in other symbols, another solver."""

import math

import numpy as np
import pytest
import scipy.linalg

from gearlib import (
    DeadZoneOscillator,
    Fourier,
    GearPair,
    Harmonics,
    OneDegreePair,
    Series,
    Steps,
    periodic_orbit,
    simulate,
)
from gearlib.analysis.lyapunov import largest
from gearlib.data import storage
from tests.physics import published
from tests.properties.changes import as_oscillator
from tests.properties.known_models import UNEQUAL

LIMIT = 10_000
JUDGE = {"solver": "DOP853", "rtol": 1e-13, "atol": 1e-14, "events": True}
RATIOS = {"contact_ratio": 1.569, "stiffness_ratio": 0.5879, "backlash": 1.2}
PAIR = GearPair.from_ratios(**RATIOS, damping=0.03, backlash_damping=0.01)


@pytest.mark.parametrize("method", ["exact", "taylor"])
def test_flight_across_the_gap_is_that_of_a_damped_mass(method):
    model = DeadZoneOscillator(
        upper_edge=9.0, lower_edge=-9.0, upper_stiffness=1.0, damping=0.3, load=0.02
    )
    frequency, x, v = 1.7, -0.4, 0.9
    run = simulate(model, frequency, periods=2, initial_state=(x, v / frequency), method=method)
    t = 4.0 * math.pi / frequency
    terminal, decay = 0.02 / 0.3, math.exp(-0.3 * t)
    end = x + terminal * t + (v - terminal) * (1.0 - decay) / 0.3
    speed = terminal + (v - terminal) * decay
    # A few roundings of numbers of order one, over some tens of substeps.
    assert run.final_state.values == pytest.approx([end, speed / frequency], abs=1e-13)
    assert run.sizes["event"] == 0


def linear(t, x, v, damping, stiffness, amplitude, frequency):
    """Return x and v of x'' + damping x' + stiffness x = amplitude cos(frequency t) at t."""
    steady = amplitude / (stiffness - frequency**2 + 1j * damping * frequency)
    root = -damping / 2.0 + 1j * math.sqrt(stiffness - damping**2 / 4.0)
    # The free part Re(c e^(root t)) takes up what the steady part leaves of the start.
    rest, speed = x - steady.real, v - (1j * frequency * steady).real
    c = complex(rest, (root.real * rest - speed) / root.imag)
    wave, free = steady * np.exp(1j * frequency * t), c * np.exp(root * t)
    return (wave + free).real, (1j * frequency * wave + root * free).real


def test_a_contact_that_is_not_there_makes_no_difference():
    known = {
        "upper_stiffness": 2.0,
        "ground_stiffness": 0.3,
        "damping": 0.1,
        "forcing": Harmonics((1.5,)),
    }
    far = {"lower_stiffness": Series(3.0, Harmonics((1.0,))), "lower_damping": 0.7}
    runs = [
        simulate(DeadZoneOscillator(**known, **more), 0.8, periods=20, record_periods=3)
        for more in ({}, far)
    ]
    assert "exact" in DeadZoneOscillator(**known, **far).propagators
    assert runs[0].sizes["event"] > 0
    np.testing.assert_allclose(runs[0].displacement, runs[1].displacement, rtol=0, atol=1e-12)


@pytest.mark.parametrize("method", ["exact", "taylor"])
@pytest.mark.parametrize("how", ["ground", "no gap"])
def test_what_is_linear_is_a_driven_linear_oscillator(method, how):
    common = {"damping": 0.2, "forcing": Harmonics((0.8,))}
    if how == "ground":
        edges = {"upper_edge": 50.0, "lower_edge": -50.0, "upper_stiffness": 1.0}
        model = DeadZoneOscillator(ground_stiffness=2.5, **edges, **common)
    else:
        # Both sides at one edge, a ground spring beside them: every crossing is an event.
        model = DeadZoneOscillator(
            upper_edge=0.0, lower_edge=0.0, upper_stiffness=2.0, ground_stiffness=0.5, **common
        )
    frequency = 0.7
    run = simulate(model, frequency, periods=3, initial_state=(0.5, 0.3), method=method)
    x, v = linear(6.0 * math.pi / frequency, 0.5, 0.3 * frequency, 0.2, 2.5, 0.8, frequency)
    assert run.final_state.values == pytest.approx([x, v / frequency], abs=1e-13)
    assert (run.sizes["event"] > 0) == (how == "no gap")


def test_a_truncated_stiffness_is_a_series():
    pair = OneDegreePair(
        pair=PAIR, profile=Fourier(3), excitation=Harmonics((0.2,)), deviation=Harmonics((), (0.1,))
    )
    table = pair.equation.near.harmonics
    model = as_oscillator(
        PAIR,
        upper_stiffness=Series(1.0, Harmonics(tuple(table[:, 1]), tuple(table[:, 2]))),
        forcing=Harmonics((0.2,)),
        deviation=Harmonics((), (0.1,)),
    )
    ends = [simulate(one, 0.9, periods=10).final_state.values for one in (pair, model)]
    assert ends[0] == pytest.approx(ends[1], abs=1e-12)


@pytest.mark.parametrize(
    "model",
    [
        OneDegreePair(pair=GearPair.from_ratios(contact_ratio=1.5, stiffness_ratio=1.0)),
        DeadZoneOscillator(upper_stiffness=1.0, load=1.0),
        DeadZoneOscillator(upper_stiffness=1.0, upper_edge=2.0, ground_stiffness=1.0),
    ],
)
def test_deviations_from_rest_swing_as_the_contact_does(model):
    # The motion itself rests at its static deflection: its own series ends at once.
    x = 1.0 if model.flank_lines[0] == 0.0 else 0.0
    frequency = 0.31
    _, maps, _ = model.propagator(frequency).maps(np.array([x, 0.0]), 1, LIMIT)
    angle = 2.0 * math.pi / frequency
    c, s = math.cos(angle), math.sin(angle)
    exact = [[c, s * frequency], [-s / frequency, c]]
    # Twenty radians of oscillation in steps of one: their roundings.
    assert maps[0] == pytest.approx(np.array(exact), abs=1e-13)


@pytest.mark.parametrize("damping", [0.0, 3.0, 114.0])
def test_deviations_from_rest_die_as_the_damping_says(damping):
    # x'' + d x' + x = 0 by Taylor steps; the motion itself rests at its static deflection.
    model = DeadZoneOscillator(upper_stiffness=1.0, load=1.0, damping=damping)
    frequency = 0.31
    _, maps, _ = model.propagator(frequency, "taylor").maps(np.array([1.0, 0.0]), 1, LIMIT)
    rates = np.array([[0.0, 1.0], [-1.0 / frequency**2, -damping / frequency]])
    exact = scipy.linalg.expm(2.0 * math.pi * rates)
    # The roundings of some 2000 steps where the damping is largest.
    assert maps[0] == pytest.approx(exact, abs=1e-12)


def test_the_four_motions_of_rattling_gears():
    model, frequency = published.PROBLEMS["gear_rattle"]
    patterns = {
        (0.61, 0.0): (1,),
        (0.64, -0.1): (1, 0, 1, 0, 1),
        (0.75, -0.43): (1, 0, 1),
        (-0.29, -0.62): (0, -1, 0, 1, 0),
    }
    for guess, pattern in patterns.items():
        orbit = periodic_orbit(model, frequency, guess=guess)
        assert orbit.residual <= 1e-12
        assert orbit.stable and not orbit.grazing
        assert orbit.pattern == pattern
        # One damping everywhere: the product is exp(-0.6) for every motion.
        assert orbit.multipliers.prod().real == pytest.approx(math.exp(-0.6), abs=1e-12)


@pytest.mark.parametrize("name", published.MOTIONS)
def test_the_motions_that_coexist_are_found_and_another_solver_follows_them(name):
    model, frequency = published.PROBLEMS[name]
    periodic, chaotic = [], []
    for start in published.starts(name, 24):
        end = simulate(model, frequency, periods=120, initial_state=tuple(start))
        known = chaotic if int(end.period) == 0 else periodic
        state = end.final_state.values
        # Motions of these problems lie a hundredth apart; one that does not repeat has no state.
        if not known or (known is periodic and min(np.abs(known - state).max(axis=1)) > 1e-2):
            known.append(state)
    assert (len(periodic), len(chaotic)) == published.MOTIONS[name]
    for state in (*periodic, *chaotic):
        settings = {"periods": 4, "record_periods": 4, "initial_state": tuple(state)}
        run, judge = (
            simulate(model, frequency, **settings, **method)
            for method in ({}, {"method": "scipy", "options": JUDGE})
        )
        # What the solver's tolerance leaves, amplified by the bounces and by chaos.
        assert np.abs(run.displacement - judge.displacement).max() < 1e-9


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
        (lambda: DeadZoneOscillator(**ONE, lower_edge=0.5), "from -inf to upper_edge = 0.0"),
        (lambda: Series(1.0, Harmonics((-0.8, -0.4))), "the stiffness falls to -0.2"),
        # In the middle of the period only, and just behind its start.
        (lambda: Series(1.0, Harmonics((1.25,))), "the stiffness falls to -0.25"),
        (lambda: Series(1.0, Harmonics((), (-0.9, -0.9))), "the stiffness falls to -0.5"),
        (lambda: Steps((0.0, 0.0), (1.0, 2.0)), "it must rise strictly"),
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


@pytest.mark.parametrize("load", [-0.4, 0.4])
def test_a_start_at_rest_without_backlash_falls_at_once(load):
    # Both contacts begin at x = 0: the one that the load presses against holds from the start.
    model = DeadZoneOscillator(
        upper_stiffness=1.0, lower_edge=0.0, lower_stiffness=2.5, damping=0.1, load=load
    )
    exact = simulate(model, 0.8, periods=3, record_periods=3)
    taylor = simulate(model, 0.8, periods=3, record_periods=3, method="taylor")
    np.testing.assert_allclose(exact.displacement, taylor.displacement, rtol=0, atol=1e-11)
    resting = load / (1.0 if load > 0.0 else 2.5)
    assert float(exact.displacement.mean()) == pytest.approx(resting, rel=0.2)
