"""Sections of the studies of gear pairs: experiments, scenes, basins, trials of the methods."""

from typing import Annotated, Literal, get_args

from pydantic import Field, model_validator

from gearlib import checks, tunings
from gearlib.config import types as t
from gearlib.config.gear_pair_section import Damping, MeshCase
from gearlib.config.types import Distinct, Grid, Section, Seeded, entry, grid, several, whole

#: Limit that catches a mistyped step.
MAX_TUNINGS = 1_000_000
_Settling = whole(1, 1_000_000)
_ExponentPeriods = whole(20, 1_000_000)
_Ranges = several(t.Finite, 2)
_RANGE = "Lowest and highest initial value."


class Resonance(grid(0.5, 1.4, 0.0005)):
    """The resonance characteristic (Fig. 3), in windows; by default with the speed of a drawing."""

    window: t.Tuning = entry("Tunings of one job of a cold sweep; a whole multiple of step.", 0.9)
    lowest: t.Tuning = entry(
        "Tuning to which the downward sweep goes on below start until it has jumped; default: "
        "start, in the default range of drawn gears a fifth of it.",
        None,
    )
    directions: Distinct[Literal["cold", "up", "down"]] = entry(
        "cold: every tuning from the initial state; up, down: the state is carried along.",
        ["cold", "up", "down"],
    )

    @model_validator(mode="after")
    def _check_grid(self):
        self.check_steps("step", MAX_TUNINGS)
        fits = tunings.steps(0.0, self.window, self.step) % 1 == 0
        allowed = f"a whole multiple of .step = {self.step!r}"
        checks.require(fits, ".window", self.window, allowed)
        return self

    def windows(self, direction):
        """Return the (first, last) tunings of the jobs of one direction.

        Up and down sweeps carry the state from tuning to tuning: one window holds them all.
        """
        if direction == "cold":
            return tunings.windows(self.start, self.stop, self.step, self.window)
        return [(self.start, self.stop)]


class PhasePlanes(Section):
    """The phase planes (Fig. 5): one run for each tuning and damping."""

    tunings: Distinct[t.Tuning] = entry("Tunings, a row each.", [0.6, 0.66, 0.78, 0.8, 0.81, 0.82])


class PhaseLag(grid(0.56, 0.79, 0.005)):
    """The phase lag of the motion behind the mesh stiffness (Fig. 2)."""

    material_dampings: Distinct[t.DampingCoefficient] = entry(
        "Material damping k_1 of each curve, N s/m. Default: the largest, and a hundredth of it.",
        None,
    )
    tuning: t.Tuning = entry("Tuning of the courses.", 0.72)
    harmonics: whole(1, 20) = entry("Harmonics of the mesh period measured.", 5)
    periods: _Settling = entry("Mesh periods of a run, to settle.", 6000)


class Jump(Seeded, grid(0.78, 0.86, 0.001)):
    """Jump of the motion from rest between two orbits, and what moves it (beside Fig. 6)."""

    damping: t.DampingName = None
    resolution: t.number(gt=0, le=0.1) = entry("Width to which the jump is bisected.", 1e-08)
    harmonics: Distinct[t.Count] = entry(
        "Numbers of stiffness harmonics instead of the full rectangle.", [1, 2, 3, 5, 10, 20]
    )
    factors: Distinct[t.Positive] = entry(
        "Factors on the damping, and on the backlash.", [0.5, 0.8, 0.9, 0.95, 1.05, 1.1, 1.25, 2.0]
    )
    displacements: Distinct[t.Finite] = entry(
        "Other initial displacements, static deflections.", [-1.0, -0.5, -0.1, 0.1, 0.5, 1.0, 2.0]
    )
    velocities: Distinct[t.Finite] = entry(
        "Other initial velocities, static deflections per radian.",
        [-1.0, -0.5, -0.1, 0.1, 0.5, 1.0],
    )
    tolerances: Distinct[t.number(gt=0, le=0.1)] = entry(
        "Relative tolerances of a 4(5) pair without event location.",
        [1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8],
    )
    starts: t.Starts = 8
    marked: Annotated[list[t.Tuning], Field(max_length=2)] = entry(
        "Tunings marked in the figures, with the band between them.", []
    )


