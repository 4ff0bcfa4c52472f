"""Motions of a system from event to event, in any number of digits, and periodic orbits.

The context of the numbers of `Equations` decides how many digits are computed.
"""

import math
from collections import namedtuple
from functools import cache
from itertools import pairwise, product
from types import SimpleNamespace

from mpmath import mp

from tests.independent.equations import Piece
from tests.independent.series import Step, slope_of, zeros

#: A change of contact at a phase, or in a run-up at a time theta. `rate` is the rate of the drive-
#: side
#: distance, and `own_rate` that of the distance of the side that is met or left.
Event = namedtuple("Event", "phase contact before after rate own_rate")


def cuts_of(equations, piece):
    """Return the times at which stiffness or sliding changes within a piece, and its end."""
    context, acceleration, start_speed = equations.context, piece.acceleration, piece.speed
    last_phase, period, times = piece.phase_at(piece.end)[0], 2 * context.pi, set()
    for contact in equations.contacts:
        cuts = set().union(*(side.cuts for side in contact.side.values()))
        first_turn = math.floor(piece.phase * contact.rate / period) - 1
        turns = range(first_turn, math.ceil(last_phase * contact.rate / period) + 2)
        for cut, k in product(cuts, turns):
            angle = period * (cut % 1 + k) / contact.rate - piece.phase
            square = start_speed * start_speed + 2 * acceleration * angle
            if angle > 0 and square > 0:
                times.add(piece.begin + 2 * angle / (start_speed + context.sqrt(square)))
    return [*sorted(t for t in times if t < piece.end), piece.end]


def first_codes(equations, piece, state, middle):
    """Return (contact states of a start, sides on whose flank line it lies).

    On a flank line the motion decides: the side gets contact if the motion goes towards it.
    `middle` is a phase within the first step, see `Step`.
    """
    codes, on_line, q = [0] * len(equations.contacts), set(), state[: equations.n]
    sides = [
        (j, *row) for j, contact in enumerate(equations.contacts) for row in contact.side.items()
    ]
    for j, code, side in sides:
        distance = code * equations.distance(side, q, piece.phase)
        codes[j] = code if distance > equations.tiny else codes[j]
        on_line |= {side} if abs(distance) <= equations.tiny else set()
    for j, code, side in sides:
        if side in on_line:
            curve = Step(equations, piece, piece.begin, state, codes, middle).curves[side]
            rounding = equations.tiny * max(map(abs, curve[1:4]))
            first_change = next((code * c for c in curve[1:] if abs(c) > rounding), 0)
            codes[j] = code if first_change > 0 or first_change == 0 < code else codes[j]
    return codes, on_line


def _first_event(step, crossed, longest):
    """Return (time, end) of the first event of a step, with the end None if there is none.

    An end is (side or "turn", contact, next code); "turn" is a zero of the rate. `crossed` holds
    the sides whose flank line the motion has just crossed, and "turn" if its rate is 0. `longest`
    is the length of the step.
    """
    equations, first_event = step.equations, (longest, None)
    for j, (contact, code) in enumerate(step.contacts):
        ends = [
            ((side, j, after), [sign * c for c in step.curves[side]])
            for side, sign, after in contact.possible_events(code)
        ]
        if contact.has_kink:
            # |v| v has a kink, so that the series ends where v changes sign.
            slope = slope_of(step.curves[contact.drive])
            sign = 1 if slope["turn" in crossed] > 0 else -1
            ends.append((("turn", j, code), [sign * c for c in slope]))
        for end, curve in ends:
            if end[0] in crossed:
                # The motion starts on the line, and its zero at the start is divided out.
                curve = curve[1:]
            elif curve[0] <= 0 and curve[1] < 0:
                return 0 * longest, end
            slope = slope_of(curve)
            for zero in zeros(equations, curve, first_event[0], equations.tiny * 1e-3):
                if equations.value(slope, zero) < 0 and (zero or end[0] not in crossed):
                    first_event = zero, end
                    break
    return first_event


