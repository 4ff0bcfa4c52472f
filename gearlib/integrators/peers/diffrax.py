"""diffrax: Dormand-Prince pairs in JAX, one compiled run per phase, ended by events."""

from functools import cache, partial

import numpy as np

from gearlib import checks
from gearlib.data import status
from gearlib.integrators.each import run_each
from gearlib.integrators.models_with_steps import MODELS, takes
from gearlib.integrators.option import Option
from gearlib.integrators.peers import contact_branches
from gearlib.integrators.peers.package import Package
from gearlib.integrators.right_hand_sides import problem_of
from gearlib.integrators.split import NEAR, Phase, Split, Stall, within_range
from gearlib.kernels.codes import BACKLASH, INVERSE, NORMAL

__all__ = ["EVENTS", "MODELS", "OPTIONS", "ORDER", "PACKAGE", "run", "run_many", "takes"]

PACKAGE = Package("diffrax", "diffrax")
#: That of the solver.
ORDER = None
EVENTS = "switches end a run, contact is an event with a direction, found by Newton"
SOLVERS = ("Dopri8", "Dopri5", "Tsit5")
OPTIONS = {
    "rtol": Option(1e-10, checks.finite_positive, "relative tolerance of a step"),
    "atol": Option(
        1e-10, checks.finite_positive, "absolute tolerance, static deflections and dx/dtau"
    ),
    # Events are found on the dense output, which in the long steps of Dopri8 is the coarser one.
    "solver": Option("Dopri5", partial(checks.one_of, choices=SOLVERS), f"one of {SOLVERS}"),
}
#: Most steps in one phase.
_MOST_STEPS = 4096


def run(pair, tuning, state, *arguments, rtol, atol, solver):
    """Run one tuning; see `gearlib.integrators`."""
    import jax

    law = pair.law(tuning)
    # Only within the run: the precision that the caller's own JAX works in is not ours to set.
    with jax.enable_x64(True):
        one = _Run(problem_of(pair, tuning), law, solver, rtol, atol)
        return one.run(state, *arguments)


def run_many(pair, *arguments, **options):
    """Run many tunings; see `gearlib.integrators`."""
    run_each(partial(run, pair, **options), *arguments)


@cache
def _compiled(name, forces, stiffnesses):
    """Return (phase, period, record, stages) of a solver, compiled for numbers of harmonics."""
    import diffrax
    import jax
    import jax.numpy as jnp
    import optimistix

    solver, rows = getattr(diffrax, name)(), contact_branches.ROWS

    def waves(t, p, first, count):
        rows = p[first : first + 3 * count].reshape(count, 3)
        return (rows[:, 1] * jnp.cos(rows[:, 0] * t) + rows[:, 2] * jnp.sin(rows[:, 0] * t)).sum()

    def rate(t, z, arguments):
        p = arguments[0]
        x, v = z
        c = p[3] + p[4] * (t - p[5]) + waves(t, p, rows + 3 * forces, stiffnesses)
        u, speed = x + p[7], abs(v)
        push = p[6] * c * (u + (p[8] * abs(u) + p[9] * u * u) * u)
        return v, waves(t, p, rows, forces) - (p[0] + (p[1] + p[2] * speed) * speed) * v - push

    def leaving(j):
        def value(t, y, args, **_):
            shift, direction, offset = args[1][j]
            return direction * (y[0] + shift) + offset

        return value

    event = diffrax.Event(
        [leaving(0), leaving(1)], optimistix.Newton(1e-12, 1e-12), direction=[True, True]
    )

    def solve(start, end, z, numbers, exits, rtol, atol, saveat, steps):
        return diffrax.diffeqsolve(
            diffrax.ODETerm(rate),
            solver,
            start,
            end,
            None,
            (z[0], z[1]),
            (numbers, exits),
            saveat=saveat,
            stepsize_controller=diffrax.PIDController(rtol, atol),
            event=event,
            max_steps=steps,
            throw=False,
        )

    @jax.jit
    def phase(start, end, z, numbers, exits, rtol, atol):
        saved = diffrax.SaveAt(t1=True)
        done = solve(start, end, z, numbers, exits, rtol, atol, saved, _MOST_STEPS)
        good = diffrax.is_okay(done.result)
        head = jnp.stack([done.ts[-1], done.ys[0][-1], done.ys[1][-1]])
        code = jnp.stack([good, done.stats["num_steps"], *done.event_mask]).astype(jnp.int64)
        return head, code

    @jax.jit
    def period(carry, breaks, numbers, exits, after, rtol, atol, limit, off):
        """Go through one mesh period, all phases of it compiled into one loop."""

        def under_way(state):
            _, _, _, good, piece, _, runs = state
            return good & (piece < breaks.size - 1) & (runs < limit)

        def one(state):
            z, contact, steps, good, piece, t, runs = state
            leave = exits[contact + 1]
            saved, end = diffrax.SaveAt(t1=True), breaks[piece + 1]
            done = solve(
                t, end, z, numbers[contact + 1, piece], leave, rtol, atol, saved, _MOST_STEPS
            )
            x, v = done.ys[0][-1], done.ys[1][-1]
            first, second = done.event_mask
            hit, j = first | second, jnp.where(first, 0, 1)
            x = jnp.where(hit, leave[j, 1] * off - leave[j, 0], x)
            return (
                jnp.stack([x, v]),
                jnp.where(hit, after[contact + 1, j], contact),
                steps + done.stats["num_steps"],
                good & diffrax.is_okay(done.result),
                jnp.where(hit, piece, piece + 1),
                jnp.where(hit, done.ts[-1], end),
                runs + 1,
            )

        z, contact, steps, good, fits = carry
        start = z, contact, steps, good, 0, 0.0, 0
        z, contact, steps, good, piece, _, _ = jax.lax.while_loop(under_way, one, start)
        return z, contact, steps, good, fits & (~good | (piece == breaks.size - 1))

    @jax.jit
    def record(start, end, z, numbers, exits, rtol, atol, times):
        saved = diffrax.SaveAt(
            subs=[diffrax.SubSaveAt(ts=times), diffrax.SubSaveAt(t0=True, steps=True)]
        )
        done = solve(start, end, z, numbers, exits, rtol, atol, saved, _MOST_STEPS)
        return [(t, jnp.stack(z, 1)) for t, z in zip(done.ts, done.ys, strict=True)]

    return phase, period, record, solver.tableau.num_stages


