"""Coast sides that move with the supports: against six degrees, and against forces body by body."""

from dataclasses import replace

import numpy as np
import pytest

import gearlib
from gearlib import planetary, simulate
from tests.paper import PAPER


def moved(train, **changes):
    """Return a train whose coast sides all move, with other changes of its meshes."""
    changes |= {"moving_backlash": True}
    return train.replace(meshes=[replace(mesh, **changes) for mesh in train.meshes])


def test_axes_that_give_do_not_close_the_backlash():
    """The paper's reducer on soft axes: the coast sides of an unloaded branch stay open."""
    reducer = gearlib.split_power_reducer(PAPER, support_stiffness=2e7)
    run = {"periods": 10, "record_periods": 2, "initial_state": "static"}
    still, follows = (simulate(one, 0.9, **run) for one in (reducer, moved(reducer)))
    assert not int(still.status) and not int(follows.status)
    # No coast side is touched in either: the motion is the same.
    np.testing.assert_allclose(still.displacement, follows.displacement, rtol=0, atol=1e-9)


@pytest.mark.parametrize("load", [2000.0, -2000.0])
@pytest.mark.parametrize("turning", [False, True])
def test_the_static_equilibrium_rests(load, turning):
    train = moved(planetary(load=load, turning=turning), backlash=6e-6)
    found = train.static()
    assert set(found.contact.values) == {1 if load > 0.0 else -1}
    run = simulate(train, 0.7, periods=3, record_periods=3, initial_state="static")
    assert np.ptp(run.displacement.values, axis=0).max() < 1e-9
    # Turning the whole train moves no flank against another.
    assert np.abs(train.far_lines @ train.free_motions).max() < 1e-12


def test_an_axis_that_nothing_holds_is_refused():
    free = gearlib.idler(PAPER, support_stiffness=1e8)
    bodies = [replace(body, torque=0.0) for body in free.bodies]
    bodies[0] = replace(bodies[0], support_stiffness=(0.0, 0.0))
    with pytest.raises(ValueError, match="moving_backlash of mesh pinion-idler = True") as error:
        moved(free.replace(bodies=bodies))
    assert "must be False" in str(error.value)
