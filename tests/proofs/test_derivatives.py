"""Every enclosed derivative, entry by entry, against differences in 70 digits of a second code.

And a wrong one proves nothing: each entry that Krawczyk's test is given is changed in turn.
"""

import itertools
from functools import cache

import mpmath
import numpy as np
import pytest
from flint import arb
from mpmath import mp, mpf

import gearlib
from gearlib.analysis.proofs import orbits, points
from gearlib.analysis.proofs.balls import precision
from gearlib.analysis.proofs.laws import Elastic, Flight, Forced, Laws
from gearlib.analysis.proofs.path import TOUCH, Path
from gearlib.analysis.proofs.trains.laws import TrainLaws
from gearlib.analysis.proofs.trains.orbits import TrainProof, listed_contacts
from gearlib.analysis.proofs.trains.path import TrainPath
from gearlib.analysis.proofs.trains.windows import Windows
from tests.paper import PAPER
from tests.proofs import test_points, test_train_certificates
from tests.proofs.differences import (
    DIGITS,
    KNOWN,
    Orbit,
    TrainOrbit,
    differences,
    eliminated,
    flow,
    of_equation,
    of_pair,
)
from tests.proofs.test_other_models import FORCED, FREE, STOP

#: More than the digits of the differences.
BITS = 240
#: Radius of what follows from exact numbers.
NARROW = mpf(10) ** -25
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
}


@cache
def orbit_of(case):
    model, tuning, guess, period = CASES[case]
    return gearlib.periodic_orbit(model, tuning, guess=guess, period=period)


def exact(ball):
    """Return the exact midpoint of a ball in the digits of mpmath."""
    mantissa, exponent = ball.mid().man_exp()
    return mpf(int(mantissa)) * mpf(2) ** int(exponent)


def holds(ball, value, wide=NARROW):
    """Return whether a ball holds a value, as far as that is known, and is narrow."""
    radius = exact(arb(ball).rad())
    return abs(exact(arb(ball)) - value) <= radius + KNOWN * max(1, abs(value)) and radius < wide


def wrong(rows, wanted, wide=NARROW):
    """Return the places of entries that do not hold the wanted ones."""
    assert [len(row) for row in rows] == [len(row) for row in wanted]
    return [
        (i, j)
        for i, (row, other) in enumerate(zip(rows, wanted, strict=True))
        for j, (ball, value) in enumerate(zip(row, other, strict=True))
        if not holds(ball, value, wide)
    ]


def numbers(model):
    return of_pair(model) if model.mesh is model else of_equation(model.equation)


def second(path, model):
    """Return the `Orbit` of the second code with the contacts of a path."""
    guess, changes = iter(path.guess), []
    for node in path.nodes:
        if node.phase is None:
            after = None if node.kind == TOUCH else node.after
            changes.append((exact(next(guess)), after))
    period = round(float(path.nodes[-1].phase - path.start) / (2.0 * np.pi))
    start = mp.pi if path.start > 0 else 0
    return Orbit(numbers(model), path.contact, changes, period, start)


def prove(orbit):
    return orbits.Proof(orbit, *orbits.listed_contacts(orbit))


def moved(centre, size):
    """Return balls about numbers, and corners and an inner place of theirs in mpmath."""
    rng = np.random.default_rng(4)
    places = [[exact(c) + mpf(size) * s for c, s in zip(centre, signs, strict=True)]
              for signs in rng.choice([-1.0, 1.0, 0.37], (1, len(centre)))]  # fmt: skip
    return [arb(c.mid(), 1.001 * size) for c in centre], places


