"""Quantities of designs: speeds of jumps and onset of contact loss, peaks, and the duty point."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from gearlib import checks
from gearlib.analysis.orbits.jumps import main_resonance
from gearlib.analysis.orbits.shooting import NoOrbit, periodic_orbit
from gearlib.data.summary import largest_force
from gearlib.data.variables import QUANTITIES
from gearlib.engines import orbit as columns
from gearlib.runs.run_arguments import MAX_EVENTS, tuning_at_speed

#: Meanings of the status codes of a quantity: 0 FOUND, 1 ABSENT (the design does not have it),
#: 2 LOST (its search failed). The code -1, NO_DESIGN, is that of a design that cannot be built.
STATUS_MEANINGS = ("found", "there_is_none", "not_followed")
FOUND, ABSENT, LOST = range(len(STATUS_MEANINGS))
NO_DESIGN = -1
#: Speed of the main resonance -> its attribute of `MainResonance`.
RESONANCE_NAMES = {"jump_up": "jump_up", "jump_down": "jump_down", "onset_of_contact_loss": "onset"}
_PEAK_QUANTITIES = {"peak", "resonance_force_ratio"}
_SHARING_QUANTITIES = {"load_sharing", "least_load_sharing"}
#: Quantities whose worst value is the least one.
_MINIMISED_QUANTITIES = {"contact_margin", "least_load_sharing"}
_FORCE_RATIOS = {"dynamic_factor", "peak_force_ratio"}
_DUTY_QUANTITIES = {"force", "transmission_error", "contact_margin"}
_DUTY_QUANTITIES |= _SHARING_QUANTITIES | _FORCE_RATIOS


class DesignQuantities:
    """Compute quantities of designs that differ little from a nominal design.

    `nominal` holds the values of the nominal design, (q,), NaN if they do not exist.
    """

    def __init__(self, model, quantities, *, speed: float | None = None, build_duty_model=None):
        """Check the quantities, different names of `QUANTITIES`, and compute the nominal ones.

        `speed` is that of the duty point, rpm; `build_duty_model` returns the nominal model there.
        """
        self.quantities = checked_names("quantities", quantities, tuple(QUANTITIES))
        duty_quantities = _DUTY_QUANTITIES & set(self.quantities)
        _check_resonance_quantities(model, set(self.quantities) - duty_quantities)
        self.speed = speed
        self._nominal_orbit: Any = None
        if duty_quantities:
            duty_model = build_duty_model() if build_duty_model else model
            if speed is None:
                raise ValueError(
                    f"speed = None is not allowed: {min(duty_quantities)} is a quantity of the "
                    "duty point"
                )
            sharing_quantities = duty_quantities & _SHARING_QUANTITIES
            if sharing_quantities and not duty_model.mesh_names:
                name = min(sharing_quantities)
                raise ValueError(f"quantities = {name!r} is not allowed: only trains have it")
            for name in duty_quantities & _FORCE_RATIOS:
                allowed = f"{duty_model.force_ratio_name!r}, which this model has"
                checks.require(name == duty_model.force_ratio_name, "quantities", name, allowed)
            equation = duty_model.equation
            if "transmission_error" in duty_quantities and equation and len(equation.deviation):
                raise ValueError(
                    "quantities = 'transmission_error' is not allowed for a model with flank "
                    "deviations: its displacement does not include them"
                )
            tuning = tuning_at_speed(duty_model, "speed", speed)
            # The orbit has the period of the excitation, in mesh periods.
            self._nominal_orbit = periodic_orbit(duty_model, tuning, period=duty_model.repeats)
        resonance_quantities = (name for name in self.quantities if name not in duty_quantities)
        self._resonance_names = [RESONANCE_NAMES.get(name, name) for name in resonance_quantities]
        self.nominal, _ = self.evaluate(model, build_duty_model)

    def evaluate(self, model: Any, build_duty_model: Callable | None = None) -> tuple:
        """Return the quantities of a design, (q,), NaN if not found, and their status codes, (q,).

        `build_duty_model` returns its model at the duty point, None if it is `model`.
        """
        values = np.full(len(self.quantities), np.nan)
        codes = np.full(len(self.quantities), ABSENT, np.int8)
        resonance: Any = None
        if self._resonance_names:
            resonance = main_resonance(model, self._resonance_names)
        duty_model = build_duty_model() if build_duty_model and self._nominal_orbit else model
        summary = self._duty_summary(duty_model) if self._nominal_orbit else None
        for i, name in enumerate(self.quantities):
            if name in _DUTY_QUANTITIES:
                values[i] = _duty_value(name, duty_model, summary, self._nominal_orbit.period)
            elif name == "peak":
                values[i] = resonance.peak_displacement * model.static_deflection
            elif name == "resonance_force_ratio":
                values[i] = resonance.peak_force
            else:  # the resonance has tunings
                values[i] = float(model.speed(1.0)) * getattr(resonance, RESONANCE_NAMES[name])
            if np.isfinite(values[i]):
                codes[i] = FOUND
            elif name in _DUTY_QUANTITIES or RESONANCE_NAMES.get(name, name) in resonance.failed:
                codes[i] = LOST
        return values, codes

    def _duty_summary(self, model: Any) -> np.ndarray | None:
        """Return the extrema over the orbit at the duty point, None if no orbit is found."""
        tuning, nominal_orbit = float(model.tuning_at(self.speed)), self._nominal_orbit
        for guess in (nominal_orbit.state, None):  # None: the default state
            try:
                orbit = periodic_orbit(model, tuning, guess=guess, period=nominal_orbit.period)
            except (NoOrbit, ValueError):
                continue
            # An unstable orbit counts only if that of the nominal design is unstable, too.
            if orbit.stable or not nominal_orbit.stable:
                propagator = model.propagator(tuning)
                return propagator.record(orbit.state, nominal_orbit.period, MAX_EVENTS).summary
        return None


def _check_resonance_quantities(model: Any, quantities: set) -> None:
    """Raise ValueError if a model does not have these quantities of the main resonance."""
    kind = type(model).__name__
    if model.speed is None:
        raise ValueError(f"model = {kind} is not allowed: it has no rotational speed")
    has_one_degree_of_freedom = model.equation is not None
    # Models with several degrees of freedom, without `equation`, have jumps, but no peaks.
    has_main_resonance = has_one_degree_of_freedom and model.size == 2 and model.repeats == 1
    if quantities and has_one_degree_of_freedom and not has_main_resonance:
        raise ValueError(
            f"quantities = {min(quantities)!r} is not allowed for this {kind}: "
            "the main resonance is searched only if the excitation repeats every mesh period"
        )
    if _PEAK_QUANTITIES & quantities and not has_main_resonance:
        raise ValueError(
            f"quantities = {min(_PEAK_QUANTITIES & quantities)!r} is not allowed for this {kind}: "
            "peaks are searched only for models with one degree of freedom"
        )


def _duty_value(name: str, model: Any, summary: Any, period: int) -> float:
    """Return the quantity `name` of the duty point for the worst mesh in SI units, or NaN."""
    if summary is None:
        return math.nan
    table = np.atleast_2d(summary)
    if name in _SHARING_QUANTITIES:
        phase_span = 2.0 * math.pi * period
        variables = model.extra_summary_variables(dims=(), summaries=summary, span=phase_span)
        _, values = variables["load_sharing"]
    elif name == "contact_margin":
        clearances = model.clearances(table[:, columns.X_MIN], table[:, columns.X_MAX])
        values = clearances * model.static_deflection
    elif name == "transmission_error":
        values = (table[:, columns.X_MAX] - table[:, columns.X_MIN]) * model.static_deflection
        if model.mesh_names:  # a train
            return float(values[model.mesh_names.index(model.reference)])
    elif name == "force":
        values = largest_force(table) * model.load
    else:
        values = model.force_ratios(largest_force(table))
    # Meshes without load have no force ratio, so NaN is ignored.
    worst = np.fmin if name in _MINIMISED_QUANTITIES else np.fmax
    return float(worst.reduce(values))


def quantity_evaluator(designs: Any, quantities: Any, speed: float | None) -> DesignQuantities:
    """Return a `DesignQuantities` for these `Designs`; `speed` is that of the duty point, rpm."""
    builder = designs.duty_model_builder(designs.tolerances.centres)
    return DesignQuantities(designs.nominal, quantities, speed=speed, build_duty_model=builder)


def checked_names(key: str, names: Any, allowed: tuple) -> tuple:
    """Return names as a tuple; raise ValueError unless they are allowed and all different."""
    names_allowed = f"a sequence of {', '.join(map(repr, allowed))}"
    checks.require(not isinstance(names, str), key, names, names_allowed)
    checked = tuple(checks.sequence(key, names, allowed=names_allowed))
    for name in checked:
        checks.one_of(key, name, allowed)
    checks.require(len(set(checked)) == len(checked), key, names, "without repeated names")
    return checked
