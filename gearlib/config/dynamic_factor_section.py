"""Section of the dynamic factor: a drawn pair, its accuracy, and the speeds."""

from pydantic import model_validator

from gearlib.config.gears_section import FZG_C, DrawnPair
from gearlib.config.types import (
    OwnStart,
    OwnStep,
    OwnStop,
    Periods,
    Recorded,
    RecordPeriods,
    Share,
    entry,
)


class DynamicFactor(Recorded):
    """Dynamic factor over speed: exact sweeps beside ISO 6336-1.

    Tunings are those of the standard, N: speed over resonance speed.
    """

    start: OwnStart = 0.1
    stop: OwnStop = 2.0
    step: OwnStep = 0.01
    pair: DrawnPair = entry(
        "The pair, both gears with their quality; by default FZG type C.",
        DrawnPair.unchecked(**FZG_C | {"backlash": 160.5e-6}),
    )
    damping_ratio: Share = entry("Damping in contact, beta.", 0.06)
    periods: Periods = 300
    record_periods: RecordPeriods = 12

    @model_validator(mode="after")
    def _check(self):
        self.check_gears("dynamic_factor.pair", self.pair)
        return self

    def check_gears(self, place, pair):
        """Refuse a `DrawnPair`, named by `place`, that has no dynamic factor."""
        for name in ("pinion", "wheel"):
            if getattr(pair, name).quality is None:
                raise ValueError(
                    f"{place}.{name}.quality is missing: it must be an integer from 1 to 11"
                )
        pair.check(place, "iso", "energy")
