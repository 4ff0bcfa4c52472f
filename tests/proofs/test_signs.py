"""Proofs notice arcs that touch a flank line and contacts that are not listed."""

import itertools
import math
from types import SimpleNamespace

import pytest

import gearlib
from gearlib.analysis.proofs import orbits
from gearlib.analysis.proofs.balls import flint, precision
from gearlib.analysis.proofs.certificate_files import ProofFailed
from gearlib.analysis.proofs.models_in_balls import DRIVE_SIDE
from gearlib.analysis.proofs.signs import check_arc, check_contacts
from tests.proofs.claims import PAIR_DAMPED_IN_CONTACT


def is_proven_free_of_grazing(
    load, x, v, duration, crosses_at_start=False, crosses_at_end=False, contact_state=1
):
    """Return whether an arc is proven not to touch the flank line x = 0 between its ends.

    The arc is the solution of x'' + x = load from displacement `x` and velocity `v` for the time
    `duration`. `crosses_at_start` and `crosses_at_end` say whether it crosses the line there.
    """
    with precision(160) as arb:
        # The state is (x, v, 1), so that the constant load is part of the state matrix.
        state_matrix = flint().arb_mat([[0, 1, 0], [-1, 0, load], [0, 0, 0]])
        start = flint().arb_mat([[x], [v], [1]])
        dynamics = SimpleNamespace(
            distance_rows=[[None, flint().arb_mat([[1, 0, 0]])]],
            model=SimpleNamespace(
                meshes=[SimpleNamespace(clearance_varies=False, has_backlash=True)]
            ),
            mesh_names=["mesh"],
        )
        crossings = [
            (0, DRIVE_SIDE) if crosses else None for crosses in (crosses_at_start, crosses_at_end)
        ]
        try:
            end = (state_matrix * arb(duration)).exp() * start
            check_arc(
                dynamics, state_matrix, start, end, arb(duration), [contact_state], crossings, 0.0
            )
        except ProofFailed as error:
            assert error.args[0] == "grazing"
            return False
        return True


@pytest.mark.parametrize(
    "minimum, proven", [(1e-9, True), (-1e-9, False), (0.0, False), (0.3, True)]
)
def test_a_minimum_between_the_ends_is_noticed(minimum, proven):
    # The arc is a full oscillation about x = 1 from its maximum to the next one.
    assert is_proven_free_of_grazing(1.0, 2.0 - minimum, 0.0, 2.0 * math.pi) == proven


def test_an_arc_may_cross_the_flank_line_only_at_its_ends():
    """An arc may touch the line only where it crosses it, in the direction of its contact state."""
    # For load 1 the arc from x = 0 with velocity 1 returns to x = 0 after this time.
    return_time = 2.0 * math.pi - 2.0 * math.atan(1.0)
    assert is_proven_free_of_grazing(1.0, 0.0, 1.0, 0.5 * return_time, True, False)
    assert is_proven_free_of_grazing(1.0, 0.0, 1.0, return_time, True, True)
    assert not is_proven_free_of_grazing(1.0, 0.0, 1.0, 0.5 * return_time, False, False)
    assert not is_proven_free_of_grazing(
        1.0, 0.0, 1.0, 0.5 * return_time, True, False, contact_state=0
    )
    assert not is_proven_free_of_grazing(1.0, 0.0, 1.0, return_time + 0.1, True, False)
    assert not is_proven_free_of_grazing(1.0, 0.0, -1.0, 0.5, True, False)
    # An arc from rest on the line does not cross it.
    assert not is_proven_free_of_grazing(1.0, 0.0, 0.0, 1.0, True, False)
    assert not is_proven_free_of_grazing(1.0, 0.0, 0.0, 2.0 * math.pi, True, True)
    assert not is_proven_free_of_grazing(0.0, 0.0, 0.0, 1.0, True, True)


def test_unordered_events_and_wrong_crossings_are_noticed():
    """The check must fail if an event phase passes the next one or the velocity is wrong there."""
    orbit = gearlib.periodic_orbit(PAIR_DAMPED_IN_CONTACT, 0.815)
    with precision(160):
        proof = orbits.Proof(orbit, *orbits.simulate_contacts(orbit))
        arcs, phases = proof.arcs, proof.path.phases(proof.phases)
        check_contacts(proof.path, arcs, proof.end_states, proof.phases)
        loss, gain = (i for i, node in enumerate(proof.path.nodes) if node.before != node.after)
        next_phase = phases[loss + 1]
        for phase in (next_phase, next_phase + 0.1, phases[loss].union(next_phase)):
            with pytest.raises(ProofFailed, match="cannot be separated"):
                check_contacts(proof.path, arcs, proof.end_states, [phase, *proof.phases[1:]])
        # With these factors of the velocity the motion crosses the line in the wrong direction, or
        # rests on it.
        for node, factor in itertools.product((loss, gain), (-1, 0)):
            end_states = [state * 1 for state in proof.end_states]  # the product is a copy
            velocity = 1, 0
            end_states[node][velocity] *= factor
            with pytest.raises(ProofFailed, match="not proven to be a crossing"):
                check_contacts(proof.path, arcs, end_states, proof.phases)
