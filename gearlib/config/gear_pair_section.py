"""Sections for the gear pair, its damping, its bodies and bearings, and the length of runs."""

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
from gearlib.config.types import Section, create_section, field, get_context_value, list_of
from gearlib.models.geometry.gear_stage import damping_coefficient, resolve_damping
from gearlib.models.pair_parameters import MIN_MAGNITUDE, PairParameters, PairScales, check_scales
from gearlib.models.profiles import PROFILES
from gearlib.parameters import Allowed, RunOut

DAMPINGS = tuple(RATIO_KEYS)
#: Digits of derived values, so that they do not depend on the units in which a file is written.
_DIGITS = 12
_DampingRatio = t.number(ge=0, le=1000)
_Pair = create_section("_Pair", "", PairParameters, exclude=DAMPINGS, required=("teeth",))


def round_floats(value: Any) -> Any:
    """Round a float or a list of floats to 12 significant digits; return other values unchanged.

    The remaining digits would depend on the units in which the geometry was given.
    """
    if isinstance(value, list):
        return [round_floats(item) for item in value]
    return float(f"{value:.{_DIGITS}g}") if isinstance(value, float) else value


class GearPairSection(_Pair, PairScales):
    """The gear pair without its damping, in SI units."""

    @model_validator(mode="after")
    def _check(self) -> "GearPairSection":
        """Raise ValueError if the stiffness, mass or load is so extreme that squares overflow."""
        check_scales(self)
        mean, ratio = self.mean_stiffness, self.stiffness_ratio
        allowed = f"larger, because the mean stiffness, {mean!r} N/m, must be >= {MIN_MAGNITUDE}"
        checks.require(mean >= MIN_MAGNITUDE, "stiffness_ratio", ratio, allowed)
        return self


_CHANGEABLE = [name for name in GearPairSection.model_fields if name != "teeth"]
_DOC = "Values that replace those of gear_pair; omitted keys keep their values."
Change = create_section("Change", _DOC, PairParameters, *_CHANGEABLE, optional=_CHANGEABLE)
_Coefficients = create_section("_Coefficients", "", PairParameters, *DAMPINGS, optional=DAMPINGS)


