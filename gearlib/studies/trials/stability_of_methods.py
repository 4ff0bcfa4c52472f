"""Compute the numerical stability of fixed-step methods for a mesh without contact loss.

Without contact loss, the equation of motion is the linear equation of Hill and Meissner,

    x'' + (2 beta / nu) x' + (c(tau) / nu^2) x = 1 / nu^2,

and the period map of a method, from the state (x, x') to the state one mesh period later, is
affine. Its linear part is determined from three runs. If the spectral radius of the linear part
exceeds 1 but the exact radius does not, the method is numerically unstable; if it is smaller than
the exact radius, the method adds numerical damping.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
import xarray as xr

from gearlib.analysis.tongues.meissner import without_backlash
from gearlib.data.result import evaluate_on_grid, make_result
from gearlib.models.pair import GearPair
from gearlib.runs.sweeping import sweep

#: Upper limit of returned radii, and value for runs that stopped early.
MAX_RADIUS = 1e6


def spectral_radii(pair: Any, tunings: Sequence[float], method: str, options: dict) -> np.ndarray:
    """Return the spectral radius of the period map of a method at each tuning.

    The period map takes a state to the state one mesh period later. A radius above 1 means
    instability. `pair` is a model without contact loss, whose period map is affine. `tunings` are
    mesh frequencies over the natural frequency, `method` is a name of `gearlib.methods`, and
    `options` are its options. Radii are limited to `MAX_RADIUS`, the value for runs that stopped
    early.
    """
    run = {"periods": 1, "record_periods": 1, "method": method, "options": options, "threads": 1}
    final_states = []  # arrays of shape (tunings, 2)
    for initial_state in ((0.0, 0.0), (1.0, 0.0), (0.0, 1.0)):
        curve = sweep(pair, tunings, initial_state=initial_state, **run)
        final_states.append(curve.final_state.values)
    # An affine map is determined by the images of zero and of the unit vectors.
    from_zero, *from_unit_states = final_states
    period_maps = np.stack([state - from_zero for state in from_unit_states], axis=-1)
    # Final states are NaN if a run stopped early.
    finite = np.isfinite(period_maps).all(axis=(1, 2))
    radii = np.full(len(period_maps), MAX_RADIUS)
    radii[finite] = np.abs(np.linalg.eigvals(period_maps[finite])).max(axis=-1)
    return np.minimum(radii, MAX_RADIUS)


def compute_spectral_radii(
    pair: GearPair, tunings: Sequence[float], fine_tunings, steps: Sequence[int], methods: dict
) -> xr.Dataset:
    """Compute the spectral radii of the period maps of fixed-step methods, and the exact ones.

    A period map takes a state to the state one mesh period later. Contact loss of `pair` is
    excluded, so that the equation is linear. The methods are run at `tunings` (mesh frequency over
    natural frequency), the exact solution is computed at `fine_tunings`. `steps` are numbers of
    steps per mesh period. `methods` maps labels to dicts with "method", a name of
    `gearlib.methods`, and "options", its options except for the number of steps.
    """
    linear = without_backlash(pair)

    def radii(name: str, step_count: int) -> dict:
        """Return the spectral radii of the method `name` with `step_count` steps per period."""
        options = methods[name]["options"] | {"steps_per_period": int(step_count)}
        return {"radius": spectral_radii(linear, tunings, methods[name]["method"], options)}

    axes = {"method": list(methods), "steps": np.asarray(steps, np.int32)}
    data = evaluate_on_grid(axes, radii, "tuning") | {
        "true_radius": ("fine_tuning", spectral_radii(linear, fine_tunings, "exact", {})),
        "stiffness_max": pair.max_stiffness / pair.mean_stiffness,
    }
    grids = {"tuning": tunings, "fine_tuning": fine_tunings}
    coords = axes | {name: np.asarray(grid, float) for name, grid in grids.items()}
    title = "Numerical stability of fixed-step methods"
    return make_result(title, pair, data, coords, method=", ".join(methods))
