"""Call every public function with every model: it must work or state in one sentence why not."""

import inspect
import math
import re
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import pytest

import gearlib
from gearlib import DeadZoneOscillator, Harmonics, continue_orbit, periodic_orbit, simulate, sweep
from gearlib.analysis.orbits import special_points
from gearlib.analysis.orbits.shooting import NoOrbit
from gearlib.models.model import Model
from gearlib.models.one_degree_pair import Equation
from gearlib.models.profiles import Steps
from tests.geometry.stages import fzg_c
from tests.paper import PAPER_PAIR
from tests.properties.known_models import CHAIN, gears_on_bearings


@dataclass(frozen=True, kw_only=True)
class StopOscillator(Model):
    """A model outside the library: a harmonically forced mass that meets a stop at x = 0."""

    stiffness: float
    hardening: float = 0.0

    title_noun = "a mass at a stop"

    @cached_property
    def equation(self):
        """Return the equation of motion of the mass."""
        side, damping = Steps((0.0,), (self.stiffness,)).piecewise_stiffness(), np.zeros((3, 3))
        # Column 0 has the coefficients of linear damping, in contact and in free flight.
        damping[:, 0] = 0.1
        return Equation(
            upper=0.0,
            lower=-math.inf,
            drive_stiffness=side,
            coast_stiffness=side,
            damping=damping,
            stiffness_powers=np.array([0.0, self.hardening]),  # quadratic, cubic
            load=1.0,
            force=Harmonics((0.5,)).table(),
            natural_frequency=math.sqrt(self.stiffness),
        )


TUNING, STATE_BOX = 0.9, ((-1.0, 1.0), (-1.0, 1.0))
DAMPED = PAPER_PAIR.replace(material_damping=3953.7, backlash_damping=3953.7)
#: Rigid bearings leave few coordinates, for which trapping ellipses are found quickly.
GEARS_ON_RIGID_BEARINGS = gears_on_bearings(math.inf, 3953.7, 3953.7)
#: In the turning frame, this train has 18 mesh periods per revolution of the sun.
PLANETARY_OPTIONS = {"teeth": (24, 72), "stiffness_ratio": (0.8, 0.8)}
FROM_GEOMETRY = gearlib.LoadSharingPair.from_geometry
MODELS = {
    "gear pair": DAMPED,
    "one degree": gearlib.OneDegreePair(pair=DAMPED, backlash_cubic_damping=4e5),
    "pairs of teeth": FROM_GEOMETRY(fzg_c(), torque=300.0, damping_ratio=0.05),
    "six degrees": GEARS_ON_RIGID_BEARINGS,
    "run-out": GEARS_ON_RIGID_BEARINGS.replace(eccentricities=(1e-6, 1e-6), teeth=(3, 2)),
    "train": CHAIN,
    "planetary": gearlib.planetary(**PLANETARY_OPTIONS),
    "turning planetary": gearlib.planetary(**PLANETARY_OPTIONS, turning=True),
    "gyroscopic forces": gearlib.planetary(**PLANETARY_OPTIONS, turning=True, gyroscopic=True),
    "oscillator": DeadZoneOscillator(
        lower_edge=-4.0, upper_stiffness=1.0, damping=0.1, load=1.0, forcing=Harmonics((0.5,))
    ),
    "linear stop": StopOscillator(stiffness=1.0),
    "hard stop": StopOscillator(stiffness=1.0, hardening=0.2),
}


def periodic_orbit_of(model):
    """Return the periodic orbit of a model at the tuning TUNING."""
    return periodic_orbit(model, TUNING, period=model.repeats)


def long_run_up(model):
    """Return a run-up that takes more than one revolution."""
    return gearlib.run_up(model, 2000.0, 2500.0, duration=0.1, samples_per_period=128)


def with_scattered_parameter(function, **options):
    """Return a function of a model that calls `function` with a tolerance of 1 %.

    The tolerance applies to the load or, if the model has none, to the stiffness.
    """

    def call(model):
        """Call the function for two samples of a model."""
        name = "load" if hasattr(model, "load") else "stiffness"
        return function(model, {name: {"upper": "1 %", "lower": "-1 %"}}, n=2, **options)

    return call


def final_state(model, tuning):
    """Return the final state of a run of two mesh periods."""
    return simulate(model, tuning, periods=2).final_state


