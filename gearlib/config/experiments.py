"""Sections for studies of gear pairs: experiments, scenes, basins, comparison of methods."""

from typing import Annotated, Literal, get_args

from pydantic import Field, model_validator

from gearlib import checks, tunings
from gearlib import parameters as p
from gearlib.config import types as t
from gearlib.config.gear_pair_section import Damping, MeshCase
from gearlib.config.types import (
    Distinct,
    Section,
    check_unique,
    field,
    grid_with_defaults,
    integer,
    list_of,
)
from gearlib.engines.summary_columns import COLUMNS

#: Largest number of tunings of the resonance sweep; the limit catches mistyped steps.
MAX_TUNINGS = 1_000_000
_SettlingPeriods = integer(1, 1_000_000)
_ExponentPeriods = integer(20, 1_000_000)
_Range = list_of(p.Finite, 2)
_RANGE_DOC = "Lowest and highest initial value."


class Resonance(grid_with_defaults(0.5, 1.4, 0.0005)):
    """The resonance characteristic (Fig. 3). The default range includes the speed of `gears`."""

    window: t.Tuning = field(
        "Range of tunings computed by one job of a cold sweep; a whole multiple of step.", 0.9
    )
    lowest: t.Tuning = field(
        "Lowest tuning to which the downward sweep continues below start if it has not yet jumped. "
        "Default: start; for the default range of gears given by geometry, a fifth of start.",
        None,
    )
    directions: Distinct[Literal["cold", "up", "down"]] = field(
        "cold: each run starts from the initial state; up, down: each run starts from the final "
        "state of the previous one.",
        ["cold", "up", "down"],
    )

    @model_validator(mode="after")
    def _check_grid(self):
        """Raise ValueError unless the range and the window are whole multiples of the step.

        The range of tunings is divided into windows of this width. Return the section itself, as
        pydantic requires.
        """
        self.check_steps("step", MAX_TUNINGS)
        is_multiple = tunings.count_steps(0.0, self.window, self.step) % 1 == 0
        allowed = f"a whole multiple of step = {self.step:.12g}"
        checks.require(is_multiple, "window", self.window, allowed)
        return self

    def windows(self, direction):
        """Return the first and last tuning of each job of a resonance sweep, as a list of pairs.

        A job is one process of the workflow. In a sweep with the direction "cold", all runs start
        from the same initial state and can be divided into independent jobs. A sweep "up" or "down"
        is a single job, because each run starts from the final state of the previous one.
        """
        if direction == "cold":
            return tunings.windows(self.start, self.stop, self.step, self.window)
        return [(self.start, self.stop)]


class PhasePlanes(Section):
    """The phase planes (Fig. 5): one run for each tuning and damping."""

    tunings: Distinct[t.Tuning] = field(
        "Tunings, one row each.", [0.6, 0.66, 0.78, 0.8, 0.81, 0.82]
    )


class PhaseLag(grid_with_defaults(0.56, 0.79, 0.005)):
    """The phase lag of the motion behind the mesh stiffness (Fig. 2)."""

    material_dampings: Distinct[p.Damping] = field(
        "Material damping k_1 of each curve, N s/m. Default: the largest damping, and 1 % of it.",
        None,
    )
    tuning: t.Tuning = field("Tuning of the time histories.", 0.72)
    harmonics: integer(1, 20) = field("Number of mesh harmonics evaluated.", 5)
    periods: _SettlingPeriods = field("Mesh periods of a run, including transients.", 6000)


class Jump(t.SeededStarts, grid_with_defaults(0.78, 0.86, 0.001)):
    """Jump between two orbits of the motion from rest, and what shifts it (relates to Fig. 6)."""

    damping: t.DampingName = None
    resolution: t.number(gt=0, le=0.1) = field(
        "Tuning interval at which the bisection of the jump stops.", 1e-08
    )
    harmonics: Distinct[t.Count] = field(
        "Numbers of stiffness harmonics to use instead of the full rectangle.", [1, 2, 3, 5, 10, 20]
    )
    factors: Distinct[p.Positive] = field(
        "Factors by which the damping or the backlash is multiplied.",
        [0.5, 0.8, 0.9, 0.95, 1.05, 1.1, 1.25, 2.0],
    )
    displacements: Distinct[p.Finite] = field(
        "Other initial displacements, in units of the static deflection.",
        [-1.0, -0.5, -0.1, 0.1, 0.5, 1.0, 2.0],
    )
    velocities: Distinct[p.Finite] = field(
        "Other initial velocities, in units of the static deflection per radian.",
        [-1.0, -0.5, -0.1, 0.1, 0.5, 1.0],
    )
    tolerances: Distinct[t.number(gt=0, le=0.1)] = field(
        "Relative tolerances of a Runge-Kutta 4(5) pair without event location.",
        [1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8],
    )
    starts: t.Starts = 8
    marked: Annotated[list[t.Tuning], Field(max_length=2)] = field(
        "Tunings to mark in the figures, with the band between them.", []
    )


