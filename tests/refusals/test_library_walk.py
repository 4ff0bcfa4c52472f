"""A walk over the parameters of public classes and functions: just outside and just inside.

What a declared parameter may be is said by its annotation. Of the others, values that no parameter
takes are refused.
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
from gearlib.parameters import MISSING, declared_parameters, dotted
from tests.geometry.drawings import fzg_c
from tests.paper import PAPER, PARAMETERS
from tests.refusals.declared import inside, is_number, outside, wrong

DAMPED, FZG = PAPER.replace(material_damping=4e3), fzg_c(quality=5)
ORBIT = gearlib.periodic_orbit(DAMPED, 0.9)
SUN, PLANET = (drawn.SpurGear(teeth=z, module=3e-3, width=0.025) for z in (27, 36))
RING = drawn.SpurGear(teeth=99, module=3e-3, width=0.025, internal=True, outer_diameter=0.34)
A = dict(name="a", inertia=0.01, base_radius=0.1, teeth=20, mass=1.0, torque=100.0)
B = dict(name="b", inertia=0.02, base_radius=0.2, teeth=40, torque=200.0)
AB = dict(pinion="a", wheel="b", max_stiffness=4e8, stiffness_ratio=0.6, contact_ratio=1.5)
GEAR, TABLE = dict(teeth=20, module=4e-3, width=0.02), dict(phase=(0, 1), stiffness=(1, 2))
BODIES = dict(base_radii=(0.1, 0.1), inertias=(0.06, 0.06), masses=(17, 17))
BRANCH = gearlib.continue_orbit(ORBIT, to=0.91, max_points=3)
BRANCH.label[0] = 2  # so that a search may start here: the label of a period doubling
POINT, SPREAD = dict(model=DAMPED, branch=BRANCH, point=0), {"load": {"std": "1 %"}}
RUN_UP = gearlib.run_up(PAPER, 1000.0, 1100.0, duration=0.2, samples_per_period=64)
JUMP = xr.Dataset({"jump_up": ((), 3300.0, {"units": "min-1", "noise_std": 1.0})})
#: Call -> valid arguments; these calls take no time and are also made just inside the ranges.
MADE = {
    GearPair: PARAMETERS,
    GearPair.from_ratios: dict(contact_ratio=1.5, stiffness_ratio=0.6),
    gearlib.OneDegreePair: dict(pair=PAPER),
    gearlib.SixDegreePair: dict(pair=PAPER, bearing_stiffness=(1e8,) * 4, **BODIES),
    gearlib.DeadZoneOscillator: dict(upper_stiffness=1.0),
    LoadSharingPair: dict(pair=PAPER, stage=FZG),
    Body: A,
    gearlib.Shaft: dict(bodies=("a", "b"), stiffness=1.0),
    gearlib.Mesh: AB,
    gearlib.GearTrain: dict(bodies=(Body(**A), Body(**B)), meshes=(gearlib.Mesh(**AB),)),
    Harmonics: {},
    gearlib.Rectangular: {},
    gearlib.Fourier: dict(harmonics=3),
    gearlib.Series: dict(mean=1.0, harmonics=Harmonics()),
    gearlib.Steps: TABLE,
    gearlib.Tabulated: TABLE,
    gearlib.planetary: {},
    gearlib.idler: dict(pair=PAPER),
    gearlib.two_stage: dict(pair=PAPER),
    gearlib.split_power_reducer: dict(pair=PAPER),
    drawn.Material: {},
    drawn.Rack: {},
    drawn.Web: dict(thickness=0.01, rim_diameter=0.06, hub_diameter=0.04),
    drawn.TipRelief: dict(amount=1e-5, length=1e-3),
    drawn.PathTable: dict(position=(0.0,), value=(0.0,)),
    drawn.SpurGear: GEAR,
    drawn.SpurGear.thickness_at: dict(self=SUN, diameter=0.1),
    drawn.GearStage: dict(pinion=drawn.SpurGear(**GEAR), wheel=drawn.SpurGear(**GEAR)),
    drawn.planetary_set: dict(sun=SUN, planet=PLANET, ring=RING, torque=100.0),
    drawn.dynamic_factor: dict(stage=FZG, torque=300.0, rpm=100.0),
    drawn.iso_stiffness: dict(stage=FZG),
}
#: Calls that run something, only made with wrong values.
CALLED = {
    Harmonics.from_table: dict(phase=np.arange(3) * math.tau / 3, values=[0, 1, 2]),
    LoadSharingPair.from_geometry: dict(stage=FZG, torque=1.0),
    drawn.mesh_stiffness: dict(stage=FZG, method="energy"),
    drawn.optimum_relief: dict(stage=FZG, torque=300.0),
    drawn.GearStage.transmission_error: dict(self=FZG, torque=300.0),
    gearlib.simulate: dict(model=PAPER, tuning=0.9, periods=2),
    gearlib.sweep: dict(model=PAPER, tunings=[0.9], periods=2, record_periods=1),
    gearlib.run_up: dict(model=PAPER, start=1000.0, stop=1100.0, duration=0.05),
    gearlib.basins: dict(model=DAMPED, tuning=0.9, grid=([0], [0])),
    gearlib.basin_stability: dict(model=DAMPED, tunings=[0.9], region=((-1, 1), (-1, 1))),
    gearlib.bifurcation_diagram: dict(model=PAPER, values=[0.9], settle=2, strobes=4),
    gearlib.poincare_section: dict(model=PAPER, tuning=0.9, states=[(0, 0)], periods=2),
    gearlib.lyapunov_exponents: dict(model=PAPER, values=[0.9], settle=2, periods=20),
    gearlib.trust: dict(model=PAPER, tuning=0.9),
    gearlib.periodic_orbit: dict(model=DAMPED, tuning=0.9),
    gearlib.continue_orbit: dict(orbit=ORBIT, to=0.91, max_points=3),
    gearlib.certify: dict(orbit=ORBIT),
    gearlib.certify_range: dict(orbit=ORBIT, to=0.91),
    gearlib.sensitivities: dict(call=lambda x: x.load, model=PAPER, parameters=("load",)),
    gearlib.switch_branch: POINT,
    gearlib.locus: POINT | dict(parameter="damping", to=0.1),
    gearlib.tongues: dict(model=PAPER, start=0.9, stop=1.1, step=0.05),
    gearlib.schmidt: dict(model=DAMPED, tuning=0.9, harmonics=16),
    gearlib.duty_point: dict(gears=FZG, speed=3000.0, torque=300.0, damping_ratio=0.05),
    gearlib.orders: dict(run=gearlib.simulate(DAMPED, 0.9, periods=24, record_periods=24)),
    gearlib.order_map: dict(run=RUN_UP),
    gearlib.harmonic_balance: dict(model=DAMPED, tuning=0.9, harmonics=16),
    gearlib.read_measured: dict(path=""),
    gearlib.scatter: dict(model=PAPER, tolerances=SPREAD, quantities=(), tunings=[0.9], n=2),
    gearlib.sobol_indices: dict(model=DAMPED, tolerances=SPREAD, quantities=("force",), n=2, speed=3e3),
    gearlib.fit: dict(model=DAMPED, data=JUMP, free={"reduced_mass": (3.0, 3.2)}),
}
#: Other ways to make some of these calls.
OTHERWISE = [
    (gearlib.simulate, dict(model=PAPER, speed=3000.0, periods=2, method="scipy")),
    (gearlib.sweep, dict(model=PAPER, speeds=[3000.0], periods=2, record_periods=1)),
    (gearlib.run_up, dict(model=PAPER, speed=[(0, 10), (1, 20)], driven_mass=1, base_radius=1)),
    (gearlib.tongues, dict(model=PAPER, parameter="damping", values=[0.1])),
]
#: What no parameter takes: other types, nested and unhashable values, tables of other contents.
TAKEN_BY_NONE = [object(), 1j, {"a": []}, [["a"]], np.array([["a"], [1]]), xr.Dataset({"a": 1})]
#: Parameter -> the parameter that it replaces, which is then left out of the call.
REPLACES = {"speed": "tuning", "speeds": "tunings"}
#: Parameter -> its name in the sentence of the function that it is handed on to.
HANDED_ON = {"mesh_stiffness.method": "stiffness"}


def all_parameters(calls):
    """Return pytest parameters (call, valid arguments, name of a parameter)."""
    return [
        pytest.param(call, arguments, name, id=f"{call.__qualname__}.{name}")
        for call, arguments in calls
        for name, x in inspect.signature(call).parameters.items()
        if x.kind != x.VAR_KEYWORD and name != "self"
    ]


def declared(calls):
    """Return pytest parameters (call, valid arguments, name, `Parameter`) of declared parameters."""
    return [
        pytest.param(call, arguments, name, parameter, id=f"{call.__qualname__}.{name}")
        for call, arguments in calls
        for name, parameter in declared_parameters(call).items()
    ]


def refusal_of(call, arguments, name, value):
    """Return the text of the ValueError for a value of a parameter."""
    others = {other: x for other, x in arguments.items() if other != REPLACES.get(name)}
    with pytest.raises(ValueError) as refusal:
        call(**others | {name: value})
    return str(refusal.value)


@pytest.mark.parametrize(("call", "arguments", "name"), all_parameters([*MADE.items(), *CALLED.items(), *OTHERWISE]))
def test_what_no_parameter_takes_is_refused_by_its_name(call, arguments, name):
    for value in TAKEN_BY_NONE:
        text = refusal_of(call, arguments, name, value)
        # Options are named by their keys, such as that of {"a": []}.
        is_named = HANDED_ON.get(f"{call.__name__}.{name}", name) in text or text.startswith("a ")
        assert is_named and "not allowed" in text, text


@pytest.mark.parametrize(("call", "arguments", "name", "parameter"), declared([*MADE.items(), *CALLED.items()]))
def test_each_wrong_value_is_refused_in_one_sentence(call, arguments, name, parameter):
    required = [(None, (), parameter.allowed)] * (parameter.default is MISSING)
    for value, path, words in [*required, *wrong(parameter.annotation)]:
        text, shown = refusal_of(call, arguments, name, value), value
        for index in path:
            shown = shown[index]
        begin, _, end = text.partition(" is not allowed: it must be ")
        place = dotted((name, *path))
        assert begin.startswith(place) and begin.endswith(f" = {shown!r}"), text
        assert end.startswith(words), (text, words)
        assert "\n" not in text and len(text) < 500


@pytest.mark.parametrize(("call", "arguments", "name", "parameter"), declared(MADE.items()))
def test_values_just_inside_are_not_refused_for_their_range(call, arguments, name, parameter):
    for value in inside(parameter.allowed) if is_number(parameter.annotation) else ():
        try:
            call(**arguments | {name: value})
        except ValueError as refusal:
            # Another sentence may say that the value does not go with the other arguments.
            assert not str(refusal).endswith(parameter.allowed), str(refusal)


def test_every_public_call_is_walked():
    public = {getattr(gearlib, name) for name in gearlib.__all__}
    public |= {getattr(drawn, name) for name in drawn.__all__ if name != "RACKS"}
    results = {drawn.DynamicFactor, drawn.IsoStiffness, drawn.MeshStiffness, gearlib.methods}
    assert public - results <= {*MADE, *CALLED}


@pytest.mark.parametrize("kind", [drawn.Material, drawn.Rack, drawn.SpurGear, drawn.Web])
def test_parts_of_a_drawing_take_their_values_by_name(kind):
    with pytest.raises(TypeError):
        kind(0.01, 0.06, 0.04)


@pytest.mark.parametrize("number", [np.float32, Fraction])
def test_numbers_of_other_types_are_numbers(number):
    options = {"parameter": "damping", "settle": 2, "strobes": 4}
    diagram = gearlib.bifurcation_diagram(PAPER, [0.1], tuning=number(0.5), **options)
    assert diagram.identical(gearlib.bifurcation_diagram(PAPER, [0.1], tuning=0.5, **options))