@pytest.mark.parametrize("case", CASES)
def test_derivatives_of_an_orbit(case):
    model, tuning, *_ = CASES[case]
    with mpmath.workdps(DIGITS), precision(BITS):
        proof = prove(orbit_of(case))
        path, centre = proof.path, [value.mid() for value in proof.centre]
        other, scale = second(path, model), 1 / mpf(tuning)
        u = [exact(value) for value in centre]
        residuals, rows = path.equations(centre, proof.scale)
        function = lambda u: other.equations(u, scale)  # noqa: E731
        assert wrong([residuals], [function(u)]) == []
        slopes = differences(function, u)
        assert wrong(rows, slopes) == []
        # In a box, at its corners and within; no wider than its derivatives change, by far.
        box, places = moved(centre, 1e-6)
        _, wide = path.equations(box, proof.scale)
        for place in places:
            assert wrong(wide, differences(function, place), mpf(10) ** -2) == []
        # The map of small deviations, by saltation and by elimination of the phases.
        matrix, determinant = path.monodromy([t for *_, t in proof.states])
        m = eliminated(slopes, 2)
        assert wrong([matrix], [[m[0, 0], m[0, 1], m[1, 0], m[1, 1]]]) == []
        assert holds(determinant, m[0, 0] * m[1, 1] - m[0, 1] * m[1, 0])
        if model.mesh is model:
            tuned = [*centre, (1 / arb(tuning)).mid()]
            u = [exact(value) for value in tuned]
            assert wrong(path.equations(tuned)[1], differences(other.equations, u)) == []
            check_invariants(path, other, tuned)


def check_invariants(path, other, tuned):
    """Hold trace and determinant, and their derivatives, against the second code."""
    u = [exact(value) for value in tuned]
    trace, determinant, *slopes = path.trace(tuned)
    assert wrong([[trace, determinant]], [other.invariants(u)]) == []
    assert wrong(slopes, differences(other.invariants, u)) == []
    box, places = moved(tuned, 1e-6)
    _, _, *slopes = path.trace(box)
    for place in places:
        assert wrong(slopes, differences(other.invariants, place), mpf(10) ** -2) == []


@cache
def special(label):
    """Return (path, place) of a fold, a doubling or a grazing that is proven."""
    found = []
    with pytest.MonkeyPatch.context() as patch:
        enclosed = points._enclosed

        def spied(system, start):
            found.append((system, start))
            return enclosed(system, start)

        patch.setattr(points, "_enclosed", spied)
        given = next(test_points.points(label))
        prove = gearlib.certify_grazing if label == "grazing" else gearlib.certify_fold
        assert prove(*given)
    system, start = found[0]
    path = next(c.cell_contents for c in system.__closure__ if isinstance(c.cell_contents, Path))
    return given[0], path, system, start


@pytest.mark.parametrize("label", ["fold", "period doubling", "grazing"])
def test_derivatives_of_a_special_point(label):
    with mpmath.workdps(DIGITS), precision(BITS):
        model, old, _, start = special(label)
        # Once more with these bits.
        events, contact, guess = [], old.contact, iter(old.guess)
        for node in old.nodes:
            if node.phase is None:
                phase = next(guess)
                if node.kind == TOUCH:
                    touch = phase, old.touched
                else:
                    events.append((phase, node.before, node.after))
        given = touch if label == "grazing" else None
        begin = arb.pi() if old.start > 0 else 0
        period = round(float(old.nodes[-1].phase - old.start) / (2.0 * np.pi))
        path = Path(Laws(model, 1.0), contact, events, period, given, begin)
        other, u = second(path, model), [exact(value) for value in start]
        residuals, rows = path.equations([value.mid() for value in start])
        assert wrong([residuals], [other.equations(u)]) == []
        assert wrong(rows, differences(other.equations, u)) == []
        if label != "grazing":
            check_invariants(path, other, [value.mid() for value in start])


def test_derivatives_of_a_tongue():
    with mpmath.workdps(DIGITS), precision(BITS):
        path = Path(Laws(MATERIAL, 1.0), 1, [], 1)
        for scale in (0.6, 1.7):
            check_invariants(path, second(path, MATERIAL), [arb(0), arb(0), arb(scale)])