class AnalyticMethod(grid_with_defaults(0.3, 1.5, 0.02)):
    """The paper's analytic method and harmonic balance, compared with exact orbits."""

    damping: t.DampingName = None
    shown: Distinct[t.Tuning] = field(
        "Tunings at which iterations and errors are shown.", [0.45, 0.7, 1.0]
    )
    iterations: t.Count = field("Number of iterations shown.", 40)
    iteration_harmonics: integer(8, 100_000) = field(
        "Number of harmonics of the iterations shown.", 512
    )
    harmonics: integer(8, 512) = field(
        "Number of harmonics of the convergence map and of the resonance curve.", 32
    )
    most_degenerate: integer(0, 8) = field("Largest number of degenerate harmonics.", 5)
    balance_harmonics: Distinct[integer(1, 100_000)] = field(
        "Numbers of harmonics for the errors of harmonic balance.", [4, 8, 16, 32, 64, 128]
    )
    schmidt_harmonics: Distinct[integer(1, 100_000)] = field(
        "Numbers of harmonics for the errors of E. Schmidt's method.", [8, 32, 128, 512, 2048]
    )


class NonlinearDamping(grid_with_defaults(0.5, 1.4, 0.004)):
    """Linear, quadratic and cubic damping with equal dissipation at one amplitude."""

    damping: t.PositiveDamping = field(
        "Linear coefficient, N s/m. Default: the largest damping.", None
    )
    amplitude: p.Positive = field(
        "Amplitude of equal dissipation, in units of the static deflection.", 1.0
    )
    tuning: t.Tuning = field("Tuning of equal dissipation.", 0.8)
    shown: Distinct[t.Tuning] = field("Tunings of the phase planes.", [0.78, 0.82, 0.95])


class ParametricResonance(t.Grid):
    """Tongues of parametric resonance: the motion without loss of contact, and its stability."""

    start: t.tuning(ge=0.05, le=100) = field("First tuning of the chart.", 0.3)
    stop: t.Stop = 2.4
    step: t.Step = 0.005
    asked: t.Tuning = field("Tuning at which the stability of this motion is reported.", 0.66)
    values: integer(2, 10_000) = field(
        "Number of values of the stiffness ratio, the contact ratio and the damping.", 161
    )
    least_stiffness_ratio: t.number(ge=0.001, lt=1) = field("Smallest stiffness ratio.", 0.2)
    damping_ratios: Distinct[p.NonNegative] = field(
        "Damping ratios for which tongues are drawn; the growth is shaded for the first one.",
        [0.0, 0.01, 0.03, 0.0617],
    )


class Labels(grid_with_defaults(0.5, 1.4, 0.01)):
    """Labels of the motion from rest, such as chaos or artefact, marked in Fig. 3."""

    periods: _SettlingPeriods = field("Mesh periods of a run, including transients.", 1500)
    exponent_periods: _ExponentPeriods = field(
        "Mesh periods over which the Lyapunov exponent is averaged.", 2000
    )
    disturbance: p.Positive = field(
        "Disturbance of the initial state, in units of the static deflection.", 0.001
    )


def check_increasing(section, low_key, high_key):
    """Raise ValueError for `high_key` unless its value in a section exceeds that of `low_key`."""
    low, high = getattr(section, low_key), getattr(section, high_key)
    checks.require(high > low, high_key, high, f"greater than {low_key} = {low!r}")


