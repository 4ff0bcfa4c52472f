"""What no train may be: each wrong input is refused in one sentence with key, value and range."""

import math
from dataclasses import replace

import pytest

from gearlib import Body, GearTrain, Mesh, Shaft, idler, planetary, split_power_reducer, two_stage
from tests.paper import PAPER

A = Body(name="a", inertia=0.01, base_radius=0.1, teeth=20, torque=100.0)
B = Body(name="b", inertia=0.02, base_radius=0.2, teeth=40, torque=200.0)
C = Body(name="c", inertia=0.02, base_radius=0.2, teeth=40)
AB = Mesh(pinion="a", wheel="b", max_stiffness=4e8, stiffness_ratio=0.6, contact_ratio=1.5)
BC = replace(AB, pinion="b", wheel="c", name="b-c")
CA = replace(AB, pinion="c", wheel="a", name="c-a")
#: Two pinions of 21 and 20 teeth, with the wheel at opposite sides: no loop, so it fits.
RING = Body(name="r", inertia=0.5, base_radius=0.3, teeth=60)


def train(bodies=(A, B), meshes=(AB,), **more):
    return GearTrain(bodies=bodies, meshes=meshes, **more)


WRONG = {
    "inertia": (lambda: replace(A, inertia=-1.0), "inertia of body a = -1.0 .* finite number > 0"),
    "radius": (lambda: replace(A, base_radius=0), "base_radius of body a = 0 .* finite number > 0"),
    "teeth": (lambda: replace(A, teeth=2.5), "teeth of body a = 2.5 .* an integer >= 3"),
    "mass": (lambda: replace(A, mass=math.inf), "mass of body a = inf .* finite number > 0"),
    "no mass": (
        lambda: replace(A, support_stiffness=1e8),
        "mass of body a = None .* where the support is elastic",
    ),
    "support": (
        lambda: replace(A, support_stiffness=(1e8, -1.0)),
        "support_stiffness of body a, y = -1.0 .* >= 0 .infinity: rigid.",
    ),
    "three supports": (
        lambda: replace(A, support_stiffness=(1e8, 1e8, 1e8)),
        "support_stiffness of body a = .* one or two numbers",
    ),
    "twist": (
        lambda: replace(A, torsional_stiffness=-1.0),
        "torsional_stiffness of body a = -1.0 .* >= 0",
    ),
    "torque": (lambda: replace(A, torque=math.inf), "torque of body a = inf .* finite"),
    "run-out": (lambda: replace(A, eccentricity=-1e-6), "eccentricity of body a = -1e-06 .* >= 0"),
    "run-out of a carrier": (
        lambda: replace(A, teeth=None, eccentricity=1e-6),
        "eccentricity of body a = 1e-06 .* 0 for a body without teeth",
    ),
    "name": (lambda: replace(A, name=7), "name of body 7 = 7 .* a text"),
    "shaft": (
        lambda: Shaft(bodies=("a", "a"), stiffness=1.0),
        "bodies of a shaft = .'a', 'a'. .* two bodies",
    ),
    "soft shaft": (
        lambda: Shaft(bodies=("a", "b"), stiffness=0.0),
        "stiffness of shaft a-b = 0.0 .* > 0",
    ),
    "stiffness": (
        lambda: replace(AB, max_stiffness=0.0),
        "max_stiffness of mesh a-b = 0.0 .* > 0",
    ),
    "kappa": (
        lambda: replace(AB, stiffness_ratio=1.5),
        "stiffness_ratio of mesh a-b = 1.5 .* > 0 and <= 1",
    ),
    "contact ratio": (
        lambda: replace(AB, contact_ratio=2.5),
        "contact_ratio of mesh a-b = 2.5 .* from 1 to 2",
    ),
    "angle": (
        lambda: replace(AB, pressure_angle=1.6),
        "pressure_angle of mesh a-b = 1.6 .* < pi / 2",
    ),
    "backlash": (lambda: replace(AB, backlash=-1e-6), "backlash of mesh a-b = -1e-06 .* >= 0"),
    "direction": (lambda: replace(AB, direction=0), "direction of mesh a-b = 0 .* one of 1, -1"),
    "friction": (lambda: replace(AB, friction=-0.1), "friction of mesh a-b, x = -0.1 .* >= 0"),
    "deviation": (lambda: replace(AB, deviation=[1.0]), "deviation of mesh a-b = .* Harmonics"),
    "two lines": (
        lambda: replace(AB, position=0.0, line_of_action=1.0),
        "line_of_action of mesh a-b = 1.0 .* left out where position",
    ),
    "bodies": (lambda: train(bodies=[A, "b"]), "bodies = .* a sequence of Body"),
    "no mesh": (lambda: train(meshes=[]), "meshes = .. .* a sequence of Mesh"),
    "twice": (lambda: train(bodies=(A, A)), "bodies = .* the name 'a' must occur once"),
    "unknown body": (
        lambda: train(meshes=[replace(AB, wheel="x")]),
        "wheel of mesh a-b = 'x' .* one of 'a', 'b'",
    ),
    "unknown shaft": (
        lambda: train(shafts=[Shaft(bodies=("a", "x"), stiffness=1.0)]),
        "bodies of a shaft = 'x' .* one of 'a', 'b'",
    ),
    "unknown carrier": (
        lambda: train(bodies=(A, replace(B, carrier="x"))),
        "carrier of body b = 'x' .* one of 'a', 'b'",
    ),
    "carried carrier": (
        lambda: train(bodies=(A, replace(B, carrier="b"))),
        "carrier of body b = 'b' .* which no carrier carries",
    ),
    "reference": (lambda: train(reference="x"), "reference = 'x' .* one of 'a-b'"),
    "itself": (
        lambda: train(meshes=[replace(AB, wheel="a")]),
        "wheel of mesh a-b = 'a' .* another body than the pinion",
    ),
    "reference frequency": (
        lambda: train(reference_frequency=0.0),
        "reference_frequency = 0.0 .* finite number > 0",
    ),
    "toothless": (
        lambda: train(bodies=(A, replace(B, teeth=None))),
        "teeth of body b = None .* in mesh a-b",
    ),
    "base pitch": (
        lambda: train(bodies=(A, replace(B, base_radius=0.21))),
        "base_radius of body b = 0.21 .* 0.2 to have the base pitch",
    ),
    "small ring": (
        lambda: train(bodies=(A, B), meshes=[replace(AB, pinion="b", wheel="a", internal=True)]),
        "teeth of body a = 20 .* more than the 40 of b",
    ),
    "locked": (
        lambda: train(bodies=(A, B, C), meshes=(AB, BC, CA)),
        "teeth of body . = .* the train is locked",
    ),
    "apart": (
        lambda: train(
            bodies=(A, B, C, replace(RING, base_radius=0.3)),
            meshes=(AB, replace(AB, pinion="c", wheel="r", name="c-r")),
        ),
        "mesh c-r .* connected with the reference mesh a-b",
    ),
    "unequal torques": (
        lambda: train(bodies=(A, replace(B, torque=0.0))),
        "torque of bodies a, b .* must balance on the free rotation",
    ),
    "free pinion": (
        lambda: train(bodies=(A, replace(B, torque=-200.0))),
        "torque of bodies a, b .* must balance",
    ),
    "gyroscopic": (
        lambda: train(
            bodies=(replace(A, mass=1.0, support_stiffness=(1e8, 2e8)), B), gyroscopic=True
        ),
        "support_stiffness of body a = .* the same along x and y in a turning frame",
    ),
    "still": (
        lambda: train(
            bodies=[replace(body, torsional_stiffness=math.inf) for body in (A, B)],
        ),
        "at least one of them must be able to move",
    ),
    "spacing": (
        lambda: planetary(planets=4),
        r"planets = 4 .* \(z_s \+ z_r\) / N = \(27 \+ 99\) / 4 .* an integer",
    ),
    "position": (
        lambda: planetary(positions=[0.0, 2.0, 4.0]),
        r"position of mesh ring 2 = 2.0 .* \(z_s \+ z_r\) / N an integer",
    ),
    "odd ring": (lambda: planetary(teeth=(27, 98)), "teeth = .27, 98. .* an even number"),
    "large planets": (
        lambda: planetary(planet_teeth=80),
        "planet_teeth = 80 .* fit into the ring",
    ),
    "masses": (lambda: planetary(masses=(1.0, 2.0)), "masses = .* 4 values"),
    "made of no mass": (
        lambda: planetary(masses=(1.0, 2.0, 3.0, "a")),
        r"masses.3. = 'a' .* a finite number > 0",
    ),
    "made of angle": (
        lambda: idler(PAPER, pressure_angle="a"),
        "pressure_angle = 'a' .* < pi / 2",
    ),
    "made of supports": (
        lambda: idler(PAPER, support_stiffness="a"),
        "support_stiffness = 'a' .* >= 0",
    ),
    "made of damping": (
        lambda: planetary(structural_damping=-1),
        "structural_damping = -1 .* >= 0",
    ),
    "made of shaft": (
        lambda: two_stage(PAPER, shaft_stiffness="a"),
        "shaft_stiffness = 'a' .* > 0",
    ),
    "made of gaps": (
        lambda: split_power_reducer(PAPER, backlashes=(1e-5,) * 3),
        r"backlashes.0. = 1e-05 .* 2 values",
    ),
    "made of no gear": (
        lambda: Body.from_gear("a", "b"),
        "gear = 'a' .* a gearlib.geometry.SpurGear",
    ),
    "made of no mesh": (
        lambda: Mesh.from_geometry(None, pinion="a", wheel="b"),
        "mesh = None .* a gearlib.geometry.Mesh",
    ),
    "pair": (lambda: idler(7), "pair = 7 .* a GearPair"),
    "idler teeth": (lambda: idler(PAPER, teeth=(24, 24)), "teeth = .24, 24. .* 3 values"),
    "module": (lambda: two_stage(PAPER, modules=(0.004, 0.0)), r"modules.1. = 0.0 .* > 0"),
    "centres": (
        lambda: split_power_reducer(PAPER, teeth=(24, 36, 24, 40)),
        "teeth = .24, 36, 24, 40. .* one centre distance, .* 0.12 m in the first, 0.128 m",
    ),
    "branches": (lambda: split_power_reducer(PAPER, branches=0), "branches = 0 .* >= 1"),
    "state": (
        lambda: planetary().check_state(("a", "b")),
        "initial_state = .* 'static'",
    ),
    "phase": (lambda: planetary().static(phase=math.nan), "phase = nan .* finite"),
}