class AnalyticMethod(grid(0.3, 1.5, 0.02)):
    """The paper's analytic method and harmonic balance against exact orbits."""

    damping: t.DampingName = None
    shown: Distinct[t.Tuning] = entry("Tunings of iterations and errors.", [0.45, 0.7, 1.0])
    iterations: t.Count = entry("Number of iterations shown.", 40)
    iteration_harmonics: whole(8, 100_000) = entry("Harmonics of the iterations shown.", 512)
    harmonics: whole(8, 512) = entry("Harmonics of the range and of the curve.", 32)
    most_degenerate: whole(0, 8) = entry("Largest number of degenerate harmonics.", 5)
    balance_harmonics: Distinct[whole(1, 100_000)] = entry(
        "Harmonics for the errors of harmonic balance.", [4, 8, 16, 32, 64, 128]
    )
    schmidt_harmonics: Distinct[whole(1, 100_000)] = entry(
        "Numbers of harmonics for the errors of E. Schmidt's method.", [8, 32, 128, 512, 2048]
    )


class NonlinearDamping(grid(0.5, 1.4, 0.004)):
    """Linear, quadratic and cubic damping that dissipate alike at one amplitude."""

    damping: t.PositiveDamping = entry("Linear coefficient, N s/m. Default: the largest.", None)
    amplitude: t.Positive = entry("Amplitude of equal dissipation, static deflections.", 1.0)
    tuning: t.Tuning = entry("Tuning that gives its frequency.", 0.8)
    shown: Distinct[t.Tuning] = entry("Tunings of the phase planes.", [0.78, 0.82, 0.95])


class ParametricResonance(Grid):
    """Tongues of parametric resonance: the motion without loss of contact, and its stability."""

    start: t.Tuning = entry("First tuning of the chart.", 0.3, ge=0.05)
    stop: t.Stop = 2.4
    step: t.Step = 0.005
    asked: t.Tuning = entry("Tuning of the sentence about the singular region.", 0.66)
    values: whole(2, 10_000) = entry("Number of values of both ratios and of the damping.", 161)
    least_stiffness_ratio: t.number(ge=0.001, lt=1) = entry("Smallest stiffness ratio.", 0.2)
    damping_ratios: Distinct[t.NonNegative] = entry(
        "Damping ratios whose tongues are drawn; the first one has the shades.",
        [0.0, 0.01, 0.03, 0.0617],
    )


class Labels(grid(0.5, 1.4, 0.01)):
    """Labels of the motion from rest, chaos or artefact, marked in Fig. 3."""

    periods: _Settling = entry("Mesh periods of a run, to settle.", 1500)
    exponent_periods: _ExponentPeriods = entry("Mesh periods of the mean exponent.", 2000)
    disturbance: t.Positive = entry("Disturbance of the start, static deflections.", 0.001)


def check_rising(section, low, high):
    """Refuse a range whose end is not above its beginning, by the keys of both."""
    first, last = getattr(section, low), getattr(section, high)
    checks.require(last > first, f".{high}", last, f"greater than .{low} = {first!r}")


class LociSection(Section):
    """Special points over tuning and material damping, those of the labelled branch."""

    damping: t.DampingName = None
    lowest: t.number(ge=0, le=10) = entry("Damping ratio at which the loci end below.", 0.005)
    highest: t.Tolerance = entry("Damping ratio at which the loci end above.", 0.2)

    @model_validator(mode="after")
    def _check(self):
        check_rising(self, "lowest", "highest")
        return self


class _Span(Section):
    """A range of tunings without steps."""

    start: t.Tuning
    stop: t.Tuning

    @model_validator(mode="after")
    def _check_span(self):
        check_rising(self, "start", "stop")
        return self


