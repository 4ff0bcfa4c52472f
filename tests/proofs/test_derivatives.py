"""Proofs notice wrong derivatives: entries of the matrix in Krawczyk's test are changed."""

import numpy as np
import pytest

import gearlib
from gearlib.analysis.proofs.path import Path, Windows
from tests.proofs.claims import PAIR_DAMPED_IN_CONTACT, STOP_OSCILLATOR
from tests.proofs.test_train_certificates import orbit_of

ORBITS = {
    "two contacts": lambda: gearlib.periodic_orbit(PAIR_DAMPED_IN_CONTACT, 0.815),
    "stops": lambda: gearlib.periodic_orbit(STOP_OSCILLATOR, 0.5, guess=(1.0, 0.0)),
    "idler": lambda: orbit_of("idler"),
    "branches": lambda: orbit_of("branches"),
}


def change_derivative(monkeypatch, owner, row, column, change):
    """Add `change` to one entry of the derivatives that `owner.equations` returns."""
    equations = owner.equations

    def changed_equations(*arguments, **options):
        """Return the residuals and the changed derivatives."""
        residuals, derivatives, *others = equations(*arguments, **options)
        derivatives = [list(entries) for entries in derivatives]
        derivatives[row][column] += change
        return residuals, derivatives, *others

    monkeypatch.setattr(owner, "equations", changed_equations)


# The matrix has `size` rows and columns, of which `count` random entries are changed in turn.
@pytest.mark.parametrize(
    "owner, case, size, count",
    [(Path, "two contacts", 4, 16), (Path, "stops", 4, 16), (Path, "idler", 8, 6),
     (Windows, "branches", 4, 2)],
)  # fmt: skip
def test_an_orbit_is_not_certified_with_a_wrong_derivative(monkeypatch, owner, case, size, count):
    """A derivative that is wrong by 1e-9 or 0.3 must be noticed, as it invalidates the proof.

    Krawczyk's test alone would accept the small error; the large one is as large as a missing term.
    """
    orbit, entries = ORBITS[case](), list(np.ndindex(size, size))
    for entry in np.random.default_rng(size).choice(len(entries), count, replace=False):
        for change in (1e-9, 0.3):
            with monkeypatch.context() as patch:
                change_derivative(patch, owner, *entries[entry], change)
                refusal = gearlib.certify(orbit)
            assert not refusal, (entries[entry], change)
            # A large error may also be refused for another reason.
            assert refusal.status == "derivative" or change > 0.1, refusal


def test_a_range_is_not_certified_with_a_wrong_derivative(monkeypatch):
    orbit = ORBITS["two contacts"]()
    change_derivative(monkeypatch, Path, 2, 3, 1e-9)
    assert gearlib.certify_range(orbit, to=0.8151).status == "derivative"
