"""Orbits and claims that several tests of proofs share, and candidates that are wrong."""

import json
from dataclasses import replace

import gearlib
from tests.paper import PAPER_PAIR

MATERIAL = PAPER_PAIR.replace(material_damping=3953.7)
#: An oscillator with stepwise stiffness, a harmonic force and unequal sides.
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


def claim_of(certificate):
    """Return the claim of a certificate as its JSON file contains it."""
    assert certificate, certificate
    return json.loads(json.dumps(certificate.as_dict()))


def assert_wrong_candidates_are_refused(orbit, shift):
    """Assert that candidates without an orbit nearby are refused, one of them moved by `shift`."""
    double_period, has_events = (
        2 * orbit.period,
        len(orbit.pattern) > max(1, len(orbit.model.mesh_names)),
    )
    candidates = [
        (("distance", "contacts", "fold"), {"state": orbit.state + shift}),
        (("period", "contacts"), {"period": double_period}),
        (("contacts",), {"pattern": (*orbit.pattern, 0, 1)}),
    ]
    if has_events:
        candidates += [
            (("contacts",), {"pattern": orbit.pattern[:-2]}),
            (
                ("period",),
                {"period": double_period, "pattern": (*orbit.pattern, *orbit.pattern[1:])},
            ),
        ]
    for statuses, change in candidates:
        refused = gearlib.certify(replace(orbit, **change), digits=10)
        assert not refused and refused.status in statuses, (change, refused)
