"""Gear pair with parameters in SI units, from which its dimensionless ratios follow.

The engines use only the ratios and the tuning ``nu = omega_c / Omega_s``.

Source: Hortel & Skuderova, Engineering Mechanics 14 (2007) 91-104. The paper prints
``m_red = 0.003123 kg``; only 0.003123 N s^2/mm = 3.123 kg agrees with its damping ratios.
"""

import math
from collections.abc import Callable
from functools import cached_property
from operator import attrgetter
from typing import TYPE_CHECKING, Annotated, Any

from annotated_types import Ge

from gearlib import checks
from gearlib.engines.pair.stiffness import mean_over_max
from gearlib.models.model import Model, single_mesh_propagator, taylor_propagator
from gearlib.models.pair_parameters import MAX_MAGNITUDE, PairParameters, check_scales
from gearlib.parameters import ContactRatio, NonNegative, StiffnessRatio, Unit, checked, declared

#: Smallest stiffness ratio for the scalar closed forms. They describe the motion relative to the
#: equilibrium of each segment. For a smaller ratio, the equilibrium of the softer segment is so far
#: away that more than four digits are lost.
_MIN_SCALAR_STIFFNESS_RATIO = 1e-4


def _scalar_propagator(model: "GearPair", tuning: float, **options: Any) -> Any:
    """Create the integrator of a gear pair by scalar closed forms at a tuning.

    `tuning` is the mesh frequency over the natural frequency; `options` are keyword arguments of
    the integrator class `Propagator`.
    """
    # Imported on first use, because it takes time to load.
    from gearlib.engines.pair.propagator import Propagator

    return Propagator(model, tuning, **options)


