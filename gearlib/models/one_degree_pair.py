"""Models with one degree of freedom: gear pairs, dead-zone oscillators and their equation.

    x'' + e x + d(x') + c(tau) (g + p2 |g| g + p3 g^3)
        = F + sum_n (a_n cos n tau + b_n sin n tau) + f''(tau),        tau = nu t,

    g(x) = x - upper     x >= upper           DRIVE contact, c and d of the drive side
         = 0             lower < x < upper    NO_CONTACT, d of the gap
         = x - lower     x <= lower           COAST contact, c and d of the coast side

with d(v) = d1 v + d2 |v| v + d3 v^3 and x' in units of the time t of the model; nu is the frequency
of the excitation in that unit. Each model converts its parameters to an `Equation`. The engines
integrate it by Taylor series as a `NonlinearMesh` or, if it is linear with constant coefficients
between events, in closed form as a `TrainSystem` with one mesh.

A gear pair obeys Eq. (3) of Hortel & Skuderova (2007) for one coordinate,

    m y'' + k y' + D2 |y'| y' + D3 y'^3 + C(tau) (g + g2 |g| g + g3 g^3)
        = F + sum_n (a_n cos n tau + b_n sin n tau) + m f''(tau),

with the relative mesh displacement y = q + f(tau) of Eq. (4): the rigid-body motion q of the flanks
plus the deviation f from the involute, whose inertia acts as a force. The coefficients k, D2 and D3
describe the damping of the material in contact, and of the oil in free flight. In units of the
static deflection d_s = F / C_s and of 1 / Omega_s, the damping with respect to the mesh phase is
d1 = 2 beta / nu, d2 = D2 d_s / m, d3 = D3 d_s^2 Omega_s nu / m.
"""

import math
from dataclasses import dataclass, field
from functools import cached_property
from typing import Annotated

import numpy as np
from annotated_types import Ge

from gearlib import checks
from gearlib.engines.codes import COAST, DRIVE, NO_CONTACT
from gearlib.engines.linear.train_system import TrainSystem
from gearlib.engines.pair.stiffness import force_note
from gearlib.engines.taylor.series import NonlinearMesh
from gearlib.models import single_mesh_system
from gearlib.models.harmonics import Harmonics
from gearlib.models.model import Model
from gearlib.models.pair import GearPair, WithPair
from gearlib.models.profiles import PiecewiseStiffness, Profile, Rectangular, Series, Steps
from gearlib.parameters import (
    Allowed,
    Finite,
    NonNegative,
    Unit,
    declared,
    described,
    units_and_names,
)

_Quadratic = Annotated[float, Ge(0), Unit("N s^2/m^2")]
_Cubic = Annotated[float, Ge(0), Unit("N s^3/m^3")]


