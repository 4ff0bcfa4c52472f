"""A wrong derivative proves nothing: entries of the matrix in Krawczyk's test are changed."""

import numpy as np
import pytest

import gearlib
from gearlib.analysis.proofs.path import Path, Windows
from tests.proofs.claims import MATERIAL, STOP
from tests.proofs.test_train_certificates import orbit_of

ORBITS = {
    "two contacts": lambda: gearlib.periodic_orbit(MATERIAL, 0.815),
    "stops": lambda: gearlib.periodic_orbit(STOP, 0.5, guess=(1.0, 0.0)),
    "idler": lambda: orbit_of("idler"),
    "branches": lambda: orbit_of("branches"),
}


def change_derivative(monkeypatch, owner, row, column, change):
    """Make the method `equations` of a class return a matrix with one entry changed."""
    equations = owner.equations

    def changed_equations(*arguments, **options):
        """Return the equations with one entry of the derivatives changed."""
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
    """A change must be noticed whether far below Krawczyk's test or as large as a missing term."""
    orbit, entries = ORBITS[case](), list(np.ndindex(size, size))
    for entry in np.random.default_rng(size).choice(len(entries), count, replace=False):
        for change in (1e-9, 0.3):
            with monkeypatch.context() as patch:
                change_derivative(patch, owner, *entries[entry], change)
                refused = gearlib.certify(orbit)
            assert not refused and (change > 0.1 or refused.status == "derivative"), refused


def test_wrong_derivative_proves_no_range(monkeypatch):
    orbit = ORBITS["two contacts"]()
    change_derivative(monkeypatch, Path, 2, 3, 1e-9)
    assert gearlib.certify_range(orbit, to=0.8151).status == "derivative"
