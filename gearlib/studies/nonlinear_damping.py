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

from gearlib.data.motions import stretches
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
POWERS = ("linear", "quadratic", "cubic")

#: Contact counts as lost beyond this, in static deflections.
_TOUCH = 1e-9
#: Width of the tuning interval to which jumps are bisected.
_RESOLUTION = 1e-6


def dissipation(coefficient, power, amplitude, frequency):
    """Return the work per period of D |v|^(n-1) v in a harmonic motion.

    coefficient: D, N s^n/m^n; power: n >= 1; amplitude: A, m; frequency: w, rad/s; the work in N m.
    """
    integral = 2.0 * math.sqrt(math.pi) * math.gamma(power / 2.0 + 1.0)
    integral /= math.gamma((power + 3.0) / 2.0)
    return coefficient * (amplitude * frequency) ** (power + 1) / frequency * integral


def equivalent(coefficient, power, amplitude, frequency):
    """Return the coefficient of a power that dissipates what a linear one does; see `dissipation`.

    In N s^n/m^n.
    """
    linear = dissipation(coefficient, 1, amplitude, frequency)
    return linear / dissipation(1.0, power, amplitude, frequency)


def model(pair, place, power, settings):
    """Return one model of the study.

    pair: keyword arguments of `GearPair`, without damping; place: {"material", "oil"}; power:
    {"linear", "quadratic", "cubic"}; settings: damping (N s/m), amplitude (static deflections),
    tuning.

    Pair and coefficient, N s^n/m^n.
    """
    undamped = GearPair(**pair)
    n = POWERS.index(power) + 1
    coefficient = equivalent(
        settings["damping"],
        n,
        settings["amplitude"] * undamped.static_deflection,
        undamped.mesh_frequency(settings["tuning"]),
    )
    name = PLACES[place][n - 1]
    if n == 1:
        return undamped.replace(**{name: coefficient}), coefficient
    return OneDegreePair(pair=undamped, **{name: coefficient}), coefficient


def compute(pair, place, power, tunings, settings, run, samples_per_period):
    """Return characteristics and phase planes of one model of the study.

    pair, place, power: as in `model`; tunings: shape (n,); settings (damping, amplitude, tuning
    (see `model`), shown: tunings of the phase planes); run: periods, record_periods, initial_state.

    NaN: there is no jump, no loss of contact.
    """
    damped, coefficient = model(pair, place, power, settings)
    curves = {name: sweep(damped, tunings, direction=name, **run) for name in DIRECTIONS}

    def swept(direction):
        curve, kept = curves[direction], ("displacement_max", "displacement_min", "period")
        facts = _facts(damped, curve, direction, run)
        return {name: curve[name].values for name in kept} | facts

    def plane(nu):
        found = simulate(damped, nu, samples_per_period=samples_per_period, **run)
        return {name: found[name].values for name in ("displacement", "velocity", "phase")}

    directions, shown = {"direction": list(DIRECTIONS)}, {"shown": list(settings["shown"])}
    data = stacked(directions, swept, "tuning") | stacked(shown, plane, "phase")
    some = curves[DIRECTIONS[0]]
    data |= {
        "speed": ("tuning", some.speed.values),
        "coefficient": coefficient,
        "backlash_ratio": damped.backlash_ratio,
    }
    phase = data.pop("phase")[1][0]
    coords = {
        **directions,
        **shown,
        "tuning": np.asarray(tunings, float),
        "phase": phase - phase[0],
        "place": place,
        "power": power,
    }
    dataset = describe(xr.Dataset(data, coords))
    unit = {"linear": "N s m-1", "quadratic": "N s2 m-2", "cubic": "N s3 m-3"}[power]
    dataset["coefficient"].attrs["units"] = unit
    return dataset.assign_attrs(some.attrs | {"title": "Nonlinear damping of a gear mesh"})


def _facts(damped, curve, direction, run):
    """Return where a characteristic jumps, peaks and loses contact, as name -> number."""
    tuning = curve.tuning.values
    found = jump.find(damped, tuning, _RESOLUTION, direction, **run)
    highest = np.nan_to_num(curve.displacement_max.values, nan=-np.inf)
    top = int(np.argmax(highest))
    lost = stretches(curve.displacement_min.values < -_TOUCH)
    first, last = max(lost, key=lambda ends: ends[1] - ends[0], default=(None, None))
    return {
        "jump": found.tuning,
        "jump_interval": found.interval,
        "jump_size": found.above - found.below,
        "peak": highest[top] if np.isfinite(highest[top]) else np.nan,
        "peak_tuning": tuning[top],
        "lost_from": np.nan if first is None else tuning[first],
        "lost_to": np.nan if first is None else tuning[last],
    }


def rows(studies):
    """Yield coefficients, jumps, peaks and bounce windows of all models as one table."""
    facts = ("jump", "jump_interval", "jump_size", "peak", "peak_tuning", "lost_from", "lost_to")
    yield ["place", "power", "coefficient", "unit", "direction", *facts]
    for study in studies:
        coefficient = f"{float(study.coefficient):.6g}", study.coefficient.attrs["units"]
        for direction in study.direction.values:
            one = study.sel(direction=direction)
            numbers = [f"{float(one[name]):.6g}" for name in facts]
            yield [study.place.item(), study.power.item(), *coefficient, direction, *numbers]
