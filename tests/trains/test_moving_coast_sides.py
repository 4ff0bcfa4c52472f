"""Coast sides that move with the supports: against six degrees, and against forces body by body."""

from dataclasses import replace

import numpy as np
import pytest

from gearlib import planetary, simulate


def moved(train, **changes):
    """Return a train whose coast sides all move, with other changes of its meshes."""
    changes |= {"moving_backlash": True}
    return train.replace(meshes=[replace(mesh, **changes) for mesh in train.meshes])


@pytest.mark.parametrize("load", [2000.0, -2000.0])
@pytest.mark.parametrize("turning", [False, True])
def test_the_static_equilibrium_rests(load, turning):
    train = moved(planetary(load=load, turning=turning), backlash=6e-6)
    found = train.static()
    assert set(found.contact.values) == {1 if load > 0.0 else -1}
    run = simulate(train, 0.7, periods=3, record_periods=3, initial_state="static")
    assert np.ptp(run.displacement.values, axis=0).max() < 1e-9
    # Turning the whole train moves no flank against another.
    assert np.abs(train.coast_lines @ train.free_motions).max() < 1e-12
