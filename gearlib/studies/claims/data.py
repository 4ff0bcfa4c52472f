"""The data of one configuration, asked for by what a statement needs."""

import numpy as np

#: Displacements this little below a flank line are contact: far above rounding (1e-14), far below
#: the thickness of a line. A conservative mesh from rest touches y = 0 in every period.
TOUCH = 1e-6
#: The paper reads nu = 0.8 and 1.12 off a plot of its own resolution, 0.01.
READING = 0.01


class NoData(Exception):
    """The configuration holds no data for a statement; the message says which."""


class Data:
    """The data of one configuration, asked for by what a statement needs."""

    def __init__(self, pair, dampings, resonance, phase_planes, phase_lag, jump, scenes):
        self.phase_lag, self.jump, self.scenes = phase_lag, jump, scenes
        self.pair, self.resonance, self.phase_planes = pair, resonance, phase_planes
        self.dampings = {
            name: (values["material_damping"] > 0.0, values["backlash_damping"] > 0.0)
            for name, values in dampings.items()
        }

    def names(self, material=None, backlash=None):
        """Return the dampings with or without (None: either) material and backlash damping."""
        found = [
            name
            for name, (has_material, has_backlash) in self.dampings.items()
            if material in (None, has_material) and backlash in (None, has_backlash)
        ]
        if not found:
            raise NoData("no such damping combination is configured")
        return found

    def curve(self, name, low, high):
        """Return the cold characteristic of one damping on [low, high]."""
        if "cold" not in self.resonance.direction.values:
            raise NoData("no cold resonance characteristic is configured")
        tuning = self.resonance.tuning.values
        # Half a step of slack at most: tunings are decimals, bounds may differ by rounding.
        slack = 1e-9
        chosen = (tuning >= low - slack) & (tuning <= high + slack)
        if not chosen.any() or tuning[0] > low + READING or tuning[-1] < high - READING:
            raise NoData(f"the configured tunings do not cover {low:g} ... {high:g}")
        curve = self.resonance.sel(damping=name, direction="cold").isel(tuning=chosen)
        if (curve.status != 0).any():
            raise NoData(f"some runs of {name} could not go on")
        return curve

    def scene(self, figure, cases=None):
        """Return the scene of a figure, which must have so many cases (None: any number)."""
        found = [scene for name, scene in sorted(self.scenes.items()) if name.startswith(figure)]
        if not found or cases not in (None, found[0].sizes["case"]):
            raise NoData(f"no scene {figure}{f' of {cases} cases' if cases else ''} is configured")
        if (found[0].status != 0).any():
            raise NoData("some of the runs could not go on")
        return found[0]

    def planes(self, names, tunings):
        """Return the phase planes of some dampings at some tunings."""
        there = self.phase_planes.tuning.values
        for tuning in tunings:
            if not np.isclose(there, tuning, rtol=0.0, atol=1e-9).any():
                raise NoData(f"no phase plane at nu = {tuning:g} is configured")
        planes = self.phase_planes.sel(damping=names).sel(tuning=tunings, method="nearest")
        if (planes.status != 0).any():
            raise NoData("some of the runs could not go on")
        return planes
