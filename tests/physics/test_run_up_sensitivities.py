"""Derivatives of run-ups: against differences of a second code in 40 digits."""

import os

import mpmath as mp
import numpy as np
import pytest

import gearlib
from tests.paper import PAPER
from tests.physics.test_run_up import SIX, TRAIN
from tests.physics.test_sensitivities import moved
from tests.properties.known_models import RADIUS, pairs_as_train
from tests.references import reference_pair_run_up

FIELDS = (
    "max_stiffness",
    "stiffness_ratio",
    "contact_ratio",
    "reduced_mass",
    "load",
    "backlash",
    "material_damping",
    "backlash_damping",
)
#: Of a wave a revolution, and of the mesh.
ORDERS = (1, 5, 10)
COURSE = ("driven_mass", "base_radius", "initial_displacement", "initial_velocity", "speed")


def differences(pair, run, along, course, orders):
    """Return name of a variable -> its derivative along a direction, by differences in 40 digits.

    `along` has what parameters change by; `orders` are those whose amplitudes are told too.
    """
    values = {field: getattr(pair, field) for field in (*FIELDS, "teeth")}
    values |= {name: course[name] for name in ("driven_mass", "base_radius")} | {"speed": 1.0}
    for one, start in zip(("displacement", "velocity"), course["initial_state"], strict=True):
        values[f"initial_{one}"] = start
    events = np.column_stack([run[f"event_{one}"] for one in ("time", "from", "to")]).tolist()
    events = [(t, int(a), int(b)) for t, a, b in events]
    with mp.workdps(40):
        step = mp.mpf("1e-15")
        moved = [
            {name: values[name] + sign * step * rate for name, rate in along.items()}
            for sign in (1, -1)
        ]
        rows = course["speed"], course["load"], events, run.time.values[::5].tolist()
        up, down = (reference_pair_run_up.run_up(values | one, *rows, orders) for one in moved)
        return {
            one: np.array(
                [float((a - b) / (2 * step)) for a, b in zip(up[one], down[one], strict=True)]
            )
            for one in up
        }


@pytest.mark.parametrize("seed", range(3))
def test_derivatives_are_those_of_forty_digits(seed):
    rng = np.random.default_rng(seed)
    pair = PAPER.replace(
        material_damping=rng.uniform(1500.0, 3000.0),
        backlash_damping=rng.uniform(500.0, 2500.0),
        contact_ratio=rng.uniform(1.3, 1.7),
        backlash=(40e-6, 8e-6, 8e-6)[seed],
        teeth=5,
    )
    top = float(pair.speed(1.0))
    course = {
        "speed": [(0.0, 0.6 * top), (0.004, 1.1 * top), (0.007, 0.9 * top)],
        # Steps of the load go by scalar closed forms, ramps by matrices.
        "load": [(0.0, 1.0), (0.003, 1.0 if seed < 2 else 0.7), (0.003, 0.5)],
        "driven_mass": 0.5 * pair.reduced_mass,
        "base_radius": 0.05,
        "initial_state": (0.7, 0.3),
    }
    names = (*FIELDS, *COURSE)
    run = gearlib.run_up(pair, samples_per_period=8, sensitivities=names, **course)
    assert run.sensitivity_status == 0
    assert (run.event_to == -1).any() or not seed
    # All at once, each by a random share of its size; one by one if asked for.
    sizes = {name: getattr(pair, name) for name in FIELDS} | dict.fromkeys(COURSE, 1.0)
    sizes |= {name: course[name] for name in ("driven_mass", "base_radius")}
    along = [{name: rng.uniform(-1.0, 1.0) * size for name, size in sizes.items()}]
    if os.environ.get("GEARLIB_PROPERTIES"):
        along += [{name: size} for name, size in sizes.items()]
    # Of ramps the orders are those of samples.
    orders = ORDERS if seed == 1 else ()
    for slopes in along:
        for one, wanted in differences(pair, run, slopes, course, orders).items():
            label, where = one, run
            if one.startswith("order"):
                where = gearlib.order_track(run, ORDERS, variable=one.removeprefix("order_"))
                label = "amplitude"
            got = sum(rate * where[f"d_{label}_d_{name}"] for name, rate in slopes.items())
            got = got[::5] if got.dims == ("time",) else np.ravel(got)
            assert np.abs(got - wanted).max() <= 1e-11 * np.abs(wanted).max(), (slopes, one)


def one_pair(kind):
    """Return (model, pair, what the pair has to be told of it)."""
    pair = PAPER.replace(material_damping=2500.0, backlash_damping=900.0, teeth=5)
    if kind == "one degree":
        given = {"driven_mass": 1.0, "base_radius": 0.1, "initial_state": (0.7, 0.3)}
        return gearlib.OneDegreePair(pair=pair), pair, given
    if kind == "six degrees":
        gears = SIX.replace(bearing_stiffness=(np.inf,) * 4, friction=(0.0, 0.0))
        gears = gears.replace(pair=pair.replace(reduced_mass=gears.reduced_mass_torsional))
        driven = gears.inertias[1] / gears.base_radii[1] ** 2
        return gears, gears.pair, {"driven_mass": driven, "base_radius": gears.base_radii[0]}
    pair = pair.replace(teeth=20)
    driven = 2.0 * pair.reduced_mass
    return pairs_as_train(pair), pair, {"driven_mass": driven, "base_radius": RADIUS}


