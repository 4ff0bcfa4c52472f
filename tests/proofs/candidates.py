"""Orbits of random gear pairs, and candidates for certificates that are wrong."""

from dataclasses import replace

import numpy as np

import gearlib
from gearlib.analysis.orbits.shooting import NoOrbit
from gearlib.engines import orbit as columns


def random_orbit(seed):
    """Return the `Orbit` of a random pair at a random tuning, None where none was found.

    Some pairs have constant stiffness, no damping, a damping ratio above 1, no or endless backlash.
    """
    rng = np.random.default_rng(seed)
    ratio, damping = rng.uniform(1.02, 1.98), rng.uniform(0.02, 0.2)
    pair = gearlib.GearPair.from_ratios(
        contact_ratio=float(rng.choice([1.0, 2.0, ratio], p=[0.03, 0.03, 0.94])),
        stiffness_ratio=float(rng.uniform(0.2, 1.0)),
        damping=float(rng.choice([0.0, 0.1 * damping, damping, 1.3], p=[0.1, 0.4, 0.47, 0.03])),
        backlash_damping=float(rng.choice([0.0, rng.uniform(0.0, 0.2)])),
        backlash=float(rng.choice([0.0, np.inf, rng.uniform(0.1, 8.0)], p=[0.05, 0.1, 0.85])),
    )
    guess = None if rng.random() < 0.3 else tuple(rng.normal(0.0, 1.5, 2))
    tuning = float(rng.uniform(0.3, 2.4))
    for period in rng.permutation([1, 2, 3, 4])[:2]:
        try:
            return gearlib.periodic_orbit(pair, tuning, guess=guess, period=int(period))
        except NoOrbit:
            continue
    return None


def difference_of_extrema(certificate, orbit):
    """Return the largest difference of the extrema of a certificate and of a run of its orbit."""
    propagator = orbit.pair.propagator(orbit.tuning)
    summary = propagator.record(orbit.state, orbit.period, 10_000).summary
    return max(
        abs(float(certificate.displacement_min) - summary[columns.X_MIN]),
        abs(float(certificate.displacement_max) - summary[columns.X_MAX]),
    )


def candidates_without_orbit(orbit, rng):
    """Yield (allowed statuses of the refusal, candidate that no orbit is near to)."""
    shift = rng.normal(size=2)
    shift *= 10.0 ** rng.uniform(-7.0, -1.0) / np.abs(shift * [1.0, orbit.tuning]).max()
    yield ("distance", "contacts", "fold"), replace(orbit, state=orbit.state + shift)
    yield ("period", "contacts"), replace(orbit, period=2 * orbit.period)
    shorter = orbit.pattern[2:] if len(orbit.pattern) > 2 else (*orbit.pattern, 0, 1)
    yield ("contacts",), replace(orbit, pattern=shorter)


def candidates_of_another_pair(orbit):
    """Yield candidates with a parameter that differs by 1e-5; an orbit may lie close to them."""
    pair = orbit.pair
    for name in ("max_stiffness", "stiffness_ratio", "material_damping", "load", "backlash"):
        changed = pair.replace(**{name: getattr(pair, name) * (1.0 - 1e-5)})
        if changed != pair:
            yield replace(orbit, pair=changed)
    yield replace(orbit, tuning=orbit.tuning * (1.0 + 1e-5))