class Damping(_Coefficients):
    """A combination of linear damping coefficients, or of ratios from which they are computed."""

    damping_ratio: _DampingRatio = field("beta: material_damping is 2 beta m_red Omega_s.", None)
    logarithmic_decrement: _DampingRatio = field("delta = 2 pi beta / sqrt(1 - beta^2).", None)
    backlash_damping_ratio: _DampingRatio = field(
        "beta_m: backlash_damping is 2 beta_m m_red Omega_s.", None
    )
    #: Coefficients or ratios as given in the configuration; ratios apply to all models.
    _configured_values: dict = PrivateAttr({})

    @model_validator(mode="after")
    def _to_coefficients(self, info: ValidationInfo) -> "Damping":
        """Return the damping with all ratios converted to coefficients, N s/m.

        Each coefficient of `RATIO_KEYS` is given either directly or by one of its ratios, e.g. the
        logarithmic decrement. The validation context of `info` contains the gear pair, with which
        the ratios are converted. If it contains no valid pair, nothing is converted.
        """
        pair = get_context_value(info, "pair")
        coefficients: dict[str, float] = {}
        given: dict[str, float] = {}
        for coefficient_key, ratio_keys in RATIO_KEYS.items():
            keys = [coefficient_key, *ratio_keys]
            values = {key: getattr(self, key) for key in keys if getattr(self, key) is not None}
            if not values:
                raise self.missing_key_error(coefficient_key)
            if len(values) > 1:
                first_key, *other_keys = values
                others = " and ".join(other_keys)
                problem = f"and {others} are not allowed together: give only one of them"
                raise checks.InputError(first_key, problem=problem)
            ((key, value),) = values.items()
            if pair and get_context_value(info, "by_geometry"):
                # Called only to raise an error if the damping ratio is not below 1.
                resolve_damping(key, value, pair.mean_stiffness, pair.reduced_mass)
            given[key] = value
            if pair and key != coefficient_key:
                if key == "logarithmic_decrement":
                    # Solve delta = 2 pi beta / sqrt(1 - beta^2) for the damping ratio beta.
                    value /= math.hypot(math.tau, value)
                value = damping_coefficient(value, pair.mean_stiffness, pair.reduced_mass)
                value = round_floats(value)
            coefficients[coefficient_key] = value
        # The values have already been validated.
        damping = Damping.model_construct(**coefficients) if pair else self
        damping._configured_values = given
        return damping

    def configured_values(self) -> dict[str, float]:
        """Return the damping as given in the configuration, as a dict: key -> value.

        The keys are coefficients (N s/m) or ratios. If the section was not read from a
        configuration, the dict has the coefficients.
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
#: Stiffness profile of the gear pair; each kind has its own section.
Profile: Any = Annotated[
    reduce(operator.or_, _PROFILE_SECTIONS),
    Field(discriminator="kind"),
    Allowed(f"a mapping with a kind (one of {', '.join(PROFILES)}) and its parameters"),
]


class State(Section):
    """Initial state at tau = 0, the middle of the interval with the stiffness C_max."""

    displacement: p.Finite = field("x, in units of the static deflection.", 0.0)
    velocity: p.Finite = field("dx/dtau, in units of the static deflection per radian.", 0.0)


class MeshCase(Section):
    """One of several runs that are drawn side by side: a gear pair at one tuning."""

    title: t.Label = field("Title of the column or panel, and name of the case in the data.")
    # This key precedes `tuning`, because a tuning in rpm is converted with the changed pair.
    change: Change = field("Values that replace those of gear_pair in this case.", {})
    tuning: t.Tuning = field("Tuning nu.")


class Run(Section):
    """Length of each run, and the part that is recorded."""

    revolutions: t.LargeCount = field("Number of revolutions of each run.", 5)
    recorded_revolutions: t.integer(1) = field("Number of last revolutions that are evaluated.", 1)
    samples_per_period: t.integer(8, 65_536) = field(
        "Samples per mesh period in phase planes.", 256
    )
    initial_state: State = field("State from which runs from rest start.", {})

    @model_validator(mode="after")
    def _check(self) -> "Run":
        """Raise ValueError if the number of recorded revolutions exceeds the length of a run."""
        recorded, revolutions = self.recorded_revolutions, self.revolutions
        allowed = f"an integer from 1 to revolutions = {revolutions}"
        checks.require(recorded <= revolutions, "recorded_revolutions", recorded, allowed)
        return self


#: Error message if gears given by geometry have no bearings.
MISSING_BEARINGS = (
    "six_degrees.bearing_stiffness is missing: these gears require a list of four values C3y, C3z, "
    "C2y, C2z in N/m; bearing_damping, in N s/m, is optional"
)


class SixDegrees(Section):
    """Bodies and bearings of the model with six degrees of freedom, in SI units.

    Gear 3 (the pinion) precedes gear 2. For gears given by geometry, radii, inertias, masses and
    pitch phase are computed from the geometry, damping, run-out and friction are 0 by default, and
    the bearing stiffness must be given. The defaults for other gears assume two equal gears on soft
    bearings.
    """

    base_radii: list_of(p.Length, 2) = field("Base radii Rb3, Rb2, m. Default: 0.1 m.", None)
    inertias: list_of(p.Inertia, 2) = field("Inertias J3, J2, kg m^2. Default: 3 Rb^2 m_red.", None)
    masses: list_of(p.Mass, 2) = field(
        "Masses m3, m2, kg. Default: 6 reduced_mass. Give radii, inertias and masses together.",
        None,
    )
    bearing_stiffness: list_of(p.Stiffness, 4) = field(
        "Stiffness C3y, C3z, C2y, C2z, N/m. Default: max_stiffness / 40.", None
    )
    bearing_damping: list_of(p.Damping, 4) = field(
        "Damping k3y, k3z, k2y, k2z, N s/m. Default: 2 % of critical damping.", None
    )
    eccentricities: list_of(RunOut, 2) = field(
        "Run-out of the pitch circles e3, e2, m. Default: 0.8 times the static deflection, at most "
        "a fifth of the backlash.",
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
        """Raise an error if the base radii, inertias or masses are missing.

        If a file gives one of these keys, it must give all of them, because the defaults are only
        consistent with each other.
        """
        for key in ("base_radii", "inertias", "masses"):
            if getattr(self, key) is None:
                raise self.missing_key_error(key)
        return self
