"""Methods that end their steps at events against the exact method, for every kind of model.

Packages that are not installed are skipped. Sweeps by every method must match single runs.
"""

import math
from typing import NamedTuple

import numpy as np
import pytest

import gearlib
from gearlib import Fourier, GearPair, OneDegreePair, integrators, simulate, sweep
from gearlib.engines.summary_columns import COLUMNS
from tests.independent.differences import SHARES
from tests.paper import PAPER_PAIR
from tests.physics.test_step_methods import (
    DAMPED_PAIR,
    METHOD_VARIANTS,
    NONLINEAR_PAIR,
    PAIR_DAMPED_IN_CONTACT,
    SCIPY_WITH_EVENTS,
)
from tests.properties.cases import random_train_case
from tests.properties.known_models import CUBIC, MOTION_CASES, UNDAMPED, MotionCase
from tests.properties.test_summaries import LOAD_SHARING_PAIR
from tests.trains.test_methods import INITIAL_STATE, bouncing_train


class Accuracy(NamedTuple):
    """Options of a method, and its largest allowed errors for pairs, other models and trains."""

    options: dict
    pair: float
    other: float
    train: float = 1e-9


#: heyoka is exact up to rounding. The methods of scipy have an error of 1e-12 per step; the
#: sum over all steps and the interpolation of events increase it by a factor of 1000, and the kink
#: of |x'| x' by another factor of 10.
METHODS = {"scipy": Accuracy(SCIPY_WITH_EVENTS, 1e-8, 1e-8), "heyoka": Accuracy({}, 1e-12, 1e-11)}
PAIR_IN_OIL = PAPER_PAIR.replace(material_damping=3953.7, backlash_damping=3953.7)
COAST_SIDE_LINE = -PAIR_IN_OIL.backlash_ratio
MOTIONS = {
    "bounces": MotionCase(PAIR_IN_OIL, 0.9, (0.0, 0.0), 20),
    "keeps contact": MotionCase(PAIR_IN_OIL, 0.7, (0.0, 0.0), 20),
    "rest on the drive-side line": MotionCase(PAIR_IN_OIL, 0.82, (0.0, 0.0)),
    "rest on the coast-side line": MotionCase(PAIR_IN_OIL, 0.82, (COAST_SIDE_LINE, 0.0)),
    "both flanks": MotionCase(PAIR_IN_OIL, 0.9, (-1.0, -6.0), 4),
    "no gap": MotionCase(DAMPED_PAIR.replace(backlash=0.0), 0.8, (0.5, -2.0), 4),
    "no coast-side flank": MotionCase(DAMPED_PAIR.replace(backlash=math.inf), 0.8, (0.5, -2.0), 4),
    "without oil": MotionCase(PAIR_DAMPED_IN_CONTACT, 0.8, (1.0, -3.0)),
    "everything": MotionCase(NONLINEAR_PAIR, 0.8, (1.0, -3.0)),
    "harmonics": MotionCase(OneDegreePair(pair=DAMPED_PAIR, profile=Fourier(3)), 0.8, (1.0, -3.0)),
    "quadratic": MotionCase(
        OneDegreePair(pair=PAIR_IN_OIL, profile=Fourier(3), quadratic_damping=3e4),
        0.9,
        (0.0, 0.0),
        10,
    ),
    "six degrees": MotionCase(MOTION_CASES["free bearings"].model, 0.8, (1.0, -3.0)),
    "train": MotionCase(bouncing_train(), 0.9, INITIAL_STATE, 6),
    # Run-out, deviations of both flanks, friction; a common period of many mesh periods.
    **{f"random train {seed}": MotionCase(*random_train_case(seed), 2) for seed in (0, 5)},
}
STATES = ("displacement", "velocity", "acceleration", "dynamic_force", "final_state")
EXTREMA = ("displacement_max", "displacement_min")
INSTALLED_METHODS = {method for method in METHODS if integrators.describe_method(method).available}


