"""Synthetic measured data: simulated sensor signals of a known model, to try out fits."""

import json

import numpy as np
import xarray as xr

from gearlib.runs.run_up import run_up


def synthetic_rig(
    model, speed_course, seed, *, noise=0.05, bits=12, samples_per_period=32, gain=1.0
) -> xr.Dataset:
    """Return synthetic measured data of a run-up of a model, a dataset like those of test rigs.

    `speed_course` has rows (time in s, speed in rpm). The signal is the displacement of the first
    mesh, with `samples_per_period` samples in each mesh period, read by an encoder whose `bits`
    resolve three times the range of the signal. Three disturbances are added: random noise, whose
    standard deviation is `noise` times that of the signal; an offset of at most 0.3 ranges; and a
    wave of 0.2 to 1 ranges once per revolution, as from an eccentricity. The signal is multiplied
    by `gain`; if this is not 1, it is marked as unknown in the attributes. `seed` is the seed of
    the random numbers.
    """
    rng = np.random.default_rng(seed)
    run = run_up(model, speed=speed_course, samples_per_period=samples_per_period)
    signal = run.displacement.values.reshape(run.sizes["time"], -1)[:, 0]
    noise_std, span = noise * signal.std(), np.ptp(signal)
    shaft_angle = run.phase.values / float(model.periods_per_revolution)
    wave = span * rng.uniform(0.2, 1.0) * np.cos(shaft_angle + rng.uniform(0.0, 2.0 * np.pi))
    values = gain * (signal + rng.normal(0.0, noise_std, signal.size) + wave)
    values += gain * span * rng.uniform(-0.3, 0.3)
    step = 3.0 * gain * span / 2**bits
    attrs = {
        "units": "m",
        "long_name": "relative mesh displacement, synthetic",
        "sensor": f"synthetic encoder of {bits} bits",
        "noise_std": float(np.hypot(gain * noise_std, step / np.sqrt(12.0))),
        "unknown_gain": int(gain != 1.0),
        "unknown_offset": 1,
    }
    name = "displacement"
    if model.mesh_names:
        name += f"_{model.mesh_names[0].replace(' ', '_')}"
    coords = {
        "time": ("sample", run.time.values, {"units": "s", "long_name": "time"}),
        "speed": ("sample", run.speed.values, {"units": "min-1", "long_name": "speed"}),
    }
    # Metadata of the test rig for `gearlib.fit`: speed course, and mesh phase at the start in rad.
    metadata = {"course": [list(map(float, row)) for row in speed_course], "phase": 0.0}
    attributes = {"title": "Synthetic rig", "source": "synthetic", "synthetic": 1}
    attributes["known"] = json.dumps(metadata)
    variables = {name: ("sample", step * np.round(values / step), attrs)}
    return xr.Dataset(variables, coords, attributes)
