"""Sections that describe the global picture: basins, bifurcation diagram, Poincare sections."""

from typing import Annotated

from pydantic import Field, model_validator

from gearlib.config.agreement import check_grid
from gearlib.config.gear_pair_section import Damping, MeshCase
from gearlib.config.types import (
    Distance,
    Finite,
    Grid,
    Periods,
    Section,
    Start,
    Step,
    Stop,
    entry,
    number_within,
    numbers,
    whole,
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
