"""The tuning at which the motion from rest jumps, as each method computes it, and its cost.

Every tuning of the scan starts from rest, and the jump is one of the orbit's height, as in
`gearlib.studies.jump`. A method may switch between the orbits many times; all switches of its scan
are kept, and the largest one, refined by bisection, is its jump. The cost is the number of
evaluations of the right-hand side.
"""

import math
from typing import NamedTuple

import numpy as np

from gearlib.data.result import result_of_many
from gearlib.models.pair import GearPair
from gearlib.studies import jump
from gearlib.studies.trials import problems, work_precision
from gearlib.studies.trials.work_precision import Line

#: scipy's right-hand side is Python: what fits into a minute.
SCIPY = [
    Line("scipy RK45", "controlled", "rtol", (1e-3,), {"solver": "RK45"}, True),
    Line("scipy LSODA", "controlled", "rtol", (1e-6,), {"solver": "LSODA"}, True),
    Line(
        "scipy DOP853, split",
        "located",
        "rtol",
        (1e-5,),
        {"solver": "DOP853", "events": True},
        True,
    ),
]


class Scan(NamedTuple):
    """The jump as a method computes it."""

    tunings: np.ndarray  #: of the scan
    switches: np.ndarray  #: tunings between whose neighbours the height switches
    jump: float  #: the largest, bisected; NaN: none
    evaluations: float  #: of the scan, per mesh period


def rungs(method):
    """Return the settings of a method, as of `work_precision.rungs`.

    Solvers of other packages, whose runs are slow, take few values.
    """
    if method in work_precision.OF_LIBRARY:
        return work_precision.rungs(method)
    lines = SCIPY if method == "scipy" else [work_precision.generic_line(method)]
    return work_precision.rungs_of(lines)


def scan(pair, tunings, resolution, method, options, run):
    """Return the `Scan` of a method.

    tunings: shape (n,), rising, n >= 2; resolution: width of the last interval of the bisection;
    run: periods, record_periods, initial_state.
    """
    tunings = np.asarray(tunings, float)

    def at(nu):
        bound = problems.Bound(pair, float(nu), method, options)
        return bound.run(tuple(run["initial_state"]), run["periods"], run["record_periods"])

    runs = [at(nu) for nu in tunings]
    height = np.array([one.height for one in runs])
    cost = sum(one.evaluations for one in runs) / (len(runs) * run["periods"])
    steps, large = jump.height_steps(height)
    middles = 0.5 * (tunings[:-1] + tunings[1:])
    if not large.any():
        return Scan(tunings, middles[large], math.nan, cost)
    i = int(np.argmax(steps))
    low, high = tunings[i], tunings[i + 1]
    while high - low > resolution:
        middle = 0.5 * (low + high)
        found = at(middle).height
        if abs(found - height[i]) <= abs(found - height[i + 1]):
            low = middle
        else:
            high = middle
    return Scan(tunings, middles[large], 0.5 * (low + high), cost)


def period_cost(pair, nu, method, options, run):
    """Return the evaluations per mesh period of a short run from the initial state."""
    bound = problems.Bound(pair, nu, method, options)
    periods = min(run["periods"], 5)
    return bound.run(tuple(run["initial_state"]), periods).evaluations / periods


def compute(method, pair, tunings, slow_tunings, settings, run):
    """Return the jump by one method, for every value of its knob that is within the cost allowed.

    pair: keyword arguments of `GearPair`; tunings, slow_tunings (shape (n,), the scan, and that of
    methods which are not compiled by this library; rising, n >= 2); settings (resolution, slow:
    resolution of the slow scan, most_evaluations per mesh period); run: periods, record_periods,
    initial_state.
    """
    model = GearPair(**pair)
    exact = scan(model, tunings, settings["resolution"], "exact", {}, run).jump
    fast = method in work_precision.OF_LIBRARY
    nus = tunings if fast else slow_tunings
    resolution = (settings if fast else settings["slow"])["resolution"]
    table = rungs(method)
    kept = [
        rung
        for rung in table
        if period_cost(model, nus[0], method, rung[2], run) <= settings["most_evaluations"]
    ]
    scans = [scan(model, nus, resolution, method, options, run) for _, _, options in kept]
    jumps = np.array([one.jump for one in scans])
    count = len(kept)
    # Without the binary digits of a difference of decimals.
    step = round(float(nus[1] - nus[0]), 12)
    data = {
        **work_precision.rung_variables(kept),
        "switches": ("rung", np.array([one.switches.size for one in scans], np.int32)),
        "jump": ("rung", jumps),
        "jump_error": ("rung", jumps - exact),
        "period_evaluations": ("rung", np.array([one.evaluations for one in scans])),
        "scan_from": ("rung", np.full(count, float(nus[0]))),
        "scan_to": ("rung", np.full(count, float(nus[-1]))),
        "scan_step": ("rung", np.full(count, step)),
        "resolution": ("rung", np.full(count, resolution)),
        "switch_tuning": ("switch", np.concatenate([[], *(one.switches for one in scans)])),
        "switch_rung": (
            "switch",
            np.repeat(np.arange(count, dtype=np.int32), [one.switches.size for one in scans]),
        ),
        "exact_jump": exact,
        "left_out": np.int32(len(table) - count),
    }
    return result_of_many(
        f"Jump of the motion from rest by method {method}",
        data,
        {"rung": np.arange(count, dtype=np.int32)},
        method,
        references=model.references,
        comment="Methods that are not compiled by this library go through a shorter scan.",
        gear_pair=pair,
        parameters={"settings": settings, "run": run},
    )


def rows(datasets):
    """Yield the jumps of all methods as one table, the cheapest first, replacing the file."""
    found = []
    for data in datasets:
        for k in range(data.sizes["rung"]):
            one = data.isel(rung=k)
            switches = data.switch_tuning.values[data.switch_rung.values == k]
            found.append(
                (
                    float(one.period_evaluations),
                    one.line.item(),
                    one.knob.item(),
                    int(one.switches),
                    f"{float(one.jump):.8f}",
                    f"{float(one.jump_error):.2e}",
                    " ".join(f"{nu:.6g}" for nu in switches),
                    f"{float(one.scan_from):g} to {float(one.scan_to):g}",
                )
            )
    names = ("switches", "jump", "error", "switch_tunings", "scan")
    yield ["line", "knob", "evaluations_per_period", *names]
    for cost, line, knob, *rest in sorted(found, key=lambda row: row[:3]):
        yield [line, knob, f"{cost:.4g}", *rest]
