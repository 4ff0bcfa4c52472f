"""The second program on trains: the orbit in 50 digits, by the second code of `tests.references`.

From the JSON of a claim alone; it shares no code with gearlib. It proves nothing; what it finds has
to lie in the enclosures. The map of small deviations is by differences.
"""

import math
import re

import numpy as np
from mpmath import eig, lu_solve, matrix, mp, mpf, nstr

from tests.references.reference_equations import machine_of
from tests.references.reference_motion import move

mp.dps = 50
_NUMBER = re.compile(r"-?(0x[0-9a-f.]+p[+-]\d+|inf)")
#: Of what follows from the middle of a claim with 20 digits.
_ROOM = mpf(10) ** -17
#: A deviation, in static deflections.
_STEP = mpf(10) ** -24


def described(claim):
    """Return the model of a claim as `tests.references` has it, with exact numbers."""
    model = _exact(claim["pair"])
    for one in model.get("meshes", [model]):
        if "pitch_phase" in one:
            # Angles in turns are rounded once.
            turns = mpf(float(one["pitch_phase"]) / (2.0 * math.pi))
            one["pitch_phase"] = 2 * mp.pi * turns
    if "bodies" not in model:
        return {"kind": "SixDegreePair"} | model if "inertias" in model else model
    given = _exact(claim["derived"])
    units = {"length": given["static_deflection"], "omega": given["reference_angular_frequency"]}
    phases = {name: given[name] for name in ("phases", "inverse_phases")}
    return {"kind": "GearTrain", **model, **phases, "derived": units}


def _exact(value):
    if isinstance(value, dict):
        return {name: _exact(one) for name, one in value.items()}
    if isinstance(value, list):
        return [_exact(one) for one in value]
    known = isinstance(value, str) and _NUMBER.fullmatch(value)
    return mpf(float.fromhex(value)) if known else value


class Motion:
    """The motions of the train of a claim; coordinates and rates in static deflections."""

    def __init__(self, claim):
        self.claim, self.model, self.nu = claim, described(claim), _exact(claim["tuning"])
        self.machine = machine_of(self.model, self.nu, mp)
        names = claim["coordinates"]
        assert len(names) == self.machine.n
        self.kept = [i for i, name in enumerate(names) if name not in claim["fixed"]]
        boxes = [claim[name][i] for name in ("displacement", "velocity") for i in self.kept]
        #: of the boxes of the claim, kept coordinates and their rates
        self.middle = np.array([(mpf(low) + mpf(high)) / 2 for low, high in boxes], object)

    def reduced(self, state):
        """Return the kept coordinates and rates of a whole state, without the free motions."""
        machine, n = self.machine, self.machine.n
        fixed, total = [i for i in range(n) if i not in self.kept], machine.stiffness
        for contact in machine.contacts if fixed else ():
            row = contact.drive.row
            total = total + contact.drive.course.high * np.outer(row, row)
        inner, found = matrix(total[np.ix_(self.kept, self.kept)].tolist()), []
        for half in (np.array(state[:n], object), np.array(state[n:], object)):
            part = half[self.kept]
            for j in fixed:
                free = lu_solve(inner, matrix((-total[self.kept, j]).tolist()))
                part = part - np.array(list(free), object) * half[j]
            found.append(part)
        return np.concatenate(found)

    def run(self, state, period=None):
        """Return (kept coordinates and rates at the end, events) from a state of such."""
        machine, n, e = self.machine, self.machine.n, len(self.kept)
        whole = machine.zeros(2 * n)
        whole[self.kept], whole[[n + i for i in self.kept]] = state[:e], state[e:]
        period, codes = period or self.claim["period"], list(self.claim["contacts"])
        found = move(self.model, self.nu, period, whole, mp, codes=codes)
        return self.reduced(found.state), found.events

    def deviation(self, end, state, way):
        """Return what a small deviation of a state becomes."""
        return (self.run(state + _STEP * way)[0] - end) / _STEP

    def slopes(self, end, state):
        """Return the map of small deviations."""
        unit = np.array([[mpf(int(i == j)) for i in range(len(state))] for j in range(len(state))])
        return matrix(np.array([self.deviation(end, state, way) for way in unit]).T.tolist())

    def orbit(self):
        """Return (state, events, map): a step of Newton from the middle of the claim's boxes."""
        end, events = self.run(self.middle)
        slopes = self.slopes(end, self.middle)
        step = lu_solve(slopes - mp.eye(len(end)), matrix((end - self.middle).tolist()))
        return self.middle - np.array(list(step), object), events, slopes

    def _contacts(self, events):
        """Return ([(event, what is listed)], ["contacts"] if they do not belong together)."""
        model = self.claim["pair"]
        names = [mesh["name"] for mesh in model["meshes"]] if "meshes" in model else ["mesh"]
        # At one phase, to rounding, the order says nothing.
        events = sorted(events, key=lambda one: (nstr(one.phase, 15), names[one.contact]))
        listed = [one | {"mesh": one.get("mesh", "mesh")} for one in self.claim["events"]]
        listed.sort(key=lambda one: (nstr(mpf(one["phase"][0]), 15), one["mesh"]))
        own = [(names[one.contact], one.before, one.after) for one in events]
        if own != [(one["mesh"], one["before"], one["after"]) for one in listed]:
            return [], ["contacts"]
        return list(zip(events, listed, strict=True)), []

    def faults(self, found):
        """Return what of an orbit does not lie in the enclosures of the claim."""
        (state, events, slopes), claim, wrong = found, self.claim, []
        for name, values in zip(("displacement", "velocity"), np.split(state, 2), strict=True):
            boxes = [claim[name][i] for i in self.kept]
            inside = [_holds(box, v) for box, v in zip(boxes, values, strict=True)]
            wrong += [] if all(inside) else [name]
        listed, missing = self._contacts(events)
        if missing:
            return [*wrong, *missing]
        for one, event in listed:
            wrong += [] if _holds(event["phase"], one.phase, _ROOM) else ["phase"]
            wrong += [] if _holds(event["velocity"], one.own_rate, _ROOM) else ["speed"]
        multipliers, boxes = eig(slopes, left=False, right=False), list(claim["multipliers"])
        for one in multipliers:
            parts = one.real, one.imag
            own = [
                box
                for box in boxes
                if all(_holds(*pair, _ROOM) for pair in zip(box, parts, strict=True))
            ]
            if not own:
                wrong.append("multiplier")
                break
            boxes.remove(own[0])
        outside = max(abs(one) for one in multipliers) > 1
        return wrong if (claim["stability"] == "unstable") == outside else [*wrong, "stability"]


def faults(claim):
    """Return what this program cannot confirm of a claim about a train, a list of words."""
    motion = Motion(claim)
    return motion.faults(motion.orbit())


def _holds(box, value, room=0):
    """Return whether an enclosure, widened by some room, holds a value."""
    return mpf(box[0]) - room <= value <= mpf(box[1]) + room
