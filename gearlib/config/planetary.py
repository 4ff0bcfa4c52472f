"""Sections of the planetary train and of its studies."""

from typing import ClassVar

from pydantic import Field, model_validator

from gearlib import tunings
from gearlib.config.types import (
    Backlash,
    ContactRatio,
    DampingCoefficient,
    Grid,
    Length,
    Load,
    Mass,
    OwnStart,
    OwnStep,
    OwnStop,
    OwnTuning,
    Section,
    Started,
    Stiffness,
    integer_within,
    number_within,
    numbers,
    quantity,
)

_Frequency = quantity("Hz", "1 kHz", gt=0)
#: Beyond, teeth jam.
_PressureAngle = quantity("rad", "24.6 deg", ge=0, le=0.78)
_StructuralDamping = quantity("s", "1 us", ge=0)
_TorsionalSupport = quantity("N/m", "1e6 N/mm", ge=0)
_Teeth = integer_within(ge=3, le=10_000)
#: Below that the lower level of every contact ratio stays positive.
_Jump = number_within(gt=0, lt=1)


class Planetary(Section):
    """The planetary train of the charts, SI: that of Lin and Parker, whose mesh data are choices.

    J. Vib. Acoust. 121 (1999) 316-321. Pairs belong to the meshes of sun and ring.
    """

    planets: integer_within(ge=3, le=20) = Field(default=3, description="Equally spaced planets.")
    masses: numbers(Mass, 4, "Of sun, ring, carrier and a planet, kg.") = [0.4, 2.35, 5.43, 0.66]
    reduced_inertias: numbers(Mass, 4, "I / r^2 of the same, kg; r: base radius, of pins.") = [
        0.39,
        3.0,
        6.29,
        0.61,
    ]
    sun_base_radius: Length = Field(default=0.0387, description="m; others follow from the teeth.")
    pressure_angle: _PressureAngle = Field(default=0.42935, description="In operation, rad.")
    support_stiffness: numbers(Stiffness, 4, "Of sun, ring, carrier and planets, N/m.") = [1e8] * 4
    torsional_stiffness: numbers(
        _TorsionalSupport, 3, "Of the supports of sun, ring and carrier at their radius, N/m."
    ) = [0.0, 1e9, 0.0]
    structural_damping: _StructuralDamping = Field(
        default=1e-6, description="Damping of the supports over their stiffness, s."
    )
    mean_stiffness: numbers(Stiffness, 2, "Mean stiffness of the meshes, N/m.") = [5e8, 5e8]
    contact_ratio: numbers(ContactRatio, 2, "Contact ratios.") = [1.4, 1.6]
    material_damping: DampingCoefficient = Field(
        default=1000.0, description="While the flanks touch, N s/m."
    )
    backlash_damping: DampingCoefficient = Field(
        default=300.0, description="Of the oil in the backlash, N s/m."
    )
    backlash: Backlash = Field(default=30e-6, description="m.")
    load: Load = Field(default=2000.0, description="On every sun mesh, N.")

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

    key: ClassVar = "train_chart"

    start: OwnStart = 5.0
    stop: OwnStop = 26.0
    step: OwnStep = 0.05
    reference_frequency: _Frequency = Field(
        default=1000.0, description="What the tuning is counted in, Hz."
    )
    teeth: numbers(
        numbers(_Teeth, 2, "z_s and z_r"), 2, "Teeth of sun and ring, z_s and z_r: two phasings."
    ) = [[27, 99], [28, 98]]
    largest_jump: _Jump = Field(
        default=0.6, description="Largest jump of the stiffness over its mean."
    )
    jump: _Jump = Field(
        default=0.3, description="Jump over the mean in the plane of contact ratios."
    )
    values: integer_within(ge=2, le=1000) = Field(
        default=24, description="Values of the jump and of the contact ratio."
    )


class SymmetryBreaking(Started):
    """Where the symmetric motion of equal planets in phase breaks."""

    key: ClassVar = "symmetry_breaking"

    start: OwnStart = 9.0
    stop: OwnStop = 21.0
    step: OwnStep = 0.1
    starts: integer_within(ge=1, le=1000) = Field(
        default=8, description="Seeded starts of every motion."
    )
    reference_frequency: _Frequency = Field(
        default=1000.0, description="What the tuning is counted in, Hz."
    )
    teeth: numbers(_Teeth, 2, "Teeth of sun and ring, multiples of the number of planets.") = [
        27,
        99,
    ]
    jump: _Jump = Field(default=0.6, description="Jump of the stiffness over its mean.")
    periods: integer_within(ge=1, le=1_000_000) = Field(
        default=300, description="Mesh periods of a run beside the symmetric orbit."
    )
    record_periods: integer_within(ge=1, le=10_000) = Field(
        default=24, description="Mesh periods recorded."
    )
    samples_per_period: integer_within(ge=8, le=4096) = Field(
        default=64, description="Samples of a recorded mesh period."
    )
    shown: OwnTuning = Field(default=19.5, description="Tuning of the course; one of the grid.")
    shown_after: integer_within(ge=0, le=10_000) = Field(
        default=100, description="Mesh periods from the first start to the course."
    )
    periods_shown: integer_within(ge=1, le=10_000) = Field(
        default=4, description="Mesh periods of the course."
    )

    @model_validator(mode="after")
    def _check(self):
        if self.shown not in tunings.grid(self.start, self.stop, self.step):
            raise ValueError(
                f"symmetry_breaking.shown = {self.shown!r} is not allowed: it must be one of the "
                f"tunings from {self.start!r} to {self.stop!r} in steps of {self.step!r}"
            )
        if self.periods_shown > self.record_periods:
            raise ValueError(
                f"symmetry_breaking.periods_shown = {self.periods_shown} is not allowed: it must "
                f"be an integer from 1 to the {self.record_periods} recorded mesh periods"
            )
        return self