@pytest.mark.parametrize(
    "law, harmonics",
    [((c, b), rows) for c, b in [(1.3, 0.1), (0.5, 1.1), (1.0, 1.0), (0.0, 0.2), (0.0, 0.0)]
     for rows in ([], [(1, 0.3, -0.2), (3, 0.1, 0.4)])],
)  # fmt: skip
def test_derivatives_of_the_laws(law, harmonics):
    """Velocity, acceleration, map and generator, by which signs and extrema are proven."""
    stiffness, damping = law
    scale, rest, load, phase, t = 0.8, 0.4, 0.7, 1.1, 1.9
    with mpmath.workdps(DIGITS), precision(BITS):
        one = (
            Elastic(arb(stiffness), arb(damping), arb(rest))
            if stiffness
            else Flight(arb(damping), arb(load))
        )
        if harmonics:
            rows = [(n, arb(a), arb(b)) for n, a, b in harmonics]
            one = Forced(one, rows, arb(scale))
        push = [(0, -mpf(stiffness)), (1, -2 * mpf(damping))]
        push.append((2, mpf(stiffness) * mpf(rest) if stiffness else mpf(load)))
        rows, waves = [[(1, mpf(1))], push, []], []
        for i, (n, a, b) in enumerate(harmonics):
            k, rate = 3 + 2 * i, n / mpf(scale)
            push += [(k, mpf(a)), (k + 1, mpf(b))]
            rows += [[(k + 1, -rate)], [(k, rate)]]
            waves += [mp.cos(n * mpf(phase)), mp.sin(n * mpf(phase))]

        def motion(u):
            x, w, t = u
            return flow(rows, [x, w, mpf(1), *waves], t)[:2]

        u = [mpf(0.3), mpf(-0.6), mpf(t)]
        slopes = differences(motion, u)
        x, w, matrix = one.go(arb(0.3), arb(-0.6), arb(t), arb(phase))
        assert wrong([[x, w]], [motion(u)]) == []
        assert wrong([matrix[:2], matrix[2:]], [row[:2] for row in slopes]) == []
        end = arb(phase) + arb(t) / arb(scale)
        assert wrong([[w, one.acceleration(x, w, end)]], [[row[2] for row in slopes]]) == []
        assert holds(one.acceleration(x, w, arb(phase), arb(t)), slopes[1][2])
        # d(matrix)/dt = generator matrix.
        later = differences(motion, [*u[:2], u[2] + mpf(10) ** -14])
        bends = [
            (b[j] - a[j]) * mpf(10) ** 14
            for a, b in zip(slopes, later, strict=True)
            for j in range(2)
        ]
        g, a = one.generator(), [row[:2] for row in slopes]
        made = [g[0] * arb_of(a[0][0]) + g[1] * arb_of(a[1][0]),
                g[0] * arb_of(a[0][1]) + g[1] * arb_of(a[1][1]),
                g[2] * arb_of(a[0][0]) + g[3] * arb_of(a[1][0]),
                g[2] * arb_of(a[0][1]) + g[3] * arb_of(a[1][1])]  # fmt: skip
        for ball, bend in zip(made, bends, strict=True):
            assert abs(exact(arb(ball)) - bend) < mpf(10) ** -12


def arb_of(value):
    return arb(mpmath.nstr(value, 65))


@cache
def train(case):
    orbit = test_train_certificates.found(case)
    return orbit, test_train_certificates.claim(gearlib.certify(orbit))


@pytest.mark.parametrize("case", ["idler", "bearings"])
def test_derivatives_of_an_orbit_of_a_train(case):
    orbit, claim = train(case)
    codes, events = listed_contacts(orbit)
    with mpmath.workdps(DIGITS), precision(BITS):
        laws = TrainLaws(orbit.pair, orbit.tuning)
        path = TrainPath(laws, codes, events, orbit.period)
        given = [value.mid() for value in [*laws.start(orbit.state), *path.guess]]
        residuals, rows = path.equations(given, BITS)
        other = TrainOrbit(claim)
        function = lambda u: other.equations(u, [what for _, *what in events])  # noqa: E731
        u = [exact(value) for value in given]
        assert wrong([residuals], [function(u)]) == []
        slopes = differences(function, u)
        assert wrong(rows, slopes) == []
        # With few bits too, as Newton's method has them, and without frames.
        assert wrong(path.equations(given)[1], slopes, mpf(10) ** -12) == []
        bare = TrainPath(laws, codes, events, orbit.period, framed=False)
        assert wrong(bare.equations(given, BITS)[1], slopes) == []
        m, n = eliminated(slopes, 2 * len(laws.kept)), 2 * len(laws.kept)
        found = path.monodromy(rows)
        assert wrong([[found[i, j] for j in range(n)] for i in range(n)], m.tolist()) == []
        if case != "idler":
            return
        box, places = moved(given, 1e-9)
        _, wide = path.equations(box)
        assert wrong(wide, differences(function, places[0]), mpf(10) ** -2) == []


