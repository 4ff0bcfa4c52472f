"""A walk over the parameters of the public constructors and calls: just outside and just inside.

What each may be is said by `ranges.yaml`; a parameter without a row there is missed.
"""

import inspect
import math
from fractions import Fraction

import numpy as np
import pytest
import xarray as xr

import gearlib
import gearlib.geometry as drawn
from gearlib import Body, GearPair, Harmonics, LoadSharingPair
from gearlib.parameters import Number, declared_parameters
from tests.geometry.drawings import fzg_c
from tests.paper import PAPER, PARAMETERS
from tests.refusals.ranges import range_of

NU = 0.9
DAMPED = PAPER.replace(material_damping=4e3)
ORBIT = gearlib.periodic_orbit(DAMPED, NU)
FZG, GEAR = fzg_c(quality=5), {"teeth": 20, "module": 4e-3, "width": 0.02}
SUN, PLANET = (drawn.SpurGear(teeth=z, module=3e-3, width=0.025) for z in (27, 36))
RING = drawn.SpurGear(teeth=99, module=3e-3, width=0.025, internal=True, outer_diameter=0.34)
A = {"name": "a", "inertia": 0.01, "base_radius": 0.1, "teeth": 20, "mass": 1.0, "torque": 100.0}
B = {"name": "b", "inertia": 0.02, "base_radius": 0.2, "teeth": 40, "torque": 200.0}
AB = dict(pinion="a", wheel="b", max_stiffness=4e8, stiffness_ratio=0.6, contact_ratio=1.5)
TABLE = {"phase": (0.0, 1.0), "stiffness": (1.0, 2.0)}


