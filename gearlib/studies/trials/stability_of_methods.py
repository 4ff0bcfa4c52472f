"""Numerical stability of fixed-step methods on the mesh without contact loss.

Without backlash and with equal damping the mesh is the linear equation of Hill and Meissner,

    x'' + (2 beta / nu) x' + (c(tau) / nu^2) x = 1 / nu^2,

and one mesh period of a method is an affine map of (x, x'). Its linear part, read off three runs,
has a spectral radius to compare with the exact one. Above one where the exact one is not, the
method invents motion (false instability); below the exact one, it adds numerical damping.
"""

import numpy as np

from gearlib.analysis.tongues.meissner import linear_pair
from gearlib.data.result import result, stacked
from gearlib.models.pair import GearPair
from gearlib.runs.sweeping import sweep

#: Radii are cut at this, which also stands for a run that stopped early.
MAX_RADIUS = 1e6


def radii(pair, tunings, method, options):
    """Return the spectral radius of one mesh period of a method at each tuning."""
    run = {"periods": 1, "record_periods": 1, "method": method, "options": options, "threads": 1}
    rest, *ends = (
        sweep(pair, tunings, initial_state=state, **run).final_state.values
        for state in ((0.0, 0.0), (1.0, 0.0), (0.0, 1.0))
    )
    # A matrix of NaN stands for a run that could not go on.
    maps = np.stack([end - rest for end in ends], axis=-1)
    finite = np.isfinite(maps).all(axis=(1, 2))
    values = np.full(len(maps), MAX_RADIUS)
    values[finite] = np.abs(np.linalg.eigvals(maps[finite])).max(axis=-1)
    return np.minimum(values, MAX_RADIUS)


def compute(pair, tunings, fine_tunings, steps, methods):
    """Return the spectral radii of fixed-step methods and of the mesh itself.

    pair (keyword arguments of `GearPair`; made linear by `linear_pair`); tunings, fine_tunings (of
    the methods; of the mesh alone, which costs little); steps: shape (s,), steps per mesh period;
    methods (name -> {"method": name of `gearlib.methods`, "options": options but the steps}).
    """
    pair = GearPair(**pair)
    mesh = linear_pair(pair)

    def radii_of(name, count):
        options = methods[name]["options"] | {"steps_per_period": int(count)}
        return {"radius": radii(mesh, tunings, methods[name]["method"], options)}

    axes = {"method": list(methods), "steps": np.asarray(steps, np.int32)}
    data = stacked(axes, radii_of, "tuning") | {
        "true_radius": ("fine_tuning", radii(mesh, fine_tunings, "exact", {})),
        "stiffness_max": pair.max_stiffness / pair.mean_stiffness,
    }
    coords = axes | {
        "tuning": np.asarray(tunings, float),
        "fine_tuning": np.asarray(fine_tunings, float),
    }
    title = "Numerical stability of fixed-step methods"
    return result(title, pair, data, coords, method=", ".join(methods))
