"""The undamped gear pair of the paper (Fig. 3), and the project's config.yaml as a dict."""

from pathlib import Path

import yaml

from gearlib.models.pair import GearPair

CONFIG = yaml.safe_load((Path(__file__).parents[1] / "config.yaml").read_text(encoding="utf-8"))

PARAMETERS = {
    "max_stiffness": 4e8,
    "stiffness_ratio": 0.5879,
    "contact_ratio": 1.569,
    "reduced_mass": 3.123,
    "load": 3289.5396,
    "backlash": 40e-6,
}
PAPER_PAIR = GearPair(**PARAMETERS)
