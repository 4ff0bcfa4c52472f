"""Single runs of the paper's figures: phase planes, labels of motions, the phase lag of Fig. 2.

With the complex Fourier coefficients X_n of y(tau) and C_n of C(tau) over one mesh period, the lag
of the n-th harmonic is arg(C_n / X_n): by so much of its own cycle y comes after C. Without damping
it is 0 or 180 degrees, so it is counted from -90 to 270.
"""

import numpy as np
import xarray as xr

from gearlib.analysis import trust
from gearlib.analysis.lyapunov import SETTLED_FLAGS, rounding_decides
from gearlib.data.variables import describe
from gearlib.models.pair import GearPair
from gearlib.runs.simulation import simulate


def phase_plane(pair, tuning, run, damping):
    """Return the recorded run of a pair at one tuning, labelled with the name of its damping."""
    course = simulate(GearPair(**pair), tuning, until_settled=True, **run)
    return describe(course.assign_coords(damping=damping))


def labels(pair, tunings, settings, damping):
    """Return the labels of `trust.scan` over tuning, with the name of the damping."""
    scan = trust.scan(GearPair(**pair), tunings, **settings)
    return describe(scan.assign_coords(damping=damping))


def harmonic_lags(run, count):
    """Return the lags of the first harmonics of a recorded mesh period, degrees in [-90, 270).

    NaN unless the orbit repeats after one mesh period.
    """
    if int(run.period) != 1:
        return np.full(count, np.nan)
    motion, stiffness = np.fft.rfft(run.displacement), np.fft.rfft(run.stiffness)
    lags = np.degrees(np.angle(stiffness[1 : count + 1] / motion[1 : count + 1]))
    return (lags + 90.0) % 360.0 - 90.0


def phase_lag(pair, dampings, tuning, tunings, *, harmonics, periods, samples_per_period):
    """Return courses and lags of all harmonics at one tuning, and the first lag over `tunings`.

    `dampings` (N s/m) replace the material damping of the pair. Lags are NaN where the orbit does
    not repeat in one period, lags and courses where rounding decides on which orbit a motion ends.
    """
    run = {"periods": periods, "samples_per_period": samples_per_period, "until_settled": True}
    models = [GearPair(**pair | {"material_damping": damping}) for damping in dampings]
    shown = [simulate(model, tuning, **run) for model in models]
    first = [[harmonic_lags(simulate(m, nu, **run), 1)[0] for nu in tunings] for m in models]
    settled, known = (
        ~np.array([rounding_decides(model, places, (0.0, 0.0), periods) for model in models])
        for places in (tunings, [tuning])
    )
    lags = [harmonic_lags(course, harmonics) for course in shown]
    courses = [course.displacement.values for course in shown]
    words = {"units": "1", "long_name": "whether the motion from rest settles"}
    data = {
        "displacement": (("damping", "phase"), np.where(known, courses, np.nan)),
        "stiffness": ("phase", shown[0].stiffness.values),
        "lag": (("damping", "harmonic"), np.where(known, lags, np.nan)),
        "first_lag": (("damping", "tuning"), np.where(settled, first, np.nan)),
        "settled": (("damping", "tuning"), settled.astype(np.int8), words | SETTLED_FLAGS),
        "shown_tuning": tuning,
    }
    phase = shown[0].phase.values
    number, of_period = np.arange(1, harmonics + 1), "harmonic of the mesh period"
    coords = {
        "damping": ("damping", dampings, {"units": "N s m-1", "long_name": "material damping"}),
        "phase": ("phase", phase - phase[0], {"units": "rad", "long_name": "mesh phase"}),
        "harmonic": ("harmonic", number, {"units": "1", "long_name": of_period}),
        "tuning": tunings,
    }
    attrs = shown[0].attrs | {"title": "Phase lag of a gear mesh"}
    return describe(xr.Dataset(data, coords, attrs))
