"""Sections that describe the experiments: what is computed, one section for each."""

from typing import Annotated, ClassVar, Literal

from pydantic import Field, model_validator

from gearlib import tunings
from gearlib.config.types import (
    Colour,
    DampingCoefficient,
    DampingName,
    Finite,
    Grid,
    Harmonic,
    Name,
    NonNegative,
    Positive,
    PositiveDampingCoefficient,
    Section,
    Start,
    Step,
    Stop,
    Truth,
    Tuning,
    check_count,
    integer_within,
    listing,
    number_within,
)


class Resonance(Section):
    """The resonance characteristic (Fig. 3): a grid of tunings, computed in windows."""

    start: Start = 0.5
    stop: Stop = 1.4
    step: Step = 0.0005
    window: Tuning = Field(
        default=0.9, description="Tunings of one job of a cold sweep; a whole multiple of step."
    )
    directions: listing(
        Literal["cold", "up", "down"],
        "cold: every tuning from the initial state; up, down: the state is carried along.",
    ) = ["cold", "up", "down"]

    @model_validator(mode="after")
    def _check(self):
        if self.stop <= self.start:
            raise ValueError(
                f"resonance.stop = {self.stop!r} is not allowed: it must be greater than "
                f"resonance.start = {self.start!r}"
            )
        # Beyond what decimals count; how many there may be depends on the dampings as well.
        check_count("resonance.step", self.start, self.stop, self.step, 10**12)
        if tunings.steps(self.start, self.stop, self.step) % 1:
            raise ValueError(
                f"resonance.stop = {self.stop!r} is not allowed: it must be resonance.start = "
                f"{self.start!r} plus a whole multiple of resonance.step = {self.step!r}"
            )
        if tunings.steps(0.0, self.window, self.step) % 1:
            raise ValueError(
                f"resonance.window = {self.window!r} is not allowed: it must be a whole multiple "
                f"of resonance.step = {self.step!r}"
            )
        return self

    def count(self):
        """Return the number of tunings of the grid."""
        return int(tunings.steps(self.start, self.stop, self.step)) + 1

    def windows(self, direction):
        """Return the (first, last) tunings of the jobs of one direction.

        Up and down sweeps carry the state from tuning to tuning: one window holds them all.
        """
        if direction == "cold":
            return tunings.windows(self.start, self.stop, self.step, self.window)
        return [(self.start, self.stop)]


class PhasePlanes(Section):
    """The phase planes (Fig. 5): one run for each tuning and damping."""

    tunings: listing(Tuning, "Tunings nu, one row of phase planes each.") = [
        0.6,
        0.66,
        0.78,
        0.8,
        0.81,
        0.82,
    ]


class PhaseLag(Grid):
    """The phase lag of the motion behind the mesh stiffness (Fig. 2)."""

    key: ClassVar = "phase_lag"

    start: Start = 0.56
    stop: Stop = 0.79
    step: Step = 0.005
    material_dampings: listing(
        DampingCoefficient,
        "Material damping k_1 of each curve, N s/m. Default: the largest, and a hundredth of it.",
    )
    tuning: Tuning = Field(default=0.72, description="Tuning of the courses.")
    harmonics: integer_within(ge=1, le=20) = Field(
        default=5, description="Harmonics of the mesh period measured."
    )
    periods: integer_within(ge=1, le=1_000_000) = Field(
        default=6000, description="Mesh periods of a run, to settle."
    )