class LociSection(Section):
    """Loci of the special points of one branch in the plane of tuning and material damping."""

    damping: t.DampingName = None
    lowest: t.number(ge=0, le=10) = field("Lowest damping ratio of the loci.", 0.005)
    highest: t.Tolerance = field("Highest damping ratio of the loci.", 0.2)

    @model_validator(mode="after")
    def _check(self):
        """Raise ValueError unless the highest damping ratio exceeds the lowest."""
        check_increasing(self, "lowest", "highest")
        return self


class _TuningRange(Section):
    """A range of tunings without a step."""

    start: t.Tuning
    stop: t.Tuning

    @model_validator(mode="after")
    def _check_span(self):
        """Raise ValueError unless the last tuning is greater than the first."""
        check_increasing(self, "start", "stop")
        return self


class Branches(_TuningRange):
    """Branches of periodic orbits in Fig. 3, and their special points at varying damping."""

    start: t.Tuning = field("Tuning at which the branches begin.", 0.5)
    stop: t.Tuning = field("Tuning at which the branches end.", 1.4)
    step: t.number(gt=0, le=1) = field("Largest step, relative to the range of tunings.", 0.05)
    max_height: p.Positive = field(
        "Peak-to-peak displacement at which a branch ends, in units of the static deflection.", 20.0
    )
    max_points: integer(2, 1_000_000) = field("Largest number of points of one branch.", 2000)
    loci: LociSection = t.SECTION


class RunUps(_TuningRange):
    """Run-ups through the resonance and back, for comparison with Fig. 3."""

    start: t.Tuning = field("First tuning.", 0.5)
    stop: t.Tuning = field("Tuning at which the speed starts to fall again.", 1.4)
    damping: t.DampingName = None
    revolutions: Distinct[integer(1, 100_000)] = field(
        "Numbers of revolutions of the run-ups, and of the coast-downs after them.", [80, 320, 1280]
    )
    orders: integer(1, 20) = field(
        "Number of mesh orders in the order map of the slowest run-up.", 4
    )


class Certificates(Section):
    """Proofs about the orbits, in a file that an independent program can check."""

    all_points: p.Boolean = field("Whether the file contains all points of the branches.", False)


#: Regular expression for colours in a configuration.
COLOUR_PATTERN = "^#[0-9A-Fa-f]{6}$"


class Figures(Section):
    """Formats and colours of the figures; no computation depends on them."""

    formats: Distinct[Literal["png", "pdf", "svg"]] = field("Formats of figures.", ["png", "pdf"])
    dpi: integer(50, 1200) = field("Resolution of raster formats, dots per inch.", 200)
    colours: dict[
        t.DampingName, t.text("a colour '#rrggbb', in quotes", pattern=COLOUR_PATTERN)
    ] = field("Colour of each damping, '#rrggbb'. Default: a colour of the palette.", {})


class Models(t.SeededStarts):
    """Comparison of models: how the results of a scene change with a more detailed model."""

    harmonics: t.Count = field("Number of harmonics of the truncated stiffness.", 20)


#: Time histories of models with friction; time histories of models with six degrees of freedom.
FRICTION_HISTORIES = {"friction_force", "bearing_z3", "bearing_z2"}
SIX_DEGREE_HISTORIES = {"bearing_y3", "bearing_y2"} | FRICTION_HISTORIES
_TimeHistory = Literal[
    *("displacement", "velocity", "acceleration", "stiffness", "modified_stiffness"),
    *("dynamic_force", "friction_force", "bearing_y3", "bearing_z3", "bearing_y2", "bearing_z2"),
]
_Observable = Literal[*(column.name for column in COLUMNS if not column.trains_only),]


class Case(MeshCase):
    """One run of a scene: a column of its figure."""

    damping: t.DampingName = field("One of the dampings.")