#: Calls of the public functions with a model, by name.
CALLS = {
    "scatter": with_scattered_parameter(
        gearlib.scatter, tunings=[TUNING], periods=2, record_periods=1, quantities=()
    ),
    "sobol_indices": with_scattered_parameter(
        gearlib.sobol_indices, quantities=("force",), speed=3000.0
    ),
    "simulate": lambda pair: simulate(pair, TUNING, periods=2),
    "sweep": lambda pair: sweep(pair, [TUNING], periods=2, record_periods=1, direction="up"),
    "basins": lambda pair: gearlib.basins(pair, TUNING, ([0.0], [0.0]), periods=60),
    "basin_stability": lambda pair: gearlib.basin_stability(
        pair, [TUNING], STATE_BOX, samples=1, periods=60
    ),
    "bifurcation_diagram": lambda pair: gearlib.bifurcation_diagram(
        pair, [TUNING], settle=2, strobes=4
    ),
    "poincare_section": lambda pair: gearlib.poincare_section(
        pair, TUNING, [(0.0, 0.0)], periods=2
    ),
    "lyapunov_exponents": lambda pair: gearlib.lyapunov_exponents(
        pair, [TUNING], settle=2, periods=20
    ),
    "run_up": lambda pair: gearlib.run_up(pair, 2000.0, 2500.0, duration=0.05),
    "duty_point": lambda pair: gearlib.duty_point(pair, 3000.0),
    # 432 mesh periods are an integer number of revolutions for all models.
    "orders": lambda pair: gearlib.orders(
        simulate(pair, TUNING, periods=432, record_periods=432, samples_per_period=64), count=1
    ),
    "order_map": lambda pair: gearlib.order_map(long_run_up(pair)),
    "trust": lambda pair: gearlib.trust(pair, TUNING, periods=200, exponent_periods=20),
    "periodic_orbit": lambda pair: periodic_orbit_of(pair).dataset(),
    "sensitivities": lambda pair: gearlib.sensitivities(final_state, pair, "tuning", tuning=TUNING),
    "continue_orbit": lambda pair: continue_orbit(
        periodic_orbit_of(pair), to=TUNING + 0.01, max_points=3
    ),
    "tongues": lambda pair: gearlib.tongues(pair, start=0.9, stop=1.1, step=0.05),
    "schmidt": lambda pair: gearlib.schmidt(
        pair, TUNING, harmonics=16, max_iterations=20
    ).dataset(),
    "harmonic_balance": lambda pair: gearlib.harmonic_balance(pair, TUNING, harmonics=16).dataset(),
}
MODELS_WITHOUT_GEARS = {"oscillator", "linear stop", "hard stop"}
TRAIN_MODELS = {"train", "planetary", "turning planetary", "gyroscopic forces"}
MODELS_WITH_MANY_COORDINATES = {"pairs of teeth", "six degrees", "run-out"} | TRAIN_MODELS
#: Groups of models, each with the functions that refuse them.
REFUSED_MODELS = [
    (TRAIN_MODELS, "basins basin_stability bifurcation_diagram poincare_section"),
    (MODELS_WITHOUT_GEARS, "continue_orbit duty_point sobol_indices orders"),
    (MODELS_WITHOUT_GEARS | {"pairs of teeth"}, "tongues"),
    (MODELS_WITHOUT_GEARS | {"one degree", "gyroscopic forces"}, "run_up order_map"),
    (MODELS_WITHOUT_GEARS | MODELS_WITH_MANY_COORDINATES, "schmidt harmonic_balance"),
]
#: Words about gears, which must not occur in the labels of an oscillator.
GEAR_WORDS = re.compile("mesh|static deflection|flank|dtau")
#: Functions that need more than a model, which are tested elsewhere.
FUNCTIONS_TESTED_ELSEWHERE = {
    "switch_branch",
    "locus",
    "fit",
    "methods",
    "read_measured",
    "read_gearbox",
}
FUNCTIONS_TESTED_ELSEWHERE |= {
    "read_train",
    "write_train",
    "characteristic_frequencies",
    "write_fmu",
}
FUNCTIONS_TESTED_ELSEWHERE |= {"state_space", "frequency_response"}


