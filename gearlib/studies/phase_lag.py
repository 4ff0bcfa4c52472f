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

    pair (keyword arguments of `GearPair`; its material damping is replaced); dampings: shape (d,),
    material damping, N s/m; tuning: of the courses; tunings: shape (t,), of the lags; harmonics:
    harmonics of the mesh period whose lag is measured at `tuning`; periods: mesh periods of every
    run, enough for the lightest damping to settle.

    displacement, stiffness over (damping, phase); lag over (damping, harmonic); first_lag, settled
    over (damping, tuning). Lags are NaN where the orbit does not repeat in one period; they and the
    displacement where rounding decides on which orbit a motion ends.
    """
    run = {"periods": periods, "samples_per_period": samples_per_period}
    models = [GearPair(**pair | {"material_damping": k}) for k in dampings]
    shown = [simulate(model, tuning, **run) for model in models]
    first = [[harmonic_lags(simulate(m, nu, **run), 1)[0] for nu in tunings] for m in models]
    rest = (0.0, 0.0)
    settled = ~np.array([[lyapunov.lost(m, nu, rest, periods) for nu in tunings] for m in models])
    known = ~np.array([[lyapunov.lost(m, tuning, rest, periods)] for m in models])
    degrees = {"units": "degree"}
    dataset = xr.Dataset(
        {
            "displacement": (
                ("damping", "phase"),
                np.where(known, [one.displacement.values for one in shown], np.nan),
                shown[0].displacement.attrs,
            ),
            "stiffness": (("phase",), shown[0].stiffness.values, shown[0].stiffness.attrs),
            "lag": (
                ("damping", "harmonic"),
                np.where(known, [harmonic_lags(one, harmonics) for one in shown], np.nan),
                degrees | {"long_name": "lag of the motion behind the mesh stiffness"},
            ),
            "first_lag": (
                ("damping", "tuning"),
                np.where(settled, first, np.nan),
                degrees | {"long_name": "lag of the first harmonic behind the mesh stiffness"},
            ),
            "settled": (
                ("damping", "tuning"),
                settled.astype(np.int8),
                lyapunov.SETTLED_FLAGS
                | {"units": "1", "long_name": "whether the motion from rest settles"},
            ),
            "shown_tuning": ((), tuning, {"units": "1", "long_name": "tuning of the courses"}),
        },
        {
            "damping": ("damping", dampings, {"units": "N s m-1", "long_name": "material damping"}),
            "phase": (
                "phase",
                shown[0].phase.values - shown[0].phase.values[0],
                {"units": "rad", "long_name": "mesh phase"},
            ),
            "harmonic": (
                "harmonic",
                np.arange(1, harmonics + 1),
                {"units": "1", "long_name": "harmonic of the mesh period"},
            ),
            "tuning": ("tuning", tunings, shown[0].tuning.attrs),
        },
    )
    return dataset.assign_attrs(shown[0].attrs | {"title": "Phase lag of a gear mesh"})
