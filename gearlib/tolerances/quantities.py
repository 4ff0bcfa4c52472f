"""Quantities of many designs, each followed from the nominal one: jumps, onset, peak, duty point.

Special points are followed one by one, `gearlib.analysis.orbits.following`, not read off curves.
Where one is lost on the way the main resonance of the design is searched anew.
"""

from typing import NamedTuple

import numpy as np

from gearlib import checks
from gearlib.analysis.orbits import following
from gearlib.analysis.orbits.following import At, Fold, Onset, Start, extrema_slopes
from gearlib.analysis.orbits.main_resonance import Branch, Resonance, Top, top
from gearlib.kernels import orbit as columns
from gearlib.models.derivatives import STEP
from gearlib.runs.run_arguments import MAX_EVENTS, check_speed

#: name -> (CF units, long_name)
QUANTITIES = {
    "jump_up": ("min-1", "speed of the jump of the main resonance, running up"),
    "jump_down": ("min-1", "speed of the jump of the main resonance, running down"),
    "onset_of_contact_loss": ("min-1", "speed at which contact is first lost, running up"),
    "peak": ("m", "largest displacement of the main resonance"),
    "peak_dynamic_factor": ("1", "largest dynamic factor K_v of the main resonance"),
    "dynamic_factor": ("1", "dynamic factor K_v at the duty point"),
    "force": ("N", "largest mesh force at the duty point"),
    "transmission_error": ("m", "transmission error from peak to peak at the duty point"),
    "contact_margin": ("m", "least displacement at the duty point, below 0 contact is lost"),
}
#: What a code says, 0 first.
CODES = ("found", "there_is_none", "not_followed")
FOUND, NONE, LOST = range(len(CODES))

_SPEEDS = {"jump_up": Fold, "jump_down": Fold, "onset_of_contact_loss": Onset}
_NAMES = {"onset_of_contact_loss": "onset"}
_PEAKS = {"peak": columns.X_MAX, "peak_dynamic_factor": columns.FORCE_MAX}
_DUTY = ("dynamic_factor", "force", "transmission_error", "contact_margin")


class _Place(NamedTuple):
    """A point of a branch of one design: its unknowns, which also tell their condition."""

    y: np.ndarray
    kind: str  #: of the `Start` by which it is followed


