"""Many seeded starts of one motion, and whether rounding decides where it goes.

What a chaotic motion comes to after many mesh periods hangs on the last digit of its start. A
motion is one of these if a start moved by a billionth of a static deflection leads it elsewhere;
then what starts of physical size have in common is told: medians, ranges and shares.
"""

import os
import warnings
from concurrent.futures import ThreadPoolExecutor

import numpy as np

#: Starts are moved by this to see whether they decide where a motion ends; rounding is less.
_BESIDE = 1e-9
#: A motion that changes by less from there is not decided by rounding, a thousandth of it or less.
KEPT = 1e-3


def starts(model, state, settings):
    """Return the starts: a state of a model with seeded displacements added, shape (k, size).

    The state is that of `gearlib.simulate`; settings are starts, seed, and spread, the largest
    displacement of a coordinate, static deflections.
    """
    if isinstance(state, str):
        state = model.start_state(state)
    state = np.asarray(state, float)
    generator, half = np.random.default_rng(settings["seed"]), state.size // 2
    found = np.tile(state, (settings["starts"], 1))
    # Of bodies, not of natural modes: of two with one frequency no computer knows which is which.
    found[:, :half] += settings["spread"] * generator.uniform(-1.0, 1.0, (len(found), half))
    return found


def beside(state):
    """Return a state next to one, by more than rounding and less than anything that is measured."""
    return state + _BESIDE * np.cos(1.0 + np.arange(len(state)) ** 2.0)


def in_parallel(call, values):
    """Return what a call gives for each value; kernels leave the interpreter to other threads."""
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        return list(pool.map(call, values))


def over_starts(every, names):
    """Return name, name_low, name_high -> DataArray: median and range over ``start``.

    Of those starts whose run could go on, if there are any.
    """
    found = {}
    for name in names:
        one = every[name]
        with warnings.catch_warnings():
            # Where no start could go on there is no number, which needs no warning.
            warnings.simplefilter("ignore", RuntimeWarning)
            found[name] = one.median("start", skipna=True)
        found[f"{name}_low"] = one.min("start", skipna=True)
        found[f"{name}_high"] = one.max("start", skipna=True)
    return found


def spread_of(values):
    """Return least, median and largest of those values that are numbers, NaN where none is."""
    values = values[np.isfinite(values)]
    found = (np.min, np.median, np.max) if values.size else ()
    return tuple(float(which(values)) for which in found) or (np.nan,) * 3
