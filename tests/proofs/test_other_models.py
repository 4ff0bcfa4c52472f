"""Certificates of other models of one degree of freedom, against a solver of scipy.

And against the second program in 50 digits; ``GEARLIB_CERTIFICATES=1000`` takes more random models.
"""

import json
import math
import os
from dataclasses import replace

import mpmath
import numpy as np
import pytest
from scipy.integrate import solve_ivp

import gearlib
from tests.paper import PAPER
from tests.proofs.candidates import extrema_apart, never_right, random_other_orbit
from tests.proofs.checker import faults
from tests.proofs.trains_in_50_digits import Motion

MATERIAL = PAPER.replace(material_damping=3953.7)
FORCED = gearlib.OneDegreePair(
    pair=MATERIAL,
    excitation=gearlib.Harmonics((600.0,), (0.0, 300.0)),
    deviation=gearlib.Harmonics((0.0, 1e-6)),
)
STOP = gearlib.DeadZoneOscillator(
    upper_edge=1.0,
    lower_edge=-0.8,
    upper_stiffness=gearlib.Steps((0.0, 2.0), (1.0, 0.6)),
    lower_stiffness=1.5,
    damping=0.1,
    upper_damping=0.2,
    ground_stiffness=0.05,
    load=0.3,
    forcing=gearlib.Harmonics((0.8,), (0.1,)),
)
FREE = replace(STOP, ground_stiffness=0.0, damping=0.0, lower_damping=0.15, load=0.25)


def acceleration(model, tuning, contact, phase, x, v):
    """Return d2x/dphase2 from the equations as the models state them."""
    if model is FORCED:
        pair, k = model.pair, model.pair.material_damping if contact else 0.0
        unit, mass = pair.static_deflection, pair.reduced_mass
        omega = tuning * math.sqrt(pair.mean_stiffness / mass)
        high = abs((phase + math.pi) % (2 * math.pi) - math.pi) <= math.pi * (
            pair.contact_ratio - 1
        )
        stiffness = pair.max_stiffness if high else pair.min_stiffness
        force = pair.load + 600.0 * math.cos(phase) + 300.0 * math.sin(2 * phase)
        force += mass * omega**2 * -4e-6 * math.cos(2 * phase)
        stretch = x * unit * (contact == 1) + (x * unit + pair.backlash) * (contact == -1)
        force -= k * v * unit * omega + stiffness * stretch
        return force / (mass * omega**2 * unit)
    t_rate = v * tuning
    high = phase % (2 * math.pi) < 2.0
    drag = {1: model.upper_damping, 0: model.damping, -1: model.lower_damping}[contact]
    force = model.load + 0.8 * math.cos(phase) + 0.1 * math.sin(phase)
    force -= drag * t_rate + model.ground_stiffness * x
    force -= (1.0 if high else 0.6) * (x - 1.0) * (contact == 1) + 1.5 * (x + 0.8) * (contact == -1)
    return force / tuning**2


@pytest.mark.parametrize(
    "model, tuning", [(FORCED, 1.0), (FORCED, 0.7), (STOP, 0.5), (STOP, 0.8), (FREE, 0.6)]
)
def test_a_proven_orbit_solves_the_differential_equation(model, tuning):
    orbit = gearlib.periodic_orbit(model, tuning, guess=(1.0, 0.0))
    found = gearlib.certify(orbit)
    assert found and found.pattern == orbit.pattern
    for one, (real, imaginary) in zip(orbit.multipliers, found.multipliers, strict=True):
        assert min(abs(one - float(real) - s * 1j * float(imaginary)) for s in (1, -1)) < 1e-7
    switches = [math.pi * 0.569, math.pi * (2 - 0.569)] if model is FORCED else [2.0]
    marks = [(at, None) for at in switches]
    marks += [(float(event.phase), event) for event in found.events]
    at, contact = 0.0, found.pattern[0]
    state = np.array([float(found.displacement), float(found.velocity)])
    lines = {1: model.flank_lines[0], -1: model.flank_lines[1]}
    for end, event in [*sorted(marks, key=lambda mark: mark[0]), (2.0 * math.pi, None)]:
        # Well within the arc, so that the stiffness is that of the arc at its ends too.
        middle = 0.5 * (at + end)

        def rate(t, z, middle=middle, at=at, end=end, contact=contact):
            low, high = at + 1e-9 * (middle - at), end - 1e-9 * (end - middle)
            a = acceleration(model, tuning, contact, min(max(t, low), high), *z)
            return z[1], a

        state = solve_ivp(rate, (at, end), state, "DOP853", rtol=1e-12, atol=1e-13).y[:, -1]
        at = end
        if event is not None:
            line = lines[1 if 1 in (event.before, event.after) else -1]
            assert abs(state[0] - line) < 1e-8 and event.before == contact
            contact = event.after
    # The solver's tolerance and a billionth of each arc.
    assert np.abs(state - orbit.state).max() < 1e-7
    assert extrema_apart(found, orbit) < 1e-9
    assert json.dumps(found.as_dict())


