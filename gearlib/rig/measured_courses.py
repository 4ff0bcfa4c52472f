"""Measured time courses at constant speeds beside those of a model, as harmonics of the mesh."""

import numpy as np
import xarray as xr

from gearlib.models.pair import GearPair
from gearlib.rig.measured import read_measured
from gearlib.runs.simulation import simulate

#: Observable -> its scale to SI among the variables of a run.
SCALES = {
    "displacement": "static_deflection",
    "velocity": "velocity_scale",
    "acceleration": "acceleration_scale",
    "dynamic_force": "force_scale",
}
HARMONICS = 5
#: Points of a course that are drawn, and samples that are taken into harmonics at once.
POINTS, _CHUNK = 600, 100_000
_PHASES = 256


def compute(path, pairs, run):
    """Return the time courses of a measured set beside the settled motions of a model.

    pairs: damping -> argument of `described`; run: arguments of `simulate`, samples_per_period
    among them, of whole revolutions.

    Over ``course`` (a condition with its speed), ``observable`` and ``harmonic`` of the mesh
    period: amplitude (SI), shape_phase (deg): that of the harmonic k less k times that of the
    first, which no unknown phase of the shaft, gain or offset changes; over ``damping`` the same
    of the model, from rest. For pictures the courses over the phase from the peak of the first
    harmonic.
    """
    rig = read_measured(path)
    names = [name for name in SCALES if name in rig]
    models = {name: GearPair(**arguments) for name, arguments in pairs.items()}
    groups = _courses(rig)
    shape = len(groups), len(names)
    over = {"course": len(groups), "observable": len(names), "damping": len(models)}
    found = {
        "amplitude": np.full((*shape, HARMONICS), np.nan),
        "amplitude_std": np.full((*shape, HARMONICS), np.nan),
        "shape_phase": np.full((*shape, HARMONICS), np.nan),
        "shape_phase_std": np.full((*shape, HARMONICS), np.nan),
        "point_phase": np.full((*shape, POINTS), np.nan),
        "point": np.full((*shape, POINTS), np.nan),
        "computed_amplitude": np.full((*over.values(), HARMONICS), np.nan),
        "computed_shape_phase": np.full((*over.values(), HARMONICS), np.nan),
        "computed": np.full((*over.values(), _PHASES), np.nan),
    }
    for i, (speed, where) in enumerate(groups):
        part = rig.isel(sample=where)
        for d, model in enumerate(models.values()):
            _fill_computed(found, (i, d), names, model, speed, run)
        rate = 2.0 * np.pi * speed / 60.0 * int(next(iter(models.values())).teeth)
        for j, name in enumerate(names):
            _fill_measured(found, (i, j), part.time.values, part[name], rate)
    return _described(found, rig, groups, names, models)


def _courses(rig):
    """Return (speed, samples) of each condition whose speed is one."""
    known = rig.condition.values if "condition" in rig.coords else np.zeros(rig.sizes["sample"])
    found = []
    for one in dict.fromkeys(known.tolist()):
        where = np.flatnonzero(known == one)
        speed = rig.speed.values[where]
        if np.ptp(speed) == 0.0 and speed[0] > 0.0:
            found.append((float(speed[0]), where))
    return found


def _fill_computed(found, place, names, model, speed, run):
    i, d = place
    motion = simulate(model, speed=speed, **run)
    periods = int(run["record_periods"])
    for j, name in enumerate(names):
        values = motion[name].values[: periods * int(run["samples_per_period"])]
        wave = np.fft.rfft(values)[periods::periods][:HARMONICS] / (0.5 * values.size)
        scale = float(motion[SCALES[name]])
        found["computed_amplitude"][i, j, d] = scale * np.abs(wave)
        found["computed_shape_phase"][i, j, d] = _shape(wave)
        one = scale * values[: int(run["samples_per_period"])]
        axis = np.linspace(0.0, 2.0 * np.pi, one.size, endpoint=False)
        grid = np.linspace(0.0, 2.0 * np.pi, _PHASES)
        shifted = np.mod(grid - np.angle(wave[0]), 2.0 * np.pi)
        found["computed"][i, j, d] = np.interp(shifted, axis, one, period=2.0 * np.pi)


def _shape(wave):
    """Return the phase of each harmonic less so many times that of the first, degrees."""
    number = np.arange(1, wave.size + 1)
    return np.degrees(np.angle(wave * np.exp(-1j * number * np.angle(wave[0]))))


def _fill_measured(found, place, time, course, rate):
    """Put the harmonics of a course and a few of its points into `found`."""
    values = course.values
    good = np.isfinite(values)
    time, values = time[good], values[good]
    if values.size <= 2 * HARMONICS + 1:
        return
    number = np.arange(1, HARMONICS + 1)

    def basis(part):
        turned = np.exp(1j * np.outer(rate * (part - time[0]), number))
        return np.hstack([np.ones((part.size, 1)), turned.real, turned.imag])

    columns = 2 * HARMONICS + 1
    square, right = np.zeros((columns, columns)), np.zeros(columns)
    for start in range(0, time.size, _CHUNK):
        rows = basis(time[start : start + _CHUNK])
        square, right = square + rows.T @ rows, right + rows.T @ values[start : start + _CHUNK]
    best, rank = np.linalg.lstsq(square, right, rcond=None)[::2]
    if rank < columns:
        return
    # y = sum of A cos(k w t + phase): the conjugate of the coefficient of exp.
    wave = best[1 : HARMONICS + 1] - 1j * best[HARMONICS + 1 :]
    few = np.unique(np.linspace(0, time.size - 1, POINTS).astype(int))
    left = float(np.std(values[few] - basis(time[few]) @ best))
    std = (course.attrs.get("noise_std", 0.0) or left) * np.sqrt(2.0 / time.size)
    found["amplitude"][place], found["amplitude_std"][place] = np.abs(wave), std
    found["shape_phase"][place] = _shape(wave)
    each = std / np.abs(wave)
    found["shape_phase_std"][place] = np.degrees(np.hypot(each, number * each[0]))
    phase = np.mod(rate * (time[few] - time[0]) + np.angle(wave[0]), 2.0 * np.pi)
    found["point_phase"][place][: few.size] = phase
    found["point"][place][: few.size] = values[few]


def _described(found, rig, groups, names, models):
    shared = ("course", "observable")
    last = {"point": "number", "point_phase": "number", "computed": "phase"}
    data = {}
    for name, values in found.items():
        inner = ("damping",) if name.startswith("computed") else ()
        data[name] = (*shared, *inner, last.get(name, "harmonic")), values
    coords = {
        "observable": names,
        "damping": list(models),
        "harmonic": np.arange(1, HARMONICS + 1),
        "phase": np.linspace(0.0, 2.0 * np.pi, _PHASES),
        "speed": ("course", [speed for speed, _ in groups], {"units": "min-1"}),
    }
    units = {name: rig[name].attrs["units"] for name in names}
    said = {"course_units": ", ".join(f"{name} in {unit}" for name, unit in units.items())}
    return xr.Dataset(data, coords, rig.attrs | said)
