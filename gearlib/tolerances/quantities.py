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
from gearlib.analysis.orbits.main_resonance import (
    Branch,
    Resonance,
    Top,
    fall,
    higher,
    lasts,
    top,
)
from gearlib.analysis.orbits.shooting import periodic_orbit
from gearlib.data.scatter_variables import QUANTITIES
from gearlib.kernels import orbit as columns
from gearlib.models.derivatives import STEP
from gearlib.runs.run_arguments import MAX_EVENTS, check_speed
from gearlib.tolerances.by_mesh import SHARES, measure, measured, share_slopes, worst

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
_DUTY = {"dynamic_factor", "force", "transmission_error", "contact_margin", *SHARES}
#: Meshes whose least displacements differ by less lose contact together, static deflections.
_TOGETHER = 1e-9


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
    names : sequence
        Parameters, as of ``model.derivatives``; of trains also directions, as of
        ``model.direction``.
    quantities : sequence of str
        Of `QUANTITIES`.
    speed : float, optional
        Of the duty point, rpm.

    Attributes
    ----------
    nominal : ndarray, shape (q,)
        NaN where the nominal design has none.
    gradient : ndarray, shape (q, k)
        Exact derivatives by the parameters, SI; of trains those of the mesh that is worst.
    pieces : list of (ndarray, shape (m,), ndarray, shape (m, k))
        The same of all meshes one of which is worst, q pairs of values and derivatives.

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
        duty = _DUTY & set(self.quantities)
        if duty and speed is None:
            raise ValueError(f"speed = None is not allowed: {min(duty)} is one of the duty point")
        if duty & SHARES and not model.mesh_names:
            name = min(duty & SHARES)
            raise ValueError(f"quantities = {name!r} is not allowed: it is one of trains")
        if "transmission_error" in duty and model.equation and len(model.equation.deviation):
            raise ValueError(
                "quantities = 'transmission_error' is not allowed for a model with deviations of "
                "the flanks: its displacement is that of the flanks"
            )
        followed = set(self.quantities) - duty
        one = model.size == 2 and model.repeats == 1
        special = model.kind().map_rates is not None and (one or model.equation is None)
        if followed and not special or model.kind().map_slopes is None:
            raise ValueError(
                f"quantities = {min(followed or duty)!r} is not allowed for this "
                f"{type(model).__name__}: what is followed are special points and orbits of models "
                "with derivatives"
            )
        if {*_PEAKS} & followed and not one:
            raise ValueError(
                f"quantities = {min({*_PEAKS} & followed)!r} is not allowed for this "
                f"{type(model).__name__}: peaks are followed of models with one degree of freedom"
            )
        self.starts: dict = {}
        #: Meshes that lose contact at the same speed.
        self._together = np.array([0])
        if duty:
            tuning = check_speed(model, "speed", speed)
            orbit = periodic_orbit(model, tuning, period=model.repeats)
            self.starts["duty"] = Start(At(float(speed), orbit.period), model, orbit.state)
        if followed:
            found = Resonance(model)
            for name, field in _SEARCHED.items():
                kind = Onset if name == "onset" else Fold
                self.starts[name] = _start(kind(), model, getattr(found, field))
            if found.onset is not None:
                propagator = model.propagator(found.onset[-1])
                _, summary, _ = propagator.record(found.onset[:-1], model.repeats, MAX_EVENTS)
                apart = np.atleast_2d(summary)[:, columns.X_MIN] - model.flank_lines[0]
                self._together = np.flatnonzero(np.ravel(apart) < _TOGETHER)
            down = fall(model, found.jump_down)
            own = None if down is found.jump_down else down
            self.starts["fall"] = _start(Fold(), model, own)
            for name in set(_PEAKS) & followed:
                which = _PEAKS[name]
                place = top(model, which, found.start, found.jump_down)
                at_fold = place is found.jump_down is not None
                self.starts[name] = None if at_fold else _start(Top(which), model, place)
        self.nominal, _, places = self._of(model)
        self.pieces, k = [], len(self.names)
        for name, place in zip(self.quantities, places, strict=True):
            values, slopes = np.array([np.nan]), np.full((1, k), np.nan)
            if place is not None:
                values = self._every(name, model, place)
                slopes = np.reshape(self._slopes(name, place) if k else [], (len(values), k))
            self.pieces.append((values, slopes))
        rows = zip(self.quantities, self.pieces, strict=True)
        self.gradient = np.array([slopes[worst(name, values)] for name, (values, slopes) in rows])

    def __call__(self, model):
        """Return the values of a design, (q,), and their codes, (q,) int8; NaN if not found."""
        return self._of(model)[:2]

    def every(self, model):
        """Return the values of the quantities of a design by mesh, of which the worst count.

        Each of shape (m,); m is 1 of what is not of meshes, and NaN what is not found.
        """
        return [
            np.full(len(values), np.nan) if place is None else self._every(name, model, place)
            for name, place, (values, _) in zip(
                self.quantities, self._of(model)[2], self.pieces, strict=True
            )
        ]

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
                propagator, z = model.propagator(place.y[-1]), place.y[:-1]
                period = model.repeats
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
                every = self._every(name, model, place)
                values[i] = every[worst(name, every)]
        return values, codes, places

    def _place(self, name, model, known):
        """Return (place, code) of a quantity of a design."""
        if name in _DUTY:
            return self._at(model, "duty", known)
        if name in _SPEEDS:
            place, code = self._at(model, _NAMES.get(name, name), known)
            if place is not None and _SPEEDS[name] is Fold and not lasts(model, place.y):
                return None, LOST
            return place, code
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

    def _every(self, name, model, place):
        """Return the values of a quantity of all meshes, of which the worst counts."""
        if name in _SPEEDS:
            # Meshes that lose contact together do so one by one in other designs.
            count = max(len(self._together), 1) if _SPEEDS[name] is Onset else 1
            return np.full(count, float(model.speed(place.y[-1])))
        propagator, z, period = self._orbit(name, model, place)
        _, summary, _ = propagator.record(z, period, MAX_EVENTS)
        if name in SHARES:
            return model.more_summary((), summary, 2.0 * math.pi * period)["load_sharing"][1]
        return np.array([value for _, value in measured(name, model, summary)])

    def _slopes(self, name, place):
        """Return the derivatives of what `_every` returns by the parameters, shape (m, k)."""
        model, names, y = self.model, self.names, place.y
        if name in _PEAKS and place.kind == name:
            # At the top the way along the branch does not count: any will do.
            found = Branch(model).evaluate(y)
            along = found.propagator.directions(model, names)
            _, ahead, _ = found.propagator.map_slopes(y[:2], along, 1, MAX_EVENTS)
            moved = -np.linalg.lstsq(found.jacobian, ahead, rcond=None)[0]
        else:
            moved = self.starts[place.kind].slopes(names)
        if name in _SPEEDS:
            rate, grown = float(model.speed(1.0)), following.speed_slopes(model, names)
            rows = [moved]
            if len(self._together) > 1 and _SPEEDS[name] is Onset:
                rows = [following.slopes(Onset(one), model, y, names) for one in self._together]
            return [rate * row[-1] + y[-1] * grown for row in rows]
        propagator, z, period = self._orbit(name, model, place)
        if name in SHARES:
            return share_slopes(model, propagator.tuning, z, period, names, moved)
        if name in _PEAKS:
            by_tuning = moved[2]
        else:
            by_tuning = following.tuning_slopes(model, propagator.tuning, names)
        along = _with_tuning(propagator, model, names, by_tuning)
        slopes, _ = extrema_slopes(propagator, z, along, moved[: len(z)], period)
        _, summary, _ = propagator.record(z, period, MAX_EVENTS)
        rows = slopes.reshape(4, -1, len(names))
        twins = [model.complex_step(model.direction(one)) for one in names]
        found = []
        for mesh, value in measured(name, model, summary):
            row, scale = measure(name, model, mesh)
            grown = [np.imag(measure(name, twin, mesh)[1] + 0j) / STEP for twin in twins]
            found.append(row @ rows[:, mesh] * scale + value / scale * np.array(grown))
        return found


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
