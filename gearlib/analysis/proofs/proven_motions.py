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
from gearlib.analysis.proofs.arcs import moved
from gearlib.analysis.proofs.balls import enclosure, flint, precision
from gearlib.analysis.proofs.candidate import listed_contacts, run_contacts
from gearlib.analysis.proofs.certificate_files import MotionCertificate, Refusal, Uncertain, listed
from gearlib.analysis.proofs.multipliers import largest_eigenvalue
from gearlib.analysis.proofs.orbits import Proof, certify, pattern_of, state_of
from gearlib.analysis.proofs.path import COAST, CONTACT, DRIVE, Path
from gearlib.analysis.proofs.signs import CROSSING, TOUCHING, check_contacts
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
        rest on the flank. Of a train all its components, off the flank lines.
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
    model = orbit.pair
    if model.equation is None:
        state = tuple(model.propagator(orbit.tuning).start(initial_state).tolist())
    else:
        state = checks.state("initial_state", initial_state)
    periods = checks.integer("periods", periods, 1)
    if found.stability != "stable":
        return Refusal("trap", f"the orbit is not proven to be stable: {found.reason}")
    try:
        contacts = listed_contacts(orbit)
        bits = _BITS
        while True:
            with precision(bits):
                trap = Trap(Proof(orbit, *contacts))
                run = _arrival(trap, orbit, state, periods)
                if run is not None:
                    return _certificate(found, state, trap, *run)
            bits *= 2
            if bits > _MOST_BITS:
                raise Uncertain("precision", f"{_MOST_BITS} bits do not carry the motion so far")
    except Uncertain as reason:
        return Refusal(*reason.args)


def _certificate(found, state, trap, count, arrival, pattern, run):
    within, names = partial(enclosure, digits=found.digits), ()
    arrived = state_of(trap.laws, arrival, trap.scale, found.digits)
    if trap.laws.framed:
        names = trap.laws.mesh_names
    return MotionCertificate(
        found,
        state,
        count,
        pattern,
        listed(run, found.digits, names),
        arrived,
        trap.basis,
        trap.radius,
        tuple(map(within, trap.phases)),
        trap.rate,
    )


class Trap:
    """An ellipsoid about the state of a stable orbit: z + V y with |y| <= radius."""

    def __init__(self, proof):
        self.laws, self.scale = proof.laws, proof.scale
        n, events = 2 * len(proof.laws.kept), proof.contacts()
        self.centre, guesses = proof.box[:n], proof.phases
        if len(proof.box) < n + len(events):
            raise Uncertain("together", "contacts come together: no trap is proven of them")
        self.path = Path(proof.laws, proof.codes, events, proof.orbit.period, framed=False)
        rows = np.array([[float(value.mid()) for value in row] for row in proof.map.tolist()])
        # y^T y = z^T Q z falls by z^T z from period to period.
        q = solve_discrete_lyapunov(rows.T, np.eye(n))
        basis = np.linalg.inv(np.linalg.cholesky(q).T)
        #: V, a row after the other, exact numbers.
        self.basis = tuple(basis.ravel().tolist())
        self.matrix = flint().arb_mat(basis.tolist())
        self.inverse = self.matrix.inv()
        self.radius = _FIRST
        for _ in range(_HALVINGS):
            try:
                self.rate = self._contraction(guesses)
            except Uncertain:
                self.rate = math.inf
            if self.rate < 1.0:
                return
            self.radius *= 0.5
        raise Uncertain("trap", "no ellipse was found that the period map contracts")

    def _contraction(self, guesses):
        """Return a bound of the norm of the derivative of the period map over the ellipsoid."""
        module, n = flint(), len(self.centre)
        spread = (self.matrix * module.arb_mat([[module.arb(0, self.radius)]] * n)).entries()
        state = [c + y for c, y in zip(self.centre, spread, strict=True)]
        arcs, ends, phases = carry(self.path, state, self.scale, guesses)
        check_contacts(self.path, arcs, ends, phases)
        found = [p for node, p in zip(self.path.nodes, phases, strict=True) if node.phase is None]
        #: Of the contacts of all motions from there.
        self.phases = found
        whole = self.inverse * self.path.deviations(arcs, ends) * self.matrix
        largest = largest_eigenvalue(whole.transpose() * whole).sqrt().upper()
        return math.nextafter(float(largest), math.inf)

    def holds(self, state):
        """Return whether a state is proven to lie in the ellipsoid."""
        away = flint().arb_mat([[a - b] for a, b in zip(state, self.centre, strict=True)])
        y = (self.inverse * away).entries()
        return sum((one**2 for one in y), flint().arb(0)) < self.radius**2


