"""Events of trains: their order, starts at rest, crossings where the stiffness switches."""

from dataclasses import replace

import numpy as np
import pytest

import gearlib
from gearlib.engines import orbit
from gearlib.engines.linear.periods import EVENT_MESH
from tests.paper import PAPER_PAIR
from tests.properties.known_models import pairs_as_train
from tests.trains.random_trains import random_problem, symmetric_problem

#: Bounces once a mesh period at a tuning of 0.85.
PAIR = PAPER_PAIR.replace(material_damping=3953.7, backlash_damping=800.0, backlash=120e-6)


def test_a_train_at_rest_on_its_flanks_begins_in_contact():
    """A train that starts at zero displacement must get contact without an event at phase 0."""
    # Ring meshes are compressed with the fourth power of time, so that rounding might open them.
    train = gearlib.planetary(stiffness_ratio=(0.7, 0.7))
    events = train.propagator(0.5).record(train.start_state((0.0, 0.0)), 1, 100).events
    assert (events[:, orbit.EVENT_PHASE] > 1e-9).all()
    run = gearlib.simulate(train, 0.5, periods=1, samples_per_period=4096)
    assert (run.contact[0] == 1).all() and (run.displacement[1:9] > 0.0).all()


@pytest.mark.parametrize("load", [3000.0, -3000.0, 0.0])
@pytest.mark.parametrize("flank", [1, -1])
def test_a_start_at_rest_on_a_flank_line_has_contact_only_if_the_load_closes_it(flank, load):
    """A gear at rest that touches a flank must have contact only if the load presses on it.

    `flank` is 1 for the drive side and -1 for the coast side.
    """
    train = pairs_as_train(PAIR)
    torques = [replace(body, torque=load * body.base_radius) for body in train.bodies]
    train = train.replace(bodies=torques)
    half_gap = 0.5 * PAIR.backlash / train.static_deflection
    state = np.repeat([-half_gap if flank == -1 else 0.0, 0.0], 2)
    # The load closes one side and opens the other. Without load nothing moves, and the coast side
    # counts as open.
    contact = int(load >= 0.0) if flank == 1 else -int(load < 0.0)
    record = train.propagator(0.9).record(state, 1, 100, 64)
    assert (record.samples[:2, orbit.SAMPLE_CONTACT] == contact).all()
    # A loaded flank stays in contact for a while, and an open one strikes later.
    assert (record.events[:, orbit.EVENT_PHASE] > 0.1).all()


# For these seeds, of sixty, an event would round to a phase below the preceding one.
@pytest.mark.parametrize(
    ("make_problem", "seed"),
    [(symmetric_problem, seed) for seed in (12, 54)] + [(random_problem, 17)],
)
def test_events_are_recorded_in_chronological_order(make_problem, seed):
    """Phases of events must not decrease, and events of equal phase are sorted by mesh."""
    train, tuning, state = make_problem(np.random.default_rng(seed))
    events = train.propagator(tuning).record(state, 40, 10**5).events
    in_same_period = np.diff(events[:, orbit.EVENT_PERIOD]) == 0.0
    steps = np.diff(events[:, orbit.EVENT_PHASE])
    assert (steps[in_same_period] >= 0.0).all()
    assert (np.diff(events[:, EVENT_MESH])[in_same_period & (steps == 0.0)] >= 0).all()
    run = gearlib.simulate(train, tuning, periods=40, record_periods=40, initial_state=state)
    assert run.event.size == len(events) > 10 and (np.diff(run.event_phase) >= 0.0).all()


def test_a_crossing_where_the_stiffness_switches_is_not_lost():
    """Contact that ends at a stiffness switch, up to rounding, must be detected at this phase."""
    propagator = pairs_as_train(PAIR).propagator(0.85)
    switch_phase, low, high = propagator.system.starts[1], 1.0, 2.0

    def first_event_phase(displacement):
        """Return the phase of the first event from rest at a displacement of the mesh."""
        record = propagator.record(np.array([displacement, displacement, 0.0, 0.0]), 1, 100)
        assert record.status == 0
        return record.events[0, orbit.EVENT_PHASE]

    # A larger initial displacement ends contact sooner. If it ends at the switch, the next segment
    # begins with a distance that is pure rounding.
    while high - low > 1e-15:  # a few units of rounding
        middle = 0.5 * (low + high)
        low, high = (low, middle) if first_event_phase(middle) < switch_phase else (middle, high)
    for steps in range(-40, 40):
        assert first_event_phase(low + steps * np.spacing(low)) == pytest.approx(
            switch_phase, abs=1e-13
        )
