"""Check certificates against orbits in 50 digits, from their JSON alone.

The orbits prove nothing; they have to lie in the enclosures. The monodromy matrix follows from
differences.

    python -m tests.independent.certificates results/certificates.json
"""

import json
import math
import sys
from itertools import pairwise, product

import numpy as np
from mpmath import mp, mpf, nstr

from tests.independent import program
from tests.independent.equations import Equations, exact
from tests.independent.systems import system_of

mp.dps = 50
#: Error of values that follow from the centre of an enclosure with 20 digits.
_ROUNDING = mpf(10) ** -17


def model_of(claim):
    """Return the description of the model of a claim, with exact numbers."""
    model = exact(mp, claim["model"])
    for mesh in model.get("meshes", [model]):
        if "pitch_phase" in mesh:
            # The library rounds angles in turns once, and so does this program.
            mesh["pitch_phase"] = 2 * mp.pi * mpf(float(mesh["pitch_phase"]) / (2.0 * math.pi))
    if "bodies" not in model:
        return {"kind": "SixDegreePair" if "inertias" in model else "GearPair"} | model
    derived = exact(mp, claim["derived"])
    length, omega = derived["static_deflection"], derived["reference_angular_frequency"]
    units = {"length": length, "omega": omega}
    return {"kind": "GearTrain", **model, **derived, "derived": units}


class Motion:
    """Motions of the model of a claim, with coordinates and velocities in static deflections."""

    def __init__(self, claim):
        if "coordinates" not in claim:
            # One degree of freedom, in the form of a train of one coordinate.
            enclosures = {name: [claim[name]] for name in ("displacement", "velocity")}
            enclosures |= {"coordinates": ["x"], "fixed": [], "contacts": claim["pattern"][:1]}
            claim = claim | enclosures
        self.claim, tuning = claim, exact(mp, claim["tuning"])
        system = system_of(model_of(claim), tuning, mp)
        self.equations, names = Equations(system), claim["coordinates"]
        assert len(names) == system.n
        self.free_coordinates = [i for i, name in enumerate(names) if name not in claim["fixed"]]
        stiffness = system.stiffness
        for drive, *_ in (contact["sides"] for contact in system.contacts):
            stiffness = stiffness + drive["profile"]["threshold"] * np.outer(
                drive["row"], drive["row"]
            )
        free_stiffness = stiffness[np.ix_(self.free_coordinates, self.free_coordinates)]
        stiffness_inverse = mp.matrix(free_stiffness.tolist()) ** -1
        #: Free coordinates without rigid-body motion are this matrix times all coordinates.
        self.reduction = np.array(stiffness_inverse.tolist()) @ stiffness[self.free_coordinates]

    def enclosures(self):
        """Return the claimed enclosures of the free coordinates and of their velocities."""
        return [
            self.claim[name][i]
            for name in ("displacement", "velocity")
            for i in self.free_coordinates
        ]

    def move(self, state, period=None, recorded=0):
        """Return (final state, motion) over some mesh periods from free coordinates and velocities.

        `period` is the number of mesh periods, by default the period of the claim. Extrema are
        taken over the last `recorded` periods.
        """
        full, periods = np.full((2, self.equations.n), mpf(0)), period or self.claim["period"]
        full[:, self.free_coordinates] = np.reshape(state, (2, -1))
        options = {"recorded": recorded, "contact_states": self.claim["contacts"]}
        motion = program.move(self.equations, periods, full.ravel(), **options)
        reduced_state = np.reshape(motion.state, (2, -1)) @ self.reduction.T
        return reduced_state.ravel(), motion

    def orbit(self, iterations=1):
        """Return (state, motion, multipliers) of the orbit by Newton's method from the centres."""
        centres = [(mpf(low) + mpf(high)) / 2 for low, high in self.enclosures()]

        def change(*state):
            """Return the change of the state over the period."""
            return self.move(state)[0] - state

        state, slopes = program.newton(change, centres, iterations)
        recorded = self.claim["period"] if "displacement_min" in self.claim else 0
        multipliers = mp.eig(slopes + mp.eye(len(state)), left=False, right=False)
        return state, self.move(state, recorded=recorded)[1], multipliers

    def find_contradictions(self, orbit):
        """Return the sorted names of the parts of the claim that `orbit` contradicts.

        `orbit` is a result of the method of this name.
        """
        claim, (state, motion, multipliers), n = self.claim, orbit, len(self.free_coordinates)
        meshes = claim["model"].get("meshes", [{"name": "mesh"}])
        events = [(meshes[e.contact]["name"], e.before, e.after, e) for e in motion.events]
        claimed_events = [
            (e.get("mesh", "mesh"), e["before"], e["after"], e) for e in claim["events"]
        ]
        # Events at equal phases, up to rounding, have no order.
        events.sort(key=lambda row: (nstr(row[3].phase, 15), row[0]))
        claimed_events.sort(key=lambda row: (nstr(mpf(row[3]["phase"][0]), 15), row[0]))
        if [row[:3] for row in events] != [row[:3] for row in claimed_events]:
            return ["contacts"]
        names = ["displacement"] * n + ["velocity"] * n
        rows = zip(names, self.enclosures(), state, strict=True)
        checks = [(name, _contains(enclosure, value, margin=0)) for name, enclosure, value in rows]
        for (*_, event), (*_, enclosure) in zip(events, claimed_events, strict=True):
            checks.append(("phase", _contains(enclosure["phase"], event.phase)))
            checks.append(("speed", _contains(enclosure["velocity"], event.side_rate)))
        for name, extremum in (("displacement_min", min), ("displacement_max", max)):
            if name in claim:
                checks.append(
                    (name, _contains(claim[name], extremum(motion.record.displacements[0])))
                )
        is_inside = [
            [all(map(_contains, enclosure, (root.real, root.imag))) for root in multipliers]
            for enclosure in claim["multipliers"]
        ]
        # Each enclosure contains a multiplier, and each multiplier lies in an enclosure.
        checks += [("multiplier", np.any(is_inside, axis=axis).all()) for axis in (0, 1)]
        shorter_periods = [p for p in range(1, claim["period"]) if claim["period"] % p == 0]
        repeats = [max(abs(self.move(state, p)[0] - state)) < 1e-9 for p in shorter_periods]
        checks += [("period", not any(repeats))]
        checks += [("stability", _is_verdict_correct(claim["stability"], multipliers))]
        return sorted({name for name, holds in checks if not holds})


