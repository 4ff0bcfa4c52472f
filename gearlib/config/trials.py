"""Sections that describe the trials of the methods."""

from typing import Annotated, Literal, get_args

from pydantic import Field, model_validator

from gearlib.config.types import (
    CubicDamping,
    DampingName,
    Distance,
    Finite,
    Grid,
    Name,
    Option,
    PositiveDampingCoefficient,
    Section,
    Start,
    Step,
    Stop,
    check_different,
    entry,
    listing,
    whole,
)

Steps = whole(1, 100_000)


#: Names of `gearlib.methods()`, kept here so that a start need not load the numerical stack.
_METHODS = (
    *("exact", "taylor", "rk4", "rk45", "newmark", "generalised_alpha"),
    *("scipy", "smoothed", "heyoka"),
)
MethodName = Literal[_METHODS]


#: The package that each peer is imported from; where it is not installed, the peer is left out.
PEERS = {"heyoka": "heyoka"}


class FixedStepMethod(Section):
    """A fixed-step method of the stability chart."""

    method: Literal["rk4", "newmark", "generalised_alpha"] = entry("Its name.")
    options: dict[Name, Finite] = entry("Its options, except the steps per period.", {})


_STEPS = (4, 5, 6, 8, 10, 12, 16, 20, 24, 32, 48, 64, 96, 128, 192, 256)


class StabilityChart(Grid):
    """Spectral radii of fixed-step methods on the mesh without contact loss."""

    start: Start = 0.2
    stop: Stop = 2.6
    step: Step = 0.02
    damping: Annotated[
        DampingName, Field(description="One of the dampings. Default: the lightest.")
    ]
    fine_step: Distance = entry("Distance of the tunings of the exact spectral radius.", 0.002)
    steps: listing(Steps, "Steps per mesh period.") = list(_STEPS)
    methods: dict[Name, FixedStepMethod] = Field(
        default={
            "rk4": FixedStepMethod.unchecked(method="rk4"),
            "newmark": FixedStepMethod.unchecked(method="newmark"),
            "generalised_alpha": FixedStepMethod.unchecked(
                method="generalised_alpha", options={"spectral_radius": 0.8}
            ),
            "generalised_alpha-0": FixedStepMethod.unchecked(
                method="generalised_alpha", options={"spectral_radius": 0.0}
            ),
        },
        min_length=1,
        description="The methods, by the name in the picture.",
    )


class Trial(Section):
    """One method with its options: a column of the matrix of failures."""

    name: Name = Field(
        description="Above the column; names the trial in the data.",
        json_schema_extra={"$comment": "a text matching ^[A-Za-z0-9+_-]{1,40}$"},
    )
    method: MethodName = entry("A name of `gearlib.methods`.")
    options: dict[Name, Option] = entry(
        "Its options that are not the defaults, see `gearlib.methods`.", {}
    )


def _trial(name, method, **options):
    return Trial.unchecked(name=name, method=method, options=options)


class Failures(Section):
    """The methods that are tried on difficult problems."""

    trials: Annotated[
        list[Trial],
        Field(min_length=1, max_length=40, description="The methods, a column of the figure each."),
    ] = [
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
    ]

    @model_validator(mode="after")
    def _check(self):
        check_different("failures.trials", self.trials, "name")
        return self


Problem = Literal[
    "smooth", "bouncing", "near_fold", "conservative", "six_degrees", "cubic", "reducer"
]


class WorkPrecision(Section):
    """Errors of the methods on test problems, against evaluations and wall time."""

    methods: listing(MethodName, "Names of `gearlib.methods()`.") = list(get_args(MethodName))
    problems: listing(Problem, "Test problems, see gearlib/studies/trials/problems.py.") = list(
        get_args(Problem)
    )
    damping: PositiveDampingCoefficient = entry(
        "Linear damping of the damped problems, N s/m. Default: the largest one."
    )
    cubic_damping: CubicDamping = entry(
        "Cubic damping of the problem cubic, N s^3/m^3. Default: the one that has the force of "
        "`damping` at the velocity static deflection * mean eigenfrequency."
    )
    periods: whole(1, 10_000) = entry("Mesh periods of a run.", 20)
    conservative_periods: whole(1, 10_000) = entry(
        "The same without damping, where rounding errors grow fast, and of the gear train.", 3
    )
    record_periods: whole(1, 100) = entry(
        "The last mesh periods, whose events are compared; at most `periods`.", 3
    )
    repeats: whole(1, 1000) = entry(
        "Largest number of timed runs, of which the shortest counts.", 9
    )
