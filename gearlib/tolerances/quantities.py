"""Quantities of many designs, each followed from the nominal one: jumps, onset, peak, duty point.

Special points are followed one by one, `gearlib.analysis.orbits.following`, not read off curves.
Where one is lost on the way the main resonance of the design is searched anew.
"""

import math
from typing import NamedTuple

import numpy as np

from gearlib import checks
from gearlib.analysis.orbits import following
from gearlib.analysis.orbits.following import At, Fold, Onset, Start, extrema_slopes
from gearlib.analysis.orbits.main_resonance import Branch, Resonance, Top, fall, higher, top
from gearlib.analysis.orbits.shooting import periodic_orbit
from gearlib.data.scatter_variables import QUANTITIES
from gearlib.kernels import orbit as columns
from gearlib.models.derivatives import STEP
from gearlib.runs.run_arguments import MAX_EVENTS, check_speed

#: What a code says, 0 first.
CODES = ("found", "there_is_none", "not_followed")
FOUND, NONE, LOST = range(len(CODES))
#: Code of a design that there is not.
NO_DESIGN = -1
#: Designs that are built at a time.
_SOME = 16

_SPEEDS = {"jump_up": Fold, "jump_down": Fold, "onset_of_contact_loss": Onset}
_NAMES = {"onset_of_contact_loss": "onset"}
#: What is searched of a `Resonance`. A motion that jumps up at its first fold falls at that of a
#: higher branch, ``fall``.
_SEARCHED = {"onset": "onset", "jump_up": "jump_up", "first_fold": "jump_down"}
_PEAKS = {"peak": columns.X_MAX, "peak_dynamic_factor": columns.FORCE_MAX}
_DUTY = ("dynamic_factor", "force", "transmission_error", "contact_margin", "load_sharing")
#: Share of a value over which differences are taken.
_STEP = 1e-5
#: Share of a standard deviation over which differences are taken.
_APART = 1e-3


class _Place(NamedTuple):
    """A point of a branch of one design: its unknowns, which also tell their condition."""

    y: np.ndarray
    kind: str  #: of the `Start` by which it is followed