@pytest.mark.parametrize("name", WRONG)
def test_wrong_input_is_refused_in_one_sentence(name):
    make, words = WRONG[name]
    with pytest.raises(ValueError, match=words) as caught:
        make()
    text = str(caught.value)
    assert "\n" not in text and not text.endswith(".") and len(text) < 400


def test_what_stands_beside_the_wrong_inputs_is_allowed():
    assert train().phases == {"a-b": 0.0}
    assert planetary(positions=[0.0, 2.0 * math.pi * 42 / 126, 4.4879895051282759]).size == 36


def test_combinations_of_meshes_have_numbers_of_64_bits():
    # Nine effects each.
    count = max(number for number in range(1, 30) if 9**number < 2**63)
    ends = {0: 100.0, count: 100.0 * (-1.0) ** (count + 1)}
    bodies = [replace(A, name=f"g{i}", torque=ends.get(i, 0.0)) for i in range(count + 2)]
    meshes = [
        replace(AB, pinion=f"g{i}", wheel=f"g{i + 1}", name=f"mesh {i}") for i in range(count + 1)
    ]
    assert len(train(bodies=bodies[:-1], meshes=meshes[:-1]).meshes) == count
    with pytest.raises(ValueError, match=f"at most {count}"):
        train(bodies=bodies, meshes=meshes)
