"""What derivatives cost: whole calls of `simulate` with and without them, processor seconds.

Those of a pair by closed forms, and by matrices of a model of one degree and of two trains.
"""

import time

from benchmarks.short import repeats
from gearlib import (
    OneDegreePair,
    continue_orbit,
    periodic_orbit,
    planetary,
    simulate,
    split_power_reducer,
)

ROUNDS = repeats(15)
SEVEN = (
    "stiffness_ratio",
    "contact_ratio",
    "reduced_mass",
    "load",
    "backlash",
    "material_damping",
    "backlash_damping",
)
OF_MESHES = ("max_stiffness", *(name for name in SEVEN if name not in ("reduced_mass", "load")))


def least(*calls, rounds=ROUNDS):
    """Return the least processor seconds of each call, taken in turns, after one not counted."""
    best = [float("inf")] * len(calls)
    for call in calls:
        call()
    for _ in range(rounds):
        for i, call in enumerate(calls):
            start = time.process_time()
            call()
            best[i] = min(best[i], time.process_time() - start)
    return best


def rows(damped, chaotic, paper):
    """Return rows (name, value, unit) for a pair that settles, one that does not, and trains.

    The branches of the reducer are those of the pair `paper`, in SI units, so that its shafts are
    some hundred times as stiff as a mesh.
    """
    table = []
    for words, pair, periods, record in (
        ("settled, 120 periods, 1 recorded", damped, 120, 1),
        ("settled, 120 periods, 24 recorded", damped, 120, 24),
        ("chaotic, 120 periods, 24 recorded", chaotic, 120, 24),
        ("chaotic, 20 000 periods, 1 recorded", chaotic, 20_000, 1),
    ):
        options = {"periods": periods, "record_periods": record}

        def plain(pair=pair, options=options):
            return simulate(pair, 0.9, **options)

        def seven(pair=pair, options=options):
            return simulate(pair, 0.9, sensitivities=SEVEN, **options)

        without, with_all = least(plain, seven)
        table += [
            (f"seven derivatives, {words}", with_all * 1e3, "ms"),
            ("  to the run without them", with_all / without, "times"),
        ]
    train = planetary(stiffness_ratio=(0.7, 0.7), reference_frequency=1475.7)
    for words, model, tuning, periods in (
        ("one degree by matrices, 120 periods", OneDegreePair(pair=damped), 0.9, 120),
        ("planetary train, bouncing, 12 periods", train, 1.0, 12),
        ("reducer, 12 periods", split_power_reducer(paper), 0.7, 12),
    ):
        # A train has no reduced mass.
        names = SEVEN if model.mesh else (*OF_MESHES, "load")

        def without_any(model=model, tuning=tuning, periods=periods):
            return simulate(model, tuning, periods=periods)

        def with_seven(model=model, tuning=tuning, periods=periods, names=names):
            return simulate(model, tuning, periods=periods, sensitivities=names)

        without, with_all = least(without_any, with_seven, rounds=repeats(3))
        table += [
            (f"seven derivatives, {words}", with_all * 1e3, "ms"),
            ("  to the run without them", with_all / without, "times"),
        ]
    orbit = periodic_orbit(damped, 0.5)
    (branch,) = least(lambda: continue_orbit(orbit, to=1.4))
    return [*table, ("a branch of orbits, tuning 0.5 to 1.4", branch * 1e3, "ms")]
