"""Another way through the same equations: DOP853 and the terminal events of scipy."""

import math

import mpmath
import numpy as np
from scipy.integrate import solve_ivp

from tests.references.reference_equations import machine_of
from tests.references.reference_motion import Step, cuts_of, first_codes, start_of, watched


def by_scipy(model, tuning, periods, state=(0.0, 0.0), rtol=1e-12):
    """Return the state at the end as of `Motion.state`, by DOP853 and terminal events."""
    context = mpmath.fp
    machine = machine_of(model, tuning, context)
    machine.inverse = machine.inverse_mass()
    n, unit = machine.n, machine.length
    q, v = start_of(machine, state)
    cuts, codes = cuts_of(machine, periods, 1e-13), None
    codes, tau, z = first_codes(machine, q, v, cuts[0] / 2, 4), 0.0, np.append(q, v) / unit
    events = 0
    for stop in cuts:
        middle = (tau + stop) / 2
        while tau < stop:

            def field(at, y, codes=codes, middle=middle):
                step = Step(machine, at, y[:n] * unit, y[n:] * unit, codes, middle, 1)
                return np.append(y[n:], 2.0 * step.series[2] / unit)

            lines = [
                (j, side, sign, after)
                for j, contact in enumerate(machine.contacts)
                for side, sign, after in watched(contact, codes[j])
            ]
            functions = []
            for _, side, sign, _ in lines:

                def line(at, y, side=side, sign=sign):
                    return sign * machine.distance(side, y[:n] * unit, at) / unit

                line.terminal, line.direction = True, -1
                functions.append(line)
            done = solve_ivp(
                field, (tau, stop), z, method="DOP853", rtol=rtol, atol=rtol, events=functions
            )
            tau, z = done.t[-1], done.y[:, -1]
            for (j, _, _, after), times in zip(lines, done.t_events, strict=True):
                if done.status == 1 and times.size and times[-1] == tau:
                    codes, events = [*codes[:j], after, *codes[j + 1 :]], events + 1
            assert math.isfinite(tau)
    return z, events
