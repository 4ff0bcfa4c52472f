"""Prove statements about the paper's orbits by certificates that another program can check.

For each damping, certificates are computed for orbits on the branches behind Fig. 3 at the tunings
of the paper's statements, and for ranges of tunings with an orbit that never loses contact. For the
reducer made of the first damped pair, they prove that the motion with contact in all six meshes,
equal in all branches, is stable at one tuning and unstable at another one.
"""

import json
import math
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from gearlib.analysis.orbits.continuation import point_of_dataset
from gearlib.analysis.orbits.shooting import NoOrbit, as_orbit, periodic_orbit
from gearlib.analysis.orbits.special_points import REGULAR
from gearlib.analysis.proofs.orbits import certify, certify_range
from gearlib.data.files import atomic_write
from gearlib.engines.codes import COAST, DRIVE, NO_CONTACT
from gearlib.models.pair import GearPair
from gearlib.models.trains.ready_made import split_power_reducer
from gearlib.runs.run_arguments import MAX_EVENTS

#: Tunings of the paper's Fig. 6.
FIG6_TUNINGS = (0.815, 0.8151)
#: A tuning above the paper's range of contact loss, which ends at 1.12 within 0.01.
TUNING_ABOVE_CONTACT_LOSS = 1.14
#: Teeth of the reducer, and tunings at which its symmetric motion is stable and unstable.
REDUCER_TEETH, REDUCER_TUNINGS = (24, 36, 24, 36), (0.5, 0.6)
#: Ranges of tunings begin and end at multiples of this step.
_TUNING_STEP = 1e-4
#: Number of significant digits of states and tunings in certificates, on which processors agree.
_DIGITS = 11
#: States that differ by less belong to the same orbit.
_SAME_ORBIT_DISTANCE = 1e-6
#: Contact state -> letter in the table.
_CONTACT_LETTERS = {DRIVE: "D", NO_CONTACT: "F", COAST: "C"}


def certify_branches(
    pairs: dict[str, GearPair], branches: dict, tunings, all_points: bool = False
) -> list[dict]:
    """Certify the periodic orbits of several gear pairs, and return one dict per certificate.

    `pairs` maps names of damping combinations to pairs, `branches` the same names to datasets with
    the branches of orbits over tuning (mesh frequency over natural frequency), as returned by
    `gearlib.studies.resonance.compute_branches`. Orbits are certified at `tunings`, at the two
    tunings of the paper's Fig. 6, and at one above the paper's range of contact loss. A dict has
    the fields of `Certificate.as_dict`; or the claim "refusal" and a message why the proof failed;
    or the claim "count" and the number of points of the branches by outcome. With `all_points`, the
    certificates of these points are included. For the first damped pair, certificates of a reducer
    ("gears": "reducer") are added.
    """
    tunings = sorted({*map(float, tunings), *FIG6_TUNINGS, TUNING_ABOVE_CONTACT_LOSS})
    certificates = []
    for damping, pair in pairs.items():
        branch = branches[damping]
        # Certificates of rounded states have the same bytes on all processors.
        rounded = {
            name: branch[name].copy(data=_round_to_digits(branch[name]))
            for name in ("state", "tuning")
        }
        branch = branch.assign(rounded)
        points = _certify_points(pair, branch)
        outcomes = [point.get("stability") or f"refused: {point['status']}" for point in points]
        count = {"claim": "count", "orbits": dict(sorted(Counter(outcomes).items()))}
        pair_certificates = [count, *_certify_ranges(pair, branch)]
        for tuning in tunings:
            pair_certificates += _certify_orbits_at_tuning(pair, branch, tuning)
        if all_points:
            pair_certificates += points
        certificates += [{"damping": damping} | entry for entry in pair_certificates]
    for damping, pair in pairs.items():
        if pair.has_damping():  # a single damped pair is enough for the reducer
            labels = {"damping": damping, "gears": "reducer"}
            certificates += [labels | certificate for certificate in _certify_reducer(pair)]
            break
    return certificates


def _round_to_digits(values: Any) -> np.ndarray:
    """Return an array of values rounded to `_DIGITS` significant digits.

    Processors agree on these digits, so files of certificates have the same bytes everywhere.
    """

    def rounded_value(value: float) -> float:
        """Return a number rounded to `_DIGITS` significant digits."""
        return float(f"{value:.{_DIGITS - 1}e}")

    return np.vectorize(rounded_value, otypes=[float])(values)


