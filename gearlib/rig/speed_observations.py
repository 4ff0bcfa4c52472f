"""What a fit compares of slow sweeps: speeds of both jumps and of the onset of contact loss.

Jumps are folds of the branch of orbits, the onset is a grazing. With one degree of freedom they are
those of the main resonance, and are followed from model to model; where they are lost on the way
the resonance is searched anew. With more coordinates the branch is.
"""

import numpy as np
from scipy.optimize import brentq

from gearlib.analysis.orbits import following
from gearlib.analysis.orbits.continuation import continue_orbit
from gearlib.analysis.orbits.main_resonance import Resonance, higher
from gearlib.analysis.orbits.orbit_sensitivities import fold_sensitivities
from gearlib.analysis.orbits.shooting import NoOrbit, periodic_orbit
from gearlib.analysis.orbits.special_points import FOLD
from gearlib.analysis.orbits.tracing import Lost
from gearlib.rig.fitted_curves import Place
from gearlib.rig.orbit_at_speed import OrbitAtSpeed
from gearlib.runs.sweeping import sweep

#: Name of a speed -> (what it is of a `Resonance`, its condition).
SPEEDS = {
    "jump_up": ("jump_up", following.Fold),
    "jump_down": ("jump_down", following.Fold),
    "onset_of_contact_loss": ("onset", following.Onset),
}
#: Shares of the tunings of the highest and the lowest jump between which a branch is followed.
_ABOVE, _BELOW = 1.5, 0.7
#: Around a measured onset of contact loss, where that of a model is looked for: shares of it.
_AROUND = np.linspace(0.7, 1.3, 61)
#: Mesh periods at each speed of it.
_SETTLING = {"periods": 200, "record_periods": 1}
#: Residual of a speed that the model has not.
_NONE = 100.0


class Speeds:
    """Speeds in rpm, each with its standard deviation."""

    kind = "speeds"

    def __init__(self, speeds):
        self.speeds = {name: float(one) for name, one in speeds.items()}
        self.deviations = {
            name: float(one.attrs.get("noise_std", 0.0)) or 1e-3 * float(one)
            for name, one in speeds.items()
        }
        self.noise = all(one.attrs.get("noise_std", 0.0) for one in speeds.values())
        #: Name -> `following.Start` of the last model.
        self._last: dict = {}

    @property
    def size(self):
        """How many residuals there are."""
        return len(self.speeds)

    @property
    def blocks_of_noise(self):
        """How many residuals, and whether their deviation stays as it is."""
        return [(self.size, True)]

    def forget(self):
        """Search the speeds of the next model anew."""
        self._last = {}

    def residuals(self, model, names):
        """Return (residuals, derivatives by the parameters named), None where there are none."""
        one_degree = model.size == 2 and model.repeats == 1 and model.kind().map_rates
        try:
            found = self._followed(model, names) if one_degree else self._searched(model, names)
        except (NoOrbit, Lost, ArithmeticError, ValueError):
            return None
        rest, moved = np.full(len(self.speeds), _NONE), np.zeros((len(self.speeds), len(names)))
        for i, (name, speed) in enumerate(self.speeds.items()):
            if name in found:
                place, slopes = found[name]
                rest[i], moved[i] = place - speed, slopes
                rest[i], moved[i] = (
                    rest[i] / self.deviations[name],
                    moved[i] / self.deviations[name],
                )
        return rest, moved

    def curves(self, model):
        """Return each speed measured and that of the model."""
        rows = zip(self.speeds.items(), self.residuals(model, ())[0], strict=True)
        found = []
        for (name, speed), rest in rows:
            deviation = self.deviations[name]
            fitted = np.nan if rest == _NONE else speed + deviation * float(rest)
            found.append(Place(name.replace("_", " "), speed, deviation, fitted))
        return found

    def deepest(self, model):
        """Return the largest way into the backlash that the data know, m."""
        return 0.0

    def _followed(self, model, names):
        """Return name -> (speed, derivatives) with one degree of freedom."""
        places = {name: start.at(model)[0] for name, start in self._last.items()}
        lost = any(places.get(name) is None for name in self.speeds)
        if lost or _goes_on(model, places):
            resonance = Resonance(model)
            places = {name: getattr(resonance, SPEEDS[name][0]) for name in self.speeds}
            if _goes_on(model, places):
                branch, folds = self._folds(model, ["jump_down"])
                for name, at in folds.items():
                    places[name] = np.append(branch.state.values[at], branch.tuning.values[at])
        found, self._last = {}, {}
        rate, moved = float(model.speed(1.0)), following.speed_slopes(model, names)
        for name, y in places.items():
            if y is not None:
                self._last[name] = start = following.Start(SPEEDS[name][1](), model, y)
                slopes = rate * start.slopes(names)[2] + start.y[2] * moved
                found[name] = rate * start.y[2], slopes
        return found

    def _searched(self, model, names):
        """Return the same with more coordinates."""
        rate, found = float(model.speed(1.0)), {}
        jumps = [name for name in self.speeds if name.startswith("jump")]
        branch, places = self._folds(model, jumps)
        for name, at in places.items():
            table = fold_sensitivities(model, branch, at, names) if names else {}
            by = np.array([float(table[f"d_tuning_d_{one}"]) for one in names])
            place = float(branch.tuning[at])
            slopes = rate * by + place * following.speed_slopes(model, names)
            found[name] = place * rate, slopes
        if len(jumps) < len(self.speeds):
            onset = self._onset(model, names)
            found |= {"onset_of_contact_loss": onset} if onset else {}
        return found

    def _folds(self, model, jumps):
        """Return (branch, name of a jump -> number of its fold, next to what was measured)."""
        if not jumps:
            return None, {}
        tunings = {name: self.speeds[name] / float(model.speed(1.0)) for name in jumps}
        orbit = periodic_orbit(model, _ABOVE * max(tunings.values()))
        branch = continue_orbit(orbit, to=_BELOW * min(tunings.values()))
        folds, found = np.flatnonzero(branch.label.values == FOLD), {}
        # From above a resonance is entered at its lower fold and left at its upper one.
        for name, tuning in tunings.items():
            own = folds[: 2 * (folds.size // 2)][name != "jump_down" :: 2]
            if own.size:
                found[name] = int(own[np.abs(branch.tuning.values[own] - tuning).argmin()])
        return branch, found

    def _onset(self, model, names):
        """Return (speed, derivatives) of the onset nearest to what was measured, or None."""
        own = self.speeds["onset_of_contact_loss"]
        speeds = own * _AROUND
        run = sweep(model, speeds / float(model.speed(1.0)), direction="up", **_SETTLING)
        above = run.displacement_min.values.reshape(speeds.size, -1).min(axis=1)
        steps = np.flatnonzero((above[1:] > 0.0) != (above[:-1] > 0.0))
        if not steps.size:
            return None
        i = steps[np.abs(speeds[steps] - own).argmin()]
        state = run.final_state.values[i]

        def at(speed):
            return OrbitAtSpeed(model, speed, state, ()).least[0]

        place = brentq(at, speeds[i], speeds[i + 1], xtol=1e-12 * own, rtol=1e-14)
        _, slopes, by_speed = OrbitAtSpeed(model, place, state, names).least
        return place, -slopes / by_speed


def _goes_on(model, places):
    """Return whether a motion that jumps at its fold, going down, jumps up to a higher branch."""
    y = places.get("jump_down")
    return y is not None and higher(model, y) is not None
