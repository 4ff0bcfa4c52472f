"""Sections that describe the gear pair, its damping, its bodies and the length of the runs."""

import inspect
import math
import operator
from functools import reduce
from typing import Annotated, Any, Literal

from pydantic import Field, PrivateAttr, ValidationInfo, model_validator

from gearlib import checks
from gearlib import parameters as p
from gearlib.config import RATIO_KEYS
from gearlib.config import types as t
from gearlib.config.types import Section, create_section, field, from_context, list_of
from gearlib.models.geometry.gear_stage import checked_damping, damping_coefficient
from gearlib.models.pair_parameters import MIN_MAGNITUDE, PairParameters, PairScales, check_scales
from gearlib.models.profiles import PROFILES
from gearlib.parameters import Allowed, RunOut

DAMPINGS = tuple(RATIO_KEYS)
#: Digits of derived values; rounded values do not depend on the units of the geometry.
_DIGITS = 12
_DampingRatio = t.number(ge=0, le=1000)
_Pair = create_section("_Pair", "", PairParameters, exclude=DAMPINGS, required=("teeth",))


def rounded(value: Any) -> Any:
    """Return a float or a list of floats, rounded to 12 significant digits.

    Other values are returned unchanged. The digits that are dropped depend on the units in which
    the geometry was given.
    """
    if isinstance(value, list):
        return [rounded(item) for item in value]
    return float(f"{value:.{_DIGITS}g}") if isinstance(value, float) else value


class GearPairSection(_Pair, PairScales):
    """The gear pair in SI units, without its damping."""

    @model_validator(mode="after")
    def _check(self) -> "GearPairSection":
        """Raise ValueError if stiffness, mass or load of the pair are numerically out of range.

        Beyond these limits squares of the values overflow or underflow.
        """
        check_scales(self)
        mean, ratio = self.mean_stiffness, self.stiffness_ratio
        allowed = f"large enough for a mean stiffness, {mean!r} N/m, >= {MIN_MAGNITUDE}"
        checks.require(mean >= MIN_MAGNITUDE, "stiffness_ratio", ratio, allowed)
        return self


_CHANGEABLE = [name for name in GearPairSection.model_fields if name != "teeth"]
_DOC = "Other values for some keys of gear_pair; keys that are left out keep their values."
Change = create_section("Change", _DOC, PairParameters, *_CHANGEABLE, optional=_CHANGEABLE)
_Coefficients = create_section("_Coefficients", "", PairParameters, *DAMPINGS, optional=DAMPINGS)


class Damping(_Coefficients):
    """One combination of linear damping coefficients, or of ratios that give them."""

    damping_ratio: _DampingRatio = field("beta: material_damping is 2 beta m_red Omega_s.", None)
    logarithmic_decrement: _DampingRatio = field("delta = 2 pi beta / sqrt(1 - beta^2).", None)
    backlash_damping_ratio: _DampingRatio = field("beta_m: backlash_damping likewise.", None)
    #: The coefficients or ratios of the configuration; a ratio holds for each model of the gears.
    _configured_values: dict = PrivateAttr({})

    @model_validator(mode="after")
    def _to_coefficients(self, info: ValidationInfo) -> "Damping":
        """Return the damping with ratios replaced by their coefficients, N s/m.

        A user gives each coefficient of `RATIO_KEYS` either directly or by one of its ratios, such
        as the logarithmic decrement. `info` has the context of the validation: the gear pair, which
        converts the ratios, and whether the gears are given by geometry. Without a valid pair
        nothing is converted.
        """
        pair = from_context(info, "pair")
        coefficients: dict[str, float] = {}
        given: dict[str, float] = {}
        for coefficient_key, ratio_keys in RATIO_KEYS.items():
            keys = [coefficient_key, *ratio_keys]
            values = {key: getattr(self, key) for key in keys if getattr(self, key) is not None}
            if not values:
                raise self.missing_key_error(coefficient_key)
            if len(values) > 1:
                first_key, *other_keys = values
                problem = (
                    f"and {' and '.join(other_keys)} are not allowed together: it must be one of "
                    "them"
                )
                raise checks.InputError(first_key, problem=problem)
            ((key, value),) = values.items()
            if pair and from_context(info, "by_geometry"):
                # This call only raises an error unless the damping ratio is below 1.
                checked_damping(key, value, pair.mean_stiffness, pair.reduced_mass)
            given[key] = value
            if pair and key != coefficient_key:
                if key == "logarithmic_decrement":
                    # delta = 2 pi beta / sqrt(1 - beta^2), solved for the damping ratio beta
                    value /= math.hypot(math.tau, value)
                value = damping_coefficient(value, pair.mean_stiffness, pair.reduced_mass)
                value = rounded(value)
            coefficients[coefficient_key] = value
        # The values are checked already, so that the section is made without validation.
        damping = Damping.model_construct(**coefficients) if pair else self
        damping._configured_values = given
        return damping

    def configured_values(self) -> dict[str, float]:
        """Return the damping as the configuration states it, as a dict: key -> value.

        The keys are those of coefficients (N s/m) or of ratios. A damping that was created in the
        program, without a configuration, has its coefficients.
        """
        return dict(self._configured_values) or self.model_dump(include=set(DAMPINGS))