class Scene(Section):
    """Time histories and phase planes of a few runs, side by side."""

    model: Literal["smallest", "pair", "six_degrees_plain", "six_degrees"] = field(
        "smallest: the simplest model whose observables change by no more than the tolerance in "
        "any larger model; six_degrees_plain: six_degrees without run-out and friction."
    )
    observables: Distinct[_Observable] = field("Observables to compare between the models.")
    tolerance: t.Tolerance = field(
        "Largest acceptable change: of displacements and forces relative to their peak-to-peak "
        "value, of fractions and numbers of bounces absolute."
    )
    cases: Annotated[list[Case], Field(min_length=1, max_length=6)] = field(
        "Runs, one column each."
    )
    courses: Distinct[_TimeHistory] = field(
        "Time histories below the phase plane, from top to bottom."
    )
    periods_shown: t.Count = field("Number of last mesh periods shown.")

    @model_validator(mode="after")
    def _check(self):
        """Raise ValueError if two titles are equal, or if the model lacks a time history.

        The model "pair" has one degree of freedom and no bearing forces; "six_degrees_plain" has
        bearings, but no friction.
        """
        check_unique("cases", self.cases, "title")
        # Model -> (time histories that it lacks, its name in the error message).
        missing_histories = {
            "pair": (SIX_DEGREE_HISTORIES, "pair"),
            "six_degrees_plain": (FRICTION_HISTORIES, "six_degrees_plain (no friction)"),
        }
        missing, model_name = missing_histories.get(self.model, ((), ""))
        for i, history in enumerate(self.courses):
            allowed = (
                f"a time history of the model {model_name}; otherwise use the model six_degrees"
            )
            checks.require(history not in missing, f"courses[{i}]", history, allowed)
        return self


class GlobalCase(MeshCase):
    """One panel: a gear pair at one tuning."""

    damping: Damping


class SectionCase(GlobalCase):
    """One panel with a Poincare section."""

    phase: t.number(ge=0, lt=360) = field("Mesh phase of the section, degrees.")
    settle: integer(0, 1_000_000) = field("Number of mesh periods before the section.")


class _InitialStates(Section):
    """Ranges of initial states of many motions."""

    displacement: _Range = field(_RANGE_DOC, [-6.0, 6.0])
    velocity: _Range = field(_RANGE_DOC, [-6.0, 6.0])

    @model_validator(mode="after")
    def _check_states(self):
        """Raise ValueError if a range of initial values is empty, or if two panels have one title.

        A range is a pair [lowest value, highest value]. Only some sections have panels (`cases`).
        """
        for key in ("displacement", "velocity"):
            low, high = getattr(self, key)
            checks.require(low < high, key, [low, high], "a lower and a higher value")
        check_unique("cases", getattr(self, "cases", ()), "title")
        return self


def _require_damping(key, damping):
    """Raise ValueError for the configuration key `key` if both coefficients of `damping` are 0.

    The coefficients apply during contact and in free flight.
    """
    allowed = "> 0 in contact or in free flight, because undamped motions have no attractors"
    is_undamped = damping.material_damping == damping.backlash_damping == 0.0
    checks.require(not is_undamped, key, 0, allowed)


class Basins(_InitialStates):
    """Basins of attraction: the orbit to which each initial state leads."""

    cases: Annotated[list[GlobalCase], Field(min_length=1, max_length=12)] = field(
        "Panels. Default: tuning 0.72, one panel for each damping with material damping.", None
    )
    count: integer(2, 5000) = field("Number of initial states in each direction.", 240)
    periods: t.Periods = 400

    @model_validator(mode="after")
    def _check(self):
        """Raise ValueError if a panel has no damping: undamped motions have no attractors."""
        for i, case in enumerate(self.cases):
            _require_damping(f"cases[{i}].damping", case.damping)
        return self


class Bifurcation(_InitialStates, grid_with_defaults(0.45, 0.95, 0.001)):
    """Bifurcation diagram over the tuning, with Lyapunov exponents and basin fractions."""

    damping: Damping = field("Damping. Default: the first one with material damping.", None)
    share_step: t.Distance = field("Step between the tunings of the basin fractions.", 0.01)
    settle: integer(0, 1_000_000) = field("Number of mesh periods before the record.", 400)
    strobes: integer(1, 10_000) = field("Number of recorded stroboscopic states.", 48)
    starts: integer(0, 1000) = field(
        "Number of random initial states, in addition to the sweeps up and down.", 8
    )
    exponent_periods: _ExponentPeriods = field(
        "Mesh periods over which the Lyapunov exponent is averaged.", 800
    )
    samples: _SettlingPeriods = field("Number of initial states for the basin fractions.", 200)
    periods: _SettlingPeriods = field("Mesh periods of each run for the basin fractions.", 400)

    @model_validator(mode="after")
    def _check(self):
        """Raise ValueError if damping is zero or the range is no whole multiple of `share_step`.

        `share_step` is the step between the tunings at which the basin fractions are computed.
        """
        _require_damping("damping", self.damping)
        self.check_steps("share_step")
        return self


