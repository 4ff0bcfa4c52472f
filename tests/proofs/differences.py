"""Equations of orbits and their derivatives by differences, in 70 digits: a second code of both.

It shares no code with gearlib. Motions are Taylor series in time, of one degree of freedom from the
numbers of a model, of trains from the file of a certificate.
"""

from dataclasses import dataclass

from mpmath import cos, lu_solve, matrix, mp, mpf, pi, sin, sqrt

from tests.proofs.trains_in_50_digits import Motion

#: Digits, the step of a difference, and what one is known to then.
DIGITS, STEP, KNOWN = 70, mpf(10) ** -34, mpf(10) ** -28
#: How far a series reaches by the norm of the law: ten digits cancel.
_REACH = 20


def flow(law, z, t):
    """Return a state after a time: law has (column, value) of each row of z' = A z."""
    largest = max(sum(abs(value) for _, value in row) for row in law)
    count = max(1, int(mp.ceil(abs(t) * largest / _REACH)))
    h = t / count
    for _ in range(count):
        term, total, k, least = z, list(z), 0, max(map(abs, z)) * mp.eps
        while k < 4 or max(map(abs, term)) > least:
            k += 1
            share = h / k
            term = [sum([a * term[j] for j, a in row]) * share for row in law]
            total = [a + b for a, b in zip(total, term, strict=True)]
        z = total
    return z


def differences(function, u):
    """Return the derivatives of a function of a list, a row for each of its values."""
    columns, at = [], function(u)
    for i in range(len(u)):
        there = function([v + (j == i) * STEP for j, v in enumerate(u)])
        columns.append([(b - a) / STEP for a, b in zip(at, there, strict=True)])
    return [list(row) for row in zip(*columns, strict=True)]


@dataclass
class Numbers:
    """A model of one degree of freedom, time in 1 / Omega_s."""

    near: mpf
    far: mpf  #: -inf: none
    levels: dict  #: contact code -> stiffness of every segment
    damping: dict  #: contact code -> b of x'' + 2 b x'
    ground: mpf
    load: mpf
    rows: list  #: (order, cosine, sine) of accelerations
    inertia: list  #: of the deviation, whose amplitudes go with the square of the frequency
    switches: list  #: (phase, segment that begins there) within a period
    first: int


def of_pair(pair):
    """Return the `Numbers` of a `GearPair`, from its SI numbers."""
    kappa, ratio = mpf(pair.stiffness_ratio), mpf(pair.contact_ratio)
    mean = mpf(pair.max_stiffness) * (kappa * (2 - ratio) + ratio - 1)
    unit = 2 * sqrt(mean * mpf(pair.reduced_mass))
    material, oil = mpf(pair.material_damping) / unit, mpf(pair.backlash_damping) / unit
    high = mpf(pair.max_stiffness) / mean
    far = -mpf(pair.backlash) * mean / mpf(pair.load)
    levels, drags = [high, high * kappa], {1: material, 0: oil, -1: material}
    ends = [(pi * (ratio - 1), 1), (2 * pi - pi * (ratio - 1), 0)]
    return Numbers(mpf(0), far, {1: levels, -1: levels}, drags, mpf(0), mpf(1), [], [], ends, 0)


def of_equation(equation):
    """Return the `Numbers` of another model, from those of its equation."""
    breaks = sorted({*map(float, equation.near.breaks), *map(float, equation.far.breaks)})[:-1]

    def level(side, at):
        owner = max(i for i, b in enumerate(side.breaks) if b <= at)
        return mpf(float(side.lines[owner][0]))

    levels = {
        code: [level(side, at) for at in breaks]
        for code, side in ((1, equation.near), (-1, equation.far))
    }
    switches = [(mpf(at), i) for i, at in enumerate(breaks) if i] + [(2 * pi, 0)]
    table = [
        [(int(n), mpf(a), mpf(b)) for n, a, b in rows.tolist()]
        for rows in (equation.force, equation.deviation)
    ]
    return Numbers(
        mpf(equation.upper), mpf(equation.lower), levels,
        {code: mpf(float(equation.damping[code + 1, 0])) / 2 for code in (1, 0, -1)},
        mpf(equation.ground), mpf(equation.load), *table, switches if len(breaks) > 1 else [], 0,
    )  # fmt: skip


