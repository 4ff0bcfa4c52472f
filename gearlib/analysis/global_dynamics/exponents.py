"""`lyapunov_exponents`: the largest Lyapunov exponent over a parameter."""

import os
from concurrent.futures import ThreadPoolExecutor

import numpy as np

from gearlib import checks, notebook
from gearlib.analysis import lyapunov
from gearlib.analysis.global_dynamics import grids
from gearlib.analysis.orbits.followed_parameters import name_parameter, varied
from gearlib.data import status
from gearlib.data.numbers_given import floats
from gearlib.data.result import result
from gearlib.integrators import choose
from gearlib.runs.run_arguments import MAX_EVENTS


def lyapunov_exponents(
    pair,
    values,
    *,
    parameter="tuning",
    tuning=None,
    states=(0.0, 0.0),
    settle=500,
    periods=2000,
    max_events=MAX_EVENTS,
    threads=None,
):
    """Return the largest Lyapunov exponent of motions over a parameter.

    Deviations are carried along by the exact maps of `Model.propagator`, with saltation at
    the flank lines: on a periodic attractor the exponent is ln|multiplier| / period, and without
    damping a positive one is chaos, a motion of zero exponent regular.

    Parameters
    ----------
    pair, values, parameter, tuning, max_events
        As of `gearlib.bifurcation_diagram`.
    states : array_like of float, shape (2,) or (n, 2)
        Displacement in static deflections and dx/dtau at tau = 0, for all or for each value: the
        final states of a diagram follow its branch.
    settle, periods : int
        Mesh periods before the count, and counted (at least 20).
    threads : int, optional
        All processors by default. The result does not depend on it.

    Returns
    -------
    xarray.Dataset
        Over the parameter under its name: exponent, per mesh period, and uncertainty, the
        standard error of its mean over 20 batches; status, where it is not 0 both are NaN: the
        run could not go on, the motion grows without bound, or its start has no numbers.

    Raises
    ------
    ValueError
        Naming the argument, its value and the allowed range.
    """
    choose(pair, None, None)
    values = grids.values("values", values)
    settle = checks.integer("settle", settle, 0)
    periods = checks.integer("periods", periods, lyapunov.BATCHES)
    max_events = checks.integer("max_events", max_events, 1)
    threads = os.cpu_count() if threads is None else checks.integer("threads", threads, 1)
    cases = varied(pair, tuning, parameter, values)
    if isinstance(states, str):
        pair.check_state(states)
        states = cases[0][0].start_state(states)
    rows, sizes = floats(states), {2, len(pair.components)}
    if rows.shape not in {shape for n in sizes for shape in ((n,), (values.size, n))}:
        raise ValueError(
            f"states = {states!r} is not allowed: it must be "
            f"{' or '.join(map(str, sorted(sizes)))} numbers, or as many for each of the "
            f"{values.size} values"
        )
    rows = np.broadcast_to(rows, (values.size, rows.shape[-1]))

    def one(i):
        model, nu = cases[i]
        if not np.isfinite(rows[i]).all():
            return np.nan, np.nan, status.NO_START
        found = lyapunov.largest(
            model, nu, state=tuple(rows[i]), settle=settle, periods=periods, max_events=max_events
        )
        return found.value, found.uncertainty, found.status

    with ThreadPoolExecutor(threads) as pool:
        every = pool.map(one, range(values.size))
        found = np.array(list(notebook.counted("values", every, values.size)))
    data = {
        "exponent": (parameter, found[:, 0]),
        "uncertainty": (parameter, found[:, 1]),
        "status": (parameter, found[:, 2].astype(np.int8)),
    }
    dataset = result(
        "Largest Lyapunov exponents of a gear mesh",
        pair,
        data,
        {parameter: values},
        method="variational maps",
        parameter=parameter,
        tuning=tuning,
        settle=settle,
        periods=periods,
    )
    return name_parameter(dataset, parameter)
