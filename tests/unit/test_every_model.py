"""Every public function with every model: it works or gives a reason in one sentence."""

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
from tests.properties.known_models import CHAIN, gears


@dataclass(frozen=True, kw_only=True)
class Stop(Model):
    """A model that the library does not know: a driven mass that meets a stop at x = 0."""

    stiffness: float
    hardening: float = 0.0

    title_noun = "a mass at a stop"

    @cached_property
    def equation(self):
        """Return the equation of motion of the mass."""
        side, damping = Steps((0.0,), (self.stiffness,)).pieces(), np.zeros((3, 3))
        # Column 0 is linear damping, in contact and in the gap.
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


NU, BOX = 0.9, ((-1.0, 1.0), (-1.0, 1.0))
DAMPED = PAPER_PAIR.replace(material_damping=3953.7, backlash_damping=3953.7)
#: With rigid bearings two coordinates are left besides the rigid-body rotation, for which trapping
#: ellipses are found quickly.
RIGID = gears(math.inf, 3953.7, 3953.7)
#: If it turns, this train has 18 mesh periods per revolution of the sun.
PLANETARY = {"teeth": (24, 72), "stiffness_ratio": (0.8, 0.8)}
FROM_GEOMETRY = gearlib.LoadSharingPair.from_geometry
MODELS = {
    "gear pair": DAMPED,
    "one degree": gearlib.OneDegreePair(pair=DAMPED, backlash_cubic_damping=4e5),
    "pairs of teeth": FROM_GEOMETRY(fzg_c(), torque=300.0, damping_ratio=0.05),
    "six degrees": RIGID,
    "run-out": RIGID.replace(eccentricities=(1e-6, 1e-6), teeth=(3, 2)),
    "train": CHAIN,
    "planetary": gearlib.planetary(**PLANETARY),
    "turning planetary": gearlib.planetary(**PLANETARY, turning=True),
    "gyroscopic forces": gearlib.planetary(**PLANETARY, turning=True, gyroscopic=True),
    "oscillator": DeadZoneOscillator(
        lower_edge=-4.0, upper_stiffness=1.0, damping=0.1, load=1.0, forcing=Harmonics((0.5,))
    ),
    "linear stop": Stop(stiffness=1.0),
    "hard stop": Stop(stiffness=1.0, hardening=0.2),
}


def orbit(pair):
    """Return the periodic orbit of a model at the tuning NU."""
    return periodic_orbit(pair, NU, period=pair.repeats)


def run_up_of_revolutions(pair):
    """Return a run-up of more than one revolution."""
    return gearlib.run_up(pair, 2000.0, 2500.0, duration=0.1, samples_per_period=128)


def scattering(function, **options):
    """Return a call of `function` on a model with tolerances of 1 % of its load or stiffness."""

    def call(model):
        """Call the function on a model."""
        name = "load" if hasattr(model, "load") else "stiffness"
        return function(model, {name: {"upper": "1 %", "lower": "-1 %"}}, n=2, **options)

    return call


def end(model, tuning):
    """Return the final state after two mesh periods."""
    return simulate(model, tuning, periods=2).final_state


CALLS = {
    "scatter": scattering(
        gearlib.scatter, tunings=[NU], periods=2, record_periods=1, quantities=()
    ),
    "sobol_indices": scattering(gearlib.sobol_indices, quantities=("force",), speed=3000.0),
    "simulate": lambda pair: simulate(pair, NU, periods=2),
    "sweep": lambda pair: sweep(pair, [NU], periods=2, record_periods=1, direction="up"),
    "basins": lambda pair: gearlib.basins(pair, NU, ([0.0], [0.0]), periods=60),
    "basin_stability": lambda pair: gearlib.basin_stability(pair, [NU], BOX, samples=1, periods=60),
    "bifurcation_diagram": lambda pair: gearlib.bifurcation_diagram(
        pair, [NU], settle=2, strobes=4
    ),
    "poincare_section": lambda pair: gearlib.poincare_section(pair, NU, [(0.0, 0.0)], periods=2),
    "lyapunov_exponents": lambda pair: gearlib.lyapunov_exponents(pair, [NU], settle=2, periods=20),
    "run_up": lambda pair: gearlib.run_up(pair, 2000.0, 2500.0, duration=0.05),
    "duty_point": lambda pair: gearlib.duty_point(pair, 3000.0),
    # 432 periods are whole revolutions of all models.
    "orders": lambda pair: gearlib.orders(
        simulate(pair, NU, periods=432, record_periods=432, samples_per_period=64), count=1
    ),
    "order_map": lambda pair: gearlib.order_map(run_up_of_revolutions(pair)),
    "trust": lambda pair: gearlib.trust(pair, NU, periods=200, exponent_periods=20),
    "periodic_orbit": lambda pair: orbit(pair).dataset(),
    "sensitivities": lambda pair: gearlib.sensitivities(end, pair, "tuning", tuning=NU),
    "continue_orbit": lambda pair: continue_orbit(orbit(pair), to=NU + 0.01, max_points=3),
    "tongues": lambda pair: gearlib.tongues(pair, start=0.9, stop=1.1, step=0.05),
    "schmidt": lambda pair: gearlib.schmidt(pair, NU, harmonics=16, max_iterations=20).dataset(),
    "harmonic_balance": lambda pair: gearlib.harmonic_balance(pair, NU, harmonics=16).dataset(),
}
NO_GEARS = {"oscillator", "linear stop", "hard stop"}
TRAINS = {"train", "planetary", "turning planetary", "gyroscopic forces"}
MANY_COORDINATES = {"pairs of teeth", "six degrees", "run-out"} | TRAINS
#: Groups of models with the functions that refuse them.
REFUSED = [
    (TRAINS, "basins basin_stability bifurcation_diagram poincare_section"),
    (NO_GEARS, "continue_orbit duty_point sobol_indices orders"),
    (NO_GEARS | {"pairs of teeth"}, "tongues"),
    (NO_GEARS | {"one degree", "gyroscopic forces"}, "run_up order_map"),
    (NO_GEARS | MANY_COORDINATES, "schmidt harmonic_balance"),
]
#: Words about gears, which must not occur in texts about an oscillator.
GEAR_WORDS = re.compile("mesh|static deflection|flank|dtau")
#: Functions that need more than a model; other tests call them.
OTHERS = {"switch_branch", "locus", "fit", "methods", "read_measured", "read_gearbox"}
OTHERS |= {"read_train", "write_train", "characteristic_frequencies", "write_fmu"}
OTHERS |= {"state_space", "frequency_response"}


