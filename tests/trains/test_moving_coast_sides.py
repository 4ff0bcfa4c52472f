"""Coast sides that move with the supports: against six degrees, and against forces body by body."""

import math
from dataclasses import replace

import numpy as np
import pytest
from tests.trains.reference import Reference

import gearlib
from gearlib import planetary, simulate
from tests.paper import PAPER
from tests.trains.random_trains import random_problem
from tests.trains.test_train_system import six_degrees


def moved(train, **changes):
    """Return a train whose coast sides all move, with other changes of its meshes."""
    changes |= {"moving_backlash": True}
    return train.replace(meshes=[replace(mesh, **changes) for mesh in train.meshes])


class Moving(Reference):
    """The second code, whose coast sides do not see what supports give, nor run-out."""

    def __init__(self, train, tuning):
        super().__init__(train, tuning)
        self.far = np.array([self._turning_of(mesh) for mesh in train.meshes])

    def _turning_of(self, mesh):
        """Return the distance by the turning of the gears, and of a carrier with its pins."""
        row, lambda_ = np.zeros(self.n), self._line(mesh)
        for name, sign, turn in self._ends(mesh):
            body = self.bodies[name]
            parts = [((name, "u"), mesh.direction * turn)]
            if body.carrier:
                across = math.sin(lambda_ - body.angle)
                parts += [
                    ((body.carrier, "x"), sign * math.cos(lambda_)),
                    ((body.carrier, "y"), sign * math.sin(lambda_)),
                    ((body.carrier, "u"), sign * across),
                ]
            for key, part in parts:
                if key in self.columns:
                    row[self.columns[key]] += part
        return row

    def errors(self, j, side, t):
        """As of `Reference`."""
        if side:
            return super().errors(j, side, t)
        still, known = {}, self.bodies
        for name, body in known.items():
            still[name] = replace(body, eccentricity=0.0, offset=(0.0, 0.0))
        self.bodies = still
        found = super().errors(j, side, t)
        self.bodies = known
        return found

    def gap(self, j, side, t, z):
        """As of `Reference`."""
        if side:
            return super().gap(j, side, t, z)
        e, v = self.errors(j, side, t)
        row = self.far[j]
        return row @ z[: self.n] + e + self.train.meshes[j].backlash, row @ z[self.n :] + v

    def right_side(self, codes, levels):
        """As of `Reference`: its forces in the backlash, and those of the coast sides."""
        others = super().right_side([max(code, 0) for code in codes], levels)
        coast = [j for j, code in enumerate(codes) if code < 0]

        def f(t, z):
            rate = others(t, z)
            for j in coast:
                mesh, (c, way) = self.train.meshes[j], levels[j][0]
                distance, speed = self.gap(j, 0, t, z)
                along = (mesh.material_damping - mesh.backlash_damping) * speed
                force = (c * distance + along) * self.far[j]
                force -= mesh.friction[1] * way * c * distance * self.sliding[j]
                rate[self.n :] -= self.inverse * force
            return rate

        return f


@pytest.mark.parametrize("seed", range(12))
def test_two_gears_move_as_six_degrees_do(seed):
    six, train = six_degrees(np.random.default_rng(seed), moving=True)
    n, coordinates = train.size // 2, train.structure.coordinates
    state = six.propagator(0.8).start((0.0, -2.0))
    names = ["u3", "u2", *[("y3", "z3", "y2", "z2")[i] for i in six.flexible()]]
    order = [names.index(dict(x="y", y="z", u="u")[axis] + body) for body, axis in coordinates]
    whole = tuple(state[[*order, *[n + i for i in order]]])
    span = {"periods": 6, "record_periods": 6}
    one = simulate(six, 0.8, initial_state=tuple(state), **span)
    other = simulate(train, 0.8, initial_state=whole, **span)
    assert one.event_to.values.tolist() == other.event_to.values.tolist()
    for name in ("displacement", "velocity", "dynamic_force"):
        np.testing.assert_allclose(other[name].squeeze(), one[name], rtol=0, atol=1e-9)


@pytest.mark.parametrize("seed", range(10))
def test_random_trains_against_forces_body_by_body(seed):
    train, tuning, state = random_problem(np.random.default_rng(seed))
    if any(np.isinf(body.support_stiffness).any() for body in train.bodies if body.carrier):
        pytest.skip("rigid pins")
    deflection = train.static_deflection
    # Little backlash, so that coast sides touch; not so little that supports might close it.
    train = moved(train, backlash=1.5 * deflection)
    half, options = train.size // 2, {"events": True, "rtol": 1e-12, "atol": 1e-12}
    end, events = Moving(train, tuning).run(state, 2)
    phase = state * np.repeat([1.0, 1.0 / tuning], half)
    span = {"periods": 2, "record_periods": 2, "initial_state": tuple(phase)}
    run = simulate(train, tuning, **span)
    if int(run.status):
        pytest.skip("flanks jam")
    assert run.event.size == len(events)
    found = run.final_state.values * np.repeat([1.0, tuning], half)
    np.testing.assert_allclose(found, end, rtol=0, atol=1e-9 * max(1.0, np.abs(end).max()))
    other = simulate(train, tuning, method="scipy", options=options, **span)
    assert other.event.size == run.event.size
    np.testing.assert_allclose(other.final_state, run.final_state, rtol=0, atol=1e-8)


def test_axes_that_give_do_not_close_the_backlash():
    """The paper's reducer on soft axes: the coast sides of an unloaded branch stay open."""
    reducer = gearlib.split_power_reducer(PAPER, support_stiffness=2e7)
    run = {"periods": 20, "record_periods": 2, "initial_state": "static"}
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
