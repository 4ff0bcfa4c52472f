"""Every enclosed derivative, entry by entry, against differences of the equations in 120 digits.

That the equations themselves are right is confirmed by the second program, which finds their zeros.
And a wrong derivative proves nothing: each entry that Krawczyk's test is given is changed in turn.
"""

import itertools
from functools import cache

import numpy as np
import pytest
from flint import arb, arb_mat

import gearlib
from gearlib.analysis.proofs import candidate, orbits, points, tongue_edges
from gearlib.analysis.proofs.balls import precision
from gearlib.analysis.proofs.closed_laws import ClosedLaw
from gearlib.analysis.proofs.path import Path
from gearlib.analysis.proofs.windows import Windows
from tests.paper import PAPER
from tests.proofs import test_points, test_train_certificates
from tests.proofs.test_other_models import FORCED, FREE, STOP

BITS = 400
#: Of a central difference, with an error of its square.
STEP, KNOWN = arb(2) ** -120, 1e-30
MATERIAL = PAPER.replace(material_damping=3953.7)
BOTH = MATERIAL.replace(backlash_damping=2000.0)


def pair(**ratios):
    return gearlib.GearPair.from_ratios(**{"contact_ratio": 1.6, "stiffness_ratio": 0.6} | ratios)


#: Model, tuning, guess, period: contacts on both sides, drag in the backlash, harmonics.
CASES = {
    "two contacts": (MATERIAL, 0.815, None, 1),
    "drag in the backlash": (BOTH, 0.815, None, 1),
    "inverse mesh": (pair(damping=0.02, backlash_damping=0.01, backlash=1.0), 0.7, None, 1),
    "two mesh periods": (pair(damping=0.03, backlash=4.0), 2.0, None, 2),
    "no backlash": (pair(damping=0.05, backlash=0.0), 0.95, None, 1),
    "over-damped": (pair(damping=1.4, backlash=3.0), 0.8, None, 1),
    "harmonics": (FORCED, 0.7, (1.0, 0.0), 1),
    "stops": (STOP, 0.5, (1.0, 0.0), 1),
    "stops, free flight": (FREE, 0.6, (1.0, 0.0), 1),
    "idler": None,
    "chain": None,
    "bearings": None,
}


@cache
def orbit_of(case):
    if CASES.get(case) is None:
        return test_train_certificates.found(case)
    model, tuning, guess, period = CASES[case]
    return gearlib.periodic_orbit(model, tuning, guess=guess, period=period)


def prove(orbit):
    return orbits.Proof(orbit, *candidate.listed_contacts(orbit))


def differences(function, u):
    """Return the derivatives of the values of a function, a row each, by central differences."""
    columns = []
    for i in range(len(u)):
        ends = [
            function([(v + sign * STEP * (i == j)).mid() for j, v in enumerate(u)])
            for sign in (1, -1)
        ]
        columns.append([((a - b) / (2 * STEP)).mid() for a, b in zip(*ends, strict=True)])
    return [list(row) for row in zip(*columns, strict=True)]


def wrong(rows, wanted, wide=KNOWN):
    """Return the places at which balls do not hold what is wanted, or are wider than `wide`."""
    assert [len(row) for row in rows] == [len(row) for row in wanted]
    return [
        (i, j)
        for i, (row, other) in enumerate(zip(rows, wanted, strict=True))
        for j, (ball, value) in enumerate(zip(row, other, strict=True))
        if not (arb(ball) - value).overlaps(arb(0, KNOWN)) or not arb(ball).rad() < wide
    ]


def in_boxes(function, rows_of, u, size, share=1e-2):
    """Return where the derivatives over a box do not hold those at a corner and within it."""
    rng, found = np.random.default_rng(4), []
    rows = rows_of([arb(v.mid(), 1.001 * size) for v in u])
    for signs in rng.choice([-1.0, 1.0, 0.37], (2, len(u))):
        place = [(v + size * s).mid() for v, s in zip(u, signs, strict=True)]
        found += wrong(rows, differences(function, place), share)
    return found


@pytest.mark.parametrize("case", CASES)
def test_derivatives_of_an_orbit(case):
    orbit = orbit_of(case)
    with precision(BITS):
        proof = prove(orbit)
        path, u, scale = proof.path, [v.mid() for v in proof.centre], proof.scale
        residuals = lambda u: path.equations(u, scale)[0]  # noqa: E731
        rows = path.equations(u, scale, BITS)[1]
        assert wrong(rows, differences(residuals, u)) == []
        # With few bits too, as Newton's method has them; without frames; over boxes.
        assert wrong(path.equations(u, scale)[1], rows, 1e-12) == []
        bare = Path(proof.laws, proof.codes, proof.contacts(), orbit.period, framed=False)
        residuals = lambda u: bare.equations(u, scale)[0]  # noqa: E731
        assert wrong(bare.equations(u, scale, BITS)[1], differences(residuals, u)) == []
        size = 1e-9 if proof.laws.framed else 1e-6
        boxed = lambda box: bare.equations(box, scale)[1]  # noqa: E731
        assert in_boxes(residuals, boxed, u, size) == []
        # The map of small deviations: by elimination, by saltation, its determinant by Liouville.
        arcs, ends = bare.states(u, scale)
        matrix = bare.deviations(arcs, ends)
        assert wrong(matrix.tolist(), path.monodromy(rows).tolist()) == []
        assert abs(matrix.det() - bare.determinant([t for _, t in arcs])).mid() < KNOWN
        if not proof.laws.tuned:
            check_tuning(bare, [*u, scale.mid()])


