"""Compare linear, quadratic and cubic damping forces with equal dissipation.

In a harmonic motion of amplitude A and frequency w the damping force D |v|^(n-1) v dissipates

    W_n = D (A w)^(n+1) / w I_n,   I_n = int_0^2pi |cos|^(n+1) = 2 sqrt(pi) G(n/2+1) / G((n+3)/2)

per period: pi D w A^2 for n = 1, 8/3 D w^2 A^3 for n = 2, 3 pi/4 D w^3 A^4 for n = 3. Coefficients
are equivalent at an amplitude if they dissipate the same work W. Higher powers dissipate less at
smaller amplitudes and more at larger amplitudes.
"""

import math
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
import xarray as xr

from gearlib.data.motions import true_intervals
from gearlib.data.result import evaluate_on_grid
from gearlib.data.variables import add_metadata
from gearlib.models.one_degree_pair import OneDegreePair
from gearlib.models.pair import GearPair
from gearlib.runs.simulation import simulate
from gearlib.runs.sweeping import DIRECTIONS, sweep
from gearlib.studies import jump

#: Where damping acts -> names of the linear, quadratic and cubic coefficients.
PLACES = {
    "material": ("material_damping", "quadratic_damping", "cubic_damping"),
    "oil": ("backlash_damping", "backlash_quadratic_damping", "backlash_cubic_damping"),
}
#: Name of the power of the velocity -> unit of the damping coefficient.
POWERS = {"linear": "N s m-1", "quadratic": "N s2 m-2", "cubic": "N s3 m-3"}
#: Interval width in tuning at which the bisection of jumps stops.
_JUMP_RESOLUTION = 1e-6
#: Negative displacements up to this size, in static deflections, may be rounding errors.
_DISPLACEMENT_TOLERANCE = 1e-9


def dissipated_work(coefficient: float, power: int, amplitude: float, frequency: float) -> float:
    """Return the work per period (N m) of the damping force D |v|^(n-1) v in harmonic motion.

    v is the velocity, `coefficient` is D in N s^n/m^n, and `power` is n >= 1. The motion has the
    `amplitude` in m and the angular `frequency` in rad/s.
    """
    # The integral of |cos|^(n+1) over a period of 2 pi.
    integral = 2.0 * math.sqrt(math.pi) * math.gamma(power / 2.0 + 1.0)
    integral /= math.gamma((power + 3.0) / 2.0)
    return coefficient * (amplitude * frequency) ** (power + 1) / frequency * integral


def equivalent_coefficient(
    linear_coefficient: float, exponent: int, amplitude: float, frequency: float
) -> float:
    """Return the coefficient D of the force D |v|^(n-1) v that is equivalent to linear damping.

    Both forces dissipate the same work in a harmonic motion with `amplitude` (m) and angular
    `frequency` (rad/s). `linear_coefficient` is in N s/m, `exponent` is n >= 1, and D is in
    N s^n/m^n.
    """
    linear_work = dissipated_work(linear_coefficient, 1, amplitude, frequency)
    return linear_work / dissipated_work(1.0, exponent, amplitude, frequency)


def build_damped_model(pair: GearPair, place: str, power: str, settings: dict) -> tuple[Any, float]:
    """Return a model with linear, quadratic or cubic damping, and its damping coefficient.

    `pair` is undamped. `place` states where damping acts: "material" (in contact) or "oil" (in free
    flight). `power` is the power of the velocity in the damping force: "linear", "quadratic" or
    "cubic". All damping forces dissipate the same work in a harmonic motion, whose amplitude
    (static deflections) and tuning (mesh frequency over natural frequency) are keys of `settings`.
    The key damping is the linear coefficient (N s/m).
    """
    exponent = [*POWERS].index(power) + 1
    amplitude = settings["amplitude"] * pair.static_deflection
    frequency = pair.mesh_frequency(settings["tuning"])
    coefficient = equivalent_coefficient(settings["damping"], exponent, amplitude, frequency)
    damping = {PLACES[place][exponent - 1]: coefficient}
    if exponent == 1:
        return pair.replace(**damping), coefficient
    return OneDegreePair(pair=pair, **damping), coefficient


