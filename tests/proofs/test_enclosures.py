"""Enclosures hold what they have to, and are hardly wider than that."""

import math

import pytest
from flint import acb, arb, arb_mat

import gearlib
from gearlib.analysis.proofs import krawczyk, orbits
from gearlib.analysis.proofs.arc_laws import ArcDynamics, propagated
from gearlib.analysis.proofs.balls import first_column, precision
from gearlib.analysis.proofs.krawczyk import eigenvalues, stability_verdict
from gearlib.analysis.proofs.orbits import listed_contacts
from gearlib.analysis.proofs.path import Path
from tests.paper import PAPER
from tests.proofs import test_train_certificates

MATERIAL = PAPER.replace(material_damping=3953.7)


@pytest.mark.parametrize("case, share", [("parametric resonance", 0.5), ("chain", 0.3)])
def test_frames_keep_boxes_from_being_wrapped(case, share):
    orbit, radius = test_train_certificates.found(case), 1e-9
    with precision(160) as arb:
        laws = ArcDynamics(orbit.pair, orbit.tuning)
        path = Path(laws, *listed_contacts(orbit), orbit.period)
        start = [*laws.initial_state(orbit.state), *path.initial_phases]
        box = [arb(value.mid(), radius) for value in start]
        n = laws.state_count
        wide = max(float(value.rad()) for value in path.equations(box)[0])
        state, last = first_column(path.start(box[:n], n)), 0
        for node, phase in zip(path.nodes, path.phases(box[n:]), strict=True):
            state, last = propagated(node.matrix, state, (phase - last) * path.scale), phase
        assert wide < share * max(float(v.rad()) for v in (laws.basis * state).entries()[:n])
        if not path.initial_phases:
            # Without contacts all is linear: a box about the image turns with it, in n dimensions
            # no wider than that by sqrt(n).
            slopes = path.equations([value.mid() for value in start])[1]
            image = max(sum(float(abs(entry.mid())) for entry in row) for row in slopes)
            assert wide < math.sqrt(len(slopes)) * image * radius


@pytest.mark.parametrize("side", [-1, 1])
def test_boxes_of_a_range_hold_its_orbits_wherever_their_centre_lies(monkeypatch, side):
    """Newton's method, which centres a box, is no part of the proof."""
    orbit, polish, boxes = gearlib.periodic_orbit(MATERIAL, 0.9), krawczyk.polish, []
    away = iter([side * 1e-3, 0.0])

    def beside(*given):
        (x, *others), inverse = polish(*given)
        return [x + next(away), *others], inverse

    def noted(path, arcs, *given):
        boxes.append((path.dynamics.basis * arcs[0][0]).entries()[:2])

    with precision(128) as arb:
        part = orbits._Range(orbit, *listed_contacts(orbit))
        ends = [1 / arb(nu) for nu in (0.9, 0.900001)]
        systems = [part.path(end).equations for end in ends]
        inside = [krawczyk.enclose(one, *polish(one, part.reached)) for one in systems]
        monkeypatch.setattr(orbits, "check_contacts", noted)
        monkeypatch.setattr(krawczyk, "polish", beside)
        part._piece(ends[0].union(ends[1]), ends[1], None)
        for one in inside:
            assert all(ball.contains(x) for ball, x in zip(*boxes, one, strict=False))


def test_multiple_eigenvalues_are_enclosed():
    with precision(128):
        # Two of 1/2 to one vector, a pair on the unit circle, and -2.
        matrix = arb_mat(
            [
                [0.5, 1, 0, 0, 0],
                [0, 0.5, 0, 0, 0],
                [0, 0, 0.6, -0.8, 0],
                [0, 0, 0.8, 0.6, 0],
                [0, 0, 0, 0, -2],
            ]
        )
        turn = arb_mat([[arb(1) / (i + j + 1) + (i == j) for j in range(5)] for i in range(5)])
        values = eigenvalues(turn.solve(matrix * turn))
    wanted = [-2, complex(0.6, 0.8), complex(0.6, -0.8), 0.5, 0.5]
    exact = [acb(-2), acb(arb(0.6), arb(0.8)), acb(arb(0.6), arb(-0.8)), acb(0.5), acb(0.5)]
    for ball, value, one in zip(values, wanted, exact, strict=True):
        assert ball.contains(one) and abs(complex(ball.mid()) - value) < 1e-15
    # Alone, so real; of the two that meet it is not known.
    assert values[0].imag == 0 and values[3].imag.rad() > 0
    for part, stability in (
        (values, "unstable"),
        (values[3:], "stable"),
        (values[1:], "undecided"),
    ):
        assert stability_verdict(part, matrix, None)[0] == stability


def test_eigenvalues_of_all_matrices_of_a_ball():
    with precision(128):
        values = eigenvalues(arb_mat([[1, arb(0, 0.1)], [arb(0, 0.1), 2]]))
        for off in (-0.1, 0.0, 0.1):
            for share, sign in zip(values, (1, -1), strict=True):
                assert share.contains(acb(1.5 + sign * (arb(0.25) + arb(off) ** 2).sqrt()))
