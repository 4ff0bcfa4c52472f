"""Gear trains beside scipy split at events, heyoka and a yardstick: whole calls; how costs grow.

Processor seconds of one thread, methods in turns, the least of several rounds: other work on the
machine only adds. All calls start from the same state, ours with empty tables; what heyoka
compiles is compiled before. Errors are those over the first periods without the free rotation,
against DOP853 split at a tolerance of 1e-13.

``python -m benchmarks.trains PICTURE`` draws how costs grow.
"""

import sys
import time
from functools import partial

import numpy as np

from benchmarks import train_yardstick
from benchmarks.short import repeats
from gearlib import idler, integrators, planetary, sweep
from gearlib.studies.trials.difficult_problems import PAPER

ROUNDS = repeats(4)
#: Mesh periods of the errors.
FEW = 3
#: Speeds that ours takes in one call: its tables depend on them in part only.
MANY = 16
SCIPY = ("scipy", {"solver": "DOP853", "events": True, "rtol": 1e-11, "atol": 1e-11})
FINER = ("scipy", {"solver": "DOP853", "events": True, "rtol": 1e-13, "atol": 1e-13})
#: (name, mesh frequency in Hz, mesh periods before the start)
SPEEDS = (("bouncing at 1475 Hz", 1475.0, 400), ("in contact at 1930 Hz", 1930.0, 0))
#: The yardstick goes there as well.
FAST = ("in contact at 2500 Hz", 2500.0, 0)


def speed_trial(planets=3, **changes):
    """Return the planetary train of the trial: mean 5e8 N/m, jump 1.5e8, contact 1.4 and 1.6."""
    lower = [5e8 - 1.5e8 * (epsilon - 1.0) for epsilon in (1.4, 1.6)]
    kappa = tuple(low / (low + 1.5e8) for low in lower)
    # So all planets are in phase for every number of them; 27 and 99 for three.
    teeth = (9 * planets, 33 * planets)
    return planetary(planets=planets, teeth=teeth, stiffness_ratio=kappa, **changes)


def tuning_of(train, frequency):
    """Return the tuning of a mesh frequency in Hz."""
    return frequency * 2.0 * np.pi / train.reference_angular_frequency


def run(train, tuning, state, periods, method=None, options=None):
    """Run as users do; return the final state without the free rotation, and the whole of it."""
    table = sweep(
        train,
        [tuning],
        periods=periods,
        record_periods=1,
        initial_state=state,
        method=method,
        options=options,
        threads=1,
    )
    end = table.final_state.values[0]
    return train.reduction()[0] @ end, tuple(end), float(table.bounces.max())


def per_period(calls):
    """Return name -> seconds per mesh period of calls (call, periods), in turns, the least."""
    best: dict = {}
    for _ in range(ROUNDS):
        for name, (call, periods) in calls.items():
            start = time.process_time()
            call(periods)
            spent = (time.process_time() - start) / periods
            best[name] = min(best.get(name, spent), spent)
    return best


def tables(train, tuning, state):
    """Return seconds for all tables of one speed: a run with empty ones less one with full ones."""
    samples, events, summary = train.empty_record(events=0)
    spent = []
    for _ in range(ROUNDS):
        start = time.process_time()
        propagator = train.propagator(tuning)
        times = [start]
        for _ in range(2):
            propagator.run(np.array(state), 2, 1, samples, events, 10**6, summary)
            times.append(time.process_time())
        spent.append(2.0 * times[1] - times[0] - times[2])
    return min(spent)


def start(train, tuning, before):
    """Return the state after some mesh periods from rest in static equilibrium."""
    state = tuple(train.start_state("static"))
    return run(train, tuning, state, before)[1] if before else state


def compared(title, train, tuning, before, periods=(400, 4, 100)):
    """Return rows (name, value, unit) of one train; periods of ours, scipy's, heyoka's calls."""
    state = start(train, tuning, before)
    ways = {"exact": (None, None), "scipy DOP853 split, rtol 1e-11": SCIPY}
    if integrators.about("heyoka").available:
        ways["heyoka with terminal events"] = ("heyoka", {})
    expected, _, bounces = run(train, tuning, state, FEW, *FINER)
    errors, calls = {}, {}
    for (name, way), count in zip(ways.items(), periods, strict=False):
        errors[name] = np.abs(run(train, tuning, state, FEW, *way)[0] - expected).max()
        method, options = way
        calls[name] = partial(run, train, tuning, state, method=method, options=options), count
    near = tuning * np.linspace(0.999, 1.001, MANY)
    call = partial(sweep, train, near, record_periods=1, initial_state=state, threads=1)
    calls["many"] = (lambda count: call(periods=count)), periods[0]
    best = per_period(calls)
    many = best.pop("many") / MANY
    table = [(f"{title}, {bounces:g} bounces a period", np.nan, "")]
    for name, spent in best.items():
        note = f"us per mesh period, error {errors[name]:.1g}"
        table.append((f"  {name}, {calls[name][1]} periods", spent * 1e6, note))
    table.append((f"  exact, each of {MANY} speeds in one call", many * 1e6, ""))
    for name, spent in best.items():
        if name != "exact":
            table += [
                (f"  exact is faster than {name}", spent / best["exact"], "times"),
                (f"  each of {MANY} speeds", spent / many, "times"),
            ]
    table.append(("  all tables of this speed", tables(train, tuning, state) * 1e3, "ms"))
    return table


