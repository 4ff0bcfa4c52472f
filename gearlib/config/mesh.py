"""Sections that describe the gears and the length of the runs."""

from pydantic import Field, model_validator
from pydantic_core import PydanticCustomError

from gearlib.config.drawing import coefficient
from gearlib.config.types import (
    Angle,
    Backlash,
    ContactRatio,
    DampingCoefficient,
    Finite,
    Given,
    Inertia,
    Length,
    Load,
    Mass,
    NonNegative,
    RunOut,
    Section,
    Stiffness,
    StiffnessRatio,
    Truth,
    Tuning,
    integer_within,
    number_within,
    numbers,
)

#: Gears beyond these have no squares of their scales within the floating-point numbers.
_SMALLEST, _LARGEST = 1e-30, 1e30
#: Key of a damping -> what may stand in its place.
IN_PLACE_OF = {
    "material_damping": ("damping_ratio", "logarithmic_decrement"),
    "backlash_damping": ("backlash_damping_ratio",),
}
Ratio = number_within(ge=0, le=1000)


class GearPairSection(Section):
    """The gear pair in SI units, without its damping."""

    max_stiffness: Stiffness = Field(description="Maximum mesh stiffness C_max, N/m.")
    stiffness_ratio: StiffnessRatio = Field(description="kappa = C_min / C_max.")
    contact_ratio: ContactRatio = Field(
        description="Contact ratio epsilon; both ends mean constant stiffness."
    )
    reduced_mass: Mass = Field(description="Reduced mass m_red, kg.")
    load: Load = Field(description="Mean force F along the line of action, N.")
    backlash: Backlash = Field(
        description="Backlash s_k, m; .inf for a pair without a second flank."
    )
    teeth: integer_within(ge=1, le=10_000) = Field(
        description="Teeth: mesh periods per revolution."
    )

    @model_validator(mode="after")
    def _check(self):
        for key in ("max_stiffness", "reduced_mass", "load"):
            self._check_scale(key, getattr(self, key))
        mean = self.mean_stiffness()
        if not _SMALLEST <= mean:
            raise ValueError(
                f"gear_pair.stiffness_ratio = {self.stiffness_ratio!r} is not allowed: the mean "
                f"stiffness, {mean!r} N/m, must be >= {_SMALLEST}"
            )
        return self

    @staticmethod
    def _check_scale(key, value):
        if not _SMALLEST <= value <= _LARGEST:
            raise ValueError(
                f"gear_pair.{key} = {value!r} is not allowed: it must be a finite number > 0, from "
                f"{_SMALLEST} to {_LARGEST}"
            )

    def mean_stiffness(self):
        """Return the mean of the mesh stiffness over a mesh period, N/m."""
        high = self.contact_ratio - 1.0
        return self.max_stiffness * (high + (1.0 - high) * self.stiffness_ratio)


class Change(Given):
    """Other values for some keys of gear_pair, each as there; those left out stay."""

    max_stiffness: Stiffness = Field(default=None, description="Max stiffness of the case.")
    stiffness_ratio: StiffnessRatio = Field(
        default=None, description="Stiffness ratio of the case."
    )
    contact_ratio: ContactRatio = Field(default=None, description="Contact ratio of the case.")
    reduced_mass: Mass = Field(default=None, description="Reduced mass of the case.")
    load: Load = Field(default=None, description="Load of the case.")
    backlash: Backlash = Field(default=None, description="Backlash of the case.")


