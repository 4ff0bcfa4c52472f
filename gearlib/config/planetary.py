"""Sections of the planetary train and of its studies."""

from pydantic import model_validator

from gearlib import tunings
from gearlib.config.agreement import check_most
from gearlib.config.types import (
    Grid,
    Load,
    OwnStart,
    OwnStep,
    OwnStop,
    OwnTuning,
    Section,
    Started,
    Starts,
    Stiffness,
    entry,
    like,
    number_within,
    numbers,
    quantity,
    whole,
)
from gearlib.models.trains.ready_made import planetary

_Frequency = quantity("Hz", "1 kHz", gt=0)
#: Beyond, teeth jam.
_PressureAngle = quantity("rad", "24.6 deg", ge=0, le=0.78)
_TorsionalSupport = quantity("N/m", "1e6 N/mm", ge=0)
_Teeth = whole(3, 10_000)
#: Below that the lower level of every contact ratio stays positive.
_Jump = number_within(gt=0, lt=1)


_KEYS = (
    *("masses", "reduced_inertias", "sun_base_radius", "structural_damping"),
    *("mean_stiffness", "contact_ratio", "material_damping", "backlash_damping", "backlash"),
)


_Train = like("_Train", "", planetary, *_KEYS, base=Section)


class Planetary(_Train):
    """The planetary train of the charts, SI: that of Lin and Parker, whose mesh data are choices.

    J. Vib. Acoust. 121 (1999) 316-321. Arguments of `gearlib.planetary`; here its planets are
    equally spaced, its supports elastic and its load positive.
    """

    planets: whole(3, 20) = entry("Equally spaced planets.", 3)
    pressure_angle: _PressureAngle = entry("In operation, rad.", 0.42935)
    support_stiffness: numbers(Stiffness, 4, "Of sun, ring, carrier and planets, N/m.") = [1e8] * 4
    torsional_stiffness: numbers(
        _TorsionalSupport, 3, "Of the supports of sun, ring and carrier at their radius, N/m."
    ) = [0.0, 1e9, 0.0]
    load: Load = entry("On every sun mesh, N.", 2000.0)

    def check_teeth(self, key, teeth, in_phase=False):
        """Refuse teeth of sun and ring between which the planets do not fit, or not in phase."""
        sun, ring = teeth
        if ring <= sun or (ring - sun) % 2 or (sun + ring) % self.planets:
            raise ValueError(
                f"{key} = {teeth!r} is not allowed: z_r - z_s must be even and > 0, and "
                f"(z_s + z_r) / {self.planets} an integer, for {self.planets} planets to fit"
            )
        if in_phase and sun % self.planets:
            raise ValueError(
                f"{key} = {teeth!r} is not allowed: z_s and z_r must be multiples of "
                f"{self.planets}, for {self.planets} planets to be in phase"
            )


class TrainChart(Grid):
    """Stability chart of the planetary train without damping and without loss of contact."""

    start: OwnStart = 5.0
    stop: OwnStop = 26.0
    step: OwnStep = 0.05
    reference_frequency: _Frequency = entry("What the tuning is counted in, Hz.", 1000.0)
    teeth: numbers(
        numbers(_Teeth, 2, "z_s and z_r"), 2, "Teeth of sun and ring, z_s and z_r: two phasings."
    ) = [[27, 99], [28, 98]]
    largest_jump: _Jump = entry("Largest jump of the stiffness over its mean.", 0.6)
    jump: _Jump = entry("Jump over the mean in the plane of contact ratios.", 0.3)
    values: whole(2, 1000) = entry("Values of the jump and of the contact ratio.", 24)


class SymmetryBreaking(Started):
    """Where the symmetric motion of equal planets in phase breaks."""

    start: OwnStart = 9.0
    stop: OwnStop = 21.0
    step: OwnStep = 0.1
    starts: Starts = 8
    reference_frequency: _Frequency = entry("What the tuning is counted in, Hz.", 1000.0)
    teeth: numbers(_Teeth, 2, "Teeth of sun and ring, multiples of the number of planets.") = [
        27,
        99,
    ]
    jump: _Jump = entry("Jump of the stiffness over its mean.", 0.6)
    periods: whole(1, 1_000_000) = entry("Mesh periods of a run beside the symmetric orbit.", 300)
    record_periods: whole(1, 10_000) = entry("Mesh periods recorded.", 24)
    samples_per_period: whole(8, 4096) = entry("Samples of a recorded mesh period.", 64)
    shown: OwnTuning = entry("Tuning of the course; one of the grid.", 19.5)
    shown_after: whole(0, 10_000) = entry("Mesh periods from the first start to the course.", 100)
    periods_shown: whole(1, 10_000) = entry("Mesh periods of the course.", 4)

    @model_validator(mode="after")
    def _check(self):
        if self.shown not in tunings.grid(self.start, self.stop, self.step):
            raise ValueError(
                f"symmetry_breaking.shown = {self.shown!r} is not allowed: it must be one of the "
                f"tunings from {self.start!r} to {self.stop!r} in steps of {self.step!r}"
            )
        check_most("symmetry_breaking.periods_shown", self.periods_shown, self.record_periods)
        return self
