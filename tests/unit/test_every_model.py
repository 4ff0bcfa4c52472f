"""Every public call with every model: it works, or says in one sentence why it does not."""

import math
import re
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import pytest

import gearlib
from gearlib import (
    DeadZoneOscillator,
    GearPair,
    Harmonics,
    LoadSharingPair,
    OneDegreePair,
    basin_stability,
    basins,
    bifurcation_diagram,
    continue_orbit,
    harmonic_balance,
    locus,
    lyapunov_exponents,
    periodic_orbit,
    planetary,
    poincare_section,
    schmidt,
    sensitivities,
    simulate,
    sweep,
    switch_branch,
    tongues,
    trust,
)
from gearlib.analysis.orbits.followed_parameters import (
    followed_parameters,
    value_of,
    with_parameter,
)
from gearlib.data.files import canonical_json
from gearlib.data.variables import DESCRIPTIONS
from gearlib.models.from_values import model_from_json
from gearlib.models.model import Model
from gearlib.models.one_degree import Equation
from gearlib.models.profiles import Steps
from tests.geometry.drawings import fzg_c
from tests.paper import PAPER
from tests.properties.known_models import gears


@dataclass(frozen=True, kw_only=True)
class Stop(Model):
    """A model that the library does not know: a driven mass that meets a stop at x = 0."""

    stiffness: float
    hardening: float = 0.0

    title_noun = "a mass at a stop"

    @cached_property
    def equation(self):
        side, damping = Steps((0.0,), (self.stiffness,)).pieces(), np.zeros((3, 3))
        damping[:, 0] = 0.1
        return Equation(
            upper=0.0,
            lower=-math.inf,
            drive_stiffness=side,
            coast_stiffness=side,
            damping=damping,
            stiffness_powers=np.array([0.0, self.hardening]),
            ground_stiffness=0.0,
            load=1.0,
            force=Harmonics((0.5,)).table(),
            deviation=Harmonics().table(),
            natural_frequency=math.sqrt(self.stiffness),
        )


NU, BOX = 0.9, (-1.0, 1.0)
DAMPED = PAPER.replace(material_damping=3953.7, backlash_damping=3953.7)
#: Rigid bearings: two coordinates without the free rotation, of which trapping ellipses are found
#: soon.
RIGID = gears(math.inf, 3953.7, 3953.7)
MODELS = {
    "gear pair": DAMPED,
    "one degree": OneDegreePair(pair=DAMPED, backlash_cubic_damping=4e5),
    "pairs of teeth": LoadSharingPair.from_geometry(fzg_c(), torque=300.0, damping_ratio=0.05),
    "six degrees": RIGID,
    "run-out": RIGID.replace(eccentricities=(1e-6, 1e-6), teeth=(3, 2)),
    "train": planetary(stiffness_ratio=(0.8, 0.8)),
    "oscillator": DeadZoneOscillator(
        lower_edge=-4.0,
        upper_stiffness=1.0,
        damping=0.1,
        load=1.0,
        forcing=Harmonics((0.5,)),
    ),
    "linear stop": Stop(stiffness=1.0),
    "hard stop": Stop(stiffness=1.0, hardening=0.2),
    "number": 7,
}


def orbit(pair):
    return periodic_orbit(pair, NU, period=1 if pair == 7 else pair.repeats)


def branch_and_point():
    """Return the branch of a gear pair, its first point called a doubling."""
    branch = continue_orbit(orbit(DAMPED), to=NU + 0.01, max_points=3)
    branch.label[0] = 2
    return branch, 0


def turns(pair):
    """Return a run-up of more than a revolution."""
    return gearlib.run_up(pair, 2000.0, 2500.0, duration=0.1, samples_per_period=128)


def scattered(pair):
    """Scatter the load of a model, or its stiffness."""
    name = "load" if hasattr(pair, "load") else "stiffness"
    runs = {"tunings": [NU], "periods": 2, "record_periods": 1, "quantities": ()}
    return gearlib.scatter(pair, {name: {"upper": "1 %", "lower": "-1 %"}}, n=2, **runs)


def at_duty_point(call, *arguments, **options):
    """Return a call of what follows the force at a duty point, while one number scatters."""

    def of(pair):
        name = "load" if hasattr(pair, "load") else "stiffness"
        limits = {name: {"upper": "1 %", "lower": "-1 %"}}
        return call(pair, limits, *arguments, n=2, speed=3000.0, **options)

    return of


def end(model, tuning):
    """Return the final state of two mesh periods."""
    return simulate(model, tuning, periods=2).final_state


