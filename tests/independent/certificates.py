"""Check certificates against orbits in 50 digits, from their JSON alone.

The orbits prove nothing; they have to lie in the enclosures. The monodromy matrix follows from
differences.

    python -m tests.independent.certificates results/certificates.json
"""

import json
import math
import sys
from itertools import pairwise

import numpy as np
from mpmath import eig, eye, matrix, mp, mpf, nstr

from tests.independent import program
from tests.independent.assembly import with_numbers_of
from tests.independent.equations import Equations
from tests.independent.systems import system_of

mp.dps = 50
#: Error of values that follow from the centre of a box with 20 digits.
_ROUNDING = mpf(10) ** -17
#: Deviation of a state for differences, in static deflections.
_STEP = mpf(10) ** -24


def model_of(claim):
    """Return the description of the model of a claim, with exact numbers."""
    model = with_numbers_of(mp, claim["pair"])
    for mesh in model.get("meshes", [model]):
        if "pitch_phase" in mesh:
            # Angles in turns are rounded once.
            mesh["pitch_phase"] = 2 * mp.pi * mpf(float(mesh["pitch_phase"]) / (2.0 * math.pi))
    if "bodies" not in model:
        return {"kind": "SixDegreePair" if "inertias" in model else "GearPair"} | model
    derived = with_numbers_of(mp, claim["derived"])
    omega = derived["reference_angular_frequency"]
    units = {"length": derived["static_deflection"], "omega": omega}
    return {"kind": "GearTrain", **model, **derived, "derived": units}


