"""Sections of the studies of gear pairs: experiments, scenes, basins, bifurcations, sections."""

from typing import Annotated, Literal

from pydantic import Field, model_validator

from gearlib import tunings
from gearlib.config.gear_pair_section import Damping, MeshCase
from gearlib.config.types import (
    Colour,
    DampingCoefficient,
    DampingName,
    Distance,
    Finite,
    Given,
    Grid,
    Harmonic,
    Name,
    NonNegative,
    Periods,
    Positive,
    PositiveDampingCoefficient,
    Section,
    Seeded,
    Start,
    Starts,
    Step,
    Stop,
    Tolerance,
    Truth,
    Tuning,
    check_count,
    check_grid,
    check_order,
    entry,
    listing,
    number_within,
    numbers,
    whole,
)


class Resonance(Given):
    """The resonance characteristic (Fig. 3), in windows; by default with the speed of a drawing."""

    start: Start = 0.5
    stop: Stop = 1.4
    step: Step = 0.0005
    window: Tuning = entry("Tunings of one job of a cold sweep; a whole multiple of step.", 0.9)
    lowest: Tuning = entry(
        "Tuning to which the downward sweep goes on below start until it has jumped; default: "
        "start, in the default range of drawn gears a fifth of it.",
        None,
    )
    directions: listing(
        Literal["cold", "up", "down"],
        "cold: every tuning from the initial state; up, down: the state is carried along.",
    ) = ["cold", "up", "down"]

    @model_validator(mode="after")
    def _check(self):
        check_order("resonance", self)
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


_SHOWN = (0.6, 0.66, 0.78, 0.8, 0.81, 0.82)


class PhasePlanes(Section):
    """The phase planes (Fig. 5): one run for each tuning and damping."""

    tunings: listing(Tuning, "Tunings nu, one row of phase planes each.") = list(_SHOWN)


class PhaseLag(Grid):
    """The phase lag of the motion behind the mesh stiffness (Fig. 2)."""

    start: Start = 0.56
    stop: Stop = 0.79
    step: Step = 0.005
    material_dampings: listing(
        DampingCoefficient,
        "Material damping k_1 of each curve, N s/m. Default: the largest, and a hundredth of it.",
    )
    tuning: Tuning = entry("Tuning of the courses.", 0.72)
    harmonics: whole(1, 20) = entry("Harmonics of the mesh period measured.", 5)
    periods: whole(1, 1_000_000) = entry("Mesh periods of a run, to settle.", 6000)


_FACTORS = (0.5, 0.8, 0.9, 0.95, 1.05, 1.1, 1.25, 2.0)
_DISPLACEMENTS = (-1.0, -0.5, -0.1, 0.1, 0.5, 1.0, 2.0)
_VELOCITIES = (-1.0, -0.5, -0.1, 0.1, 0.5, 1.0)


class Jump(Seeded, Grid):
    """Where the motion from rest jumps between two orbits, and what moves it (beside Fig. 6)."""

    start: Start = 0.78
    stop: Stop = 0.86
    step: Step = 0.001
    damping: DampingName
    resolution: number_within(gt=0, le=0.1) = entry(
        "Width of the tuning interval to which the jump is bisected.", 1e-08
    )
    harmonics: listing(
        Harmonic, "Numbers of stiffness harmonics instead of the full rectangle."
    ) = [1, 2, 3, 5, 10, 20]
    factors: listing(Positive, "Factors on the damping, and on the backlash.") = list(_FACTORS)
    displacements: listing(Finite, "Other initial displacements, static deflections.") = list(
        _DISPLACEMENTS
    )
    velocities: listing(Finite, "Other initial velocities, static deflections per radian.") = list(
        _VELOCITIES
    )
    tolerances: listing(
        number_within(gt=0, le=0.1), "Relative tolerances of a 4(5) pair without event location."
    ) = [1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8]
    starts: Starts = 8
    marked: Annotated[
        list[Tuning],
        Field(max_length=2, description="Tunings marked in the figures, and the band between."),
    ] = []


Harmonics = whole(1, 100_000)


_OF_BALANCE = (4, 8, 16, 32, 64, 128)
_OF_SCHMIDT = (8, 32, 128, 512, 2048)


class AnalyticMethod(Grid):
    """The paper's analytic method and harmonic balance against exact orbits."""

    start: Start = 0.3
    stop: Stop = 1.5
    step: Step = 0.02
    damping: DampingName
    shown: listing(Tuning, "Tunings of the iterations and of the errors.") = [0.45, 0.7, 1.0]
    iterations: whole(1, 1000) = entry("Iterations shown.", 40)
    iteration_harmonics: whole(8, 100_000) = entry("Harmonics of the iterations shown.", 512)
    harmonics: whole(8, 512) = entry("Harmonics of the range and of the curve.", 32)
    most_degenerate: whole(0, 8) = entry("Degenerate harmonics at most.", 5)
    balance_harmonics: listing(Harmonics, "Of the errors of harmonic balance.") = list(_OF_BALANCE)
    schmidt_harmonics: listing(Harmonics, "Of the errors of E. Schmidt's method.") = list(
        _OF_SCHMIDT
    )