_branch = gearlib.continue_orbit(ORBIT, to=NU + 0.01, max_points=3)
_branch.label[0] = 2  # so that a search may start here: the label of a period doubling
BRANCH = {"model": DAMPED, "branch": _branch, "point": 0}
RUN_UP = gearlib.run_up(PAPER, 1000.0, 1100.0, duration=0.2, samples_per_period=64)
JUMP = xr.Dataset({"jump_up": ((), 3300.0, {"units": "min-1", "noise_std": 1.0})})
#: Call -> valid arguments; these calls take no time and are also made just inside the ranges.
MADE = {
    GearPair: PARAMETERS,
    GearPair.from_ratios: {"contact_ratio": 1.5, "stiffness_ratio": 0.6},
    gearlib.OneDegreePair: {"pair": PAPER},
    gearlib.SixDegreePair: {
        **{"pair": PAPER, "base_radii": (0.1, 0.1), "inertias": (0.06, 0.06)},
        **{"masses": (17.0, 17.0), "bearing_stiffness": (1e8,) * 4},
    },
    gearlib.DeadZoneOscillator: {"upper_stiffness": 1.0},
    LoadSharingPair: {"pair": PAPER, "stage": FZG},
    Body: A,
    gearlib.Shaft: {"bodies": ("a", "b"), "stiffness": 1.0},
    gearlib.Mesh: AB,
    gearlib.GearTrain: {"bodies": (Body(**A), Body(**B)), "meshes": (gearlib.Mesh(**AB),)},
    Harmonics: {},
    gearlib.Fourier: {"harmonics": 3},
    gearlib.Series: {"mean": 1.0, "harmonics": Harmonics()},
    gearlib.Steps: TABLE,
    gearlib.Tabulated: TABLE,
    gearlib.planetary: {},
    gearlib.idler: {"pair": PAPER},
    gearlib.two_stage: {"pair": PAPER},
    gearlib.split_power_reducer: {"pair": PAPER},
    drawn.Material: {},
    drawn.Rack: {},
    drawn.Web: {"thickness": 0.01, "rim_diameter": 0.06, "hub_diameter": 0.04},
    drawn.TipRelief: {"amount": 1e-5, "length": 1e-3},
    drawn.PathTable: {"position": (0.0,), "value": (0.0,)},
    drawn.SpurGear: GEAR,
    drawn.GearStage: {"pinion": drawn.SpurGear(**GEAR), "wheel": drawn.SpurGear(**GEAR)},
    drawn.planetary_set: {"sun": SUN, "planet": PLANET, "ring": RING, "torque": 100.0},
    drawn.dynamic_factor: {"stage": FZG, "torque": 300.0, "rpm": 100.0},
    drawn.iso_stiffness: {"stage": FZG},
}
FOLLOWED = {"model": DAMPED, "tolerances": {"load": {"std": "1 %"}}, "n": 2, "speed": 3000.0}
#: Calls that run something, only made with wrong values.
CALLED = {
    LoadSharingPair.from_geometry: {"stage": FZG, "torque": 1.0},
    drawn.mesh_stiffness: {"stage": FZG, "method": "energy"},
    drawn.optimum_relief: {"stage": FZG, "torque": 300.0},
    drawn.GearStage.transmission_error: {"self": FZG, "torque": 300.0},
    gearlib.simulate: {"model": PAPER, "tuning": NU, "periods": 2},
    gearlib.sweep: {"model": PAPER, "tunings": [NU], "periods": 2, "record_periods": 1},
    gearlib.run_up: {"model": PAPER, "start": 1000.0, "stop": 1100.0, "duration": 0.05},
    gearlib.basins: {"model": DAMPED, "tuning": NU, "grid": ([0.0], [0.0]), "periods": 60},
    gearlib.basin_stability: {
        **{"model": DAMPED, "tunings": [NU], "region": ((-1.0, 1.0), (-1.0, 1.0))},
        **{"samples": 1, "periods": 60},
    },
    gearlib.bifurcation_diagram: {"model": PAPER, "values": [NU], "settle": 2, "strobes": 4},
    gearlib.poincare_section: {"model": PAPER, "tuning": NU, "states": [(0.0, 0.0)], "periods": 2},
    gearlib.lyapunov_exponents: {"model": PAPER, "values": [NU], "settle": 2, "periods": 20},
    gearlib.trust: {"model": PAPER, "tuning": NU, "periods": 200, "exponent_periods": 20},
    gearlib.periodic_orbit: {"model": DAMPED, "tuning": NU},
    gearlib.continue_orbit: {"orbit": ORBIT, "to": NU + 0.01, "max_points": 3},
    gearlib.sensitivities: {
        **{"call": lambda model, tuning: model.load * tuning, "model": PAPER},
        **{"parameters": ("load",), "tuning": NU},
    },
    gearlib.switch_branch: BRANCH,
    gearlib.locus: BRANCH | {"parameter": "damping", "to": 0.1},
    gearlib.tongues: {"model": PAPER, "start": 0.9, "stop": 1.1, "step": 0.05},
    gearlib.schmidt: {"model": DAMPED, "tuning": NU, "harmonics": 16},
    gearlib.duty_point: {"gears": FZG, "speed": 3000.0, "torque": 300.0, "damping_ratio": 0.05},
    gearlib.orders: {"run": gearlib.simulate(DAMPED, NU, periods=24, record_periods=24)},
    gearlib.order_map: {"run": RUN_UP},
    gearlib.harmonic_balance: {"model": DAMPED, "tuning": NU, "harmonics": 16},
    gearlib.read_measured: {"path": ""},
    gearlib.scatter: {
        **{"model": PAPER, "tolerances": {"load": {"std": "1 %"}}, "n": 2, "quantities": ()},
        **{"tunings": [NU], "periods": 2, "record_periods": 1},
    },
    gearlib.sobol_indices: FOLLOWED | {"quantities": ("force",)},
    gearlib.fit: {"model": DAMPED, "data": JUMP, "free": {"reduced_mass": (3.0, 3.2)}},
}
SIGNAL = xr.Dataset({"displacement": ("time", [0.0] * 9)}, {"time": range(9)})
#: Other ways to make some of these calls.
OTHERWISE = [
    (gearlib.simulate, {"model": PAPER, "speed": 3000.0, "periods": 2, "method": "scipy"}),
    (gearlib.sweep, {"model": PAPER, "speeds": [3000.0], "periods": 2, "record_periods": 1}),
    (
        gearlib.bifurcation_diagram,
        {"model": PAPER, "values": [0.1], "parameter": "damping", "tuning": NU, "strobes": 4},
    ),
    (
        gearlib.lyapunov_exponents,
        {"model": PAPER, "values": [0.1], "parameter": "damping", "tuning": NU, "periods": 20},
    ),
    (gearlib.tongues, {"model": PAPER, "parameter": "damping", "values": [0.1]}),
    (
        gearlib.run_up,
        {"model": PAPER, "speed": [(0.0, 10.0), (1.0, 20.0)], "driven_mass": 1.0, "base_radius": 1},
    ),
    (Harmonics.from_table, {"phase": np.arange(3) * math.tau / 3, "values": [0.0, 1.0, 2.0]}),
    (drawn.SpurGear.thickness_at, {"self": SUN}),
    (gearlib.order_map, {"run": SIGNAL, "tacho": [0.0, 8.0]}),
    (gearlib.continue_orbit, {"orbit": ORBIT, "parameter": "damping", "to": 0.1}),
    (gearlib.scatter, FOLLOWED | {"quantities": ("force",), "speeds": [3000.0]}),
]
#: What no parameter takes: other types, nested and unhashable values, tables of other contents.
TAKEN_BY_NONE = [
    *(object(), 1j, {"a": []}, [["a"]], [object()], np.array([["a"], [1]])),
    xr.Dataset({"a": ("x", [1.0])}),
]
#: Parameter -> the parameter that it replaces, which is then left out of the call.
REPLACES = {"speed": "tuning", "speeds": "tunings"}
#: Parameter -> its name in the sentence of the function that it is handed on to.
HANDED_ON = {
    "mesh_stiffness.method": "stiffness",
    "planetary_set.sun": "pinion of the sun mesh",
    "planetary_set.planet": "wheel of the sun mesh",
}
#: Parameters without a row of `ranges.yaml`: any number but one; a value counts only beside another
#: one; refused together with others, in `test_combinations.py`.
UNCHECKED = """
locus.to continue_orbit.to tongues.values
sensitivities.call sensitivities.parameters sensitivities.arguments
SpurGear.tip_diameter planetary_set.ring schmidt.degenerate dynamic_factor.rpm
lyapunov_exponents.states order_map.tacho
scatter.box scatter.progress sobol_indices.progress
run_up.speed run_up.load run_up.acceleration run_up.driver run_up.base_radius
""".split()