def _is_verdict_correct(stability, multipliers):
    """Return whether multipliers confirm a verdict on stability.

    The verdict must be "undecided" if all multipliers lie on the unit circle.
    """
    largest = max(map(abs, multipliers))
    if abs(largest - 1) < _ROUNDING:
        return stability == "undecided"
    return stability == ("unstable" if largest > 1 else "stable")


def _contains(enclosure, value, margin=_ROUNDING):
    """Return whether an enclosure, widened by `margin` on both sides, contains a value."""
    return mpf(enclosure[0]) - margin <= value <= mpf(enclosure[1]) + margin


def _find_range_contradictions(claim):
    """Return the contradicted parts of a claimed range, checked at both ends of each piece."""
    claim = claim | {name: exact(mp, claim[name]) for name in ("pieces", "start", "stop")}
    ends = [(piece["start"], piece["stop"]) for piece in claim["pieces"]]
    joined = all(left[1] == right[0] for left, right in pairwise(ends))
    if not joined or (ends[0][0], ends[-1][1]) != (claim["start"], claim["stop"]):
        return ["cuts"]
    if not all(low < high for low, high in ends):
        return ["order"]
    if any(len(piece["centre"]) != len(claim["pattern"]) + 1 for piece in claim["pieces"]):
        return ["contacts"]
    contradicted_parts, states = set(), []
    for piece, end in product(claim["pieces"], ("start", "stop")):
        motion = Motion(claim | _claim_at(claim["pattern"], piece, piece[end]))
        orbit = motion.orbit(iterations=4)
        contradicted_parts |= set(motion.find_contradictions(orbit))
        states.append(orbit[0])
    # Two neighbouring pieces must have the same orbit at their common tuning.
    if not np.all(abs(np.subtract(states[1:-1:2], states[2::2])) < 1e-20):
        contradicted_parts.add("branch")
    return sorted(contradicted_parts)


def _claim_at(pattern, piece, tuning):
    """Return the claim about the orbit at one tuning within a piece of a range."""
    rows = zip(piece["centre"], piece["radii"], strict=True)
    x, (lower_velocity, upper_velocity), *phases = [(c - r, c + r) for c, r in rows]
    velocity, unbounded = (lower_velocity / tuning, upper_velocity / tuning), (-math.inf, math.inf)
    point = {"tuning": tuning, "displacement": x, "velocity": velocity, "events": []}
    for phase, (before, after) in zip(phases, pairwise(pattern), strict=True):
        event = {"phase": phase, "velocity": unbounded, "before": before, "after": after}
        point["events"].append(event)
    return point | {"multipliers": [(unbounded, unbounded)]}


def find_contradictions(claim):
    """Return the names of the parts of a claim that an orbit in 50 digits contradicts."""
    if claim["claim"] == "range":
        return _find_range_contradictions(claim)
    motion = Motion(claim)
    return motion.find_contradictions(motion.orbit())


def main(path):
    """Print the contradicted parts of all certificates in a file and return their number."""
    with open(path, encoding="utf-8") as file:
        claims = [row for row in json.load(file) if row["claim"] not in ("count", "refusal")]
    refuted_claims = [(claim, parts) for claim in claims if (parts := find_contradictions(claim))]
    for claim, parts in refuted_claims:
        print(claim["damping"], claim["claim"], claim.get("tuning", claim.get("start")), *parts)
    print(f"{len(claims) - len(refuted_claims)} of {len(claims)} claims are confirmed")
    return len(refuted_claims)


if __name__ == "__main__":
    sys.exit(bool(main(sys.argv[1])))
