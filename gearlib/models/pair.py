"""Parameters of a gear pair: the border between SI units and dimensionless ratios.

Nothing below this module knows a unit: kernels see the ratios and the tuning
``nu = omega_c / Omega_s`` only.

Source: Hortel & Skuderova, Engineering Mechanics 14 (2007) 91-104. The paper prints
``m_red = 0.003123 kg``; only 0.003123 N s^2/mm = 3.123 kg agrees with its damping ratios.
"""

import math
from dataclasses import dataclass
from functools import cached_property
from operator import attrgetter
from typing import TYPE_CHECKING, Any

from gearlib import checks, parameters
from gearlib.engines.pair.stiffness import force_note, mean_over_max
from gearlib.models.model import Model
from gearlib.models.pair_parameters import LARGEST, PairParameters, check_scales

#: Below, the rest position of the softer segment lies so far away that the scalar closed forms,
#: which are written about it, lose more than four digits.
_LEAST_STIFFNESS_RATIO = 1e-4


@parameters.documented
@dataclass(frozen=True, kw_only=True)
class GearPair(PairParameters, Model):
    """One pair of spur gears, in SI units; immutable.

    Raises
    ------
    ValueError
        If a value is impossible; the message names parameter, value and range.
    """

    one_mesh = True

    @property
    def force_note(self):
        """Return the sentence that its forces jump, "" where the stiffness is constant."""
        return "" if self.contact_ratio in (1.0, 2.0) else force_note(self.stiffness_ratio)

    def __post_init__(self):
        super().__post_init__()
        check_scales(self)
        for name in ("material_damping", "backlash_damping"):
            value = getattr(self, name)
            most = LARGEST * 2.0 * self.reduced_mass * self.mean_eigenfrequency
            words = f"a finite number >= 0 and <= {most:.3g}, a damping ratio of {LARGEST}"
            checks.require(value is None or value <= most, name, value, words)

    @classmethod
    def from_ratios(
        cls,
        *,
        contact_ratio,
        stiffness_ratio,
        damping=0.0,
        backlash_damping=0.0,
        backlash=math.inf,
        teeth=24,
    ):
        """Return a pair given by its dimensionless ratios, in unit scales.

        Mean stiffness, reduced mass and load are 1 N/m, 1 kg and 1 N, so that one
        static deflection is 1 m and the mean eigenfrequency is 1 rad/s.

        Parameters
        ----------
        contact_ratio, stiffness_ratio : float
            epsilon in [1, 2], kappa in (0, 1].
        damping, backlash_damping : float, default 0
            Damping ratios beta (contact) and beta_m (backlash); finite, >= 0.
        backlash : float, default infinite
            In static deflections; >= 0.
        teeth : int, default 24
            Mesh periods per revolution.

        Raises
        ------
        ValueError
            If a value is impossible; the message names parameter, value and range.
        """
        damping = checks.finite_nonnegative("damping", damping)
        backlash_damping = checks.finite_nonnegative("backlash_damping", backlash_damping)
        contact_ratio = parameters.CONTACT_RATIO.check("contact_ratio", contact_ratio)
        stiffness_ratio = parameters.STIFFNESS_RATIO.check("stiffness_ratio", stiffness_ratio)
        over_max = mean_over_max(contact_ratio, stiffness_ratio)
        # The mean stiffness is 1 up to rounding. Mass and load are the very same number, so that
        # static deflection and eigenfrequency are exactly 1 and ratios keep their last digit.
        unit = 1.0 / over_max * over_max
        return cls(
            max_stiffness=1.0 / over_max,
            stiffness_ratio=stiffness_ratio,
            contact_ratio=contact_ratio,
            reduced_mass=unit,
            load=unit,
            backlash=backlash,
            material_damping=2.0 * damping * unit,
            backlash_damping=2.0 * backlash_damping * unit,
            teeth=teeth,
        )

    @classmethod
    def from_geometry(cls, mesh, **options):
        """Return the pair of two drawn gears, free to turn, whose pinion counts the revolutions.

        Parameters
        ----------
        mesh : gearlib.geometry.Mesh
        torque : float
            Of the pinion, N m; finite, > 0. Or instead of it:
        power, speed : float
            W and rpm of the pinion; finite, > 0.
        damping_ratio, logarithmic_decrement, material_damping : float, optional
            Damping in contact, one of them at most: beta; delta = 2 pi beta / sqrt(1 - beta^2);
            k_1 in N s/m. The damping ratio is >= 0 and < 1. Left out, the damping is unknown:
            stiffness and resonance need none, whatever moves the gears asks for it.
        backlash_damping_ratio : float, default 0
            beta_m, >= 0 and < 1.
        stiffness : {"iso", "energy"} or Tabulated, default "iso"
            How the mesh stiffness is found; see `gearlib.geometry.mesh_stiffness`.
        options : dict, optional
            Of that method.

        Raises
        ------
        ValueError
            If a value is impossible; the message names parameter, value and range.
        """
        return cls(**checks.drawn_mesh(mesh).pair_parameters(**options))

    @property
    def mesh(self):
        """The pair itself."""
        return self

    @cached_property
    def equation(self):
        """The `Equation` in static deflections and 1 / Omega_s of time."""
        # Here: a start of the workflow reads what is declared, and does not pay for numbers.
        from gearlib.models.one_degree import equation_of_pair
        from gearlib.models.profiles import Rectangular

        return equation_of_pair(self, Rectangular().pieces(self))

    @property
    def propagators(self):
        """Scalar closed forms where they keep their digits; see `Model.propagators`."""
        scalar = self.stiffness_ratio >= _LEAST_STIFFNESS_RATIO
        exact = "pair.propagator" if scalar else "linear.one_mesh"
        return {"exact": exact, "taylor": "taylor.propagator"}

    def damped(self):
        """Return whether any phase of the motion is damped."""
        return checks.known_damping(self.material_damping) > 0.0 or self.backlash_damping > 0.0

    @property
    def min_stiffness(self):
        """Minimum mesh stiffness C_min, N/m."""
        return self.stiffness_ratio * self.max_stiffness

    @property
    def tuning_factor_max(self):
        """sqrt(C_s / C_max), so that nu_max = nu * tuning_factor_max."""
        return math.sqrt(self.mean_stiffness / self.max_stiffness)

    @property
    def tuning_factor_min(self):
        """sqrt(C_s / C_min), so that nu_min = nu * tuning_factor_min."""
        return math.sqrt(self.mean_stiffness / self.min_stiffness)

    def tuning_max(self, tuning):
        """Return nu_max = omega_c / Omega_max for a tuning nu (float or array)."""
        return tuning * self.tuning_factor_max

    def tuning_min(self, tuning):
        """Return nu_min = omega_c / Omega_min for a tuning nu (float or array)."""
        return tuning * self.tuning_factor_min

    def mesh_frequency(self, tuning):
        """Return omega_c = nu Omega_s, rad/s (float or array)."""
        return tuning * self.mean_eigenfrequency

    def speed(self, tuning):
        """Return the speed in rpm of the gear whose teeth count, at a tuning (float or array)."""
        return self.mesh_frequency(tuning) * 60.0 / (2.0 * math.pi * self.teeth)

    @property
    def flank_lines(self):
        """Displacements, in static deflections, at which normal and inverse mesh begin."""
        return 0.0, -self.backlash_ratio

    def scales(self):
        """Return the scalar variables of datasets that depend on the pair alone."""
        return {
            "static_deflection": self.static_deflection,
            "force_scale": self.load,
            "stiffness_scale": self.mean_stiffness,
            "backlash_ratio": self.backlash_ratio,
            "tuning_factor_max": self.tuning_factor_max,
            "tuning_factor_min": self.tuning_factor_min,
        }


class WithPair(Model):
    """A model with a `GearPair` as its field ``pair``, whose scales and ratios are its own.

    Every name is listed: one that means something else for the model does not reach the pair.
    """

    pair: Any  #: the `GearPair`, a field of subclasses
    mesh = property(attrgetter("pair"), doc="The pair.")

    if TYPE_CHECKING:

        def __getattr__(self, name: str) -> Any: ...

    def as_dict(self):
        """Return the parameters as plain values, those of the pair among them."""
        values = super().as_dict()
        return values.pop("pair") | values


for _name in (
    *("max_stiffness", "min_stiffness", "mean_stiffness", "stiffness_ratio", "contact_ratio"),
    *("reduced_mass", "load", "backlash", "backlash_ratio", "material_damping", "damping_ratio"),
    *("backlash_damping", "backlash_damping_ratio", "teeth", "static_deflection"),
    *("mean_eigenfrequency", "flank_lines", "tuning_factor_max", "tuning_factor_min"),
    *("tuning_max", "tuning_min", "mesh_frequency", "scales", "speed"),
):
    setattr(WithPair, _name, property(attrgetter(f"pair.{_name}"), doc=f"`GearPair.{_name}`."))