class Motion:
    """A motion along `Piece`s from a state in units, with times theta.

    `codes` are the contacts at the start, or None to derive them from the state. Extrema and
    durations are taken from the time `record_from` on, and samples at the rising `sample_times`.
    The attribute `cuts` has the times at which stiffness or sliding may switch.
    """

    def __init__(self, equations, pieces, state, codes=None, record_from=math.inf, sample_times=()):
        self.equations, self.events, self.cuts = equations, [], []
        self.record_from, self.pending = record_from, list(sample_times)
        contacts = equations.contacts
        self.record = SimpleNamespace(
            #: rows (time, displacements, rates, forces, coordinates)
            samples=[],
            #: by contact values among which are the extrema
            heights=[[] for _ in contacts],
            forces=[[] for _ in contacts],
            #: of contact states 1 (drive side), 0 and -1 (coast side), and of the lower stiffness
            durations=[[0, 0, 0, 0] for _ in contacts],
        )
        self.state, crossed = [equations.context.mpf(x) for x in state], None
        for piece in pieces:
            cuts, t = cuts_of(equations, piece), piece.begin
            self.cuts += cuts
            if piece.begin < record_from < piece.end:
                cuts = sorted({*cuts, record_from})
            for stop in cuts:
                middle = piece.phase_at((t + stop) / 2)[0]
                if crossed is None:
                    start_codes, crossed = first_codes(equations, piece, self.state, middle)
                    self.codes = list(codes or start_codes)
                while t < stop:
                    t, crossed = self._step(piece, t, stop, middle, crossed)
        self.phase = pieces[-1].phase_at(t)[0]

    def _step(self, piece, t, stop, middle, crossed):
        """Make one step and return (time, sides crossed at its end), see `_first_event`."""
        step = Step(self.equations, piece, t, self.state, self.codes, middle, "turn" in crossed)
        h, end = _first_event(step, crossed, step.length(stop - t))
        t = stop if h == stop - t else t + h
        if stop > self.record_from + self.equations.tiny:
            self._record(step, h)
        self._sample(step, t)
        if h:
            self.state, crossed = step.at(h), set()
        if end:
            side, j, code = end
            crossed.add(side)
            if side != "turn":
                curves = step.curves[self.equations.contacts[j].drive], step.curves[side]
                rates = (self.equations.value(slope_of(curve), h) for curve in curves)
                self.events.append(Event(t, j, self.codes[j], code, *rates))
                self.codes[j] = code
        return t, crossed

    def _record(self, step, t):
        """Add the extrema and durations of a step of length `t` to the record."""
        equations, record = self.equations, self.record
        for j, (contact, code) in enumerate(step.contacts):
            record.durations[j][1 - code] += t
            curves = step.displacement(contact), step.elastic(contact, code)
            for curve, values in zip(curves, (record.heights[j], record.forces[j]), strict=True):
                floor = equations.tiny * max(map(abs, curve))
                turns = zeros(equations, slope_of(curve), t, floor)
                values += [equations.value(curve, place) for place in (0 * t, *turns, t)]
            if code:
                # Models of one degree of freedom record the stiffness of the drive side.
                side = contact.side[code] if equations.n > 1 else contact.drive
                level, high = step.stiffness(contact, side), side.course["high"]
                level[0] -= high
                floor = high * equations.tiny
                for begin, end in pairwise([0 * t, *zeros(equations, level, t, floor), t]):
                    is_low = equations.value(level, (begin + end) / 2) < -floor
                    record.durations[j][3] += is_low * (end - begin)

    def _sample(self, step, until):
        """Add the samples of a step before the time `until`."""
        value, n = self.equations.value, self.equations.n
        while self.pending and self.pending[0] < until:
            time, rows = self.pending.pop(0), []
            for contact, code in step.contacts:
                curve = step.displacement(contact)
                curves = curve, slope_of(curve), step.elastic(contact, code)
                rows.append([value(c, time - step.t) for c in curves])
            row = *zip(*rows, strict=True), step.at(time - step.t)[:n]
            self.record.samples.append((time, *row))

    def mesh_state(self):
        """Return displacement and rate of the first contact at the end of the motion."""
        n, contact = self.equations.n, self.equations.contacts[0]
        halves = enumerate((self.state[:n], self.state[n:]))
        x, v = (self.equations.distance(contact.drive, half, self.phase, k) for k, half in halves)
        return x - contact.zero, v


def move(equations, periods, state, recorded=0, phases=(), codes=None):
    """Return the `Motion` at constant speed from phase 0 over a number of periods, whole or not.

    The last `recorded` periods are recorded, and samples are taken at `phases`.
    """
    period, zero = 2 * equations.context.pi, equations.context.mpf(0)
    piece = Piece(zero, period * periods, zero, zero + 1)
    begin = period * (periods - recorded) if recorded else math.inf
    return Motion(equations, [piece], state, codes, begin, phases)


def newton(function, point, iterations):
    """Return a zero of a function by Newton's method, and the derivatives before the last step."""
    function = cache(function)
    for _ in range(iterations):
        slopes = mp.jacobian(function, point)
        change = mp.lu_solve(slopes, mp.matrix(function(*point)))
        point = [a - b for a, b in zip(point, change, strict=True)]
    return point, slopes