def rows():
    """Return rows (name, value, unit)."""
    train = speed_trial()
    table = []
    for name, frequency, before in SPEEDS:
        title = f"planetary train, 18 degrees, 6 meshes, {name}"
        table += compared(title, train, tuning_of(train, frequency), before)
    tunings = [tuning_of(train, frequency) for _, frequency, _ in (*SPEEDS, FAST)]
    cases = [
        (f"planetary train, {name}", frequency, tuning, start(train, tuning, before))
        for (name, frequency, before), tuning in zip((*SPEEDS, FAST), tunings, strict=True)
    ]
    table += train_yardstick.rows(train, cases, run)
    two = idler(PAPER.replace(backlash_damping=PAPER.material_damping))
    table += compared("idler, 3 degrees, 2 meshes", two, 0.55, 300, (2000, 20, 400))
    return table


def growth():
    """Return rows (degrees, meshes, seconds per mesh period in resonance, above it) of trains.

    Planetary trains of 2 to 8 planets, axes elastic or fixed, at the first natural frequency of a
    rotational mode (1475 Hz for three planets) and 1.3 times that.
    """
    found = []
    for fixed in (False, True):
        for planets in range(2, 9):
            more = {"support_stiffness": (np.inf,) * 4} if fixed else {}
            train = speed_trial(planets, **more)
            modes, spent = train.modes(), []
            rotational = modes.natural_frequency.values[modes.mode_kind.values == "rotational"]
            first = rotational[rotational > 1.0].min()
            for frequency in (first, 1.3 * first):
                tuning = tuning_of(train, frequency)
                state, bounces = run(train, tuning, tuple(train.start_state("static")), 400)[1:]
                print(f"{planets} planets, {frequency:.0f} Hz: {bounces:g} bounces a period")
                call = partial(run, train, tuning, state)
                best = per_period({n: (call, n) for n in (50, 250)})
                # The slope: without the start of a call and its tables.
                spent.append((250 * best[250] - 50 * best[50]) / 200)
            found.append((train.size // 2, len(train.meshes), *spent))
            print(*found[-1][:2], *(f"{1e6 * s:.3g} us" for s in found[-1][2:]), flush=True)
    return np.array(found)


def draw(path):
    """Draw the growth of costs into a picture."""
    from matplotlib.figure import Figure

    found = growth()
    figure = Figure((6.3, 2.8), layout="constrained")
    axes = figure.subplots(1, 2, sharey=True)
    looks = (("elastic axes", "o", "C0", found[:7]), ("fixed axes", "s", "C1", found[7:]))
    for axis, column, words, ticks in (
        (axes[0], 0, "degrees of freedom", (5, 7, 11, 15, 21, 33)),
        (axes[1], 1, "meshes", (4, 6, 8, 10, 12, 16)),
    ):
        for words_of, marker, colour, own in looks:
            for k, kind, fill in ((2, "in resonance", colour), (3, "above it", "white")):
                label, look = f"{words_of}, {kind}", {"marker": marker, "mfc": fill}
                axis.plot(own[:, column], 1e6 * own[:, k], color=colour, label=label, **look)
        axis.set(xlabel=words, xscale="log", yscale="log")
        axis.set_xticks(ticks, map(str, ticks))
        axis.set_xticks([], minor=True)
    axes[0].set_ylabel("µs per mesh period")
    axes[1].legend(fontsize=7)
    figure.savefig(path, dpi=150)


def main():
    """Print the rows, or draw the growth if a path is given."""
    if len(sys.argv) > 1:
        draw(sys.argv[1])
        return
    for name, value, unit in rows():
        print(f"{name:70s} {value:10.3g} {unit}")


if __name__ == "__main__":
    main()
