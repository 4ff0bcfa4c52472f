"""Sections that describe the gear pair, its damping, its bodies and the length of the runs."""

import math
from typing import Any

from pydantic import ValidationInfo, model_validator
from pydantic_core import PydanticCustomError

from gearlib import checks
from gearlib.config import RATIO_KEYS
from gearlib.config import types as t
from gearlib.config.types import Section, entry, like, several
from gearlib.models.geometry.drawings import parameters_renamed
from gearlib.models.geometry.mesh import checked_damping, damping_coefficient
from gearlib.models.pair_parameters import SMALLEST, PairParameters, PairScales, check_scales
from gearlib.parameters import RUN_OUT

DAMPINGS = tuple(RATIO_KEYS)
#: Digits of derived values, few enough that a drawing in other units gives the same values.
_DIGITS = 12
_Ratio = t.number(ge=0, le=1000)
_Pair = like("_Pair", "", PairParameters, without=DAMPINGS, required=("teeth",))


def rounded(value: Any) -> Any:
    """Return a float, or a list of floats, with 12 digits; other values are returned unchanged."""
    if isinstance(value, list):
        return [rounded(item) for item in value]
    return float(f"{value:.{_DIGITS}g}") if isinstance(value, float) else value


class GearPairSection(_Pair, PairScales):
    """The gear pair in SI units, without its damping."""

    @model_validator(mode="after")
    def _check(self) -> "GearPairSection":
        """Refuse a pair with a mean stiffness or scales that are too small to compute with."""
        check_scales(self, ".")
        allowed = f"large enough for a mean stiffness, {self.mean_stiffness!r} N/m, >= {SMALLEST}"
        fits = self.mean_stiffness >= SMALLEST
        checks.require(fits, ".stiffness_ratio", self.stiffness_ratio, allowed)
        return self


_OTHERS = [name for name in GearPairSection.model_fields if name != "teeth"]
_DESCRIPTION = "Other values for some keys of gear_pair; keys that are left out keep their values."
Change = like("Change", _DESCRIPTION, PairParameters, *_OTHERS, optional=_OTHERS)
_Coefficients = like("_Coefficients", "", PairParameters, *DAMPINGS, optional=DAMPINGS)


class Damping(_Coefficients):
    """One combination of linear damping coefficients, or of ratios that give them."""

    damping_ratio: _Ratio = entry("beta: material_damping is 2 beta m_red Omega_s.", None)
    logarithmic_decrement: _Ratio = entry("delta = 2 pi beta / sqrt(1 - beta^2).", None)
    backlash_damping_ratio: _Ratio = entry("beta_m: backlash_damping likewise.", None)

    @model_validator(mode="after")
    def _in_coefficients(self, info: ValidationInfo) -> "Damping":
        """Return the damping with coefficients, N s/m, in place of its ratios.

        The ratios refer to the gear pair in the context of the validation.
        """
        pair, coefficients = t.from_context(info, "pair"), {}
        for coefficient_key, ratio_keys in RATIO_KEYS.items():
            keys = [coefficient_key, *ratio_keys]
            given_keys = [key for key in keys if getattr(self, key) is not None]
            if not given_keys:
                raise PydanticCustomError("missing_key", "", {"key": coefficient_key})
            if len(given_keys) > 1:
                key_list = " and ".join(f".{key}" for key in given_keys)
                raise ValueError(f"{key_list} are not allowed together: it must be one of them")
            key, value = given_keys[0], getattr(self, given_keys[0])
            if pair and t.from_context(info, "drawn"):
                with parameters_renamed(lambda argument, owner: f".{argument}"):
                    checked_damping(key, value, pair.mean_stiffness, pair.reduced_mass)
            if pair and key != coefficient_key:
                if key == "logarithmic_decrement":
                    value /= math.hypot(math.tau, value)
                value = damping_coefficient(value, pair.mean_stiffness, pair.reduced_mass)
                value = rounded(value)
            coefficients[coefficient_key] = value
        return Damping.model_construct(**coefficients) if pair else self


class State(Section):
    """State at the start, tau = 0: the middle of the segment of C_max."""

    displacement: t.Finite = entry("x, in static deflections.", 0.0)
    velocity: t.Finite = entry("dx/dtau, in static deflections per radian.", 0.0)


class MeshCase(Section):
    """One of several runs that are drawn side by side: a gear pair at one tuning."""

    title: t.Label = entry("Title above the column or panel; names the case in the data.")
    # This key precedes `tuning`, because a tuning in rpm is converted for the changed pair.
    change: Change = entry("Other values for keys of gear_pair, in this case only.", {})
    tuning: t.Tuning = entry("Tuning nu.")


class Run(Section):
    """Length and recorded part of each run."""

    revolutions: t.LargeCount = entry("Revolutions of each run.", 5)
    recorded_revolutions: t.whole(1) = entry("Number of last revolutions that are evaluated.", 1)
    samples_per_period: t.whole(8, 65_536) = entry("Samples per mesh period in phase planes.", 256)
    initial_state: State = entry("State from which runs from rest start.", {})

    @model_validator(mode="after")
    def _check(self) -> "Run":
        """Refuse more recorded revolutions than revolutions."""
        recorded, revolutions = self.recorded_revolutions, self.revolutions
        allowed = f"an integer from 1 to .revolutions = {revolutions}"
        checks.require(recorded <= revolutions, ".recorded_revolutions", recorded, allowed)
        return self


#: Error message where drawn gears have no bearings.
MISSING_BEARINGS = (
    "six_degrees.bearing_stiffness is missing: it must be a list of 4 entries, C3y, C3z, C2y, C2z "
    "in N/m, for these gears; bearing_damping in N s/m comes beside it"
)


class SixDegrees(Section):
    """Bodies and bearings of six degrees of freedom, SI; gear 3 first, then gear 2.

    For drawn gears, the pinion first, radii, inertias, masses and pitch phase follow from the
    drawing; damping, run-out and friction are 0 by default; the bearing stiffness must be given.
    The defaults of other gears assume two equal gears on soft bearings.
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
        "Friction coefficients in drive-side and back-side contact.", [0.05, 0.05]
    )
    pitch_phase: t.Angle = entry("Mesh phase at the pitch point, rad.", 0.0)
    moving_backlash: t.Truth = entry(
        "Whether the back-side flank moves with the bearings, as in Eq. (4).", True
    )

    @model_validator(mode="after")
    def _check(self) -> "SixDegrees":
        """Refuse bodies of which only some of radii, inertias and masses are given."""
        for key in ("base_radii", "inertias", "masses"):
            if getattr(self, key) is None:
                raise PydanticCustomError("missing_key", "", {"key": key})
        return self
