"""Linear, quadratic and cubic damping side by side: what the title of the paper announces.

In a harmonic motion of amplitude A and frequency w the damping force D |v|^(n-1) v dissipates

    W_n = D (A w)^(n+1) / w I_n,   I_n = int_0^2pi |cos|^(n+1) = 2 sqrt(pi) G(n/2+1) / G((n+3)/2)

per period: pi D w A^2 for n = 1, 8/3 D w^2 A^3 for n = 2, 3 pi/4 D w^3 A^4 for n = 3. Coefficients
with the same W at one amplitude are equivalent there; below it the higher powers damp less, above
it more.
"""

import math

import numpy as np
import xarray as xr

from gearlib.data.motions import true_intervals
from gearlib.data.result import stacked
from gearlib.data.variables import describe
from gearlib.models.one_degree import OneDegreePair
from gearlib.models.pair import GearPair
from gearlib.runs.simulation import simulate
from gearlib.runs.sweeping import DIRECTIONS, sweep
from gearlib.studies import jump

#: Where damping acts -> (linear, quadratic, cubic coefficient); the other phases are undamped.
PLACES = {
    "material": ("material_damping", "quadratic_damping", "cubic_damping"),
    "oil": ("backlash_damping", "backlash_quadratic_damping", "backlash_cubic_damping"),
}
#: Power of the velocity -> unit of its coefficient.
POWERS = {"linear": "N s m-1", "quadratic": "N s2 m-2", "cubic": "N s3 m-3"}
#: Width of the tuning interval to which jumps are bisected.
_RESOLUTION = 1e-6
#: Penetration of the flank line, static deflections, that is rounding.
_ROUNDING = 1e-9


def dissipation(coefficient, power, amplitude, frequency):
    """Return the work per period (N m) of D |v|^(n-1) v in a harmonic motion.

    coefficient D in N s^n/m^n, power n >= 1, amplitude in m, frequency in rad/s.
    """
    integral = 2.0 * math.sqrt(math.pi) * math.gamma(power / 2.0 + 1.0)
    integral /= math.gamma((power + 3.0) / 2.0)
    return coefficient * (amplitude * frequency) ** (power + 1) / frequency * integral


def equivalent(coefficient, power, amplitude, frequency):
    """Return the coefficient of a power that dissipates as much as a linear one."""
    linear = dissipation(coefficient, 1, amplitude, frequency)
    return linear / dissipation(1.0, power, amplitude, frequency)


def model(pair, place, power, settings):
    """Return a model with damping at one of `PLACES` by one of `POWERS`, and its coefficient.

    `pair` are arguments of `GearPair` without damping; `settings` hold the linear damping (N s/m),
    the amplitude (static deflections) and tuning of the motion in which it does the same work.
    """
    undamped, n = GearPair(**pair), [*POWERS].index(power) + 1
    amplitude = settings["amplitude"] * undamped.static_deflection
    frequency = undamped.mesh_frequency(settings["tuning"])
    coefficient = equivalent(settings["damping"], n, amplitude, frequency)
    damping = {PLACES[place][n - 1]: coefficient}
    if n == 1:
        return undamped.replace(**damping), coefficient
    return OneDegreePair(pair=undamped, **damping), coefficient


def compute(pair, place, power, tunings, settings, run, samples_per_period):
    """Return characteristics over tuning and direction, and phase planes, of one model.

    pair, place, power and settings as in `model`; settings also hold shown, the tunings of the
    phase planes. NaN: there is no jump, no loss of contact.
    """
    damped, coefficient = model(pair, place, power, settings)
    curves = {name: sweep(damped, tunings, direction=name, **run) for name in DIRECTIONS}

    def characteristic(direction):
        names = ("displacement_max", "displacement_min", "period")
        values = {name: curves[direction][name].values for name in names}
        return values | _facts(damped, curves[direction], direction, run)

    def plane(tuning):
        course = simulate(damped, tuning, samples_per_period=samples_per_period, **run)
        return {name: course[name].values for name in ("displacement", "velocity", "phase")}

    directions, shown = {"direction": list(DIRECTIONS)}, {"shown": list(settings["shown"])}
    data = stacked(directions, characteristic, "tuning") | stacked(shown, plane, "phase")
    phase = data.pop("phase")[1][0]
    curve = curves[DIRECTIONS[0]]
    data |= {
        "speed": ("tuning", curve.speed.values),
        "coefficient": (
            (),
            coefficient,
            {"units": POWERS[power], "long_name": "damping coefficient"},
        ),
        "backlash_ratio": damped.backlash_ratio,
    }
    coords = {"tuning": np.asarray(tunings, float), "phase": phase - phase[0]}
    coords |= {**directions, **shown, "place": place, "power": power}
    attrs = curve.attrs | {"title": "Nonlinear damping of a gear mesh"}
    return describe(xr.Dataset(data, coords, attrs))


def _facts(damped, curve, direction, run):
    """Return where a characteristic jumps, peaks and loses contact, as name -> number."""
    tuning = curve.tuning.values
    located = jump.find(damped, tuning, _RESOLUTION, direction, **run)
    highest = curve.displacement_max.fillna(-np.inf)
    lost = true_intervals(curve.displacement_min.values < -_ROUNDING)
    widest = max(lost, key=lambda ends: ends[1] - ends[0], default=None)
    lost_from, lost_to = (np.nan, np.nan) if widest is None else tuning[list(widest)]
    return {
        "jump": located.tuning,
        "jump_interval": located.interval,
        "jump_size": located.above - located.below,
        "peak": float(curve.displacement_max.max()),
        "peak_tuning": float(highest.idxmax()),
        "lost_from": lost_from,
        "lost_to": lost_to,
    }


def rows(studies):
    """Yield the table of all models: a head and a row for each of their characteristics."""
    facts = ("jump", "jump_interval", "jump_size", "peak", "peak_tuning", "lost_from", "lost_to")
    yield ["place", "power", "coefficient", "unit", "direction", *facts]
    for study in studies:
        coefficient = f"{float(study.coefficient):.6g}", study.coefficient.attrs["units"]
        for direction in study.direction.values:
            numbers = [f"{float(study[name].sel(direction=direction)):.6g}" for name in facts]
            yield [study.place.item(), study.power.item(), *coefficient, direction, *numbers]
