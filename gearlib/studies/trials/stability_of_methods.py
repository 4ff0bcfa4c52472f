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
from gearlib.studies.trials.problems import Bound

#: Radii are cut at this: larger ones say no more.
LARGEST = 1e6


def true_radius(pair, tuning):
    """Return the spectral radius of one mesh period of the linear mesh, from closed forms."""
    _, maps, _ = linear_pair(pair).propagator(tuning).maps(np.zeros(2), 1, 10**6)
    return float(np.abs(np.linalg.eigvals(maps[0])).max())


def method_radius(pair, tuning, method, options):
    """Return the spectral radius of one mesh period of a method on the linear mesh.

    method: a name of `gearlib.methods`; options: its options.

    At most `LARGEST`, which also stands for a run that stopped early.
    """
    bound = Bound(linear_pair(pair), tuning, method, options)
    rest, *ends = (bound.run(state, 1).state for state in ((0.0, 0.0), (1.0, 0.0), (0.0, 1.0)))
    # NaN of a run that could not go on.
    matrix = np.column_stack([end - rest for end in ends])
    if not np.isfinite(matrix).all():
        return LARGEST
    return float(min(np.abs(np.linalg.eigvals(matrix)).max(), LARGEST))


def compute(pair, tunings, fine_tunings, steps, methods):
    """Return the spectral radii of fixed-step methods and of the mesh itself.

    pair (keyword arguments of `GearPair`; made linear by `linear_pair`); tunings, fine_tunings (of
    the methods; of the mesh alone, which costs little); steps: shape (s,), steps per mesh period;
    methods (name -> {"method": name of `gearlib.methods`, "options": options but the steps}).
    """
    pair = GearPair(**pair)

    def radius(name, count, nu):
        options = methods[name]["options"] | {"steps_per_period": int(count)}
        return {"radius": method_radius(pair, nu, methods[name]["method"], options)}

    axes = {
        "method": list(methods),
        "steps": np.asarray(steps, np.int32),
        "tuning": np.asarray(tunings, float),
    }
    data = stacked(axes, radius) | {
        "true_radius": ("fine_tuning", [true_radius(pair, nu) for nu in fine_tunings]),
        "stiffness_max": pair.max_stiffness / pair.mean_stiffness,
    }
    coords = axes | {"fine_tuning": np.asarray(fine_tunings, float)}
    title = "Numerical stability of fixed-step methods"
    return result(title, pair, data, coords, method=", ".join(methods))
