"""What the orders of a run-up change by: integrals over its arcs, as the orders themselves."""

import itertools
import json
import math

import numpy as np

from gearlib.analysis import course_orders
from gearlib.kernels.closed_form.course_waves import Waves
from gearlib.models.propagators import course_slopes, courses
from gearlib.runs.sensitivities import quotient


def names_of(run, variable):
    """Return the parameters by which a run-up is differentiated."""
    begin = f"d_{variable}_d_"
    return tuple(
        str(one).removeprefix(begin) for one in run.data_vars if str(one).startswith(begin)
    )


def known(model, run, variable, names):
    """Return whether the derivatives of the orders of a run-up are integrals, too.

    Of many coordinates, or under ramps of the load, those of a variable are that jumps at no phase
    which moves: of the acceleration flanks that meet and part move it, of the force switches of the
    stiffness.
    """
    if model is None or _is_of_pair(model, run):
        return model is not None
    if variable != "dynamic_force":
        return variable != "acceleration"
    own = [name for name in names if name not in (*course_slopes.COURSE, *course_slopes.START)]
    moved = (key for name in own for key in model.direction(name))
    return "speed" not in names and not any("contact_ratio" in key for key in moved)


def _is_of_pair(model, run):
    loads = json.loads(run.attrs["parameters"])["load"]
    ramps = any(a[0] < b[0] and a[1] != b[1] for a, b in itertools.pairwise(loads))
    return model.propagators.get("exact") == "closed_form" and not ramps


def exact(model, run, names, variable, span, shape):
    """Return what Fourier coefficients of a run-up change by, complex, shape (k, b, n, ...), SI.

    Parameters
    ----------
    model : Model
        For which they are `known`.
    run : xarray.Dataset
        Of `gearlib.run_up`; it is run again.
    names : tuple of str
        Parameters, k of them.
    variable : str
        Of displacement, velocity, acceleration, dynamic_force: which.
    span : float
        Mesh phase of a block.
    shape : tuple of (int, int, float)
        Blocks b, orders n, and mesh phase that the first order has in a unit.
    """
    blocks, count, step = shape
    if not _is_of_pair(model, run):
        column = course_orders.VARIABLES[variable]
        return course_orders.slopes(model, run, names, column, blocks, span, step, count)
    asked, pair = json.loads(run.attrs["parameters"]), model
    driven, radius, state = (
        asked["driven_mass"],
        asked["base_radius"],
        tuple(asked["initial_state"]),
    )
    found = list(course_orders.again(pair, run, courses.equal_steps(1)))
    highest = math.sqrt(pair.max_stiffness / pair.mean_stiffness)
    sums = np.zeros((blocks, 2, count, len(names)))
    what = list(course_orders.VARIABLES).index(variable)
    waves = Waves(what, span, step, highest, course_orders.rules(), sums)
    course_slopes.of_pair(pair, names, found, state, 0, driven, radius, waves)
    omega, length = float(pair.mesh_frequency(1.0)), pair.static_deflection
    scale = (length, length * omega, length * omega**2, pair.load)[what] / span
    return np.moveaxis(scale * (sums[:, 0] + 1j * sums[:, 1]), -1, 0)


def variables(run, variable, names, found, slopes, amplitude):
    """Return name -> (dims, values, attributes) of the derivatives of an order map.

    `found` are its coefficients, (b, n, ...), `slopes` what they change by with each name.
    """
    size, dims = np.abs(found), ("time", "order", *run[variable].dims[1:])
    factor = {"rms": math.sqrt(2.0), "peak": 2.0, "power": 4.0 * size}[amplitude] * np.ones(
        size.shape
    )
    factor[:, 0] = 2.0 * size[:, 0] if amplitude == "power" else 1.0
    unit, data = run[variable].attrs["units"], {}
    for name, slope in zip(names, slopes, strict=True):
        about = run[f"d_{variable}_d_{name}"].attrs
        with np.errstate(divide="ignore", invalid="ignore"):
            along = slope / found
        above = f"{about['units']} {unit}" if amplitude == "power" else about["units"]
        words = about["long_name"].removeprefix("derivative of ")
        for label, values, units in (
            ("amplitude", factor * size * along.real, quotient(above, "1")),
            ("phase", along.imag, quotient(f"rad {about['units']}", unit)),
        ):
            said = f"derivative of the {label} of {words}"
            data[f"d_{label}_d_{name}"] = dims, values, {"units": units, "long_name": said}
    return data