@dataclass(frozen=True)
class Equation:
    """Parameters of the equation of motion in the docstring of this module, in consistent units."""

    upper: float  #: displacement at which drive-side contact begins; finite
    lower: float  #: displacement at which coast-side contact begins, <= upper; -inf if none
    drive_stiffness: PiecewiseStiffness  #: stiffness c(tau) of drive-side contact
    coast_stiffness: PiecewiseStiffness  #: the same object as `drive_stiffness` if equal
    damping: np.ndarray  #: d1, d2, d3 in coast-side contact, gap, drive-side contact, shape (3, 3)
    stiffness_powers: np.ndarray = field(default_factory=lambda: np.zeros(2))  #: p2, p3
    ground_stiffness: float = 0.0  #: stiffness e to the ground
    load: float = 1.0  #: mean force F
    #: Rows (n, a_n, b_n) of the force, shape (k, 3), and of the deviation f, shape (j, 3).
    force: np.ndarray = field(default_factory=lambda: np.empty((0, 3)))
    deviation: np.ndarray = field(default_factory=lambda: np.empty((0, 3)))
    natural_frequency: float = 1.0  #: natural frequency in contact, which limits the step

    def is_piecewise_linear(self) -> bool:
        """Return whether the equation is linear with constant coefficients between contact events.

        Damping must be linear, contact forces must be proportional to the deflection, and the
        stiffness must be piecewise constant.
        """
        nonlinear = self.damping[:, 1:].any() or self.stiffness_powers.any()
        for stiffness in (self.drive_stiffness, self.coast_stiffness):
            slopes = stiffness.values_and_slopes[:, 1]
            nonlinear |= bool(stiffness.harmonics.size) or slopes.any()
        return not nonlinear

    def nonlinear_mesh(self, tuning: float, tolerance: float) -> NonlinearMesh:
        """Return the constants of the equation for integration by Taylor series.

        `tuning` is the frequency nu of the excitation, and `tolerance` is the error tolerance of a
        step. Derivatives are taken with respect to the mesh phase tau = nu t instead of the time,
        so that x' becomes nu x', and the equation is divided by nu^2.
        """
        force_scale = 1.0 / tuning**2
        drive_side, coast_side = self.stiffness_of_both_sides()
        # The columns of `damping` are linear, quadratic and cubic coefficients.
        damping = self.damping * np.array([1.0 / tuning, 1.0, tuning])
        # Harmonics are rows (order, cosine, sine); the order is not scaled.
        harmonic_scale = np.array([1.0, force_scale, force_scale])
        inertia = self.deviation.copy()
        # The second derivative of a harmonic of order n is -n^2 times the harmonic.
        inertia[:, 1:] *= -(inertia[:, :1] ** 2)
        mean_force = [0.0, self.load * force_scale, 0.0]  # a harmonic of order 0
        return NonlinearMesh(
            tuning=tuning,
            backlash_ratio=self.upper - self.lower,
            drive_damping=damping[DRIVE + 1],
            backlash_damping=damping[NO_CONTACT + 1],
            stiffness_powers=self.stiffness_powers,
            segment_bounds=drive_side.breakpoints,
            stiffness_segments=drive_side.values_and_slopes * force_scale,
            below_mean=drive_side.is_below_mean,
            stiffness_harmonics=drive_side.harmonics * harmonic_scale,
            force_harmonics=np.vstack([mean_force, self.force * harmonic_scale, inertia]),
            tolerance=tolerance,
            drive_line=self.upper,
            coast_line=self.lower,
            ground_stiffness=self.ground_stiffness * force_scale,
            coast_damping=damping[COAST + 1],
            coast_stiffness_segments=coast_side.values_and_slopes * force_scale,
            coast_stiffness_harmonics=coast_side.harmonics * harmonic_scale,
        )

    def system(self, tuning: float) -> TrainSystem:
        """Return the state-space matrices of a piecewise-linear equation, a `TrainSystem`.

        `tuning` is the frequency nu of the excitation. The state consists of q = x - f (the
        displacement x without the deviation f of the flanks), dq/dt, the constant 1, and a cosine
        and a sine of each order of the excitation. In these coordinates the deviation moves the
        flanks, and its inertia does not appear as a force.
        """
        drive_side, coast_side = self.stiffness_of_both_sides()
        orders = np.unique(np.concatenate([self.force[:, 0], self.deviation[:, 0]]))
        n = 3 + 2 * orders.size  # number of state components
        # `drive_row` and `coast_row` map the state to the distances of the flanks.
        drive_row, coast_row, force_input = np.zeros((3, n), np.result_type(tuning))
        drive_row[0], force_input[1] = 1.0, -1.0
        gap_damping = self.damping[NO_CONTACT + 1, 0]
        free = single_mesh_system.oscillator_matrix(n, 3, tuning * orders).astype(drive_row.dtype)
        free[0, 1] = 1.0  # row of dq/dt
        free[1, 2] = self.load  # row of d2q/dt2
        for row_vector, harmonics in ((free[1], self.force), (drive_row, self.deviation)):
            for order, cosine, sine in harmonics:
                column = 3 + 2 * int(np.searchsorted(orders, order))
                row_vector[column : column + 2] += cosine, sine
        # The position of the flank is not subtracted yet: drive_row @ state is x, and
        # (drive_row @ free) @ state is dx/dt.
        free[1] -= self.ground_stiffness * drive_row + gap_damping * (drive_row @ free)
        coast_row[:] = drive_row
        drive_row[2] = -self.upper
        # The damping of free flight always acts; contact adds the difference.
        drive_levels = drive_side.values_and_slopes[:, 0]
        coast_levels = coast_side.values_and_slopes[:, 0]
        damping = self.damping[DRIVE + 1, 0] - gap_damping
        flanks = {DRIVE: single_mesh_system.Flank(drive_row, drive_levels, damping)}
        if np.isfinite(self.lower):
            coast_row[2] = -self.lower
            damping = self.damping[COAST + 1, 0] - gap_damping
            flanks[COAST] = single_mesh_system.Flank(coast_row, coast_levels, damping)
        return single_mesh_system.assemble_single_mesh_system(
            free,
            force_input,
            flanks,
            drive_side.is_below_mean,
            drive_side.breakpoints,
            orders,
            tuning,
        )

    def static_displacement(self, load: float) -> float:
        """Return the displacement in static equilibrium just after phase 0.

        `load` is a factor on the mean force of the equation. If there is no equilibrium, or more
        than one, return the displacement without deflection that is closest to 0.
        """
        # At phase 0 only the cosines of the harmonics, in column 1, contribute.
        force, ground = self.load * load + self.force[:, 1].sum(), self.ground_stiffness
        contacts = (1.0, self.upper, self.drive_stiffness), (-1.0, self.lower, self.coast_stiffness)
        for sign, contact_position, profile in contacts:
            pushing_force = sign * (force - ground * contact_position)
            # Skip a flank that does not exist, or that the force does not push against.
            if not math.isfinite(contact_position) or pushing_force <= 0.0:
                continue
            stiffness = profile.values_and_slopes[0, 0] + profile.harmonics[:, 1].sum()
            if not stiffness + ground > 0.0:
                continue  # Nothing would resist the force.
            # The force increases with the deflection, so that exactly one root is positive.
            cubic, quadratic = stiffness * self.stiffness_powers[::-1]
            polynomial = [cubic, quadratic, stiffness + ground, -pushing_force]
            deflection = np.roots(polynomial).real.max()
            return float(contact_position + sign * deflection)
        if ground:  # Only the spring to the ground carries the force.
            return float(force / ground)
        return float(np.clip(0.0, self.lower, self.upper))

    def stiffness_of_both_sides(self) -> tuple[PiecewiseStiffness, PiecewiseStiffness]:
        """Return the stiffness of drive-side and coast-side contact with common breakpoints."""
        if self.drive_stiffness is self.coast_stiffness:
            return self.drive_stiffness, self.coast_stiffness
        breakpoints = np.union1d(self.drive_stiffness.breakpoints, self.coast_stiffness.breakpoints)
        drive_stiffness = self.drive_stiffness.subdivide(breakpoints)
        return drive_stiffness, self.coast_stiffness.subdivide(breakpoints)


