"""Select the computed data of one configuration that a statement of the paper needs."""

from collections.abc import Sequence

import numpy as np
import xarray as xr

#: Displacements down to this much below zero count as contact. It is far above rounding errors,
#: 1e-14, and far below the width of a plotted line: undamped motions touch y = 0 in every period.
CONTACT_TOLERANCE = 1e-6
#: Resolution in tuning of the plot from which the paper reads nu = 0.8 and 1.12.
PLOT_RESOLUTION = 0.01


class NoData(Exception):
    """The configuration has no data for a statement; the message says which are missing."""


class Data:
    """The computed data of one configuration; methods select those that a statement needs."""

    def __init__(self, pair, dampings, resonance, phase_planes, phase_lag, jump, scenes) -> None:
        """Take a `GearPair`, dampings by name, and datasets; `gearlib.studies.claims` has details.

        `jump` has the jump of the motion from rest, `scenes` maps names to sets of simulated cases.
        """
        self.phase_lag, self.jump, self.scenes = phase_lag, jump, scenes
        self.pair, self.resonance, self.phase_planes = pair, resonance, phase_planes
        #: Name of a damping -> whether it has material damping, and backlash damping.
        self.dampings = {
            name: (values["material_damping"] > 0.0, values["backlash_damping"] > 0.0)
            for name, values in dampings.items()
        }

    def damping_names(self, material=None, backlash=None) -> list[str]:
        """Return the names of dampings with or without (None: either) both kinds of damping."""
        damping_names = [
            name
            for name, (has_material, has_backlash) in self.dampings.items()
            if material in (None, has_material) and backlash in (None, has_backlash)
        ]
        if not damping_names:
            raise NoData("no such damping combination is configured")
        return damping_names

    def curve(self, damping: str, lowest: float, highest: float) -> xr.Dataset:
        """Return the response curve from zero initial states, from tuning `lowest` to `highest`."""
        if "cold" not in self.resonance.direction.values:
            raise NoData("no cold resonance characteristic is configured")
        tuning = self.resonance.tuning.values
        # Tunings are decimals and may differ from the limits by rounding errors.
        tolerance = 1e-9
        selected = (tuning >= lowest - tolerance) & (tuning <= highest + tolerance)
        starts_late = tuning[0] > lowest + PLOT_RESOLUTION
        ends_early = tuning[-1] < highest - PLOT_RESOLUTION
        if not selected.any() or starts_late or ends_early:
            raise NoData(f"the configured tunings do not cover {lowest:g} ... {highest:g}")
        curve = self.resonance.sel(damping=damping, direction="cold").isel(tuning=selected)
        if (curve.status != 0).any():
            raise NoData(f"some runs of {damping} stopped early")
        return curve

    def scene(self, figure: str, cases: int | None = None) -> xr.Dataset:
        """Return the simulated cases that reproduce a figure of the paper, such as "fig4".

        A scene is a dataset of time histories and summaries along the dimension "case"; the first
        one whose name begins with `figure` is used. Raise NoData if there is none, or if its number
        of cases is not `cases` (None: any number).
        """
        scenes = [scene for name, scene in sorted(self.scenes.items()) if name.startswith(figure)]
        if not scenes or cases not in (None, scenes[0].sizes["case"]):
            raise NoData(f"no scene {figure}{f' of {cases} cases' if cases else ''} is configured")
        if (scenes[0].status != 0).any():
            raise NoData("some of the runs stopped early")
        return scenes[0]

    def planes(self, damping: str, tunings: Sequence[float]) -> xr.Dataset:
        """Return the phase portraits of one damping at some tunings."""
        configured = self.phase_planes.tuning.values
        for tuning in tunings:
            if not np.isclose(configured, tuning, rtol=0.0, atol=1e-9).any():
                raise NoData(f"no phase plane at nu = {tuning:g} is configured")
        planes = self.phase_planes.sel(damping=damping)
        planes = planes.sel(tuning=list(tunings), method="nearest")
        if (planes.status != 0).any():
            raise NoData("some of the runs stopped early")
        return planes
