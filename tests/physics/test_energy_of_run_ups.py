"""Statistics of run-ups by other means, and the balance of their energy.

Energy by the matrices and flanks of `tests.independent`, on the time courses of the library.
"""

import numpy as np
import pytest

import gearlib
from gearlib.engines.linear import courses
from gearlib.models import acceleration
from tests.physics.test_run_up import DAMPED, random_course, reference


def course_of(model, speed, load, push, samples):
    """Return (time, coordinates in m) along a course, from rest."""
    omega = float(model.mesh_frequency(1.0))
    start = "static" if model.mesh_names else (0.0, 0.0)
    runner, pieces, state = courses.start_course(model, np.array(speed), np.array(load), start)
    inertia, teeth = push / model.static_deflection, 24.0
    found = list(courses.run_course(runner, pieces, state, samples, 10**6, inertia, teeth))
    steps = np.arange(samples) / samples
    theta = [(one.theta[:-1, None] + np.diff(one.theta)[:, None] * steps).ravel() for one in found]
    q = (
        np.concatenate([one.states[:, : model.size // 2] for one in found])
        * model.static_deflection
    )
    return np.concatenate(theta) / omega, q


def test_statistics_of_arcs_and_of_matrices_are_the_same():
    # Through the resonance, with flights and strokes on both flanks.
    pair = DAMPED.replace(backlash_damping=0.0, backlash=6e-6)
    speed = [(0.0, 2000.0), (0.4, 4000.0), (0.8, 2000.0)]
    course = {"speed": speed, "load": [(0.0, 1.0), (0.1, 1.0), (0.1, 0.7)]}
    course |= {"driven_mass": 1.5, "base_radius": 0.05, "samples_per_period": 4}
    one, other = (gearlib.run_up(m, **course) for m in (pair, gearlib.OneDegreePair(pair=pair)))
    assert (one.fraction_inverse > 0.0).any() and one.bounces.max() > 0.5
    for name in one.data_vars:
        if one[name].dtype.kind == "f":
            wrong, size = np.abs(one[name].values - other[name].values), np.abs(one[name]).max()
            assert wrong.max() < 1e-11 * size, name


@pytest.mark.parametrize(
    ("model", "tuning"),
    [
        (DAMPED, 0.7),
        (gearlib.OneDegreePair(pair=DAMPED), 0.7),
        (gearlib.planetary(stiffness_ratio=(0.7, 0.7)), 0.2),
    ],
)
def test_energy_is_in_balance(model, tuning):
    speed, load = random_course(np.random.default_rng(0), model, tuning, 12, 0.5)
    push = np.array([0.5 * 0.05 / model.teeth]) if model.train is None else None
    if push is None:
        push = acceleration.train_accelerations(model) * model.static_deflection
    t, q = course_of(model, speed, load, push, 1024)
    code, moved = reference(model, speed, load, push), np.diff(q, axis=0)
    system = code.system
    # On straight lines of speed and load their middles count; between samples the motion is smooth.
    middle = (t[:-1] + t[1:]) / 2.0 * system.speed
    v = moved / np.diff(t)[:, None]
    # From the middle of the first step to that of the last.
    moved[[0, -1]] /= 2.0
    spans = np.diff(t) * np.append(np.append(0.5, np.ones(t.size - 3)), 0.5)
    which = np.searchsorted([piece.end for piece in code.pieces], middle)
    own = [code.pieces[k] for k in which]
    share = np.array([p.load + p.slope * (at - p.begin) for p, at in zip(own, middle, strict=True)])
    pull = np.array([p.acceleration for p in own]) * system.speed**2
    brought = share @ (moved @ system.load) + pull @ (moved @ (system.mass @ push))
    lost = np.einsum("ti,ij,tj->t", v, system.damping, v)
    at_ends = v[[0, -1]], (q[:-1] + q[1:])[[0, -1]] / 2.0
    stored = sum(
        np.einsum("ti,ij,tj->t", x, matrix, x) / 2.0
        for x, matrix in zip(at_ends, (system.mass, system.stiffness), strict=True)
    )
    phases = np.array([p.about(at)[0] for p, at in zip(own, middle, strict=True)])
    cuts = np.concatenate([code.cuts(piece)[:-1] for piece in code.pieces]) / system.speed
    for contact in system.contacts:
        film = contact["film"][0]
        for side, now in zip(contact["sides"], (1, -1), strict=True):
            g, slide = q @ side["row"] + side["constant"], v @ side["row"]
            pressed = np.maximum(now * g, 0.0)
            # Of a step in which contact comes or goes a share counts.
            ends = np.abs(g[:-1]) + np.abs(g[1:])
            touches = np.where(
                g[:-1] * g[1:] > 0.0, pressed[1:] > 0.0, (pressed[:-1] + pressed[1:]) / ends
            )
            c = np.array([system.level(contact, side, at) for at in phases])
            square = pressed**2
            lost += film * slide**2 * (now == 1)
            lost += (side["material"][0] - film) * slide**2 * touches
            stored += c[[0, -1]] * (square[:-1] + square[1:])[[0, -1]] / 4.0
            # What changes the stiffness works on the flanks: where it switches, or all the time.
            jumps, at = np.diff(c), t[1:-1]
            places = np.searchsorted(middle / system.speed, cuts)
            kept = (places > 0) & (places < middle.size)
            jumps, at = jumps[places[kept] - 1], cuts[kept]
            brought += jumps @ np.interp(at, t, square) / 2.0
    lost = lost @ spans
    wrong = brought - lost - (stored[1] - stored[0])
    # The trapezoidal rule: a fourfold step makes sixteen times the difference.
    assert abs(wrong) < 4e-5 * lost
