"""Synthetic rigs: what sensors would have of a known model. Nothing is measured here.

For trials of fits only: the truth is known, seeds are fixed, and every dataset says what it is.
"""

import json

import numpy as np
import xarray as xr

from gearlib.runs.run_up import run_up


def synthetic_rig(model, course, seed, *, noise=0.05, bits=12, samples_per_period=32, gain=1.0):
    """Return a synthetic run-up as a measured set has it.

    Parameters
    ----------
    model : Model
        The truth; of a train the encoder tells the displacement of its first mesh.
    course : sequence of (float, float)
        s and rpm, as of `gearlib.run_up`.
    seed : int
        Of the noise, of the offset and of the eccentricity of the encoder, a wave once a turn as
        large as the signal.
    noise : float, default 0.05
        Standard deviation over that of the signal.
    bits : int, default 12
        Of the encoder, over three times the range of the signal.
    samples_per_period : int
        Of mesh periods.
    gain : float
        Of the sensor; said to be unknown unless it is 1.

    Returns
    -------
    xarray.Dataset
        Over ``sample``: time, speed, displacement, of a train with the name of its mesh behind it.
        ``synthetic`` is 1 among the attributes.
    """
    rng = np.random.default_rng(seed)
    run = run_up(model, speed=course, samples_per_period=samples_per_period)
    signal = run.displacement.values.reshape(run.sizes["time"], -1)[:, 0]
    deviation, span = noise * signal.std(), np.ptp(signal)
    turn = run.phase.values / float(model.periods_per_revolution)
    wave = span * rng.uniform(0.2, 1.0) * np.cos(turn + rng.uniform(0.0, 2.0 * np.pi))
    values = gain * (signal + rng.normal(0.0, deviation, signal.size) + wave)
    values += gain * span * rng.uniform(-0.3, 0.3)
    step = 3.0 * gain * span / 2**bits
    attrs = {
        "units": "m",
        "long_name": "relative mesh displacement, synthetic",
        "sensor": f"synthetic encoder of {bits} bits",
        "noise_std": float(np.hypot(gain * deviation, step / np.sqrt(12.0))),
        "unknown_gain": int(gain != 1.0),
        "unknown_offset": 1,
    }
    name = "_".join(["displacement", *(mesh.replace(" ", "_") for mesh in model.mesh_names[:1])])
    coords = {
        "time": ("sample", run.time.values, {"units": "s", "long_name": "time"}),
        "speed": ("sample", run.speed.values, {"units": "min-1", "long_name": "speed"}),
    }
    known = {"course": [list(map(float, row)) for row in course], "phase": 0.0}
    return xr.Dataset(
        {name: ("sample", step * np.round(values / step), attrs)},
        coords,
        {
            "title": "Synthetic rig",
            "source": "synthetic",
            "synthetic": 1,
            "known": json.dumps(known),
        },
    )
