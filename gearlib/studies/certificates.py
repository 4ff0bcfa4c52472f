"""Proofs about the paper's orbits: a file of certificates that a second program can check.

For each damping: the orbits on the branches behind Fig. 3 at the tunings that the paper's
statements name, and the ranges of tunings with an orbit that never loses contact. Of the reducer
made of the first damped pair, whose branches move alike with contact in all six meshes: at one
tuning this motion is stable, at another one it breaks.
"""

import json
import math
from collections import Counter
from dataclasses import replace

import numpy as np

from gearlib.analysis.orbits.continuation import point_of_dataset
from gearlib.analysis.orbits.shooting import NoOrbit, as_orbit, periodic_orbit
from gearlib.analysis.orbits.special_points import REGULAR
from gearlib.analysis.proofs.orbits import certify, certify_range
from gearlib.data.files import replacing
from gearlib.models.pair import GearPair
from gearlib.models.trains.ready_made import split_power_reducer
from gearlib.runs.run_arguments import MAX_EVENTS

#: Tunings of the paper's Fig. 6.
TWO = (0.815, 0.8151)
#: Tuning above those of the paper's bounces, 1.12, by more than the reading of its plot.
ABOVE = 1.14
#: Teeth and tunings of the reducer: below the loss of symmetry, and in it.
REDUCER, ALIKE = (24, 36, 24, 36), (0.5, 0.6)
#: Step of tunings: ranges begin and end at multiples of it, not nearer to a special point.
_STEP = 1e-4
#: Digits of the states and tunings that are proven of: fewer than all processors agree on.
_DIGITS = 11
#: Difference of states below which orbits are one.
_SAME_ORBIT = 1e-6
#: Contact codes of a certificate -> letters of its table.
_LETTERS = {1: "N", 0: "B", -1: "I"}


def compute(pairs, branches, tunings, whole=False):
    """Return the certificates of all dampings, dicts as of `Certificate.as_dict`, and refusals.

    `pairs` are arguments of `GearPair` by damping, `branches` those of `gearlib.studies.resonance`;
    orbits are asked for at `tunings`, `TWO` and `ABOVE`. A count for each damping says how many
    points of its branches are proven; with `whole` their certificates are there too.
    """
    tunings = sorted({*map(float, tunings), *TWO, ABOVE})
    models = {name: GearPair(**parameters) for name, parameters in pairs.items()}
    rows = []
    for name, pair in models.items():
        branch = branches[name]
        branch = branch.assign({key: _rounded(branch[key]) for key in ("state", "tuning")})
        proven = [*_ranges(pair, branch)]
        for tuning in tunings:
            proven += _orbits_at(pair, branch, tuning)
        counts, points = _all_points(pair, branch)
        proven = [{"claim": "count", "orbits": counts}, *proven, *(points if whole else [])]
        rows += [{"damping": name} | row for row in proven]
    for name in [name for name, pair in models.items() if pair.damped()][:1]:
        about = {"damping": name, "model": "reducer"}
        rows += [about | row for row in _reducer_orbits(models[name])]
    return rows


def _rounded(values):
    """Return values with fewer digits, as an array of xarray, of numpy or a number."""
    # What is enclosed does not depend on the last digits, the box that is written does.
    digits = np.vectorize(lambda x: float(f"{x:.{_DIGITS - 1}e}"), otypes=[float])
    return values.copy(data=digits(values)) if hasattr(values, "dims") else digits(values)


def _certificate(orbit, tuning=None, to=None):
    """Return the certificate of an orbit, or of the range up to a tuning, or the refusal."""
    orbit = replace(orbit, state=_rounded(orbit.state))
    proven = certify(orbit) if to is None else certify_range(orbit, to=to)
    if proven:
        return proven.as_dict()
    about = {} if tuning is None else {"tuning": float(tuning).hex()}
    return {"claim": "refusal", "status": proven.status, "message": proven.message} | about


def _reducer_orbits(pair):
    """Yield the certificates of the motion of the reducer whose branches move alike."""
    reducer = split_power_reducer(pair, teeth=REDUCER)
    start, period = reducer.start_state("static"), reducer.repeats
    for tuning in ALIKE:
        try:
            orbit = periodic_orbit(reducer, tuning, guess=start, period=period)
        except NoOrbit:
            continue
        yield _certificate(orbit, tuning)


