"""A motion of a `Machine` along a course of speed and load, over theta = Omega t.

Omega is the mesh speed at tuning 1. Event by event by Taylor series in any number of digits, or by
scipy, which knows nothing of series.
"""

import math
from typing import NamedTuple

import mpmath
import numpy as np
from scipy.integrate import solve_ivp

from tests.references.reference_equations import harmonics, machine_of
from tests.references.reference_motion import (
    along,
    first_codes,
    least_of,
    on_line,
    watched,
)
from tests.references.reference_record import Record


class Course:
    """A piecewise linear course."""

    def __init__(self, rows):
        self.rows = rows

    def __call__(self, t, after):
        """Return the value at t; at a step that behind it, if asked for."""
        times, values = zip(*self.rows, strict=True)
        for i in range(len(times) - 1):
            inside = times[i] <= t < times[i + 1] if after else times[i] < t <= times[i + 1]
            if inside:
                share = (t - times[i]) / (times[i + 1] - times[i])
                return values[i] + share * (values[i + 1] - values[i])
        return values[0] if t <= times[0] else values[-1]


class Piece(NamedTuple):
    """A stretch of a course on which tuning and load are linear."""

    begin: object
    end: object
    phase: object
    speed: object
    acceleration: object
    load: object
    slope: object
    push: object  #: m, of the coordinates for a unit of acceleration
    deviation: list  #: rows (order, cosine, sine), of one degree of freedom

    def about(self, t):
        """Return (phase, its rate, half the rate of that)."""
        s, half = t - self.begin, self.acceleration / 2
        return (
            self.phase + (self.speed + half * s) * s,
            self.speed + self.acceleration * s,
            half,
        )

    def add_forces(self, machine, t, force):
        """Add to Taylor coefficients of forces what the course brings."""
        inertia = machine.mass * machine.speed**2
        share = self.load - 1 + self.slope * (t - self.begin)
        force[0] = force[0] + machine.load * share + inertia @ self.push * self.acceleration
        if len(force) > 1:
            force[1] = force[1] + machine.load * self.slope
        for order, a, b in self.deviation:
            waves = machine.wave(order, t, len(force) + 2)
            for k, (c, s) in enumerate(waves[2:]):
                force[k][0] += (k + 1) * (k + 2) * inertia[0, 0] * (a * c + b * s)


