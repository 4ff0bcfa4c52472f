"""Solvers from packages of others against the exact method; those not installed are skipped."""

import importlib.util
import subprocess
import sys

import numpy as np
import pytest

import gearlib
from gearlib import (
    Fourier,
    OneDegreePair,
    integrators,
    simulate,
    sweep,
)
from gearlib.integrators.peers import heyoka as peer_heyoka
from tests.paper import PAPER
from tests.physics.test_step_methods import FULL as MESH
from tests.physics.test_step_methods import SIX
from tests.properties.known_models import KNOWN

PEERS = ("heyoka", "cvode", "diffrax")
AVAILABLE = {method.name: method for method in gearlib.methods()}
PAIR = PAPER.replace(material_damping=3953.7, backlash_damping=3953.7)
FULL = MESH.replace(contact_ratio=1.569, quadratic_stiffness=1e4)
#: Tight options and the error in displacement they leave over some periods: heyoka works to
#: rounding. The others control the error of a step to 1e-11; the sum over the steps, and the slope
#: of an event, which its root finder leaves at the root of its interpolant, cost a factor of 1e3.
TIGHT = {
    "heyoka": ({}, 1e-12),
    "cvode": ({"rtol": 1e-11, "atol": 1e-11}, 1e-8),
    "diffrax": ({"rtol": 1e-11, "atol": 1e-11}, 1e-8),
}
SIX_TAKEN = ("heyoka", "cvode")


def need(name):
    method = AVAILABLE[name]
    if not method.available:
        pytest.skip(f"{name} is not installed: {method.note}")


def compare(model, nu, name, periods, factor=1.0, **arguments):
    """Compare all of a run with the exact one; `factor` widens the tolerance."""
    options, tolerance = TIGHT[name]
    arguments = {"periods": periods, "record_periods": 3, "samples_per_period": 64, **arguments}
    run = simulate(model, nu, method=name, options=options, **arguments)
    exact = simulate(model, nu, **arguments)
    assert int(run.status) == 0 and int(run.evaluations) > 0
    assert run.event_to.values.tolist() == exact.event_to.values.tolist()
    columns = ["displacement", "velocity", "dynamic_force", "final_state", "event_phase"]
    columns += model.extra_samples
    for column in (*columns, "fraction_backlash", "fraction_min_stiffness", "bounces"):
        np.testing.assert_allclose(
            run[column], exact[column], rtol=0, atol=factor * tolerance, err_msg=column
        )
    # Extrema are those of step ends and samples, 64 to a period: x'' h^2 / 8 = 5e-3.
    for column in ("displacement_max", "displacement_min"):
        assert float(run[column]) == pytest.approx(float(exact[column]), abs=0.01)
    return exact


@pytest.mark.parametrize("name", PEERS)
def test_bouncing_orbit(name):
    need(name)
    assert float(compare(PAIR, 0.9, name, 20).bounces) > 0.0


@pytest.mark.parametrize("name", PEERS)
def test_orbit_that_keeps_contact(name):
    need(name)
    assert float(compare(PAIR, 0.7, name, 20).displacement_min) > 0.0


@pytest.mark.parametrize("name", PEERS)
@pytest.mark.parametrize("far", [False, True])
def test_start_from_rest_exactly_on_a_flank_line(name, far):
    need(name)
    state = (-PAIR.backlash_ratio if far else 0.0, 0.0)
    compare(PAIR, 0.82, name, 5, record_periods=5, initial_state=state)


@pytest.mark.parametrize("name", PEERS)
def test_both_flanks(name):
    need(name)
    # Thrown at the far flank: inverse mesh takes part.
    exact = compare(PAIR, 0.9, name, 4, record_periods=4, initial_state=(-1.0, -6.0))
    assert -1 in exact.event_to


@pytest.mark.parametrize("name", PEERS)
@pytest.mark.parametrize("gap", [0.0, np.inf])
def test_no_gap_and_no_far_flank(name, gap):
    need(name)
    compare(PAIR.replace(backlash=gap), 0.8, name, 4, record_periods=4, initial_state=(0.5, -2.0))


@pytest.mark.parametrize("name", PEERS)
@pytest.mark.parametrize(
    "model",
    [FULL, OneDegreePair(pair=PAIR, profile=Fourier(3), quadratic_damping=3e4)],
    ids=["full", "fourier"],
)
def test_nonlinear_models(name, model):
    need(name)
    # Their reference is the Taylor method, exact to some 1e-13; with |x'| x' the right-hand side
    # has a kink at x' = 0, behind which a Runge-Kutta pair loses a digit.
    compare(model, 0.9, name, 10, factor=10.0)