def compute_damping_study(
    pair: GearPair,
    place: str,
    power: str,
    tunings,
    settings: dict,
    run: dict,
    samples_per_period: int,
) -> xr.Dataset:
    """Compute sweeps in all directions with one damping force, their jumps, and phase portraits.

    `pair`, `place` ("material" or "oil"), `power` ("linear", "quadratic" or "cubic") and `settings`
    are arguments of `build_damped_model`. `settings` also has the key shown, the tunings of the
    phase portraits, which have `samples_per_period`. `tunings` are mesh frequencies over the
    natural frequency, and `run` has arguments of `gearlib.sweep`. Variables of jumps and contact
    loss are NaN if there is none.
    """
    damped, coefficient = build_damped_model(pair, place, power, settings)
    curves = {name: sweep(damped, tunings, direction=name, **run) for name in DIRECTIONS}

    def sweep_variables(direction: str) -> dict:
        """Return extrema and period of the sweep in a direction, and its jump, peak etc."""
        names = ("displacement_max", "displacement_min", "period")
        values = {name: curves[direction][name].values for name in names}
        return values | _find_curve_features(damped, curves[direction], direction, run)

    def phase_portrait(tuning: float) -> dict:
        """Return displacement, velocity and mesh phase of the motion at a tuning."""
        motion = simulate(damped, tuning, samples_per_period=samples_per_period, **run)
        return {name: motion[name].values for name in ("displacement", "velocity", "phase")}

    directions, shown = {"direction": list(DIRECTIONS)}, {"shown": list(settings["shown"])}
    data = evaluate_on_grid(directions, sweep_variables, "tuning") | evaluate_on_grid(
        shown, phase_portrait, "phase"
    )
    # All portraits have the same phases.
    _, phases = data.pop("phase")
    phase = phases[0]
    curve = curves[DIRECTIONS[0]]
    attrs = {"units": POWERS[power], "long_name": "damping coefficient"}
    data |= {
        "speed": ("tuning", curve.speed.values),
        "coefficient": ((), coefficient, attrs),
        "backlash_ratio": damped.backlash_ratio,
    }
    coords = {"tuning": np.asarray(tunings, float), "phase": phase - phase[0]}
    coords |= {**directions, **shown, "place": place, "power": power}
    title = "Nonlinear damping of a gear mesh"
    return add_metadata(xr.Dataset(data, coords, curve.attrs | {"title": title}))


def _find_curve_features(
    damped: Any, curve: xr.Dataset, direction: str, run: dict
) -> dict[str, float]:
    """Find jump, peak and widest range of contact loss of a sweep; return variable -> value.

    `curve` is the sweep of the model `damped` over tuning (mesh frequency over natural frequency)
    in the given direction, computed with the arguments `run`. The range of contact loss extends
    from lost_from to lost_to; both are NaN if contact is never lost.
    """
    tuning = curve.tuning.values
    largest_jump = jump.find_jump(damped, tuning, _JUMP_RESOLUTION, direction, **run)
    heights = curve.displacement_max.fillna(-np.inf)
    losses = true_intervals(curve.displacement_min.values < -_DISPLACEMENT_TOLERANCE)
    widest_loss = max(losses, key=lambda ends: ends[1] - ends[0], default=None)
    lost_from = lost_to = np.nan
    if widest_loss is not None:
        lost_from, lost_to = tuning[list(widest_loss)]
    return {
        "jump": largest_jump.tuning,
        "jump_interval": largest_jump.interval,
        "jump_size": largest_jump.above - largest_jump.below,
        "peak": float(curve.displacement_max.max()),
        "peak_tuning": float(heights.idxmax()),
        "lost_from": lost_from,
        "lost_to": lost_to,
    }


def table_rows(studies: Sequence[xr.Dataset]) -> Iterator[list]:
    """Yield the rows of the table of damping forces, beginning with the column names.

    `studies` are datasets from `compute_damping_study`; each direction of their sweeps has a row.
    The column place states where damping acts ("material" or "oil"), power is the power of the
    velocity, jump_interval the width of the tuning interval that contains the jump, and jump_size
    the change of the orbit height.
    """
    features = ("jump", "jump_interval", "jump_size", "peak", "peak_tuning", "lost_from", "lost_to")
    yield ["place", "power", "coefficient", "unit", "direction", *features]
    for study in studies:
        coefficient = f"{float(study.coefficient):.6g}", study.coefficient.attrs["units"]
        for direction in study.direction.values:
            numbers = [f"{float(study[name].sel(direction=direction)):.6g}" for name in features]
            yield [study.place.item(), study.power.item(), *coefficient, direction, *numbers]
