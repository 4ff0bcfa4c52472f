"""Parameters, scales and ratios of a gear pair; this module does not import numpy."""

import math
from typing import TYPE_CHECKING, Annotated, Any

from annotated_types import Ge, Le

from gearlib import checks, parameters
from gearlib.engines.pair.stiffness import force_note, mean_over_max
from gearlib.parameters import (
    Backlash,
    BacklashDamping,
    ContactRatio,
    Load,
    Mass,
    MaterialDamping,
    MaxStiffness,
    StiffnessRatio,
    declared,
    described,
)

#: Limits of scales and damping ratios; squares of values beyond them could overflow or underflow.
MIN_MAGNITUDE, MAX_MAGNITUDE = 1e-30, 1e30

#: Parameters of the gear pair of Hortel and Skuderova (2007), "the paper".
PAPER = {"max_stiffness": 4e8, "stiffness_ratio": 0.5879}
PAPER |= {"contact_ratio": 1.569, "reduced_mass": 3.123}


def check_scales(pair: Any) -> None:
    """Raise ValueError if the stiffness, mass or load of a `GearPair` is too large or too small.

    Products of values beyond the limits could overflow or underflow.
    """
    allowed = f"a finite number > 0, from {MIN_MAGNITUDE} to {MAX_MAGNITUDE}"
    for name in ("max_stiffness", "reduced_mass", "load"):
        value = getattr(pair, name)
        checks.require(MIN_MAGNITUDE <= value <= MAX_MAGNITUDE, name, value, allowed)


class PairScales:
    """Scales and ratios that follow from the parameters of a gear pair."""

    if TYPE_CHECKING:

        def __getattr__(self, name: str) -> Any: ...

    @property
    def mean_stiffness(self):
        """Mean mesh stiffness C_s, N/m; Eq. (2)."""
        return self.max_stiffness * mean_over_max(self.contact_ratio, self.stiffness_ratio)

    @property
    def mean_eigenfrequency(self):
        """Mean eigenfrequency Omega_s = sqrt(C_s / m_red), rad/s."""
        return math.sqrt(self.mean_stiffness / self.reduced_mass)

    @property
    def damping_ratio(self):
        """Damping ratio in contact, beta = k_1 / (2 m_red Omega_s)."""
        damping = checks.require_damping(self.material_damping)
        return damping / (2.0 * self.reduced_mass * self.mean_eigenfrequency)

    @property
    def backlash_damping_ratio(self):
        """Damping ratio in free flight, beta_m = k_1m / (2 m_red Omega_s)."""
        return self.backlash_damping / (2.0 * self.reduced_mass * self.mean_eigenfrequency)

    @property
    def static_deflection(self):
        """Static deflection F / C_s, m: the scale of dimensionless displacements."""
        return self.load / self.mean_stiffness

    @property
    def backlash_ratio(self):
        """Backlash in units of the static deflection, s_k C_s / F."""
        return self.backlash / self.static_deflection

    @property
    def force_note(self) -> str:
        """A sentence for results about jumps of the mesh force; "" for a constant stiffness."""
        return "" if self.contact_ratio in (1.0, 2.0) else force_note(self.stiffness_ratio)

    @property
    def stiffness_model(self) -> str:
        """Description of the mesh stiffness, with its stiffness ratio and contact ratio."""
        if not self.force_note:  # Without jumps of the mesh force the stiffness is constant.
            return "constant stiffness"
        return f"rectangle, kappa {self.stiffness_ratio:.4g}, epsilon {self.contact_ratio:.4g}"

    @property
    def name(self) -> str:
        """Name of the gear pair in titles and captions.

        The gear pair of Hortel and Skuderova (2007) is recognized by the values of `PAPER`.
        """
        if all(math.isclose(getattr(self, key), value) for key, value in PAPER.items()):
            return "paper's pair"
        return (
            f"gear pair C_max {1e-6 * self.max_stiffness:.10g} N/µm, "
            f"κ {self.stiffness_ratio:.10g}, ε {self.contact_ratio:.10g}, "
            f"m_red {self.reduced_mass:.10g} kg"
        )


@declared()
class PairParameters(PairScales):
    """Parameters of a gear pair in SI units."""

    max_stiffness: MaxStiffness
    stiffness_ratio: StiffnessRatio
    contact_ratio: ContactRatio
    reduced_mass: Annotated[Mass, described("Reduced mass", "m_red")]
    load: Annotated[Load, described("Load, the mean force along the line of action,", "F")]
    backlash: Backlash
    material_damping: MaterialDamping = 0.0
    backlash_damping: BacklashDamping = 0.0
    teeth: Annotated[
        int,
        Ge(1),
        Le(10_000),
        parameters.INTEGER,
        described("Teeth z: mesh periods per revolution"),
    ] = 24


#: Name of a ratio of a gear pair -> field that it determines.
RATIOS = {
    "damping_ratio": "material_damping",
    "backlash_damping_ratio": "backlash_damping",
    "backlash_ratio": "backlash",
}
#: Name of a ratio -> description.
RATIO_NAMES = {
    "damping_ratio": "damping ratio beta",
    "backlash_damping_ratio": "damping ratio beta_m in free flight",
    "backlash_ratio": "backlash in static deflections",
}


def ratio_fields(pair: Any, ratio_name: str, value: float) -> dict[str, float]:
    """Convert a ratio of a gear pair to the field that it determines, a dict {name: SI value}.

    `ratio_name` is "damping_ratio", "backlash_damping_ratio" or "backlash_ratio", and `value` is
    its value. Damping ratios refer to the critical damping 2 m_red Omega_s with the mean
    eigenfrequency Omega_s, and the backlash ratio refers to the static deflection.
    """
    if ratio_name == "backlash_ratio":
        scale = pair.static_deflection
    else:
        scale = 2.0 * pair.reduced_mass * pair.mean_eigenfrequency
    return {RATIOS[ratio_name]: value * scale}