def test_every_public_function_is_called():
    """CALLS must have all public functions except those that are tested elsewhere."""
    functions = {name for name in gearlib.__all__ if inspect.isfunction(getattr(gearlib, name))}
    # Functions that prove results are called with all models in tests/proofs.
    proof_functions = {name for name in functions if name.startswith("certify")}
    train_functions = {"planetary", "idler", "two_stage", "split_power_reducer"}
    assert set(CALLS) == functions - FUNCTIONS_TESTED_ELSEWHERE - proof_functions - train_functions


@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize("call", CALLS)
def test_every_function_accepts_a_model_or_refuses_it_by_name(call, model):
    """A refusal must be one sentence that names the class, the values or the title of the model.

    A result for the oscillator must not have labels with words about gears.
    """
    instance = MODELS[model]
    if any(model in models and call in functions.split() for models, functions in REFUSED_MODELS):
        with pytest.raises(ValueError, match="not allowed") as error:
            CALLS[call](instance)
        message = str(error.value)
        names = type(instance).__name__, repr(instance), instance.title_noun
        assert any(name in message for name in names)
        assert "\n" not in message and ". " not in message
        return
    result = CALLS[call](instance)
    dataset = getattr(result, "runs", result)
    if model == "oscillator":
        labels = [dataset.attrs.get("title", "")]
        labels += [str(variable.attrs.get("long_name")) for variable in dataset.variables.values()]
        assert not [label for label in labels if GEAR_WORDS.search(label)]


def reversed_load(model):
    """Return the model with the opposite load."""
    if hasattr(model, "bodies"):
        return model.replace(bodies=[replace(body, torque=-body.torque) for body in model.bodies])
    if hasattr(model, "torques"):
        return model.replace(torques=[-torque for torque in model.torques])
    return model.replace(load=-model.load)


#: Models with accelerations even in the static state, due to run-out or a turning frame.
ACCELERATED_MODELS = ("run-out", "gyroscopic forces")
#: Models, each with the contact state of the side that carries the load: 1 drive, -1 coast.
LOADED_MODELS = [(model, 1) for name, model in MODELS.items() if name not in ACCELERATED_MODELS]
LOADED_MODELS += [
    (reversed_load(MODELS[name]), -1) for name in ("six degrees", "train", "oscillator")
]


@pytest.mark.parametrize(("model", "side"), LOADED_MODELS)
def test_the_static_state_has_no_acceleration(model, side):
    """In the static state forces must balance, with contact on the loaded side."""
    run = simulate(model, TUNING, periods=1, initial_state=model.static_state(TUNING))
    assert (run.contact[0] == side).all()
    np.testing.assert_allclose(run.acceleration[0], 0.0, atol=1e-13)


@pytest.mark.parametrize("model", ["gear pair", "pairs of teeth", "six degrees"])
def test_a_negative_load_rests_on_the_coast_side(model):
    """The static displacements under opposite loads must be symmetric about half the backlash.

    Without relief and errors, both sides have equal stiffness at phase 0.
    """
    gears = MODELS[model].replace(backlash=40e-6)
    # The symmetry also holds for the sum of all coordinates; the velocities are 0.
    drive_sum, coast_sum = (sum(gears.static_state(TUNING, load)) for load in (1.0, -1.0))
    assert coast_sum == pytest.approx(-gears.backlash_ratio - drive_sum, rel=1e-14)


@pytest.mark.parametrize("model", ["gear pair", "six degrees"])
def test_without_load_the_flanks_just_touch(model):
    assert not any(MODELS[model].static_state(TUNING, 0.0))
    assert not any(MODELS[model].replace(backlash=math.inf).static_state(TUNING, -1.0))


@pytest.mark.parametrize("model", [name for name in MODELS if name not in MODELS_WITHOUT_GEARS])
def test_a_locus_from_an_ordinary_point_is_refused(model):
    """`locus` must refuse a point that is labelled special, but is not."""
    gears = MODELS[model]
    branch = continue_orbit(periodic_orbit_of(gears), to=TUNING + 0.01, max_points=3)
    for label in (special_points.FOLD, special_points.DOUBLING, special_points.GRAZING):
        branch.label[0] = label
        with pytest.raises((ValueError, NoOrbit), match="point|not allowed"):
            gearlib.locus(gears, branch, 0, "backlash_ratio", to=5.0, max_points=3)