class NonlinearDamping(Grid):
    """Linear, quadratic and cubic damping that dissipate alike at one amplitude."""

    start: Start = 0.5
    stop: Stop = 1.4
    step: Step = 0.004
    damping: PositiveDampingCoefficient = entry(
        "Linear coefficient all are equivalent to, N s/m. Default: the largest of the dampings."
    )
    amplitude: Positive = entry(
        "Amplitude of the harmonic motion at which they are, static deflections.", 1.0
    )
    tuning: Tuning = entry("Tuning that gives the frequency of that motion.", 0.8)
    shown: listing(Tuning, "Tunings of the phase planes.") = [0.78, 0.82, 0.95]


class ParametricResonance(Grid):
    """Tongues of parametric resonance: the motion without loss of contact, and its stability."""

    start: Tuning = Field(default=0.3, ge=0.05, description="First tuning of the chart.")
    stop: Stop = 2.4
    step: Step = 0.005
    asked: Tuning = entry("Tuning that the sentence about the singular region is on.", 0.66)
    values: whole(2, 10_000) = entry(
        "Values of the stiffness ratio, contact ratio and damping.", 161
    )
    least_stiffness_ratio: number_within(ge=0.001, lt=1) = entry(
        "Smallest stiffness ratio of the chart.", 0.2
    )
    damping_ratios: listing(
        NonNegative, "Damping ratios whose tongues are drawn; the first one has the shades."
    ) = [0.0, 0.01, 0.03, 0.0617]


class Labels(Grid):
    """Labels of the motion from rest, chaos or artefact, marked in Fig. 3."""

    start: Start = 0.5
    stop: Stop = 1.4
    step: Step = 0.01
    periods: whole(1, 1_000_000) = entry("Mesh periods of a run, to settle.", 1500)
    exponent_periods: whole(20, 1_000_000) = entry(
        "Mesh periods over which the exponent is averaged.", 2000
    )
    disturbance: Positive = entry(
        "Added to the initial displacement in the disturbed run, static deflections.", 0.001
    )


class LociSection(Section):
    """Special points over tuning and material damping, those of the labelled branch."""

    damping: DampingName
    lowest: number_within(ge=0, le=10) = entry("Damping ratio at which the loci end below.", 0.005)
    highest: Tolerance = entry("Damping ratio at which the loci end above.", 0.2)

    @model_validator(mode="after")
    def _check(self):
        check_order("branches.loci", self, "lowest", "highest")
        return self


class Branches(Section):
    """Branches of periodic orbits behind Fig. 3, and their special points over the damping."""

    start: Tuning = entry("Tuning at which the branches begin.", 0.5)
    stop: Tuning = entry("Tuning at which they end.", 1.4)
    step: number_within(gt=0, le=1) = entry(
        "Largest step, static deflections; from start to stop counts as one.", 0.05
    )
    max_height: Positive = entry(
        "Height of orbits at which a branch ends, static deflections.", 20.0
    )
    max_points: whole(2, 1_000_000) = entry("Most points of one branch.", 2000)
    loci: LociSection

    @model_validator(mode="after")
    def _check(self):
        check_order("branches", self)
        return self


class RunUps(Section):
    """Run-ups through the resonance and back, beside Fig. 3."""

    start: Start = 0.5
    stop: Tuning = entry("Tuning at which a run turns.", 1.4)
    damping: DampingName
    revolutions: listing(
        whole(1, 100_000), "Revolutions of each way, up and down: how slowly the speed changes."
    ) = [80, 320, 1280]
    orders: whole(1, 20) = entry("Mesh orders of the map of the slowest run.", 4)

    @model_validator(mode="after")
    def _check(self):
        check_order("run_ups", self)
        return self


class Certificates(Section):
    """Proofs about the orbits, in a file that a second program can check."""

    all_points: Truth = entry(
        "Whether it holds all points of the branches, some MB; else how many hold.", False
    )


class Figures(Section):
    """How the figures are drawn; no computation depends on it."""

    formats: listing(Literal["png", "pdf", "svg"], "File formats of every figure.") = ["png", "pdf"]
    dpi: whole(50, 1200) = entry("Resolution of pixel formats, dots per inch.", 200)
    colours: dict[Name, Colour] = entry(
        "Colour of each damping, '#rrggbb'. Default: one of a palette.", {}
    )


class Models(Seeded):
    """The comparison of models: what more than the smallest one would change in a scene."""

    starts: Starts = 32
    harmonics: Harmonic = entry("Harmonics of the truncated stiffness compared with.", 20)


_COURSES = (
    *("displacement", "velocity", "acceleration", "stiffness", "modified_stiffness"),
    *("dynamic_force", "friction_force", "bearing_y3", "bearing_z3", "bearing_y2"),
    *("bearing_z2"),
)
Course = Literal[_COURSES]
#: Courses that only six degrees of freedom have, and those that only friction sets off.
SIX_ONLY = {"friction_force", "bearing_y3", "bearing_z3", "bearing_y2", "bearing_z2"}
FRICTION_ONLY = {"friction_force", "bearing_z3", "bearing_z2"}

