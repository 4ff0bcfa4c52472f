"""Both flanks of a mesh at once: a run either says so, or keeps them apart at every instant.

Samples are judged by distances that the program of `tests.independent` writes down for itself, of
motions in which nothing looks at the other flank.
"""

import math

import numpy as np
import pytest

import gearlib
from gearlib import Body, GearPair, GearTrain, Harmonics, Mesh, SixDegreePair
from gearlib.data import status
from tests.independent.systems import describe, system_of
from tests.trains.random_trains import edge_problem

#: Samples of a mesh period; an overlap in static deflections that is more than rounding.
SAMPLES, DEEP = 2000, 1e-9


def two_gears(drive, coast, backlash=1e-6, load=400.0):
    radius = 0.05
    body = dict(teeth=24, base_radius=radius, inertia=6.0 * radius**2, torque=load * radius)
    mesh = Mesh(
        pinion="a",
        wheel="b",
        max_stiffness=4e8,
        stiffness_ratio=0.6,
        contact_ratio=1.5,
        backlash=backlash,
        material_damping=2000.0,
        backlash_damping=500.0,
        deviation=Harmonics((drive,)),
        inverse_deviation=Harmonics((coast,)),
    )
    return GearTrain(bodies=[Body(name="a", **body), Body(name="b", **body)], meshes=[mesh])


def overlap(train, tuning, states, periods):
    """Return by how much both flanks of a mesh overlap at samples, static deflections, (k, m).

    states : ndarray, shape (k, n), coordinates in static deflections at equal steps of the phase.
    """
    system = system_of(describe(train), tuning)
    phases = 2.0 * math.pi * periods * np.arange(len(states)) / len(states)

    def distances(side):
        result = states @ side["row"] + side["constant"] / system.length
        for frequency, cosine, sine in side["waves"]:
            wave = cosine * np.cos(frequency * phases) + sine * np.sin(frequency * phases)
            result += wave / system.length
        return result

    result = [
        np.minimum(distances(drive), -distances(coast[0]) if coast else -math.inf)
        for drive, *coast in (contact["sides"] for contact in system.contacts)
    ]
    return np.stack(result, axis=1)


def unwatched(train, tuning, state, periods):
    """Return (status, overlaps) of a motion in which flanks in contact look at no other flank."""
    propagator = train.propagator(tuning)
    closing = np.zeros_like(propagator.constants.may_jam)
    propagator.constants = propagator.constants._replace(may_jam=closing)
    record = propagator.record(state, periods, 10**5, SAMPLES)
    states = record.samples[:, 6 * len(train.meshes) :]
    return record.status, overlap(train, tuning, states, periods)


@pytest.mark.parametrize("start", [(0.0, 0.0), "static"])
@pytest.mark.parametrize(
    ("drive", "coast", "tuning", "jams"),
    [
        # Slowly, the load holds the drive side: it is the coast side that comes to touch too.
        (1e-6, -1e-6, 0.2, True),
        # The backlash closes by 0.2 um, but not while the flanks are there.
        (0.6e-6, -0.6e-6, 0.2, False),
        (0.6e-6, -0.6e-6, 0.5, True),
        (0.499e-6, -0.499e-6, 0.5, False),
        # Both flanks alike: the backlash stays.
        (1e-6, 1e-6, 0.5, False),
    ],
)
def test_two_gears_whose_backlash_closes(start, drive, coast, tuning, jams):
    train = two_gears(drive, coast)
    run = gearlib.simulate(train, tuning, periods=20, initial_state=start)
    assert int(run.status) == (status.JAMMED if jams else status.OK)
    _, both = unwatched(train, tuning, train.start_state(start), 20)
    assert (both.max() > 1e-3) == jams
    if jams:
        assert np.isnan(run.displacement_max).all() and "both flanks" in run.status.attrs["message"]
        _, maps, code = train.propagator(tuning).maps(train.start_state(start), 20, 100)
        assert code == status.JAMMED and np.isnan(maps).all()


def test_a_start_in_which_both_flanks_touch():
    train = two_gears(0.0, -3e-6)
    state = np.zeros(train.size)
    for at, jams in ((0.01, True), (-0.01, False), (0.99, True), (1.01, False)):
        # Both touch between d = 0 and 2 um; the pinion moves along the line of action.
        state[0] = at * 2e-6 / train.static_deflection
        code = train.propagator(0.9).record(state, 1, 100).status
        first = unwatched(train, 0.9, state, 1)[1][0].max()
        assert (first >= 0.0) == jams
        if jams:
            assert code == status.JAMMED


@pytest.mark.parametrize("seed", range(16))
def test_random_trains_with_hardly_any_backlash(seed):
    train, tuning, state = edge_problem(np.random.default_rng(seed))
    periods = 3
    code = train.propagator(tuning).record(state, periods, 10**5).status
    before, both = unwatched(train, tuning, state, periods)
    deepest = both.max(axis=1)
    if code == status.OK:
        # Proven for every instant, so at the samples too.
        assert before == status.OK and deepest.max() <= DEEP
    else:
        assert code == status.JAMMED
        # Seen by the samples, or between two of them, where distances hardly change.
        speed = np.abs(np.diff(both, axis=0)).max()
        assert deepest.max() > -2.0 * speed


def six(moving, backlash=1.2e-6, drive=0.8e-6, coast=-0.8e-6):
    pair = GearPair(
        max_stiffness=4e8,
        stiffness_ratio=0.6,
        contact_ratio=1.5,
        reduced_mass=3.0,
        load=400.0,
        backlash=backlash,
        material_damping=2000.0,
        backlash_damping=500.0,
    )
    return SixDegreePair(
        pair=pair,
        base_radii=(0.05, 0.05),
        inertias=(0.015, 0.015),
        masses=(4.0, 4.0),
        bearing_stiffness=(1e9,) * 4,
        bearing_damping=(500.0,) * 4,
        deviation=Harmonics((drive,)),
        inverse_deviation=Harmonics((coast,)),
        moving_backlash=moving,
    )


def test_statics_say_where_the_load_wedges_a_mesh():
    # C (2 d - 1 um) = 100 N while both touch: d = 0.625 um, the coast side 0.375 um too deep.
    train = two_gears(1e-6, -1e-6, load=100.0)
    wedged, free = train.static(), train.static(math.pi)
    assert int(wedged.status) == status.JAMMED and "both flanks" in wedged.status.attrs["message"]
    assert int(free.status) == status.OK
    # Net of the 250 N and 150 N on both flanks: the load.
    for result in (wedged, free):
        assert float(result.mesh_force[0]) == pytest.approx(100.0)
    # Without backlash, but without deviations: one flank touches.
    without = two_gears(0.0, 0.0, 0.0).static()
    assert int(without.contact[0]) == 1 and int(without.status) == status.OK
