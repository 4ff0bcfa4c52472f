"""The typed model of ``config.yaml``: every key, its meaning, its allowed range.

The JSON schema for editors is generated from the model::

    python -m gearlib.config --write-schema

Numbers: YAML 1.1, which Snakemake reads, takes ``4e8`` or ``4.0e8`` for a text (it wants
``4.0e+8``). Such a text, a decimal number with an exponent, is accepted as the number that it
plainly is. Every other text in place of a number (``"0.66"``, ``"4 kg"``) is refused, and so
are ``true`` for 1, NaN and, except for a backlash, infinity.

This module stays free of the numerical stack, because every start of the workflow reads it.
"""

import json
import re
import sys
from pathlib import Path
from typing import Annotated, Literal

from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    ValidationError,
    model_validator,
)
from pydantic_core import PydanticCustomError

from gearlib import tunings
from gearlib.pair import GearPair
from gearlib.validation import sentences

#: Where the generated schema lies, seen from the root of the project.
SCHEMA_PATH = Path("workflow/schemas/config.schema.json")

#: Limits that catch a mistyped step or window before it fills a disk.
MAX_TUNINGS = 10_000_000
MAX_SAMPLES = 100_000_000
MAX_JOBS = 10_000

_EXPONENT_NUMBER = re.compile(r"[-+]?(\d+\.?\d*|\.\d+)[eE][-+]?\d+")


class ConfigError(ValueError):
    """The configuration is refused; the message has one sentence per problem."""


def _read_exponent(value):
    if isinstance(value, str) and _EXPONENT_NUMBER.fullmatch(value):
        return float(value)
    return value


def _all_different(values):
    seen = set()
    for value in values:
        if value in seen:
            raise PydanticCustomError("duplicate", "{value}", {"value": value})
        seen.add(value)
    return values


def _number(**bounds):
    """Return the type of a finite number within `bounds` (gt, ge, lt, le)."""
    # Innermost first: bounds that pydantic cannot attach to the number itself would be missing
    # in the schema.
    return Annotated[float, Field(allow_inf_nan=False, **bounds), BeforeValidator(_read_exponent)]


Finite = _number()
Positive = _number(gt=0)
NonNegative = _number(ge=0)
Tuning = _number(gt=0, le=100)
Backlash = Annotated[
    float,
    Field(ge=0, json_schema_extra={"$comment": "or .inf"}),
    BeforeValidator(_read_exponent),
]
Name = Annotated[str, Field(pattern=r"^[A-Za-z0-9+_-]+$")]
Colour = Annotated[
    str,
    Field(
        pattern=r"^#[0-9A-Fa-f]{6}$",
        json_schema_extra={"$comment": "a colour '#rrggbb', in quotes"},
    ),
]


def _listing(item, description):
    """Return the type of a non-empty list of different items, and its description."""
    return Annotated[
        list[item],
        Field(min_length=1, description=description, json_schema_extra={"uniqueItems": True}),
        AfterValidator(_all_different),
    ]


