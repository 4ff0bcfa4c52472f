"""Motions of a system in any number of digits, from event to event: courses, orbits, multipliers.

`equations` describes a system; the context of its numbers decides how many digits are computed.
"""

import math
from itertools import pairwise
from typing import NamedTuple

import mpmath

from tests.independent.equations import Equations, Piece
from tests.independent.series import Step, slope_of, zeros


class Event(NamedTuple):
    """A change of contact at a phase; rates by phase, in units of length."""

    phase: object
    contact: int
    before: int
    after: int
    rate: object  #: of the drive-side distance
    own_rate: object  #: of the distance from the side that is met or left


class Record:
    """Extrema and durations of each contact from `begin` on, and samples at rising times."""

    def __init__(self, count, begin, sample_times):
        self.begin, self.pending, self.samples = begin, list(sample_times), []
        self.heights, self.forces = ([[] for _ in range(count)] for _ in range(2))
        #: of normal contact (code 1), backlash (0), inverse contact (-1), the lower stiffness
        self.durations = [[0, 0, 0, 0] for _ in range(count)]

    def add_step(self, step, t):
        """Add the extrema and durations of a step of length t."""
        equations = step.equations
        for j, (contact, code) in enumerate(zip(equations.contacts, step.codes, strict=True)):
            self.durations[j][1 - code] += t
            self._extrema(self.heights[j], step, step.displacement(contact), t)
            if not code:
                self.forces[j].append(0 * t)
                continue
            self._extrema(self.forces[j], step, step.elastic(contact, code), t)
            # Models of one degree record the stiffness of the drive side.
            side = contact.side(code) if equations.n > 1 else contact.drive
            level = step.stiffness(contact, side, equations.terms)
            high = side.course["high"]
            level[0] -= high
            floor = high * equations.tiny
            marks = [0 * t, *zeros(equations, level, t, t * 1e-12, floor), t]
            for a, b in pairwise(marks):
                low = equations.value(level, (a + b) / 2) < -floor
                self.durations[j][3] += b - a if low else 0

    def _extrema(self, into, step, curve, t):
        equations = step.equations
        floor = equations.tiny * max(map(abs, curve))
        turns = zeros(equations, slope_of(curve), t, t * 1e-12, floor)
        into += [equations.value(curve, place) for place in (0 * t, *turns, t)]

    def sample(self, step, until):
        """Add the samples of a step before a time: (time, displacements, rates, forces, q)."""
        while self.pending and self.pending[0] < until:
            time = self.pending.pop(0)
            t, equations, rows = time - step.t, step.equations, []
            for contact, code in zip(equations.contacts, step.codes, strict=True):
                curve = step.displacement(contact)
                force = equations.value(step.elastic(contact, code), t) if code else 0
                rate = equations.value(slope_of(curve), t)
                rows.append((equations.value(curve, t), rate, force))
            self.samples.append((time, *zip(*rows, strict=True), step.at(t)[: equations.n]))


class Motion(NamedTuple):
    """A motion: last state, events, record, times of switches, and the equations."""

    state: list
    events: list
    record: Record
    cuts: list
    equations: Equations
    phase: object

    def mesh_state(self, contact=0):
        """Return displacement and rate of a contact at the end."""
        equations, drive = self.equations, self.equations.contacts[contact].drive
        q, v = self.state[: equations.n], self.state[equations.n :]
        rate = equations.rate(drive, v, self.phase)
        return equations.distance(drive, q, self.phase) - equations.contacts[contact].zero, rate


