"""`orders`: order spectra of mesh force and transmission error over whole mesh periods.

Those of one degree of freedom are integrals to rounding, as `order_map` has them of a run-up whose
speed stays. Other models go by the sum over their samples; its error is the difference of every
second sample.
"""

import json
import math

import numpy as np

from gearlib import checks
from gearlib.analysis import course_orders
from gearlib.analysis.steady_course import as_run_up
from gearlib.data.result import result_of_many
from gearlib.models.harmonics import Harmonics

#: Error of the closed forms, of the largest amplitude.
_ROUNDING = 1e-11


def orders(run, *, count=None):
    """Return the order spectrum of the mesh force and of the transmission error of a run.

    Parameters
    ----------
    run : xarray.Dataset
        Of `gearlib.simulate`; its record has to hold whole revolutions, or whole orbits.
    count : int, optional
        Highest mesh order; by default 10, at most a quarter of the samples per period.

    Returns
    -------
    xarray.Dataset
        Over ``order`` (per revolution of the gear whose teeth count, from 0): mesh_order (order
        over teeth), force_amplitude (N, peak; the mean at order 0), force_phase,
        error_amplitude (m) and error_phase (rad; of a cosine of the mesh phase times the mesh
        order), force_amplitude_error and error_amplitude_error, estimates and no bounds: 1e-11 of
        the largest amplitude for rounding or, where a model has no closed form, the difference that
        every second sample makes; mean squares. Of a train over ``mesh`` too.

    Raises
    ------
    ValueError
        If the run could not go on, or has no whole revolutions.
    """
    names = {"phase", "displacement", "dynamic_force", "mesh_frequency"}
    if not names <= set(getattr(run, "variables", ())):
        shown = run.attrs.get("title", type(run).__name__) if hasattr(run, "attrs") else run
        raise checks.refusal("run", shown, "a dataset of gearlib.simulate, of gears that turn")
    if int(run.status):
        raise ValueError(f"run is not allowed: {run.status.attrs['message']}")
    asked = json.loads(run.attrs["parameters"])
    periods, samples = asked["record_periods"], run.phase.size
    teeth = round(float(run.mesh_frequency) * 60.0 / (math.tau * float(run.speed)))
    orbit = int(run.period)
    if periods % teeth and not (orbit and periods % orbit == 0):
        raise ValueError(
            f"record_periods = {periods} is not allowed: it must be a multiple of {teeth}, whole "
            "revolutions of the gear whose teeth count"
            + (f", or of the {orbit} periods of the orbit" if orbit else "")
        )
    most = max(samples // periods // 4, 1)
    count = checks.integer("count", min(10, most) if count is None else count, 1, most)
    harmonics = np.arange(count * periods + 1)
    scales = float(run.force_scale), float(run.static_deflection)
    x, force = transmission_error(run), run.dynamic_force.values
    steady = as_run_up(run)
    model = course_orders.of_run(steady)
    if model is None:
        sampled = [scale * values for scale, values in zip(scales, (force, x), strict=True)]
        found = [_sampled(values, harmonics.size) for values in sampled]
        half = [_sampled(values[::2], harmonics.size) for values in sampled]
        errors = [np.abs(one - other) for one, other in zip(found, half, strict=True)]
    else:
        block = 1, math.tau * periods, 1.0 / periods, harmonics.size
        names = "dynamic_force", "displacement"
        found = [
            course_orders.integrals(model, steady, course_orders.VARIABLES[name], *block)[0][0]
            for name in names
        ]
        errors = [_ROUNDING * np.abs(one).max() * np.ones(one.shape) for one in found]
    # A period that begins later turns the phases only: they count from the mesh phase 0.
    turn = np.exp(-1j * harmonics / periods * float(run.phase[0]))
    turn = turn.reshape(-1, *[1] * (x.ndim - 1))
    dims = ("order", *run.displacement.dims[1:])
    data = {}
    peak = np.where(harmonics.reshape(turn.shape) > 0, 2.0, 1.0)
    for name, one, error in zip(("force", "error"), found, errors, strict=True):
        data[f"{name}_amplitude"] = dims, peak * np.abs(one)
        data[f"{name}_phase"] = dims, np.angle(one * turn)
        data[f"{name}_amplitude_error"] = dims, peak * error
    data["mesh_order"] = "order", harmonics / periods
    data["mean_square_force"] = dims[1:], (force**2).mean(axis=0) * scales[0] ** 2
    data["mean_square_error"] = dims[1:], (x**2).mean(axis=0) * scales[1] ** 2
    for name in ("tuning", "speed", "mesh_frequency", "period"):
        data[name] = run[name].values
    coords = {"order": harmonics * teeth / periods}
    coords |= {name: run[name].values for name in dims[1:]}
    found = result_of_many("Order spectrum of a gear mesh", data, coords, "Fourier integrals")
    found["order"].attrs["long_name"] = "order, waves per revolution of the gear whose teeth count"
    kept = ("references", "gear_pair", "parameters")
    found.attrs |= {name: run.attrs[name] for name in kept if name in run.attrs}
    return found


def transmission_error(run):
    """Return the transmission error at the samples, static deflections.

    Displacements of models with deviations of the flanks are those of the flanks.
    """
    x = run.displacement.values
    model = json.loads(run.attrs.get("gear_pair") or run.attrs["model"])
    given = model.get("deviation") if "profile" in model else None
    if not given:
        return x
    phase, scale = run.phase.values, 1.0 / run.static_deflection.item()
    waves = Harmonics(given["cosines"], given["sines"]).table(scale)
    return x - sum(c * np.cos(k * phase) + s * np.sin(k * phase) for k, c, s in waves)


def _sampled(values, count):
    """Return the first `count` Fourier coefficients of samples, along the first axis."""
    return np.fft.rfft(values, axis=0)[:count] / len(values)
