"""Compute phase portraits, classes of motion and phase lags for the figures of the paper.

The lag of the n-th harmonic is arg(C_n / X_n), where X_n and C_n are the complex Fourier
coefficients of the displacement and the stiffness over one mesh period. Without damping it is 0 or
180 degrees. Lags are therefore chosen between -90 and 270 degrees.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
import xarray as xr

from gearlib.analysis import trust
from gearlib.analysis.lyapunov import SETTLED_FLAGS, are_sensitive_to_rounding
from gearlib.data.variables import add_metadata
from gearlib.models.pair import GearPair
from gearlib.runs.simulation import simulate


def simulate_phase_portrait(
    model: Any, pair: GearPair, tuning: float, run: dict, damping: str
) -> xr.Dataset:
    """Simulate the time history of a phase portrait.

    `tuning` is mesh frequency over natural frequency of `pair`; `model` runs at the same speed.
    `run` has arguments of `gearlib.simulate`. `damping` is the name of the damping combination, a
    coordinate of the result.
    """
    tuning = model.tuning_from(pair, tuning)
    motion = simulate(model, tuning, until_settled=True, **run)
    return add_metadata(motion.assign_coords(damping=damping))


def classify_motions(
    model: Any, pair: GearPair, tunings: Sequence[float], settings: dict, damping: str
) -> xr.Dataset:
    """Classify the motion from rest as periodic, chaotic, etc. at each tuning.

    `tunings` are mesh frequencies over the natural frequency of `pair`; `model` runs at the same
    speeds. `settings` has further arguments of `gearlib.trust`, which also assesses how reliable a
    class is. `damping` is the name of the damping combination, a coordinate of the result.
    """
    tunings = model.tuning_from(pair, np.asarray(tunings))
    classified = trust.classify_at_tunings(model, tunings, **settings)
    return add_metadata(classified.assign_coords(damping=damping))


def harmonic_lags(motion: xr.Dataset, count: int) -> np.ndarray:
    """Return the lags of the first `count` mesh harmonics, degrees in [-90, 270).

    A lag is the phase angle by which a harmonic of the displacement lags behind the stiffness.
    `motion` is a result of `gearlib.simulate`. Lags are NaN unless the motion has the period of the
    mesh.
    """
    if int(motion.period) != 1:
        return np.full(count, np.nan)
    displacement, stiffness = np.fft.rfft(motion.displacement), np.fft.rfft(motion.stiffness)
    lags = np.degrees(np.angle(stiffness[1 : count + 1] / displacement[1 : count + 1]))
    # Undamped lags of 0 or 180 degrees are far from the ends of this range.
    return (lags + 90.0) % 360.0 - 90.0


def compute_phase_lag(
    pair: GearPair, dampings, tuning, tunings, *, harmonics, periods, samples_per_period
) -> xr.Dataset:
    """Compute time histories and lags of all harmonics at a tuning, and the first lag over tuning.

    A lag is the phase angle by which a harmonic of the displacement lags behind the stiffness.
    `dampings` are values of the material damping (in contact, N s/m), and `harmonics` is the number
    of harmonics. Time histories are computed at `tuning` (mesh frequency over natural frequency),
    the lag of the first harmonic at `tunings`. `periods` and `samples_per_period` are arguments of
    `gearlib.simulate`. Lags are NaN if the period of the motion is not one mesh period. Lags and
    time histories are NaN if rounding errors decide on which orbit the motion settles.
    """
    run = {"periods": periods, "samples_per_period": samples_per_period, "until_settled": True}
    models = [pair.replace(material_damping=damping) for damping in dampings]
    motions = [simulate(model, tuning, **run) for model in models]
    first_lags = []
    for model in models:
        model_lags = [harmonic_lags(simulate(model, nu, **run), 1)[0] for nu in tunings]
        first_lags.append(model_lags)
    rest = (0.0, 0.0)
    is_settled = ~np.array(
        [are_sensitive_to_rounding(model, tunings, rest, periods) for model in models]
    )
    is_reliable = ~np.array(
        [are_sensitive_to_rounding(model, [tuning], rest, periods) for model in models]
    )
    lags = [harmonic_lags(motion, harmonics) for motion in motions]
    histories = [motion.displacement.values for motion in motions]
    settled_attrs = {"units": "1", "long_name": "whether the motion from rest settles"}
    settled_attrs |= SETTLED_FLAGS
    data = {
        "displacement": (("damping", "phase"), np.where(is_reliable, histories, np.nan)),
        "stiffness": ("phase", motions[0].stiffness.values),
        "lag": (("damping", "harmonic"), np.where(is_reliable, lags, np.nan)),
        "first_lag": (("damping", "tuning"), np.where(is_settled, first_lags, np.nan)),
        "settled": (("damping", "tuning"), is_settled.astype(np.int8), settled_attrs),
        "shown_tuning": tuning,
    }
    phase = motions[0].phase.values
    numbers = np.arange(1, harmonics + 1)
    harmonic_attrs = {"units": "1", "long_name": "harmonic of the mesh period"}
    coords = {
        "damping": ("damping", dampings, {"units": "N s m-1", "long_name": "material damping"}),
        "phase": ("phase", phase - phase[0], {"units": "rad", "long_name": "mesh phase"}),
        "harmonic": ("harmonic", numbers, harmonic_attrs),
        "tuning": tunings,
    }
    attrs = motions[0].attrs | {"title": "Phase lag of a gear mesh"}
    return add_metadata(xr.Dataset(data, coords, attrs))