class Motion:
    """Motions of the model of a claim; coordinates and velocities in static deflections."""

    def __init__(self, claim):
        if "coordinates" not in claim:
            # One degree of freedom, in the form of a train of one coordinate.
            boxes = {name: [claim[name]] for name in ("displacement", "velocity")}
            boxes |= {"coordinates": ["x"], "fixed": [], "contacts": claim["pattern"][:1]}
            claim = claim | boxes
        self.claim, tuning = claim, with_numbers_of(mp, claim["tuning"])
        system = system_of(model_of(claim), tuning, mp)
        self.equations, names = Equations(system), claim["coordinates"]
        assert len(names) == system.n
        self.kept = [i for i, name in enumerate(names) if name not in claim["fixed"]]
        boxes = [claim[name][i] for name in ("displacement", "velocity") for i in self.kept]
        #: Centres of the boxes of kept coordinates and their velocities.
        self.middle = [(mpf(low) + mpf(high)) / 2 for low, high in boxes]
        stiffness = system.stiffness
        for drive, *_ in (contact["sides"] for contact in system.contacts):
            stiffness = stiffness + drive["course"]["high"] * np.outer(drive["row"], drive["row"])
        inner = matrix(stiffness[np.ix_(self.kept, self.kept)].tolist()) ** -1
        #: Kept coordinates without rigid-body motion are this matrix times all coordinates.
        self.reduction = np.array(inner.tolist()) @ stiffness[self.kept]

    def move(self, state, period=None, recorded=0):
        """Return (end, motion) over some mesh periods from kept coordinates and velocities.

        Extrema are those of the last `recorded` periods.
        """
        full = np.full((2, self.equations.n), mpf(0))
        full[:, self.kept] = np.reshape(state, (2, -1))
        options = {"recorded": recorded, "codes": self.claim["contacts"]}
        periods = period or self.claim["period"]
        motion = program.move(self.equations, periods, full.ravel(), **options)
        halves = np.split(np.array(motion.state), 2)
        return np.concatenate([self.reduction @ half for half in halves]), motion

    def orbit(self, iterations=1):
        """Return (state, last motion, multipliers) by Newton steps from the boxes' centre."""

        def change(state):
            return self.move(state)[0] - state

        state, slopes = program.newton(change, self.middle, _STEP, iterations)
        recorded = self.claim["period"] if "displacement_min" in self.claim else 0
        multipliers = eig(slopes + eye(len(state)), left=False, right=False)
        return state, self.move(state, recorded=recorded)[1], multipliers

    def repeats_earlier(self):
        """Return whether the orbit repeats after fewer mesh periods than the claim says."""
        period = self.claim["period"]
        ends = [self.move(self.middle, n)[0] for n in range(1, period) if period % n == 0]
        return any(max(abs(end - self.middle)) < 1e-9 for end in ends)

    def _matched_events(self, events):
        """Return pairs (event, event of the claim); None if their contacts differ."""
        names = [mesh["name"] for mesh in self.claim["pair"].get("meshes", [{"name": "mesh"}])]
        # Events at one phase, to rounding, have no order.
        events = sorted(events, key=lambda event: (nstr(event.phase, 15), names[event.contact]))
        listed = [{"mesh": "mesh"} | event for event in self.claim["events"]]
        listed.sort(key=lambda event: (nstr(mpf(event["phase"][0]), 15), event["mesh"]))
        changes = [(names[event.contact], event.before, event.after) for event in events]
        if changes != [(event["mesh"], event["before"], event["after"]) for event in listed]:
            return None
        return list(zip(events, listed, strict=True))

    def faults(self, orbit):
        """Return the names of the enclosures that do not hold an orbit, as `orbit` returns it."""
        (state, motion, multipliers), claim, wrong = orbit, self.claim, []
        for name, values in zip(("displacement", "velocity"), np.split(state, 2), strict=True):
            boxes = [claim[name][i] for i in self.kept]
            inside = map(_holds, boxes, values)
            wrong += [] if all(inside) else [name]
        matched = self._matched_events(motion.events)
        if matched is None:
            return [*wrong, "contacts"]
        for event, box in matched:
            wrong += [] if _holds(box["phase"], event.phase, _ROUNDING) else ["phase"]
            wrong += [] if _holds(box["velocity"], event.own_rate, _ROUNDING) else ["speed"]
        boxes = list(claim["multipliers"])
        for root in multipliers:
            near = [
                box
                for box in boxes
                if all(map(_holds, box, (root.real, root.imag), [_ROUNDING] * 2))
            ]
            if not near:
                wrong.append("multiplier")
                break
            boxes.remove(near[0])
        if "displacement_min" in claim:
            (heights,) = motion.record.heights
            limits = {"displacement_min": min(heights), "displacement_max": max(heights)}
            wrong += [name for name, x in limits.items() if not _holds(claim[name], x, _ROUNDING)]
        wrong += ["period"] if self.repeats_earlier() else []
        return wrong if _is_judged_right(claim["stability"], multipliers) else [*wrong, "stability"]


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
    claim = claim | {name: with_numbers_of(mp, claim[name]) for name in ("pieces", "start", "stop")}
    ends = [(piece["start"], piece["stop"]) for piece in claim["pieces"]]
    joined = all(left[1] == right[0] for left, right in pairwise(ends))
    if not joined or (ends[0][0], ends[-1][1]) != (claim["start"], claim["stop"]):
        return ["cuts"]
    if not all(low < high for low, high in ends):
        return ["order"]
    wrong, last_state = [], None
    for piece in claim["pieces"]:
        faults, state = _point_faults(claim, piece, piece["start"])
        if last_state is not None and max(map(abs, np.subtract(state, last_state))) > 1e-20:
            wrong.append("branch")
        more_faults, last_state = _point_faults(claim, piece, piece["stop"])
        wrong += faults + more_faults
    return sorted({*wrong})


def _point_faults(claim, piece, tuning):
    """Return (faults, state of the orbit) at one tuning of a piece."""
    (x, velocity, *_), codes = piece["centre"], claim["pattern"]
    point = {"tuning": tuning, "displacement": [x, x], "velocity": [velocity / tuning] * 2}
    state, motion, multipliers = Motion(claim | point).orbit(iterations=4)
    events = motion.events
    values = [state[0], state[1] * tuning, *(event.phase for event in events)]
    if [(event.before, event.after) for event in events] != list(pairwise(codes)):
        return ["contacts"], state
    boxes = zip(piece["centre"], piece["radii"], values, strict=True)
    faults = [] if all(abs(value - c) <= r for c, r, value in boxes) else ["box"]
    right = _is_judged_right(claim["stability"], multipliers)
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
        if refuted := faults(claim):
            wrong += 1
            tuning = claim.get("tuning", claim.get("start"))
            print(claim["damping"], claim["claim"], tuning, *refuted)
    print(f"{len(claims) - wrong} of {len(claims)} claims are confirmed")
    return wrong


if __name__ == "__main__":
    sys.exit(bool(main(sys.argv[1])))