def test_derivatives_through_contacts_at_once():
    """By differences across the contacts, whose order is another one on either side."""
    orbit, claim = train("branches")
    codes, events = listed_contacts(orbit)
    with mpmath.workdps(50), precision(420):
        proof = TrainProof(orbit, codes, events)
        n = 2 * len(proof.laws.kept)
        windows = Windows(proof.path, codes, proof.phases)
        assert windows.any()
        centre = [value.mid() for value in proof.box]
        _, rows = windows.equations(centre)
        other, u = TrainOrbit(claim), [exact(value) for value in centre]
        at = other.returned(u)
        for j in range(n):
            step = mpf(10) ** -18
            ends = other.returned([v + (i == j) * step for i, v in enumerate(u)])
            for i in range(n):
                slope = (ends[i] - at[i]) / step
                # The slope changes at the contacts' order by nothing, along the step by its length.
                assert abs(exact(rows[i][j]) - slope) < mpf(10) ** -13, (i, j)
                assert rows[i][j].rad() < 1e-13


def spoilt(monkeypatch, owner, name, change):
    """Have a method that returns (residuals, rows) return other rows."""
    real = getattr(owner, name)
    monkeypatch.setattr(
        owner, name, lambda self, *given, **more: change(real(self, *given, **more))
    )


def with_entry(i, j, by):
    def change(found):
        residuals, rows = found
        rows = [list(row) for row in rows]
        rows[i][j] = rows[i][j] + by
        return residuals, rows

    return change


#: Far below what Krawczyk's test would notice, and as large as a missing term.
CHANGES = (1e-9, 0.3)


def places(n, count=None):
    """Return places in a square matrix, all or some."""
    found = list(itertools.product(range(n), range(n)))
    if count is None:
        return found
    rng = np.random.default_rng(n)
    return [found[k] for k in rng.choice(len(found), count, replace=False)]


@pytest.mark.parametrize(
    "owner, case, size, count",
    [(Path, "two contacts", 4, None), (Path, "stops", 4, None), (TrainPath, "idler", 8, 6),
     (Windows, "branches", 4, 2)],
)  # fmt: skip
def test_a_wrong_derivative_proves_no_orbit(owner, case, size, count):
    orbit = orbit_of(case) if owner is Path else train(case)[0]
    for (i, j), by in itertools.product(places(size, count), CHANGES):
        with pytest.MonkeyPatch.context() as patch:
            spoilt(patch, owner, "equations", with_entry(i, j, by))
            refused = gearlib.certify(orbit)
        assert not refused, (i, j)
        if by == min(CHANGES):
            assert refused.status == "derivative", (i, j, refused)


@pytest.mark.parametrize("label", ["fold", "grazing"])
def test_a_wrong_derivative_proves_no_special_point(label):
    given = next(test_points.points(label))
    prove = gearlib.certify_grazing if label == "grazing" else gearlib.certify_fold
    size = len(special(label)[3])
    held = [("equations", place) for place in places(size, 6)]
    if label == "fold":
        held = [("equations", place) for place in places(size - 1, 4)]
        held += [("trace", (k, j)) for k in (2, 3) for j in range(2, size)]
    for name, (i, j) in held:

        def change(found, i=i, j=j, name=name):
            if name == "equations":
                return with_entry(i, j, 1e-9)(found)
            found = [*found[:2], list(found[2]), list(found[3])]
            found[i][j] = found[i][j] + 1e-9
            return found

        with pytest.MonkeyPatch.context() as patch:
            spoilt(patch, Path, name, change)
            refused = prove(*given)
        assert not refused and refused.status == "derivative", (name, i, j)


def test_a_wrong_derivative_proves_no_tongue_and_no_range():
    with pytest.MonkeyPatch.context() as patch:

        def change(found):
            trace, determinant, slopes, rates = found
            return trace, determinant, [*slopes[:-1], slopes[-1] * (1 + 1e-9)], rates

        spoilt(patch, Path, "trace", change)
        for one in gearlib.certify_tongues(PAPER, start=0.6, stop=0.9):
            assert not one and one.status == "derivative"
    with pytest.MonkeyPatch.context() as patch:
        spoilt(patch, Path, "equations", with_entry(2, 3, 1e-9))
        refused = gearlib.certify_range(orbit_of("two contacts"), to=0.8151)
        assert refused.status == "derivative"
        motion = gearlib.certify_motion(orbit_of("two contacts"))
        assert motion.status == "derivative"