@pytest.mark.parametrize("name", MOTIONS)
@pytest.mark.parametrize("method", sorted(INSTALLED_METHODS))
def test_a_motion_matches_the_exact_method(method, name):
    """Samples, events and statistics must match the exact method within the accuracy of METHODS.

    A method must refuse a model that it does not support.
    """
    accuracy, case = METHODS[method], MOTIONS[name]
    run_options = {
        "periods": case.periods,
        "record_periods": case.periods,
        "samples_per_period": 64,
    }
    run_options["initial_state"] = case.state
    if not integrators.METHODS[method].supports(case.model):
        with pytest.raises(ValueError, match=f"method = '{method}' is not allowed .* it takes"):
            simulate(case.model, case.tuning, method=method, **run_options)
        return
    exact = simulate(case.model, case.tuning, **run_options)
    run = simulate(case.model, case.tuning, method=method, options=accuracy.options, **run_options)
    assert int(run.status) == 0 and int(run.evaluations) > 0
    is_train = "mesh" in exact.dims
    for column in ("event_from", "event_to", *["event_mesh"] * is_train):
        np.testing.assert_array_equal(run[column], exact[column])
    assert case.model.repeats > 1 or not name.startswith("random")
    error = accuracy.pair if isinstance(case.model, GearPair) else accuracy.other
    error = accuracy.train if is_train else error
    columns = [*STATES, "event_phase", "bounces", *SHARES]
    columns += ["modified_stiffness", "body_motion"] if is_train else [*case.model.extra_samples]
    # Extrema are taken over step ends and samples. Between samples at the distance h = 2 pi / 64,
    # the displacement may exceed them by x'' h^2 / 8 = 5e-3.
    tolerances = dict.fromkeys(columns, error) | dict.fromkeys(EXTREMA, 0.01)
    for column, atol in tolerances.items():
        np.testing.assert_allclose(run[column], exact[column], rtol=0, atol=atol, err_msg=column)


SWEEP_CASES = [
    (PAIR_DAMPED_IN_CONTACT, method, options)
    for method, options in METHOD_VARIANTS
    if options != SCIPY_WITH_EVENTS
]
SWEEP_CASES += [
    (PAIR_IN_OIL, method, {}) for method in sorted({"exact", "heyoka"} & INSTALLED_METHODS)
]
SWEEP_CASES += [
    (OneDegreePair(pair=UNDAMPED, **CUBIC), "taylor", {}),
    (bouncing_train(), "rk4", {}),
]
SWEEP_CASES += [
    (MOTION_CASES[name].model, "exact", {}) for name in ("gear_rattle", "unequal gears", "reducer")
]


@pytest.mark.parametrize(("model", "method", "options"), SWEEP_CASES)
def test_a_sweep_matches_its_single_runs(model, method, options):
    """Each row of a sweep must equal a single run at its tuning, because it starts anew there."""
    run_options = {"periods": 10, "record_periods": 4, "method": method, "options": options}
    table = sweep(model, [0.9, 0.7], **run_options)
    assert ("mesh" in table.dynamic_force_max.dims) == bool(model.mesh_names)
    for nu in (0.7, 0.9):
        single_run = simulate(model, nu, **run_options)
        sweep_row = table.sel(tuning=nu)
        for name in {"final_state", *(column.name for column in COLUMNS)} & set(single_run):
            if name.endswith(("max", "min")) and method not in integrators.AUTOMATIC:
                # Extrema of a single run include samples, but extrema of a sweep only step ends.
                if name.endswith("max"):
                    assert (single_run[name] >= sweep_row[name]).all()
                else:
                    assert (single_run[name] <= sweep_row[name]).all()
            else:
                # Results differ by rounding, because a single run also stops at samples.
                np.testing.assert_allclose(
                    sweep_row[name], single_run[name], rtol=1e-13, err_msg=name
                )
        # A single run continues until it has settled. A sweep may not find a period and then has 0.
        assert sweep_row.period in (0, single_run.period)


def test_methods_refuse_models_that_they_do_not_support():
    """A method must refuse a model it does not support and name the methods that do."""
    unsupported = [(bouncing_train(), method) for method in ("taylor", "rk45", "newmark")]
    unsupported += [(LOAD_SHARING_PAIR, method) for method in ("rk4", "scipy", "heyoka")]
    for model, method in unsupported:
        with pytest.raises(
            ValueError, match=f"method = '{method}' .* it supports .* must be one of"
        ):
            gearlib.simulate(model, 0.9, periods=1, method=method)
