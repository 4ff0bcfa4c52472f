"""Sections that describe the gears and the length of the runs."""

from pydantic import model_validator
from pydantic_core import PydanticCustomError

from gearlib.config.gears_section import coefficient
from gearlib.config.types import (
    Angle,
    DampingCoefficient,
    Finite,
    Given,
    Inertia,
    Label,
    Length,
    Mass,
    NonNegative,
    RunOut,
    Section,
    Stiffness,
    Truth,
    Tuning,
    check_most,
    entry,
    like,
    number_within,
    numbers,
    whole,
)
from gearlib.models.pair_parameters import SMALLEST, PairParameters, PairScales, check_scales

#: Key of a damping -> what may stand in its place.
IN_PLACE_OF = {
    "material_damping": ("damping_ratio", "logarithmic_decrement"),
    "backlash_damping": ("backlash_damping_ratio",),
}
DAMPINGS = tuple(IN_PLACE_OF)
Ratio = number_within(ge=0, le=1000)


_Pair = like("_Pair", "", PairParameters, base=Section, without=DAMPINGS, required=("teeth",))


class GearPairSection(_Pair, PairScales):
    """The gear pair in SI units, without its damping."""

    @model_validator(mode="after")
    def _check(self):
        check_scales(self, "gear_pair.")
        if not SMALLEST <= self.mean_stiffness:
            raise ValueError(
                f"gear_pair.stiffness_ratio = {self.stiffness_ratio!r} is not allowed: the mean "
                f"stiffness, {self.mean_stiffness!r} N/m, must be >= {SMALLEST}"
            )
        return self


_OTHERS = [name for name in GearPairSection.model_fields if name != "teeth"]
_WORDS = "Other values for some keys of gear_pair, each as there; those left out stay."
Change = like("Change", _WORDS, PairParameters, *_OTHERS, optional=_OTHERS)
_Coefficients = like("_Coefficients", "", PairParameters, *DAMPINGS, optional=DAMPINGS)


class Damping(_Coefficients):
    """One combination of linear damping coefficients, or of ratios by which they are found."""

    damping_ratio: Ratio = entry(
        "beta in place of material_damping: k_1 = 2 beta m_red Omega_s.", None
    )
    logarithmic_decrement: Ratio = entry(
        "delta = 2 pi beta / sqrt(1 - beta^2) in place of material_damping.", None
    )
    backlash_damping_ratio: Ratio = entry(
        "beta_m in place of backlash_damping: k_1m = 2 beta_m m_red Omega_s.", None
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
        values, scale = self.model_dump(), (pair.mean_stiffness, pair.reduced_mass)
        coefficients = {}
        for key, others in IN_PLACE_OF.items():
            name = next(name for name in (key, *others) if name in values)
            coefficients[key] = (
                values[name] if name == key else coefficient(name, values[name], *scale)
            )
        return coefficients


class State(Section):
    """State at the start, tau = 0: the middle of the segment of C_max."""

    displacement: Finite = entry("x, in static deflections.", 0.0)
    velocity: Finite = entry("dx/dtau, in static deflections per radian.", 0.0)


class MeshCase(Section):
    """One run of several side by side: a mesh at one tuning."""

    title: Label = entry("Above the column or panel; names the case in the data.")
    tuning: Tuning = entry("Tuning nu.")
    change: Change = entry(
        "Other values for keys of gear_pair, in this case only.", Change.unchecked()
    )


class Run(Section):
    """Length and record of every run."""

    revolutions: whole(1, 1_000_000) = entry("Revolutions of every run.", 5)
    recorded_revolutions: whole(1) = entry(
        "The last ones, which are evaluated; at most `revolutions`.", 1
    )
    samples_per_period: whole(8, 65_536) = entry(
        "Samples of a recorded mesh period in the phase planes.", 256
    )
    initial_state: State = entry("State from which cold runs start.", State.unchecked())

    @model_validator(mode="after")
    def _check(self):
        words = "run.revolutions = {}"
        check_most("run.recorded_revolutions", self.recorded_revolutions, self.revolutions, words)
        return self


#: Asks for the bearings of drawn gears.
BEARINGS = (
    "six_degrees.bearing_stiffness is missing: it must be a list of 4 entries, C3y, C3z, C2y, C2z "
    "in N/m, for these gears; bearing_damping in N s/m comes beside it"
)


class SixDegrees(Given):
    """Bodies and bearings of six degrees of freedom, SI; gear 3 first, then gear 2.

    Of drawn gears, the pinion first, radii, inertias, masses and pitch phase are those of the
    drawing, damping, run-out and friction are 0, and the stiffness of the bearings has to be given.
    The defaults for other gears are those of equal gears on soft bearings: a choice.
    """

    base_radii: numbers(Length, 2, "Rb3, Rb2, m. Default: 0.1 m.")
    inertias: numbers(Inertia, 2, "J3, J2, kg m^2. Default: 3 Rb^2 reduced_mass.")
    masses: numbers(
        Mass, 2, "m3, m2, kg. Default: 6 reduced_mass; radii, inertias and masses come together."
    )
    bearing_stiffness: numbers(
        Stiffness, 4, "C3y, C3z, C2y, C2z, N/m. Default: max_stiffness / 40."
    ) = None
    bearing_damping: numbers(
        DampingCoefficient, 4, "k3y, k3z, k2y, k2z, N s/m. Default: a damping ratio of 2 %."
    )
    eccentricities: numbers(
        RunOut,
        2,
        "e3, e2, run-out of the pitch circles, m. Default: 0.8 static deflections, at most a "
        "fifth of the backlash.",
    )
    run_out_phase: Angle = entry("Delta, relative phase of the run-out, rad.", 0.0)
    friction: numbers(NonNegative, 2, "Coefficients of friction in normal and inverse mesh.") = [
        0.05,
        0.05,
    ]
    pitch_phase: Angle = entry("Mesh phase of the pitch point, rad.", 0.0)
    moving_backlash: Truth = entry(
        "true: the far flank moves as in Eq. (4); false: it stays s_k behind y = 0.", True
    )