class Jump(Grid):
    """Where the motion from rest jumps between two orbits, and what moves it (beside Fig. 6)."""

    key: ClassVar = "jump"

    start: Start = 0.78
    stop: Stop = 0.86
    step: Step = 0.001
    damping: DampingName
    resolution: number_within(gt=0, le=0.1) = Field(
        default=1e-08, description="Width of the tuning interval to which the jump is bisected."
    )
    harmonics: listing(
        Harmonic, "Numbers of stiffness harmonics instead of the full rectangle."
    ) = [1, 2, 3, 5, 10, 20]
    factors: listing(Positive, "Factors on the damping, and on the backlash.") = [
        0.5,
        0.8,
        0.9,
        0.95,
        1.05,
        1.1,
        1.25,
        2.0,
    ]
    displacements: listing(Finite, "Other initial displacements, static deflections.") = [
        -1.0,
        -0.5,
        -0.1,
        0.1,
        0.5,
        1.0,
        2.0,
    ]
    velocities: listing(Finite, "Other initial velocities, static deflections per radian.") = [
        -1.0,
        -0.5,
        -0.1,
        0.1,
        0.5,
        1.0,
    ]
    tolerances: listing(
        number_within(gt=0, le=0.1), "Relative tolerances of a 4(5) pair without event location."
    ) = [1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8]
    starts: integer_within(ge=1, le=1000) = Field(
        default=8, description="Seeded starts with every tolerance."
    )
    seed: integer_within(ge=0, le=1_000_000) = Field(
        default=1, description="Of the random displacements at the start."
    )
    spread: number_within(gt=0, le=10) = Field(
        default=0.02, description="Largest of these displacements, static deflections."
    )
    marked: Annotated[
        list[Tuning],
        Field(max_length=2, description="Tunings marked in the figures, and the band between."),
    ] = []


Harmonics = integer_within(ge=1, le=100_000)


class AnalyticMethod(Grid):
    """The paper's analytic method and harmonic balance against exact orbits."""

    key: ClassVar = "analytic_method"

    start: Start = 0.3
    stop: Stop = 1.5
    step: Step = 0.02
    damping: DampingName
    shown: listing(Tuning, "Tunings of the iterations and of the errors.") = [0.45, 0.7, 1.0]
    iterations: integer_within(ge=1, le=1000) = Field(default=40, description="Iterations shown.")
    iteration_harmonics: integer_within(ge=8, le=100_000) = Field(
        default=512, description="Harmonics of the iterations shown."
    )
    harmonics: integer_within(ge=8, le=512) = Field(
        default=32, description="Harmonics of the range and of the curve."
    )
    most_degenerate: integer_within(ge=0, le=8) = Field(
        default=5, description="Degenerate harmonics at most."
    )
    balance_harmonics: listing(Harmonics, "Of the errors of harmonic balance.") = [
        4,
        8,
        16,
        32,
        64,
        128,
    ]
    schmidt_harmonics: listing(Harmonics, "Of the errors of E. Schmidt's method.") = [
        8,
        32,
        128,
        512,
        2048,
    ]


class NonlinearDamping(Grid):
    """Linear, quadratic and cubic damping that dissipate alike at one amplitude."""

    key: ClassVar = "nonlinear_damping"

    start: Start = 0.5
    stop: Stop = 1.4
    step: Step = 0.004
    damping: PositiveDampingCoefficient = Field(
        description=(
            "Linear coefficient all are equivalent to, N s/m. Default: the largest of the dampings."
        )
    )
    amplitude: Positive = Field(
        default=1.0,
        description="Amplitude of the harmonic motion at which they are, static deflections.",
    )
    tuning: Tuning = Field(
        default=0.8, description="Tuning that gives the frequency of that motion."
    )
    shown: listing(Tuning, "Tunings of the phase planes.") = [0.78, 0.82, 0.95]


class ParametricResonance(Grid):
    """Tongues of parametric resonance: the motion without loss of contact, and its stability."""

    key: ClassVar = "parametric_resonance"

    start: Tuning = Field(default=0.3, ge=0.05, description="First tuning of the chart.")
    stop: Stop = 2.4
    step: Step = 0.005
    asked: Tuning = Field(
        default=0.66, description="Tuning that the sentence about the singular region is on."
    )
    values: integer_within(ge=2, le=10_000) = Field(
        default=161, description="Values of the stiffness ratio, contact ratio and damping."
    )
    least_stiffness_ratio: number_within(ge=0.001, lt=1) = Field(
        default=0.2, description="Smallest stiffness ratio of the chart."
    )
    damping_ratios: listing(
        NonNegative, "Damping ratios whose tongues are drawn; the first one has the shades."
    ) = [0.0, 0.01, 0.03, 0.0617]