def owner(call):
    """Return the name of a call in `ranges.yaml`."""
    name = call.__qualname__.replace("Mesh.transmission", "transmission")
    return f"geometry.{name}" if call is drawn.GearStage else name


def parameters(calls, skipped=()):
    """Return pytest parameters (call, valid arguments, parameter) of pairs of the first two."""
    return [
        pytest.param(call, valid, parameter, id=f"{owner(call)}.{parameter.name}")
        for call, valid in calls
        for parameter in inspect.signature(call).parameters.values()
        if parameter.kind != parameter.VAR_KEYWORD and parameter.name != "self"
        and f"{owner(call)}.{parameter.name}" not in skipped
    ]  # fmt: skip


def wrong_values(parameter, allowed):
    """Yield (value, part of it that the sentence shows, range of that part) for a parameter."""
    if parameter.default is parameter.empty:
        yield None, None, allowed
    # The count of a list is None for any number of entries; 0 is no list.
    count = allowed.count
    if count != 0:
        valid = allowed.entry.inside()[0]
        if count:
            yield from ((value, value, allowed) for value in (7, (valid,) * (count + 1)))
        if allowed.entry.numeric:
            for value in ("fast", *allowed.entry.outside()):
                yield (valid,) * ((count or 1) - 1) + (value,), value, allowed.entry
    elif allowed.numeric:
        yield from ((value, value, allowed) for value in ("fast", True, *allowed.outside()))
    else:
        texts = [] if allowed.words in ("a text", "a sequence") else ["wrong"]
        yield from ((value, value, allowed) for value in (*texts, 7))


def required_words(allowed):
    """Return the words of a range that its sentence has: the length of a list, or the bounds."""
    if allowed.count:
        return str(allowed.count)
    words = allowed.words.removeprefix("a finite number ")
    words = words.removeprefix("a number ").split(" or infinity")[0]
    return {"a finite number": "finite"}.get(words, words if allowed.count == 0 else "")


