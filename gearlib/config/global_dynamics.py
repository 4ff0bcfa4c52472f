"""Sections that describe the global picture: basins, bifurcation diagram, Poincare sections."""

from typing import Annotated, ClassVar

from pydantic import Field, model_validator

from gearlib.config.mesh import Damping, MeshCase
from gearlib.config.types import (
    Distance,
    Finite,
    Grid,
    Section,
    Start,
    Step,
    Stop,
    check_grid,
    integer_within,
    number_within,
    numbers,
)

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

    phase: number_within(ge=0, lt=360) = Field(description="Mesh phase of the section, degrees.")
    settle: integer_within(ge=0, le=1_000_000) = Field(
        description="Mesh periods before the section."
    )


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
    count: integer_within(ge=2, le=5000) = Field(
        default=240, description="Initial states in each direction."
    )
    periods: integer_within(ge=1, le=1_000_000) = Field(
        default=400, description="Mesh periods of a run."
    )

    @model_validator(mode="after")
    def _check(self):
        check_ranges("basins", self)
        for i, case in enumerate(self.cases):
            check_damped(f"basins.cases[{i}]", case.damping)
        return self


class Bifurcation(Grid):
    """Bifurcation diagram over the tuning, Lyapunov exponents and shares of the basins."""

    key: ClassVar = "bifurcation"

    start: Start = 0.45
    stop: Stop = 0.95
    step: Step = 0.001
    damping: Annotated[
        Damping, Field(description="Default: the first of the dampings with material damping.")
    ]
    share_step: Distance = Field(
        default=0.01,
        description="Distance of the tunings of the shares; stop is start + a multiple of it.",
    )
    settle: integer_within(ge=0, le=1_000_000) = Field(
        default=400, description="Mesh periods before the record."
    )
    strobes: integer_within(ge=1, le=10_000) = Field(
        default=48, description="Stroboscopic states recorded."
    )
    starts: integer_within(ge=0, le=1000) = Field(
        default=8, description="Random initial states besides up and down."
    )
    exponent_periods: integer_within(ge=20, le=1_000_000) = Field(
        default=800, description="Mesh periods over which an exponent is averaged."
    )
    displacement: Range = [-6.0, 6.0]
    velocity: Range = [-6.0, 6.0]
    samples: integer_within(ge=1, le=1_000_000) = Field(
        default=400, description="Initial states of the shares."
    )
    periods: integer_within(ge=1, le=1_000_000) = Field(
        default=400, description="Mesh periods of their runs."
    )

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
    orbits: integer_within(ge=1, le=10_000) = Field(
        default=60, description="Random initial states."
    )
    periods: integer_within(ge=20, le=1_000_000) = Field(
        default=600, description="Mesh periods of the section."
    )

    @model_validator(mode="after")
    def _check(self):
        check_ranges("poincare", self)
        return self