class Orbit:
    """The equations of an orbit with contacts in a given order, as `gearlib` states them."""

    def __init__(self, numbers, contact, changes, period, start=0):
        """`changes` are (near phase, code after; None: a touch); start is a phase."""
        self.numbers, self.start = numbers, mpf(start)
        end = self.start + 2 * pi * period
        switches = [(at + 2 * pi * n, segment) for n in range(period + 1)
                    for at, segment in numbers.switches]  # fmt: skip
        passed = [segment for at, segment in switches if at < self.start]
        segment = passed[-1] if passed else numbers.first
        marks = [(at, following) for at, following in switches if self.start < at < end]
        marks += [(mpf(at), (after,)) for at, after in changes]
        self.arcs, begin = [], contact
        for at, what in [*sorted(marks, key=lambda mark: mark[0]), (end, segment)]:
            if isinstance(what, tuple):
                after = contact if what[0] is None else what[0]
                self.arcs.append((None, contact, segment, what[0], after))
                contact = after
            else:
                self.arcs.append((at, contact, segment, contact, contact))
                segment = what
        self.contact = begin

    def law(self, contact, segment, nu):
        """Return the rows of A of z' = A z, z = (x, x', 1, cos, sin, ...)."""
        n = self.numbers
        line, c = (n.near if contact == 1 else n.far), mpf(0)
        if contact:
            c = n.levels[contact][segment]
        push = [(0, -c - n.ground), (1, -2 * n.damping[contact]), (2, n.load)]
        if contact:
            push.append((2, c * line))
        rows = [(order, a, b) for order, a, b in n.rows]
        rows += [(order, -a * (order * nu) ** 2, -b * (order * nu) ** 2)
                 for order, a, b in n.inertia]  # fmt: skip
        found = [[(1, mpf(1))], push, []]
        for i, (order, a, b) in enumerate(rows):
            k = 3 + 2 * i
            push += [(k, a), (k + 1, b)]
            found += [[(k + 1, -order * nu)], [(k, order * nu)]]
        return found, [order for order, *_ in rows]

    def equations(self, u, scale=None):
        """Return the residuals; the last unknown is 1 / nu where it is not given."""
        (x, w), phases = u[:2], list(u[2:])
        scale = phases.pop() if scale is None else scale
        phases, last, found = iter(phases), self.start, []
        for at, contact, segment, goal, _ in self.arcs:
            phase = next(phases) if at is None else at
            law, orders = self.law(contact, segment, 1 / scale)
            waves = [f(order * last) for order in orders for f in (cos, sin)]
            x, w, *_ = flow(law, [x, w, mpf(1), *waves], (phase - last) * scale)
            if at is None:
                touch = goal is None
                near = contact == 1 if touch else 1 in (contact, goal)
                line = self.numbers.near if near else self.numbers.far
                found += [x - line, w] if touch else [x - line]
                x, w = line, mpf(0) if touch else w
            last = phase
        return [*found, x - u[0], w - u[1]]

    def off_lines(self, u, scale, count=24):
        """Return whether a motion is where its contacts say, at places within every arc."""
        (x, w), phases, last = u[:2], iter(u[2:]), self.start
        n = self.numbers
        for at, contact, segment, goal, _ in self.arcs:
            phase = next(phases) if at is None else at
            law, orders = self.law(contact, segment, 1 / scale)
            z = [x, w, mpf(1), *(f(order * last) for order in orders for f in (cos, sin))]
            for _ in range(count):
                z = flow(law, z, (phase - last) * scale / count)
                far = abs(z[0] - n.near) < KNOWN or abs(z[0] - n.far) < KNOWN
                if not far and contact != (1 if z[0] > n.near else -1 if z[0] < n.far else 0):
                    return False
            x, w, last = z[0], z[1], phase
            if at is None:
                x = n.near if 1 in (contact, goal) else n.far
        return True

    def deviations(self, phases, scale):
        """Return the map of small deviations for given phases of contact: a saltation at each."""
        phases, last, columns = iter(phases), self.start, [[mpf(1), mpf(0)], [mpf(0), mpf(1)]]
        for at, contact, segment, _, after in self.arcs:
            phase = next(phases) if at is None else at
            law = [row for row in self.law(contact, segment, 1 / scale)[0][:2]]
            law = [[(j, value) for j, value in row if j < 2] for row in law]
            columns = [flow(law, column, (phase - last) * scale) for column in columns]
            # By how much the acceleration jumps at a speed of 1, on the line.
            jump = 2 * (self.numbers.damping[contact] - self.numbers.damping[after])
            columns = [[x, w + jump * x] for x, w in columns]
            last = phase
        return columns

    def invariants(self, u):
        """Return trace and determinant of that map; the last unknown is 1 / nu."""
        (a, c), (b, d) = self.deviations(u[2:-1], u[-1])
        return [a + d, a * d - b * c]


