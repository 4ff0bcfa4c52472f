"""What the orbit in 50 digits confirms of a certificate, from its JSON alone.

It proves nothing; what it finds has to lie in the enclosures. The map of small deviations is by
differences.
"""

import math
import re

import numpy as np
from mpmath import lu_solve, matrix, mp, mpf, nstr

from tests.independent import program
from tests.independent.equations import Equations
from tests.independent.systems import system_of

mp.dps = 50
_NUMBER = re.compile(r"-?(0x[0-9a-f.]+p[+-]\d+|inf)")
#: Of what follows from the middle of a claim with 20 digits.
_ROOM = mpf(10) ** -17
#: A deviation, in static deflections.
_STEP = mpf(10) ** -24


def described(claim):
    """Return the description of the model of a claim, with exact numbers."""
    model = _exact(claim["pair"])
    for mesh in model.get("meshes", [model]):
        if "pitch_phase" in mesh:
            # Angles in turns are rounded once.
            mesh["pitch_phase"] = 2 * mp.pi * mpf(float(mesh["pitch_phase"]) / (2.0 * math.pi))
    if "bodies" not in model:
        return {"kind": "SixDegreePair"} | model if "inertias" in model else model
    derived = _exact(claim["derived"])
    omega = derived["reference_angular_frequency"]
    units = {"length": derived["static_deflection"], "omega": omega}
    phases = {name: derived[name] for name in ("phases", "inverse_phases")}
    return {"kind": "GearTrain", **model, **phases, "derived": units}


def _exact(value):
    if isinstance(value, dict):
        return {name: _exact(item) for name, item in value.items()}
    if isinstance(value, list):
        return [_exact(item) for item in value]
    known = isinstance(value, str) and _NUMBER.fullmatch(value)
    return mpf(float.fromhex(value)) if known else value


class Motion:
    """The motions of the model of a claim; coordinates and rates in static deflections."""

    def __init__(self, claim):
        self.claim = claim
        self.system = system_of(described(claim), _exact(claim["tuning"]), mp)
        self.equations = Equations(self.system.json(), mp)
        names, n = claim["coordinates"], self.system.n
        assert len(names) == n
        self.kept = [i for i, name in enumerate(names) if name not in claim["fixed"]]
        self.places = [*self.kept, *(n + i for i in self.kept)]
        boxes = [claim[name][i] for name in ("displacement", "velocity") for i in self.kept]
        #: of the boxes of the claim, kept coordinates and their rates
        self.middle = np.array([(mpf(low) + mpf(high)) / 2 for low, high in boxes], object)

    def reduced(self, state):
        """Return the kept coordinates and rates of a whole state, without the free motions."""
        system, n, halves = self.system, self.system.n, []
        fixed, total = [i for i in range(n) if i not in self.kept], system.stiffness
        for contact in system.contacts if fixed else ():
            row, high = contact["sides"][0]["row"], contact["sides"][0]["course"]["high"]
            total = total + high * np.outer(row, row)
        for half in (np.array(state[:n], object), np.array(state[n:], object)):
            part = half[self.kept]
            if fixed:
                inner = matrix(total[np.ix_(self.kept, self.kept)].tolist())
                pulled = matrix((total[np.ix_(self.kept, fixed)] @ half[fixed]).tolist())
                part = part + np.array(list(lu_solve(inner, pulled)), object)
            halves.append(part)
        return np.concatenate(halves)

    def run(self, state, period=None):
        """Return (kept coordinates and rates at the end, events) from a state of such."""
        whole = [mpf(0)] * (2 * self.system.n)
        for place, value in zip(self.places, state, strict=True):
            whole[place] = value
        period, codes = period or self.claim["period"], self.claim["contacts"]
        motion = program.move(self.equations, period, whole, codes=codes)
        return self.reduced(motion.state), motion.events

    def deviation(self, end, state, way):
        """Return what a small deviation of a state becomes."""
        return (self.run(state + _STEP * way)[0] - end) / _STEP

    def orbit(self):
        """Return (state, events, map): a step of Newton from the middle of the claim's boxes."""
        events = self.run(self.middle)[1]
        flow = lambda state: self.run(state)[0]  # noqa: E731
        end, slopes = program.period_map(flow, self.middle, _STEP)
        step = lu_solve(slopes - mp.eye(len(end)), matrix((end - self.middle).tolist()))
        return self.middle - np.array(list(step), object), events, slopes

    def _contacts(self, events):
        """Return ([(event, what is listed)], ["contacts"] if they do not belong together)."""
        model = self.claim["pair"]
        names = [mesh["name"] for mesh in model["meshes"]] if "meshes" in model else ["mesh"]
        # At one phase, to rounding, the order says nothing.
        events = sorted(events, key=lambda event: (nstr(event.phase, 15), names[event.contact]))
        listed = [event | {"mesh": event.get("mesh", "mesh")} for event in self.claim["events"]]
        listed.sort(key=lambda event: (nstr(mpf(event["phase"][0]), 15), event["mesh"]))
        changes = [(names[event.contact], event.before, event.after) for event in events]
        if changes != [(event["mesh"], event["before"], event["after"]) for event in listed]:
            return [], ["contacts"]
        return list(zip(events, listed, strict=True)), []

    def faults(self, orbit):
        """Return what of an orbit does not lie in the enclosures of the claim."""
        (state, events, slopes), claim, wrong = orbit, self.claim, []
        for name, values in zip(("displacement", "velocity"), np.split(state, 2), strict=True):
            boxes = [claim[name][i] for i in self.kept]
            inside = [_holds(box, v) for box, v in zip(boxes, values, strict=True)]
            wrong += [] if all(inside) else [name]
        listed, missing = self._contacts(events)
        if missing:
            return [*wrong, *missing]
        for event, box in listed:
            wrong += [] if _holds(box["phase"], event.phase, _ROOM) else ["phase"]
            wrong += [] if _holds(box["velocity"], event.own_rate, _ROOM) else ["speed"]
        roots, boxes = program.multipliers(slopes), list(claim["multipliers"])
        for root in roots:
            near = [
                (real, imaginary)
                for real, imaginary in boxes
                if _holds(real, root.real, _ROOM) and _holds(imaginary, root.imag, _ROOM)
            ]
            if not near:
                wrong.append("multiplier")
                break
            boxes.remove(list(near[0]))
        outside = max(map(abs, roots)) > 1
        return wrong if (claim["stability"] == "unstable") == outside else [*wrong, "stability"]


def faults(claim):
    """Return what this program cannot confirm of a claim, a list of words."""
    motion = Motion(claim)
    return motion.faults(motion.orbit())


def _holds(box, value, room=0):
    """Return whether an enclosure, widened by some room, holds a value."""
    return mpf(box[0]) - room <= value <= mpf(box[1]) + room
