"""A wrong derivative proves nothing: each entry that Krawczyk's test is given is changed in turn.

So the enclosed derivatives are held against the equations in every proof, and those of the second
program are by dual numbers and differences.
"""

import itertools
from functools import cache

import numpy as np
import pytest

import gearlib
from gearlib.analysis.proofs import orbits
from gearlib.analysis.proofs.balls import precision
from gearlib.analysis.proofs.path import Path, Windows
from tests.paper import PAPER
from tests.proofs import test_train_certificates
from tests.proofs.test_other_models import STOP

MATERIAL = PAPER.replace(material_damping=3953.7)


#: Model, tuning, guess; the others are trains.
CASES = {"two contacts": (MATERIAL, 0.815, None), "stops": (STOP, 0.5, (1.0, 0.0))}


@cache
def orbit_of(case):
    if case not in CASES:
        return test_train_certificates.found(case)
    model, tuning, guess = CASES[case]
    return gearlib.periodic_orbit(model, tuning, guess=guess)


def test_derivatives_through_contacts_at_once():
    """Held against those in the order that was found: differences across windows say nothing."""
    orbit = orbit_of("branches")
    with precision(420):
        proof = orbits.Proof(orbit, *orbits.listed_contacts(orbit))
        windows = Windows(proof.path, proof.phases)
        assert windows.are_needed() and len(proof.phases) == 8
        n = proof.dynamics.state_count
        unknowns = [*(v.mid() for v in proof.box), *(p.mid() for p in proof.phases)]
        ordered = proof.path.monodromy(proof.path.equations(unknowns)[1])
        _, rows = windows.equations([v.mid() for v in proof.box])
        for i, j in itertools.product(range(n), repeat=2):
            assert abs(rows[i][j] + (i == j) - ordered[i, j]).mid() < 1e-13
            assert rows[i][j].rad() < 1e-13


def changed(place, by):
    """Return what changes an entry of the derivatives behind the residuals."""

    def change(found):
        residuals, rows, *others = found
        rows = [list(row) for row in rows]
        rows[place[0]][place[1]] += by
        return residuals, rows, *others

    return change


def refused(monkeypatch, owner, name, change, prove):
    """Return what is proven with other derivatives."""
    real = getattr(owner, name)
    with monkeypatch.context() as patch:
        patch.setattr(owner, name, lambda self, *given, **more: change(real(self, *given, **more)))
        return prove()


@pytest.mark.parametrize(
    "owner, case, size, count",
    [(Path, "two contacts", 4, 16), (Path, "stops", 4, 16), (Path, "idler", 8, 6),
     (Windows, "branches", 4, 2)],
)  # fmt: skip
def test_a_wrong_derivative_proves_no_orbit(monkeypatch, owner, case, size, count):
    """Far below what Krawczyk's test would notice, and as large as a missing term."""
    orbit, places = orbit_of(case), list(itertools.product(range(size), repeat=2))
    for k in np.random.default_rng(size).choice(len(places), count, replace=False):
        for by in (1e-9, 0.3):
            found = refused(
                monkeypatch, owner, "equations", changed(places[k], by),
                lambda: gearlib.certify(orbit),
            )  # fmt: skip
            assert not found and (by > 0.1 or found.status == "derivative"), (places[k], found)


def test_a_wrong_derivative_proves_no_range(monkeypatch):
    orbit = orbit_of("two contacts")
    found = refused(
        monkeypatch, Path, "equations", changed((2, 3), 1e-9),
        lambda: gearlib.certify_range(orbit, to=0.8151),
    )  # fmt: skip
    assert found.status == "derivative"
