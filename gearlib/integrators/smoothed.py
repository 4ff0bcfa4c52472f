"""Contact smoothed by tanh, then integrated with the embedded pair at a tight tolerance.

Another model than the sharp law: up to 0.14 / sharpness of the mean mesh force is missing on the
flanks, and as much pulls next to them. Crossed at a speed, both make an impulse of the order of
1 / sharpness^2. Samples hold the smoothed force; their contact code is that of the displacement.
"""

import math
from functools import partial

from gearlib import checks
from gearlib.integrators.each import run_each
from gearlib.integrators.models_with_steps import MODELS, takes
from gearlib.integrators.option import Option
from gearlib.kernels.steps.embedded import Control, run_embedded

__all__ = ["EVENTS", "MODELS", "OPTIONS", "ORDER", "run", "run_many", "takes"]

ORDER = 5
EVENTS = "none: contact and damping change smoothly; switches of stiffness by step control"
OPTIONS = {
    "sharpness": Option(
        100.0,
        checks.finite_positive,
        "per static deflection, of H1 = (1 + tanh(sharpness x)) / 2; H2 and damping likewise",
    ),
    "rtol": Option(
        1e-9, checks.finite_positive, "tolerance of a step, relative and in static deflections"
    ),
}


def run(pair, tuning, state, periods, *arguments, sharpness, rtol):
    """Run one tuning; see `gearlib.integrators`."""
    control = Control(rtol, rtol, 0.1 * 2.0 * math.pi * periods)
    return run_embedded(pair.law(tuning), sharpness, control, *state, periods, *arguments)


def run_many(pair, *arguments, **options):
    """Run many tunings; see `gearlib.integrators`."""
    run_each(partial(run, pair, **options), *arguments)
