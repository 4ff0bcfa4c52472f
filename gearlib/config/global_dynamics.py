"""Sections that describe the global picture: basins, bifurcation diagram, Poincare sections."""

from typing import Annotated, ClassVar

from pydantic import Field, model_validator

from gearlib.config.mesh import Damping, MeshCase
from gearlib.config.types import (
    Finite,
    Grid,
    Section,
    check_grid,
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
    if damping.material == damping.backlash == 0.0:
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
    settle: int = Field(ge=0, le=1_000_000, description="Mesh periods before the section.")


class Basins(Section):
    """Basins of attraction: to which orbit the motion from each initial state comes."""

    cases: Annotated[list[GlobalCase], Field(min_length=1, max_length=12, description="Panels.")]
    displacement: Range
    velocity: Range
    count: int = Field(ge=2, le=5000, description="Initial states in each direction.")
    periods: int = Field(ge=1, le=1_000_000, description="Mesh periods of a run.")

    @model_validator(mode="after")
    def _check(self):
        check_ranges("basins", self)
        for i, case in enumerate(self.cases):
            check_damped(f"basins.cases[{i}]", case.damping)
        return self


class Bifurcation(Grid):
    """Bifurcation diagram over the tuning, Lyapunov exponents and shares of the basins."""

    key: ClassVar = "bifurcation"

    damping: Damping
    share_step: number_within(gt=0, le=10) = Field(
        description="Distance of the tunings of the shares; stop is start + a multiple of it."
    )
    settle: int = Field(ge=0, le=1_000_000, description="Mesh periods before the record.")
    strobes: int = Field(ge=1, le=10_000, description="Stroboscopic states recorded.")
    starts: int = Field(ge=0, le=1000, description="Random initial states besides up and down.")
    exponent_periods: int = Field(
        ge=20, le=1_000_000, description="Mesh periods over which an exponent is averaged."
    )
    displacement: Range
    velocity: Range
    samples: int = Field(ge=1, le=1_000_000, description="Initial states of the shares.")
    periods: int = Field(ge=1, le=1_000_000, description="Mesh periods of their runs.")

    @model_validator(mode="after")
    def _check(self):
        check_ranges("bifurcation", self)
        check_damped("bifurcation", self.damping)
        check_grid("bifurcation", self.model_copy(update={"step": self.share_step}))
        return self


class Poincare(Section):
    """Poincare sections: states of many orbits at one mesh phase of every period."""

    cases: Annotated[list[SectionCase], Field(min_length=1, max_length=12, description="Panels.")]
    displacement: Range
    velocity: Range
    orbits: int = Field(ge=1, le=10_000, description="Random initial states.")
    periods: int = Field(ge=20, le=1_000_000, description="Mesh periods of the section.")

    @model_validator(mode="after")
    def _check(self):
        check_ranges("poincare", self)
        return self
