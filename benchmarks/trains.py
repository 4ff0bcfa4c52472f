"""Gear trains beside scipy split at events, heyoka and a yardstick: whole calls; how costs grow.

Processor seconds of one thread, methods in turns, the least of several rounds: other work on the
machine only adds. All calls start from the same state, ours with empty tables unless those of an
earlier call, which a train keeps, are said; what heyoka compiles is compiled before. Errors are
those over the first periods without the free rotation, against DOP853 split at a tolerance of
1e-13.

``python -m benchmarks.trains PICTURE`` draws how costs grow. Set ``OPENBLAS_NUM_THREADS=1``, as
jobs of the workflow do: threads of the linear algebra library would count.
"""

import dataclasses
import resource
import sys
import time
from functools import partial

import numpy as np

from benchmarks import train_yardstick
from benchmarks.short import repeats
from gearlib import GearTrain, idler, integrators, planetary, sweep, two_stage
from gearlib.engines import orbit
from gearlib.engines.orbit import Span
from gearlib.studies.trials.difficult_problems import PAPER

ROUNDS = repeats(4)
#: Mesh periods of the errors.
FEW = 3
#: How many planets, and stages, the growth of costs is measured with.
PLANETS, STAGES = (2, 3, 4, 6, 8, 12, 16, 20), (1, 2, 4, 7, 10, 14, 20)
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
    teeth = {"teeth": (9 * planets, 33 * planets)}
    return planetary(planets=planets, stiffness_ratio=kappa, **(teeth | changes))


def parting(planets):
    """Return a lightly damped train whose planets are all at other phases."""
    train = speed_trial(planets, teeth=(9 * planets + 1, 33 * planets - 1))
    films = {"material_damping": 50.0, "backlash_damping": 15.0}
    bodies = [
        dataclasses.replace(body, support_damping=tuple(0.05 * x for x in body.support_damping))
        for body in train.bodies
    ]
    meshes = [dataclasses.replace(mesh, **films) for mesh in train.meshes]
    return train.replace(meshes=meshes, bodies=bodies)


def tuning_of(train, frequency):
    """Return the tuning of a mesh frequency in Hz."""
    return frequency * 2.0 * np.pi / train.reference_angular_frequency


def emptied(train):
    """Take the tables of earlier calls from a train, and return it."""
    vars(train).pop("_frame", None)
    return train


def run(train, tuning, state, periods, method=None, options=None, again=False):
    """Run as users do; return the final state without the free rotation, and the whole of it.

    `again` with the tables of an earlier call.
    """
    if not again:
        emptied(train)
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
    spent = []
    for _ in range(ROUNDS):
        start = time.process_time()
        propagator = emptied(train).propagator(tuning)
        times = [start]
        for _ in range(2):
            propagator.run(state, Span(2, 1, 10**6), keep_events=False)
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
    if integrators.describe_method("heyoka").available:
        ways["heyoka with terminal events"] = ("heyoka", {})
    expected, _, bounces = run(train, tuning, state, FEW, *FINER)
    errors, calls = {}, {}
    for (name, way), count in zip(ways.items(), periods, strict=False):
        errors[name] = np.abs(run(train, tuning, state, FEW, *way)[0] - expected).max()
        method, options = way
        calls[name] = partial(run, train, tuning, state, method=method, options=options), count
    kept = "exact, tables of an earlier call"
    errors[kept] = errors["exact"]
    calls[kept] = partial(run, train, tuning, state, again=True), periods[0]
    near = tuning * np.linspace(0.999, 1.001, MANY)
    call = partial(sweep, tunings=near, record_periods=1, initial_state=state, threads=1)
    calls["many"] = (lambda count: call(emptied(train), periods=count)), periods[0]
    best = per_period(calls)
    many = best.pop("many") / MANY
    table = [(f"{title}, {bounces:g} bounces a period", np.nan, "")]
    for name, spent in best.items():
        note = f"us per mesh period, error {errors[name]:.1g}"
        table.append((f"  {name}, {calls[name][1]} periods", spent * 1e6, note))
    table.append((f"  exact, each of {MANY} speeds in one call", many * 1e6, ""))
    for name, spent in best.items():
        if not name.startswith("exact"):
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


def stages(count, teeth, axes):
    """Return a chain of stages of the paper's pair, `axes` their support stiffness in N/m."""
    pair = PAPER.replace(backlash_damping=PAPER.material_damping)
    one = two_stage(pair, teeth=2 * teeth, support_stiffness=axes)
    bodies, meshes, shafts, gain = [], [], [], teeth[1] / teeth[0]
    for i in range(count):
        names = f"pinion {i + 1}", f"wheel {i + 1}"
        # Forces grow from stage to stage; every other one turns the other way.
        way, force = (-1) ** i, pair.load * gain**i
        for k, name in enumerate(names):
            body, own = one.bodies[k], force * (way * (i == count - 1) if k else i == 0)
            torque = own * body.base_radius
            bodies.append(dataclasses.replace(body, name=name, torque=torque))
        parts = {"name": f"mesh {i + 1}", "pinion": names[0], "wheel": names[1]}
        meshes.append(dataclasses.replace(one.meshes[i % 2], phase=None, **parts))
        if i:
            ends = f"wheel {i}", names[0]
            shafts.append(dataclasses.replace(one.shafts[0], bodies=ends))
    return GearTrain(bodies=bodies, meshes=meshes, shafts=shafts)