def test_a_pair_and_the_same_pair_as_a_larger_model():
    orbits = [
        gearlib.periodic_orbit(model, 0.815)
        for model in (MATERIAL, gearlib.OneDegreePair(pair=MATERIAL))
    ]
    one, two = (gearlib.certify(orbit) for orbit in orbits)
    # Ratios in balls, and rounded to floats.
    assert abs(float(one.displacement) - float(two.displacement)) < 1e-13
    assert one.pattern == two.pattern and one.stability == two.stability


def test_a_motion_of_a_dead_zone_oscillator():
    orbit = gearlib.periodic_orbit(STOP, 0.5)
    found = gearlib.certify_motion(orbit)
    assert found and found.periods < 40
    assert not gearlib.certify_motion(orbit, periods=1)


def unconfirmed(found):
    """Return what the second program does not find, of the numbers of the model's equation."""
    equation = found.pair.equation
    far, gap, near = equation.damping[:, 0].tolist()
    numbers = dict(ground=equation.ground, load=equation.load, far=far, gap=gap, near=near)
    numbers |= {"upper": equation.upper, "lower": equation.lower}
    sides = equation.far, equation.near
    claim = json.loads(json.dumps(found.as_dict())) | {
        "claim": "train",
        "equation": {
            "numbers": numbers,
            "force": equation.force.tolist(),
            "deviation": equation.deviation.tolist(),
            "steps": [
                list(zip(side.breaks[:-1].tolist(), side.lines[:, 0].tolist(), strict=True))
                for side in sides
            ],
        },
        "coordinates": ["x"],
        "fixed": [],
        "contacts": [found.pattern[0]],
    }
    for name in ("displacement", "velocity"):
        claim[name] = [claim[name]]
    wrong = faults(claim)
    for part in range(1, found.period):
        motion = Motion(claim | {"period": part})
        at = [sum(map(mpmath.mpf, claim[name][0])) / 2 for name in ("displacement", "velocity")]
        back, *_ = motion.run(at[:1], at[1:])
        wrong += [] if max(abs(a - b) for a, b in zip(back, at, strict=True)) > 1e-9 else ["period"]
    return wrong


COUNT = int(os.environ.get("GEARLIB_CERTIFICATES", "12"))
#: What a candidate may be that is not proven: it repeats earlier, or is not an isolated one.
ALLOWED = ("period", "fold", "grazing", "contacts", "distance")


def test_random_models_under_harmonics():
    proven = []
    for seed in range(COUNT):
        orbit = random_other_orbit(seed)
        if orbit is None:
            continue
        found = gearlib.certify(orbit)
        if not found:
            assert found.status in ALLOWED, (seed, found)
            continue
        proven.append(found)
        assert found.pattern == orbit.pattern
        assert unconfirmed(found) == [], seed
        for statuses, candidate in never_right(orbit, np.random.default_rng(seed)):
            refused = gearlib.certify(candidate)
            assert not refused and refused.status in statuses, (seed, refused)
    assert len(proven) >= 0.4 * COUNT
    assert sum(found.period > 1 for found in proven) >= 0.08 * COUNT


def test_a_dead_zone_without_a_contact_in_the_first_period():
    """Forced, so that the state at the start of a period depends on its phase."""
    free = replace(STOP, upper_edge=50.0, lower_edge=-50.0, ground_stiffness=0.3)
    once = gearlib.periodic_orbit(free, 0.8)
    assert gearlib.certify(once) and len(once.pattern) == 1
    for period in (2, 3):
        twice = gearlib.periodic_orbit(free, 0.8, period=period)
        refused = gearlib.certify(twice)
        assert refused.status == "period" and "after 1 mesh period already" in refused.message
