"""Certificates of other models of one degree of freedom, against orbits in 50 digits."""

import json
from dataclasses import replace

import pytest

import gearlib
from tests.independent.certificates import faults
from tests.paper import PAPER
from tests.proofs.candidates import difference_of_extrema

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


def faults_of(certificate):
    """Return the claims of a certificate that an orbit in 50 digits contradicts.

    The orbit is that of a `DeadZoneOscillator` with the numbers of the model's equation.
    """
    equation = certificate.pair.equation
    coast_damping, gap_damping, drive_damping = equation.damping[:, 0].tolist()
    model = {"kind": "DeadZoneOscillator", "load": equation.load, "damping": gap_damping}
    model["ground_stiffness"] = equation.ground_stiffness
    for name, rows in (("forcing", equation.force), ("deviation", equation.deviation)):
        model[name] = {}
        for column, parts in enumerate(("cosines", "sines"), start=1):
            orders = range(1, int(rows[:, 0].max(initial=0)) + 1)
            model[name][parts] = [float(rows[rows[:, 0] == n, column].sum()) for n in orders]
    for name, side, edge, damping in (
        ("upper", equation.drive_stiffness, equation.upper, drive_damping),
        ("lower", equation.coast_stiffness, equation.lower, coast_damping),
    ):
        model[f"{name}_edge"], model[f"{name}_damping"] = edge, damping
        values = {"phase": side.breaks[:-1].tolist(), "stiffness": side.lines[:, 0].tolist()}
        model[f"{name}_stiffness"] = {"kind": "Steps", **values}
    return faults(json.loads(json.dumps(certificate.as_dict())) | {"pair": model})


@pytest.mark.parametrize(
    "model, tuning", [(FORCED, 1.0), (FORCED, 0.7), (STOP, 0.5), (STOP, 0.8), (FREE, 0.6)]
)
def test_orbit_in_50_digits_lies_in_its_enclosures(model, tuning):
    orbit = gearlib.periodic_orbit(model, tuning, guess=(1.0, 0.0))
    proven = gearlib.certify(orbit)
    assert proven and proven.pattern == orbit.pattern
    assert faults_of(proven) == []
    assert difference_of_extrema(proven, orbit) < 1e-9


def test_orbit_that_repeats_earlier_is_refused():
    """A forced orbit without contact: the state at the start of a period depends on its phase."""
    free = replace(STOP, upper_edge=50.0, lower_edge=-50.0, ground_stiffness=0.3)
    once = gearlib.periodic_orbit(free, 0.8)
    assert gearlib.certify(once) and len(once.pattern) == 1
    for period in (2, 3):
        assert gearlib.periodic_orbit(free, 0.8, period=period).period == 1
        refused = gearlib.certify(replace(once, period=period))
        assert refused.status == "period" and "after 1 mesh period already" in refused.message
