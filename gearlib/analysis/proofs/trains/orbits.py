"""The proof of one orbit of a train."""

import math
from functools import partial
from itertools import pairwise, product

from gearlib.analysis.orbits.shooting import resting
from gearlib.analysis.proofs.balls import COARSE, digits_of, enclosure, flint, precision
from gearlib.analysis.proofs.certificates import MeshEvent, TrainCertificate
from gearlib.analysis.proofs.krawczyk import (
    LARGEST,
    WRONG,
    check_derivative,
    image,
    polish,
    uniqueness,
)
from gearlib.analysis.proofs.orbits import FOLD, enclosed, first_with
from gearlib.analysis.proofs.path import Uncertain
from gearlib.analysis.proofs.trains.laws import TrainLaws
from gearlib.analysis.proofs.trains.multipliers import eigenvalues, judge
from gearlib.analysis.proofs.trains.parts import parts_of
from gearlib.analysis.proofs.trains.path import TrainPath
from gearlib.analysis.proofs.trains.signs import check_contacts
from gearlib.analysis.proofs.trains.windows import Windows, close
from gearlib.data.status import JAMMED, MESSAGES
from gearlib.kernels import orbit as columns
from gearlib.runs.run_arguments import MAX_EVENTS

#: Bits beyond the digits asked for where contacts come together.
_MORE = 320
#: How often contacts at nearly one phase are put into another order; what is near, and the bits
#: that tell most of them apart.
_ORDERS, _NEAR, _SORTING = 3, 1e-9, 96
#: By how much derivatives in an order and through windows may differ.
_SAME = 2.0**-32
#: A box that shows how large a box about the orbit may be, and how often a smaller one is tried.
_SMALL, _TRIES = 2.0**-24, 20


def listed_contacts(orbit):
    """Return (contact codes of all meshes at tau = 0, events) of the motion from a candidate.

    Events are (phase, mesh, code before, code after), phases counted on over the mesh periods.
    """
    model = orbit.pair
    events, summary, _, code = model.propagator(orbit.tuning).recorded(
        orbit.state, orbit.period, MAX_EVENTS
    )
    if code == JAMMED:
        raise Uncertain("jammed", MESSAGES[JAMMED])
    table = [
        (
            2.0 * math.pi * row[columns.EVENT_PERIOD] + row[columns.EVENT_PHASE],
            # Behind the columns of every event the mesh, where there are several.
            int(row[columns.EVENT_COLUMNS]) if len(row) > columns.EVENT_COLUMNS else 0,
            int(row[columns.EVENT_FROM]),
            int(row[columns.EVENT_TO]),
        )
        for row in events
    ]
    low, high = summary[..., columns.X_MIN], summary[..., columns.X_MAX]
    codes = resting(low, high, *model.flank_lines)
    pattern = codes if not table else [table[0][2], *(after for *_, after in table)]
    if tuple(pattern) != tuple(orbit.pattern):
        raise Uncertain(
            "contacts",
            f"the motion from the candidate has the contacts {tuple(pattern)}, not the listed "
            f"{tuple(orbit.pattern)}",
        )
    for _, mesh, before, _ in reversed(table):
        codes[mesh] = before
    return codes, table


def train_certificate(orbit, digits):
    """Return the `TrainCertificate` of a candidate, with so many digits.

    Raises
    ------
    Uncertain
        At the first step that fails.
    """
    with precision(COARSE):
        parts_of(orbit.pair)
    codes, events = listed_contacts(orbit)
    step = lambda: TrainProof(orbit, codes, events).certificate(digits)  # noqa: E731
    try:
        return first_with(digits, step)
    except Uncertain as reason:
        if reason.args[0] != "together":
            raise
        # Windows of contacts at once widen from one to the next.
        return first_with(digits, step, _MORE)