class Branches(_Span):
    """Branches of periodic orbits behind Fig. 3, and their special points over the damping."""

    start: t.Tuning = entry("Tuning at which the branches begin.", 0.5)
    stop: t.Tuning = entry("Tuning at which the branches end.", 1.4)
    step: t.number(gt=0, le=1) = entry("Largest step; the range of tunings counts as 1.", 0.05)
    max_height: t.Positive = entry("Height of orbits that ends a branch, static deflections.", 20.0)
    max_points: whole(2, 1_000_000) = entry("Largest number of points of one branch.", 2000)
    loci: LociSection = t.SECTION


class RunUps(_Span):
    """Run-ups through the resonance and back, beside Fig. 3."""

    start: t.Tuning = entry("First tuning.", 0.5)
    stop: t.Tuning = entry("Tuning at which a run turns.", 1.4)
    damping: t.DampingName = None
    revolutions: Distinct[whole(1, 100_000)] = entry(
        "Revolutions of each way, up and down: how slowly the speed changes.", [80, 320, 1280]
    )
    orders: whole(1, 20) = entry("Mesh orders of the map of the slowest run.", 4)


class Certificates(Section):
    """Proofs about the orbits, in a file that a second program can check."""

    all_points: t.Truth = entry("Whether the file holds every point of the branches.", False)


class Figures(Section):
    """Formats and colours of the figures; no computation depends on them."""

    formats: Distinct[Literal["png", "pdf", "svg"]] = entry("Formats of figures.", ["png", "pdf"])
    dpi: whole(50, 1200) = entry("Resolution of pixel formats, dots per inch.", 200)
    colours: dict[
        t.DampingName, t.text("a colour '#rrggbb', in quotes", pattern="^#[0-9A-Fa-f]{6}$")
    ] = entry("Colour of each damping, '#rrggbb'. Default: one of a palette.", {})


class Models(Seeded):
    """The comparison of models: what larger models than the smallest would change in a scene."""

    starts: t.Starts = 32
    harmonics: t.Count = entry("Harmonics of the truncated stiffness in the comparison.", 20)


#: Courses that only friction sets off, and all that only six degrees of freedom have.
FRICTION_ONLY = {"friction_force", "bearing_z3", "bearing_z2"}
SIX_ONLY = {"bearing_y3", "bearing_y2"} | FRICTION_ONLY
_Course = Literal[
    *("displacement", "velocity", "acceleration", "stiffness", "modified_stiffness"),
    *("dynamic_force", "friction_force", "bearing_y3", "bearing_z3", "bearing_y2", "bearing_z2"),
]
_Observable = Literal[
    *("displacement_max", "displacement_min", "dynamic_force_max", "dynamic_force_min"),
    *("fraction_normal", "fraction_backlash", "fraction_inverse", "fraction_min_stiffness"),
    "bounces",
]


class Case(MeshCase):
    """One run of a scene: a column of its figure."""

    damping: t.DampingName = entry("One of the dampings.")


class Scene(Section):
    """Time courses and phase planes of a few runs, side by side."""

    model: Literal["smallest", "one_degree", "six_degrees_plain", "six_degrees"] = entry(
        "smallest: the one whose observables no larger model changes by more than the "
        "tolerance; six_degrees_plain leaves out run-out and friction."
    )
    observables: Distinct[_Observable] = entry("Observables to compare between the models.")
    tolerance: t.Tolerance = entry(
        "Largest change that counts as none: displacements over the height of the orbit, "
        "forces over the height of the force, fractions and bounces as they are."
    )
    cases: Annotated[list[Case], Field(min_length=1, max_length=6)] = entry("Runs, a column each.")
    courses: Distinct[_Course] = entry("Time courses below the phase plane, from above.")
    periods_shown: t.Count = entry("Mesh periods shown, the last ones.")

    @model_validator(mode="after")
    def _check(self):
        t.check_different(".cases", self.cases, "title")
        lacking = {
            "one_degree": (SIX_ONLY, "the model one_degree"),
            "six_degrees_plain": (FRICTION_ONLY, "six_degrees_plain, which has no friction"),
        }
        courses, model = lacking.get(self.model, (set(), ""))
        for course in (name for name in self.courses if name in courses):
            allowed = f"a course of {model}, or the model must be six_degrees"
            raise checks.refusal(".courses", course, allowed)
        return self


