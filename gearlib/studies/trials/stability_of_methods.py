"""Numerical stability of fixed-step methods on the mesh without contact loss.

Without backlash and with equal damping the mesh is the linear equation of Hill and Meissner,

    x'' + (2 beta / nu) x' + (c(tau) / nu^2) x = 1 / nu^2,

and one mesh period of a method is an affine map of (x, x'). Its linear part, read off three runs,
has a spectral radius. If it is above one but the exact radius is not, the method is falsely
unstable; if it is below the exact radius, the method adds numerical damping.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
import xarray as xr

from gearlib.analysis.tongues.meissner import linear_pair
from gearlib.data.result import result, stacked
from gearlib.models.pair import GearPair
from gearlib.runs.sweeping import sweep

#: Larger radii are cut to this value, which also replaces the radius of a run that stopped early.
MAX_RADIUS = 1e6


def spectral_radii(pair: Any, tunings: Sequence[float], method: str, options: dict) -> np.ndarray:
    """Return the spectral radius of the period map of a method at each tuning.

    `pair` is a linear model, `method` a name of `gearlib.methods`.
    """
    run = {"periods": 1, "record_periods": 1, "method": method, "options": options, "threads": 1}
    from_rest, *ends = (
        sweep(pair, tunings, initial_state=state, **run).final_state.values
        for state in ((0.0, 0.0), (1.0, 0.0), (0.0, 1.0))
    )
    period_maps = np.stack([end - from_rest for end in ends], axis=-1)
    # The map of a run that stopped early is NaN.
    finite = np.isfinite(period_maps).all(axis=(1, 2))
    values = np.full(len(period_maps), MAX_RADIUS)
    values[finite] = np.abs(np.linalg.eigvals(period_maps[finite])).max(axis=-1)
    return np.minimum(values, MAX_RADIUS)


def compute(
    pair: GearPair, tunings: Sequence[float], fine_tunings, steps: Sequence[int], methods: dict
) -> xr.Dataset:
    """Return the spectral radii of fixed-step methods, and of the exact period map.

    The methods are run at `tunings`, the exact map at `fine_tunings`. `pair` is made
    linear; `steps` are numbers of steps per mesh period; `methods` maps
    names to a method of `gearlib.methods` and its options without steps.
    """
    linear = linear_pair(pair)

    def radii(name: str, count: int) -> dict:
        options = methods[name]["options"] | {"steps_per_period": int(count)}
        return {"radius": spectral_radii(linear, tunings, methods[name]["method"], options)}

    axes = {"method": list(methods), "steps": np.asarray(steps, np.int32)}
    data = stacked(axes, radii, "tuning") | {
        "true_radius": ("fine_tuning", spectral_radii(linear, fine_tunings, "exact", {})),
        "stiffness_max": pair.max_stiffness / pair.mean_stiffness,
    }
    grids = {"tuning": tunings, "fine_tuning": fine_tunings}
    coords = axes | {name: np.asarray(grid, float) for name, grid in grids.items()}
    title = "Numerical stability of fixed-step methods"
    return result(title, pair, data, coords, method=", ".join(methods))
