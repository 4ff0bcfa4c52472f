"""`certify_motion`: that the motion from a state tends to an orbit, by a run that is proven.

The run goes from contact to contact in balls: each is enclosed by Newton's method for intervals,
that there is none before it follows as for orbits. It ends in a *trap*, an ellipse about the
orbit's state that the period map contracts, so that all motions from the ellipse tend to the orbit.
"""

import math
from functools import partial

import numpy as np
from scipy.linalg import solve_discrete_lyapunov

from gearlib import checks
from gearlib.analysis.proofs.balls import enclosure, flint, precision
from gearlib.analysis.proofs.certificates import MotionCertificate, Refusal, listed
from gearlib.analysis.proofs.orbits import Proof, certify, listed_contacts, run_contacts
from gearlib.analysis.proofs.path import Path, Uncertain, product
from gearlib.analysis.proofs.signs import CROSSING, OFF, TOUCHING, check_contacts
from gearlib.kernels.codes import BACKLASH, INVERSE, NORMAL

#: Radius of the first trap that is tried, in its own measure, and how often it is halved.
_FIRST, _HALVINGS = 0.1, 24
#: Bits of the first run, and of the last that is tried; a ball beyond this radius is lost.
_BITS, _MOST_BITS, _LOST = 512, 16384, 1e-12
#: Corrections of the phase of a contact, and factors by which its enclosure is widened.
_CORRECTIONS, _FACTORS = 16, (1.5, 3.0, 10.0)


def certify_motion(orbit, initial_state=(0.0, 0.0), *, periods=2000):
    """Prove that the motion from a state tends to a stable orbit.

    Parameters
    ----------
    orbit : Orbit
        As of `gearlib.certify`.
    initial_state : tuple of float, shape (2,)
        Displacement in static deflections and dx/dtau at tau = 0, exact numbers; by default at
        rest on the flank.
    periods : int, default 2000
        Mesh periods after which the motion has to be near the orbit.

    Returns
    -------
    MotionCertificate or Refusal

    Raises
    ------
    ValueError
        Naming the argument, its value and the allowed range.
    ImportError
        Without python-flint.
    """
    found = certify(orbit)
    if not found:
        return found
    state = checks.state("initial_state", initial_state)
    periods = checks.integer("periods", periods, 1)
    if found.stability != "stable":
        return Refusal("trap", f"the orbit is not proven to be stable: {found.reason}")
    try:
        contact, events = listed_contacts(orbit)
        bits = _BITS
        while True:
            with precision(bits):
                trap = Trap(Proof(orbit, contact, events))
                run = _arrival(trap, orbit, state, periods)
                if run is not None:
                    return _certificate(found, state, trap, *run)
            bits *= 2
            if bits > _MOST_BITS:
                raise Uncertain("precision", f"{_MOST_BITS} bits do not carry the motion so far")
    except Uncertain as reason:
        return Refusal(*reason.args)


def _certificate(found, state, trap, count, arrival, pattern, run):
    within = partial(enclosure, digits=found.digits)
    return MotionCertificate(
        found,
        state,
        count,
        pattern,
        listed(run, found.digits),
        tuple(map(within, arrival)),
        trap.basis,
        trap.radius,
        tuple(map(within, trap.phases)),
        trap.rate,
    )


class Trap:
    """An ellipse about the state of a stable orbit: z + V y with |y| <= radius.

    Raises
    ------
    Uncertain
        If none is found.
    """

    def __init__(self, proof):
        arb = flint().arb
        self.centre, self.laws = proof.box[:2], proof.laws
        matrix, _ = proof.path.monodromy([t for *_, t in proof.states])
        rows = np.array([float(arb(entry).mid()) for entry in matrix]).reshape(2, 2)
        # y^T y = z^T Q z falls by z^T z from period to period.
        q = solve_discrete_lyapunov(rows.T, np.eye(2))
        #: V, a row after the other, exact numbers.
        self.basis = tuple(np.linalg.inv(np.linalg.cholesky(q).T).ravel().tolist())
        a, b, c, d = map(arb, self.basis)
        share = a * d - b * c
        self.inverse = d / share, -b / share, -c / share, a / share
        self.radius = _FIRST
        for _ in range(_HALVINGS):
            try:
                self.rate = self._contraction(proof)
            except Uncertain:
                self.rate = math.inf
            if self.rate < 1.0:
                return
            self.radius *= 0.5
        raise Uncertain("trap", "no ellipse was found that the period map contracts")

    def _contraction(self, proof):
        """Return a bound of the norm of the derivative of the period map over the ellipse."""
        y, (a, b, c, d) = flint().arb(0, self.radius), self.basis
        x, w = self.centre[0] + a * y + b * y, self.centre[1] + c * y + d * y
        states = carry(proof.path, x, w, proof.scale, proof.centre[2:])
        check_contacts(proof.path, (x, w), states)
        #: Of the contacts of all motions from there.
        self.phases = [p for p, *_ in proof.path.contacts(states, proof.scale)]
        matrix, _ = proof.path.monodromy([t for *_, t in states])
        p, q, r, s = product(self.inverse, product(matrix, self.basis))
        # The larger eigenvalue of the square.
        one, two, mixed = p * p + r * r, q * q + s * s, p * q + r * s
        root = (((one - two) / 2) ** 2 + mixed * mixed).sqrt()
        largest = ((one + two) / 2 + root).sqrt().upper()
        return math.nextafter(float(largest), math.inf)

    def holds(self, x, w):
        """Return whether a state is proven to lie in the ellipse."""
        a, b, c, d = self.inverse
        u, v = x - self.centre[0], w - self.centre[1]
        return (a * u + b * v) ** 2 + (c * u + d * v) ** 2 < self.radius**2


