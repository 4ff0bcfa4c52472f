"""Proofs about the paper's orbits: a file of certificates that a second program can check.

Of every damping: the orbits on the branches behind Fig. 3 at the tunings that the paper's
statements name; the ranges of tunings with an orbit that never loses contact. Of all other points
of the branches only how many are proven, unless all are asked for. Of the first damping that is one
also `certificates_of_trains`.
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
from gearlib.runs.run_arguments import MAX_EVENTS
from gearlib.studies import certificates_of_trains

#: Tunings of the paper's Fig. 6.
TWO = (0.815, 0.8151)
#: Ranges begin and end at multiples of this, not nearer to a special point.
NEAR = 1e-4
#: Above the tunings of the paper's bounces, 1.12, by more than the reading of its plot.
ABOVE = 1.14
#: Digits of the states and tunings that are proven of: fewer than all processors agree on.
CANDIDATE_DIGITS = 11


def compute(pairs, branches, tunings, whole=False):
    """Return the certificates of all dampings.

    pairs: keyword arguments of `GearPair`, by the name of the damping; branches: as of
    `gearlib.studies.resonance_branches`, by the name of the damping; tunings: at which orbits are
    asked for, beside `TWO` and `ABOVE`; whole: whether all points of the branches are asked for.

    Claims as in `Certificate.as_dict` and the others, with the name of the damping, of trains also
    that of the model; refusals with status and message; of each damping how many points of its
    branches are proven.

    ImportError: Without python-flint.
    """
    tunings = sorted({*map(float, tunings), *TWO, ABOVE})
    found = []
    for name, parameters in pairs.items():
        pair, branch = GearPair(**parameters), _rounded_branch(branches[name])
        rows = [{}, *_ranges(pair, branch)]
        for tuning in tunings:
            rows += _at(pair, branch, tuning)
        counts, orbits = _all_points(pair, branch)
        rows[0] = {"claim": "count", "orbits": counts}
        found += [{"damping": name} | row for row in rows + (orbits if whole else [])]
    damped = (name for name, parameters in pairs.items() if GearPair(**parameters).damped())
    for name in list(damped)[:1]:
        proven = certificates_of_trains.compute(GearPair(**pairs[name]), _rounded_orbit)
        for train, tuning, row in proven:
            found.append({"damping": name, "model": train} | _row(row, tuning))
    return found


def _row(proven, tuning=None):
    if proven:
        return proven.as_dict()
    row = {"claim": "refusal", "status": proven.status, "message": proven.message}
    return row if tuning is None else row | {"tuning": float(tuning).hex()}


def _rounded(values):
    """Return candidates with fewer digits: of the last ones processors have different opinions.

    What is enclosed does not depend on them, the box that is written does.
    """
    return np.array([float(f"{x:.{CANDIDATE_DIGITS - 1}e}") for x in np.ravel(values)]).reshape(
        np.shape(values)
    )


def _rounded_branch(branch):
    return branch.assign(
        {name: (branch[name].dims, _rounded(branch[name].values)) for name in ("state", "tuning")}
    )


def _rounded_orbit(orbit):
    return replace(orbit, state=_rounded(orbit.state))


def _ranges(pair, branch):
    """Yield ranges of tunings with an orbit without loss of contact: between special points."""
    tuning, label, number = (branch[name].values for name in ("tuning", "label", "branch"))
    kept = (branch.contacts.values == "N") & (branch.period.values == 1) & (label == REGULAR)
    ends = np.flatnonzero((label != REGULAR) | (np.diff(number, append=-1) != 0))
    for first, last in zip([0, *ends], ends, strict=False):
        # A special point belongs to what is on either side of it, the end of a branch does not.
        first += number[first] != number[last]
        inside = np.flatnonzero(kept[first : last + 1]) + first
        low, high = sorted((first, last), key=lambda point: tuning[point])
        counts = [round(tuning[point] / NEAR, 6) for point in (low, high)]
        away = [label[point] != REGULAR for point in (low, high)]
        low = round((math.ceil(counts[0]) + away[0]) * NEAR, 4)
        high = round((math.floor(counts[1]) - away[1]) * NEAR, 4)
        if not inside.size or low >= high:
            continue
        nearest = inside[np.abs(tuning[inside] - low).argmin()]
        try:
            orbit = periodic_orbit(pair, low, guess=branch.state.values[nearest])
        except NoOrbit:
            continue
        if orbit.pattern == (1,):
            yield _row(certify_range(_rounded_orbit(orbit), to=high), low)


def _at(pair, branch, tuning):
    """Yield the orbits of one mesh period at a tuning."""
    seen = []
    for guess in _crossings(branch, tuning):
        try:
            orbit = periodic_orbit(pair, tuning, guess=guess)
        except NoOrbit:
            continue
        if not any(np.abs(orbit.state - state).max() < 1e-6 for state in seen):
            seen.append(orbit.state)
            yield _row(certify(_rounded_orbit(orbit)), tuning)


def _crossings(branch, tuning):
    """Yield the states of the points next to where the branches pass a tuning."""
    at, single = branch.tuning.values, branch.period.values == 1
    away, number = at - tuning, branch.branch.values
    for i in np.flatnonzero((away[:-1] <= 0.0) != (away[1:] <= 0.0)):
        if number[i] == number[i + 1] and single[i]:
            share = away[i] / (away[i] - away[i + 1])
            yield tuple((1.0 - share) * branch.state.values[i] + share * branch.state.values[i + 1])


def _all_points(pair, branch):
    """Return (how many points of the branches are what, the claims of all)."""
    counts, rows = Counter(), []
    for point in np.flatnonzero(branch.label.values == REGULAR):
        orbit = as_orbit(point_of_dataset(pair, branch, int(point), MAX_EVENTS).solution)
        proven = certify(_rounded_orbit(orbit))
        counts[proven.stability if proven else f"refused: {proven.status}"] += 1
        rows.append(_row(proven, orbit.tuning))
    return dict(sorted(counts.items())), rows


def write_json(rows, path):
    """Write the certificates, a line each, replacing the file in one step."""
    lines = ",\n".join(json.dumps(row) for row in rows)
    with replacing(path) as temporary:
        temporary.write_text(f"[\n{lines}\n]\n", encoding="utf-8")
