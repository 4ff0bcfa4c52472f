"""Arcs that touch a flank line, and contacts that are not listed, are noticed."""

import itertools
import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.linalg import expm

import gearlib
from gearlib.analysis.proofs import orbits
from gearlib.analysis.proofs.balls import flint, precision
from gearlib.analysis.proofs.certificate_files import ProofFailed
from gearlib.analysis.proofs.models_in_balls import DRIVE
from gearlib.analysis.proofs.signs import check_arc, check_contacts
from tests.paper import PAPER

MATERIAL = PAPER.replace(material_damping=3953.7)


def is_proven_free_of_grazing(coefficients, x, w, t, *crossed, code=1, line=0.0):
    """Return whether an arc is proven to touch no flank line between its ends.

    The arc of x'' + 2 damping x' + stiffness x = load, `coefficients` (stiffness, damping, load),
    begins at the displacement x with the speed w and takes the time t. `crossed` are two flags, for
    its begin and its end, whether the line x = `line` is crossed there; `code` is its contact code.
    """
    with precision(160) as arb:
        stiffness, damping, load = coefficients
        matrix = [[0, 1, 0], [-stiffness, -2.0 * damping, load], [0, 0, 0]]
        law = flint().arb_mat(matrix)
        start = flint().arb_mat([[x], [w], [1]])
        mesh = SimpleNamespace(clearance_varies=False, has_backlash=True)
        dynamics = SimpleNamespace(
            distance_rows=[[None, flint().arb_mat([[1, 0, -line]])]],
            model=SimpleNamespace(meshes=[mesh]),
            mesh_names=["mesh"],
        )
        marks = [(0, DRIVE) if mark else None for mark in crossed or (False, False)]
        try:
            end = (law * arb(t)).exp() * start
            check_arc(dynamics, law, start, end, arb(t), [code], marks, 0.0)
        except ProofFailed as reason:
            assert reason.args[0] == "grazing"
            return False
        return True


#: Undamped contact about the rest position 1, of stiffness 1.
LINEAR = 1.0, 0.0, 1.0


@pytest.mark.parametrize(
    "lowest, proven", [(1e-9, True), (-1e-9, False), (0.0, False), (0.3, True)]
)
def test_dip_between_the_ends(lowest, proven):
    # From the highest point over the lowest to the next highest point.
    assert is_proven_free_of_grazing(LINEAR, 2.0 - lowest, 0.0, 2.0 * math.pi) == proven


def test_arc_that_starts_or_ends_on_the_line():
    # From the line with speed 1 to the line again, over the top.
    back = 2.0 * math.pi - 2.0 * math.atan(1.0)
    assert is_proven_free_of_grazing(LINEAR, 0.0, 1.0, 0.5 * back, True, False)
    assert is_proven_free_of_grazing(LINEAR, 0.0, 1.0, back, True, True)
    assert not is_proven_free_of_grazing(LINEAR, 0.0, 1.0, 0.5 * back, False, False)
    assert not is_proven_free_of_grazing(LINEAR, 0.0, 1.0, 0.5 * back, True, False, code=0)
    assert not is_proven_free_of_grazing(LINEAR, 0.0, 1.0, back + 0.1, True, False)
    assert not is_proven_free_of_grazing(LINEAR, 0.0, -1.0, 0.5, True, False)
    # At rest on the line, which is no crossing.
    assert not is_proven_free_of_grazing(LINEAR, 0.0, 0.0, 1.0, True, False)
    assert not is_proven_free_of_grazing(LINEAR, 0.0, 0.0, 2.0 * math.pi, True, True)
    assert not is_proven_free_of_grazing((1.0, 0.0, 0.0), 0.0, 0.0, 1.0, True, True)


@pytest.mark.parametrize("damping", [0.0, 0.1])
def test_arc_that_nearly_reaches_the_coast_side(damping):
    # Down from x = 0 with speed 1: the lowest point, in closed form.
    depth = 0.5
    if damping:
        rate = 2.0 * damping
        depth = 1.0 / rate - math.log1p(rate) / rate**2
    for line, proven in ((-depth - 1e-10, True), (-depth + 1e-10, False)):
        assert is_proven_free_of_grazing((0.0, damping, 1.0), 0.0, -1.0, 1.5, line=line) == proven


def state_without_contact_loss(pair, tuning):
    """Return the state at tau = 0 of the orbit without loss of contact, by matrix exponentials."""
    max_stiffness = pair.max_stiffness / pair.mean_stiffness
    half = math.pi * (pair.contact_ratio - 1.0)
    begin, total = (max_stiffness, half), np.eye(3)
    middle = pair.stiffness_ratio * max_stiffness, 2 * (math.pi - half)
    for stiffness, length in (begin, middle, begin):
        law = np.array([[0, 1, 0], [-stiffness, -2 * pair.damping_ratio, 1], [0, 0, 0]])
        total = expm(law * length / tuning) @ total
    displacement, speed = np.linalg.solve(np.eye(2) - total[:2, :2], total[:2, 2])
    return np.array([displacement, speed / tuning])


def test_contact_loss_that_is_not_listed_is_noticed(monkeypatch):
    """The orbit of the linear mesh is a zero of the equations without contacts, but no motion."""
    monkeypatch.setattr(orbits, "simulated_contacts", lambda _: ([1], []))
    for tuning, proven in ((0.802, True), (0.803, False)):
        orbit = gearlib.periodic_orbit(MATERIAL, 0.79, guess=(0.5, 0.0))
        state = state_without_contact_loss(MATERIAL, tuning)
        certificate = gearlib.certify(replace(orbit, tuning=tuning, state=state))
        # The flank is touched at 0.80205.
        assert bool(certificate) == proven
        assert proven or certificate.status == "grazing"


def test_contacts_out_of_order_or_at_a_switch_are_noticed():
    orbit = gearlib.periodic_orbit(MATERIAL, 0.815)
    with precision(160):
        proof = orbits.Proof(orbit, *orbits.simulated_contacts(orbit))
        arcs, phases = proof.arcs, proof.path.phases(proof.phases)
        check_contacts(proof.path, arcs, proof.ends, proof.phases)
        lost, gained = (i for i, node in enumerate(proof.path.nodes) if node.before != node.after)
        after = phases[lost + 1]
        for phase in (after, after + 0.1, phases[lost].union(after)):
            with pytest.raises(ProofFailed, match="cannot be told apart"):
                check_contacts(proof.path, arcs, proof.ends, [phase, *proof.phases[1:]])
        # Up through the line where contact is said to be lost, down where gained, or to rest on it.
        for node, factor in itertools.product((lost, gained), (-1, 0)):
            # The product copies a matrix.
            ends = [end * 1 for end in proof.ends]
            ends[node][1, 0] *= factor
            with pytest.raises(ProofFailed, match="not proven to be a crossing"):
                check_contacts(proof.path, arcs, ends, proof.phases)