def _ranges(pair, branch):
    """Yield ranges of tunings with an orbit without loss of contact, between special points."""
    tuning, label, number = (branch[name].values for name in ("tuning", "label", "branch"))
    kept = (branch.contacts.values == "N") & (branch.period.values == 1) & (label == REGULAR)
    ends = np.flatnonzero((label != REGULAR) | (np.diff(number, append=-1) != 0))
    for first, last in zip([0, *ends], ends, strict=False):
        # A special point belongs to what is on either side of it, the end of a branch does not.
        first += number[first] != number[last]
        inside = np.flatnonzero(kept[first : last + 1]) + first
        low, high = sorted((first, last), key=lambda point: tuning[point])
        counts = [round(tuning[point] / _STEP, 6) for point in (low, high)]
        away = [label[point] != REGULAR for point in (low, high)]
        low = round((math.ceil(counts[0]) + away[0]) * _STEP, 4)
        high = round((math.floor(counts[1]) - away[1]) * _STEP, 4)
        if not inside.size or low >= high:
            continue
        nearest = inside[np.abs(tuning[inside] - low).argmin()]
        try:
            orbit = periodic_orbit(pair, low, guess=branch.state.values[nearest])
        except NoOrbit:
            continue
        if orbit.pattern == (1,):
            yield _certificate(orbit, low, to=high)


def _orbits_at(pair, branch, tuning):
    """Yield the certificates of the orbits of one mesh period at a tuning."""
    states = []
    for guess in _crossings(branch, tuning):
        try:
            orbit = periodic_orbit(pair, tuning, guess=guess)
        except NoOrbit:
            continue
        if not any(np.abs(orbit.state - state).max() < _SAME_ORBIT for state in states):
            states.append(orbit.state)
            yield _certificate(orbit, tuning)


def _crossings(branch, tuning):
    """Yield the states, between those of two points, where branches of period one pass a tuning."""
    away, number = branch.tuning.values - tuning, branch.branch.values
    states, single = branch.state.values, branch.period.values == 1
    for i in np.flatnonzero((away[:-1] <= 0.0) != (away[1:] <= 0.0)):
        if number[i] == number[i + 1] and single[i]:
            share = away[i] / (away[i] - away[i + 1])
            yield tuple((1.0 - share) * states[i] + share * states[i + 1])


def _all_points(pair, branch):
    """Return how many regular points of the branches are proven to be what, and all their rows."""
    rows = []
    for point in np.flatnonzero(branch.label.values == REGULAR):
        orbit = as_orbit(point_of_dataset(pair, branch, int(point), MAX_EVENTS).solution)
        rows.append(_certificate(orbit, orbit.tuning))
    kinds = [row.get("stability") or f"refused: {row['status']}" for row in rows]
    return dict(sorted(Counter(kinds).items())), rows


def write_json(rows, path):
    """Write the certificates, a line each, replacing the file in one step."""
    lines = ",\n".join(json.dumps(row) for row in rows)
    with replacing(path) as temporary:
        temporary.write_text(f"[\n{lines}\n]\n", encoding="utf-8")


def rows(certificates):
    """Yield the table of the certificates, without refusals and counts: a head and their rows.

    Of a range `tuning` is where it begins, `until` where it ends; lowest is the least displacement
    of the orbit, static deflections. Enclosures are far narrower than the digits printed.
    """
    yield ["damping", "claim", "tuning", "until", "contacts", "lowest", "stability", "reason"]
    for row in certificates:
        if row["claim"] not in ("count", "refusal"):
            numbers = (
                row.get("tuning", row.get("start")),
                row.get("stop"),
                row.get("displacement_min"),
            )
            tuning, until, lowest = ("" if one is None else _decimal(one) for one in numbers)
            contacts = "".join(_LETTERS[code] for code in row.get("pattern", ()))
            name = ", ".join(row[key] for key in ("damping", "model") if key in row)
            about = [name, row["claim"], tuning, until, contacts, lowest]
            yield [*about, row["stability"], row["reason"]]


def _decimal(value):
    """Return a float that is written as its bits, or an end of an enclosure, as a decimal."""
    number = float.fromhex(value) if isinstance(value, str) else float(value[0])
    return f"{number:.10g}"
