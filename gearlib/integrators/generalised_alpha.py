"""The generalised-alpha method in fixed steps, with the numerical damping of its spectral radius.

Chung, Hulbert: J. Appl. Mech. 60 (1993) 371-375. Mesh force and damping are those of the middle
state at share 1 - alpha_f of the step.
"""

from functools import partial

from gearlib import checks
from gearlib.integrators.each import run_each
from gearlib.integrators.models_with_steps import MODELS, takes
from gearlib.integrators.newmark import STEP_OPTIONS
from gearlib.integrators.option import Option
from gearlib.kernels.steps.fixed import Scheme, run_steps

__all__ = ["EVENTS", "MODELS", "OPTIONS", "ORDER", "run", "run_many", "takes"]

ORDER = 2
EVENTS = "steps go over switches and contact; changes between step ends, by a straight line"
OPTIONS = {
    **STEP_OPTIONS,
    "spectral_radius": Option(
        0.8,
        partial(checks.number, allowed="from 0 to 1", accept=lambda r: 0.0 <= r <= 1.0),
        "rho_inf: what is left per step of the fastest oscillations; 1: no numerical damping",
    ),
}


def scheme(spectral_radius, iterated):
    """Return the `Scheme` of Chung and Hulbert's optimal parameters."""
    alpha_m = (2.0 * spectral_radius - 1.0) / (spectral_radius + 1.0)
    alpha_f = spectral_radius / (spectral_radius + 1.0)
    shift = alpha_f - alpha_m
    return Scheme(False, iterated, alpha_m, alpha_f, 0.25 * (1.0 + shift) ** 2, 0.5 + shift)


def run(pair, tuning, state, *arguments, steps_per_period, contact, spectral_radius):
    """Run one tuning; see `gearlib.integrators`."""
    constants = scheme(spectral_radius, contact == "iterated")
    return run_steps(pair.law(tuning), constants, steps_per_period, *state, *arguments)


def run_many(pair, *arguments, **options):
    """Run many tunings; see `gearlib.integrators`."""
    run_each(partial(run, pair, **options), *arguments)
