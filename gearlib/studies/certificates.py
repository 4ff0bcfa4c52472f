"""Prove statements about the paper's orbits by certificates that another program can check.

For each damping, orbits on the solution branches of Fig. 3 are certified at the tunings mentioned
in the paper, and ranges of tunings are certified in which an orbit never loses contact. For a
reducer with the first damped pair, the certificates prove that the symmetric motion with contact in
all six meshes is stable at one tuning and unstable at another.
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
#: Numbers of teeth of the reducer, and tunings at which its symmetric motion is stable or unstable.
REDUCER_TEETH, REDUCER_TUNINGS = (24, 36, 24, 36), (0.5, 0.6)
#: The ends of certified ranges of tunings are multiples of this step.
_TUNING_STEP = 1e-4
#: Significant digits of states and tunings in certificates, equal on all processors.
_DIGITS = 11
#: Orbits whose states differ by less are the same orbit.
_SAME_ORBIT_DISTANCE = 1e-6
#: Contact state -> letter in the table.
_CONTACT_LETTERS = {DRIVE: "D", NO_CONTACT: "F", COAST: "C"}


def certify_branches(
    pairs: dict[str, GearPair], branches: dict, tunings, all_points: bool = False
) -> list[dict]:
    """Certify the periodic orbits of several gear pairs; return a list with one dict per proof.

    `pairs` maps names of damping combinations to pairs, and `branches` maps these names to datasets
    of `gearlib.studies.resonance.compute_branches`. Orbits are certified at `tunings` (mesh
    frequency over natural frequency), at the two tunings of the paper's Fig. 6, and at one above
    the paper's range of contact loss. Each dict has one of the forms

    * the fields of `Certificate.as_dict`,
    * the claim "refusal" with a message that explains why the proof failed,
    * the claim "count" with the number of branch points for each outcome.

    If `all_points` is true, the certificates of all branch points are included. Certificates of a
    reducer with the first damped pair have the entry "gears": "reducer".
    """
    tunings = sorted({*map(float, tunings), *FIG6_TUNINGS, TUNING_ABOVE_CONTACT_LOSS})
    certificates = []
    for damping, pair in pairs.items():
        branch = branches[damping]
        # With rounded states, certificates are identical on all processors.
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
        if pair.has_damping():  # one damped pair is enough for the reducer
            labels = {"damping": damping, "gears": "reducer"}
            certificates += [labels | certificate for certificate in _certify_reducer(pair)]
            break
    return certificates


def _round_to_digits(values: Any) -> np.ndarray:
    """Round an array to `_DIGITS` significant digits, which are equal on all processors."""

    def rounded_value(value: float) -> float:
        """Round a number to `_DIGITS` significant digits."""
        return float(f"{value:.{_DIGITS - 1}e}")

    return np.vectorize(rounded_value, otypes=[float])(values)


def _certify_orbit(orbit: Any, tuning: float, last_tuning: float | None = None) -> dict:
    """Prove existence and stability of an orbit, and return the certificate as a dict.

    The proof holds at `tuning` (mesh frequency over natural frequency) or, if `last_tuning` is
    given, for all tunings from `tuning` to `last_tuning`. If the proof fails, the dict has the
    claim "refusal" with a status and a message.
    """
    orbit = replace(orbit, state=_round_to_digits(orbit.state))
    outcome = certify(orbit) if last_tuning is None else certify_range(orbit, to=last_tuning)
    if outcome:
        return outcome.as_dict()
    # Hexadecimal floats are exact.
    failure = {"claim": "refusal", "status": outcome.status, "message": outcome.message}
    return failure | {"tuning": float(tuning).hex()}


def _certify_reducer(pair: GearPair) -> list[dict]:
    """Certify the symmetric motion of a split-power reducer; return the certificates.

    All branches of the reducer move equally, and each mesh has the parameters of `pair`. The motion
    is stable or unstable at the two `REDUCER_TUNINGS` (mesh frequency over natural frequency).
    Tunings at which no orbit is found are skipped.
    """
    reducer = split_power_reducer(pair, teeth=REDUCER_TEETH)
    start = reducer.start_state("static")
    common_period = reducer.repeats  # common period of all meshes, in mesh periods
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
    all solution branches of `pair`. A range lies between two consecutive special points, such as
    folds and period doublings, and its ends are multiples of `_TUNING_STEP`.
    """
    tuning, label = branch.tuning.values, branch.label.values
    branch_number = branch.branch.values
    in_contact = branch.contacts.values == "D"  # drive-side contact during the whole period
    is_usable = in_contact & (branch.period.values == 1) & (label == REGULAR)
    # Ranges end at special points and at the last point of each branch.
    ends = np.flatnonzero((label != REGULAR) | (np.diff(branch_number, append=-1) != 0))
    certificates = []
    for start_point, end_point in zip([0, *ends], ends, strict=False):
        # A special point bounds both adjacent ranges; the end of a branch bounds only one.
        start_point += branch_number[start_point] != branch_number[end_point]
        inside = np.flatnonzero(is_usable[start_point : end_point + 1]) + start_point
        lower, upper = sorted((start_point, end_point), key=lambda point: tuning[point])
        # Ranges end at least one step before special points. Multiples of the step 1e-4 are not
        # exact floats, so quotients are rounded to 6 decimals and tunings to 4.
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
    """Certify all period-one orbits on the branches at a tuning; return the certificates.

    The tuning is mesh frequency over natural frequency. `branch` is a dataset with the points of
    all solution branches of `pair`. An orbit on several branches is certified once.
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
    """Yield approximate states of the period-one orbits at a tuning, as guesses for shooting.

    States are interpolated linearly between the two branch points that bracket the tuning (mesh
    frequency over natural frequency). `branch` is a dataset with the points of all branches.
    """
    difference = branch.tuning.values - tuning
    branch_number = branch.branch.values
    states, period = branch.state.values, branch.period.values
    # The sign changes between points i and i + 1, which must belong to the same branch.
    for i in np.flatnonzero((difference[:-1] <= 0.0) != (difference[1:] <= 0.0)):
        if branch_number[i] == branch_number[i + 1] and period[i] == 1:
            fraction = difference[i] / (difference[i] - difference[i + 1])
            yield tuple((1.0 - fraction) * states[i] + fraction * states[i + 1])


def _certify_points(pair: GearPair, branch: xr.Dataset) -> list[dict]:
    """Certify the orbit at every regular branch point of a pair; return the certificates.

    `branch` is a dataset with the points of all branches. Special points, such as folds and period
    doublings, are skipped.
    """
    certificates = []
    for point in np.flatnonzero(branch.label.values == REGULAR):
        orbit = as_orbit(point_of_dataset(pair, branch, int(point), MAX_EVENTS).solution)
        certificates.append(_certify_orbit(orbit, orbit.tuning))
    return certificates


def write_json(certificates: Sequence[dict], path: Path) -> None:
    """Write certificates to a JSON file as a list with one certificate per line.

    The file is replaced atomically, so that readers never see an incomplete file.
    """
    lines = ",\n".join(json.dumps(certificate) for certificate in certificates)
    with atomic_write(path) as temporary:
        temporary.write_text(f"[\n{lines}\n]\n", encoding="utf-8")


def certificate_rows(certificates: Sequence[dict]) -> Iterator[list]:
    """Yield the rows of the table of certificates, beginning with the column names.

    `certificates` are the dicts of `certify_branches`; failed proofs and counts are skipped. The
    columns tuning and until are the first and the last tuning of a certified range. contacts is the
    sequence of contact states: D drive-side contact, F free flight, C coast-side contact. lowest is
    the minimum displacement in units of the static deflection.
    """
    yield ["damping", "claim", "tuning", "until", "contacts", "lowest", "stability", "reason"]
    for certificate in certificates:
        if certificate["claim"] in ("count", "refusal"):
            continue
        # Certificates of a range have the keys "start" and "stop" instead of "tuning".
        first_tuning = certificate.get("tuning", certificate.get("start"))
        contacts = "".join(_CONTACT_LETTERS[code] for code in certificate.get("pattern", ()))
        labels = [certificate[name] for name in ("damping", "gears") if name in certificate]
        tunings = _format_decimal(first_tuning), _format_decimal(certificate.get("stop"))
        min_displacement = _format_decimal(certificate.get("displacement_min"))
        cells = [", ".join(labels), certificate["claim"], *tunings, contacts, min_displacement]
        yield [*cells, certificate["stability"], certificate["reason"]]


def _format_decimal(value: str | Sequence[str] | None) -> str:
    """Format a number of a certificate as a decimal string; return "" for None.

    `value` is a hexadecimal float or an enclosure, a pair of decimal strings (lower and upper
    bound). Enclosures are far narrower than the 10 printed digits, so the lower bound is used.
    """
    if value is None:
        return ""
    number = float.fromhex(value) if isinstance(value, str) else float(value[0])
    return f"{number:.10g}"
