"""Jamming: a run reports contact of both flanks, or both flanks never overlap.

Overlaps are computed by the separate equations of `tests.independent` for motions without the check
for jamming.
"""

import math
from dataclasses import replace

import numpy as np
import pytest

import gearlib
from gearlib import Harmonics
from gearlib.data import status
from tests.independent.systems import describe, system_of
from tests.paper import PAPER_PAIR
from tests.properties.known_models import pairs_as_train
from tests.trains.random_trains import jamming_problem

#: Samples per mesh period; overlap in static deflections that rounding may cause.
SAMPLES_PER_PERIOD, OVERLAP_TOLERANCE = 2000, 1e-9


def two_gears(drive, coast, backlash=1e-6, load=400.0):
    """Return a train of two equal gears with cosine deviations of both flanks.

    `drive` and `coast` are the amplitudes of the deviations, m; `backlash` is in m and `load` in N.
    """
    stiffness = {"stiffness_ratio": 0.6, "contact_ratio": 1.5, "reduced_mass": 3.0}
    damping = {"material_damping": 2000.0, "backlash_damping": 500.0}
    train = pairs_as_train(PAPER_PAIR.replace(load=load, backlash=backlash, **stiffness, **damping))
    deviations = {"deviation": Harmonics((drive,)), "coast_deviation": Harmonics((coast,))}
    return train.replace(meshes=[replace(train.meshes[0], **deviations)])


def run_without_jamming_check(train, tuning, state, periods):
    """Return (status, overlaps) of a run that continues where both flanks of a mesh touch.

    Overlaps, (samples, meshes), are the depths by which both flanks overlap, in static deflections,
    at equal steps of the phase.
    """
    propagator, system = train.propagator(tuning), system_of(describe(train), tuning)
    no_mesh = np.zeros_like(propagator.constants.may_jam)
    propagator.constants = propagator.constants._replace(may_jam=no_mesh)
    record = propagator.record(state, periods, 10**5, SAMPLES_PER_PERIOD)
    # A sample holds six values for each mesh and then the coordinates.
    states = record.samples[:, 6 * len(train.meshes) :] * system.length
    phases = math.tau * periods * np.arange(len(states)) / len(states)
    overlaps = []
    for contact in system.contacts:
        deviations = [
            sum(
                a * np.cos(f * phases) + b * np.sin(f * phases)
                for f, a, b in side["harmonic_terms"]
            )
            for side in contact["sides"]
        ]
        drive, *coast = (
            (states @ side["row"] + side["constant"] + deviation) / system.length
            for side, deviation in zip(contact["sides"], deviations, strict=True)
        )
        overlaps.append(np.minimum(drive, -coast[0] if coast else -math.inf))
    return record.status, np.stack(overlaps, axis=1)


@pytest.mark.parametrize("start", [(0.0, 0.0), "static"])
@pytest.mark.parametrize(
    ("drive", "coast", "tuning", "jams"),
    [
        # At a low speed the load keeps the drive side in contact, and the coast side touches too.
        (1e-6, -1e-6, 0.2, True),
        # The backlash is negative for a while, but then the gears are away from the flanks.
        (0.6e-6, -0.6e-6, 0.2, False),
        (0.6e-6, -0.6e-6, 0.5, True),
        (0.499e-6, -0.499e-6, 0.5, False),
        # If both flanks deviate alike, the backlash does not change.
        (1e-6, 1e-6, 0.5, False),
    ],
)
def test_two_gears_jam_where_their_backlash_closes(start, drive, coast, tuning, jams):
    """A run must jam if and only if both flanks overlap in a run without the check."""
    train = two_gears(drive, coast)
    run = gearlib.simulate(train, tuning, periods=20, initial_state=start)
    assert int(run.status) == (status.JAMMED if jams else status.OK)
    _, overlaps = run_without_jamming_check(train, tuning, train.start_state(start), 20)
    assert (overlaps.max() > 1e-3) == jams
    if jams:
        assert np.isnan(run.displacement_max).all() and "both flanks" in run.status.attrs["message"]
        _, maps, code = train.propagator(tuning).maps(train.start_state(start), 20, 100)
        assert code == status.JAMMED and np.isnan(maps).all()


def test_a_run_that_starts_with_both_flanks_in_contact_is_jammed():
    """A backlash of 1 um and a coast deviation of -3 um leave an overlap of 2 um at the start."""
    train = two_gears(0.0, -3e-6)
    state = np.zeros(train.size)
    for fraction, both_flanks_touch in ((0.01, True), (-0.01, False), (0.99, True), (1.01, False)):
        # Both flanks touch while the pinion is displaced by 0 to 2 um along the line of action.
        state[0] = fraction * 2e-6 / train.static_deflection
        _, overlaps = run_without_jamming_check(train, 0.9, state, 1)
        assert (overlaps[0].max() >= 0.0) == both_flanks_touch
        # The other starts may jam later.
        if both_flanks_touch:
            assert train.propagator(0.9).record(state, 1, 100).status == status.JAMMED


@pytest.mark.parametrize("seed", range(16))
def test_a_random_train_is_jammed_if_and_only_if_both_flanks_of_a_mesh_touch(seed):
    """Compare the status with the overlap of flanks in a run without the check."""
    train, tuning, state = jamming_problem(np.random.default_rng(seed))
    code = train.propagator(tuning).record(state, 3, 10**5).status
    status_without_check, overlaps = run_without_jamming_check(train, tuning, state, 3)
    if code == status.OK:
        # A run without jamming has no overlap at any instant.
        assert status_without_check == status.OK and overlaps.max() <= OVERLAP_TOLERANCE
    else:
        assert code == status.JAMMED
        # Both flanks touch at a sample or between two samples, whose overlaps differ by a step.
        assert overlaps.max() > -2.0 * np.abs(np.diff(overlaps, axis=0)).max()


def test_statics_report_a_mesh_that_is_jammed():
    """Statics must report contact of both flanks at once, and its net force of 100 N."""
    # While both flanks touch, C (2 d - 1 um) = 100 N gives a displacement d of 0.625 um, which is
    # 0.375 um too much for the coast side.
    train = two_gears(1e-6, -1e-6, load=100.0)
    jammed, free = train.static(), train.static(math.pi)
    assert int(jammed.status) == status.JAMMED and "both flanks" in jammed.status.attrs["message"]
    assert int(free.status) == status.OK
    # The load is the difference of 250 N and 150 N on both flanks.
    np.testing.assert_allclose([jammed.mesh_force[0], free.mesh_force[0]], 100.0)
    # Without backlash and deviations one flank touches.
    result = two_gears(0.0, 0.0, 0.0).static()
    assert int(result.contact[0]) == 1 and int(result.status) == status.OK