@declared()
class GearPair(PairParameters, Model):
    """One pair of spur gears, in SI units; immutable."""

    has_pair_equation = True

    def __post_init__(self) -> None:
        """Check the parameters, their scales and the damping ratios.

        Products of values outside the limits could overflow or underflow.
        """
        super().__post_init__()
        check_scales(self)
        max_damping = MAX_MAGNITUDE * 2.0 * self.reduced_mass * self.mean_eigenfrequency
        allowed = (
            f"a finite number >= 0 and <= {max_damping:.3g}, a damping ratio of {MAX_MAGNITUDE}"
        )
        for name in ("material_damping", "backlash_damping"):
            damping = getattr(self, name)
            # None means that the damping in contact is unknown.
            checks.require(damping is None or damping <= max_damping, name, damping, allowed)

    @classmethod
    @checked
    def from_ratios(
        cls,
        *,
        contact_ratio: ContactRatio,
        stiffness_ratio: StiffnessRatio,
        damping: NonNegative = 0.0,
        backlash_damping: NonNegative = 0.0,
        backlash_ratio: Annotated[
            float, Ge(0), Unit("1", infinity_text="infinity included")
        ] = math.inf,
        teeth: int = 24,
    ) -> "GearPair":
        """Return a pair with the given dimensionless ratios and unit scales.

        Mean stiffness, reduced mass and load are 1 N/m, 1 kg and 1 N, so that the static deflection
        is 1 m and the mean eigenfrequency is 1 rad/s.

        Parameters
        ----------
        contact_ratio, stiffness_ratio : float
            Contact ratio epsilon in [1, 2]; ratio kappa of minimum to maximum stiffness in (0, 1].
        damping, backlash_damping : float, default 0
            Damping ratios beta in contact and beta_m in free flight; finite, >= 0.
        backlash_ratio : float, default infinite
            Backlash in units of the static deflection; >= 0.
        teeth : int, default 24
            Number of mesh periods per revolution.

        Raises
        ------
        ValueError
            If a value is impossible; the message names parameter, value and range.
        """
        stiffness_quotient = mean_over_max(contact_ratio, stiffness_ratio)
        # Mass and load equal the rounded mean stiffness, so that static deflection and
        # eigenfrequency are exactly 1 and the ratios are not rounded.
        mean_stiffness = 1.0 / stiffness_quotient * stiffness_quotient
        return cls(
            max_stiffness=1.0 / stiffness_quotient,
            stiffness_ratio=stiffness_ratio,
            contact_ratio=contact_ratio,
            reduced_mass=mean_stiffness,
            load=mean_stiffness,
            backlash=backlash_ratio,
            material_damping=2.0 * damping * mean_stiffness,
            backlash_damping=2.0 * backlash_damping * mean_stiffness,
            teeth=teeth,
        )

    @classmethod
    def from_geometry(cls, stage: Any, **options: Any) -> "GearPair":
        """Return the gear pair of two gears in mesh; its reference gear is the pinion.

        Parameters
        ----------
        stage : gearlib.geometry.GearStage
            Geometry of the two gears in mesh.
        torque : float
            Torque on the pinion in N m; finite, > 0. Alternatively give power and speed.
        power, speed : float
            Power in W and speed of the pinion in rpm; finite, > 0.
        damping_ratio, logarithmic_decrement, material_damping : float, optional
            Damping in contact, given by at most one of the damping ratio beta in [0, 1), the
            logarithmic decrement 2 pi beta / sqrt(1 - beta^2) and the coefficient k_1 in N s/m. If
            none is given, the damping is unknown, and only stiffness and resonance can be computed.
        backlash_damping_ratio : float, default 0
            Damping ratio beta_m in free flight, >= 0 and < 1.
        stiffness : {"iso", "energy"} or Tabulated, default "iso"
            Method or table of the mesh stiffness; see `gearlib.geometry.mesh_stiffness`.
        options : dict, optional
            Options of the stiffness method.

        Raises
        ------
        ValueError
            If a value is impossible; the message names parameter, value and range.
        """
        return cls(**checks.check_gear_stage(stage).pair_parameters(**options))

    @property
    def pair(self) -> "GearPair":
        """The pair itself."""
        return self

    @cached_property
    def equation(self) -> Any:
        """The dimensionless `Equation` of motion.

        The unit of length is the static deflection, and the unit of time is 1 / Omega_s with the
        natural frequency Omega_s at the mean stiffness.
        """
        # Imported here, because reading a configuration needs the fields but no equation.
        from gearlib.models.one_degree_pair import pair_equation
        from gearlib.models.profiles import Rectangular

        return pair_equation(self, Rectangular().piecewise_stiffness(self))

    @property
    def propagators(self) -> dict[str, Callable]:
        """Factories of integrators as a dict method name -> function; the first is the default.

        "exact" uses closed forms, and "taylor" uses Taylor series. The closed forms are scalar,
        which is faster, unless the stiffness ratio is so small that they lose digits.
        """
        propagators = {"exact": _scalar_propagator, "taylor": taylor_propagator}
        if self.stiffness_ratio < _MIN_SCALAR_STIFFNESS_RATIO:
            propagators["exact"] = single_mesh_propagator
        return propagators

    def has_damping(self) -> bool:
        """Return whether damping acts in contact or in free flight."""
        return checks.require_damping(self.material_damping) > 0.0 or self.backlash_damping > 0.0

    @property
    def min_stiffness(self):
        """Minimum mesh stiffness C_min, N/m."""
        return self.stiffness_ratio * self.max_stiffness

    @property
    def tuning_factor_max(self):
        """Factor sqrt(C_s / C_max) in nu_max = nu * tuning_factor_max."""
        return math.sqrt(self.mean_stiffness / self.max_stiffness)

    @property
    def tuning_factor_min(self):
        """Factor sqrt(C_s / C_min) in nu_min = nu * tuning_factor_min."""
        return math.sqrt(self.mean_stiffness / self.min_stiffness)

    def tuning_max(self, tuning: Any) -> Any:
        """Return the tuning relative to the natural frequency at the maximum stiffness.

        `tuning`, a float or array, is the mesh frequency over the mean natural frequency.
        """
        return tuning * self.tuning_factor_max

    def tuning_min(self, tuning: Any) -> Any:
        """Return the tuning relative to the natural frequency at the minimum stiffness.

        `tuning`, a float or array, is the mesh frequency over the mean natural frequency.
        """
        return tuning * self.tuning_factor_min

    def mesh_frequency(self, tuning: Any) -> Any:
        """Return the mesh frequency omega_c = nu Omega_s in rad/s at a tuning (float or array)."""
        return tuning * self.mean_eigenfrequency

    def speed(self, tuning: Any) -> Any:
        """Return the speed of the reference gear in rpm at a tuning (float or array)."""
        return self.mesh_frequency(tuning) * 60.0 / (2.0 * math.pi * self.teeth)

    @property
    def flank_lines(self) -> tuple[float, float]:
        """Displacements at which drive-side and coast-side contact begin.

        They are in units of the static deflection.
        """
        return 0.0, -self.backlash_ratio

    def scales(self) -> dict[str, float]:
        """Return the scales of a dataset that do not depend on the speed, as a dict name -> value.

        Deflection, force and stiffness are in SI units; backlash_ratio is the backlash in units of
        the static deflection. tuning_factor_max and tuning_factor_min convert a tuning to the
        tuning relative to the natural frequency at maximum and minimum stiffness.
        """
        return {
            "static_deflection": self.static_deflection,
            "force_scale": self.load,
            "stiffness_scale": self.mean_stiffness,
            "backlash_ratio": self.backlash_ratio,
            "tuning_factor_max": self.tuning_factor_max,
            "tuning_factor_min": self.tuning_factor_min,
        }


class WithPair(Model):
    """A model with a field ``pair``, a `GearPair`, whose scales and ratios it shares."""

    if TYPE_CHECKING:

        def __getattr__(self, name: str) -> Any: ...

    def as_dict(self) -> dict:
        """Return the parameters of the model and of its gear pair as one dict of plain values.

        If both have a parameter of the same name, the parameter of the model is kept.
        """
        values = super().as_dict()
        return values.pop("pair") | values


for _name in (
    *("max_stiffness", "min_stiffness", "mean_stiffness", "stiffness_ratio", "contact_ratio"),
    *("reduced_mass", "load", "backlash", "backlash_ratio", "material_damping", "damping_ratio"),
    *("backlash_damping", "backlash_damping_ratio", "teeth", "static_deflection"),
    *("mean_eigenfrequency", "flank_lines", "tuning_factor_max", "tuning_factor_min"),
    *("tuning_max", "tuning_min", "mesh_frequency", "scales", "speed", "name"),
):
    setattr(WithPair, _name, property(attrgetter(f"pair.{_name}"), doc=f"`GearPair.{_name}`."))