def check_tuning(path, u):
    """Check derivatives by 1 / nu too, and those along a direction."""
    residuals = lambda u: path.equations(u)[0]  # noqa: E731
    rows = path.equations(u, bits=BITS)[1]
    assert wrong(rows, differences(residuals, u)) == []
    way = [arb(0.3 + 0.1 * k * (-1) ** k) for k in range(len(u) - 1)]

    def along(u):
        _, rows = path.equations(u, bits=BITS)
        return [sum((a * b for a, b in zip(row, way, strict=False)), arb(0)) for row in rows]

    *_, bends = path.equations(u, bits=BITS, direction=way)
    assert wrong(bends, differences(along, u)) == []


@cache
def special(label):
    """Return the model, the equations and the start of a fold, a doubling or a grazing."""
    found = []
    with pytest.MonkeyPatch.context() as patch:
        enclosed = points.enclosed_zero

        def spied(system, start):
            found.append((system, start))
            return enclosed(system, start)

        patch.setattr(points, "enclosed_zero", spied)
        given = next(test_points.points(label))
        prove = gearlib.certify_grazing if label == "grazing" else gearlib.certify_fold
        # So many that differences are known.
        assert prove(*given, digits=100)
    return found[0]


@pytest.mark.parametrize("label", ["fold", "period doubling", "grazing"])
def test_derivatives_of_a_special_point(label):
    system, start = special(label)
    with precision(BITS):
        u = [v.mid() for v in start]
        slopes = differences(lambda u: system(u)[0], u)
        # Few bits of derivatives suffice.
        assert wrong(system(u)[1], slopes, 1e-12) == []
        assert in_boxes(lambda u: system(u)[0], lambda u: system(u)[1], u, 1e-7) == []


@pytest.mark.parametrize("case", ["two contacts", "parametric resonance"])
def test_derivatives_of_a_tongue(case):
    model, sign = orbit_of(case).pair, -1
    with precision(BITS):
        laws = candidate.laws_of(model, 1.0)
        path = Path(laws, [1] * len(laws.mesh_names), [], 1, framed=False)

        def excess(u):
            return tongue_edges._determinant(*path.without_contacts(u[0]), sign)

        for scale in (0.6, 1.7):
            u = [arb(scale)]
            assert wrong([[excess(u)[1]]], differences(lambda u: excess(u)[:1], u)) == []


@pytest.mark.parametrize("stiffness, damping", [(1.3, 0.1), (0.5, 1.1), (1, 1), (0, 0.2), (0, 0)])
@pytest.mark.parametrize("rows", [[], [(1, 0.3, -0.2), (3, 0.1, 0.4)]])
def test_derivatives_of_the_laws(stiffness, damping, rows):
    """The motion solves z' = A z: by this all signs and extrema are proven."""
    with precision(BITS):
        rows = [(n, arb(a), arb(b)) for n, a, b in rows]
        law = ClosedLaw(stiffness, damping, 0.7, rows, arb(0.8))
        z = arb_mat([[0.3], [-0.6], [1]] + [[arb(k).cos()] for k in range(2 * len(rows))])

        def motion(u):
            there = arb_mat([[u[0]], [u[1]], *z.tolist()[2:]])
            return law.go(there, u[2]).entries()

        u = [arb(0.3), arb(-0.6), arb(1.9)]
        end = law.go(z, u[2])
        slopes = arb_mat(differences(motion, u)).tolist()
        assert wrong((law.matrix * end).tolist(), [row[2:] for row in slopes]) == []
        flow = law.flow(u[2]).tolist()
        assert wrong([row[:2] for row in flow], [row[:2] for row in slopes]) == []
        assert law.go(z, arb(0)).entries()[0].overlaps(z[0, 0])


def test_derivatives_through_contacts_at_once():
    """Held against those in the order that was found: differences across windows say nothing."""
    orbit = orbit_of("branches")
    with precision(420):
        proof = prove(orbit)
        windows = Windows(proof.path, proof.codes, proof.phases)
        assert windows.any() and len(proof.phases) == 8
        n = 2 * len(proof.laws.kept)
        unknowns = [*(v.mid() for v in proof.box), *(p.mid() for p in proof.phases)]
        ordered = proof.path.monodromy(proof.path.equations(unknowns, proof.scale, 420)[1])
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


@pytest.mark.parametrize("label", ["fold", "grazing"])
def test_a_wrong_derivative_proves_no_special_point(monkeypatch, label):
    given, size = next(test_points.points(label)), len(special(label)[1])
    prove = gearlib.certify_grazing if label == "grazing" else gearlib.certify_fold
    owner, name = (Path, "equations") if label == "grazing" else (points._Bordered, "__call__")
    places = list(itertools.product(range(size), repeat=2))
    for k in np.random.default_rng(size).choice(len(places), 8, replace=False):
        found = refused(monkeypatch, owner, name, changed(places[k], 1e-9), lambda: prove(*given))
        assert not found and found.status == "derivative", (places[k], found)


def test_a_wrong_derivative_proves_no_tongue_no_range_and_no_motion(monkeypatch):
    def steeper(found):
        return found[0], found[1] * (1 + arb(1e-9))

    tongues = refused(
        monkeypatch, Path, "without_contacts", steeper,
        lambda: gearlib.certify_tongues(PAPER, start=0.6, stop=0.9),
    )  # fmt: skip
    assert tongues and all(not one and one.status == "derivative" for one in tongues)
    orbit = orbit_of("two contacts")
    for prove in (
        lambda: gearlib.certify_range(orbit, to=0.8151),
        lambda: gearlib.certify_motion(orbit),
    ):
        found = refused(monkeypatch, Path, "equations", changed((2, 3), 1e-9), prove)
        assert found.status == "derivative"