def courses(equations, speed, load, turn, push):
    """Return the pieces of a run-up over theta = speed of the system times the time in s.

    speed: rows of s and rpm; load: rows of s and shares; turn: rad/s of the phase for 1 rpm;
    push: accelerations of coordinates, m/s^2 for 1 rad/s^2.
    """
    number, omega = equations.context.mpf, equations.speed
    push = [number(x) / equations.length for x in push]
    speeds = [(number(t) * omega, number(v) * turn / omega) for t, v in speed]
    loads = [(number(t) * omega, number(v)) for t, v in load]
    marks = sorted({t for t, _ in loads if t < speeds[-1][0]} | {t for t, _ in speeds})
    pieces, phase = [], number(0)
    for begin, end in pairwise(marks):
        (v, w), (a, b), span = _ends(speeds, begin, end), _ends(loads, begin, end), end - begin
        pieces.append(Piece(begin, end, phase, v, (w - v) / span, a, (b - a) / span, push))
        phase += (v + w) / 2 * span
    return pieces


def _ends(rows, begin, end):
    """Return the values of a piecewise linear course at both ends of an interval within a line."""
    for (t, v), (u, w) in pairwise(rows):
        if t <= begin and end <= u and t < u:
            return tuple(v + (w - v) * (at - t) / (u - t) for at in (begin, end))
    return (rows[0][1],) * 2 if end <= rows[0][0] else (rows[-1][1],) * 2


def cuts_of(equations, piece):
    """Return the times at which stiffness or sliding changes within a piece, and its end."""
    context, least = equations.context, equations.tiny
    last, a, b = piece.phase_at(piece.end)[0], piece.acceleration, piece.speed
    times, period = [], 2 * context.pi
    for contact in equations.contacts:
        first = math.floor(piece.phase * contact.rate / period) - 1
        for cut in contact.cuts(context):
            for k in range(first, math.ceil(last * contact.rate / period) + 2):
                angle = period * (cut % 1 + k) / contact.rate - piece.phase
                square = b * b + 2 * a * angle
                if angle > 0 and square > 0:
                    times.append(piece.begin + 2 * angle / (b + context.sqrt(square)))
    kept = []
    for t in sorted(times):
        inside = piece.begin + least < t < piece.end - least
        if inside and (not kept or t - kept[-1] > least):
            kept.append(t)
    return [*kept, piece.end]


def first_codes(equations, piece, state, middle):
    """Return (contact codes of a start, sides on whose flank line it lies).

    On a line the code is that of the side to which the motion goes; `middle` as for `Step`.
    """
    codes, q, phase = [], state[: equations.n], piece.phase
    sides = [side for contact in equations.contacts for side in contact.sides]
    on_line = {side for side in sides if equations.on_line(side, q, phase)}
    for contact in equations.contacts:
        drive, coast = (
            0 if side in on_line else side and equations.distance(side, q, phase)
            for side in (contact.drive, contact.coast)
        )
        if drive > 0 or (drive == 0 and coast is not None and coast <= 0):
            codes.append(1)
        else:
            codes.append(-1 if coast is not None and coast < 0 else 0)
    for j, contact in enumerate(equations.contacts):
        for side in contact.sides:
            if side not in on_line:
                continue
            curve = Step(equations, piece, piece.begin, state, codes, middle).curve(side)
            least = equations.tiny * max(map(abs, curve[1:4]))
            first = next((c for c in curve[1:] if abs(c) > least), 0)
            if side is contact.drive:
                codes[j] = 1 if first >= 0 else min(codes[j], 0)
            elif first < 0:
                codes[j] = -1
    return codes, on_line


def _first_event(step, crossed, longest):
    """Return (time, (contact, side, next code) or None, whether v turns) of what ends a step.

    `crossed` are the sides whose line the motion has just crossed, `longest` is the step at most.
    """
    equations, event = step.equations, (longest, None, False)
    floor, least = equations.tiny * 1e-3, equations.tiny * 1e-3
    for j, (contact, code) in enumerate(zip(equations.contacts, step.codes, strict=True)):
        if contact.has_kink:
            # |v| v has a kink: the series ends where v turns.
            slope = slope_of(step.curve(contact.drive))
            slope = slope[1:] if step.turned or not slope[0] else slope
            turn = next(zeros(equations, slope, event[0], least, floor), None)
            if turn is not None and 0 < turn < event[0]:
                event = turn, None, True
        for side, sign, after in contact.possible_events(code):
            curve = step.curve(side)
            curve = curve if sign > 0 else [-c for c in curve]
            if side in crossed:
                # From the line on: the zero at the start is divided out.
                curve = curve[1:]
            elif curve[0] <= 0 and curve[1] < 0:
                return 0 * longest, (j, side, after), False
            slope = slope_of(curve)
            for zero in zeros(equations, curve, event[0], least, floor):
                falls = equations.value(slope, zero) < 0
                if falls and (zero or side not in crossed):
                    event = min(event, (zero, (j, side, after), False), key=lambda pair: pair[0])
                    break
    return event