class _Run(Split):
    """A new run for each phase."""

    def __init__(self, problem, law, solver, *tolerances):
        super().__init__(problem)
        self.law, self.tolerances = law, tolerances
        sizes = len(law.force), len(law.stiffness)
        self.phase, self.period, self.recorded, self.stages = _compiled(solver, *sizes)
        self._branches = {}

    def _branch(self, piece, contact):
        import jax.numpy as jnp

        key = piece, contact
        if key not in self._branches:
            # Direction 0 and offset -1: no second exit.
            exits = np.array([[0.0, 0.0, -1.0]] * 2)
            leaves = self.exits(np.array([contact]))
            for row, leave in zip(exits, leaves, strict=False):
                row[:] = (0.0 if leave.line == NEAR else self.law.gap), leave.direction, 0.0
            numbers = contact_branches.pack(self.law, piece, contact)
            # Behind no flank there is no distance to it.
            numbers[7] = numbers[7] if np.isfinite(numbers[7]) else 0.0
            self._branches[key] = jnp.array(numbers), jnp.array(exits), *self.tolerances
        return self._branches[key]

    def skip(self, z, codes):
        """Go through the unrecorded periods; a call of JAX takes longer than a phase."""
        import jax.numpy as jnp

        contacts, pieces = (INVERSE, BACKLASH, NORMAL), range(len(self.problem.starts) - 1)
        branches_of = [[self._branch(piece, code) for piece in pieces] for code in contacts]
        numbers = jnp.stack([jnp.stack([branch[0] for branch in row]) for row in branches_of])
        exits = jnp.stack([row[0][1] for row in branches_of])
        after = np.zeros((3, 2), dtype=int)
        for row, code in zip(after, contacts, strict=True):
            afters = [leave.after for leave in self.exits(np.array([code]))]
            row[: len(afters)] = afters
        table = jnp.array(self.problem.starts), numbers, exits, jnp.array(after)
        options = *self.tolerances, self.limit, self.OFF
        carry = (
            jnp.array(z),
            jnp.array(int(codes[0])),
            jnp.array(0),
            jnp.array(True),
            jnp.array(True),
        )
        for n in range(self.first):
            if n >= self.strobe:
                self.add_strobe(n, np.asarray(carry[0]))
            carry = self.period(carry, *table, *options)
        z, contact, steps, good, fits = carry
        self.evaluations += int(steps) * self.stages
        z, code = np.array(z), status.OK
        if not within_range(z):
            code = status.OVERFLOW
        elif not good:
            code = status.STALLED
        elif not fits:
            code = status.EVENT_LIMIT
        return self.first, z, np.array([int(contact)]), code

    def solve(self, n, start, end, z, segment, codes, exits):
        """Take one phase; see `Split`."""
        before = start, end, z, *self._branch(segment, int(codes[0]))
        head, code = self.phase(*before)
        (t, *after), (good, steps, first, second) = np.asarray(head), np.asarray(code).tolist()
        if not good:
            raise Stall
        self.evaluations += steps * self.stages
        hit = 0 if first else (1 if second else None)
        t, after = (end if hit is None else float(t)), np.array(after)
        if not self.keep:
            return Phase(t, after, hit)
        # Of one length, so that it is compiled once; evaluations for the record do not count.
        wanted = np.full(self.per_period + 2, end)

        def dense(times):
            wanted[: len(times)] = times
            return np.asarray(self.recorded(*before, wanted)[0][1])[: len(times)]

        ends, states = map(np.asarray, self.recorded(*before, wanted)[1])
        points = [(at, y) for at, y in zip(ends, states, strict=True) if at < t]
        return Phase(t, after, hit, [*points, (t, after.copy())], dense)
