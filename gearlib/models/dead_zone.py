"""An oscillator with a dead zone, in its own dimensionless variables.

    x'' + d x' + e x + P(x, t) = F + sum_n (a_n cos n W t + b_n sin n W t) + f''(t)

    P = c_u(t) (x - upper_edge)     x >= upper_edge:               upper contact
      = 0                           between the edges:             the gap
      = c_l(t) (x - lower_edge)     x <= lower_edge:               lower contact

Rattling gears, a gear pair in Kahraman's and Singh's variables and an oscillator with an elastic
stop are three sets of these parameters.

The mass is 1. The "tuning" of `gearlib.simulate`, `gearlib.sweep` and the others is W, the
frequency of the forcing in the model's unit of time; phase is W t, so that a period of 2 pi is one
of the forcing, and velocities in results are dx/dphase = x' / W. Take a unit of length in which
the motion is of order one: tolerances are absolute.
"""

import math
from dataclasses import asdict, dataclass
from functools import cached_property
from typing import Annotated

import numpy as np

from gearlib import checks
from gearlib.models.harmonics import Harmonics
from gearlib.models.model import Model
from gearlib.models.oscillator import Equation
from gearlib.models.profiles import Profile, Series, Steps
from gearlib.parameters import FINITE, NONNEGATIVE, Instance, Number, documented

#: Names of variables of datasets that are otherwise those of a gear mesh.
_LONG_NAMES = {
    "phase": "phase of the forcing, 2 pi per period",
    "tuning": "frequency of the forcing",
    "displacement": "displacement",
    "velocity": "velocity by phase",
    "acceleration": "acceleration by phase",
    "stiffness": "contact stiffness",
    "modified_stiffness": "contact stiffness, 0 in the gap",
    "dynamic_force": "contact force",
    "event_phase": "phase of the crossing of an edge",
    "event_velocity": "velocity by phase at the event",
    "displacement_max": "largest displacement",
    "displacement_min": "smallest displacement",
    "dynamic_force_max": "largest contact force",
    "dynamic_force_min": "smallest contact force",
    "fraction_normal": "fraction of time in upper contact",
    "fraction_backlash": "fraction of time in the gap",
    "fraction_inverse": "fraction of time in lower contact",
    "fraction_min_stiffness": "fraction of time in contact below the mean upper stiffness",
    "bounces": "losses of upper contact per period of the forcing",
    "period": "periods of the forcing after which the settled motion repeats, 0: not settled",
    "followed": "periods of the forcing over which the motion was followed to settle",
    "final_state": "displacement and velocity by phase at the end of the run",
    "state": "displacement and velocity by phase at phase 0",
    "exponent": "largest Lyapunov exponent per period of the forcing",
    "grazing": "whether the orbit touches an edge",
    "strobe": "period of the forcing of the stroboscopic state",
    "trap_radius": "radius of the smallest trap of the orbit",
}


class _Stiffness(Number):
    """A stiffness, constant or not."""

    words = "a finite number >= 0, a Series or Steps"

    def check(self, name, value):
        return value if isinstance(value, (Series, Steps)) else super().check(name, value)


class _Edge(Number):
    """The lower edge, which may be at -infinity."""

    words = "a number < infinity"

    def accepts(self, value):
        return value < math.inf


_STIFFNESS, _HARMONICS = _Stiffness("1", least=0), Instance((Harmonics,))
_Stiff = float | Series | Steps