def carry(path, state, scale, guesses):
    """Return arcs, ends and phases of all motions from a ball of states, as `Path.states`.

    The phases of the contacts follow from the states; `guesses` are where they are looked for.
    """
    laws, z, last, guesses = path.laws, path.column(state), path.start, iter(guesses)
    arcs, ends, phases = [], [], []
    for node in path.nodes:
        start = z
        if node.phase is not None:
            phase, t = node.phase, (node.phase - last) * scale
            z = moved(node.law, z, t)
        else:
            row = laws.distances[node.mesh][node.side]
            t = _crossing(node.law, z, row, ((next(guesses) - last) * scale).mid())
            z, phase = moved(node.law, z, t), last + t / scale
            place = laws.on_line(node.side, False)
            z = z if place is None else place * z
        arcs.append((start, t))
        ends.append(z)
        phases.append(phase)
        last = phase
    return arcs, ends, phases


def _crossing(law, z, row, t):
    """Return the ball of times at which motions cross a flank line, one time each, near `t`."""
    arb = flint().arb
    goal = abs(t) * arb(2) ** (8 - flint().ctx.prec)
    rate = row * law.matrix

    def at(z, t):
        there = moved(law, z, t)
        return (row * there)[0, 0], (rate * there)[0, 0]

    for _ in range(_CORRECTIONS):
        distance, speed = at(z.mid(), t)
        step = (distance / speed).mid()
        t = (t - step).mid()
        if abs(step) <= goal:
            break
    distance, speed = at(z, t)
    reach = (abs(distance) / abs(speed)).upper() + goal
    for factor in _FACTORS:
        around = arb(t, (factor * reach).upper())
        newton = t - distance / at(z, around)[1]
        if around.contains_interior(newton):
            return newton
    raise Uncertain("grazing", "a contact is not proven to be a crossing for all motions")


def _arrival(trap, orbit, given, periods):
    """Follow the motion into the trap.

    Returns (mesh periods, state there, contact codes in the order met, contacts as of
    `Proof.contacts`, phases from the start); None: the precision is lost.
    """
    laws, scale, turn = trap.laws, trap.scale, 2 * flint().arb.pi()
    state, begin, run = laws.start(given), None, []
    for count in range(0, periods + 1, laws.repeats):
        if count % orbit.period == 0 and trap.holds(state):
            return count, state, (*begin, *(one[3] for one in run)) if begin else (), run
        if any(value.rad() > _LOST for value in state):
            return None
        first, codes = _start(laws, Path(laws, [BACKLASH] * len(laws.mesh_names), [], 1), state)
        displacement, velocity = laws.spread(state, scale)
        candidate = np.array([float(value.mid()) for value in (*displacement, *velocity)])
        found, events, _ = run_contacts(orbit.pair, orbit.tuning, candidate, laws.repeats)
        if found != codes:
            raise Uncertain("arrival", f"at mesh period {count} a contact may be at its start")
        path = Path(laws, codes, events, laws.repeats, framed=False)
        arcs, ends, phases = carry(path, state, scale, path.guess)
        rates = iter(check_contacts(path, arcs, ends, phases, first))
        if begin is None:
            begin = pattern_of(codes, ())
        run += [
            (phase + count * turn, node.mesh, node.before, node.after, next(rates) * scale)
            for node, phase in zip(path.nodes, phases, strict=True)
            if node.kind == CONTACT
        ]
        state = (laws.basis * ends[-1]).entries()[: len(state)]
    raise Uncertain("arrival", f"after {periods} mesh periods the motion is not in the trap")


def _start(laws, path, state):
    """Return (flank line that a state lies on, see `check_contacts`, contact codes from there)."""
    z, codes, on_line = path.column(state), [], None
    for mesh, (coast, drive) in enumerate(laws.distances):
        if not laws.framed:
            for side, above, below in ((DRIVE, NORMAL, BACKLASH), (COAST, BACKLASH, INVERSE)):
                if laws.lines[side] is not None and state[0] == laws.lines[side]:
                    below = INVERSE if laws.lines[0] is laws.lines[1] else below
                    if state[1] != 0:
                        return (mesh, side, CROSSING), [above if state[1] > 0 else below]
                    # There is no force from the flank.
                    free = laws.law([BACKLASH], laws.segments[0][1]).matrix
                    pull = (laws.distances[0][side] * free * free * z)[0, 0]
                    if not (pull > 0 or pull < 0):
                        raise Uncertain(
                            "arrival", "where a start at rest on the line leads to is open"
                        )
                    return (mesh, side, TOUCHING), [above if pull > 0 else below]
        if (drive * z)[0, 0] > 0:
            codes.append(NORMAL)
        else:
            codes.append(INVERSE if coast is not None and (coast * z)[0, 0] < 0 else BACKLASH)
    return on_line, codes