def test_every_public_function_is_listed():
    functions = {name for name in gearlib.__all__ if inspect.isfunction(getattr(gearlib, name))}
    # Proofs are tried with all models in tests/proofs.
    proofs = {name for name in functions if name.startswith("certify")}
    trains = {"planetary", "idler", "two_stage", "split_power_reducer"}
    assert set(CALLS) == functions - OTHERS - proofs - trains


@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize("call", CALLS)
def test_every_function_accepts_a_model_or_refuses_it_by_name(call, model):
    """A refusal is one sentence that names the class, the values or the title of the model."""
    pair = MODELS[model]
    if any(model in models and call in calls.split() for models, calls in REFUSED):
        with pytest.raises(ValueError, match="not allowed") as error:
            CALLS[call](pair)
        message = str(error.value)
        assert any(name in message for name in (type(pair).__name__, repr(pair), pair.title_noun))
        assert "\n" not in message and ". " not in message
        return
    result = CALLS[call](pair)
    dataset = getattr(result, "runs", result)
    if model == "oscillator":
        texts = [dataset.attrs.get("title", "")]
        texts += [str(variable.attrs.get("long_name")) for variable in dataset.variables.values()]
        assert not [text for text in texts if GEAR_WORDS.search(text)]


def reversed_load(model):
    """Return the model with the opposite load."""
    if hasattr(model, "bodies"):
        return model.replace(bodies=[replace(body, torque=-body.torque) for body in model.bodies])
    if hasattr(model, "torques"):
        return model.replace(torques=[-torque for torque in model.torques])
    return model.replace(load=-model.load)


#: Run-out and turning frames accelerate a model even in its static state.
ACCELERATED = ("run-out", "gyroscopic forces")
#: Models with the side that carries their load.
LOADED = [(model, 1) for name, model in MODELS.items() if name not in ACCELERATED]
LOADED += [(reversed_load(MODELS[name]), -1) for name in ("six degrees", "train", "oscillator")]


@pytest.mark.parametrize(("model", "side"), LOADED)
def test_the_static_state_has_no_acceleration(model, side):
    run = simulate(model, NU, periods=1, initial_state=model.static_state(NU))
    assert (run.contact[0] == side).all()
    np.testing.assert_allclose(run.acceleration[0], 0.0, atol=1e-13)


@pytest.mark.parametrize("model", ["gear pair", "pairs of teeth", "six degrees"])
def test_a_negative_load_rests_on_the_coast_side(model):
    # Without relief and errors both sides have equal stiffness at phase 0, so that the coast state
    # is
    # the mirror image of the drive state.
    gears = MODELS[model].replace(backlash=40e-6)
    drive, coast = (sum(gears.static_state(NU, load)) for load in (1.0, -1.0))
    assert coast == pytest.approx(-gears.backlash_ratio - drive, rel=1e-14)


@pytest.mark.parametrize("model", ["gear pair", "six degrees"])
def test_without_load_the_flanks_just_touch(model):
    assert not any(MODELS[model].static_state(NU, 0.0))
    assert not any(MODELS[model].replace(backlash=math.inf).static_state(NU, -1.0))


@pytest.mark.parametrize("model", [name for name in MODELS if name not in NO_GEARS])
def test_a_locus_from_an_ordinary_point_is_refused_in_one_sentence(model):
    pair = MODELS[model]
    # Labels are set on points that are not special.
    branch = continue_orbit(orbit(pair), to=NU + 0.01, max_points=3)
    for label in (special_points.FOLD, special_points.DOUBLING, special_points.GRAZING):
        branch.label[0] = label
        with pytest.raises((ValueError, NoOrbit), match="point|not allowed"):
            gearlib.locus(pair, branch, 0, "backlash_ratio", to=5.0, max_points=3)