class Followed:
    """Quantities of designs near a nominal one.

    Parameters
    ----------
    model : Model
        The nominal design; of a train quantities of the duty point, those of the mesh which is
        worst, the transmission error that of the reference mesh.
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
        Derivatives by the parameters, SI: exact, but those of the load sharing and the dynamic
        factors of trains, which are central differences.

    Raises
    ------
    ValueError
        Naming the argument, its value and the allowed range.
    """

    def __init__(self, model, names, quantities, *, speed=None):
        self.model, self.names = model, tuple(names)
        self.quantities = names_of("quantities", quantities, tuple(QUANTITIES))
        if model.speed is None:
            raise ValueError(
                f"model = {type(model).__name__} is not allowed: nothing turns in this model"
            )
        duty = set(_DUTY) & set(self.quantities)
        if duty and speed is None:
            raise ValueError(f"speed = None is not allowed: {min(duty)} is one of the duty point")
        if "load_sharing" in duty and not model.mesh_names:
            raise ValueError("quantities = 'load_sharing' is not allowed: it is one of trains")
        if "transmission_error" in duty and model.equation and len(model.equation.deviation):
            raise ValueError(
                "quantities = 'transmission_error' is not allowed for a model with deviations of "
                "the flanks: its displacement is that of the flanks"
            )
        followed = set(self.quantities) - duty
        special = model.size == 2 and model.repeats == 1 and model.kind().map_rates is not None
        if followed and not special or model.kind().map_slopes is None:
            raise ValueError(
                f"quantities = {min(followed or duty)!r} is not allowed for this "
                f"{type(model).__name__}: special points are followed of models with one degree of "
                "freedom and derivatives, orbits at the duty point of models with derivatives"
            )
        self.starts: dict = {}
        if duty:
            tuning = check_speed(model, "speed", speed)
            orbit = periodic_orbit(model, tuning, period=model.repeats)
            self.starts["duty"] = Start(At(float(speed), orbit.period), model, orbit.state)
        if followed:
            found = Resonance(model)
            for name, field in _SEARCHED.items():
                kind = Onset if name == "onset" else Fold
                self.starts[name] = _start(kind(), model, getattr(found, field))
            down = fall(model, found.jump_down)
            own = None if down is found.jump_down else down
            self.starts["fall"] = _start(Fold(), model, own)
            for name in set(_PEAKS) & followed:
                which = _PEAKS[name]
                place = top(model, which, found.start, found.jump_down)
                at_fold = place is found.jump_down is not None
                self.starts[name] = None if at_fold else _start(Top(which), model, place)
        values, _, places = self._of(model)
        self.nominal = values
        self.gradient = np.full((len(values), len(self.names)), np.nan)
        for i, (name, place) in enumerate(zip(self.quantities, places, strict=True)):
            if place is not None and self.names:
                self.gradient[i] = self._slopes(name, place)

    def __call__(self, model):
        """Return the values of a design, (q,), and their codes, (q,) int8; NaN if not found."""
        return self._of(model)[:2]

    def contacts(self, model):
        """Return how often contact is gained and lost on the orbit of each quantity.

        -1: there is none, or it touches the flank line by its definition.
        """
        found = []
        for name, place in zip(self.quantities, self._of(model)[2], strict=True):
            if place is None or _SPEEDS.get(name) is Onset:
                found.append(-1)
                continue
            if name in _SPEEDS:
                propagator, z, period = model.propagator(place.y[2]), place.y[:2], 1
            else:
                propagator, z, period = self._orbit(name, model, place)
            found.append(len(propagator.record(z, period, MAX_EVENTS)[0]))
        return np.array(found)

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
        # Of the branch on which the resonance is entered: a higher one need not have a top.
        fold, _ = self._at(model, "first_fold", known)
        start = None if fold is not None else self._searched(model, known).start
        y = top(model, _PEAKS[name], start, None if fold is None else fold.y)
        if y is None:
            return None, LOST
        return _Place(y, fold.kind if fold is not None and y is fold.y else name), FOUND

    def _at(self, model, kind, known):
        """Return (place, code) of what is followed; where it is lost, of a search."""
        if kind not in known and kind == "jump_down":
            known[kind] = self._down(model, known)
        elif kind not in known:
            start = self.starts[kind]
            y, code = (None, None) if start is None else start.at(model)
            if y is not None:
                known[kind] = _Place(y, kind), FOUND
            elif kind in _SEARCHED:
                y = getattr(self._searched(model, known), _SEARCHED[kind])
                known[kind] = (None, NONE) if y is None else (_Place(y, kind), FOUND)
            else:
                known[kind] = None, NONE if code == following.VANISHED else LOST
        return known[kind]

    def _down(self, model, known):
        """Return (place, code) of the fold at which the motion falls."""
        place, code = self._at(model, "first_fold", known)
        if place is None or higher(model, place.y) is None:
            return place, code
        start = self.starts["fall"]
        y = None if start is None else start.at(model)[0]
        if y is None or higher(model, y) is not None:
            y = fall(model, place.y)
        return (None, LOST) if y is None else (_Place(y, "fall"), FOUND)

    def _searched(self, model, known):
        if "search" not in known:
            known["search"] = Resonance(model)
        return known["search"]

    def _orbit(self, name, model, place):
        """Return (propagator, state, mesh periods) of the orbit of a quantity."""
        if name in _PEAKS:
            return model.propagator(place.y[2]), place.y[:2], 1
        condition = self.starts["duty"].condition
        return model.propagator(condition.tuning(model, place.y)), place.y, condition.period

    def _value(self, name, model, place):
        if name in _SPEEDS:
            return float(model.speed(place.y[2]))
        propagator, z, period = self._orbit(name, model, place)
        _, summary, _ = propagator.record(z, period, MAX_EVENTS)
        if name == "load_sharing":
            more = model.more_summary((), summary, 2.0 * math.pi * period)
            return float(more[name][1].max())
        return float(_measured(name, model, summary)[1])

    def _slopes(self, name, place):
        """Return the derivatives of a quantity of the nominal design by its parameters, (k,)."""
        model, names, y = self.model, self.names, place.y
        if name == "load_sharing" or name == "dynamic_factor" and model.mesh_names:
            return self._differences(name)
        if name in _PEAKS and place.kind == name:
            # At the top the way along the branch does not count: any will do.
            found = Branch(model).evaluate(y)
            along = found.propagator.directions(model, names)
            _, ahead, _ = found.propagator.map_slopes(y[:2], along, 1, MAX_EVENTS)
            moved = -np.linalg.lstsq(found.jacobian, ahead, rcond=None)[0]
        else:
            moved = self.starts[place.kind].slopes(names)
        if name in _SPEEDS:
            rate = float(model.speed(1.0))
            return rate * moved[2] + y[2] * following.speed_slopes(model, names)
        propagator, z, period = self._orbit(name, model, place)
        if name in _PEAKS:
            by_tuning = moved[2]
        else:
            by_tuning = following.tuning_slopes(model, propagator.tuning, names)
        along = _with_tuning(propagator, model, names, by_tuning)
        slopes, _ = extrema_slopes(propagator, z, along, moved[: len(z)], period)
        _, summary, _ = propagator.record(z, period, MAX_EVENTS)
        mesh, value = _measured(name, model, summary)
        rows = slopes.reshape(4, -1, len(names))[:, mesh]
        row, scale = _measure(name, model, mesh)
        twins = [model.complex_step(model.direction(one)) for one in names]
        grown = np.array([np.imag(_measure(name, twin, mesh)[1] + 0j) / STEP for twin in twins])
        return row @ rows * scale + value / scale * grown

    def _differences(self, name):
        """Return the same by central differences of orbits that are followed."""
        found = []
        for one in self.names:
            ends = []
            for share in (_STEP, -_STEP):
                model, step = following.moved(self.model, one, share)
                place, _ = self._at(model, "duty", {})
                ends.append((self._value(name, model, place), step))
            (a, right), (b, left) = ends
            found.append((a - b) / (right - left))
        return np.array(found)


