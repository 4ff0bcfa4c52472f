"""Check certificates against orbits in 50 digits, from their JSON alone.

The orbits prove nothing; they have to lie in the enclosures. The monodromy matrix follows from
differences.

    python -m tests.independent.certificates results/certificates.json
"""

import json
import math
import re
import sys
from itertools import pairwise

import numpy as np
from mpmath import lu_solve, matrix, mp, mpf, nstr

from tests.independent import program
from tests.independent.equations import Equations
from tests.independent.systems import system_of

mp.dps = 50
_HEXADECIMAL = re.compile(r"-?(0x[0-9a-f.]+p[+-]\d+|inf)")
#: Error of values that follow from the centre of a box with 20 digits.
_ROUNDING = mpf(10) ** -17
#: Deviation of a state for differences, in static deflections.
_STEP = mpf(10) ** -24


def model_of(claim):
    """Return the description of the model of a claim, with exact numbers."""
    model = _exact(claim["pair"])
    for mesh in model.get("meshes", [model]):
        if "pitch_phase" in mesh:
            # Angles in turns are rounded once.
            mesh["pitch_phase"] = 2 * mp.pi * mpf(float(mesh["pitch_phase"]) / (2.0 * math.pi))
    if "bodies" not in model:
        return {"kind": "SixDegreePair" if "inertias" in model else "GearPair"} | model
    derived = _exact(claim["derived"])
    omega = derived["reference_angular_frequency"]
    units = {"length": derived["static_deflection"], "omega": omega}
    phases = {name: derived[name] for name in ("phases", "inverse_phases")}
    return {"kind": "GearTrain", **model, **phases, "derived": units}


def _exact(value):
    """Return a JSON value with its hexadecimal floats as numbers of many digits."""
    if isinstance(value, dict):
        return {name: _exact(item) for name, item in value.items()}
    if isinstance(value, list):
        return [_exact(item) for item in value]
    is_number = isinstance(value, str) and _HEXADECIMAL.fullmatch(value)
    return mpf(float.fromhex(value)) if is_number else value


def _with_coordinates(claim):
    """Return the claim of one degree of freedom in the form of a train's, with one coordinate."""
    if "coordinates" in claim:
        return claim
    boxes = {name: [claim[name]] for name in ("displacement", "velocity")}
    contacts = [claim["pattern"][0]]
    return claim | boxes | {"coordinates": ["x"], "fixed": [], "contacts": contacts}


class Motion:
    """Motions of the model of a claim; coordinates and velocities in static deflections."""

    def __init__(self, claim):
        self.claim = claim = _with_coordinates(claim)
        self.system = system_of(model_of(claim), _exact(claim["tuning"]), mp)
        self.equations = Equations(self.system.json(), mp)
        names, n = claim["coordinates"], self.system.n
        assert len(names) == n
        self.kept = [i for i, name in enumerate(names) if name not in claim["fixed"]]
        self.places = [*self.kept, *(n + i for i in self.kept)]
        boxes = [claim[name][i] for name in ("displacement", "velocity") for i in self.kept]
        #: Centres of the boxes of kept coordinates and their velocities.
        self.middle = np.array([(mpf(low) + mpf(high)) / 2 for low, high in boxes], object)

    def reduced(self, state):
        """Return the kept coordinates and velocities of a state, without rigid-body motion."""
        system, n, halves = self.system, self.system.n, []
        fixed, total = [i for i in range(n) if i not in self.kept], system.stiffness
        for contact in system.contacts if fixed else ():
            row, high = contact["sides"][0]["row"], contact["sides"][0]["course"]["high"]
            total = total + high * np.outer(row, row)
        for half in (np.array(state[:n], object), np.array(state[n:], object)):
            kept = half[self.kept]
            if fixed:
                inner = matrix(total[np.ix_(self.kept, self.kept)].tolist())
                pulled = matrix((total[np.ix_(self.kept, fixed)] @ half[fixed]).tolist())
                kept = kept + np.array(list(lu_solve(inner, pulled)), object)
            halves.append(kept)
        return np.concatenate(halves)

    def move(self, state, period=None, recorded=0):
        """Return the motion over some mesh periods from kept coordinates and velocities.

        Extrema are those of the last `recorded` periods.
        """
        full_state = [mpf(0)] * (2 * self.system.n)
        for place, value in zip(self.places, state, strict=True):
            full_state[place] = value
        options = {"recorded": recorded, "codes": self.claim["contacts"]}
        return program.move(self.equations, period or self.claim["period"], full_state, **options)

    def run(self, state, period=None):
        """Return (state at the end, events); states are kept coordinates and velocities."""
        motion = self.move(state, period)
        return self.reduced(motion.state), motion.events

    def deviation(self, end, state, direction):
        """Return the deviation at the end that a unit deviation of the start leads to."""
        return (self.run(state + _STEP * direction)[0] - end) / _STEP

    def orbit(self, iterations=1):
        """Return (state, last motion, monodromy matrix) by Newton steps from the boxes' centre."""
        state = self.middle
        recorded = self.claim["period"] if "displacement_min" in self.claim else 0
        for _ in range(iterations):
            motion = self.move(state, recorded=recorded)
            end = self.reduced(motion.state)
            directions = np.eye(len(end), dtype=int)
            columns = [self.deviation(end, state, direction).tolist() for direction in directions]
            slopes = matrix(columns).T
            step = lu_solve(slopes - mp.eye(len(end)), matrix((end - state).tolist()))
            state = state - np.array(list(step), object)
        return state, motion, slopes

    def repeats_earlier(self):
        """Return whether the orbit repeats after fewer mesh periods than the claim says."""
        period = self.claim["period"]
        divisors = [n for n in range(1, period) if period % n == 0]
        ends = [self.run(self.middle, n)[0] for n in divisors]
        return any(max(abs(end - self.middle)) < 1e-9 for end in ends)

    def _matched_events(self, events):
        """Return pairs (event, event of the claim); None if their contacts differ."""
        model = self.claim["pair"]
        names = [mesh["name"] for mesh in model["meshes"]] if "meshes" in model else ["mesh"]
        # Events at one phase, to rounding, have no order.
        events = sorted(events, key=lambda event: (nstr(event.phase, 15), names[event.contact]))
        listed = [event | {"mesh": event.get("mesh", "mesh")} for event in self.claim["events"]]
        listed.sort(key=lambda event: (nstr(mpf(event["phase"][0]), 15), event["mesh"]))
        changes = [(names[event.contact], event.before, event.after) for event in events]
        if changes != [(event["mesh"], event["before"], event["after"]) for event in listed]:
            return None
        return list(zip(events, listed, strict=True))

    def faults(self, orbit):
        """Return the names of the enclosures that do not hold an orbit, as `orbit` returns it."""
        (state, motion, slopes), claim, wrong = orbit, self.claim, []
        for name, values in zip(("displacement", "velocity"), np.split(state, 2), strict=True):
            boxes = [claim[name][i] for i in self.kept]
            inside = [_holds(box, v) for box, v in zip(boxes, values, strict=True)]
            wrong += [] if all(inside) else [name]
        matched = self._matched_events(motion.events)
        if matched is None:
            return [*wrong, "contacts"]
        for event, box in matched:
            wrong += [] if _holds(box["phase"], event.phase, _ROUNDING) else ["phase"]
            wrong += [] if _holds(box["velocity"], event.own_rate, _ROUNDING) else ["speed"]
        roots, boxes = program.multipliers(slopes), list(claim["multipliers"])
        for root in roots:
            near = [
                (real, imaginary)
                for real, imaginary in boxes
                if _holds(real, root.real, _ROUNDING) and _holds(imaginary, root.imag, _ROUNDING)
            ]
            if not near:
                wrong.append("multiplier")
                break
            boxes.remove(list(near[0]))
        if "displacement_min" in claim:
            (heights,) = motion.record.heights
            limits = {"displacement_min": min(heights), "displacement_max": max(heights)}
            wrong += [name for name, x in limits.items() if not _holds(claim[name], x, _ROUNDING)]
        wrong += ["period"] if self.repeats_earlier() else []
        return wrong if _is_judged_right(claim["stability"], roots) else [*wrong, "stability"]