def carry(path, x, w, scale, guesses):
    """Return the states at the nodes of all motions from a ball of states, as `Path.states`.

    The phases of the contacts follow from the states; `guesses` are where they are looked for.

    Raises
    ------
    Uncertain
        If a contact is not proven for all of them.
    """
    found, last, guesses = [], path.start, iter(guesses)
    for node in path.nodes:
        if node.phase is not None:
            phase, t = node.phase, (node.phase - last) * scale
            x, w, _ = node.law.go(x, w, t, last)
        else:
            line = path.line(node)
            t = _crossing(node.law, x, w, last, line, ((next(guesses) - last) * scale).mid())
            _, w, _ = node.law.go(x, w, t, last)
            x, phase = line, last + t / scale
        found.append((x, w, phase, t))
        last = phase
    return found


def _crossing(law, x, w, phase, line, t):
    """Return the ball of times at which motions cross a flank line, one time each, near `t`."""
    arb = flint().arb

    goal = abs(t) * arb(2) ** (8 - flint().ctx.prec)
    for _ in range(_CORRECTIONS):
        y, v, _ = law.go(x.mid(), w.mid(), t, phase)
        step = ((y - line) / v).mid()
        t = (t - step).mid()
        if abs(step) <= goal:
            break
    y, v, _ = law.go(x, w, t, phase)
    reach = (abs(y - line) / abs(v)).upper() + goal
    for factor in _FACTORS:
        around = arb(t, (factor * reach).upper())
        _, speed, _ = law.go(x, w, around, phase)
        newton = t - (y - line) / speed
        if around.contains_interior(newton):
            return newton
    raise Uncertain("grazing", "a contact is not proven to be a crossing for all motions")


def _arrival(trap, orbit, state, periods):
    """Follow the motion into the trap.

    Returns (mesh periods, displacement and dx/dtau there, contact codes in the order met, contacts
    as of `Path.contacts`, phases from the start); None: the precision is lost.
    """
    arb, laws = flint().arb, trap.laws
    scale, turn = 1 / arb(orbit.tuning), 2 * arb.pi()
    x, w = arb(state[0]), arb(state[1]) * orbit.tuning
    begin, run = (), []
    for count in range(periods + 1):
        if count % orbit.period == 0 and trap.holds(x, w):
            return count, (x, w * scale), (*begin, *(after for _, _, after, _ in run)), run
        if x.rad() > _LOST or w.rad() > _LOST:
            return None
        first, contact = _start(laws, x, w)
        candidate = np.array([float(x.mid()), float((w * scale).mid())])
        found, events = run_contacts(orbit.pair, orbit.tuning, candidate, 1)
        if found != contact:
            raise Uncertain("arrival", f"at mesh period {count} a contact may be at its start")
        path = Path(laws, contact, events, 1)
        states = carry(path, x, w, scale, path.guess)
        check_contacts(path, (x, w), states, first)
        begin = begin or (contact,)
        run += [(p + count * turn, *rest) for p, *rest in path.contacts(states, scale)]
        x, w, _, _ = states[-1]
    raise Uncertain("arrival", f"after {periods} mesh periods the motion is not in the trap")


def _start(laws, x, w):
    """Return (how a state lies to the flank lines, contact code of the motion from it)."""
    for line, above, below in ((laws.near, NORMAL, BACKLASH), (laws.far, BACKLASH, INVERSE)):
        if line is not None and x == line:
            below = INVERSE if laws.near is laws.far else below
            if w == 0:
                # There is no force from the flank.
                pull = laws.law(BACKLASH, laws.first).acceleration(x, w, 0)
                if not (pull > 0 or pull < 0):
                    raise Uncertain("arrival", "where a start at rest on the line leads to is open")
                return TOUCHING, above if pull > 0 else below
            return CROSSING, above if w > 0 else below
    if x > laws.near:
        return OFF, NORMAL
    return OFF, INVERSE if laws.far is not None and x < laws.far else BACKLASH