class GlobalCase(MeshCase):
    """One panel: a mesh at one tuning."""

    damping: Damping


class SectionCase(GlobalCase):
    """One panel of the Poincare sections."""

    phase: t.number(ge=0, lt=360) = entry("Mesh phase of the section, degrees.")
    settle: whole(0, 1_000_000) = entry("Mesh periods before the section.")


class _States(Section):
    """Initial states of many motions, and panels with different titles."""

    displacement: _Ranges = entry(_RANGE, [-6.0, 6.0])
    velocity: _Ranges = entry(_RANGE, [-6.0, 6.0])

    @model_validator(mode="after")
    def _check_states(self):
        for key in ("displacement", "velocity"):
            low, high = getattr(self, key)
            allowed = "a lower value and a higher one"
            checks.require(low < high, f".{key}", [low, high], allowed)
        t.check_different(".cases", getattr(self, "cases", ()), "title")
        return self


def _check_damped(key, damping):
    """Refuse a mesh without any damping where attractors are looked for."""
    if damping.material_damping == damping.backlash_damping == 0.0:
        raise ValueError(
            f"{key} = 0 is not allowed: material or backlash must be > 0, for a mesh without "
            "damping has no attractors"
        )


class Basins(_States):
    """Basins of attraction: to which orbit the motion from each initial state comes."""

    cases: Annotated[list[GlobalCase], Field(min_length=1, max_length=12)] = entry(
        "Panels. Default: tuning 0.72, each of the dampings with material damping.", None
    )
    count: whole(2, 5000) = entry("Number of initial states in each direction.", 240)
    periods: t.Periods = 400

    @model_validator(mode="after")
    def _check(self):
        for i, case in enumerate(self.cases):
            _check_damped(f".cases[{i}].damping", case.damping)
        return self


class Bifurcation(_States, grid(0.45, 0.95, 0.001)):
    """Bifurcation diagram over the tuning, Lyapunov exponents and shares of the basins."""

    damping: Damping = entry("Damping. Default: the first one with material damping.", None)
    share_step: t.Distance = entry("Step of the shares of the basins.", 0.01)
    settle: whole(0, 1_000_000) = entry("Mesh periods before the record.", 400)
    strobes: whole(1, 10_000) = entry("Number of stroboscopic states recorded.", 48)
    starts: whole(0, 1000) = entry("Random initial states besides up and down.", 8)
    exponent_periods: _ExponentPeriods = entry("Mesh periods of the mean exponent.", 800)
    samples: _Settling = entry("Number of initial states of the shares.", 400)
    periods: _Settling = entry("Mesh periods of the runs from them.", 400)

    @model_validator(mode="after")
    def _check(self):
        _check_damped(".damping", self.damping)
        self.check_steps("share_step")
        return self


class Poincare(_States):
    """Poincare sections: states of many orbits at one mesh phase of every period."""

    cases: Annotated[list[SectionCase], Field(min_length=1, max_length=12)] = entry(
        "Panels. Default: tuning 0.66, each of the dampings.", None
    )
    displacement: _Ranges = entry(_RANGE, [-5.0, 6.0])
    orbits: whole(1, 10_000) = entry("Number of random initial states.", 60)
    periods: whole(20, 1_000_000) = entry("Mesh periods of the section.", 600)


class FixedStepMethod(Section):
    """A fixed-step method of the stability chart."""

    method: Literal["rk4", "newmark", "generalised_alpha"] = entry("Name of the method.")
    options: dict[t.Name, t.Finite] = entry("Its options, except the steps per period.", {})


_ALPHA = {"method": "generalised_alpha"}