_PROFILE_SECTIONS = [
    create_section(
        f"{profile.__name__}Profile",
        inspect.getdoc(profile).partition("\n")[0],
        profile,
        kind=(Literal[kind], field("Kind of the profile.")),
    )
    for kind, profile in PROFILES.items()
]
#: Stiffness profile of the gear pair, a section for each kind.
Profile: Any = Annotated[
    reduce(operator.or_, _PROFILE_SECTIONS),
    Field(discriminator="kind"),
    Allowed(f"a mapping with a kind, one of {', '.join(PROFILES)}, and its parameters"),
]


class State(Section):
    """State at the start, tau = 0: the middle of the segment of C_max."""

    displacement: p.Finite = field("x, in static deflections.", 0.0)
    velocity: p.Finite = field("dx/dtau, in static deflections per radian.", 0.0)


class MeshCase(Section):
    """One of several runs that are drawn side by side: a gear pair at one tuning."""

    title: t.Label = field("Title above the column or panel; names the case in the data.")
    # This key precedes `tuning`, because a tuning in rpm is converted for the changed pair.
    change: Change = field("Other values for keys of gear_pair, in this case only.", {})
    tuning: t.Tuning = field("Tuning nu.")


class Run(Section):
    """Length and recorded part of each run."""

    revolutions: t.LargeCount = field("Revolutions of each run.", 5)
    recorded_revolutions: t.integer(1) = field("Number of last revolutions that are evaluated.", 1)
    samples_per_period: t.integer(8, 65_536) = field(
        "Samples per mesh period in phase planes.", 256
    )
    initial_state: State = field("State from which runs from rest start.", {})

    @model_validator(mode="after")
    def _check(self) -> "Run":
        """Raise ValueError if more revolutions are recorded than a run has.

        The recorded revolutions are the last ones of a run, which are evaluated.
        """
        recorded, revolutions = self.recorded_revolutions, self.revolutions
        allowed = f"an integer from 1 to revolutions = {revolutions}"
        checks.require(recorded <= revolutions, "recorded_revolutions", recorded, allowed)
        return self


#: Error message where gears given by geometry have no bearings.
MISSING_BEARINGS = (
    "six_degrees.bearing_stiffness is missing: it must be a list of 4 entries, C3y, C3z, C2y, C2z "
    "in N/m, for these gears; bearing_damping in N s/m comes beside it"
)


class SixDegrees(Section):
    """Bodies and bearings of six degrees of freedom, SI; gear 3 first, then gear 2.

    For gears given by geometry, the pinion first, radii, inertias, masses and pitch phase follow
    from the geometry; damping, run-out and friction are 0 by default; the bearing stiffness must be
    given. The defaults of other gears assume two equal gears on soft bearings.
    """

    base_radii: list_of(p.Length, 2) = field("Base radii Rb3, Rb2, m. Default: 0.1 m.", None)
    inertias: list_of(p.Inertia, 2) = field("Inertias J3, J2, kg m^2. Default: 3 Rb^2 m_red.", None)
    masses: list_of(p.Mass, 2) = field(
        "Masses m3, m2, kg. Default: 6 reduced_mass; radii, inertias and masses come together.",
        None,
    )
    bearing_stiffness: list_of(p.Stiffness, 4) = field(
        "Stiffness C3y, C3z, C2y, C2z, N/m. Default: max_stiffness / 40.", None
    )
    bearing_damping: list_of(p.Damping, 4) = field(
        "Damping k3y, k3z, k2y, k2z, N s/m. Default: 2 % of the critical.", None
    )
    eccentricities: list_of(RunOut, 2) = field(
        "Run-out of the pitch circles e3, e2, m. Default: 0.8 static deflections, at most a fifth "
        "of the backlash.",
        None,
    )
    run_out_phase: p.Angle = field("Relative phase Delta of the run-out, rad.", 0.0)
    friction: list_of(p.NonNegative, 2) = field(
        "Friction coefficients in drive-side and coast-side contact.", [0.05, 0.05]
    )
    pitch_phase: p.Angle = field("Mesh phase at the pitch point, rad.", 0.0)
    moving_backlash: p.Boolean = field(
        "Whether the coast-side flank moves with the bearings, as in Eq. (4).", True
    )

    @model_validator(mode="after")
    def _check(self) -> "SixDegrees":
        """Raise an error if radii, inertias or masses of the two gears are missing.

        These keys have defaults that suit each other. If the user gives one of the keys,
        `defaults.add_defaults` adds no default for the others, which must then be given as well.
        """
        for key in ("base_radii", "inertias", "masses"):
            if getattr(self, key) is None:
                raise self.missing_key_error(key)
        return self
