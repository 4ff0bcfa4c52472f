"""Sections that describe the trials of the methods."""

from typing import Annotated, ClassVar, Literal

from pydantic import Field, model_validator

from gearlib.config.types import (
    CubicDamping,
    Finite,
    Grid,
    Name,
    Option,
    Positive,
    PositiveDampingCoefficient,
    Section,
    listing,
    number_within,
)

Steps = Annotated[int, Field(ge=1, le=100_000)]


#: Names of `gearlib.methods()`, kept here so that a start need not load the numerical stack.
MethodName = Literal[
    "exact",
    "taylor",
    "rk4",
    "rk45",
    "newmark",
    "generalised_alpha",
    "scipy",
    "smoothed",
    "heyoka",
    "cvode",
    "diffrax",
    "cyrk",
    "numbalsoda",
]


#: The package that each peer is imported from; where it is not installed, the peer is left out.
PEERS = {
    "heyoka": "heyoka",
    "cvode": "sksundae",
    "diffrax": "diffrax",
    "cyrk": "CyRK",
    "numbalsoda": "numbalsoda",
}


class FixedStepMethod(Section):
    """A fixed-step method of the stability chart."""

    method: Literal["rk4", "newmark", "generalised_alpha"] = Field(description="Its name.")
    options: dict[Name, Finite] = Field(
        default={}, description="Its options, but the steps per period."
    )


class StabilityChart(Grid):
    """Spectral radii of fixed-step methods on the mesh that never loses contact."""

    key: ClassVar = "stability_chart"

    damping: Name = Field(
        description="One of the dampings.", json_schema_extra={"$comment": "one of the dampings"}
    )
    fine_step: number_within(gt=0, le=10) = Field(
        description="Distance of the tunings of the true radius."
    )
    steps: listing(Steps, "Steps per mesh period.")
    methods: dict[Name, FixedStepMethod] = Field(
        min_length=1, description="The methods, by the name in the picture."
    )


class Trial(Section):
    """One method with its options: a column of the matrix of failures."""

    name: Name = Field(
        description="Above the column; names the trial in the data.",
        json_schema_extra={"$comment": "a text matching ^[A-Za-z0-9+_-]+$"},
    )
    method: MethodName = Field(description="A name of `gearlib.methods`.")
    options: dict[Name, Option] = Field(
        default={}, description="Its options that are not the defaults, see `gearlib.methods`."
    )


class Failures(Section):
    """The methods that are put to the hostile problems of `gearlib.trials.hostile`."""

    trials: Annotated[
        list[Trial],
        Field(min_length=1, max_length=40, description="The methods, a column of the figure each."),
    ]

    @model_validator(mode="after")
    def _check(self):
        names = [trial.name for trial in self.trials]
        for i, name in enumerate(names):
            if names.count(name) > 1:
                raise ValueError(
                    f"failures.trials[{i}].name = {name!r} is not allowed: names must be all "
                    "different"
                )
        return self


Problem = Literal["smooth", "bouncing", "near_fold", "conservative", "six_degrees", "cubic"]


class WorkPrecision(Section):
    """Errors of the methods on test problems, against evaluations and wall time."""

    methods: listing(MethodName, "Names of `gearlib.methods()`.")
    problems: listing(Problem, "Test problems, see gearlib/trials/problems.py.")
    damping: PositiveDampingCoefficient = Field(
        description="Linear damping where a problem has any, N s/m."
    )
    cubic_damping: CubicDamping = Field(
        description="Cubic damping of the problem cubic, N s^3/m^3."
    )
    periods: int = Field(ge=1, le=10_000, description="Mesh periods of a run.")
    conservative_periods: int = Field(
        ge=1, le=10_000, description="The same without damping, where rounding errors grow fast."
    )
    record_periods: int = Field(
        ge=1, le=100, description="The last ones, whose events are compared; at most those run."
    )
    repeats: int = Field(
        ge=1, le=1000, description="Timed runs at most, of which the median counts."
    )


class Published(Section):
    """Published problems of dead-zone oscillators, see gearlib/trials/published.py."""

    starts: int = Field(
        ge=1, le=100_000, description="Initial states whose motions are told apart."
    )
    settle: int = Field(
        ge=1, le=1_000_000, description="Periods of the forcing before a run is looked at."
    )
    exponent_periods: int = Field(
        ge=20, le=1_000_000, description="Periods over which the exponent is averaged."
    )
    points: int = Field(ge=1, le=1_000_000, description="Points of every Poincare section.")
    values: int = Field(
        ge=2, le=10_000, description="Values of the scanned parameter, three starts each."
    )
    check_periods: int = Field(
        ge=4, le=1000, description="Periods over which an independent integration is compared."
    )


class SteadyOrbits(Section):
    """Errors of settled orbits: the frequency domain beside time marching."""

    methods: listing(
        Literal["exact", "taylor", "rk4", "rk45", "newmark", "harmonic_balance", "schmidt"],
        "Methods that march, and those that work on harmonics.",
    )
    problems: listing(
        Literal["smooth", "bouncing", "near_fold", "cubic"],
        "Test problems that settle, see gearlib/trials/problems.py.",
    )
    repeats: int = Field(ge=1, le=1000, description="Timed runs, of which the median counts.")


class SlowScan(Grid):
    """The scan of methods whose right-hand side is not compiled by the library."""

    key: ClassVar = "jump_by_method.slow"

    resolution: number_within(gt=0, le=0.1) = Field(
        description="Width of the tuning interval to which the jump is bisected."
    )


class JumpByMethod(Grid):
    """Where each method puts the jump of the motion from rest."""

    key: ClassVar = "jump_by_method"

    methods: listing(MethodName, "Names of `gearlib.methods()`.")
    damping: Name = Field(
        description="One of the dampings.", json_schema_extra={"$comment": "one of the dampings"}
    )
    resolution: number_within(gt=0, le=0.1) = Field(
        description="Width of the tuning interval to which the jump is bisected."
    )
    most_evaluations: Positive = Field(
        description="Values of a knob that cost more evaluations per mesh period are left out."
    )
    slow: SlowScan