def _certify_orbit(orbit: Any, tuning: float, last_tuning: float | None = None) -> dict:
    """Prove existence and stability of an orbit, and return the certificate as a dict.

    The proof holds at `tuning` (mesh frequency over natural frequency) or, with `last_tuning`, for
    all tunings between both. If it fails, the dict has the claim "refusal", and the status and the
    message of the failure.
    """
    orbit = replace(orbit, state=_round_to_digits(orbit.state))
    outcome = certify(orbit) if last_tuning is None else certify_range(orbit, to=last_tuning)
    if outcome:
        return outcome.as_dict()
    # The outcome of a failed proof is false. Hexadecimal numbers are exact.
    failure = {"claim": "refusal", "status": outcome.status, "message": outcome.message}
    return failure | {"tuning": float(tuning).hex()}


def _certify_reducer(pair: GearPair) -> list[dict]:
    """Certify the motion of a reducer that is equal in all its branches; return the certificates.

    The reducer shares the power between equal branches, and each of its meshes has the properties
    of `pair`. `REDUCER_TUNINGS` are two values of mesh frequency over natural frequency, at which
    this motion is stable and unstable. A tuning at which no orbit is found is left out.
    """
    reducer = split_power_reducer(pair, teeth=REDUCER_TEETH)
    start = reducer.start_state("static")
    common_period = reducer.repeats  # mesh periods after which the phases of all meshes repeat
    certificates = []
    for tuning in REDUCER_TUNINGS:
        try:
            orbit = periodic_orbit(reducer, tuning, guess=start, period=common_period)
        except NoOrbit:
            continue
        certificates.append(_certify_orbit(orbit, tuning))
    return certificates


def _certify_ranges(pair: GearPair, branch: xr.Dataset) -> list[dict]:
    """Certify ranges of tunings with an orbit that never loses contact; return the certificates.

    The tuning is mesh frequency over natural frequency. `branch` is a dataset with the points of
    all branches of orbits of `pair`. A range lies between two successive special points, such as
    folds and period doublings, and its ends are multiples of `_TUNING_STEP`.
    """
    tuning, label = branch.tuning.values, branch.label.values
    branch_number = branch.branch.values
    in_contact = branch.contacts.values == "D"  # drive-side contact during the whole period
    is_usable = in_contact & (branch.period.values == 1) & (label == REGULAR)
    # Points at which a range ends: special points and the last point of each branch.
    ends = np.flatnonzero((label != REGULAR) | (np.diff(branch_number, append=-1) != 0))
    certificates = []
    for start_point, end_point in zip([0, *ends], ends, strict=False):
        # A special point belongs to both neighbouring ranges, the end of a branch does not.
        start_point += branch_number[start_point] != branch_number[end_point]
        inside = np.flatnonzero(is_usable[start_point : end_point + 1]) + start_point
        lower, upper = sorted((start_point, end_point), key=lambda point: tuning[point])
        # Ranges stay at least one step away from special points. Multiples of the step, 1e-4, are
        # not exact as floats, so quotients are rounded to 6 decimals and tunings to 4.
        lower_steps = math.ceil(round(tuning[lower] / _TUNING_STEP, 6))
        upper_steps = math.floor(round(tuning[upper] / _TUNING_STEP, 6))
        lower_tuning = round((lower_steps + (label[lower] != REGULAR)) * _TUNING_STEP, 4)
        upper_tuning = round((upper_steps - (label[upper] != REGULAR)) * _TUNING_STEP, 4)
        if not inside.size or lower_tuning >= upper_tuning:
            continue
        nearest = inside[np.abs(tuning[inside] - lower_tuning).argmin()]
        try:
            orbit = periodic_orbit(pair, lower_tuning, guess=branch.state.values[nearest])
        except NoOrbit:
            continue
        if orbit.pattern == (DRIVE,):
            certificates.append(_certify_orbit(orbit, lower_tuning, upper_tuning))
    return certificates