class Damping(Given):
    """One combination of linear damping coefficients, or of ratios by which they are found."""

    material_damping: DampingCoefficient = Field(
        default=None, description="k_1 while the flanks touch, N s/m."
    )
    backlash_damping: DampingCoefficient = Field(
        default=None, description="k_1m of the oil in the backlash, N s/m."
    )
    damping_ratio: Ratio = Field(
        default=None, description="beta in place of material_damping: k_1 = 2 beta m_red Omega_s."
    )
    logarithmic_decrement: Ratio = Field(
        default=None,
        description="delta = 2 pi beta / sqrt(1 - beta^2) in place of material_damping.",
    )
    backlash_damping_ratio: Ratio = Field(
        default=None,
        description="beta_m in place of backlash_damping: k_1m = 2 beta_m m_red Omega_s.",
    )

    @model_validator(mode="after")
    def _check(self):
        for key, others in IN_PLACE_OF.items():
            names = [name for name in (key, *others) if getattr(self, name) is not None]
            if not names:
                raise PydanticCustomError("missing_one", "", {"key": key})
            if names[1:]:
                raise PydanticCustomError("both", "", {"names": names})
        return self

    def coefficients(self, pair):
        """Return k_1 and k_1m for a `GearPairSection`, N s/m, as keywords of `gearlib.GearPair`."""
        given, scale = self.model_dump(), (pair.mean_stiffness(), pair.reduced_mass)
        found = {}
        for key, others in IN_PLACE_OF.items():
            name = next(name for name in (key, *others) if name in given)
            found[key] = given[name] if name == key else coefficient(name, given[name], *scale)
        return found


class State(Section):
    """State at the start, tau = 0: the middle of the segment of C_max."""

    displacement: Finite = Field(default=0.0, description="x, in static deflections.")
    velocity: Finite = Field(default=0.0, description="dx/dtau, in static deflections per radian.")


class MeshCase(Section):
    """One run of several side by side: a mesh at one tuning."""

    title: str = Field(
        min_length=1,
        max_length=60,
        description="Above the column or panel; names the case in the data.",
        json_schema_extra={"$comment": "a text of 1 to 60 characters"},
    )
    tuning: Tuning = Field(description="Tuning nu.")
    change: Change = Field(
        default=Change(), description="Other values for keys of gear_pair, in this case only."
    )


class Run(Section):
    """Length and record of every run."""

    revolutions: integer_within(ge=1, le=1_000_000) = Field(
        default=5, description="Revolutions of every run."
    )
    recorded_revolutions: integer_within(ge=1) = Field(
        default=1, description="The last ones, which are evaluated; at most `revolutions`."
    )
    samples_per_period: integer_within(ge=8, le=65_536) = Field(
        default=256, description="Samples of a recorded mesh period in the phase planes."
    )
    initial_state: State = Field(default=State(), description="State from which cold runs start.")

    @model_validator(mode="after")
    def _check(self):
        if self.recorded_revolutions > self.revolutions:
            raise ValueError(
                f"run.recorded_revolutions = {self.recorded_revolutions} is not allowed: it must "
                f"be an integer from 1 to run.revolutions = {self.revolutions}"
            )
        return self


class SixDegrees(Section):
    """What six degrees of freedom need beyond the gear pair, SI; gear 3 first, then gear 2.

    The defaults are those of equal gears on soft bearings: a choice, not a guess at real ones.
    """

    base_radii: numbers(Length, 2, "Rb3, Rb2, m. Default: 0.1 m.")
    inertias: numbers(Inertia, 2, "J3, J2, kg m^2. Default: 3 Rb^2 reduced_mass.")
    masses: numbers(
        Mass, 2, "m3, m2, kg. Default: 6 reduced_mass; radii, inertias and masses come together."
    )
    bearing_stiffness: numbers(
        Stiffness, 4, "C3y, C3z, C2y, C2z, N/m. Default: max_stiffness / 40."
    )
    bearing_damping: numbers(
        DampingCoefficient, 4, "k3y, k3z, k2y, k2z, N s/m. Default: a damping ratio of 2 %."
    )
    eccentricities: numbers(
        RunOut,
        2,
        "e3, e2, run-out of the pitch circles, m. Default: 0.8 static deflections, at most a "
        "fifth of the backlash.",
    )
    run_out_phase: Angle = Field(
        default=0.0, description="Delta, relative phase of the run-out, rad."
    )
    friction: numbers(NonNegative, 2, "Coefficients of friction in normal and inverse mesh.") = [
        0.05,
        0.05,
    ]
    pitch_phase: Angle = Field(default=0.0, description="Mesh phase of the pitch point, rad.")
    moving_backlash: Truth = Field(
        default=True,
        description="true: the far flank moves as in Eq. (4); false: it stays s_k behind y = 0.",
    )
