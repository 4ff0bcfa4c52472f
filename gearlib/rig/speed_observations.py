"""What a fit compares of slow sweeps: speeds of both jumps and of the onset of contact loss.

Jumps are folds of the branch of orbits, the onset is a grazing. With one degree of freedom they are
those of the main resonance. With more coordinates the branch is followed.
"""

import numpy as np
from scipy.optimize import brentq

from gearlib.analysis.orbits.continuation import continue_orbit
from gearlib.analysis.orbits.jumps import main_resonance
from gearlib.analysis.orbits.shooting import NoOrbit, periodic_orbit
from gearlib.analysis.orbits.special_points import FOLD
from gearlib.analysis.orbits.tracing import Lost
from gearlib.rig.fitted_curves import Place
from gearlib.rig.orbit_at_speed import OrbitAtSpeed
from gearlib.runs.sweeping import sweep

#: Name of a speed -> name of the quantity of `main_resonance`.
SPEEDS = {"jump_up": "jump_up", "jump_down": "jump_down", "onset_of_contact_loss": "onset"}
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

    @property
    def size(self):
        """How many residuals there are."""
        return len(self.speeds)

    @property
    def blocks_of_noise(self):
        """How many residuals, and whether their deviation stays as it is."""
        return [(self.size, True)]

    def sequences(self, residuals):
        """Return nothing: speeds of different events have no order."""
        return {}

    def residuals(self, model):
        """Return the residuals, None where there are none."""
        try:
            speeds = self._speeds_of(model)
        except (NoOrbit, Lost, ArithmeticError, ValueError):
            return None
        return np.array(
            [
                (speeds[name] - speed) / self.deviations[name] if name in speeds else _NONE
                for name, speed in self.speeds.items()
            ]
        )

    def curves(self, model):
        """Return each speed measured and that of the model."""
        places = []
        for (name, speed), residual in zip(self.speeds.items(), self.residuals(model), strict=True):
            deviation = self.deviations[name]
            fitted = np.nan if residual == _NONE else speed + deviation * float(residual)
            places.append(Place(name.replace("_", " "), speed, deviation, fitted))
        return places

    def deepest(self, model):
        """Return the largest way into the backlash that the data know, m."""
        return 0.0

    def _speeds_of(self, model):
        """Return name -> speed of a model, rpm; what it does not have is left out."""
        rate = float(model.speed(1.0))
        if model.size == 2 and model.repeats == 1:
            points = main_resonance(model, [SPEEDS[name] for name in self.speeds])
            if points.lost:
                raise Lost
            tunings = {name: getattr(points, SPEEDS[name]) for name in self.speeds}
            return {name: rate * nu for name, nu in tunings.items() if np.isfinite(nu)}
        speeds = self._speeds_of_folds(model)
        if "onset_of_contact_loss" in self.speeds:
            onset = self._onset(model)
            speeds |= {} if onset is None else {"onset_of_contact_loss": onset}
        return speeds

    def _speeds_of_folds(self, model):
        """Return name of a jump -> speed of the fold next to what was measured."""
        jumps = [name for name in self.speeds if name.startswith("jump")]
        if not jumps:
            return {}
        rate, speeds = float(model.speed(1.0)), {}
        tunings = {name: self.speeds[name] / rate for name in jumps}
        orbit = periodic_orbit(model, _ABOVE * max(tunings.values()))
        branch = continue_orbit(orbit, to=_BELOW * min(tunings.values()))
        folds = branch.tuning.values[branch.label.values == FOLD]
        # From above a resonance is entered at its lower fold and left at its upper one.
        for name, tuning in tunings.items():
            candidates = folds[: 2 * (folds.size // 2)][name != "jump_down" :: 2]
            if candidates.size:
                speeds[name] = rate * float(candidates[np.abs(candidates - tuning).argmin()])
        return speeds

    def _onset(self, model):
        """Return the speed of the onset nearest to what was measured, or None."""
        measured = self.speeds["onset_of_contact_loss"]
        speeds = measured * _AROUND
        run = sweep(model, speeds / float(model.speed(1.0)), direction="up", **_SETTLING)
        above = run.displacement_min.values.reshape(speeds.size, -1).min(axis=1)
        steps = np.flatnonzero((above[1:] > 0.0) != (above[:-1] > 0.0))
        if not steps.size:
            return None
        i = steps[np.abs(speeds[steps] - measured).argmin()]
        state = run.final_state.values[i]

        def least(speed):
            return OrbitAtSpeed(model, speed, state).least

        return brentq(least, speeds[i], speeds[i + 1], xtol=1e-12 * measured, rtol=1e-14)
