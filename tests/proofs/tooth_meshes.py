"""Meshes of a train from the JSON of a certificate alone; shares no code with gearlib.

mpmath, SI units, mesh phase as time.
"""

from fractions import Fraction

from mpmath import floor, inf, mpf, pi


def number(value):
    """Return an exact number of a claim."""
    return mpf(inf) if value == "inf" else mpf(float.fromhex(value))


class Mesh:
    """Rows over the coordinates and all that a mesh is made of, SI."""

    def __init__(self, drive, coast, across, **values):
        self.drive, self.coast, self.across = drive, coast, across
        self.waves, self.constant = {}, [mpf(0), mpf(0)]
        self.__dict__ |= values

    def add(self, frequency, sides, cosine, sine):
        entry = self.waves.setdefault(Fraction(frequency), [[mpf(0), mpf(0)], [mpf(0), mpf(0)]])
        for side in sides:
            entry[side][0] += cosine
            entry[side][1] += sine

    def in_contact(self, side):
        """Return the damping in contact of a side."""
        return self.material_damping

    def turns(self, tau):
        """Return how far this mesh has come in its period, from both pitch points and middles."""
        own = self.rate * tau / (2 * pi)
        return [own - at - floor(own - at) for at in (*self.pitches, *self.phases)]

    def cuts(self, end):
        """Yield the phases of the reference mesh at which stiffness or sliding changes."""
        half = (self.contact_ratio - 1) / 2
        at = [g + s * half for g in self.phases for s in (1, -1)] if 0 < half < 0.5 else []
        if any(self.friction):
            at += [pitch + half for pitch in self.pitches for half in (0, mpf(1) / 2)]
        for one in at:
            k = -3
            while (k + one) * 2 * pi / self.rate < end:
                if (k + one) * 2 * pi / self.rate > 0:
                    yield (k + one) * 2 * pi / self.rate
                k += 1

    def stiffness(self, side, tau):
        """Return C, and 1 where friction has the sign of `across` times the force, else -1."""
        *pitches, coast, drive = self.turns(tau)
        away = (drive, coast)[side == 0]
        away = min(away, 1 - away)
        high = away < (self.contact_ratio - 1) / 2
        past = 1 if pitches[side] < 0.5 else -1
        # The force of the coast side counts negative, its friction opposes the sliding as well.
        sense = past if side else -past
        return self.max_stiffness * (1 if high else self.stiffness_ratio), sense


class Levels(Mesh):
    """Two flanks whose stiffness has steps, each its own, and its own damping."""

    def __init__(self, equation, values):
        super().__init__(
            [mpf(1)],
            [mpf(1)],
            [mpf(0)],
            film=values["gap"],
            friction=(mpf(0), mpf(0)),
            backlash=values["upper"] - values["lower"],
        )
        self.constant = [-values["lower"], -values["upper"]]
        self.dampings = values["far"], values["near"]
        self.steps = [[(mpf(at), mpf(c)) for at, c in side] for side in equation["steps"]]

    def in_contact(self, side):
        return self.dampings[side]

    def cuts(self, end):
        at = {at for side in self.steps for at, _ in side if at} | ({mpf(0)} if any(
            len(side) > 1 for side in self.steps) else set())  # fmt: skip
        k = 0
        while at and 2 * pi * k < end:
            yield from (one + 2 * pi * k for one in at if 0 < one + 2 * pi * k < end)
            k += 1

    def stiffness(self, side, tau):
        phase = tau - 2 * pi * floor(tau / (2 * pi))
        return max((at, c) for at, c in self.steps[side] if at <= phase)[1], 1