def refusal_of(call, valid, name, value):
    """Return the text of the ValueError for a value of a parameter."""
    others = {other: argument for other, argument in valid.items() if other != REPLACES.get(name)}
    with pytest.raises(ValueError) as refusal:
        call(**others | {name: value})
    return str(refusal.value)


WALK = [*MADE.items(), *CALLED.items()]


@pytest.mark.parametrize(("call", "valid", "parameter"), parameters(WALK + OTHERWISE))
def test_what_no_parameter_takes_is_refused_by_its_name(call, valid, parameter):
    key = f"{owner(call)}.{parameter.name}"
    for value in TAKEN_BY_NONE:
        text = refusal_of(call, valid, parameter.name, value)
        # Options are named by their keys, such as that of {"a": []}.
        is_named = HANDED_ON.get(key, parameter.name) in text or text.startswith("a ")
        assert is_named and "not allowed" in text, text


@pytest.mark.parametrize(("call", "valid", "parameter"), parameters(WALK, UNCHECKED))
def test_each_wrong_value_is_refused_in_one_sentence(call, valid, parameter):
    key = f"{owner(call)}.{parameter.name}"
    row = range_of("library", key.split("."))
    assert row, "no row of ranges.yaml"
    for value, shown, allowed in wrong_values(parameter, row):
        text = refusal_of(call, valid, parameter.name, value)
        begin, _, end = text.partition(" is not allowed: it must be ")
        assert begin.startswith(HANDED_ON.get(key, parameter.name)), text
        assert repr(shown) in begin or type(shown).__name__ in begin, text
        assert required_words(allowed) in end, (text, allowed.words)
        assert "\n" not in text and ". " not in text and len(text) < 500


@pytest.mark.parametrize(("call", "valid", "parameter"), parameters(MADE.items(), UNCHECKED))
def test_values_just_inside_are_not_refused_for_their_range(call, valid, parameter):
    allowed = range_of("library", [owner(call), parameter.name])
    entry, words = allowed.entry, required_words(allowed.entry)
    for value in entry.inside() if entry.numeric else ():
        argument = value if allowed.count == 0 else (value,) * (allowed.count or 1)
        try:
            call(**valid | {parameter.name: argument})
        except ValueError as refusal:
            # Another sentence may say that the value does not go with the other arguments.
            assert not words or not str(refusal).endswith(words), str(refusal)


def test_every_public_call_is_walked():
    public = {getattr(gearlib, name) for name in gearlib.__all__ if not name.startswith("certify")}
    public |= {getattr(drawn, name) for name in drawn.__all__ if name != "RACKS"}
    # Functions return the three results; `Rectangular()` and `methods()` have no parameters.
    results = {drawn.DynamicFactor, drawn.IsoStiffness, drawn.MeshStiffness}
    assert public - results - {gearlib.methods, gearlib.Rectangular} <= {*MADE, *CALLED}


def test_declared_units_are_those_of_the_table():
    declared = [
        (owner(call), name, parameter.unit or "1")
        for call in (*MADE, *CALLED)
        for name, parameter in declared_parameters(call).items()
        if isinstance(innermost(parameter.kind), Number)
    ]
    assert len(declared) > 100
    for call_name, name, unit in declared:
        row = range_of("units", [call_name, name])
        assert row and unit == row.words, (call_name, name)
    with pytest.raises(TypeError, match="unit"):
        Number(gt=0)  # type: ignore[call-arg]


def innermost(kind):
    """Return the kind of the values of a list, of a list of lists."""
    return innermost(kind.item) if hasattr(kind, "item") else kind


@pytest.mark.parametrize("kind", [drawn.Material, drawn.Rack, drawn.SpurGear, drawn.Web])
def test_parts_of_a_drawing_take_their_values_by_name(kind):
    with pytest.raises(TypeError, match="positional"):
        kind(0.01, 0.06, 0.04)


@pytest.mark.parametrize("number", [np.float32, Fraction])
def test_numbers_of_other_types_are_numbers(number):
    options = {"parameter": "damping", "settle": 2, "strobes": 4}
    diagram = gearlib.bifurcation_diagram(PAPER, [0.1], tuning=number(0.5), **options)
    assert diagram.identical(gearlib.bifurcation_diagram(PAPER, [0.1], tuning=0.5, **options))