class RunUp:
    """A described model on its way: rows of s and rpm, rows of s and shares of the load.

    `turn`: rad/s of the mesh for 1 rpm; `push`: accelerations of coordinates, m/s^2 for 1 rad/s^2.
    """

    def __init__(self, model, speed, load, turn, push, context=mpmath.fp):
        bare = dict(model)
        # The inertia of a deviation is not that of a constant speed.
        one, deviation = "deviation" in bare and model["kind"] != "SixDegreePair", []
        if one:
            deviation = harmonics(bare["deviation"])
            bare["deviation"] = {"cosines": [], "sines": []}
        self.context, self.machine = context, machine_of(bare, 1.0, context)
        machine, number = self.machine, context.mpf
        machine.inverse = machine.inverse_mass()
        self.omega = omega = machine.speed
        push = np.array([number(x) for x in push], machine.kind)
        speeds = Course([(number(t) * omega, number(v) * turn / omega) for t, v in speed])
        loads = Course([(number(t) * omega, number(v)) for t, v in load])
        marks = {t for t, _ in loads.rows if t < speeds.rows[-1][0]} | {t for t, _ in speeds.rows}
        self.pieces, phase = [], number(0)
        for begin, end in zip(sorted(marks)[:-1], sorted(marks)[1:], strict=True):
            first, last, span = speeds(begin, True), speeds(end, False), end - begin
            share = loads(begin, True)
            slope = (loads(end, False) - share) / span
            rest = (first, (last - first) / span, share, slope, push, deviation)
            self.pieces.append(Piece(begin, end, phase, *rest))
            phase += (first + last) / 2 * span

    def end(self, seconds):
        """End the course early."""
        last = self.context.mpf(seconds) * self.omega
        kept = [one for one in self.pieces if one.begin < last]
        self.pieces = [one._replace(end=min(one.end, last)) for one in kept]

    def cuts(self, piece):
        """Return where stiffness or sliding changes, and the end."""
        context, least, found = self.context, least_of(self.context), []
        last, a, b = piece.about(piece.end)[0], piece.acceleration, piece.speed
        for contact in self.machine.contacts:
            for cut in contact.cuts(context):
                first = math.floor(piece.phase * contact.rate / math.tau) - 1
                for k in range(first, math.ceil(last * contact.rate / math.tau) + 2):
                    way = 2 * context.pi * (cut % 1 + k) / contact.rate - piece.phase
                    square = b * b + 2 * a * way
                    if way > 0 and square > 0:
                        found.append(piece.begin + 2 * way / (b + context.sqrt(square)))
        kept = []
        for t in sorted(found):
            if piece.begin + least < t < piece.end - least and (not kept or t - kept[-1] > least):
                kept.append(t)
        return [*kept, piece.end]

    def move(self, q, v, times):
        """Return (distances of the drive sides at rising times in s, events), by Taylor series.

        Distances are in m, from the line of the flank; events (time, contact, before, after).
        """
        machine, codes, events = self.machine, None, []
        machine.piece = self.pieces[0]
        phases = [self.context.mpf(t) * self.omega for t in times]
        record = Record(len(machine.contacts), phases)
        crossed = {(j, s): True for j, c in enumerate(machine.contacts) for s in c.sides
                   if on_line(machine, s, q)}  # fmt: skip
        for piece in self.pieces:
            machine.piece = piece
            way = piece.begin, self.cuts(piece)
            q, v, codes = along(machine, way, q, v, codes, crossed, events, record)
            crossed = {}
        moved = [row[1] for row in record.samples]
        rows = [(one.phase / self.omega, one.contact, one.before, one.after) for one in events]
        return np.array(moved, machine.kind) * machine.length, rows

    def right_side(self, piece, codes, middle):
        """Return the rates of (q, q') by theta while contacts stay."""
        machine, n, omega = self.machine, self.machine.n, self.omega

        def wave(rows, t):
            phase, speed, _ = piece.about(t)
            parts = [(m, a, b, math.cos(m * phase), math.sin(m * phase)) for m, a, b in rows]
            value = sum(a * c + b * s for _, a, b, c, s in parts)
            return value, sum(m * (b * c - a * s) for m, a, b, c, s in parts) * speed

        def rates(t, z):
            q, v = z[:n], z[n:] * omega
            share = piece.load + piece.slope * (t - piece.begin)
            force = machine.load * share - machine.stiffness @ q - machine.damping @ v
            for contact, code in zip(machine.contacts, codes, strict=True):
                drive = contact.drive
                film = drive.row @ v + wave(drive.waves, t)[1] * omega
                force = force - drive.row * (contact.film[0] * film)
                if code:
                    side = drive if code > 0 else contact.coast
                    value, rate = wave(side.waves, t)
                    distance = side.row @ q + side.constant + value
                    rate = side.row @ v + rate * omega
                    phase = piece.about(t)[0]
                    normal = contact.level(self.context, side, phase, middle)[0] * distance
                    more = side.material[0] - contact.film[0]
                    force = force - side.row * (normal + more * rate)
                    if side.friction:
                        way = contact.sense(self.context, side, middle) * side.friction
                        force = force - contact.across * (way * normal)
            pull = machine.inverse @ force / omega**2 + piece.push * piece.acceleration
            return np.concatenate([z[n:], pull])

        return rates

    def by_scipy(self, q, v, times, max_step, rtol):
        """Return the same as `move` of linear contacts, by scipy; `max_step` in theta."""
        machine, n, codes, z = self.machine, self.machine.n, None, np.concatenate([q, v])
        wanted, moved, events = [t * self.omega for t in times], [], []
        for piece in self.pieces:
            machine.piece, t = piece, piece.begin
            # Samples may lie where a piece begins, whatever rounds.
            count = sum(one < piece.end - 1e-9 for one in wanted)
            inner, cuts = [max(one, t) for one in wanted[:count]], self.cuts(piece)
            wanted = wanted[count:]
            for end in sorted(cuts + inner):
                middle = piece.about((t + min(one for one in cuts if one >= end)) / 2.0)[0]
                codes = codes or first_codes(machine, q, v, middle, 12)
                while t < end:
                    tests = []
                    for j, (contact, code) in enumerate(zip(machine.contacts, codes, strict=True)):
                        for side, sign, after in watched(contact, code):

                            def test(t, z, side=side, sign=sign):
                                return sign * machine.distance(side, z[:n], t)

                            test.terminal, test.direction, test.to = True, -1, (j, after)
                            tests.append(test)
                    done = solve_ivp(
                        self.right_side(piece, codes, middle), (t, end), z, "DOP853", events=tests,
                        rtol=rtol, atol=1e-2 * rtol * machine.length, max_step=max_step,
                    )  # fmt: skip
                    t, z = float(done.t[-1]), done.y[:, -1]
                    for one, at in zip(tests, done.t_events, strict=True):
                        if at.size:
                            j, after = one.to
                            events.append((t / self.omega, j, codes[j], after))
                            codes = [*codes[:j], after, *codes[j + 1 :]]
                            break
                if end in inner:
                    moved.append([machine.distance(c.drive, z[:n], t) for c in machine.contacts])
        return np.array(moved), events