def eliminated(rows, n):
    """Return the map of small deviations of n components: the phases follow from the state."""
    k = len(rows) - n
    back = matrix([row[:n] for row in rows[k:]]) + mp.eye(n)
    if not k:
        return back
    by_phase = matrix([row[n:] for row in rows[:k]])
    for j in range(n):
        rates = lu_solve(by_phase, matrix([row[j] for row in rows[:k]]))
        change = matrix([row[n:] for row in rows[k:]]) * rates
        for i in range(n):
            back[i, j] -= change[i]
    return back


class TrainOrbit(Motion):
    """The equations of an orbit of a train, in static deflections and by phase over nu."""

    def equations(self, u, events):
        """Return the residuals; events are (mesh, code before, code after) in their order."""
        n, e, nu = self.n, len(self.kept), mpf(float.fromhex(self.claim["tuning"]))
        z = [mpf(0)] * (2 * n) + [mpf(1)] + [mpf(1), mpf(0)] * len(self.frequencies)
        for i, k in enumerate(self.kept):
            z[k], z[n + k] = u[i] * self.length, u[e + i] * self.length / nu
        end, found, codes, last = 2 * pi * self.claim["period"], [], list(self.codes), mpf(0)
        cuts = sorted({*(cut for mesh in self.meshes for cut in mesh.cuts(end)), end})
        marks = [(b, None) for a, b in zip([mpf(0), *cuts], cuts, strict=False) if b - a > 1e-40]
        marks += [(phase, what) for phase, what in zip(u[2 * e :], events, strict=True)]
        for phase, what in sorted(marks, key=lambda mark: mark[0]):
            z = flow(self.law((last + phase) / 2, codes), z, phase - last)
            last = phase
            if what:
                mesh, before, after = what
                row, _ = self.functional(self.meshes[mesh], 1 if 1 in (before, after) else 0)
                found.append(sum(a * b for a, b in zip(row, z, strict=True)) / self.length)
                codes[mesh] = after
        ends = [*self.reduced(z[:n]), *(nu * rate for rate in self.reduced(z[n : 2 * n]))]
        return [*found, *(a / self.length - b for a, b in zip(ends, u, strict=False))]

    def returned(self, u):
        """Return by how much the state does not return; the contacts are found on the way."""
        e, nu = len(self.kept), mpf(float.fromhex(self.claim["tuning"]))
        rates = [value * self.length / nu for value in u[e:]]
        ends, *_ = self.run([value * self.length for value in u[:e]], rates)
        ends = [*ends[:e], *(nu * rate for rate in ends[e:])]
        return [a / self.length - b for a, b in zip(ends, u, strict=True)]