_OBSERVABLES = (
    *("displacement_max", "displacement_min", "dynamic_force_max", "dynamic_force_min"),
    *("fraction_normal", "fraction_backlash", "fraction_inverse", "fraction_min_stiffness"),
    "bounces",
)
Observable = Literal[_OBSERVABLES]


class Case(MeshCase):
    """One run of a scene: a column of its figure."""

    damping: Annotated[DampingName, Field(description="One of the dampings.")]


class Scene(Section):
    """Time courses and phase planes of a few runs, side by side."""

    model: Literal["smallest", "one_degree", "six_degrees_plain", "six_degrees"] = entry(
        "smallest: the one whose observables no larger model changes by more than the "
        "tolerance; six_degrees_plain leaves out run-out and friction."
    )
    observables: listing(Observable, "What the scene is about; compared between the models.")
    tolerance: Tolerance = entry(
        "Largest change that counts as none: displacements over the height of the orbit, "
        "forces over the height of the force, fractions and bounces as they are."
    )
    cases: Annotated[
        list[Case], Field(min_length=1, max_length=6, description="The runs, a column each.")
    ]
    courses: listing(Course, "Time courses below the phase plane, from above.")
    periods_shown: whole(1, 1000) = entry("Mesh periods shown, the last ones.")


Range = numbers(Finite, 2, "Lowest and highest initial value.")


def check_ranges(key, section):
    """Refuse ranges of initial states that are empty."""
    for name in ("displacement", "velocity"):
        low, high = getattr(section, name)
        if not low < high:
            raise ValueError(
                f"{key}.{name} = {[low, high]!r} is not allowed: the second must be greater than "
                "the first"
            )


def check_damped(key, damping):
    """Refuse a mesh without any damping where attractors are looked for."""
    if damping.material_damping == damping.backlash_damping == 0.0:
        raise ValueError(
            f"{key}.damping = 0 is not allowed: material or backlash must be > 0, for a mesh "
            "without damping has no attractors"
        )


class GlobalCase(MeshCase):
    """One panel: a mesh at one tuning."""

    damping: Damping


class SectionCase(GlobalCase):
    """One panel of the Poincare sections."""

    phase: number_within(ge=0, lt=360) = entry("Mesh phase of the section, degrees.")
    settle: whole(0, 1_000_000) = entry("Mesh periods before the section.")


class Basins(Section):
    """Basins of attraction: to which orbit the motion from each initial state comes."""

    cases: Annotated[
        list[GlobalCase],
        Field(
            min_length=1,
            max_length=12,
            description="Panels. Default: tuning 0.72, each of the dampings with material damping.",
        ),
    ]
    displacement: Range = [-6.0, 6.0]
    velocity: Range = [-6.0, 6.0]
    count: whole(2, 5000) = entry("Initial states in each direction.", 240)
    periods: Periods = 400

    @model_validator(mode="after")
    def _check(self):
        check_ranges("basins", self)
        for i, case in enumerate(self.cases):
            check_damped(f"basins.cases[{i}]", case.damping)
        return self


class Bifurcation(Grid):
    """Bifurcation diagram over the tuning, Lyapunov exponents and shares of the basins."""

    start: Start = 0.45
    stop: Stop = 0.95
    step: Step = 0.001
    damping: Annotated[
        Damping, Field(description="Default: the first of the dampings with material damping.")
    ]
    share_step: Distance = entry(
        "Distance of the tunings of the shares; stop is start + a multiple of it.", 0.01
    )
    settle: whole(0, 1_000_000) = entry("Mesh periods before the record.", 400)
    strobes: whole(1, 10_000) = entry("Stroboscopic states recorded.", 48)
    starts: whole(0, 1000) = entry("Random initial states besides up and down.", 8)
    exponent_periods: whole(20, 1_000_000) = entry(
        "Mesh periods over which an exponent is averaged.", 800
    )
    displacement: Range = [-6.0, 6.0]
    velocity: Range = [-6.0, 6.0]
    samples: whole(1, 1_000_000) = entry("Initial states of the shares.", 400)
    periods: whole(1, 1_000_000) = entry("Mesh periods of their runs.", 400)

    @model_validator(mode="after")
    def _check(self):
        check_ranges("bifurcation", self)
        check_damped("bifurcation", self.damping)
        check_grid("bifurcation", self, "share_step")
        return self


class Poincare(Section):
    """Poincare sections: states of many orbits at one mesh phase of every period."""

    cases: Annotated[
        list[SectionCase],
        Field(
            min_length=1,
            max_length=12,
            description="Panels. Default: tuning 0.66, each of the dampings.",
        ),
    ]
    displacement: Range = [-5.0, 6.0]
    velocity: Range = [-6.0, 6.0]
    orbits: whole(1, 10_000) = entry("Random initial states.", 60)
    periods: whole(20, 1_000_000) = entry("Mesh periods of the section.", 600)

    @model_validator(mode="after")
    def _check(self):
        check_ranges("poincare", self)
        return self
