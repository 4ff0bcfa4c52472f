"""What a fit compares of slow sweeps: the speeds of both jumps, which are folds of the branch."""

import numpy as np

from gearlib.analysis.orbits.continuation import continue_orbit
from gearlib.analysis.orbits.orbit_sensitivities import fold_sensitivities
from gearlib.analysis.orbits.shooting import NoOrbit, periodic_orbit
from gearlib.analysis.orbits.special_points import FOLD
from gearlib.models.derivatives import slope_of
from gearlib.rig.fitted_curves import Place

#: Shares of the tunings of the highest and the lowest jump between which the branch is followed.
_ABOVE, _BELOW = 1.5, 0.7
#: Residual of a jump that the model has not.
_NONE = 100.0


class Speeds:
    """Speeds of jumps in rpm, each with its standard deviation."""

    kind = "jumps"

    def __init__(self, speeds):
        self.speeds = {name: float(one) for name, one in speeds.items()}
        self.deviations = {
            name: float(one.attrs.get("noise_std", 0.0)) or 1e-3 * float(one)
            for name, one in speeds.items()
        }
        self.noise = all(one.attrs.get("noise_std", 0.0) for one in speeds.values())

    def residuals(self, model, names):
        """Return (residuals, derivatives by the parameters named)."""
        rate = float(model.speed(1.0))
        tunings = [value / rate for value in self.speeds.values()]
        try:
            orbit = periodic_orbit(model, _ABOVE * max(tunings))
            branch = continue_orbit(orbit, to=_BELOW * min(tunings))
        except (NoOrbit, ValueError):
            return None
        folds = np.flatnonzero(branch.label.values == FOLD)
        rest, moved = [], []
        for name, speed in self.speeds.items():
            # Going up the motion jumps at the higher fold, going down at the lower one.
            known = folds[np.argsort(branch.tuning.values[folds])]
            if known.size < 2:
                rest.append(_NONE)
                moved.append(np.zeros(len(names)))
                continue
            # Of the main resonance, the two next to what was measured.
            at = known[np.abs(branch.tuning.values[known] * rate - speed).argmin()]
            place = float(branch.tuning[at])
            slopes = np.zeros(len(names))
            if names:
                table = fold_sensitivities(model, branch, int(at), names)
                for i, one in enumerate(names):
                    own = slope_of(lambda twin: twin.speed(1.0), model, one)
                    slopes[i] = rate * float(table[f"d_tuning_d_{one}"]) + place * own
            deviation = self.deviations[name]
            rest.append((place * rate - speed) / deviation)
            moved.append(slopes / deviation)
        return np.array(rest), np.array(moved).reshape(len(rest), len(names))

    def curves(self, model):
        """Return each speed measured and that of the model."""
        found = []
        for (name, speed), rest in zip(
            self.speeds.items(), self.residuals(model, ())[0], strict=True
        ):
            deviation = self.deviations[name]
            fitted = np.nan if rest == _NONE else speed + deviation * float(rest)
            found.append(Place(name.replace("_", " "), speed, deviation, fitted))
        return found

    def deepest(self, model):
        """Return the largest way into the backlash that the data know, m."""
        return 0.0