@pytest.mark.parametrize("kind", ["one degree", "six degrees", "train"])
def test_one_pair_has_the_same_derivatives_in_all_models(kind):
    model, pair, given = one_pair(kind)
    top = float(pair.speed(1.0))
    course = {
        "speed": [(0.0, 0.6 * top), (0.006, 1.1 * top), (0.01, 0.9 * top)],
        "load": [(0.0, 1.0), (0.004, 1.0), (0.004, 0.5)],
        "samples_per_period": 8,
    }
    names = (*FIELDS[:3], *FIELDS[4:], "speed")
    if kind == "one degree":
        names = FIELDS + COURSE
    own = given if kind == "one degree" else {}
    one = gearlib.run_up(pair, sensitivities=names, **course, **given)
    other = gearlib.run_up(model, sensitivities=names, **course, **own)
    assert one.sensitivity_status == other.sensitivity_status == 0
    assert one.sizes["event"] > 10
    for name in one.data_vars:
        if name.startswith("d_"):
            values, wanted = np.ravel(other[name]), np.ravel(one[name])
            # Modes of trains round otherwise.
            assert np.abs(values - wanted).max() <= 1e-9 * np.abs(wanted).max(), name
    # So have orders, of what jumps at no phase that moves; the train makes no whole revolution.
    held = {"displacement": names, "velocity": names, "dynamic_force": FIELDS[:2]}
    for variable in held if kind != "train" else ():
        left = [f"d_{variable}_d_{name}" for name in names if name not in held[variable]]
        first, then = (
            gearlib.order_map(run.drop_vars(left), variable=variable, highest=7)
            for run in (one, other)
        )
        for name in first.data_vars:
            if name.startswith("d_amplitude"):
                values, wanted = then[name].values, first[name].values
                assert np.abs(values - wanted).max() <= 1e-9 * np.abs(wanted).max(), name


def test_the_last_loss_of_contact_before_a_jump_moves_by_its_derivative():
    pair = PAPER.replace(material_damping=3953.7, backlash_damping=3953.7)
    course = {"start": pair.speed(0.8), "stop": pair.speed(0.6), "duration": 1.0}
    run = gearlib.run_up(pair, sensitivities=("material_damping", "load"), **course)
    # From there on contact is kept: the motion has fallen.
    assert pair.tuning_at(float(run.event_speed[-1])) > 0.601
    for name in ("material_damping", "load"):
        step = 1e-8 * getattr(pair, name)
        ends = [
            gearlib.run_up(pair.replace(**{name: getattr(pair, name) + k * step}), **course)
            for k in (1.0, -1.0)
        ]
        assert all(one.sizes["event"] == run.sizes["event"] for one in ends)
        moved = float(ends[0].event_time[-1] - ends[1].event_time[-1]) / (2.0 * step)
        # Rounding of an instant over the step.
        assert moved == pytest.approx(float(run[f"d_event_time_d_{name}"][-1]), rel=1e-5)


def test_a_planetary_set_against_differences():
    train = TRAIN.replace(reference_frequency=TRAIN.reference_angular_frequency / (2.0 * np.pi))
    course = {"speed": [(0.0, 300.0), (0.02, 2400.0), (0.04, 3000.0)], "samples_per_period": 4}
    course |= {"load": [(0.0, 0.3), (0.012, 0.3), (0.012, 1.0)], "initial_state": "static"}
    names = ("max_stiffness of mesh sun 2", "inertia of body sun", "load", "contact_ratio")
    run = gearlib.run_up(train, sensitivities=names, **course)
    assert run.sizes["event"] > 10
    for name in names:
        ends = [moved(train, 0.0, name, share) for share in (1e-6, -1e-6)]
        up, down = (gearlib.run_up(one, **course) for one, _, _ in ends)
        step = abs(ends[0][2])
        for one in ("displacement", "dynamic_force", "displacement_max", "mean_force"):
            slope = (up[one] - down[one]) / (2.0 * step)
            got = run[f"d_{one}_d_{name}"]
            # Rounding of a run over the step.
            assert np.abs(got - slope).max() < 3e-6 * np.abs(slope).max(), (name, one)
        track, *ends = (gearlib.order_track(one, (1.0, 20.0)) for one in (run, up, down))
        slope = (ends[0].amplitude - ends[1].amplitude) / (2.0 * step)
        got = track[f"d_amplitude_d_{name}"]
        assert np.abs(got - slope).max() < 3e-6 * np.abs(slope).max(), name


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"sensitivities": ("tuning",)}, "sensitivities = 'tuning' is not allowed: it must be one"),
        ({"sensitivities": ("load", "load")}, "names must be all different"),
        ({"sensitivities": 7}, "sensitivities = 7 is not allowed: it must be a sequence of names"),
        ({"sensitivities": "driven_mass"}, "with base_radius = None"),
        (
            {"sensitivities": "contact_ratio", "model": PAPER.replace(contact_ratio=1.0)},
            "contact_ratio = 1.0",
        ),
    ],
)
def test_what_has_no_derivative_is_refused(given, words):
    with pytest.raises(ValueError, match="not allowed") as told:
        gearlib.run_up(**{"model": PAPER, "start": 1e3, "stop": 1100.0, "duration": 0.05} | given)
    assert words in str(told.value)
