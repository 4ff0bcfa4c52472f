"""What a fit compares of slow sweeps point by point: statistics on a named branch, onset of loss.

A branch is followed from its own end: of a sweep that jumps the points before the jump are reached
from the first speed, those behind it from the last one, back. So each has its own branch, also
where the model jumps elsewhere, and a point beyond the fold of the model keeps the value next to
it. The jump itself is compared as a speed.
"""

import numpy as np
import xarray as xr
from scipy.optimize import brentq

from gearlib import checks
from gearlib.analysis.orbits.orbit_sensitivities import orbit_sensitivities
from gearlib.analysis.orbits.shooting import NoOrbit, periodic_orbit
from gearlib.models.derivatives import slope_of
from gearlib.rig.fitted_curves import Curve, Place
from gearlib.rig.projection import projected
from gearlib.runs.sweeping import sweep

#: name -> what it is measured in: static deflections, loads, shares of time
STATISTICS = {
    "displacement_max": "length",
    "displacement_min": "length",
    "dynamic_force_max": "force",
    "dynamic_force_min": "force",
    "fraction_normal": "share",
    "fraction_backlash": "share",
    "fraction_inverse": "share",
}
#: A step from one point to the next that is a jump: share of the value, and times the step before.
_JUMP, _STEEP = 0.15, 3.0
#: Mesh periods at each speed: what deviates dies out, Newton's method does the rest.
SETTLING = {"periods": 200, "record_periods": 1}
#: Samples of a mesh period for its orders, whose aliases fall with the third power.
_SAMPLES = 1024
#: Around a measured onset of contact loss, where that of the model is looked for: shares of it.
_AROUND = np.linspace(0.7, 1.3, 61)


class Point:
    """An orbit at a speed in SI, with derivatives at this speed."""

    def __init__(self, model, speed, guess, names, orders=0):
        rate = float(model.speed(1.0))
        tuning, scales = speed / rate, _scales(model)
        orbit = periodic_orbit(model, tuning, guess=guess)
        found = orbit_sensitivities(
            orbit, (*names, "tuning"), samples_per_period=_SAMPLES if orders else 1
        )
        self.values, self.slopes, self.by_speed = {}, {}, {}
        moved = [slope_of(lambda twin: twin.speed(1.0), model, one) for one in names]
        for name, kind in STATISTICS.items():
            value, scale = float(found[name]), scales[kind]
            self.values[name] = value * scale
            by_tuning, slopes = float(found[f"d_{name}_d_tuning"]), []
            self.by_speed[name] = by_tuning * scale / rate
            for one, by_rate in zip(names, moved, strict=True):
                grown = slope_of(lambda twin, kind=kind: _scales(twin)[kind], model, one)
                own = float(found[f"d_{name}_d_{one}"]) - by_tuning * tuning / rate * by_rate
                slopes.append(own * scale + value * grown)
            self.slopes[name] = np.array(slopes)
        if orders:
            wave = np.exp(-1j * np.outer(np.arange(1, orders + 1), found.phase.values)) / _SAMPLES
            scale, own = scales["length"], wave @ found.displacement.values
            by_tuning = wave @ found.d_displacement_d_tuning.values
            #: Complex amplitudes of the displacement, m, from the first order of the mesh on.
            self.orders, slopes = own * scale, []
            for one, by_rate in zip(names, moved, strict=True):
                grown = slope_of(lambda twin: _scales(twin)["length"], model, one)
                slope = wave @ found[f"d_displacement_d_{one}"].values
                slopes.append((slope - by_tuning * tuning / rate * by_rate) * scale + own * grown)
            self.order_slopes = np.array(slopes).reshape(-1, orders).T


