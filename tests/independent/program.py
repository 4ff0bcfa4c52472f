"""Motions of a system from event to event, in any number of digits, and periodic orbits.

The context of the numbers of `Equations` decides how many digits are computed.
"""

import math
from collections import namedtuple
from functools import cache
from itertools import pairwise, product
from types import SimpleNamespace

from mpmath import mp

from tests.independent.equations import TimeInterval
from tests.independent.series import Step, derivative_of, find_roots

#: A change of contact at a phase, or at a time theta in a run-up. `rate` is the rate of the
#: drive-side distance, and `side_rate` the rate of the distance of the side that is met or left.
Event = namedtuple("Event", "phase contact before after rate side_rate")


def find_switch_times(equations, interval):
    """Return the times at which stiffness or sliding changes within an interval, and its end."""
    context, acceleration, start_speed = equations.context, interval.acceleration, interval.speed
    last_phase, period, times = interval.phase_at(interval.end)[0], 2 * context.pi, set()
    for contact in equations.contacts:
        switch_phases = set().union(*(side.switch_phases for side in contact.side.values()))
        first_period = math.floor(interval.phase * contact.frequency_ratio / period) - 1
        whole_periods = range(
            first_period, math.ceil(last_phase * contact.frequency_ratio / period) + 2
        )
        for switch_phase, k in product(switch_phases, whole_periods):
            angle = period * (switch_phase % 1 + k) / contact.frequency_ratio - interval.phase
            square = start_speed * start_speed + 2 * acceleration * angle
            if angle > 0 and square > 0:
                times.add(interval.begin + 2 * angle / (start_speed + context.sqrt(square)))
    return [*sorted(t for t in times if t < interval.end), interval.end]


def initial_contact_states(equations, interval, state, interior_phase):
    """Return (contact states of an initial state, sides whose distance is zero).

    A side with zero distance gets contact if the motion closes it.
    `interior_phase` is a phase within the first step, see `Step`.
    """
    contact_states, boundary_sides, q = [0] * len(equations.contacts), set(), state[: equations.n]
    sides = [
        (j, *row) for j, contact in enumerate(equations.contacts) for row in contact.side.items()
    ]
    for j, contact_state, side in sides:
        distance = contact_state * equations.distance(side, q, interval.phase)
        if distance > equations.tolerance:
            contact_states[j] = contact_state
        if abs(distance) <= equations.tolerance:
            boundary_sides.add(side)
    for j, contact_state, side in sides:
        if side in boundary_sides:
            step = Step(equations, interval, interval.begin, state, contact_states, interior_phase)
            curve = step.curves[side]
            rounding = equations.tolerance * max(map(abs, curve[1:4]))
            first_change = next((contact_state * c for c in curve[1:] if abs(c) > rounding), 0)
            if first_change > 0 or first_change == 0 < contact_state:
                contact_states[j] = contact_state
    return contact_states, boundary_sides


def _first_event(step, crossed_sides, max_length):
    """Return (time, end) of the first event of a step, with the end None if there is none.

    An end is (side or "extremum", contact, next contact state); "extremum" is a zero of the rate.
    `crossed_sides` holds the sides that the motion has just met or left, and "extremum" if its rate
    is 0. `max_length` is the length of the step.
    """
    equations, first_event = step.equations, (max_length, None)
    for j, (contact, contact_state) in enumerate(step.contacts):
        ends = [
            ((side, j, after), [sign * c for c in step.curves[side]])
            for side, sign, after in contact.possible_events(contact_state)
        ]
        if contact.has_kink:
            # |v| v has a kink, so that the series ends where v changes sign.
            slope = derivative_of(step.curves[contact.drive])
            sign = 1 if slope["extremum" in crossed_sides] > 0 else -1
            ends.append((("extremum", j, contact_state), [sign * c for c in slope]))
        for end, curve in ends:
            if end[0] in crossed_sides:
                # The distance is zero at the start of the step, and this root is divided out.
                curve = curve[1:]
            elif curve[0] <= 0 and curve[1] < 0:
                return 0 * max_length, end
            slope = derivative_of(curve)
            for zero in find_roots(equations, curve, first_event[0], equations.tolerance * 1e-3):
                if equations.value(slope, zero) < 0 and (zero or end[0] not in crossed_sides):
                    first_event = zero, end
                    break
    return first_event