CALLS = {
    "scatter": scattered,
    "sobol_indices": at_duty_point(gearlib.sobol_indices, ("force",)),
    "simulate": lambda pair: simulate(pair, NU, periods=2),
    "sweep": lambda pair: sweep(pair, [NU], periods=2, record_periods=1, direction="up"),
    "basins": lambda pair: basins(pair, NU, ([0.0], [0.0]), periods=60),
    "basin_stability": lambda pair: basin_stability(pair, [NU], (BOX, BOX), samples=1, periods=60),
    "bifurcation_diagram": lambda pair: bifurcation_diagram(pair, [NU], settle=2, strobes=4),
    "poincare_section": lambda pair: poincare_section(pair, NU, [(0.0, 0.0)], periods=2),
    "lyapunov_exponents": lambda pair: lyapunov_exponents(pair, [NU], settle=2, periods=20),
    "run_up": lambda pair: gearlib.run_up(pair, 2000.0, 2500.0, duration=0.05),
    "duty_point": lambda pair: gearlib.duty_point(pair, 3000.0),
    # Of whole revolutions of all.
    "orders": lambda pair: gearlib.orders(
        simulate(pair, NU, periods=432, record_periods=432, samples_per_period=64), count=1
    ),
    "order_map": lambda pair: gearlib.order_map(turns(pair)),
    "trust": lambda pair: trust(pair, NU, periods=200, exponent_periods=20),
    "periodic_orbit": lambda pair: orbit(pair).dataset(),
    "sensitivities": lambda pair: sensitivities(end, pair, "tuning", tuning=NU),
    "continue_orbit": lambda pair: continue_orbit(orbit(pair), to=NU + 0.01, max_points=3),
    "switch_branch": lambda pair: switch_branch(pair, *branch_and_point()),
    "locus": lambda pair: locus(pair, *branch_and_point(), "damping", to=0.1),
    "tongues": lambda pair: tongues(pair, start=0.9, stop=1.1, step=0.05),
    "schmidt": lambda pair: schmidt(pair, NU, harmonics=16, max_iterations=20).dataset(),
    "harmonic_balance": lambda pair: harmonic_balance(pair, NU, harmonics=16).dataset(),
}
#: What a call does not take beside the number; one branch serves those of one kind only.
NO_GEARS = {"oscillator", "linear stop", "hard stop"}
REFUSED = {
    "basins": {"train"},
    "basin_stability": {"train"},
    "bifurcation_diagram": {"train"},
    "poincare_section": {"train"},
    "continue_orbit": NO_GEARS,
    "tongues": {"pairs of teeth", *NO_GEARS},
    "schmidt": {"pairs of teeth", "six degrees", "run-out", "train", *NO_GEARS},
    "duty_point": NO_GEARS,
    "sobol_indices": NO_GEARS,
    **dict.fromkeys(("run_up", "order_map"), NO_GEARS | {"pairs of teeth", "one degree"}),
    "orders": NO_GEARS,
    "harmonic_balance": {"pairs of teeth", "six degrees", "run-out", "train", *NO_GEARS},
}
BRANCHES = {"switch_branch", "locus"}
#: Words of a gear mesh, which an oscillator has not.
MESH = re.compile("mesh|static deflection|flank|dtau")


def test_no_public_call_is_left_out():
    models = {"DeadZoneOscillator", "GearPair", "OneDegreePair", "SixDegreePair", "GearTrain"}
    models |= {"LoadSharingPair"}
    models |= {"planetary", "idler", "two_stage", "split_power_reducer"}
    parts = {"Fourier", "Harmonics", "Rectangular", "Series", "Steps", "Tabulated"} | {
        "Body",
        "Mesh",
        "Shaft",
    }
    # Of proofs tests/proofs knows which models they take.
    proofs = {name for name in gearlib.__all__ if name.startswith("certify")}
    assert set(CALLS) == set(gearlib.__all__) - models - parts - proofs - {
        "fit",
        "methods",
        "read_measured",
    }


@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize("call", [name for name in CALLS if name not in BRANCHES])
def test_it_works_or_says_why_not(call, model):
    pair = MODELS[model]
    if model == "number" or model in REFUSED.get(call, ()):
        with pytest.raises(ValueError, match="not allowed") as error:
            CALLS[call](pair)
        message = str(error.value)
        named = type(pair).__name__, repr(pair), getattr(pair, "title_noun", repr(pair))
        assert any(name in message for name in named)
        assert "\n" not in message and ". " not in message
        return
    found = CALLS[call](pair)
    dataset = getattr(found, "runs", found)
    if model == "oscillator":
        texts = [dataset.attrs.get("title", "")]
        texts += [str(one.attrs.get("long_name")) for one in dataset.variables.values()]
        assert not [text for text in texts if MESH.search(text)]


