"""Sections of the scenes, runs side by side, and of the models that may carry them."""

from typing import Annotated, Literal

from pydantic import Field

from gearlib.config.gear_pair_section import MeshCase
from gearlib.config.types import (
    DampingName,
    Harmonic,
    Section,
    Seeded,
    Starts,
    Tolerance,
    entry,
    listing,
    whole,
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
