"""What derivatives cost: whole calls of `simulate` with and without them, processor seconds."""

import time

from gearlib import continue_orbit, periodic_orbit, simulate

ROUNDS = 15
SEVEN = (
    "stiffness_ratio",
    "contact_ratio",
    "reduced_mass",
    "load",
    "backlash",
    "material_damping",
    "backlash_damping",
)


def least(*calls):
    """Return the least processor seconds of each call, taken in turns, after one not counted."""
    best = [float("inf")] * len(calls)
    for call in calls:
        call()
    for _ in range(ROUNDS):
        for i, call in enumerate(calls):
            start = time.process_time()
            call()
            best[i] = min(best[i], time.process_time() - start)
    return best


def rows(damped, chaotic):
    """Return rows (name, value, unit) for a pair that settles and one that does not."""
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
    orbit = periodic_orbit(damped, 0.5)
    (branch,) = least(lambda: continue_orbit(orbit, to=1.4))
    return [*table, ("a branch of orbits, tuning 0.5 to 1.4", branch * 1e3, "ms")]
