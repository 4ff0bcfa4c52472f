"""What phasing forbids stays zero through bounces; N planets in phase are the train of one."""

import dataclasses
import math

import numpy as np
import pytest

from gearlib import GearTrain, periodic_orbit, planetary, simulate

SAMPLES = 120


def train(teeth, planets, **options):
    """Return a planetary train with a stiffness jump of 60 % of its mean; tunings are kHz."""
    ratios = [1.0 - 0.6 / (1.0 + 0.6 * (2.0 - epsilon)) for epsilon in (1.4, 1.6)]
    settings = dict(
        planets=planets, teeth=teeth, stiffness_ratio=ratios, reference_frequency=1000.0
    )
    return planetary(**settings | options)


def harmonics(model, tuning, guess=None):
    """Return amplitudes of the sun over axis and order, 1 to 12, and the bounces of an orbit."""
    orbit = periodic_orbit(model, tuning, guess=guess)
    run = simulate(
        model, tuning, periods=1, samples_per_period=SAMPLES, initial_state=tuple(orbit.state)
    )
    sun = run.body_motion.sel(body="sun").values
    # Samples in a multiple of 2, 3 and 4: harmonics that are folded keep their remainders.
    return 2.0 * np.abs(np.fft.rfft(sun, axis=0)).T[:, 1:13] / SAMPLES, run.bounces.values


@pytest.mark.parametrize(
    ("teeth", "planets", "tuning"),
    # Orders l with k = l z_s mod N: in phase; a third, half a mesh period apart.
    [((27, 99), 3, 12.0), ((28, 98), 3, 10.0), ((26, 98), 4, 8.0)],
)
def test_harmonics_that_phasing_forbids_are_zero_through_loss_of_contact(teeth, planets, tuning):
    amplitudes, bounces = harmonics(train(teeth, planets), tuning)
    assert bounces.max() == 1.0
    k = np.arange(1, 13) * teeth[0] % planets
    rotational, translational = k == 0, (k == 1) | (k == planets - 1)
    # Orbits are found to 1e-12 static deflections, free rotation drifts by as much in a period.
    assert amplitudes[:2, ~translational].max() < 1e-11
    assert amplitudes[2, ~rotational].max(initial=0.0) < 1e-11
    for motions, allowed in ((amplitudes[:2], translational), (amplitudes[2:], rotational)):
        assert motions[:, allowed].min(initial=1.0) > 1e-6


def reduced(train):
    """Return the train of one planet that moves as N equal planets in phase do."""
    carried = [body for body in train.bodies if body.carrier]
    first = carried[0]
    bodies = []
    for body in train.bodies:
        if body is first:
            bodies.append(body)
        elif not body.carrier:
            parts = ("inertia", "torque", "torsional_stiffness", "torsional_damping")
            share = {name: getattr(body, name) / len(carried) for name in parts}
            share |= {"support_stiffness": math.inf, "support_damping": 0.0}
            bodies.append(dataclasses.replace(body, **share))
    meshes = [mesh for mesh in train.meshes if first.name in (mesh.pinion, mesh.wheel)]
    return GearTrain(
        bodies=bodies,
        meshes=[dataclasses.replace(mesh, phase=train.phases[mesh.name]) for mesh in meshes],
        reference_frequency=train.reference_angular_frequency / (2.0 * math.pi),
        carrier_ratio=train.carrier_ratio,
    )


def lifting(train, small):
    """Return the matrix that turns a state of the reduced train, `small`, into one of the train."""
    planet = next(body.name for body in small.bodies if body.carrier)
    columns = {coordinate: i for i, coordinate in enumerate(small.structure.coordinates)}
    matrix = np.zeros((len(train.structure.coordinates), len(columns)))
    for i, (body, axis) in enumerate(train.structure.coordinates):
        # Every planet moves as the one of the reduced train; sun, ring and carrier only turn.
        coordinate = (planet if train.by_name[body].carrier else body), axis
        if coordinate in columns:
            matrix[i, columns[coordinate]] = 1.0
    # The same for coordinates and velocities.
    return np.kron(np.eye(2), matrix)


def shifted(model):
    """Return the train with one mesh a thousandth of a mesh period late."""
    mesh = dataclasses.replace(model.meshes[1], phase=model.phases[model.meshes[1].name] + 1e-3)
    return model.replace(meshes=[model.meshes[0], mesh, *model.meshes[2:]])


def test_a_late_mesh_lets_forbidden_harmonics_in():
    model = shifted(train((28, 98), 3))
    # From rest rounding grows until one of several motions is reached.
    amplitudes, _ = harmonics(model, 10.0, model.start_state("static"))
    assert amplitudes[:2, 3].min() > 1e-6


@pytest.mark.parametrize(
    ("planets", "teeth", "tuning", "growth"),
    [
        (3, (27, 99), 11.0, 1.0),
        # Here the symmetry breaks: rounding grows, by no more than the largest multiplier.
        (3, (27, 99), 10.0, 1.26),
        (4, (28, 100), 8.0, 1.0),
        # Three bounces in every mesh period.
        (5, (30, 100), 2.0, 1.0),
    ],
)
def test_equal_planets_in_phase_move_as_the_reduced_train(planets, teeth, tuning, growth):
    """The reduced train has one planet and two meshes.

    Where all planets move alike, the lateral forces of the meshes on sun, ring and carrier cancel,
    N sin(psi_n) and N cos(psi_n) summing to zero: they only turn. With one planet (zeta, eta, u_n)

        2 T = m_s u_s'^2 + m_r u_r'^2 + m_c u_c'^2 + N (m_p (zeta'^2 + eta'^2) + m_n u_n'^2),
        2 U = k_r u_r^2 + N (k_1 d_s^2 + k_2 d_r^2 + k_p (zeta^2 + (u_c - eta)^2)),

    m = I / r^2; both, dissipation and the work of the torques, divided by N, are those of a train
    with one planet whose sun, ring and carrier cannot move sideways and have an N-th of inertia,
    torque, torsional stiffness and damping: weights N of two meshes.
    """
    full = train(teeth, planets)
    small = reduced(full)
    lift = lifting(full, small)
    reduce, _ = full.reduction()
    run = dict(periods=60, record_periods=4, initial_state="static")
    one, all_of_them = (simulate(model, tuning, **run) for model in (small, full))
    assert one.bounces.values.max() > 0.0
    for i, central in enumerate(("sun", "ring")):
        own = [name for name in full.mesh_names if name.startswith(central)]
        bounces = all_of_them.bounces.sel(mesh=own).values
        np.testing.assert_array_equal(bounces, one.bounces.values[i])
    # As many events, in every planet at the same instant.
    assert all_of_them.event.size == planets * one.event.size
    phases = np.sort(all_of_them.event_phase.values).reshape(-1, planets)
    # A motion of unit size after 60 periods of a thousand substeps; 4e-13 seen without growth.
    rounding = 4e-12 * growth**60
    assert np.ptp(phases, axis=1).max() < 100.0 * rounding
    difference = reduce @ (all_of_them.final_state.values - lift @ one.final_state.values)
    assert np.abs(difference).max() < rounding
    late = simulate(shifted(full), tuning, **run)
    assert np.abs(reduce @ (late.final_state.values - lift @ one.final_state.values)).max() > 1e-4
