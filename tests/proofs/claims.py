"""Models, claims and wrong orbits that several tests of proofs use."""

import json
from dataclasses import replace

import gearlib
from tests.paper import PAPER_PAIR

#: The paper's pair with its damping coefficient k1 in contact, N s/m.
PAIR_DAMPED_IN_CONTACT = PAPER_PAIR.replace(material_damping=3953.7)
#: An oscillator with stepwise stiffness, a harmonic force and unequal sides.
STOP_OSCILLATOR = gearlib.DeadZoneOscillator(
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


def json_claim(certificate):
    """Return the claim of a certificate as it is read from a JSON file."""
    assert certificate, certificate
    return json.loads(json.dumps(certificate.as_dict()))


def assert_wrong_orbits_are_refused(orbit, state_change):
    """Assert that wrong changes of a certified orbit are refused for one of the right reasons.

    `state_change` is added to the state; the other changes are a doubled period and contact
    patterns with too many or too few events.
    """
    double_period = 2 * orbit.period
    wrong_orbits = [
        (("distance", "contacts", "fold"), {"state": orbit.state + state_change}),
        (("period", "contacts"), {"period": double_period}),
        (("contacts",), {"pattern": (*orbit.pattern, 0, 1)}),
    ]
    # The pattern has the initial contact state of each mesh, followed by the states after events.
    has_events = len(orbit.pattern) > max(1, len(orbit.model.mesh_names))
    if has_events:
        repeated_pattern = (*orbit.pattern, *orbit.pattern[1:])
        wrong_orbits += [
            (("contacts",), {"pattern": orbit.pattern[:-2]}),
            (("period",), {"period": double_period, "pattern": repeated_pattern}),
        ]
    for allowed_statuses, changes in wrong_orbits:
        refusal = gearlib.certify(replace(orbit, **changes), digits=10)
        assert not refusal and refusal.status in allowed_statuses, (changes, refusal)