class Poincare(_InitialStates):
    """Poincare sections: states of many orbits at one phase of each mesh period."""

    cases: Annotated[list[SectionCase], Field(min_length=1, max_length=12)] = field(
        "Panels. Default: tuning 0.66, one panel for each damping.", None
    )
    displacement: _Range = field(_RANGE_DOC, [-5.0, 6.0])
    orbits: integer(1, 10_000) = field("Number of random initial states.", 60)
    periods: integer(20, 1_000_000) = field("Number of mesh periods in the section.", 600)


class FixedStepMethod(Section):
    """A fixed-step integration method of the stability chart."""

    method: Literal["rk4", "newmark", "generalised_alpha"] = field("Name of the method.")
    options: dict[t.Name, p.Finite] = field(
        "Options of the method, except the number of steps per period.", {}
    )


_ALPHA = {"method": "generalised_alpha"}


class StabilityChart(grid_with_defaults(0.2, 2.6, 0.02)):
    """Spectral radii of fixed-step methods for a mesh that never loses contact."""

    damping: t.DampingName = field("One of the dampings. Default: the smallest.", None)
    fine_step: t.Distance = field("Step between the tunings of the exact spectral radius.", 0.002)
    steps: Distinct[integer(1, 100_000)] = field(
        "Numbers of steps per mesh period.",
        [4, 5, 6, 8, 10, 12, 16, 20, 24, 32, 48, 64, 96, 128, 192, 256],
    )
    methods: dict[t.Name, FixedStepMethod] = field(
        "The methods, by their names in the figure.",
        {
            "rk4": {"method": "rk4"},
            "newmark": {"method": "newmark"},
            "generalised_alpha": _ALPHA | {"options": {"spectral_radius": 0.8}},
            "generalised_alpha-0": _ALPHA | {"options": {"spectral_radius": 0.0}},
        },
        min_length=1,
    )


#: Integration method -> the optional package that it needs.
METHOD_PACKAGES = {"heyoka": "heyoka"}


class Trial(Section):
    """A method with its options, which is one column of the matrix of failures."""

    name: t.text(f"a text matching {t.NAME}", pattern=t.NAME) = field(
        "Name in the figure and in the data."
    )
    method: p.MethodName = field("Name of the method, see `gearlib.methods`.")
    options: dict[t.Name, t.Option] = field("Options that differ from the defaults.", {})


def _trial(name, method, **options):
    """Return the section `Trial` of an integration method with its options, as a dict."""
    return {"name": name, "method": method, "options": options}


class Failures(Section):
    """The methods that are applied to difficult problems."""

    trials: Annotated[list[Trial], Field(min_length=1, max_length=40)] = field(
        "The methods, one column of the figure each.",
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
        """Raise ValueError if two trials have the same name."""
        check_unique("trials", self.trials, "name")
        return self


Problem = Literal[
    "smooth", "bouncing", "near_fold", "conservative", "six_degrees", "cubic", "reducer"
]


class WorkPrecision(Section):
    """Errors of the methods for test problems, over function evaluations and wall time."""

    methods: Distinct[p.MethodName] = field(
        "Names of `gearlib.methods()`.", [*get_args(p.MethodName)]
    )
    problems: Distinct[Problem] = field("Names of the test problems.", [*get_args(Problem)])
    damping: t.PositiveDamping = field("Linear damping, N s/m. Default: the largest damping.", None)
    cubic_damping: t.quantity("N s^3/m^3", "5e-6 N s^3/mm^3", gt=0) = field(
        "Cubic damping of the problem cubic, N s^3/m^3. Default: equal to the force of `damping` "
        "at the velocity static deflection * mean eigenfrequency.",
        None,
    )
    periods: integer(1, 10_000) = field("Mesh periods of a run.", 20)
    conservative_periods: integer(1, 10_000) = field(
        "Mesh periods of a run without damping, in which rounding errors grow fast, and of trains.",
        3,
    )
    record_periods: integer(1, 100) = field(
        "Number of last mesh periods, of which the events are compared.", 3
    )
    repeats: t.Count = field("Largest number of timed runs; the shortest time is used.", 5)