@pytest.mark.parametrize("name", [name for name in MODELS if name != "number"])
def test_a_model_has_what_the_protocol_says(name):
    model = MODELS[name]
    assert isinstance(model, Model)
    assert model.size >= 2 and model.size % 2 == 0 and model.repeats >= 1
    assert model.mesh is None or model.mesh.mesh is model.mesh and type(model.mesh) is GearPair
    assert (model.equation is None) == (model.size > 2 or name == "pairs of teeth")
    assert not np.any(model.flank_lines[0])
    assert model.damped() is True
    assert canonical_json(model.as_dict()) and model.replace() == model
    named = [*model.scales(), *model.speed_scales(NU), *model.extra_samples, *model.long_names]
    assert set(named) <= set(DESCRIPTIONS)
    for parameter in followed_parameters(model) if model.mesh or model.mesh_names else ():
        # The parameters of a train are those that all its meshes share.
        if model.mesh_names and len({getattr(mesh, parameter, 0) for mesh in model.meshes}) > 1:
            continue
        value = value_of(model, NU, parameter)
        moved, tuning = with_parameter(model, NU, parameter, 0.9 * value + 0.01)
        assert value_of(moved, tuning, parameter) == pytest.approx(0.9 * value + 0.01, rel=1e-12)
        if parameter == "backlash":
            tight, tuning = with_parameter(model, NU, parameter, 0.0)
            assert value_of(tight, tuning, parameter) == 0.0


@pytest.mark.parametrize("name", [name for name in MODELS if name != "number"])
def test_all_ways_through_the_periods_are_one(name):
    # A run, the maps, a record and many states at once go by the same propagator.
    model, periods = MODELS[name], 6
    n = model.size
    asked = simulate(model, NU, periods=periods, record_periods=periods, samples_per_period=4)
    for method in model.propagators:
        propagator = model.propagator(NU, method)
        start = propagator.start((0.0, 0.0))
        assert start.shape == (n,)
        end, maps, code = propagator.maps(start, periods, 1000)
        assert (end.shape, maps.shape, code) == ((n,), (periods, n, n), 0)
        record = propagator.record(start, periods, 1000, 4)
        events, summary, samples = record.events, record.summary, record.samples
        assert (start == propagator.start((0.0, 0.0))).all()
        room = model.empty_record(4 * periods)
        assert (summary.shape, samples.shape) == (room[2].shape, room[0].shape)
        ends, codes = propagator.many(np.array([start, start]), periods, 1000)
        # Rounding, over a few bounces.
        close = {"rtol": 0, "atol": 1e-11 * max(1.0, np.abs(end).max())}
        np.testing.assert_allclose(ends, [end, end], **close)
        first = asked.displacement if not model.mesh_names else asked.displacement[:, 0]
        np.testing.assert_allclose(samples[:, 0], first, **close)
        assert not codes.any()
        # What the run says of its own method is what the propagator did, to the last bit.
        if method == next(iter(model.propagators)):
            np.testing.assert_array_equal(samples[:, 0], first)
            np.testing.assert_array_equal(len(events), asked.sizes["event"])
            np.testing.assert_array_equal(maps, model.propagator(NU).maps(start, periods, 1000)[1])
        other = model.propagator(NU).maps(start, periods, 1000)[1]
        np.testing.assert_allclose(maps, other, rtol=0, atol=1e-11 * np.abs(other).max())


def test_a_new_model_moves_as_its_equation_says():
    # The same oscillator in the parameters of a model of the library.
    twin = DeadZoneOscillator(upper_stiffness=1.0, damping=0.1, load=1.0, forcing=Harmonics((0.5,)))
    new = MODELS["linear stop"]
    assert new.propagators == {"exact": "linear.one_mesh", "taylor": "taylor.propagator"}
    assert MODELS["hard stop"].propagators == {"taylor": "taylor.propagator"}
    one, other = (sweep(model, [0.5, NU], periods=50, record_periods=8) for model in (new, twin))
    for variable in one.data_vars:
        np.testing.assert_array_equal(one[variable], other[variable])
    assert "a mass at a stop" in one.attrs["title"]
    orbits = [periodic_orbit(model, NU) for model in (new, twin)]
    np.testing.assert_array_equal(orbits[0].multipliers, orbits[1].multipliers)
    with pytest.raises(ValueError, match="method = 'rk4' is not allowed for this Stop"):
        simulate(new, NU, periods=1, method="rk4")


@pytest.mark.parametrize("name", ["gear pair", "one degree", "six degrees", "run-out", "train"])
def test_a_dataset_tells_its_model(name):
    model = MODELS[name]
    assert model_from_json(canonical_json(model.as_dict())) == model
    assert model_from_json(canonical_json({"load": 1.0})) is None