class Labels(Grid):
    """Labels of the motion from rest, chaos or artefact, marked in Fig. 3."""

    key: ClassVar = "labels"

    start: Start = 0.5
    stop: Stop = 1.4
    step: Step = 0.01
    periods: integer_within(ge=1, le=1_000_000) = Field(
        default=1500, description="Mesh periods of a run, to settle."
    )
    exponent_periods: integer_within(ge=20, le=1_000_000) = Field(
        default=2000, description="Mesh periods over which the exponent is averaged."
    )
    disturbance: Positive = Field(
        default=0.001,
        description="Added to the initial displacement in the disturbed run, static deflections.",
    )


class LociSection(Section):
    """Special points over tuning and material damping, those of the labelled branch."""

    damping: DampingName
    lowest: number_within(ge=0, le=10) = Field(
        default=0.005, description="Damping ratio at which the loci end below."
    )
    highest: number_within(gt=0, le=10) = Field(
        default=0.2, description="Damping ratio at which the loci end above."
    )

    @model_validator(mode="after")
    def _check(self):
        if self.highest <= self.lowest:
            raise ValueError(
                f"branches.loci.highest = {self.highest!r} is not allowed: it must be greater than "
                f"branches.loci.lowest = {self.lowest!r}"
            )
        return self


class Branches(Section):
    """Branches of periodic orbits behind Fig. 3, and their special points over the damping."""

    start: Tuning = Field(default=0.5, description="Tuning at which the branches begin.")
    stop: Tuning = Field(default=1.4, description="Tuning at which they end.")
    step: number_within(gt=0, le=1) = Field(
        default=0.05,
        description="Largest step, static deflections; from start to stop counts as one.",
    )
    max_height: Positive = Field(
        default=20.0, description="Height of orbits at which a branch ends, static deflections."
    )
    max_points: integer_within(ge=2, le=1_000_000) = Field(
        default=2000, description="Most points of one branch."
    )
    loci: LociSection

    @model_validator(mode="after")
    def _check(self):
        if self.stop <= self.start:
            raise ValueError(
                f"branches.stop = {self.stop!r} is not allowed: it must be greater than "
                f"branches.start = {self.start!r}"
            )
        return self


class Certificates(Section):
    """What is proven of the orbits, a file that a second program can check."""

    all_points: Truth = Field(
        default=False,
        description="Whether it holds all points of the branches, some MB; else how many hold.",
    )


class ReportPage(Grid):
    """The page of the report on which tunings are chosen: motions from rest over a grid."""

    key: ClassVar = "report_page"

    start: Start = 0.5
    stop: Stop = 1.4
    step: Step = 0.005
    periods_shown: integer_within(ge=1, le=100) = Field(
        default=2, description="Mesh periods shown, the last ones."
    )
    samples_per_period: integer_within(ge=8, le=4096) = Field(
        default=128, description="Samples per mesh period; the page grows with them."
    )

    def count(self):
        """Return the number of tunings of the grid."""
        return int(tunings.steps(self.start, self.stop, self.step)) + 1


class Figures(Section):
    """How the figures are drawn; no computation depends on it."""

    formats: listing(Literal["png", "pdf", "svg"], "File formats of every figure.") = ["png", "pdf"]
    dpi: integer_within(ge=50, le=1200) = Field(
        default=200, description="Resolution of pixel formats, dots per inch."
    )
    colours: dict[Name, Colour] = Field(
        default={}, description="Colour of each damping, '#rrggbb'. Default: one of a palette."
    )