def pair_equation(pair, stiffness, nonlinear_damping=0.0, **other_terms) -> Equation:
    """Create the dimensionless `Equation` of motion of a gear pair with a mesh stiffness.

    `pair` is a `GearPair`, and `stiffness` is a `PiecewiseStiffness` divided by its mean.
    `nonlinear_damping` is 0 or an array of shape (3, 3): the rows are coast side, free flight and
    drive side, and the columns are 0, quadratic damping d2 and cubic damping d3. `other_terms` are
    further fields of `Equation`, such as the force.
    """
    damping = np.zeros((3, 3)) + nonlinear_damping
    damping[:, 0] += 2.0 * np.array(
        [pair.damping_ratio, pair.backlash_damping_ratio, pair.damping_ratio]
    )
    upper, lower = 0.0, -pair.backlash_ratio  # displacements at which contact begins
    return Equation(upper, lower, stiffness, stiffness, damping, **other_terms)


@declared()
class OneDegreePair(WithPair):
    """A gear pair with nonlinear damping, other stiffness profiles and external excitation.

    Only `pair` is required; with the default values the model equals the pair. A softening
    stiffness is not possible, because the flanks could pass through each other.
    """

    # The call of `field` prevents the attribute `pair` of the base class from becoming the default.
    pair: Annotated[GearPair, described("Stiffness, mass, load, backlash, linear damping")] = (
        field()
    )
    quadratic_damping: Annotated[_Quadratic, described("Quadratic damping D2 in contact")] = 0.0
    cubic_damping: Annotated[_Cubic, described("Cubic damping D3 in contact")] = 0.0
    backlash_quadratic_damping: Annotated[
        _Quadratic, described("Quadratic damping D2m of the oil")
    ] = 0.0
    backlash_cubic_damping: Annotated[_Cubic, described("Cubic damping D3m of the oil")] = 0.0
    quadratic_stiffness: Annotated[
        float, Ge(0), Unit("1/m"), described("Quadratic stiffness g2; power law in contact, |g| g")
    ] = 0.0
    cubic_stiffness: Annotated[float, Ge(0), Unit("1/m^2"), described("Cubic stiffness g3")] = 0.0
    profile: Annotated[
        Profile,
        described("Mesh stiffness over the phase, scaled to the mean of the pair", "C(tau)"),
    ] = Rectangular()
    excitation: Annotated[Harmonics, described("External force in N, added to the load")] = (
        Harmonics()
    )
    deviation: Annotated[
        Harmonics, described("Deviation f(tau) of the flanks from the involute in m")
    ] = Harmonics()

    has_pair_equation = True
    nonlinear = ("quadratic_damping", "cubic_damping", "quadratic_stiffness", "cubic_stiffness")

    @property
    def force_note(self) -> str:
        """A sentence for results about jumps of the mesh force; "" for a continuous stiffness."""
        if isinstance(self.profile, Rectangular):
            return self.pair.force_note
        return force_note(self.equation.drive_stiffness.min_jump_ratio, is_rectangle=False)

    @property
    def stiffness_model(self) -> str:
        """Description of the mesh stiffness."""
        return self.profile.description or self.pair.stiffness_model

    parameters = property(
        lambda model: units_and_names(type(model)), doc="Continuation parameters of the model."
    )

    @cached_property
    def equation(self) -> Equation:
        """The dimensionless `Equation` of motion.

        The unit of length is the static deflection, and the unit of time is 1 / Omega_s with the
        natural frequency Omega_s at the mean stiffness. The equation of the `GearPair` is extended
        by nonlinear damping and stiffness, the external force and the deviation of the flanks.
        """
        pair = self.pair
        deflection, mass = pair.static_deflection, pair.reduced_mass
        damping_scales = np.array(
            [1.0, deflection / mass, deflection**2 * pair.mean_eigenfrequency / mass]
        )
        # Rows of linear, quadratic and cubic damping; `pair_equation` adds the linear damping.
        contact_damping = 0.0, self.quadratic_damping, self.cubic_damping
        flight_damping = 0.0, self.backlash_quadratic_damping, self.backlash_cubic_damping
        nonlinear_damping = np.array([contact_damping, flight_damping, contact_damping])
        powers = np.array([self.quadratic_stiffness, self.cubic_stiffness])
        return pair_equation(
            pair,
            self.profile.piecewise_stiffness(pair),
            nonlinear_damping * damping_scales,
            stiffness_powers=powers * [deflection, deflection**2],
            force=self.excitation.table(1.0 / pair.load),
            deviation=self.deviation.table(1.0 / deflection),
        )


