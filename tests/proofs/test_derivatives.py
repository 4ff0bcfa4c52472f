"""A wrong derivative proves nothing: entries of the matrix in Krawczyk's test are changed."""

import itertools
from functools import cache

import numpy as np
import pytest

import gearlib
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
        return test_train_certificates.orbit_of(case)
    model, tuning, guess = CASES[case]
    return gearlib.periodic_orbit(model, tuning, guess=guess)


def change_derivative(monkeypatch, owner, row, column, change):
    """Let the method `equations` of a class return a matrix of which one entry is changed."""
    equations = owner.equations

    def changed_equations(*arguments, **options):
        residuals, derivatives, *others = equations(*arguments, **options)
        derivatives = [list(entries) for entries in derivatives]
        derivatives[row][column] += change
        return residuals, derivatives, *others

    monkeypatch.setattr(owner, "equations", changed_equations)


@pytest.mark.parametrize(
    "owner, case, size, count",
    [(Path, "two contacts", 4, 16), (Path, "stops", 4, 16), (Path, "idler", 8, 6),
     (Windows, "branches", 4, 2)],
)  # fmt: skip
def test_wrong_derivative_proves_no_orbit(monkeypatch, owner, case, size, count):
    """A change far below what Krawczyk's test would notice, and one as large as a missing term."""
    orbit, entries = orbit_of(case), list(itertools.product(range(size), repeat=2))
    for k in np.random.default_rng(size).choice(len(entries), count, replace=False):
        for change in (1e-9, 0.3):
            with monkeypatch.context() as patch:
                change_derivative(patch, owner, *entries[k], change)
                refused = gearlib.certify(orbit)
            assert not refused and (change > 0.1 or refused.status == "derivative"), refused


def test_wrong_derivative_proves_no_range(monkeypatch):
    orbit = orbit_of("two contacts")
    change_derivative(monkeypatch, Path, 2, 3, 1e-9)
    assert gearlib.certify_range(orbit, to=0.8151).status == "derivative"
