"""What a fit compares of slow sweeps point by point: statistics on a named branch.

A branch is followed from its own end: of a sweep that jumps the points before the jump are reached
from the first speed, those behind it from the last one, back. So each has its own branch, also
where the model jumps elsewhere, and a point beyond the fold of the model keeps the value next to
it. The jump itself is compared as a speed.
"""

import numpy as np
import xarray as xr

from gearlib import checks
from gearlib.analysis.orbits.shooting import NoOrbit
from gearlib.rig.fitted_curves import Curve
from gearlib.rig.orbit_at_speed import ORDER, SAMPLES, SHARING, STATISTICS, OrbitAtSpeed
from gearlib.rig.projection import projected
from gearlib.runs.sweeping import sweep

#: A step from one point to the next that is a jump: share of the value, and times the step before.
_JUMP, _STEEP = 0.15, 3.0
#: What grows with the motion or, the first of them, falls.
_LOW = ("displacement_min", "dynamic_force_min")
_HIGH = (*_LOW, "_max", *(f"{ORDER}_{k}" for k in range(1, 10)))
#: Mesh periods at each speed: what deviates dies out, Newton's method does the rest.
SETTLING = {"periods": 200, "record_periods": 1}


def channels(model, data, known=(*STATISTICS, SHARING, ORDER)):
    """Return name of a variable -> (what it is of `OrbitAtSpeed.of`, number of its mesh).

    Of trains the mesh comes after what is measured, ``load_sharing_sun_1``.
    """
    meshes, found = [name.replace(" ", "_") for name in model.mesh_names], {}
    for name in map(str, data.data_vars):
        for j, mesh in enumerate(meshes or [""]):
            what = name.removesuffix(f"_{mesh}") if mesh else name
            number = what.removeprefix(f"{ORDER}_")
            kind = ORDER if number.isdigit() and int(number) > 0 else what
            if kind in known and (what != name or not mesh) and (mesh or what != SHARING):
                found[name] = what, j
    return found