@pytest.mark.parametrize("name", PEERS)
def test_six_degrees(name):
    if name in SIX_TAKEN:
        need(name)
        # Twelve components and run-out over a revolution.
        compare(SIX, 0.8, name, 4, factor=10.0)
    else:
        with pytest.raises(ValueError, match="one degree of freedom"):
            simulate(SIX, 0.9, periods=1, method=name)


@pytest.mark.parametrize("name", PEERS)
def test_sweep_equals_single_runs(name):
    need(name)
    table = sweep(PAIR, [0.9, 0.7], periods=5, record_periods=2, method=name)
    for nu in (0.7, 0.9):
        one = simulate(PAIR, nu, periods=5, record_periods=2, method=name)
        np.testing.assert_array_equal(table.final_state.sel(tuning=nu), one.final_state)
        assert float(table.bounces.sel(tuning=nu)) == float(one.bounces)


@pytest.mark.parametrize("name", PEERS)
def test_evaluations_do_not_depend_on_the_record(name):
    need(name)
    counts = {
        int(simulate(PAIR, 0.9, periods=4, record_periods=n, method=name).evaluations)
        for n in (1, 3)
    }
    assert len(counts) == 1


@pytest.mark.parametrize("name", PEERS)
def test_limits_are_a_status(name):
    need(name)
    assert int(simulate(PAIR, 0.9, periods=5, method=name, max_events=2).status) == 1


def test_heyoka_compiles_a_structure_once():
    need("heyoka")
    simulate(PAIR, 0.9, periods=10, method="heyoka")
    made = dict(peer_heyoka._COMPILED.integrators)
    other = PAIR.replace(load=2000.0, material_damping=2000.0)
    sweep(other, np.linspace(0.6, 1.2, 7), periods=10, record_periods=1, method="heyoka")
    inverse = {key for key in peer_heyoka._COMPILED.integrators if key not in made}
    # Only the contact code that had not been met may be new.
    assert all(key[1][0] == -1 for key in inverse)


@pytest.mark.parametrize("name", PEERS)
def test_wrong_options_are_refused(name):
    need(name)
    key = "tol" if name == "heyoka" else "rtol"
    for options, part in (({key: 0.0}, f"options['{key}'] = 0.0"), ({"h": 1}, "knows")):
        with pytest.raises(ValueError) as refusal:
            simulate(PAIR, 0.9, periods=1, method=name, options=options)
        assert part in str(refusal.value)


@pytest.mark.parametrize("name", PEERS)
def test_missing_package_is_told(name, monkeypatch):
    package = integrators.METHODS[name].PACKAGE
    found = importlib.util.find_spec
    monkeypatch.setattr(
        "gearlib.integrators.peers.package.find_spec",
        lambda module: None if module == package.module else found(module),
    )
    listed = {method.name: method for method in gearlib.methods()}[name]
    assert not listed.available and package.distribution in listed.note
    for kind in (ValueError, ImportError):
        with pytest.raises(kind) as refusal:
            simulate(PAIR, 0.9, periods=1, method=name)
        text = str(refusal.value)
        assert name in text and package.distribution in text and "\n" not in text


def test_nothing_is_imported_before_it_is_used():
    modules = [integrators.METHODS[name].PACKAGE.module for name in PEERS]
    code = (
        "import sys, gearlib\n"
        "from gearlib import GearPair, methods, simulate\n"
        "methods()\n"
        "pair = GearPair.from_ratios(contact_ratio=1.5, stiffness_ratio=0.6)\n"
        "simulate(pair, 0.9, periods=1)\n"
        f"print([m for m in {modules + ['jax']} if m in sys.modules])\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


@pytest.mark.parametrize("name", ["oscillator", "unequal sides", "series", "gear_rattle"])
@pytest.mark.parametrize("method", ["heyoka", "cvode"])
def test_sides_that_differ_and_edges_off_zero(method, name):
    need(method)
    known = KNOWN[name]
    # Contacts of a stiffness up to 200, whose force has so many times the error.
    span = {"periods": 4, "initial_state": known.state}
    compare(known.model, known.tuning, method, factor=200.0, **span)
