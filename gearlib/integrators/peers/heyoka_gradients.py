"""heyoka's variational equations of a `GearPair`, from event to event: derivatives of its own.

The variations go along with the state, by the ratios and the tuning. At an event they go on as they
are, for nothing in the package knows that the event moves.
"""

import math
from functools import cache

import numpy as np

from gearlib.kernels.closed_form.mesh_constants import contact_of
from gearlib.kernels.codes import BACKLASH, INVERSE
from gearlib.models.stiffness import segment_lengths

#: Of the ratios and the tuning, then of the phase: in contact, C_max, far flank.
_RATIOS = 6
_MOST_EVENTS = 10_000
#: Phase after an event within which it is not found again.
_COOLDOWN = 1e-10


@cache
def _compiled():
    """Return (integrator, its compiled dimension) with the events of both flank lines."""
    import heyoka as hy

    x, v = hy.make_vars("x", "v")
    contact, kappa, beta, oil, gap, nu = (hy.par[i] for i in range(_RATIOS))
    touching, high, far = (hy.par[_RATIOS + i] for i in range(3))
    mean = kappa + (1.0 - kappa) * (contact - 1.0)
    stiffness = (high + (1.0 - high) * kappa) / mean
    loss = touching * beta + (1.0 - touching) * oil
    push = touching * stiffness * (x + far * gap)
    system = [(x, v), (v, (1.0 - push) / (nu * nu) - 2.0 * loss / nu * v)]
    variational = hy.var_ode_sys(system, [hy.par[i] for i in range(_RATIOS)], order=1)
    events = [hy.t_event(line, cooldown=_COOLDOWN) for line in (x, x + gap)]
    start = np.zeros(2 + 2 * _RATIOS)
    return hy.taylor_adaptive(variational, start, t_events=events, compact_mode=True)


def derivatives(pair, tuning, state, periods):
    """Return the derivatives of the final state by `GearPair.RATIOS` and the tuning, (6, 2)."""
    values = [getattr(pair, name) for name in pair.RATIOS]
    # An endless backlash has its line where no motion comes.
    values[4] = min(values[4], 1e9)
    ta, gap = _compiled(), values[4]
    half_high, whole_low = segment_lengths(pair.contact_ratio)
    ta.time = 0.0
    ta.state[:] = 0.0
    ta.state[:2] = state
    ta.pars[:_RATIOS] = [*values, tuning]
    ta.reset_cooldowns()
    contact, events = contact_of(gap, *map(float, state)), 0
    for n in range(periods):
        start = 2.0 * math.pi * n
        for high, end in (
            (1.0, half_high),
            (0.0, half_high + whole_low),
            (1.0, 2.0 * math.pi),
        ):
            ta.pars[_RATIOS + 1] = high
            while ta.time < start + end:
                ta.pars[_RATIOS] = float(contact != BACKLASH)
                ta.pars[_RATIOS + 2] = float(contact == INVERSE)
                code = int(ta.propagate_until(start + end)[0])
                events += 1
                if events > _MOST_EVENTS:
                    return np.full((_RATIOS, 2), math.nan)
                which = -code - 1
                if which not in (0, 1):
                    break
                contact = contact_of(gap, (0.0, -gap)[which], float(ta.state[1]))
    return ta.state[2:].reshape(2, _RATIOS).T.copy()
