"""The explorer's page of one pair: its sliders, and the figures of its motion."""

import numpy as np

from gearlib import config
from gearlib.models.pair import GearPair
from gearlib.pages.explorer import view
from gearlib.pages.explorer.motion import Motion
from gearlib.pages.explorer.slider_page import SliderPage

#: Tunings of the characteristic.
POINTS = 500

#: Label, and unit of the slider in SI.
_LABELS = {
    "tuning": ("tuning ν", 1.0),
    "damping": ("damping ratio β", 1.0),
    "backlash_damping": ("damping ratio in the backlash β_m", 1.0),
    "stiffness_ratio": ("stiffness ratio κ", 1.0),
    "contact_ratio": ("contact ratio ε", 1.0),
    "backlash": ("backlash, µm", 1e-6),
    "load": ("load, N", 1.0),
}


class Page(SliderPage):
    """Sliders that stand for a `view.Setting`, and the figures of its `view.View`."""

    def __init__(self, mapping, damping):
        self.mapping, self.damping = mapping, damping
        settings = config.load(mapping)
        self.base = pair = GearPair(**settings.pair_parameters(damping))
        grid = settings.resonance
        self.grid = np.linspace(grid.start, grid.stop, POINTS)
        self.motion = Motion("tuning ν")
        setting = view.Setting.of(pair, settings.phase_planes.tunings[0])
        backlash = view.finite_backlash(pair)
        ranges = {
            "tuning": (float(grid.start), float(grid.stop), 0.0005),
            "damping": (0.0, max(0.3, 2.0 * setting.damping), 0.0005),
            "backlash_damping": (0.0, max(0.3, 2.0 * setting.backlash_damping), 0.0005),
            "stiffness_ratio": (0.05, 1.0, 0.0005),
            "contact_ratio": (1.0, 2.0, 0.001),
            "backlash": (0.0, max(200.0, 3e6 * backlash), 0.5),
            "load": (0.05 * pair.load, 5.0 * pair.load, 0.01 * pair.load),
        }
        super().__init__(_LABELS, ranges, {**vars(setting), "backlash": backlash})

    def setting(self):
        """Return what the sliders say."""
        return view.Setting(**self.values())

    def figures(self):
        """Return the figures."""
        return self.motion.figures()

    def draw(self, setting):
        """Draw what is seen at a setting, and return it in words."""
        pair = setting.pair(self.base)
        seen = view.look(pair, setting.tuning, self.grid)
        words = self.motion.draw(seen, setting.tuning)
        return f"{pair.speed(setting.tuning):.0f} rpm. {words}"

    def configuration(self, setting):
        """Return the text of a config.yaml that computes what is seen."""
        return view.configuration(self.mapping, self.damping, setting)
