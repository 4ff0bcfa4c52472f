"""Quantities of many designs: jumps, onset, peak, duty point; each design is one search."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from gearlib import checks
from gearlib.analysis.orbits.jumps import main_resonance
from gearlib.analysis.orbits.shooting import NoOrbit, periodic_orbit
from gearlib.data.variables import QUANTITIES
from gearlib.engines import orbit as columns
from gearlib.runs.run_arguments import MAX_EVENTS, check_speed

#: Meanings of the codes, 0 first, and the code of a design that does not exist.
CODES = ("found", "there_is_none", "not_followed")
FOUND, NONE, LOST = range(len(CODES))
NO_DESIGN = -1
#: Names of speeds of the main resonance in `MainResonance`.
RESONANCE_NAMES = {"jump_up": "jump_up", "jump_down": "jump_down", "onset_of_contact_loss": "onset"}
_PEAKS = {"peak", "peak_dynamic_factor"}
#: Quantities of the duty point that are shares of the load, and those whose least value counts.
_SHARES = {"load_sharing", "least_load_sharing"}
_LEAST = {"contact_margin", "least_load_sharing"}
_DUTY = {"dynamic_factor", "force", "transmission_error", "contact_margin", *_SHARES}


class DesignQuantities:
    """Search for quantities of designs near a nominal one, whose values are `nominal`, (q,).

    Of a train quantities of the duty point are those of the worst mesh, the transmission error is
    that of the reference mesh. `speed` is that of the duty point, rpm; `at_duty` returns the
    nominal design for it, where that is another model. Quantities without a value are NaN.
    """

    def __init__(
        self,
        model: Any,
        quantities: Any,
        *,
        speed: float | None = None,
        at_duty: Callable | None = None,
    ):
        self.quantities = names_of("quantities", quantities, tuple(QUANTITIES))
        duty = _DUTY & set(self.quantities)
        _check_model(model, set(self.quantities) - duty)
        self.speed = speed
        self._orbit: Any = None
        if duty:
            duty_model = at_duty() if at_duty else model
            _check_duty(duty_model, duty, speed)
            tuning = check_speed(duty_model, "speed", speed)
            self._orbit = periodic_orbit(duty_model, tuning, period=duty_model.repeats)
        self._resonant = [
            RESONANCE_NAMES.get(name, name) for name in self.quantities if name not in duty
        ]
        self.nominal = self(model, at_duty)[0]

    def __call__(self, model: Any, at_duty: Callable | None = None) -> tuple:
        """Return the values of a design, (q,), NaN if not found, and their codes, (q,) int8."""
        values = np.full(len(self.quantities), np.nan)
        codes = np.full(len(self.quantities), NONE, np.int8)
        resonance: Any = main_resonance(model, self._resonant) if self._resonant else None
        duty = at_duty() if at_duty and self._orbit else model
        summary = self._duty_summary(duty) if self._orbit else None
        for i, name in enumerate(self.quantities):
            if name in _DUTY:
                values[i] = _of_summary(name, duty, summary, self._orbit.period)
            else:
                values[i] = _of_resonance(name, model, resonance)
            if np.isfinite(values[i]):
                codes[i] = FOUND
            elif name in _DUTY or RESONANCE_NAMES.get(name, name) in resonance.lost:
                codes[i] = LOST
        return values, codes

    def _duty_summary(self, model: Any) -> np.ndarray | None:
        """Return the summary of the orbit at the duty point next to the nominal one, or None."""
        tuning, nominal = float(model.tuning_at(self.speed)), self._orbit
        for guess in (nominal.state, None):
            try:
                orbit = periodic_orbit(model, tuning, guess=guess, period=nominal.period)
            except (NoOrbit, ValueError):
                continue
            if orbit.stable or not nominal.stable:
                propagator = model.propagator(tuning)
                return propagator.record(orbit.state, nominal.period, MAX_EVENTS).summary
        return None


def _check_duty(model: Any, duty: set, speed: float | None) -> None:
    """Refuse quantities of the duty point that a model does not have."""
    if speed is None:
        raise ValueError(f"speed = None is not allowed: {min(duty)} is one of the duty point")
    if duty & _SHARES and not model.mesh_names:
        name = min(duty & _SHARES)
        raise ValueError(f"quantities = {name!r} is not allowed: it is one of trains")
    if "transmission_error" in duty and model.equation and len(model.equation.deviation):
        raise ValueError(
            "quantities = 'transmission_error' is not allowed for a model with deviations of "
            "the flanks: its displacement is that of the flanks"
        )


def _check_model(model: Any, resonant: set) -> None:
    """Refuse quantities of the resonance that a model does not have."""
    kind = type(model).__name__
    if model.speed is None:
        raise ValueError(f"model = {kind} is not allowed: nothing turns in this model")
    one_degree = model.size == 2 and model.repeats == 1 and model.equation is not None
    if resonant and not one_degree and model.equation is not None:
        raise ValueError(
            f"quantities = {min(resonant)!r} is not allowed for this {kind}: "
            "the main resonance is searched of models whose excitation repeats every mesh period"
        )
    if _PEAKS & resonant and not one_degree:
        raise ValueError(
            f"quantities = {min(_PEAKS & resonant)!r} is not allowed for this {kind}: "
            "peaks are searched of models with one degree of freedom"
        )


def _of_resonance(name: str, model: Any, resonance: Any) -> float:
    """Return a quantity of a `MainResonance` in SI units, NaN where there is none."""
    if name == "peak":
        return resonance.peak_displacement * model.static_deflection
    if name == "peak_dynamic_factor":
        return resonance.peak_force
    return float(model.speed(1.0)) * getattr(resonance, RESONANCE_NAMES[name])


def _of_summary(name: str, model: Any, summary: Any, period: int) -> float:
    """Return a quantity of the duty point, of the mesh where it is worst; NaN without an orbit."""
    if summary is None:
        return math.nan
    table = np.atleast_2d(summary)
    if name in _SHARES:
        values = model.extra_summary_variables((), summary, 2.0 * math.pi * period)["load_sharing"][
            1
        ]
    elif name == "contact_margin":
        values = table[:, columns.X_MIN] * model.static_deflection
    elif name == "transmission_error":
        values = (table[:, columns.X_MAX] - table[:, columns.X_MIN]) * model.static_deflection
        if model.mesh_names:
            return float(values[model.mesh_names.index(model.reference)])
    elif name == "force":
        values = table[:, columns.FORCE_MAX] * model.load
    else:
        values = table[:, columns.FORCE_MAX] / np.asarray(
            model.mean_forces if model.mesh_names else 1.0
        )
    # There are no dynamic factors without load.
    return float((np.fmin if name in _LEAST else np.fmax).reduce(values))


def search_of(designs: Any, quantities: Any, speed: float | None) -> DesignQuantities:
    """Return the `DesignQuantities` near the nominal one of `Designs`."""
    duty = designs.at_duty(designs.tolerances.centres)
    return DesignQuantities(designs.nominal, quantities, speed=speed, at_duty=duty)


def names_of(key: str, given: Any, allowed: tuple) -> tuple:
    """Return names as a tuple, each once."""
    if isinstance(given, str) or not hasattr(given, "__iter__"):
        raise checks.refusal(key, given, f"a sequence of {', '.join(map(repr, allowed))}")
    names = tuple(given)
    for name in names:
        checks.one_of(key, name, allowed)
    checks.require(len(set(names)) == len(names), key, given, "names, each once")
    return names