class BranchStatistics:
    """Statistics of motions over speed, each direction with its own branches."""

    kind = "branches"

    def __init__(self, data):
        self.names = [name for name in STATISTICS if name in data]
        self.measured = {name: np.asarray(data[name].values, float) for name in self.names}
        self.sensor = {name: data[name].attrs for name in self.names}
        speeds = np.asarray(data.speed.values, float)
        checks.require(np.isfinite(speeds).all(), "speed", "NaN", "finite in each sample")
        for name, values in self.measured.items():
            checks.require(np.isfinite(values).all(), name, "NaN", "finite in each sample")
            said = "more than one value, or each with a known noise"
            checks.require(np.ptp(values) > 0.0 or self._noise(name), name, values[0], said)
        self.noise = all(self._noise(name) for name in self.names)
        ways = data.direction.values if "direction" in data.coords else np.zeros(len(speeds))
        #: Numbers of points of each branch, in the order in which it is followed.
        self.branches, self.jumps = [], {}
        for way in np.unique(ways):
            own = np.flatnonzero(ways == way)
            own = own[np.argsort(speeds[own] * (way or 1), kind="stable")]
            if way:
                self._part(int(way), own, speeds)
            else:
                self.branches += [own[i : i + 1] for i in range(len(own))]
        self.speeds, self.falls = speeds, ways < 0

    def _noise(self, name):
        return float(self.sensor[name].get("noise_std", 0.0))

    def _part(self, way, own, speeds):
        """Part a sweep at its largest jump, if there is one."""
        table = np.array([self.measured[name][own] for name in self.names])
        i = _jump(table, [3.0 * self._noise(name) for name in self.names])
        if i is None:
            self.branches.append(own)
            return
        self.branches += [own[:i], own[i:][::-1]]
        a, b = speeds[own[i - 1]], speeds[own[i]]
        # Anywhere between two points: a rectangle's standard deviation.
        attrs = {"units": "min-1", "noise_std": abs(b - a) / np.sqrt(12.0)}
        name = "jump_up" if way > 0 else "jump_down"
        self.jumps[name] = xr.DataArray(0.5 * (a + b), attrs=attrs)

    def residuals(self, model, names):
        """Return (residuals, derivatives), None where a motion could not go on."""
        count, points = len(self.speeds), np.empty(len(self.speeds), object)
        try:
            for own in self.branches:
                points[own] = _followed(model, self.speeds[own], names)
        except (NoOrbit, ValueError):
            return None
        rest, moved = [], []
        for name in self.names:
            noise = self._noise(name) or np.ptp(self.measured[name])
            values = np.array([one.values[name] for one in points]) / noise
            slopes = np.array([one.slopes[name] for one in points]).reshape(count, -1) / noise
            offset = np.ones((count, int(self.sensor[name].get("unknown_offset", 0))))
            gain = bool(self.sensor[name].get("unknown_gain", 0))
            one = projected(self.measured[name] / noise, values, slopes, offset, gain)
            rest.append(one[0])
            moved.append(one[1])
        return np.concatenate(rest), np.vstack(moved)

    def curves(self, model):
        """Return the statistics over the speed, each a `Curve`."""
        apart = self.residuals(model, ())[0].reshape(len(self.names), -1)
        found = []
        for name, rest in zip(self.names, apart, strict=True):
            values, units = self.measured[name], self.sensor[name].get("units", "")
            fitted = values + rest * (self._noise(name) or np.ptp(values))
            words = name.replace("_", " ")
            found.append(Curve(words, units, "speed", self.speeds, values, fitted, self.falls))
        return found

    def deepest(self, model):
        """Return the largest way of the model into the backlash, m."""
        points = [one for own in self.branches for one in _followed(model, self.speeds[own], ())]
        return max(0.0, *(-one.values["displacement_min"] for one in points))


class Onset:
    """The speed at which contact is first lost: there the least displacement is zero."""

    kind = "onset of contact loss"

    def __init__(self, variable):
        self.speed = float(variable)
        self.noise = float(variable.attrs.get("noise_std", 0.0))

    def residuals(self, model, names):
        """Return (residual, derivatives), None where the model never loses contact near it."""
        speeds = self.speed * _AROUND
        run = sweep(model, speeds / float(model.speed(1.0)), direction="up", **SETTLING)
        least = run.displacement_min.values
        steps = np.flatnonzero((least[1:] > 0.0) != (least[:-1] > 0.0))
        if not steps.size:
            return None
        i = steps[np.abs(speeds[steps] - self.speed).argmin()]
        state = run.final_state.values[i]

        def at(speed):
            return Point(model, speed, state, ()).values["displacement_min"]

        try:
            place = brentq(at, speeds[i], speeds[i + 1], xtol=1e-12 * self.speed, rtol=1e-14)
            point = Point(model, place, state, names)
        except (NoOrbit, ValueError):
            # Contact is lost by a jump: there is no grazing.
            return None
        deviation = self.noise or 1e-3 * self.speed
        moved = -point.slopes["displacement_min"] / point.by_speed["displacement_min"]
        return np.array([(place - self.speed) / deviation]), moved[None] / deviation

    def curves(self, model):
        """Return the speed measured and that of the model."""
        deviation = self.noise or 1e-3 * self.speed
        fitted = self.speed + deviation * float(self.residuals(model, ())[0][0])
        return [Place(self.kind, self.speed, deviation, fitted)]

    def deepest(self, model):
        """Return the largest way into the backlash that the data know, m."""
        return 0.0


def _followed(model, speeds, names):
    """Return the points of one branch from its first speed on."""
    tunings = speeds / float(model.speed(1.0))
    rising = len(speeds) < 2 or tunings[-1] > tunings[0]
    run = sweep(model, np.sort(tunings), direction="up" if rising else "down", **SETTLING)
    order = slice(None) if rising else slice(None, None, -1)
    states = run.final_state.values[order]
    end = _jump(run.displacement_max.values[order][None], [0.0])
    kept = len(speeds) if end is None else end
    points = [Point(model, speeds[i], states[i], names) for i in range(kept)]
    return points + [points[-1]] * (len(speeds) - kept)


def _jump(table, least):
    """Return the first point behind the largest jump of rows of values, None without one."""
    if table.shape[1] < 2:
        return None
    steps = np.abs(np.diff(table, axis=1))
    sizes = np.maximum(np.abs(table).max(axis=1), 1e-300)[:, None]
    usual = np.median(steps, axis=1)[:, None]
    jumps = (steps > _JUMP * sizes) & (steps > _STEEP * usual) & (steps > np.array(least)[:, None])
    if not jumps.any():
        return None
    return int(np.where(jumps, steps / sizes, 0.0).max(axis=0).argmax()) + 1


def _scales(model):
    return {"length": model.static_deflection, "force": model.load, "share": 1.0}
