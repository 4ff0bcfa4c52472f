"""The equations of a claim about a train, from its JSON: the second code of `tests.references`.

mpmath in 50 digits, SI units, mesh phase as time. It shares no code with gearlib.
"""

import math
import re
from functools import cache

import numpy as np
from mpmath import lu_solve, matrix, mp, mpf, nstr

from tests.references.reference_equations import machine_of
from tests.references.reference_motion import Step

mp.dps = 50
_NUMBER = re.compile(r"-?(0x[0-9a-f.]+p[+-]\d+|inf)")
#: Digits to which frequencies are the same.
_SAME = 40


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
    units = {
        "length": given["static_deflection"],
        "omega": given["reference_angular_frequency"],
    }
    phases = {name: given[name] for name in ("phases", "inverse_phases")}
    return {"kind": "GearTrain", **model, **phases, "derived": units}


def _exact(value):
    if isinstance(value, dict):
        return {name: _exact(one) for name, one in value.items()}
    if isinstance(value, list):
        return [_exact(one) for one in value]
    known = isinstance(value, str) and _NUMBER.fullmatch(value)
    return mpf(float.fromhex(value)) if known else value


class Train:
    """M Omega^2 q'' + D Omega q' + K q = f - mesh forces, linear between contacts."""

    level, laws = Step.level, Step.laws

    def __init__(self, claim):
        self.claim, self.context, tuning = claim, mp, claim["tuning"]
        nu = _exact(tuning) if isinstance(tuning, str) else sum(map(mpf, tuning)) / 2
        self.machine = machine = machine_of(described(claim), nu, mp)
        self.n, self.length = machine.n, machine.length
        self.names, self.codes = claim["coordinates"], list(claim["contacts"])
        assert len(self.names) == self.n
        self.kept = [i for i, name in enumerate(self.names) if name not in claim["fixed"]]
        #: Of every mesh, coast side, None where there is none, and drive side.
        self.sides = [(contact.coast, contact.drive) for contact in machine.contacts]
        sides = [side for contact in machine.contacts for side in contact.sides]
        waves = [mpf(f) for side in sides for f, *_ in side.waves]
        waves += [mpf(f) for f, *_ in machine.forcing]
        self.frequencies = sorted({nstr(f, _SAME): f for f in waves}.values())
        self.turning, self.inverse = self._free(), machine.inverse_mass()

    def _free(self):
        """Return the motions that no stiffness resists: of the kept coordinates, by the fixed."""
        fixed, total = [i for i in range(self.n) if i not in self.kept], self.machine.stiffness
        for contact in self.machine.contacts if fixed else ():
            row = contact.drive.row
            total = total + contact.drive.course.high * np.outer(row, row)
        inner = [[total[i, j] for j in self.kept] for i in self.kept]
        return fixed, [
            lu_solve(matrix(inner), matrix([-total[i, j] for i in self.kept])) for j in fixed
        ]

    def reduced(self, q):
        """Return the coordinates, or rates, without the free motions."""
        found = [q[i] for i in self.kept]
        for j, column in zip(*self.turning, strict=True):
            found = [value - c * q[j] for value, c in zip(found, column, strict=True)]
        return found

    def _waves(self, rows):
        """Return (frequency, number of its cosine in z, cosine, sine) of rows."""
        same = [nstr(f, _SAME) for f in self.frequencies]
        for f, cosine, sine in rows:
            i = same.index(nstr(mpf(f), _SAME))
            yield self.frequencies[i], 2 * self.n + 1 + 2 * i, cosine, sine

    @cache  # noqa: B019 (few sides of a test)
    def functional(self, side):
        """Return the distance from a side, and its rate, as rows over z."""
        size = 2 * self.n + 1 + 2 * len(self.frequencies)
        distance, rate = ([mpf(0)] * size for _ in range(2))
        distance[: self.n], rate[self.n : 2 * self.n] = side.row, side.row
        distance[2 * self.n] = side.constant
        for f, at, cosine, sine in self._waves(side.waves):
            distance[at] += cosine
            distance[at + 1] += sine
            # (c cos + s sin)' = f (s cos - c sin)
            rate[at] += f * sine
            rate[at + 1] -= f * cosine
        return distance, rate

    def law(self, tau, codes):
        """Return A of dz/dtau = A z, z = (q, dq/dtau, 1, cos, sin, ...), as rows of its entries."""
        machine, n, w = self.machine, self.n, self.machine.speed
        self.tau = self.middle = tau
        size = 2 * n + 1 + 2 * len(self.frequencies)
        force, whole = machine.zeros(n, size), machine.zeros(size, size)
        force[:, :n] -= machine.stiffness
        force[:, n : 2 * n] -= machine.damping * w
        force[:, 2 * n] += machine.load
        for contact, code in zip(machine.contacts, codes, strict=True):
            for side, push, stiffness, damping in self.laws(contact, code):
                distance, rate = self.functional(side)
                for left, right in ((push * stiffness, distance), (side.row * (damping * w), rate)):
                    columns = [j for j, value in enumerate(right) if value]
                    for i in np.flatnonzero(left):
                        force[i, columns] -= [left[i] * right[j] for j in columns]
        for f, i, cosine, sine in machine.forcing:
            for _, at, *values in self._waves([(f, cosine, sine)]):
                force[i, at : at + 2] += values
        for i in range(n):
            whole[i, n + i] = mpf(1)
        for i in range(n):
            for j in np.flatnonzero(self.inverse[i]):
                whole[n + i] += force[j] * (self.inverse[i, j] / w**2)
        for j, f in enumerate(self.frequencies):
            at = 2 * n + 1 + 2 * j
            whole[at, at + 1], whole[at + 1, at] = -f, f
        return [[(j, value) for j, value in enumerate(row) if value] for row in whole]