class Motion:
    """A motion along `TimeInterval`s from a state in units, with times theta.

    `contact_states` are the initial contacts; if None, they follow from the state. Extrema and
    durations are taken from the time `record_from` on, and samples at the rising `sample_times`.
    The attribute `switch_times` has the times at which stiffness or sliding may switch.
    """

    def __init__(
        self,
        equations,
        intervals,
        state,
        contact_states=None,
        record_from=math.inf,
        sample_times=(),
    ):
        self.equations, self.events, self.switch_times = equations, [], []
        self.record_from, self.remaining_sample_times = record_from, list(sample_times)
        contacts = equations.contacts
        self.record = SimpleNamespace(
            #: rows (time, displacements, rates, forces, coordinates)
            samples=[],
            #: for each contact values that include the extrema
            displacements=[[] for _ in contacts],
            forces=[[] for _ in contacts],
            #: for each contact: time in drive contact, no contact, coast contact, low stiffness
            durations=[[0, 0, 0, 0] for _ in contacts],
        )
        self.state, crossed_sides = [equations.context.mpf(x) for x in state], None
        for interval in intervals:
            switch_times, t = find_switch_times(equations, interval), interval.begin
            self.switch_times += switch_times
            if interval.begin < record_from < interval.end:
                switch_times = sorted({*switch_times, record_from})
            for stop in switch_times:
                interior_phase = interval.phase_at((t + stop) / 2)[0]
                if crossed_sides is None:
                    initial_states, crossed_sides = initial_contact_states(
                        equations, interval, self.state, interior_phase
                    )
                    self.contact_states = list(contact_states or initial_states)
                while t < stop:
                    t, crossed_sides = self._step(interval, t, stop, interior_phase, crossed_sides)
        self.phase = intervals[-1].phase_at(t)[0]

    def _step(self, interval, t, stop, interior_phase, crossed_sides):
        """Make one step and return (time, sides crossed at its end), see `_first_event`."""
        step = Step(
            self.equations,
            interval,
            t,
            self.state,
            self.contact_states,
            interior_phase,
            "extremum" in crossed_sides,
        )
        h, end = _first_event(step, crossed_sides, step.length(stop - t))
        t = stop if h == stop - t else t + h
        if stop > self.record_from + self.equations.tolerance:
            self._record(step, h)
        self._sample(step, t)
        if h:
            self.state, crossed_sides = step.state_at(h), set()
        if end:
            side, j, contact_state = end
            crossed_sides.add(side)
            if side != "extremum":
                curves = step.curves[self.equations.contacts[j].drive], step.curves[side]
                rates = (self.equations.value(derivative_of(curve), h) for curve in curves)
                self.events.append(Event(t, j, self.contact_states[j], contact_state, *rates))
                self.contact_states[j] = contact_state
        return t, crossed_sides

    def _record(self, step, t):
        """Add the extrema and durations of a step of length `t` to the record."""
        equations, record = self.equations, self.record
        for j, (contact, contact_state) in enumerate(step.contacts):
            record.durations[j][1 - contact_state] += t
            curves = step.displacement(contact), step.elastic(contact, contact_state)
            for curve, values in zip(
                curves, (record.displacements[j], record.forces[j]), strict=True
            ):
                floor = equations.tolerance * max(map(abs, curve))
                extremum_times = find_roots(equations, derivative_of(curve), t, floor)
                values += [equations.value(curve, time) for time in (0 * t, *extremum_times, t)]
            if contact_state:
                # Models of one degree of freedom record the stiffness of the drive side.
                side = contact.side[contact_state] if equations.n > 1 else contact.drive
                excess_stiffness, threshold = (
                    step.stiffness(contact, side),
                    side.profile["threshold"],
                )
                excess_stiffness[0] -= threshold
                floor = threshold * equations.tolerance
                for begin, end in pairwise(
                    [0 * t, *find_roots(equations, excess_stiffness, t, floor), t]
                ):
                    is_low = equations.value(excess_stiffness, (begin + end) / 2) < -floor
                    record.durations[j][3] += is_low * (end - begin)

    def _sample(self, step, until):
        """Add the samples of a step before the time `until`."""
        value, n = self.equations.value, self.equations.n
        while self.remaining_sample_times and self.remaining_sample_times[0] < until:
            time, rows = self.remaining_sample_times.pop(0), []
            for contact, contact_state in step.contacts:
                curve = step.displacement(contact)
                curves = curve, derivative_of(curve), step.elastic(contact, contact_state)
                rows.append([value(c, time - step.t) for c in curves])
            row = *zip(*rows, strict=True), step.state_at(time - step.t)[:n]
            self.record.samples.append((time, *row))

    def mesh_state(self):
        """Return displacement and rate of the first contact at the end of the motion."""
        n, contact = self.equations.n, self.equations.contacts[0]
        halves = enumerate((self.state[:n], self.state[n:]))
        x, v = (self.equations.distance(contact.drive, half, self.phase, k) for k, half in halves)
        return x - contact.displacement_origin, v


def move(equations, periods, state, recorded=0, phases=(), contact_states=None):
    """Return the `Motion` at constant speed from phase 0 over `periods`, which may be a fraction.

    The last `recorded` periods are recorded, and samples are taken at `phases`.
    """
    period, zero = 2 * equations.context.pi, equations.context.mpf(0)
    interval = TimeInterval(zero, period * periods, zero, zero + 1)
    begin = period * (periods - recorded) if recorded else math.inf
    return Motion(equations, [interval], state, contact_states, begin, phases)


def newton(function, point, iterations):
    """Return a zero of a function by Newton's method, and the derivatives before the last step."""
    function = cache(function)
    for _ in range(iterations):
        slopes = mp.jacobian(function, point)
        change = mp.lu_solve(slopes, mp.matrix(function(*point)))
        point = [a - b for a, b in zip(point, change, strict=True)]
    return point, slopes