def _certify_orbits_at_tuning(pair: GearPair, branch: xr.Dataset, tuning: float) -> list[dict]:
    """Certify all orbits of one mesh period on the branches at a tuning; return the certificates.

    The tuning is mesh frequency over natural frequency. `branch` is a dataset with the points of
    all branches of orbits of `pair`. An orbit that two branches share is certified once.
    """
    states: list[np.ndarray] = []
    certificates = []
    for guess in _interpolate_states(branch, tuning):
        try:
            orbit = periodic_orbit(pair, tuning, guess=guess)
        except NoOrbit:
            continue
        distances = [np.abs(orbit.state - state).max() for state in states]
        if all(distance >= _SAME_ORBIT_DISTANCE for distance in distances):
            states.append(orbit.state)
            certificates.append(_certify_orbit(orbit, tuning))
    return certificates


def _interpolate_states(branch: xr.Dataset, tuning: float) -> Iterator[tuple]:
    """Yield approximate states of the orbits at a tuning, as initial guesses for shooting.

    A state is interpolated linearly between the two points at which a branch of orbits of one mesh
    period passes the tuning. `branch` is a dataset with the points of all branches.
    """
    difference = branch.tuning.values - tuning
    branch_number = branch.branch.values
    states, period = branch.state.values, branch.period.values
    # The tuning is passed between point i and the next one, if both belong to the same branch.
    for i in np.flatnonzero((difference[:-1] <= 0.0) != (difference[1:] <= 0.0)):
        if branch_number[i] == branch_number[i + 1] and period[i] == 1:
            fraction = difference[i] / (difference[i] - difference[i + 1])
            yield tuple((1.0 - fraction) * states[i] + fraction * states[i + 1])


def _certify_points(pair: GearPair, branch: xr.Dataset) -> list[dict]:
    """Certify the orbit at every regular point of the branches of a pair; return the certificates.

    `branch` is a dataset with the points of all branches. Regular points are those that are not
    special, as folds and period doublings are.
    """
    certificates = []
    for point in np.flatnonzero(branch.label.values == REGULAR):
        orbit = as_orbit(point_of_dataset(pair, branch, int(point), MAX_EVENTS).solution)
        certificates.append(_certify_orbit(orbit, orbit.tuning))
    return certificates


def write_json(certificates: Sequence[dict], path: Path) -> None:
    """Write certificates to a JSON file as a list with one certificate per line.

    A temporary file replaces `path` in one step, so that a reader never finds half a file.
    """
    lines = ",\n".join(json.dumps(certificate) for certificate in certificates)
    with atomic_write(path) as temporary:
        temporary.write_text(f"[\n{lines}\n]\n", encoding="utf-8")


def certificate_rows(certificates: Sequence[dict]) -> Iterator[list]:
    """Yield the rows of the table of certificates: the names of the columns, then their values.

    `certificates` are the dicts of `certify_branches`; failed proofs (claim "refusal") and counts
    are left out. The columns tuning and until are the first and the last tuning of a certified
    range; contacts has one letter per contact state in turn: D drive-side contact, F no contact
    (free flight), C coast-side contact. lowest is the smallest displacement of the orbit in static
    deflections, and reason the argument for its stability.
    """
    yield ["damping", "claim", "tuning", "until", "contacts", "lowest", "stability", "reason"]
    for certificate in certificates:
        if certificate["claim"] in ("count", "refusal"):
            continue
        # An orbit at one tuning has the key "tuning", a range the keys "start" and "stop".
        first_tuning = certificate.get("tuning", certificate.get("start"))
        contacts = "".join(_CONTACT_LETTERS[code] for code in certificate.get("pattern", ()))
        labels = [certificate[name] for name in ("damping", "gears") if name in certificate]
        tunings = _format_decimal(first_tuning), _format_decimal(certificate.get("stop"))
        min_displacement = _format_decimal(certificate.get("displacement_min"))
        cells = [", ".join(labels), certificate["claim"], *tunings, contacts, min_displacement]
        yield [*cells, certificate["stability"], certificate["reason"]]


def _format_decimal(value: str | Sequence[str] | None) -> str:
    """Return a number of a certificate as a decimal string, "" for None.

    `value` is a hexadecimal float, or an enclosure: a pair of decimal strings (lower, upper end).
    Enclosures are far narrower than the 10 digits of the result, so their lower end is used.
    """
    if value is None:
        return ""
    number = float.fromhex(value) if isinstance(value, str) else float(value[0])
    return f"{number:.10g}"
