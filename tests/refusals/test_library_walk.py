"""A walk over the parameters of public classes and functions: just outside and just inside.

What a declared parameter may be is said by its annotation; values that no parameter takes are
refused by all.
"""

import inspect
import math
from fractions import Fraction

import numpy as np
import pytest
import xarray as xr

import gearlib
import gearlib.geometry as drawn
from gearlib.parameters import MISSING, declared_parameters, dotted, parts
from tests.geometry.drawings import fzg_c
from tests.paper import PAPER, PARAMETERS
from tests.refusals.declared import numbers, wrong

DAMPED, STAGE = PAPER.replace(material_damping=4e3), fzg_c(quality=5)
ORBIT = gearlib.periodic_orbit(DAMPED, 0.9)
BRANCH = gearlib.continue_orbit(ORBIT, to=0.91, max_points=3)
BRANCH.label[0] = 2  # so that a search may start here: the label of a period doubling
RECORD = gearlib.simulate(DAMPED, 0.9, periods=24, record_periods=24)
JUMP = xr.Dataset({"jump_up": ((), 3300.0, {"units": "min-1", "noise_std": 1.0})})
BODIES = [gearlib.Body(name=x, inertia=1, base_radius=0.1, teeth=20, torque=1) for x in "ab"]
MESH = gearlib.Mesh(pinion="a", wheel="b", max_stiffness=1, stiffness_ratio=0.6, contact_ratio=1.5)
GEAR = drawn.SpurGear(teeth=20, module=4e-3, width=0.02)
SUN, PLANET = (drawn.SpurGear(teeth=z, module=3e-3, width=0.025) for z in (27, 36))
RING = drawn.SpurGear(teeth=99, module=3e-3, width=0.025, internal=True, outer_diameter=0.34)
#: Name of a parameter, or of its owner and of it -> a value that is taken.
VALUES = PARAMETERS | dict(pair=PAPER, model=DAMPED, stage=STAGE, gears=STAGE, self=STAGE)
VALUES |= dict(orbit=ORBIT, branch=BRANCH, point=0, run=RECORD, data=JUMP, sun=SUN, planet=PLANET)
VALUES |= dict(ring=RING, tuning=0.9, tunings=[0.9], speed=3e3, periods=60, record_periods=1)
VALUES |= dict(start=1e3, stop=1.1e3, duration=0.05, grid=([0], [0]), region=((-1, 1), (-1, 1)))
VALUES |= dict(values=[0.9], states=[(0, 0)], to=0.91, parameter="damping", path="", torque=300.0)
VALUES |= dict(call=lambda model: model.load, parameters=("load",), n=2, quantities=("force",))
VALUES |= dict(tolerances={"load": {"std": "1 %"}}, free={"reduced_mass": (3, 3.2)}, rpm=100.0)
VALUES |= dict(base_radii=(0.1, 0.1), inertias=(1, 1), masses=(9, 9), bearing_stiffness=(1e8,) * 4)
VALUES |= dict(upper_stiffness=1, name="a", inertia=1, base_radius=0.1, teeth=20, bodies=("a", "b"))
VALUES |= dict(stiffness=(1, 2), phase=(0, 1), harmonics=3, mean=1, thickness=0.01, amount=1e-5)
VALUES |= dict(rim_diameter=0.06, hub_diameter=0.04, length=1e-3, position=(0,), value=(0,))
VALUES |= dict(module=4e-3, width=0.02, pinion="a", wheel="b", diameter=0.1, method="energy")
VALUES |= {"GearStage.pinion": GEAR, "GearStage.wheel": GEAR, "Shaft.stiffness": 1.0}
VALUES |= {"GearTrain.bodies": BODIES, "GearTrain.meshes": [MESH], "locus.to": 0.1}
VALUES |= {"thickness_at.self": GEAR, "Series.harmonics": gearlib.Harmonics()}
VALUES |= {"from_table.phase": np.arange(3) * math.tau / 3, "from_table.values": (0, 1, 2)}
#: Parameters that are given although they have a default.
GIVEN = """simulate.tuning sweep.tunings scatter.tunings scatter.n sobol_indices.n sobol_indices.speed
sobol_indices.quantities run_up.start run_up.stop run_up.duration mesh_stiffness.method
duty_point.torque""".split()
#: Further arguments of functions that hand them on.
FURTHER = {"from_geometry": {"torque": 1.0}, "duty_point": {"damping_ratio": 0.1}}
#: What no parameter takes: other types, nested and unhashable values, tables of other contents.
TAKEN_BY_NONE = [object(), 1j, {"a": []}, [["a"]], np.array([["a"], [1]]), xr.Dataset({"a": 1})]
#: Results of functions.
RESULTS = {drawn.DynamicFactor, drawn.IsoStiffness, drawn.MeshStiffness}
CALLS = {getattr(module, x) for module in (gearlib, drawn) for x in module.__all__ if x != "RACKS"}
CALLS |= {gearlib.GearPair.from_ratios, gearlib.Harmonics.from_table, drawn.SpurGear.thickness_at}
CALLS |= {gearlib.LoadSharingPair.from_geometry, drawn.GearStage.transmission_error}
PARAMETERS_OF_CALLS = [
    pytest.param(call, name, id=f"{call.__qualname__}.{name}")
    for call in sorted(CALLS - RESULTS, key=lambda call: call.__qualname__)
    for name, parameter in inspect.signature(call).parameters.items()
    if parameter.kind != parameter.VAR_KEYWORD and name != "self"
]