#: A constant or periodic stiffness.
_Stiffness = NonNegative | Series | Steps


@declared()
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

    upper_edge: Annotated[Finite, described("Upper edge, where the upper contact begins")] = 0.0
    lower_edge: Annotated[
        float,
        Allowed("-inf or a number <= upper_edge"),
        described("Lower edge, where the lower contact begins; -inf: there is none"),
    ] = -math.inf
    upper_stiffness: Annotated[_Stiffness, described("Stiffness of the upper contact", "c_u")]
    lower_stiffness: Annotated[
        _Stiffness | None,
        described("Stiffness of the lower contact; by default upper_stiffness", "c_l"),
    ] = None
    damping: Annotated[NonNegative, described("Damping of the gap", "d")] = 0.0
    upper_damping: Annotated[
        NonNegative | None,
        described("Damping of the upper contact; by default `damping`", "d"),
    ] = None
    lower_damping: Annotated[
        NonNegative | None,
        described("Damping of the lower contact; by default `damping`", "d"),
    ] = None
    ground_stiffness: Annotated[
        NonNegative, described("Stiffness to the ground; a spring to x = 0 that never parts", "e")
    ] = 0.0
    load: Annotated[Finite, described("Load, the mean force", "F")] = 0.0
    forcing: Annotated[
        Harmonics, described("Force; its amplitudes do not depend on the frequency", "a_n, b_n")
    ] = Harmonics()
    deviation: Annotated[
        Harmonics,
        described(
            "Motion of the support; its inertia is a force with amplitudes times (n W)^2", "f"
        ),
    ] = Harmonics()

    # The tuning is the frequency W of the forcing in the model's unit of time, the phase is W t,
    # and velocities in results are dx/dphase = x' / W.
    long_names = {
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
        "fraction_drive": "fraction of time in upper contact",
        "contact_loss_fraction": "fraction of time in the gap",
        "fraction_coast": "fraction of time in lower contact",
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
    title_noun = "a dead-zone oscillator"
    defaults = {
        "lower_stiffness": lambda model: model.upper_stiffness,
        "upper_damping": lambda model: model.damping,
        "lower_damping": lambda model: model.damping,
    }
    references = "Kahraman, Singh: Journal of Sound and Vibration 142 (1990) 49-75"

    def __post_init__(self) -> None:
        """Check the edges and stiffnesses of the contacts, and set default values.

        The lower edge must not lie above the upper edge, and at least one contact must have a
        positive mean stiffness.
        """
        allowed = f"-inf or a number <= upper_edge = {self.upper_edge!r}"
        valid = self.lower_edge <= self.upper_edge
        checks.require(valid, "lower_edge", self.lower_edge, allowed)
        super().__post_init__()
        names = ["upper_stiffness"]
        if math.isfinite(self.lower_edge):
            names.append("lower_stiffness")
        if not any(_mean(getattr(self, name)) for name in names):
            values = " and ".join(f"{name} = {getattr(self, name)!r}" for name in names)
            raise ValueError(f"{values} is not allowed: one contact must have a stiffness > 0")

    @cached_property
    def equation(self) -> Equation:
        """The `Equation` of motion in the units of the parameters.

        The upper contact is treated as the drive side and the lower contact as the coast side.
        """
        upper_stiffness = _to_piecewise(self.upper_stiffness)
        same_stiffness = self.lower_stiffness == self.upper_stiffness or math.isinf(self.lower_edge)
        lower_stiffness = upper_stiffness if same_stiffness else _to_piecewise(self.lower_stiffness)
        max_stiffness = max(_mean(self.upper_stiffness), _mean(self.lower_stiffness))
        damping = np.zeros((3, 3))
        # The rows are lower contact, gap and upper contact; column 0 is linear damping.
        damping[:, 0] = self.lower_damping, self.damping, self.upper_damping
        return Equation(
            upper=self.upper_edge,
            lower=self.lower_edge,
            drive_stiffness=upper_stiffness,
            coast_stiffness=lower_stiffness,
            damping=damping,
            ground_stiffness=self.ground_stiffness,
            load=self.load,
            force=self.forcing.table(),
            deviation=self.deviation.table(),
            natural_frequency=math.sqrt(self.ground_stiffness + max_stiffness),
        )


def _to_piecewise(stiffness: float | Series | Steps) -> PiecewiseStiffness:
    """Convert a constant or periodic stiffness to a `PiecewiseStiffness`."""
    if isinstance(stiffness, float):
        stiffness = Steps((0.0,), (stiffness,))  # a single step that starts at phase 0
    return stiffness.piecewise_stiffness()


def _mean(stiffness: float | Series | Steps) -> float:
    """Return the mean of a constant or periodic stiffness over a period."""
    profile = _to_piecewise(stiffness)
    # All slopes are 0, and harmonics do not change the mean.
    integral = profile.values_and_slopes[:, 0] @ np.diff(profile.breakpoints)
    return float(integral) / (2.0 * math.pi)
