"""Compare runs of random meshes with 50 digits, which reveal each missed or spurious event."""

import math

import numpy as np
import pytest

from gearlib import GearPair, simulate
from tests.references import StoredReferences, from_rest, propagate

REFERENCES = StoredReferences("random_meshes")

CASES_PER_SEED, SEEDS, PERIODS = 140, 4, 3


def random_mesh(rng):
    """Return random ratios of a gear pair, a tuning and an initial state (x, v).

    Special values, such as no damping, are frequent, and so are states of grazing motions.
    """

    def choose(usual_value, *special_values):
        """Return one of the special values with the probability 0.15, else the usual value."""
        return float(rng.choice(special_values)) if rng.random() < 0.15 else float(usual_value)

    ratios = {
        "contact_ratio": choose(rng.uniform(1.0, 2.0), 1.0, 2.0),
        "stiffness_ratio": choose(rng.uniform(0.05, 1.0), 1.0),
        "damping": choose(10 ** rng.uniform(-3, 0.5), 0.0, 1.0),
        "backlash_damping": choose(10 ** rng.uniform(-3, 0.5), 0.0),
        "backlash_ratio": choose(10 ** rng.uniform(-2, 1.3), 0.0, math.inf),
    }
    tuning = 10 ** rng.uniform(-0.8, 0.5)
    coast_line = -ratios["backlash_ratio"] if math.isfinite(ratios["backlash_ratio"]) else 0.0
    state = choose(rng.uniform(-6.0, 4.0), 0.0, coast_line), choose(rng.uniform(-3.0, 3.0), 0.0)
    if rng.random() < 0.25 and ratios["contact_ratio"] > 1.05:
        # The motion grazes the drive-side flank line: it has a minimum next to 0, from which it is
        # integrated backwards in time, i.e. with negative damping.
        stiffness_ratio, contact_ratio = ratios["stiffness_ratio"], ratios["contact_ratio"]
        mean_stiffness = stiffness_ratio + (1 - stiffness_ratio) * (contact_ratio - 1)
        minimum = float(rng.choice([-1, 1]) * 10 ** rng.uniform(-11, -3))
        decay, load = -ratios["damping"] / tuning, 1 / tuning**2
        squared_frequency = 1 / mean_stiffness / tuning**2
        # The stiffness is constant during this time after the start of a mesh period.
        time = min(0.9 * math.pi * (contact_ratio - 1), 0.5 * tuning)
        x, v = from_rest(decay, squared_frequency, load, minimum, time)
        state = float(x), -float(v)
    return ratios, tuning, state


@pytest.mark.parametrize("seed", range(SEEDS))
def test_no_event_of_a_random_mesh_is_missed_or_invented(seed):
    """Final states and events must agree with 50 digits, unless rounding decides about events."""
    rng = np.random.default_rng(seed)
    compared_count = 0
    for _ in range(CASES_PER_SEED):
        ratios, tuning, state = random_mesh(rng)
        arguments = *ratios.values(), tuning, PERIODS, state
        (x, v), *reference_events = REFERENCES.rows(propagate, *arguments)
        pair = GearPair.from_ratios(**ratios)
        options = {"periods": PERIODS, "record_periods": PERIODS, "samples_per_period": 1}
        run = simulate(pair, tuning, initial_state=state, **options)
        perturbed_state = state[0], state[1] + 1e-12
        perturbed_run = simulate(pair, tuning, initial_state=perturbed_state, **options)
        case = (ratios, tuning, state)
        assert int(run.status) == 0, case
        # The perturbation of the initial velocity has a larger effect than rounding errors. If this
        # effect is large, the motion is too sensitive for a comparison of events.
        spread = float(abs(perturbed_run.final_state - run.final_state).max())
        scale = 1.0 + abs(float(x)) + abs(float(v))
        error = max(abs(float(run.final_state[0] - x)), abs(float(run.final_state[1] - v)))
        assert error <= 1e-10 * scale + 10.0 * spread, (case, error)
        if spread > 1e-7 * scale or run.sizes["event"] != perturbed_run.sizes["event"]:
            continue
        compared_count += 1
        # An undamped mesh of constant stiffness that starts at rest on its flank returns to rest
        # there, and rounding errors decide whether this is an event. Events with velocities below
        # 1e-14 are therefore ignored.
        reference_events = [event for event in reference_events if abs(event[3]) > 1e-14]
        contacts = list(zip(run.event_from.values, run.event_to.values, strict=True))
        reference_contacts = [(before, after) for _, before, after, _ in reference_events]
        assert contacts == reference_contacts, case
        phases = run.event_phase.values
        for phase, (reference_phase, _, _, velocity) in zip(phases, reference_events, strict=True):
            # An error of the displacement, divided by the velocity, shifts the phase of an event.
            tolerance = 1e-10 + (1e-12 + spread) / max(1e-9, abs(float(velocity)))
            assert abs(phase - float(reference_phase)) <= tolerance, case
    # Nearly all motions must have been compared event by event.
    assert compared_count >= 0.9 * CASES_PER_SEED


@pytest.mark.parametrize("side", [1, -1])
def test_near_misses_of_the_coast_flank_are_told_from_hits(side):
    """A free flight must miss the coast flank if its lowest point is above it, else hit it.

    The lowest point lies 1e-3 to 1e-12 above (`side` 1) or below (-1) the coast-side flank line.
    """
    tuning, damping, backlash = 0.8, 0.05, 2.0
    ratios = {"contact_ratio": 1.569, "stiffness_ratio": 0.5879, "backlash_ratio": backlash}
    pair = GearPair.from_ratios(damping=damping, backlash_damping=damping, **ratios)
    for distance in (1e-3, 1e-6, 1e-9, 1e-12):
        # The free flight is computed backwards in time from its lowest point, where it is at rest.
        lowest_point = side * distance - backlash
        x, v = from_rest(-damping / tuning, 0.0, 1.0 / tuning**2, lowest_point, 0.9)
        run = simulate(pair, tuning, periods=1, initial_state=(float(x), -float(v)))
        # A motion that misses the coast side (-1) touches the drive side (1) next.
        assert int(run.event_to[0]) == side
