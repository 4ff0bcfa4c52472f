"""Sections that describe the gear pair, its damping, its bodies and the length of the runs."""

import math

from pydantic import model_validator
from pydantic_core import PydanticCustomError

from gearlib import checks
from gearlib.config import IN_PLACE_OF
from gearlib.config import types as t
from gearlib.config.types import Section, entry, like, several
from gearlib.models.geometry.drawings import renaming
from gearlib.models.geometry.mesh import damping_coefficient, drawn_damping
from gearlib.models.pair_parameters import SMALLEST, PairParameters, PairScales, check_scales
from gearlib.parameters import RUN_OUT

DAMPINGS = tuple(IN_PLACE_OF)
#: Digits of what is derived: the same drawing in other units, whose rounding differs, reruns
#: nothing.
_DIGITS = 12
_Ratio = t.number(ge=0, le=1000)
_Pair = like("_Pair", "", PairParameters, without=DAMPINGS, required=("teeth",))


def rounded(value):
    """Return a number, or a list of them, with 12 digits, an integer or a name as it is."""
    if isinstance(value, list):
        return [rounded(item) for item in value]
    return float(f"{value:.{_DIGITS}g}") if isinstance(value, float) else value


class GearPairSection(_Pair, PairScales):
    """The gear pair in SI units, without its damping."""

    @model_validator(mode="after")
    def _check(self):
        check_scales(self, ".")
        allowed = f"large enough for a mean stiffness, {self.mean_stiffness!r} N/m, >= {SMALLEST}"
        fits = self.mean_stiffness >= SMALLEST
        checks.require(fits, ".stiffness_ratio", self.stiffness_ratio, allowed)
        return self


_OTHERS = [name for name in GearPairSection.model_fields if name != "teeth"]
_WORDS = "Other values for some keys of gear_pair, each as there; those left out stay."
Change = like("Change", _WORDS, PairParameters, *_OTHERS, optional=_OTHERS)
_Coefficients = like("_Coefficients", "", PairParameters, *DAMPINGS, optional=DAMPINGS)


class Damping(_Coefficients):
    """One combination of linear damping coefficients, or of ratios that give them."""

    damping_ratio: _Ratio = entry("beta: material_damping is 2 beta m_red Omega_s.", None)
    logarithmic_decrement: _Ratio = entry("delta = 2 pi beta / sqrt(1 - beta^2).", None)
    backlash_damping_ratio: _Ratio = entry("beta_m: backlash_damping likewise.", None)

    @model_validator(mode="after")
    def _in_coefficients(self, info):
        """Return k_1 and k_1m for the pair of the context, N s/m, in place of ratios."""
        pair, coefficients = t.of_context(info, "pair"), {}
        for key, others in IN_PLACE_OF.items():
            names = [name for name in (key, *others) if getattr(self, name) is not None]
            if not names:
                raise PydanticCustomError("missing_key", "", {"key": key})
            if names[1:]:
                both = " and ".join(f".{name}" for name in names)
                raise ValueError(f"{both} are not allowed together: it must be one of them")
            name, value = names[0], getattr(self, names[0])
            if pair and t.of_context(info, "drawn"):
                with renaming(lambda name, part: f".{name}"):
                    drawn_damping(name, value, pair.mean_stiffness, pair.reduced_mass)
            if pair and name != key:
                if name == "logarithmic_decrement":
                    value /= math.hypot(math.tau, value)
                value = damping_coefficient(value, pair.mean_stiffness, pair.reduced_mass)
                value = rounded(value)
            coefficients[key] = value
        return Damping.model_construct(**coefficients) if pair else self


class State(Section):
    """State at the start, tau = 0: the middle of the segment of C_max."""

    displacement: t.Finite = entry("x, in static deflections.", 0.0)
    velocity: t.Finite = entry("dx/dtau, in static deflections per radian.", 0.0)


class MeshCase(Section):
    """One run of several side by side: a mesh at one tuning."""

    title: t.Label = entry("Title above the column or panel; names the case in the data.")
    # Before the tuning: a speed is that of the changed pair.
    change: Change = entry("Other values for keys of gear_pair, in this case only.", {})
    tuning: t.Tuning = entry("Tuning nu.")


class Run(Section):
    """Length and record of every run."""

    revolutions: t.LargeCount = entry("Revolutions of every run.", 5)
    recorded_revolutions: t.whole(1) = entry("The last revolutions, which are evaluated.", 1)
    samples_per_period: t.whole(8, 65_536) = entry("Samples of a mesh period in phase planes.", 256)
    initial_state: State = entry("State from which cold runs start.", {})

    @model_validator(mode="after")
    def _check(self):
        recorded, revolutions = self.recorded_revolutions, self.revolutions
        allowed = f"an integer from 1 to .revolutions = {revolutions}"
        checks.require(recorded <= revolutions, ".recorded_revolutions", recorded, allowed)
        return self


#: Asks for the bearings of drawn gears.
BEARINGS = (
    "six_degrees.bearing_stiffness is missing: it must be a list of 4 entries, C3y, C3z, C2y, C2z "
    "in N/m, for these gears; bearing_damping in N s/m comes beside it"
)


class SixDegrees(Section):
    """Bodies and bearings of six degrees of freedom, SI; gear 3 first, then gear 2.

    Of drawn gears, the pinion first, radii, inertias, masses and pitch phase are those of the
    drawing, damping, run-out and friction are 0, and the stiffness of the bearings has to be given.
    The defaults for other gears are those of equal gears on soft bearings: a choice.
    """

    base_radii: several(t.Length, 2) = entry("Base radii Rb3, Rb2, m. Default: 0.1 m.", None)
    inertias: several(t.Inertia, 2) = entry("Inertias J3, J2, kg m^2. Default: 3 Rb^2 m_red.", None)
    masses: several(t.Mass, 2) = entry(
        "Masses m3, m2, kg. Default: 6 reduced_mass; radii, inertias and masses come together.",
        None,
    )
    bearing_stiffness: several(t.Stiffness, 4) = entry(
        "Stiffness C3y, C3z, C2y, C2z, N/m. Default: max_stiffness / 40.", None
    )
    bearing_damping: several(t.DampingCoefficient, 4) = entry(
        "Damping k3y, k3z, k2y, k2z, N s/m. Default: 2 % of the critical.", None
    )
    eccentricities: several(t.type_of(RUN_OUT), 2) = entry(
        "Run-out of the pitch circles e3, e2, m. Default: 0.8 static deflections, at most a fifth "
        "of the backlash.",
        None,
    )
    run_out_phase: t.Angle = entry("Relative phase Delta of the run-out, rad.", 0.0)
    friction: several(t.NonNegative, 2) = entry(
        "Friction in normal and inverse mesh.", [0.05, 0.05]
    )
    pitch_phase: t.Angle = entry("Mesh phase of the pitch point, rad.", 0.0)
    moving_backlash: t.Truth = entry("Whether the far flank moves, as in Eq. (4).", True)

    @model_validator(mode="after")
    def _check(self):
        for key in ("base_radii", "inertias", "masses"):
            if getattr(self, key) is None:
                raise PydanticCustomError("missing_key", "", {"key": key})
        return self