class Followed:
    """Quantities of designs near a nominal one.

    Parameters
    ----------
    model : Model
        The nominal design, with one degree of freedom.
    names : sequence of str
        Parameters, as of ``model.derivatives``.
    quantities : sequence of str
        Of `QUANTITIES`.
    speed : float, optional
        Of the duty point, rpm.

    Attributes
    ----------
    nominal : ndarray, shape (q,)
        NaN where the nominal design has none.
    gradient : ndarray, shape (q, k)
        Exact derivatives by the parameters, SI.

    Raises
    ------
    ValueError
        Naming the argument, its value and the allowed range.
    """

    def __init__(self, model, names, quantities, *, speed=None):
        self.model, self.names = model, tuple(names)
        self.quantities = tuple(quantities)
        for name in self.quantities:
            checks.one_of("quantities", name, tuple(QUANTITIES))
        if model.size != 2 or model.kind().map_rates is None or model.repeats != 1:
            raise ValueError(
                f"model = {type(model).__name__} is not allowed: special points are followed of "
                "models with one degree of freedom and derivatives"
            )
        duty = set(_DUTY) & set(self.quantities)
        if duty and speed is None:
            raise ValueError(f"speed = None is not allowed: {min(duty)} is one of the duty point")
        self.starts: dict = {}
        if duty:
            tuning = check_speed(model, "speed", speed)
            self.starts["duty"] = _start(At(float(speed)), model, settled(model, tuning))
        if set(self.quantities) - set(_DUTY):
            found = Resonance(model)
            for name, kind in (("onset", Onset), ("jump_up", Fold), ("jump_down", Fold)):
                self.starts[name] = _start(kind(), model, getattr(found, name))
            for name in set(_PEAKS) & set(self.quantities):
                which = _PEAKS[name]
                place = top(model, which, found.start, found.jump_down)
                at_fold = place is found.jump_down is not None
                self.starts[name] = None if at_fold else _start(Top(which), model, place)
        values, _, places = self._of(model)
        self.nominal = values
        self.gradient = np.full((len(values), len(self.names)), np.nan)
        for i, (name, place) in enumerate(zip(self.quantities, places, strict=True)):
            if place is not None:
                self.gradient[i] = self._slopes(name, place)

    def __call__(self, model):
        """Return the values of a design, (q,), and their codes, (q,) int8; NaN if not found."""
        return self._of(model)[:2]

    def _of(self, model):
        known: dict = {}
        values = np.full(len(self.quantities), np.nan)
        codes = np.zeros(len(self.quantities), np.int8)
        places = []
        for i, name in enumerate(self.quantities):
            try:
                place, codes[i] = self._place(name, model, known)
            except (following.Failed, np.linalg.LinAlgError):
                place, codes[i] = None, LOST
            places.append(place)
            if place is not None:
                values[i] = self._value(name, model, place)
        return values, codes, places

    def _place(self, name, model, known):
        """Return (place, code) of a quantity of a design."""
        if name in _DUTY:
            return self._at(model, "duty", known)
        if name in _SPEEDS:
            return self._at(model, _NAMES.get(name, name), known)
        if self.starts[name] is not None:
            place, code = self._at(model, name, known)
            if code == FOUND and _stable(model, place.y):
                return place, code
        fold, _ = self._at(model, "jump_down", known)
        start = None if fold is not None else self._searched(model, known).start
        y = top(model, _PEAKS[name], start, None if fold is None else fold.y)
        if y is None:
            return None, LOST
        return _Place(y, "jump_down" if fold is not None and y is fold.y else name), FOUND

    def _at(self, model, kind, known):
        """Return (place, code) of what is followed; where it is lost, of a search."""
        if kind not in known:
            start = self.starts[kind]
            y, code = (None, None) if start is None else start.at(model)
            if y is not None:
                known[kind] = _Place(y, kind), FOUND
            elif kind in ("onset", "jump_up", "jump_down"):
                y = getattr(self._searched(model, known), kind)
                known[kind] = (None, NONE) if y is None else (_Place(y, kind), FOUND)
            else:
                known[kind] = None, NONE if code == following.VANISHED else LOST
        return known[kind]

    def _searched(self, model, known):
        if "search" not in known:
            known["search"] = Resonance(model)
        return known["search"]

    def _value(self, name, model, place):
        y = place.y
        if name in _SPEEDS:
            return float(model.speed(y[2]))
        propagator = model.propagator(y[2] if name in _PEAKS else self.starts["duty"].condition.tuning(model, y))
        _, summary, _ = propagator.record(y[:2], 1, MAX_EVENTS)
        row, scale = _measure(name, model)
        return float(row @ summary[:4] * scale)

    def _slopes(self, name, place):
        """Return the derivatives of a quantity of the nominal design by its parameters, (k,)."""
        model, names, y = self.model, self.names, place.y
        if name in _PEAKS and place.kind == name:
            # At the top the way along the branch does not count: any will do.
            found = Branch(model).evaluate(y)
            along = found.propagator.directions(model, names)
            _, ahead, _ = found.propagator.map_slopes(y[:2], along, 1, MAX_EVENTS)
            moved = -np.linalg.lstsq(found.jacobian, ahead, rcond=None)[0]
        else:
            moved = self.starts[place.kind].slopes(names)
        twins = [model.complex_step(model.direction(one)) for one in names]
        if name in _SPEEDS:
            rate = float(model.speed(1.0))
            return rate * moved[2] + y[2] * following.speed_slopes(model, names)
        if name in _PEAKS:
            tuning, by_tuning = y[2], moved[2]
        else:
            tuning = self.starts["duty"].condition.tuning(model, y)
            by_tuning = following.tuning_slopes(model, tuning, names)
        propagator = model.propagator(tuning)
        along = _with_tuning(propagator, model, names, by_tuning)
        slopes, _ = extrema_slopes(propagator, y[:2], along, moved[:2])
        row, scale = _measure(name, model)
        grown = np.array([np.imag(_measure(name, twin)[1] + 0j) / STEP for twin in twins])
        _, summary, _ = propagator.record(y[:2], 1, MAX_EVENTS)
        return row @ slopes * scale + row @ summary[:4] * grown


def settled(model, tuning):
    """Return the state of the orbit on which the motion from rest settles."""
    from gearlib.analysis.orbits.shooting import periodic_orbit

    return periodic_orbit(model, tuning).state


def _start(condition, model, guess):
    if guess is None:
        return None
    return Start(condition, model, guess)


def _stable(model, y):
    """Return whether a point of the branch lies before its fold."""
    return Branch(model).evaluate(y).turning > 0.0


def _measure(name, model):
    """Return what a quantity is of the extrema, (4,), and its scale in SI."""
    row = np.zeros(4)
    if name in ("peak", "transmission_error"):
        row[columns.X_MAX] = 1.0
    if name == "transmission_error":
        row[columns.X_MIN] = -1.0
    if name == "contact_margin":
        row[columns.X_MIN] = 1.0
    if not row.any():
        row[columns.FORCE_MAX] = 1.0
        return row, model.load if name == "force" else 1.0
    return row, model.static_deflection


def _with_tuning(propagator, model, names, by_tuning):
    """Return directions of parameters along which the tuning changes too."""
    along = propagator.directions(model, names)
    own = propagator.directions(model, ("tuning",))[0]
    if isinstance(own, dict):
        return [{**one, "tuning": slope} for one, slope in zip(along, by_tuning, strict=True)]
    return along + np.outer(by_tuning, own)