def names_of(key, given, allowed):
    """Return names as a tuple, each once."""
    if isinstance(given, str) or not hasattr(given, "__iter__"):
        words = f"a sequence of {', '.join(map(repr, allowed))}"
        raise checks.refusal(key, given, words)
    found = tuple(given)
    for name in found:
        checks.one_of(key, name, allowed)
    checks.require(len(set(found)) == len(found), key, given, "names, each once")
    return found


def _start(condition, model, guess):
    if guess is None:
        return None
    return Start(condition, model, guess)


def _stable(model, y):
    """Return whether a point of the branch lies before its fold."""
    return Branch(model).evaluate(y).turning > 0.0


def _measured(name, model, summary):
    """Return (number of the mesh that counts, value) of a quantity from a summary, SI."""
    table, values = np.atleast_2d(summary), []
    for mesh in range(len(table)):
        row, scale = _measure(name, model, mesh)
        values.append(row @ table[mesh, :4] * scale)
    if name == "transmission_error":  # of one mesh, also where others have the same
        mesh = model.mesh_names.index(model.reference) if model.mesh_names else 0
    else:
        mesh = int(np.argmin(values) if name == "contact_margin" else np.nanargmax(values))
    return mesh, values[mesh]


def _measure(name, model, mesh):
    """Return what a quantity is of the extrema of a mesh, (4,), and its scale in SI."""
    row = np.zeros(4)
    if name in ("peak", "transmission_error"):
        row[columns.X_MAX] = 1.0
    if name in ("contact_margin", "transmission_error"):
        row[columns.X_MIN] = 1.0 if name == "contact_margin" else -1.0
    if row.any():
        return row, model.static_deflection
    row[columns.FORCE_MAX] = 1.0
    if name == "force":
        return row, model.load
    return row, 1.0 / model.mean_forces[mesh] if model.mesh_names else 1.0


def _with_tuning(propagator, model, names, by_tuning):
    """Return directions of parameters along which the tuning changes too."""
    along = propagator.directions(model, names)
    own = propagator.directions(model, ("tuning",))[0]
    if isinstance(own, dict):
        return [{**one, "tuning": slope} for one, slope in zip(along, by_tuning, strict=True)]
    return along + np.outer(by_tuning, own)


def of_designs(follow, designs, values, done=lambda count: None):
    """Return (values (n, q), codes (n, q), refusals) of many designs, one after the other.

    follow: `Followed`; designs: `gearlib.tolerances.designs.Designs`; values: of what scatters,
    shape (n, k). Where there is no design the values are NaN, the codes -1 and the text says why.
    Threads would wait for each other: shards and processes do not.
    """
    found = np.full((len(values), len(follow.quantities)), np.nan)
    codes, refusals = np.full(found.shape, NO_DESIGN, np.int8), []
    for first in range(0, len(values), _SOME):
        models, texts = designs.built(values[first : first + _SOME])
        refusals += texts
        for i, model in enumerate(models, first):
            if model is not None:
                found[i], codes[i] = follow(model)
        done(len(models))
    return found, codes, refusals


def gradient(follow, designs):
    """Return the derivatives of quantities by what scatters, shape (q, k).

    They are exact where what scatters are parameters of the model, by the formulas of the drawing
    where it is a drawing; else central differences of designs that are followed.
    """
    fields, jacobian = designs.fields
    if fields:
        return follow.gradient @ jacobian
    centres, columns = designs.tolerances.centres, []
    for i, one in enumerate(designs.tolerances.marginals.values()):
        step = np.zeros(centres.size)
        step[i] = _APART * one.std
        ends = [follow(designs.model(centres + sign * step))[0] for sign in (1.0, -1.0)]
        columns.append((ends[0] - ends[1]) / (2.0 * step[i]))
    return np.array(columns).T
