"""Certificates of other models of one degree of freedom, against the second code in 50 digits.

``GEARLIB_CERTIFICATES=1000`` takes more random models.
"""

import json
import os
from dataclasses import replace

import numpy as np
import pytest

import gearlib
from tests.independent.certificates import faults
from tests.paper import PAPER
from tests.proofs.candidates import extrema_apart, never_right, random_other_orbit

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


@pytest.mark.parametrize(
    "model, tuning", [(FORCED, 1.0), (FORCED, 0.7), (STOP, 0.5), (STOP, 0.8), (FREE, 0.6)]
)
def test_a_second_program_finds_the_orbit_in_its_box(model, tuning):
    orbit = gearlib.periodic_orbit(model, tuning, guess=(1.0, 0.0))
    found = gearlib.certify(orbit)
    assert found and found.pattern == orbit.pattern
    assert unconfirmed(found) == []
    assert extrema_apart(found, orbit) < 1e-9


def unconfirmed(found):
    """Return what the second program does not find, of the numbers of the model's equation."""
    equation = found.pair.equation
    far, gap, near = equation.damping[:, 0].tolist()
    model = {"kind": "DeadZoneOscillator", "load": equation.load, "damping": gap}
    model["ground_stiffness"] = equation.ground_stiffness
    for name, rows in (("forcing", equation.force), ("deviation", equation.deviation)):
        model[name] = {}
        for column, parts in enumerate(("cosines", "sines"), start=1):
            orders = range(1, int(rows[:, 0].max(initial=0)) + 1)
            model[name][parts] = [float(rows[rows[:, 0] == n, column].sum()) for n in orders]
    for name, side, edge, damping in (
        ("upper", equation.drive_stiffness, equation.upper, near),
        ("lower", equation.coast_stiffness, equation.lower, far),
    ):
        model[f"{name}_edge"], model[f"{name}_damping"] = edge, damping
        values = {"phase": side.breaks[:-1].tolist(), "stiffness": side.lines[:, 0].tolist()}
        model[f"{name}_stiffness"] = {"kind": "Steps", **values}
    return faults(json.loads(json.dumps(found.as_dict())) | {"pair": model})


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
        assert gearlib.periodic_orbit(free, 0.8, period=period).period == 1
        twice = replace(once, period=period)
        refused = gearlib.certify(twice)
        assert refused.status == "period" and "after 1 mesh period already" in refused.message