class StabilityChart(grid(0.2, 2.6, 0.02)):
    """Spectral radii of fixed-step methods on the mesh without contact loss."""

    damping: t.DampingName = entry("One of the dampings. Default: the lightest.", None)
    fine_step: t.Distance = entry("Distance of the tunings of the exact spectral radius.", 0.002)
    steps: Distinct[whole(1, 100_000)] = entry(
        "Numbers of steps per mesh period.",
        [4, 5, 6, 8, 10, 12, 16, 20, 24, 32, 48, 64, 96, 128, 192, 256],
    )
    methods: dict[t.Name, FixedStepMethod] = entry(
        "The methods, by the name in the picture.",
        {
            "rk4": {"method": "rk4"},
            "newmark": {"method": "newmark"},
            "generalised_alpha": _ALPHA | {"options": {"spectral_radius": 0.8}},
            "generalised_alpha-0": _ALPHA | {"options": {"spectral_radius": 0.0}},
        },
        min_length=1,
    )


#: Names of `gearlib.methods()`, kept here so that a start need not load the numerical stack.
MethodName = Literal[
    *("exact", "taylor", "rk4", "rk45", "newmark", "generalised_alpha"),
    *("scipy", "smoothed", "heyoka"),
]
#: The package that each peer is imported from; where it is not installed, the peer is left out.
PEERS = {"heyoka": "heyoka"}


class Trial(Section):
    """One method with its options: a column of the matrix of failures."""

    name: t.text(f"a text matching {t.NAME}", pattern=t.NAME) = entry(
        "Name in the figure and in the data."
    )
    method: MethodName = entry("Name of the method, see `gearlib.methods`.")
    options: dict[t.Name, t.Option] = entry("Options that are not the defaults.", {})


def _trial(name, method, **options):
    return {"name": name, "method": method, "options": options}


class Failures(Section):
    """The methods that are tried on difficult problems."""

    trials: Annotated[list[Trial], Field(min_length=1, max_length=40)] = entry(
        "The methods, a column of the figure each.",
        [
            _trial("exact", "exact"),
            _trial("taylor", "taylor"),
            _trial("rk4-64", "rk4", steps_per_period=64),
            _trial("rk4-200", "rk4", steps_per_period=200),
            _trial("rk4-2000", "rk4", steps_per_period=2000),
            _trial("rk45", "rk45"),
            _trial("rk45-1e-8", "rk45", rtol=1e-8, atol=1e-10),
            _trial("newmark", "newmark"),
            _trial("alpha-frozen", "generalised_alpha", contact="frozen"),
            _trial("alpha-iterated", "generalised_alpha", contact="iterated"),
            _trial("scipy-RK45", "scipy"),
            _trial("scipy-DOP853", "scipy", solver="DOP853", rtol=1e-9, atol=1e-9),
            _trial("DOP853-split", "scipy", solver="DOP853", rtol=1e-10, atol=1e-10, events=True),
            _trial("scipy-LSODA", "scipy", solver="LSODA", rtol=1e-6, atol=1e-9),
            _trial("scipy-Radau", "scipy", solver="Radau"),
            _trial("smoothed", "smoothed"),
            _trial("heyoka", "heyoka"),
        ],
    )

    @model_validator(mode="after")
    def _check(self):
        t.check_different(".trials", self.trials, "name")
        return self


Problem = Literal[
    "smooth", "bouncing", "near_fold", "conservative", "six_degrees", "cubic", "reducer"
]


class WorkPrecision(Section):
    """Errors of the methods on test problems, against evaluations and wall time."""

    methods: Distinct[MethodName] = entry("Names of `gearlib.methods()`.", [*get_args(MethodName)])
    problems: Distinct[Problem] = entry("Names of the test problems.", [*get_args(Problem)])
    damping: t.PositiveDamping = entry("Linear damping, N s/m. Default: the largest one.", None)
    cubic_damping: t.quantity("N s^3/m^3", "5e-6 N s^3/mm^3", gt=0) = entry(
        "Cubic damping of the problem cubic, N s^3/m^3. Default: the one that has the force of "
        "`damping` at the velocity static deflection * mean eigenfrequency.",
        None,
    )
    periods: whole(1, 10_000) = entry("Mesh periods of a run.", 20)
    conservative_periods: whole(1, 10_000) = entry(
        "Mesh periods without damping, where rounding errors grow fast, and of trains.", 3
    )
    record_periods: whole(1, 100) = entry("The last periods, whose events are compared.", 3)
    repeats: t.Count = entry("Largest number of timed runs, of which the shortest counts.", 9)