def grown():
    """Yield (family, train, tunings at which contact is lost and not).

    Planetary trains at the first natural frequency of a rotational mode (1475 Hz for three planets)
    and 1.3 times that; chains of equal stages on elastic axes.
    """
    for planets in PLANETS:
        train = speed_trial(planets)
        modes = train.modes()
        rotational = modes.natural_frequency.values[modes.mode_kind.values == "rotational"]
        first = tuning_of(train, rotational[rotational > 1.0].min())
        yield "planets", train, (first, 1.3 * first)
    for count in STAGES:
        yield "stages", stages(count, (24, 24), 1e8), (1.0, 2.5)


def table_bytes(propagator):
    """Return what the combinations in use take in the tables of a propagator's last run."""
    tables = (propagator.unused_large_tables or propagator.unused_tables)[0][1]
    all_bytes = sum(table.nbytes for table in tables if table.ndim > 2)
    return tables.combination_count[0] * all_bytes / len(tables.keys)


def growth():
    """Return dict family -> rows (coordinates, meshes, twice seconds a period, bounces, MB).

    Of the motion that 40 mesh periods from rest lead to, with contact lost and kept: so far equal
    planets move together.
    """
    found: dict = {}
    for family, train, tunings in grown():
        row = [train.size // 2, len(train.meshes)]
        for tuning in tunings:
            state = np.array(train.start_state("static"))
            propagator, spent = train.propagator(tuning), []
            few = 20
            state = propagator.run(state, Span(2 * few, 1, 10**6), keep_events=False).state
            for _ in range(ROUNDS + 1):
                start = time.process_time()
                record = propagator.run(state, Span(few, 1, 10**6), keep_events=False)
                spent.append((time.process_time() - start) / few)
            assert record.status == 0, (family, row, tuning)
            bounces = record.summary[:, orbit.BOUNCES].max()
            row += [min(spent[1:]), bounces, table_bytes(propagator) / 1e6]
        found.setdefault(family, []).append(row)
        print(family, *(f"{value:.3g}" for value in row), flush=True)
    return {family: np.array(rows) for family, rows in found.items()}


def to_the_end():
    """Print what long ways cost: ten stages that hardly ever repeat, twenty planets that part."""
    twenty, apart = speed_trial(20), parting(20)
    for name, train, tuning, periods, size in (
        ("ten stages of 23:71", stages(10, (23, 71), np.inf), 0.8, 100, 0.0),
        ("the same on elastic axes", stages(10, (23, 71), 1e8), 0.8, 100, 0.0),
        ("twenty planets", twenty, tuning_of(twenty, 1391.0), 60, 0.0),
        ("twenty that part one after the other", apart, tuning_of(apart, 1700.0), 1000, 3.0),
    ):
        before = time.process_time()
        propagator, state = train.propagator(tuning), np.array(train.start_state("static"))
        state[: train.size // 2] += size * np.sin(1.7 * np.arange(train.size // 2))
        status = propagator.run(state, Span(periods, 1, 10**6), keep_events=False).status
        spent = time.process_time() - before
        tables = (propagator.unused_large_tables or propagator.unused_tables)[0][1]
        most = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
        print(
            f"{name}, {train.size // 2} coordinates, repeats after {train.repeats:.3g} periods: "
            f"{spent:.3g} s for {periods} periods, status {status}, "
            f"{tables.combination_count[0]} combinations with modes, "
            f"{table_bytes(propagator) / 1e6:.3g} MB of tables, process {most:.0f} MiB",
            flush=True,
        )


def draw(path):
    """Draw the growth of costs into a picture."""
    from matplotlib.figure import Figure

    found = growth()
    figure = Figure((6.3, 2.8), layout="constrained")
    axes = figure.subplots(1, 3)
    looks = {"planets": ("planetary train", "o", "C0"), "stages": ("chain of stages", "s", "C1")}
    for family, rows in found.items():
        words, marker, colour = looks[family]
        for k, kind, fill in ((2, "in resonance", colour), (5, "above it", "white")):
            look = {"marker": marker, "color": colour, "mfc": fill, "ms": 4, "lw": 1}
            label = f"{words}, {kind}"
            axes[0].plot(rows[:, 0], 1e6 * rows[:, k], label=label, **look)
            axes[1].plot(rows[:, 1], 1e6 * rows[:, k], **look)
            axes[2].plot(rows[:, 0], rows[:, k + 2], **look)
    for axis, words, unit, ticks in (
        (axes[0], "coordinates", "µs per mesh period", (6, 12, 24, 60, 120)),
        (axes[1], "meshes", "µs per mesh period", (1, 2, 4, 10, 20, 40)),
        (axes[2], "coordinates", "MB of tables", (6, 12, 24, 60, 120)),
    ):
        axis.set(xlabel=words, ylabel=unit, xscale="log", yscale="log")
        axis.set_xticks(ticks, map(str, ticks))
        axis.set_xticks([], minor=True)
    figure.legend(loc="outside upper center", ncols=2, fontsize=7)
    figure.savefig(path, dpi=150)


def main():
    """Print the rows, or draw the growth if a path is given."""
    if len(sys.argv) > 1:
        draw(sys.argv[1])
        to_the_end()
        return
    for name, value, unit in rows():
        print(f"{name:70s} {value:10.3g} {unit}")


if __name__ == "__main__":
    main()
