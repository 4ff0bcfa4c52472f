"""Derivatives of what `run_up` returns: their names and units, and by what they may be asked for.

``d_<variable>_d_<parameter>`` is at fixed time, what revolutions have is that of the revolution.
"""

import numpy as np

from gearlib.kernels import orbit
from gearlib.kernels.several_meshes.record import FORCE_SUM
from gearlib.models.propagators import course_slopes
from gearlib.runs import sensitivities

_SAMPLES = ("displacement", "velocity", "acceleration", "dynamic_force")
_EVENTS = ("event_time", "event_velocity")
_EXTREMA = ("displacement_max", "displacement_min", "dynamic_force_max", "dynamic_force_min")
_SHARES = ("fraction_normal", "fraction_backlash", "fraction_inverse")
_TIMES = [orbit.TIME_NORMAL, orbit.TIME_BACKLASH, orbit.TIME_INVERSE]


def check(model, names, base_radius, closed):
    """Return the names as a tuple; `closed`: whether the run-up goes by closed forms.

    Raises
    ------
    ValueError
        If one is unknown or repeated, or the model or its course has no derivatives.
    """
    names = sensitivities.listed(names)
    known = [*(name for name in model.derivatives if name != "tuning"), *course_slopes.COURSE]
    if model.train is not None:
        known.remove("driven_mass")
        known.remove("base_radius")
    sensitivities.check_names(names, known)
    if names and not closed:
        raise ValueError(
            f"sensitivities = {names!r} is not allowed for this {type(model).__name__}: "
            "derivatives of run-ups are those of closed forms"
        )
    for name in names:
        if name in ("driven_mass", "base_radius") and base_radius is None:
            raise ValueError(
                f"sensitivities = {name!r} is not allowed with base_radius = None: it must be given"
            )
        if name not in (*course_slopes.COURSE, *course_slopes.START):
            model.direction(name)
    return names


def variables(model, names, found, table, samples, about, ok, **course):
    """Return name -> (dims, values, attributes) of the derivatives of a run-up.

    Parameters
    ----------
    model : GearPair
    names : tuple of str
    found : list of Stretch
    table : ndarray, shape (r, m, 10)
        Summaries of the revolutions.
    samples : int
        In each mesh period.
    about : dict
        name -> (CF units, long_name) of the variables of a run-up.
    ok : bool
        Whether the run-up is complete; else derivatives are NaN.
    course : dict
        state, driver, driven_mass and base_radius of the run-up.
    """
    if ok:
        slopes = course_slopes.of_run_up(model, names, found, table, per=samples, **course)
    else:
        slopes = course_slopes.unknown(found, table.shape[1], names, samples)
    omega, length = float(model.mesh_frequency(1.0)), model.static_deflection
    force, meshes = model.scales()["force_scale"], ("mesh",) if model.mesh_names else ()
    scale = np.array([length, length * omega, length * omega**2, force])
    share = table[..., _TIMES].sum(axis=-1)[..., None] if ok else np.nan
    means = np.stack([table[..., i] for i in (FORCE_SUM, *_TIMES)])[..., None] / share
    changes = np.stack([slopes.area, *np.moveaxis(slopes.times[:, :3], 1, 0)])
    changes = (changes - means * slopes.times[:, 3]) / share
    changes[0] *= force
    heights = slopes.extrema * np.array([length, length, force, force])[:, None, None]
    code = sensitivities.ONE_SIDED if slopes.one_sided else 0
    known = model.derivatives | course_slopes.COURSE
    parameters = {name: known[name] for name in names}
    data = {
        "sensitivity_status": sensitivities.flag(sensitivities.GRAZING if slopes.grazing else code)
    }
    for which, dims, values in (
        (_SAMPLES, ("time", *meshes), slopes.samples * scale[:, None, None]),
        (_EVENTS, ("event",), slopes.events * np.array([1.0 / omega, scale[1]])[:, None]),
        (_EXTREMA, ("revolution", *meshes), heights),
        (("mean_force", *_SHARES), ("revolution", *meshes), np.moveaxis(changes, 0, 1)),
    ):
        if which is _SAMPLES and not samples:
            continue
        values = np.moveaxis(values, 1, 0)
        values = values if len(dims) == values.ndim - 2 else values[:, :, 0]
        data |= sensitivities.derivatives(which, dims, values, parameters, about)
    return data
