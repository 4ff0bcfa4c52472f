"""What a fit compares of a time course at constant speed: the mesh orders of its orbit."""

import numpy as np

from gearlib import checks
from gearlib.analysis.orbits.shooting import NoOrbit
from gearlib.rig.branch_observations import SETTLING
from gearlib.rig.fitted_curves import Curve
from gearlib.rig.orbit_at_speed import OrbitAtSpeed
from gearlib.rig.order_observations import ORDERS, MeshOrders, regressed
from gearlib.rig.run_up_observations import RunUpOrders
from gearlib.runs.sweeping import sweep

#: How the speed was reached -> direction of the sweep, and where it begins, a share of the speed.
_WAYS = {0: ("cold", 1.0), 1: ("up", 0.5), -1: ("down", 1.6)}
#: Tunings of such a sweep, points of a mesh period that is drawn.
_STEPS, _POINTS = 40, 200
#: Samples of a mesh period for its orders, whose aliases fall with the third power.
_SAMPLES = 512


class SteadyOrders(MeshOrders):
    """A measured time course at constant speed, on the branch that its direction names."""

    kind = "time course"

    def __init__(self, model, data):
        super().__init__(model, data)
        self.speed = float(data.speed.values[0])
        checks.require(self.speed > 0.0, "speed", self.speed, "> 0")
        way = int(data.direction.values[0]) if "direction" in data.coords else 0
        self.direction, self.first = _WAYS[way]
        # Its phase is that at the time 0, as of a course.
        turns = data.time.values * self.speed / 60.0
        bounds = np.array([turns[0], np.nextafter(turns[-1], np.inf)])
        self.measured, self.share = regressed(turns, self.values, bounds, self.teeth)
        self.kept = np.ones(1, bool)

    def _point(self, model):
        tuning = self.speed / float(model.speed(1.0))
        tunings = np.linspace(self.first * tuning, tuning, 1 if self.first == 1.0 else _STEPS)
        run = sweep(model, np.sort(tunings), direction=self.direction, **SETTLING)
        state = run.final_state.values[0 if self.direction == "down" else -1]
        return OrbitAtSpeed(model, self.speed, state, _SAMPLES)

    def modelled(self, model):
        """Return the orders of a model, shape (1, ORDERS), None without an orbit."""
        try:
            return self._point(model).waves(ORDERS, self.mesh)[None]
        except (NoOrbit, ValueError):
            return None

    def curves(self, model):
        """Return the course over a mesh period, a `Curve`."""
        phase = np.linspace(0.0, 1.0, _POINTS)
        waves = np.exp(2j * np.pi * np.outer(phase, np.arange(1, ORDERS + 1)))
        own, fitted = (2.0 * (waves @ one[0]).real for one in (self.measured, self.fitted(model)))
        words = f"displacement at {self.speed:.5g} rpm"
        return [Curve(words, self.units, "phase", phase, (own, fitted), np.zeros(_POINTS, bool))]

    def deepest(self, model):
        """Return the largest way of the model into the backlash, m."""
        return max(0.0, -self._point(model).least)


def courses_of(model, data):
    """Return what is compared of time courses: each condition is a course of its own."""
    parts = [data]
    if "condition" in data.coords:
        names = data.condition.values
        groups = [np.flatnonzero(names == one) for one in dict.fromkeys(names.tolist())]
        parts = [data.isel(sample=own) for own in groups]
    steady = ["speed" in one.coords and np.ptp(one.speed.values) == 0.0 for one in parts]
    if len(parts) > 1 and not all(steady):
        raise ValueError(
            f"data has {len(parts)} conditions with time courses: each must have one speed; "
            "give run-ups as sets of their own"
        )
    return [
        SteadyOrders(model, one) if still else RunUpOrders(model, one)
        for one, still in zip(parts, steady, strict=True)
    ]
