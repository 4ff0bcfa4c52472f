"""Random gear pairs with an orbit each, what a candidate says, and candidates that are wrong."""

from dataclasses import replace

import numpy as np

import gearlib
from gearlib.analysis.orbits.shooting import NoOrbit
from gearlib.engines import orbit as columns


def random_orbit(seed):
    """Return the `Orbit` of a random pair at a random tuning; None where none was found.

    All kinds of ends: constant stiffness, no damping, over-damped, no or endless backlash.
    """
    rng = np.random.default_rng(seed)
    ratio, heavy = rng.uniform(1.02, 1.98), rng.uniform(0.02, 0.2)
    pair = gearlib.GearPair.from_ratios(
        contact_ratio=float(rng.choice([1.0, 2.0, ratio], p=[0.03, 0.03, 0.94])),
        stiffness_ratio=float(rng.uniform(0.2, 1.0)),
        damping=float(rng.choice([0.0, 0.1 * heavy, heavy, 1.3], p=[0.1, 0.4, 0.47, 0.03])),
        backlash_damping=float(rng.choice([0.0, rng.uniform(0.0, 0.2)])),
        backlash=float(rng.choice([0.0, np.inf, rng.uniform(0.1, 8.0)], p=[0.05, 0.1, 0.85])),
    )
    guess = None if rng.random() < 0.3 else tuple(rng.normal(0.0, 1.5, 2))
    tuning = float(rng.uniform(0.3, 2.4))
    for period in rng.permutation([1, 2, 3, 4])[:2]:
        try:
            orbit = gearlib.periodic_orbit(pair, tuning, guess=guess, period=int(period))
        except NoOrbit:
            continue
        return orbit
    return None


def random_other_orbit(seed):
    """Return the `Orbit` of a random model of one degree of freedom under harmonics, or None."""
    rng = np.random.default_rng(seed)

    def waves(size):
        return gearlib.Harmonics(*(tuple(size * rng.normal(0.0, 1.0, rng.integers(3)))
                                   for _ in range(2)))  # fmt: skip

    if seed % 2:
        pair = gearlib.GearPair.from_ratios(
            contact_ratio=float(rng.uniform(1.1, 1.9)),
            stiffness_ratio=float(rng.uniform(0.3, 0.9)),
            damping=float(rng.uniform(0.02, 0.1)),
            backlash_damping=float(rng.choice([0.0, 0.03])),
            backlash=float(rng.uniform(0.5, 5.0)),
        )
        model = gearlib.OneDegreePair(
            pair=pair,
            excitation=waves(0.1 * pair.load),
            deviation=waves(0.1 * pair.static_deflection),
        )
    else:
        steps = gearlib.Steps((0.0, float(rng.uniform(1.0, 5.0))), (1.0, 0.6))
        model = gearlib.DeadZoneOscillator(
            upper_edge=float(rng.uniform(-0.5, 2.0)),
            lower_edge=float(rng.choice([-0.8, -2.0, -np.inf])),
            upper_stiffness=steps if rng.random() < 0.5 else 1.2,
            lower_stiffness=1.5 if rng.random() < 0.5 else None,
            damping=float(rng.choice([0.0, 0.05])),
            upper_damping=0.1,
            ground_stiffness=float(rng.choice([0.0, 0.1])),
            load=float(rng.uniform(0.1, 0.6)),
            forcing=waves(0.4),
        )
    tuning, guess = float(rng.uniform(0.4, 2.4)), tuple(rng.normal(0.0, 1.5, 2))
    for period in rng.permutation([1, 2, 3]):
        try:
            orbit = gearlib.periodic_orbit(model, tuning, guess=guess, period=int(period))
        except NoOrbit:
            continue
        return orbit
    return None


def extrema_apart(found, orbit):
    """Return how far the extrema of a certificate lie from those of its candidate, a run."""
    propagator = orbit.pair.propagator(orbit.tuning)
    summary = propagator.record(orbit.state, orbit.period, 10_000).summary
    return max(
        abs(float(found.displacement_min) - summary[columns.X_MIN]),
        abs(float(found.displacement_max) - summary[columns.X_MAX]),
    )


def never_right(orbit, rng):
    """Yield (status of the refusal, candidate) of candidates that no orbit is near to."""
    away = rng.normal(size=2)
    away *= 10.0 ** rng.uniform(-7.0, -1.0) / np.abs(away * [1.0, orbit.tuning]).max()
    yield ("distance", "contacts", "fold"), replace(orbit, state=orbit.state + away)
    yield ("period", "contacts"), replace(orbit, period=2 * orbit.period)
    shorter = orbit.pattern[2:] if len(orbit.pattern) > 2 else (*orbit.pattern, 0, 1)
    yield ("contacts",), replace(orbit, pattern=shorter)


def mostly_wrong(orbit):
    """Yield candidates with a parameter that is not theirs: an orbit may lie that close to them."""
    pair = orbit.pair
    for name in ("max_stiffness", "stiffness_ratio", "material_damping", "load", "backlash"):
        changed = pair.replace(**{name: getattr(pair, name) * (1.0 - 1e-5)})
        if changed != pair:
            yield replace(orbit, pair=changed)
    yield replace(orbit, tuning=orbit.tuning * (1.0 + 1e-5))
