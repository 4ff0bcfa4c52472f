"""Fig. 2: how far the relative motion lags behind the mesh stiffness, by damping and tuning.

With the complex Fourier coefficients X_n of y(tau) and C_n of C(tau) over one mesh period, the lag
of the n-th harmonic is arg(C_n / X_n): by so much of its own cycle y comes after C. Without damping
it is 0 or 180 degrees, so it is counted from -90 to 270.

With little damping a motion may go through chaos for long before it settles. There rounding decides
on which orbit it ends, and nothing is told of it.
"""

import numpy as np
import xarray as xr

from gearlib.analysis import lyapunov
from gearlib.data.variables import describe
from gearlib.models.pair import GearPair
from gearlib.runs.simulation import simulate


def harmonic_lags(run, count):
    """Return the lags of the first harmonics of a recorded period, degrees in [-90, 270).

    run: result of `gearlib.simulate` with one recorded period; count: number of harmonics.

    Shape (count,). NaN unless the orbit repeats after one mesh period.
    """
    if int(run.period) != 1:
        return np.full(count, np.nan)
    motion, stiffness = np.fft.rfft(run.displacement), np.fft.rfft(run.stiffness)
    lags = np.degrees(np.angle(stiffness[1 : count + 1] / motion[1 : count + 1]))
    return (lags + 90.0) % 360.0 - 90.0


def compute(pair, dampings, tuning, tunings, *, harmonics, periods, samples_per_period):
    """Return courses at one tuning and lags over many.

    pair (as in `described`; its material damping is replaced); dampings: shape (d,),
    material damping, N s/m; tuning: of the courses; tunings: shape (t,), of the lags; harmonics:
    harmonics of the mesh period whose lag is measured at `tuning`; periods: mesh periods of every
    run, enough for the lightest damping to settle.

    Lags are NaN where the orbit does not repeat in one period; they and the displacement where
    rounding decides on which orbit a motion ends.
    """
    run = {"periods": periods, "samples_per_period": samples_per_period, "until_settled": True}
    models = [GearPair(**pair | {"material_damping": k}) for k in dampings]
    shown = [simulate(model, tuning, **run) for model in models]
    first = [[harmonic_lags(simulate(m, nu, **run), 1)[0] for nu in tunings] for m in models]
    rest = (0.0, 0.0)
    settled = ~np.array([lyapunov.rounding_decides(m, tunings, rest, periods) for m in models])
    known = ~np.array([lyapunov.rounding_decides(m, [tuning], rest, periods) for m in models])
    lags = np.where(known, [harmonic_lags(one, harmonics) for one in shown], np.nan)
    courses = np.where(known, [one.displacement.values for one in shown], np.nan)
    data = {
        "displacement": (("damping", "phase"), courses),
        "stiffness": (("phase",), shown[0].stiffness.values),
        "lag": (("damping", "harmonic"), lags),
        "first_lag": (("damping", "tuning"), np.where(settled, first, np.nan)),
        "settled": (("damping", "tuning"), settled.astype(np.int8), lyapunov.SETTLED_FLAGS),
        "shown_tuning": tuning,
    }
    own = {
        "damping": ("N s m-1", "material damping"),
        "phase": ("rad", "mesh phase"),
        "harmonic": ("1", "harmonic of the mesh period"),
        "settled": ("1", "whether the motion from rest settles"),
    }
    coords = {
        "damping": dampings,
        "phase": shown[0].phase.values - shown[0].phase.values[0],
        "harmonic": np.arange(1, harmonics + 1),
        "tuning": tunings,
    }
    dataset = describe(xr.Dataset(data, coords))
    for name, (units, words) in own.items():
        dataset[name].attrs |= {"units": units, "long_name": words}
    return dataset.assign_attrs(shown[0].attrs | {"title": "Phase lag of a gear mesh"})
