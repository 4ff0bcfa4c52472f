"""One gear pair, as the explorer changes it: ratios, backlash and load."""

import math
from dataclasses import asdict
from typing import ClassVar

import numpy as np

from gearlib import config
from gearlib.config.laying import laid_over
from gearlib.models.pair import GearPair
from gearlib.pages.explorer.explored import Explored, Slider, saved, slider_of
from gearlib.pages.explorer.view import look

#: Tunings of the characteristic.
POINTS = 500


class Pair(Explored):
    """The pair of a configuration with one of its dampings, by name."""

    abscissa: ClassVar = "tuning"

    def __init__(self, mapping, damping):
        self.mapping, self.damping = mapping, damping
        self.settings = settings = config.load(mapping)
        self.base = pair = GearPair(**settings.pair_parameters(damping))
        drawn = settings.gears
        teeth = f"z {drawn.pinion.teeth}/{drawn.wheel.teeth}, drawn" if drawn else f"z {pair.teeth}"
        self.heading = f"Gear pair, {teeth}, load {pair.load:.4g} N"
        grid = settings.resonance
        self.grid = np.linspace(grid.start, grid.stop, POINTS)
        beta, beta_m, load = pair.damping_ratio, pair.backlash_damping_ratio, pair.load
        # Without a far flank: four static deflections.
        gap = pair.backlash if math.isfinite(pair.backlash) else 4.0 * pair.static_deflection
        first = settings.phase_planes.tunings[0]
        self.sliders = {
            "tuning": Slider("tuning ν", first, (float(grid.start), float(grid.stop), 0.0005)),
            "damping": Slider("damping ratio β", beta, (0.0, max(0.3, 2.0 * beta), 0.0005)),
            "backlash_damping": Slider(
                "damping ratio in the backlash β_m",
                beta_m,
                (0.0, max(0.3, 2.0 * beta_m), 0.0005),
            ),
            "stiffness_ratio": slider_of(
                GearPair, "stiffness_ratio", pair.stiffness_ratio, 0.0005, low=0.05
            ),
            "contact_ratio": slider_of(GearPair, "contact_ratio", pair.contact_ratio, 0.001),
            "backlash": slider_of(
                GearPair, "backlash", gap, 0.5, high=max(200.0, 3e6 * gap), unit=1e-6
            ),
            "load": slider_of(GearPair, "load", load, 0.01 * load, 0.05 * load, 5.0 * load),
        }

    def pair(self, setting):
        """Return the gear pair that the sliders stand for."""
        pair = self.base.replace(
            stiffness_ratio=setting.stiffness_ratio,
            contact_ratio=setting.contact_ratio,
            backlash=setting.backlash,
            load=setting.load,
        )
        critical = 2.0 * pair.reduced_mass * pair.mean_eigenfrequency
        return pair.replace(
            material_damping=setting.damping * critical,
            backlash_damping=setting.backlash_damping * critical,
        )

    def look(self, setting):
        """Return the view of a setting."""
        return look(self.pair(setting), setting.tuning, self.grid)

    def configuration(self, setting):
        """Return the text of a config.yaml: what the sliders do not touch is kept."""
        pair, first = asdict(self.pair(setting)), self.settings.gear_pair.model_dump()
        kept = {name: getattr(setting, name) for name in self.sliders if name != "tuning"}
        seen = {"phase_planes": {"tunings": [setting.tuning]}}
        # Gears that were not changed stay as they are given, by their drawing too.
        if kept != {name: getattr(self.start, name) for name in kept}:
            names = ("material_damping", "backlash_damping")
            seen["dampings"] = {self.damping: {key: pair[key] for key in names}}
        if any(pair[key] != value for key, value in first.items()):
            seen["gear_pair"] = {key: pair[key] for key in first}
        head = f"at tuning {setting.tuning:g}, damping {self.damping}."
        return saved(head, laid_over(self.mapping, seen))