def _is_judged_right(stability, multipliers):
    """Return whether multipliers bear out a verdict; undecided: all lie on the unit circle."""
    largest = max(map(abs, multipliers))
    if abs(largest - 1) < _ROUNDING:
        return stability == "undecided"
    return stability == ("unstable" if largest > 1 else "stable")


def _holds(box, value, room=0):
    """Return whether an enclosure, widened by some room, holds a value."""
    return mpf(box[0]) - room <= value <= mpf(box[1]) + room


def _range_faults(claim):
    """Return the faults of a range of tunings: at both ends of each piece."""
    pieces = _exact(claim["pieces"])
    ends = [(piece["start"], piece["stop"]) for piece in pieces]
    start, stop = _exact(claim["start"]), _exact(claim["stop"])
    joined = all(left[1] == right[0] for left, right in pairwise(ends))
    if not joined or (ends[0][0], ends[-1][1]) != (start, stop):
        return ["cuts"]
    if not all(low < high for low, high in ends):
        return ["order"]
    wrong, last_state = [], None
    for piece in pieces:
        faults, state = _point_faults(claim, piece, piece["start"])
        if last_state is not None and max(abs(state - last_state)) > 1e-20:
            wrong.append("branch")
        more_faults, last_state = _point_faults(claim, piece, piece["stop"])
        wrong += faults + more_faults
    return sorted({*wrong})


def _point_faults(claim, piece, tuning):
    """Return (faults, state of the orbit) at one tuning of a piece."""
    (x, velocity, *_), codes = piece["centre"], claim["pattern"]
    point = {"tuning": tuning, "displacement": [x, x], "velocity": [velocity / tuning] * 2}
    state, motion, slopes = Motion(claim | point).orbit(iterations=4)
    events = motion.events
    values = [state[0], state[1] * tuning, *(event.phase for event in events)]
    changes = [*zip(codes, codes[1:], strict=False)]
    if [(event.before, event.after) for event in events] != changes:
        return ["contacts"], state
    boxes = zip(piece["centre"], piece["radii"], values, strict=True)
    faults = [] if all(abs(value - c) <= r for c, r, value in boxes) else ["box"]
    right = _is_judged_right(claim["stability"], program.multipliers(slopes))
    return faults + ([] if right else ["stability"]), state


def faults(claim):
    """Return what the orbits in 50 digits refute of a claim of any kind, a list of words."""
    if claim["claim"] == "range":
        return _range_faults(claim)
    motion = Motion(claim)
    return motion.faults(motion.orbit())


def main(path):
    """Print the faults of a file of certificates; return how many claims have any."""
    with open(path, encoding="utf-8") as file:
        claims = [row for row in json.load(file) if row["claim"] not in ("count", "refusal")]
    wrong = 0
    for claim in claims:
        refuted = faults(claim)
        wrong += bool(refuted)
        if refuted:
            tuning = claim.get("tuning", claim.get("start"))
            print(claim["damping"], claim["claim"], tuning, *refuted)
    print(f"{len(claims) - wrong} of {len(claims)} claims are confirmed")
    return wrong


if __name__ == "__main__":
    sys.exit(bool(main(sys.argv[1])))
