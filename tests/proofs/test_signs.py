"""Arcs that touch a flank line, and contacts that are not listed, are noticed."""

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
from tests.proofs.claims import MATERIAL


def is_proven_free_of_grazing(load, x, w, t, *crossed, code=1):
    """Return whether an arc is proven not to touch the flank line x = 0 between its ends.

    The arc of x'' + x = load starts at the displacement x with the speed w and lasts for the time
    t. `crossed` holds two flags, for start and end, whether the line is crossed there. `code` is
    the contact state.
    """
    with precision(160) as arb:
        law = flint().arb_mat([[0, 1, 0], [-1, 0, load], [0, 0, 0]])
        start = flint().arb_mat([[x], [w], [1]])
        dynamics = SimpleNamespace(
            distance_rows=[[None, flint().arb_mat([[1, 0, 0]])]],
            model=SimpleNamespace(
                meshes=[SimpleNamespace(clearance_varies=False, has_backlash=True)]
            ),
            mesh_names=["mesh"],
        )
        marks = [(0, DRIVE_SIDE) if mark else None for mark in crossed or (False, False)]
        try:
            end = (law * arb(t)).exp() * start
            check_arc(dynamics, law, start, end, arb(t), [code], marks, 0.0)
        except ProofFailed as reason:
            assert reason.args[0] == "grazing"
            return False
        return True


@pytest.mark.parametrize(
    "lowest, proven", [(1e-9, True), (-1e-9, False), (0.0, False), (0.3, True)]
)
def test_a_dip_between_the_ends_is_noticed(lowest, proven):
    # The arc goes from its highest point over the lowest one to the next highest point.
    assert is_proven_free_of_grazing(1.0, 2.0 - lowest, 0.0, 2.0 * math.pi) == proven


def test_an_arc_that_starts_or_ends_on_the_flank_line_has_one_sign():
    """Only crossings marked at the ends, in the direction of the contact, are allowed."""
    # The arc starts on the line with speed 1 and returns to it after this time.
    return_time = 2.0 * math.pi - 2.0 * math.atan(1.0)
    assert is_proven_free_of_grazing(1.0, 0.0, 1.0, 0.5 * return_time, True, False)
    assert is_proven_free_of_grazing(1.0, 0.0, 1.0, return_time, True, True)
    assert not is_proven_free_of_grazing(1.0, 0.0, 1.0, 0.5 * return_time, False, False)
    assert not is_proven_free_of_grazing(1.0, 0.0, 1.0, 0.5 * return_time, True, False, code=0)
    assert not is_proven_free_of_grazing(1.0, 0.0, 1.0, return_time + 0.1, True, False)
    assert not is_proven_free_of_grazing(1.0, 0.0, -1.0, 0.5, True, False)
    # An arc that is at rest on the line does not cross it.
    assert not is_proven_free_of_grazing(1.0, 0.0, 0.0, 1.0, True, False)
    assert not is_proven_free_of_grazing(1.0, 0.0, 0.0, 2.0 * math.pi, True, True)
    assert not is_proven_free_of_grazing(0.0, 0.0, 0.0, 1.0, True, True)


def test_contacts_out_of_order_or_at_a_switch_are_noticed():
    """Move a phase across the next one, and turn or stop the velocity at a crossing."""
    orbit = gearlib.periodic_orbit(MATERIAL, 0.815)
    with precision(160):
        proof = orbits.Proof(orbit, *orbits.simulate_contacts(orbit))
        arcs, phases = proof.arcs, proof.path.phases(proof.phases)
        check_contacts(proof.path, arcs, proof.end_states, proof.phases)
        lost, gained = (i for i, node in enumerate(proof.path.nodes) if node.before != node.after)
        after = phases[lost + 1]
        for phase in (after, after + 0.1, phases[lost].union(after)):
            with pytest.raises(ProofFailed, match="cannot be separated"):
                check_contacts(proof.path, arcs, proof.end_states, [phase, *proof.phases[1:]])
        # The motion then crosses the line in the wrong direction, or rests on it.
        for node, factor in itertools.product((lost, gained), (-1, 0)):
            # The product with 1 copies the matrix.
            ends = [end * 1 for end in proof.end_states]
            ends[node][1, 0] *= factor
            with pytest.raises(ProofFailed, match="not proven to be a crossing"):
                check_contacts(proof.path, arcs, ends, proof.phases)