@documented
@dataclass(frozen=True, kw_only=True)
class DeadZoneOscillator(Model):
    """A driven oscillator between two elastic contacts with a gap; immutable.

    Raises
    ------
    ValueError
        If a value is impossible; the message names parameter, value and range.

    References
    ----------
    Kahraman, Singh: Non-linear dynamics of a spur gear pair, Journal of Sound and Vibration 142
    (1990) 49-75.
    """

    upper_edge: Annotated[float, FINITE, "Upper edge, where the upper contact begins"] = 0.0
    lower_edge: Annotated[
        float, _Edge("1"), "Lower edge, where the lower contact begins; -inf: there is none"
    ] = -math.inf
    upper_stiffness: Annotated[_Stiff, _STIFFNESS, "Stiffness of the upper contact", "c_u"]
    lower_stiffness: Annotated[
        _Stiff | None,
        _STIFFNESS,
        "Stiffness of the lower contact; by default that of the upper one",
        "c_l",
    ] = None
    damping: Annotated[float, NONNEGATIVE, "Damping of the gap", "d"] = 0.0
    upper_damping: Annotated[
        float | None, NONNEGATIVE, "Damping of the upper contact; by default that of the gap", "d"
    ] = None
    lower_damping: Annotated[
        float | None, NONNEGATIVE, "Damping of the lower contact; by default that of the gap", "d"
    ] = None
    ground_stiffness: Annotated[
        float, NONNEGATIVE, "Stiffness to the ground; a spring to x = 0 that never parts", "e"
    ] = 0.0
    load: Annotated[float, FINITE, "Load, the mean force", "F"] = 0.0
    forcing: Annotated[
        Harmonics, _HARMONICS, "Force; its amplitudes do not depend on the frequency", "a_n, b_n"
    ] = Harmonics()
    deviation: Annotated[
        Harmonics,
        _HARMONICS,
        "Motion of the support; its inertia is a force of amplitude (n W)^2",
        "f",
    ] = Harmonics()

    long_names = _LONG_NAMES
    title_noun = "a dead-zone oscillator"
    by_default = {
        "lower_stiffness": lambda model: model.upper_stiffness,
        "upper_damping": lambda model: model.damping,
        "lower_damping": lambda model: model.damping,
    }
    references = "Kahraman, Singh: Journal of Sound and Vibration 142 (1990) 49-75"

    def __post_init__(self):
        upper = FINITE.check("upper_edge", self.upper_edge)
        allowed = f"from -inf to upper_edge = {upper!r}"
        checks.number("lower_edge", self.lower_edge, allowed, lambda x: x <= upper)
        super().__post_init__()
        names = ["upper_stiffness", "lower_stiffness"][: 1 + math.isfinite(self.lower_edge)]
        if not any(_mean(getattr(self, name)) for name in names):
            values = " and ".join(f"{name} = {getattr(self, name)!r}" for name in names)
            raise ValueError(f"{values} is not allowed: one contact must have a stiffness > 0")

    @cached_property
    def equation(self):
        """The `Equation`, in the model's own units."""
        near = _pieces(self.upper_stiffness)
        same = self.lower_stiffness == self.upper_stiffness or math.isinf(self.lower_edge)
        stiffest = max(_mean(self.upper_stiffness), _mean(self.lower_stiffness))
        damping = np.zeros((3, 3))
        damping[:, 0] = self.lower_damping, self.damping, self.upper_damping
        return Equation(
            upper=self.upper_edge,
            lower=self.lower_edge,
            near=near,
            far=near if same else _pieces(self.lower_stiffness),
            damping=damping,
            powers=np.zeros(2),
            ground=self.ground_stiffness,
            load=self.load,
            force=self.forcing.table(),
            deviation=self.deviation.table(),
            natural=math.sqrt(self.ground_stiffness + stiffest),
        )

    def as_dict(self):
        """Return the parameters as plain values, in the order of the fields."""
        profiles = {
            name: stiffness.as_dict()
            for name, stiffness in vars(self).items()
            if isinstance(stiffness, Profile)
        }
        return asdict(self) | profiles


def _pieces(stiffness):
    """Return the `Pieces` of a stiffness, constant or not."""
    if isinstance(stiffness, float):
        stiffness = Steps((0.0,), (stiffness,))
    return stiffness.pieces()


def _mean(stiffness):
    """Return the mean of a stiffness over a period."""
    pieces = _pieces(stiffness)
    return float(pieces.lines[:, 0] @ np.diff(pieces.breaks)) / (2.0 * math.pi)