class Section(BaseModel):
    """Base of all sections: no unknown keys, no silent conversions, immutable."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True)


class GearPairSection(Section):
    """The gear pair in SI units, without its damping."""

    max_stiffness: Positive = Field(description="Maximum mesh stiffness C_max, N/m.")
    stiffness_ratio: _number(gt=0, le=1) = Field(description="kappa = C_min / C_max.")
    contact_ratio: _number(ge=1, le=2) = Field(
        description="Contact ratio epsilon; both ends mean constant stiffness."
    )
    reduced_mass: Positive = Field(description="Reduced mass m_red, kg.")
    load: Positive = Field(description="Mean force F along the line of action, N.")
    backlash: Backlash = Field(
        description="Backlash s_k, m; .inf for a pair without a second flank."
    )
    teeth: int = Field(ge=1, le=10_000, description="Teeth: mesh periods per revolution.")


class Damping(Section):
    """One combination of linear damping coefficients."""

    material: NonNegative = Field(description="k_1 while the flanks touch, N s/m.")
    backlash: NonNegative = Field(description="k_1m of the oil in the backlash, N s/m.")


class State(Section):
    """State at the start, tau = 0: the middle of the C_max stretch."""

    displacement: Finite = Field(description="x, in static deflections.")
    velocity: Finite = Field(description="dx/dtau, in static deflections per radian.")


class Run(Section):
    """Length and record of every run."""

    revolutions: int = Field(ge=1, le=1_000_000, description="Revolutions of every run.")
    recorded_revolutions: int = Field(
        ge=1, description="The last ones, which are evaluated; at most `revolutions`."
    )
    samples_per_period: int = Field(
        ge=8, le=65_536, description="Samples of a recorded mesh period in the phase planes."
    )
    initial_state: State = Field(description="State from which cold runs start.")

    @model_validator(mode="after")
    def _check(self):
        if self.recorded_revolutions > self.revolutions:
            raise ValueError(
                f"run.recorded_revolutions = {self.recorded_revolutions} is not allowed: it must "
                f"be an integer from 1 to run.revolutions = {self.revolutions}"
            )
        return self


class Resonance(Section):
    """The resonance characteristic (Fig. 3): a grid of tunings, computed in windows."""

    start: Tuning = Field(description="First tuning nu.")
    stop: Tuning = Field(description="Last tuning; start + a whole multiple of step.")
    step: _number(gt=0, le=10) = Field(description="Distance of the tunings.")
    window: _number(gt=0, le=100) = Field(
        description="Tunings of one job of a cold sweep; a whole multiple of step."
    )
    directions: _listing(
        Literal["cold", "up", "down"],
        "cold: every tuning from the initial state; up, down: the state is carried along.",
    )

    @model_validator(mode="after")
    def _check(self):
        if self.stop <= self.start:
            raise ValueError(
                f"resonance.stop = {self.stop!r} is not allowed: it must be greater than "
                f"resonance.start = {self.start!r}"
            )
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

    tunings: _listing(Tuning, "Tunings nu, one row of phase planes each.")


def _numbers(item, count, description):
    """Return the type of a list of `count` numbers, and its description."""
    return Annotated[list[item], Field(min_length=count, max_length=count, description=description)]


class PhaseLag(Section):
    """The phase lag of the motion behind the mesh stiffness (Fig. 2)."""

    material_dampings: _listing(NonNegative, "Material damping k_1 of each curve, N s/m.")
    tuning: Tuning = Field(description="Tuning of the courses.")
    start: Tuning = Field(description="First tuning of the lag over the tuning.")
    stop: Tuning = Field(description="Last one; start + a whole multiple of step.")
    step: _number(gt=0, le=10) = Field(description="Distance of the tunings.")
    harmonics: int = Field(ge=1, le=20, description="Harmonics of the mesh period measured.")
    periods: int = Field(ge=1, le=1_000_000, description="Mesh periods of a run, to settle.")

    @model_validator(mode="after")
    def _check(self):
        if self.stop <= self.start or tunings.steps(self.start, self.stop, self.step) % 1:
            raise ValueError(
                f"phase_lag.stop = {self.stop!r} is not allowed: it must be phase_lag.start = "
                f"{self.start!r} plus a whole multiple of phase_lag.step = {self.step!r}"
            )
        count = int(tunings.steps(self.start, self.stop, self.step)) + 1
        if count > MAX_JOBS:
            raise ValueError(
                f"phase_lag.step = {self.step!r} is not allowed: it must be >= "
                f"{(self.stop - self.start) / MAX_JOBS:.2g} to stay within {MAX_JOBS:,} tunings"
            )
        return self


class SixDegrees(Section):
    """What six degrees of freedom need beyond the gear pair, SI; gear 3 first, then gear 2."""

    base_radii: _numbers(Positive, 2, "Rb3, Rb2, m.")
    inertias: _numbers(Positive, 2, "J3, J2, kg m^2.")
    masses: _numbers(Positive, 2, "m3, m2, kg.")
    bearing_stiffness: _numbers(Positive, 4, "C3y, C3z, C2y, C2z, N/m.")
    bearing_damping: _numbers(NonNegative, 4, "k3y, k3z, k2y, k2z, N s/m.")
    eccentricities: _numbers(NonNegative, 2, "e3, e2, run-out of the pitch circles, m.")
    run_out_phase: Finite = Field(description="Delta, relative phase of the run-out, rad.")
    friction: _numbers(NonNegative, 2, "Coefficients of friction in normal and inverse mesh.")
    pitch_phase: Finite = Field(description="Mesh phase of the pitch point, rad.")


Course = Literal[
    "displacement",
    "velocity",
    "acceleration",
    "stiffness",
    "modified_stiffness",
    "dynamic_force",
    "friction_force",
    "bearing_y3",
    "bearing_z3",
    "bearing_y2",
    "bearing_z2",
]
#: Courses that only six degrees of freedom have.
SIX_ONLY = {"friction_force", "bearing_y3", "bearing_z3", "bearing_y2", "bearing_z2"}


class Case(Section):
    """One run of a scene: a column of its figure."""

    title: str = Field(
        min_length=1,
        max_length=60,
        description="Above the column; names the case in the data.",
        json_schema_extra={"$comment": "a text of 1 to 60 characters"},
    )
    damping: Name = Field(
        description="One of the dampings.", json_schema_extra={"$comment": "one of the dampings"}
    )
    tuning: Tuning = Field(description="Tuning nu.")
    change: dict[Name, Finite] = Field(
        default={}, description="Other values for keys of gear_pair, in this case only."
    )


class Scene(Section):
    """Time courses and phase planes of a few runs, side by side."""

    model: Literal["one_degree", "six_degrees"] = Field(
        description="The smallest model that carries the scene."
    )
    cases: Annotated[
        list[Case], Field(min_length=1, max_length=6, description="The runs, a column each.")
    ]
    courses: _listing(Course, "Time courses below the phase plane, from above.")
    periods_shown: int = Field(ge=1, le=1000, description="Mesh periods shown, the last ones.")


class Figures(Section):
    """How the figures are drawn; no computation depends on it."""

    formats: _listing(Literal["png", "pdf", "svg"], "File formats of every figure.")
    dpi: int = Field(ge=50, le=1200, description="Resolution of pixel formats, dots per inch.")
    colours: dict[Name, Colour] = Field(description="Colour of each damping, '#rrggbb'.")


class Config(Section):
    """The configuration of the workflow."""

    # Each section is described by its own docstring.
    gear_pair: GearPairSection
    dampings: dict[Name, Damping] = Field(
        min_length=1, description="The damping combinations, by name."
    )
    run: Run
    resonance: Resonance
    phase_planes: PhasePlanes
    phase_lag: PhaseLag
    six_degrees: SixDegrees
    scenes: dict[Name, Scene] = Field(description="Scenes by name, one figure each; may be empty.")
    figures: Figures

    @model_validator(mode="after")
    def _check(self):
        self._check_colours()
        self._check_size()
        for name, scene in self.scenes.items():
            self._check_scene(f"scenes.{name}", scene)
        return self

    def _check_scene(self, key, scene):
        if scene.periods_shown > self.record_periods:
            raise ValueError(
                f"{key}.periods_shown = {scene.periods_shown} is not allowed: it must be an "
                f"integer from 1 to the {self.record_periods} recorded mesh periods"
            )
        alien = SIX_ONLY.intersection(scene.courses)
        if scene.model == "one_degree" and alien:
            raise ValueError(
                f"{key}.courses = {sorted(alien)[0]!r} is not allowed: it must be a course of the "
                "model one_degree, or the model must be six_degrees"
            )
        titles = [case.title for case in scene.cases]
        for i, case in enumerate(scene.cases):
            if titles.count(case.title) > 1:
                raise ValueError(
                    f"{key}.cases[{i}].title = {case.title!r} is not allowed: titles must be all "
                    "different"
                )
            if case.damping not in self.dampings:
                raise ValueError(
                    f"{key}.cases[{i}].damping = {case.damping!r} is not allowed: it must be one "
                    f"of {', '.join(self.dampings)}"
                )
            known = GearPairSection.model_fields
            for name in case.change:
                if name not in known or name == "teeth":
                    raise ValueError(
                        f"{key}.cases[{i}].change.{name} is not a known key: it must be one of "
                        f"{', '.join(k for k in known if k != 'teeth')}"
                    )
            try:
                GearPair(**self.case_parameters(case))
            except ValueError as error:
                raise ValueError(f"{key}.cases[{i}].change: {error}") from None

    def _check_colours(self):
        for name in self.dampings:
            if name not in self.figures.colours:
                raise ValueError(
                    f"figures.colours.{name} is missing: every damping needs a colour '#rrggbb'"
                )
        for name, colour in self.figures.colours.items():
            if name not in self.dampings:
                raise ValueError(
                    f"figures.colours.{name} = {colour!r} is not allowed: its name must be one of "
                    f"the dampings {', '.join(self.dampings)}"
                )

    def _check_size(self):
        resonance, run = self.resonance, self.run
        span = resonance.stop - resonance.start
        copies = len(self.dampings) * len(resonance.directions)
        if copies * resonance.count() > MAX_TUNINGS:
            raise ValueError(
                f"resonance.step = {resonance.step!r} is not allowed: it must be >= "
                f"{copies * span / MAX_TUNINGS:.2g} to stay within {MAX_TUNINGS:,} runs in all"
            )
        if len(self.dampings) * span / resonance.window > MAX_JOBS:
            raise ValueError(
                f"resonance.window = {resonance.window!r} is not allowed: it must be >= "
                f"{len(self.dampings) * span / MAX_JOBS:.2g} to stay within {MAX_JOBS:,} jobs"
            )
        planes = len(self.dampings) * len(self.phase_planes.tunings)
        if planes > MAX_JOBS:
            raise ValueError(
                f"phase_planes.tunings has {len(self.phase_planes.tunings):,} entries: there must "
                f"be from 1 to {MAX_JOBS // len(self.dampings):,} to stay within {MAX_JOBS:,} jobs"
            )
        # Two samples a period resolve a harmonic; its lag wants a few more.
        if 8 * self.phase_lag.harmonics > run.samples_per_period:
            raise ValueError(
                f"phase_lag.harmonics = {self.phase_lag.harmonics} is not allowed: it must be an "
                f"integer from 1 to run.samples_per_period / 8 = {run.samples_per_period // 8}"
            )
        samples = planes * self.record_periods * run.samples_per_period
        if samples > MAX_SAMPLES:
            raise ValueError(
                f"run.samples_per_period = {run.samples_per_period} with run.recorded_revolutions "
                f"= {run.recorded_revolutions} is not allowed: the samples of all phase planes, "
                f"{samples:,}, must be <= {MAX_SAMPLES:,}"
            )

    @property
    def periods(self):
        """Mesh periods of every run."""
        return self.run.revolutions * self.gear_pair.teeth

    @property
    def record_periods(self):
        """Recorded mesh periods, the last ones of every run."""
        return self.run.recorded_revolutions * self.gear_pair.teeth

    def pair_parameters(self, damping):
        """Return the keyword arguments of `gearlib.GearPair` for one damping, by its name."""
        chosen = self.dampings[damping]
        return self.gear_pair.model_dump() | {
            "material_damping": chosen.material,
            "backlash_damping": chosen.backlash,
        }

    def case_parameters(self, case):
        """Return the keyword arguments of `gearlib.GearPair` for one case of a scene."""
        return self.pair_parameters(case.damping) | case.change


def load(mapping):
    """Return the checked configuration.

    Parameters
    ----------
    mapping : dict
        What was read from YAML.

    Raises
    ------
    ConfigError
        With one sentence per problem, which names key, value and allowed range.
    """
    try:
        return Config.model_validate(mapping)
    except ValidationError as error:
        raise ConfigError("\n".join(sentences(error.errors(), schema()))) from None


def schema():
    """Return the JSON schema of the configuration as a dict."""
    return Config.model_json_schema()


def schema_text():
    """Return the JSON schema as the text of its file."""
    return json.dumps(schema(), indent=2) + "\n"


if __name__ == "__main__":
    if sys.argv[1:] != ["--write-schema"]:
        sys.exit("usage: python -m gearlib.config --write-schema")
    SCHEMA_PATH.write_text(schema_text(), encoding="utf-8")