def make(call, name, value):
    """Make a call with a value of a parameter, and the values that the call needs beside it."""
    arguments = FURTHER.get(call.__name__, {})
    for other, parameter in inspect.signature(call).parameters.items():
        key = f"{call.__name__}.{other}"
        needed = parameter.default is parameter.empty and parameter.kind != parameter.VAR_KEYWORD
        if (needed or key in GIVEN) and {"speed": "tuning", "speeds": "tunings"}.get(name) != other:
            arguments = arguments | {other: VALUES.get(key, VALUES.get(other))}
    return call(**arguments | {name: value})


def refusal_of(call, name, value):
    """Return the text of the ValueError for a value of a parameter."""
    with pytest.raises(ValueError) as refusal:
        make(call, name, value)
    return str(refusal.value)


@pytest.mark.parametrize(("call", "name"), PARAMETERS_OF_CALLS)
def test_what_no_parameter_takes_is_refused_by_its_name(call, name):
    for value in TAKEN_BY_NONE:
        text = refusal_of(call, name, value)
        # Options are named by their keys, such as that of {"a": []}; a method is handed on.
        is_named = name in text or text.startswith("a ") or "stiffness" in text
        assert is_named and "not allowed" in text, text


@pytest.mark.parametrize(("call", "name"), PARAMETERS_OF_CALLS)
def test_each_wrong_value_is_refused_in_one_sentence(call, name):
    if (parameter := declared_parameters(call).get(name)) is None:
        return
    required = [(None, (), parameter.allowed)] * (parameter.default is MISSING)
    for value, path, words in [*required, *wrong(parameter.annotation)]:
        text, shown = refusal_of(call, name, value), value
        for index in path:
            shown = shown[index]
        begin, _, end = text.partition(" is not allowed: it must be ")
        assert begin.startswith(dotted((name, *path))) and begin.endswith(f" = {shown!r}"), text
        assert end.startswith(words) and "\n" not in end and len(end) < 500, (text, words)


@pytest.mark.parametrize(("call", "name"), PARAMETERS_OF_CALLS)
def test_values_just_inside_are_not_refused_for_their_range(call, name):
    parameter = declared_parameters(call).get(name)
    for value in (
        numbers(parameter.allowed)[1]
        if parameter and parts(parameter.annotation)[0] in (int, float)
        else ()
    ):
        for number in [value, np.asarray(value)[()], Fraction(value)][
            : None if type(value) is float else 2
        ]:
            assert parameter.check(name, number) == value
        try:  # functions may run for long
            make(call, name, value) if inspect.isclass(call) or "planet" in call.__name__ else 0
        except ValueError as refusal:
            # Another sentence may say that the value does not go with the other arguments.
            assert not str(refusal).endswith(parameter.allowed), str(refusal)
