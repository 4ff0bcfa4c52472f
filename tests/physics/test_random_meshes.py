"""Hundreds of random meshes against 50 digits, which show each missed or invented event."""

import math

import numpy as np
import pytest

from gearlib import GearPair, simulate
from tests.references import StoredReferences, from_rest, propagate

REFERENCES = StoredReferences("random_meshes")

CASES_PER_SEED, SEEDS, PERIODS = 140, 4, 3


def random_mesh(rng):
    """Draw ratios, tuning and initial state of a mesh, special values and grazing included."""

    def choose(usual_value, *special_values):
        """Return one of the `special` values with probability 0.15, else the usual value."""
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
        # Integration backwards from a minimum next to the drive-side flank line gives a grazing
        # motion.
        stiffness_ratio, contact_ratio = ratios["stiffness_ratio"], ratios["contact_ratio"]
        mean = stiffness_ratio + (1 - stiffness_ratio) * (contact_ratio - 1)
        minimum = float(rng.choice([-1, 1]) * 10 ** rng.uniform(-11, -3))
        decay, square, load = -ratios["damping"] / tuning, 1 / mean / tuning**2, 1 / tuning**2
        x, v = from_rest(
            decay, square, load, minimum, min(0.9 * math.pi * (contact_ratio - 1), 0.5 * tuning)
        )
        state = float(x), -float(v)
    return ratios, tuning, state


@pytest.mark.parametrize("seed", range(SEEDS))
def test_no_event_of_a_random_mesh_is_missed_or_invented(seed):
    """Compare final states and, where rounding does not decide, every event with 50 digits."""
    rng = np.random.default_rng(seed)
    compared = 0
    for _ in range(CASES_PER_SEED):
        ratios, tuning, state = random_mesh(rng)
        arguments = *ratios.values(), tuning, PERIODS, state
        (x, v), *reference_events = REFERENCES.rows(propagate, *arguments)
        pair = GearPair.from_ratios(**ratios)
        options = {"periods": PERIODS, "record_periods": PERIODS, "samples_per_period": 1}
        run = simulate(pair, tuning, initial_state=state, **options)
        nudged = simulate(pair, tuning, initial_state=(state[0], state[1] + 1e-12), **options)
        case = (ratios, tuning, state)
        assert int(run.status) == 0, case
        # A change of the initial velocity by 1e-12 has a larger effect than rounding. If this
        # effect
        # is large, the motion is too sensitive for a comparison of events.
        spread = float(abs(nudged.final_state - run.final_state).max())
        scale = 1.0 + abs(float(x)) + abs(float(v))
        error = max(abs(float(run.final_state[0] - x)), abs(float(run.final_state[1] - v)))
        assert error <= 1e-10 * scale + 10.0 * spread, (case, error)
        if spread > 1e-7 * scale or run.sizes["event"] != nudged.sizes["event"]:
            continue
        compared += 1
        # An undamped mesh of constant stiffness that starts at rest on its flank returns to rest
        # there, and rounding, 1e-50 in the reference, decides whether this is an event. Events with
        # velocities below 1e-14 are therefore ignored.
        reference_events = [event for event in reference_events if abs(event[3]) > 1e-14]
        order = list(zip(run.event_from.values, run.event_to.values, strict=True))
        assert order == [event[1:3] for event in reference_events], case
        for phase, event in zip(run.event_phase.values, reference_events, strict=True):
            # An error of the displacement, divided by the velocity, shifts the phase of an event.
            allowed = 1e-10 + (1e-12 + spread) / max(1e-9, abs(float(event[3])))
            assert abs(phase - float(event[0])) <= allowed, case
    # Nearly all motions must have been compared event by event.
    assert compared >= 0.9 * CASES_PER_SEED


@pytest.mark.parametrize("side", [1, -1])
def test_near_misses_of_the_coast_flank_are_told_from_hits(side):
    """A free flight that passes the coast flank at a tiny distance must be classified rightly."""
    tuning, damping, gap = 0.8, 0.05, 2.0
    ratios = {"contact_ratio": 1.569, "stiffness_ratio": 0.5879, "backlash_ratio": gap}
    pair = GearPair.from_ratios(damping=damping, backlash_damping=damping, **ratios)
    for distance in (1e-3, 1e-6, 1e-9, 1e-12):
        # The free flight ends at rest beside the coast-side flank line, and is computed backwards.
        x, v = from_rest(-damping / tuning, 0.0, 1.0 / tuning**2, side * distance - gap, 0.9)
        run = simulate(pair, tuning, periods=1, initial_state=(float(x), -float(v)))
        # A motion that misses the coast side (-1) touches the drive side (1) next.
        assert int(run.event_to[0]) == side
