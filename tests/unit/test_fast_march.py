"""The fast march takes the same orbits as the plain one: thousands of random meshes."""

import math

import numpy as np
import pytest

from gearlib.core.fast_march import advance, new_desk, set_mesh, set_start
from gearlib.core.march import ARC_COLUMNS, march_period
from gearlib.core.mesh import contact_of, mesh
from gearlib.stiffness import levels, stretches

PERIODS = 8
LIMIT = 10**6


def random_case(rng):
    """Return (ratios, tuning, x, v) over all regimes, exact special values included."""

    def choose(usual, *special):
        return rng.choice(special) if rng.random() < 0.2 else usual

    contact_ratio = choose(rng.uniform(1.0, 2.0), 1.0, 2.0, 1.569)
    stiffness_ratio = choose(rng.uniform(0.05, 1.0), 1.0, 0.5879)
    damping = choose(10 ** rng.uniform(-3, 0.5), 0.0, 0.0617, 1.0)
    drag = choose(10 ** rng.uniform(-3, 0.5), 0.0, 0.0617)
    gap = choose(10 ** rng.uniform(-2, 1), 0.0, 4.0, math.inf)
    tuning = 10 ** rng.uniform(-1.2, 0.5)
    x = choose(rng.uniform(-6.0, 4.0), 0.0, -gap if math.isfinite(gap) else 0.0)
    v = choose(rng.uniform(-3.0, 3.0), 0.0)
    ratios = np.array(
        [*levels(contact_ratio, stiffness_ratio), *stretches(contact_ratio), damping, drag, gap]
    )
    return ratios, tuning, x, v


def fast_and_plain(m, x, v, periods):
    """Return the final (contact, x, v) of the fast and of the plain march."""
    no_arcs = np.empty((0, ARC_COLUMNS))
    start = contact_of(m.gap, x, v)
    desk = new_desk()
    set_mesh(desk, m)
    set_start(desk, x, v)
    *fast, count = advance(m, desk, 0, start, x, v, periods, LIMIT, no_arcs)
    assert count <= LIMIT
    plain = start, x, v
    for _ in range(periods):
        plain = march_period(m, *plain, no_arcs, LIMIT)[:3]
    return fast, plain


@pytest.mark.parametrize("seed", range(4))
def test_fast_march_equals_plain_march(seed):
    rng = np.random.default_rng(seed)
    worst = 0.0
    for _ in range(2000):
        ratios, tuning, x, v = random_case(rng)
        m = mesh(ratios, tuning)
        fast, plain = fast_and_plain(m, x, v, PERIODS)
        # What rounding alone does to this orbit: the plain march from a start moved by one part
        # in 1e13, a thousand roundings. Chaotic and undamped orbits amplify it by any factor.
        _, moved = fast_and_plain(m, x + 1e-13 * max(1.0, abs(x)), v, PERIODS)
        spread = abs(moved[1] - plain[1]) + abs(moved[2] - plain[2])
        scale = 1.0 + abs(plain[1]) + abs(plain[2])
        error = abs(fast[1] - plain[1]) + abs(fast[2] - plain[2])
        assert error <= 1e-11 * scale + 3.0 * spread, (ratios, tuning, x, v, fast, plain)
        worst = max(worst, error / scale) if spread < 1e-11 else worst
    assert worst < 1e-11