def integrate(equations, pieces, state, codes=None, record_from=math.inf, sample_times=()):
    """Return the `Motion` along pieces from a state in units; all times are theta of `courses`.

    codes : contacts at the start, None for those of the state.
    """
    state = [equations.context.mpf(x) for x in state]
    record, events, all_cuts = Record(len(equations.contacts), record_from, sample_times), [], []
    n, turned, crossed = equations.n, False, None
    for piece in pieces:
        cuts, t = cuts_of(equations, piece), piece.begin
        all_cuts += cuts
        if piece.begin < record_from < piece.end:
            cuts = sorted({*cuts, record_from})
        for stop in cuts:
            middle = piece.phase_at((t + stop) / 2)[0]
            if crossed is None:
                start_codes, crossed = first_codes(equations, piece, state, middle)
                codes = list(codes or start_codes)
            while t < stop:
                step = Step(equations, piece, t, state, codes, middle, turned)
                h, met, turned = _first_event(step, crossed, step.length(stop - t))
                whole = h == stop - t
                after = stop if whole else t + h
                if stop > record_from + equations.tiny:
                    record.add_step(step, h)
                record.sample(step, after)
                if h:
                    state, crossed = step.at(h), set()
                t = after
                if met:
                    j, side, code = met
                    phase, speed, _ = piece.phase_at(t)
                    sides = equations.contacts[j].drive, side
                    rates = (equations.rate(s, state[n:], phase, speed) for s in sides)
                    events.append(Event(t, j, codes[j], code, *rates))
                    codes[j] = code
                    crossed = {*crossed, side}
    return Motion(state, events, record, all_cuts, equations, pieces[-1].phase_at(t)[0])


def move(equations, periods, state, recorded=0, phases=(), codes=None):
    """Return the `Motion` at constant speed from phase 0 over periods that need not be whole.

    recorded : number of the last periods whose extrema and durations are taken.
    phases : of samples, rising; codes : contacts at the start, None for those of the state.
    """
    period, zero = 2 * equations.context.pi, equations.context.mpf(0)
    piece = Piece(zero, period * periods, zero, zero + 1)
    begin = period * (periods - recorded) if recorded else math.inf
    return integrate(equations, [piece], state, codes, begin, phases)


def period_map(flow, state, step):
    """Return the end to which a flow leads a state, and the matrix of its derivatives."""
    end, columns = flow(state), []
    for j in range(len(state)):
        other = list(state)
        other[j] += step
        columns.append([(a - b) / step for a, b in zip(flow(other), end, strict=True)])
    return end, mpmath.matrix(columns).T


def orbit(flow, state, step, iterations):
    """Return (state, matrix) of the periodic orbit of a flow near a state, by Newton's method."""
    for _ in range(iterations):
        end, matrix = period_map(flow, state, step)
        away = mpmath.matrix([a - b for a, b in zip(end, state, strict=True)])
        change = mpmath.lu_solve(mpmath.eye(len(state)) - matrix, away)
        state = [a + b for a, b in zip(state, change, strict=True)]
    return state, period_map(flow, state, step)[1]


def multipliers(matrix):
    """Return the eigenvalues of a monodromy matrix."""
    return mpmath.eig(matrix, left=False, right=False)
