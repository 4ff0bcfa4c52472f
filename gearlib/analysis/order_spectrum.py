"""`orders`: order spectra of mesh force and transmission error over whole mesh periods.

They are sums over the samples of the record; their error is the difference of every second sample.
"""

import json
import math

import numpy as np

from gearlib import checks
from gearlib.analysis.order_maps import MAX_CHANGE, check_change
from gearlib.analysis.order_sums import STENCIL, as_run_up, jump_phases, summed
from gearlib.data.result import result_of_many
from gearlib.models.harmonics import Harmonics


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
        order), force_amplitude_error and error_amplitude_error, estimates and no bounds: the
        difference that every second sample makes; mean squares. Of a train over ``mesh`` too.

    Raises
    ------
    ValueError
        If the run could not go on, has no whole revolutions, or a coefficient changes by more than
        5 % of the root mean square when every second sample is left out.
    """
    names = {"phase", "displacement", "dynamic_force", "mesh_frequency"}
    if not names <= set(getattr(run, "variables", ())):
        shown = run.attrs.get("title", type(run).__name__) if hasattr(run, "attrs") else run
        raise checks.refusal("run", shown, "a dataset of gearlib.simulate, of gears that turn")
    return spectrum(run, count)


def spectrum(run, count=None, mesh_orders=False):
    """Return what `orders` does, or of the multiples of the mesh frequency only.

    Of the latter those that change too much are nan.
    """
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
    fractions = 1 if mesh_orders else periods
    harmonics = np.arange(count * fractions + 1)
    dims = ("order", *run.displacement.dims[1:])
    shape = -1, *[1] * (len(dims) - 1)
    # A period that begins later turns the phases only: they count from the mesh phase 0.
    turn = np.exp(-1j * harmonics / fractions * float(run.phase[0])).reshape(shape)
    peak = np.where(harmonics > 0, 2.0, 1.0).reshape(shape)
    grid, repeats = (1.0 / fractions, harmonics.size), orbit and periods % orbit == 0
    force = run.dynamic_force.values * float(run.force_scale)
    error = transmission_error(run) * float(run.static_deflection)
    jumps = jump_phases(as_run_up(run), teeth)
    data: dict = {"mesh_order": ("order", harmonics / fractions)}
    for name, values, phases in (("force", force, jumps), ("error", error, np.empty(0))):
        sums, change, squares = _sums(run.phase.values, values, phases, periods, grid, repeats)
        if mesh_orders:
            sums[change > MAX_CHANGE * math.sqrt(squares.max())] = math.nan
        else:
            check_change(change, squares, run.phase.values)
        data[f"{name}_amplitude"] = dims, peak * np.abs(sums)
        data[f"{name}_phase"] = dims, np.angle(sums * turn)
        data[f"{name}_amplitude_error"] = dims, peak * change
        data[f"mean_square_{name}"] = dims[1:], (values**2).mean(axis=0)
    for name in ("tuning", "speed", "mesh_frequency", "period"):
        data[name] = run[name].values
    coords = {"order": harmonics * teeth / fractions}
    coords |= {name: run[name].values for name in dims[1:]}
    dataset = result_of_many("Order spectrum of a gear mesh", data, coords, "Fourier sums")
    dataset["order"].attrs["long_name"] = (
        "order, waves per revolution of the gear whose teeth count"
    )
    kept = ("references", "gear_pair", "parameters")
    dataset.attrs |= {name: run.attrs[name] for name in kept if name in run.attrs}
    return dataset


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


def _sums(phase, values, jumps, periods, grid: tuple[float, int], repeats):
    """Return (Fourier coefficients of a record, their changes with half of them, mean squares).

    grid: step of the mesh orders and their number.
    """
    phase, span = phase - phase[0], math.tau * periods

    def coefficients(step):
        at, record = phase[::step], values[::step]
        if repeats:
            # An orbit goes on behind the record, and before it, as in it.
            at = np.concatenate([at[-STENCIL:] - span, at, at[:STENCIL] + span])
            record = np.concatenate([record[-STENCIL:], record, record[:STENCIL]])
        sums, squares = summed(at, record, 1, span, *grid, jumps)
        return sums[0], squares

    sums, squares = coefficients(1)
    return sums, np.abs(sums - coefficients(2)[0]), squares