class TrainProof:
    """The steps of the proof of one orbit, at the present precision.

    Raises
    ------
    Uncertain
        At the first step that fails.
    """

    def __init__(self, orbit, codes, events):
        self.orbit, self.codes = orbit, codes
        self.laws = TrainLaws(orbit.pair, orbit.tuning)
        if orbit.period % self.laws.repeats:
            raise Uncertain(
                "period",
                f"the excitation repeats after {self.laws.repeats} mesh periods, not after "
                f"{orbit.period}",
            )
        given = self.laws.start(orbit.state)
        self.centre, inverse = self._polished(given, events)
        system, n = self.path.equations, len(given)
        windows = Windows(self.path, codes, self.centre[n:])
        if windows.any():
            system = windows.equations
            self._check_derivative(windows)
            self.centre, inverse = polish(system, self.centre[:n], FOLD)
        self.box, self.moved = enclosed(system, self.centre, inverse, given)
        if windows.any():
            self.phases, self.speeds, ends, self.map = windows.proven(self.box)
            system = windows.equations_or_nothing
        else:
            self.speeds = check_contacts(self.path, codes, self.box)
            _, ends = self.path.states(self.box)
            self.phases = self.box[n:]
            self.map = self.path.monodromy(system(self.box, flint().ctx.prec)[1])
        self._check_period([ends[node] for node in self.path.ends])
        # Few bits suffice for a radius, but not for windows.
        with precision(flint().ctx.prec if windows.any() else COARSE):
            self.radius = self._radius(system, inverse)

    def _check_derivative(self, windows):
        """Hold the derivative through windows against that in the one order that was found.

        Differences would say nothing: at another place than their middle windows are as wide as the
        step to it.
        """
        n, path = 2 * len(self.laws.kept), self.path
        residuals, rows = path.equations(self.centre)
        check_derivative(path.equations, self.centre, residuals)
        ordered = path.monodromy(rows)
        _, rows = windows.equations(self.centre[:n])
        for i, j in product(range(n), repeat=2):
            apart = ordered[i, j] - (i == j) - rows[i][j]
            if not abs(apart).lower() < _SAME * max(1, abs(ordered[i, j])):
                raise Uncertain(*WRONG)

    def _radius(self, system, inverse, small=_SMALL):
        """Return the radius of uniqueness; `small` is one that shows how large it may be."""
        n = len(self.centre)
        for _ in range(_TRIES):
            shift = image(system, self.centre, [small] * n, inverse, [0] * n)
            # The share of a box that its image fills grows with the box.
            share = float(max(abs(s) for s in shift).upper()) / small
            if share < 1.0:
                break
            small *= _SMALL
        largest = min(LARGEST, small / _SMALL, 0.5 * small / max(share, small))
        return uniqueness(system, self.centre, inverse, FOLD, largest)

    def _polished(self, given, events):
        """Return (midpoints of a zero, inverse of the derivative); the contacts in their order."""
        n = len(given)
        start, events = self._ordered(given, events)
        for _ in range(_ORDERS):
            self.path = TrainPath(self.laws, self.codes, events, self.orbit.period)
            centre, inverse = polish(self.path.equations, [*start, *self.path.guess], FOLD)
            # What coincides has no order.
            if all(a - b < close() for a, b in pairwise(centre[n:])):
                break
            events = [(centre[n + i], *events[i][1:]) for i in _order(centre[n:])]
        return centre, inverse

    def _ordered(self, start, events):
        """Return state and events; where floats may have mixed up their order, in a better one."""
        phases = [phase for phase, *_ in events]
        if not any(b - a < _NEAR for a, b in pairwise(phases)):
            return start, events
        with precision(_SORTING):
            path = TrainPath(self.laws, self.codes, events, self.orbit.period, framed=False)
            centre, _ = polish(path.equations, [*start, *path.guess], FOLD)
        n = len(start)
        return centre[:n], [(centre[n + i], *events[i][1:]) for i in _order(centre[n:])]

    def _check_period(self, states):
        """Refuse an orbit that repeats earlier; `states` are those at the ends of its repeats."""
        period, repeats, n = self.orbit.period, self.laws.repeats, 2 * len(self.laws.kept)
        for count, state in enumerate(states, start=1):
            part = count * repeats
            end = (self.laws.basis * state).entries()[:n]
            if period % part == 0 and all(map(flint().arb.overlaps, end, self.box)):
                plural = "s" * (part > 1)
                raise Uncertain(
                    "period",
                    f"it repeats after {part} mesh period{plural} already, not after {period}",
                )

    def certificate(self, digits):
        """Return (the `TrainCertificate`, the digits that its enclosures have)."""
        orbit, laws, rate = self.orbit, self.laws, self.path.scale
        e, arb = len(laws.kept), flint().arb
        multipliers = eigenvalues(self.map)
        stability, reason = judge(multipliers)
        state = [arb(0)] * (2 * len(laws.parts.names))
        half = len(laws.parts.names)
        for i, row in enumerate(laws.kept):
            state[row], state[half + row] = self.box[i], self.box[e + i] * rate
        contacts = [node for node in self.path.nodes if node.phase is None]
        speeds = [speed * rate for speed in self.speeds]
        phases = self.phases
        numbers = [*state, *phases, *speeds]
        numbers += [part for one in multipliers for part in (one.real, one.imag)]
        within = partial(enclosure, digits=digits)
        names = [mesh.name for mesh in laws.parts.meshes]
        found = TrainCertificate(
            orbit.pair,
            orbit.tuning,
            orbit.period,
            tuple(names),
            tuple(self.codes),
            laws.parts.names,
            tuple(laws.parts.names[i] for i in laws.fixed),
            tuple(within(value) for value in state[:half]),
            tuple(within(value) for value in state[half:]),
            tuple(
                MeshEvent(within(phase), node.before, node.after, within(speed), names[node.mesh])
                for node, phase, speed in zip(contacts, phases, speeds, strict=True)
            ),
            self.radius,
            float(self.moved),
            tuple((within(one.real), within(one.imag)) for one in multipliers),
            stability,
            reason,
            digits,
            laws.parts.derived,
        )
        return found, min(digits_of(value) for value in numbers)


def _order(phases):
    """Return the numbers of phases in their order."""
    return sorted(range(len(phases)), key=phases.__getitem__)