class BranchStatistics:
    """Statistics of motions over speed, each direction with its own branches."""

    kind = "branches"

    def __init__(self, data, model):
        self.channels = channels(model, data)
        self.names = list(self.channels)
        self.measured = {name: np.asarray(data[name].values, float) for name in self.names}
        self.sensor = {name: data[name].attrs for name in self.names}
        speeds = np.asarray(data.speed.values, float)
        checks.require((speeds > 0.0).all(), "speed", float(speeds.min()), "> 0 in each sample")
        for name, values in self.measured.items():
            said = "more than one value, or each with a known noise"
            checks.require(np.ptp(values) > 0.0 or self._noise(name), name, values[0], said)
        self.noise = all(self._noise(name) for name in self.names)
        #: Name -> standard deviation of each sample; a scale where it is unknown.
        self.deviations = {name: self._deviations(name, data) for name in self.names}
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

    @property
    def size(self):
        """How many residuals there are."""
        return len(self.names) * len(self.speeds)

    @property
    def blocks_of_noise(self):
        """How many residuals each statistic has, and whether its noise is known."""
        return [(len(self.speeds), bool(self._noise(name))) for name in self.names]

    def sequences(self, residuals):
        """Return residuals of unknown noise in the order of the branches: name -> (1, points)."""
        rows, order = residuals.reshape(len(self.names), -1), np.concatenate(self.branches)
        return {
            name: row[None, order]
            for name, row in zip(self.names, rows, strict=True)
            if not self._noise(name)
        }

    @property
    def eliminated(self):
        """How many numbers are taken from the data besides the parameters."""
        return sum(sum(self._unknown(name)) for name in self.names)

    def _unknown(self, name):
        """Return whether gain and offset of a sensor are unknown, 0 or 1."""
        attrs = self.sensor[name]
        return int(attrs.get("unknown_gain", 0)), int(attrs.get("unknown_offset", 0))

    def _deviations(self, name, data):
        own = data.get(f"{name}_noise_std")
        if own is not None and (own.values > 0.0).all():
            return own.values.astype(float)
        return np.full(data.speed.size, self._noise(name) or np.ptp(self.measured[name]))

    def _noise(self, name):
        return float(self.sensor[name].get("noise_std", 0.0))

    def _part(self, way, own, speeds):
        """Part a sweep at its largest jump, up of rising speeds, if there is one."""
        high = [name for name in self.names if self.channels[name][0].endswith(_HIGH)]
        signs = [-1.0 if self.channels[name][0] in _LOW else 1.0 for name in high]
        names = high or self.names
        table = np.array([self.measured[name][own] for name in names])
        table[: len(signs)] *= np.array(signs).reshape(-1, 1)
        i = _jump(table, [3.0 * self._noise(name) for name in names], way if high else 0)
        if i is None:
            self.branches.append(own)
            return
        self.branches += [own[:i], own[i:][::-1]]
        a, b = speeds[own[i - 1]], speeds[own[i]]
        # Anywhere between two points: a rectangle's standard deviation.
        attrs = {"units": "min-1", "noise_std": abs(b - a) / np.sqrt(12.0)}
        name = "jump_up" if way > 0 else "jump_down"
        self.jumps[name] = xr.DataArray(0.5 * (a + b), attrs=attrs)

    def residuals(self, model):
        """Return the residuals, None where a motion could not go on."""
        count, points = len(self.speeds), np.empty(len(self.speeds), object)
        samples = SAMPLES if any(ORDER in name for name in self.names) else 1
        try:
            for own in self.branches:
                points[own] = _followed(model, self.speeds[own], samples)
        except (NoOrbit, ValueError):
            return None
        residuals = []
        for name, which in self.channels.items():
            noise = self.deviations[name]
            values = np.array([point.of(*which) for point in points]) / noise
            gain, offset = self._unknown(name)
            basis = np.ones((count, offset)) / noise[:, None]
            residuals.append(projected(self.measured[name] / noise, values, basis, bool(gain))[0])
        return np.concatenate(residuals)

    def curves(self, model):
        """Return the statistics over the speed, each a `Curve`."""
        apart = self.residuals(model).reshape(len(self.names), -1)
        found = []
        for name, rest in zip(self.names, apart, strict=True):
            values, units = self.measured[name], self.sensor[name].get("units", "")
            fitted = values + rest * self.deviations[name]
            words = name.replace("_", " ")
            found.append(Curve(words, units, "speed", self.speeds, (values, fitted), self.falls))
        return found

    def deepest(self, model):
        """Return the largest way of the model into the backlash, m."""
        points = [one for own in self.branches for one in _followed(model, self.speeds[own])]
        return max(0.0, *(-one.least for one in points))


def _followed(model, speeds, samples=1):
    """Return the points of one branch from its first speed on.

    It ends where a motion jumps up while the speed rises, down while it falls; the other way a
    motion comes to a branch that leads on, as where it begins to strike the far flank.
    """
    rising = len(speeds) < 2 or speeds[-1] > speeds[0]
    # At a speed that comes twice the motion is the same.
    tunings, order = np.unique(speeds / float(model.speed(1.0)), return_inverse=True)
    run = sweep(model, tunings, direction="up" if rising else "down", **SETTLING)
    states = run.final_state.values[order]
    heights = run.displacement_max.values[order].reshape(len(speeds), -1).T
    end = _jump(heights, np.zeros(len(heights)), 1 if rising else -1)
    kept = len(speeds) if end is None else end
    points = [OrbitAtSpeed(model, speeds[i], states[i], samples) for i in range(kept)]
    return points + [points[-1]] * (len(speeds) - kept)


def _jump(table, least, way=0):
    """Return the first point behind the largest jump of rows of values, None without one.

    `way`: 1 of jumps up alone, -1 of jumps down.
    """
    if table.shape[1] < 2:
        return None
    steps = np.abs(np.diff(table, axis=1))
    sizes = np.maximum(np.abs(table).max(axis=1), 1e-300)[:, None]
    usual = np.median(steps, axis=1)[:, None]
    jumps = (steps > _JUMP * sizes) & (steps > _STEEP * usual) & (steps > np.array(least)[:, None])
    if way:
        jumps &= way * np.diff(table, axis=1) > 0.0
    if not jumps.any():
        return None
    return int(np.where(jumps, steps / sizes, 0.0).max(axis=0).argmax()) + 1
