"""Trains of drawn gears: phases by the involutes themselves, numbers by hand, refusals."""

import dataclasses
import math

import numpy as np
import pytest

import gearlib
from gearlib import Body, GearPair, GearTrain
from gearlib.geometry import Mesh, SpurGear, planetary_set
from tests.geometry.drawings import fzg_c

COMMON = {"module": 3e-3, "width": 0.025}


def gears(teeth=(27, 36, 99), shifts=(0.0, 0.0, 0.0), **changes):
    """Return sun, planet and ring."""
    sun, planet = (
        SpurGear(teeth=z, shift=x, **COMMON | changes)
        for z, x in zip(teeth[:2], shifts[:2], strict=True)
    )
    rim = {"teeth": teeth[2], "shift": shifts[2], "internal": True, "outer_diameter": 0.34}
    return sun, planet, SpurGear(**COMMON | rim | changes)


def rolls(train, sun, planet, ring, n, orientation):
    """Return where planet n touches sun and ring on both paths of contact, m.

    `orientation` is the angle of the middle of one of its teeth at tau = 0, seen from the line of
    centres. The flank that the sun pushes begins on the base circle half a tooth before it, the
    flank that pushes the ring half a tooth behind it; the lines of action touch the base circle of
    the planet at pi - alpha_s and at alpha_r. Turning it moves both contacts.
    """
    of_sun = Mesh(sun, planet, train.by_name["carrier"].base_radius)
    of_ring = Mesh(planet, ring, train.by_name["carrier"].base_radius)
    base = planet.base_diameter / 2.0
    half = planet.thickness_at(planet.base_diameter) / planet.base_diameter
    from_sun = base * (orientation + half - (math.pi - of_sun.working_pressure_angle))
    to_ring = base * (of_ring.working_pressure_angle - (orientation - half))
    return of_sun.phase_of(of_sun.wheel_roll_length(from_sun)), of_ring.phase_of(to_ring)


SETS = {
    "nominal": ((27, 36, 99), (0.0, 0.0, 0.0), 3),
    "odd planet": ((28, 35, 98), (0.0, 0.0, 0.0), 3),
    "shifted": ((24, 37, 99), (0.3, 0.25, -0.55), 3),
    "a planet with fewer teeth": ((25, 36, 99), (0.0, 0.3, -0.11), 4),
}


@pytest.mark.parametrize("name", SETS)
def test_phases_of_a_planetary_set_are_those_of_its_flanks(name):
    teeth, shifts, planets = SETS[name]
    sun, planet, ring = gears(teeth, shifts)
    train = planetary_set(sun, planet, ring, planets=planets, torque=100.0)
    for n in range(planets):
        wanted = -math.tau * train.phases[f"sun {n + 1}"]
        # Turn the planet until the stiffness of the sun's mesh has its phase at tau = 0.
        start = rolls(train, sun, planet, ring, n, 0.0)[0]
        pitch = math.tau / planet.teeth
        # A turn by one pitch is a mesh period; clockwise, as the planet turns, is forwards.
        turn = -(wanted - start) / math.tau * pitch
        first, second = rolls(train, sun, planet, ring, n, turn)
        assert math.cos(first - wanted) == pytest.approx(1.0, abs=1e-12)
        found = -math.tau * train.phases[f"ring {n + 1}"]
        # Angles: the cosine of 1e-5 rad differs from 1 by 5e-11.
        assert math.cos(second - found) == pytest.approx(1.0, abs=1e-11)


def test_tooth_thickness_and_pitch_phase_move_the_ring():
    sun, planet, ring = gears(*SETS["shifted"][:2])
    train = planetary_set(sun, planet, ring, torque=100.0)
    meshes = [
        dataclasses.replace(m, tooth_thickness=(0.5, 0.5), pitch_phase=0.0) for m in train.meshes
    ]
    plain = dataclasses.replace(train, meshes=tuple(meshes))
    apart = (train.phases["ring 1"] - plain.phases["ring 1"]) % 1.0
    assert 0.02 < apart < 0.98
    # Sun meshes, all alike, keep theirs: z_s psi / 2 pi.
    assert train.phases["sun 2"] == plain.phases["sun 2"]


def test_a_planetary_set_has_the_numbers_of_its_drawing():
    sun, planet, ring = gears()
    train = planetary_set(sun, planet, ring, torque=300.0, damping_ratio=0.05, carrier_mass=4.0)
    centre = 3e-3 * (27 + 36) / 2.0
    assert train.by_name["carrier"].base_radius == pytest.approx(centre, rel=1e-12)
    assert train.by_name["carrier"].mass == 4.0
    for name, gear in (("sun", sun), ("ring", ring), ("planet 2", planet)):
        body = train.by_name[name]
        assert body.inertia == pytest.approx(gear.inertia, rel=1e-12)
        assert body.base_radius == pytest.approx(gear.base_diameter / 2.0, rel=1e-12)
        assert body.mass == gear.mass
    found = train.static()
    # A third of the torque on each sun mesh; the planets pass the force on.
    expected = 100.0 / (sun.base_diameter / 2.0)
    np.testing.assert_allclose(found.mesh_force, expected, rtol=1e-9)
    pair = GearPair.from_geometry(Mesh(sun, planet), torque=100.0, damping_ratio=0.05)
    mesh = train.meshes[0]
    for name in ("max_stiffness", "stiffness_ratio", "contact_ratio", "material_damping"):
        assert getattr(mesh, name) == pytest.approx(getattr(pair, name), rel=1e-12), name
    inner = Mesh(planet, ring).stiffness("iso", torque=100.0 * 36 / 27)
    assert train.meshes[-1].mean_stiffness == pytest.approx(inner.mean_stiffness, rel=1e-12)
    assert train.meshes[-1].internal and not mesh.internal
    # Steady state by Willis: the torque of the carrier is the sun's times 1 + z_r / z_s.
    assert train.by_name["carrier"].torque == pytest.approx(-300.0 * (1 + 99 / 27), rel=1e-12)


def test_a_pair_as_a_train_of_drawn_gears():
    drawn = fzg_c()
    mesh = Mesh(drawn.pinion, drawn.wheel, drawn.centre_distance, backlash=1e-4)
    options = {"damping_ratio": 0.06, "backlash_damping_ratio": 0.01}
    pair = GearPair.from_geometry(mesh, torque=302.0, **options)
    torque = 302.0
    train = GearTrain(
        bodies=[
            Body.from_gear(mesh.pinion, "pinion", torque=torque),
            Body.from_gear(mesh.wheel, "wheel", torque=torque * 24 / 16),
        ],
        meshes=[gearlib.Mesh.from_geometry(mesh, "pinion", "wheel", torque=torque, **options)],
    )
    run, expected = (gearlib.simulate(m, 0.7, periods=20, record_periods=1) for m in (train, pair))
    # A train goes by matrices, a pair by scalar closed forms: rounding of 20 periods.
    np.testing.assert_allclose(
        run.displacement.values[:, 0], expected.displacement.values, rtol=0, atol=1e-9
    )
    light = Body.from_gear(mesh.pinion, "pinion", inertia=1e-4)
    assert light.inertia == 1e-4 and light.mass == mesh.pinion.mass


def refused(call):
    with pytest.raises(ValueError) as error:
        call()
    message = str(error.value)
    assert "\n" not in message and ". " not in message and "not allowed" in message
    return message


def planets(teeth=(27, 36, 99), shifts=(0.0, 0.0, 0.0), ring=None, **options):
    sun, planet, other = gears(teeth, shifts)
    return planetary_set(sun, planet, ring or other, **{"torque": 100.0} | options)


REFUSED = {
    "no ring": (lambda: planets(ring=gears()[1]), "internal of the ring = False ", "True"),
    "ring smaller than planet": (
        lambda: planets(ring=SpurGear(teeth=36, internal=True, **COMMON)),
        "teeth of the ring = 36 ",
        ">= 37",
    ),
    "ring hardly larger": (
        lambda: planets((27, 96, 99), centre_distance=0.1845),
        "",
        "the ring",
    ),
    "loose": (lambda: planets((27, 33, 99)), "", "ring"),
    "tight": (lambda: planets((27, 37, 99)), "", "ring"),
    "not assembled": (lambda: planets(planets=4), "planets = 4 ", "(27 + 99) / 4"),
    "collide": (lambda: planets((27, 36, 99), planets=6), "planets = 6 ", "axes are"),
    "collide unequally": (
        lambda: planets(positions=[0.0, math.tau * 10 / 126, math.pi]),
        "planets = 3 ",
        "axes are",
    ),
    "between teeth": (
        lambda: planets(positions=[0.0, 2.0, 4.0]),
        "positions[1] = 2.0 ",
        "0.0498666",
    ),
    "positions": (lambda: planets(positions=[0.0, 1.0]), "positions = (0.0, 1.0) ", "3 values"),
    "modules": (
        lambda: planets(ring=SpurGear(teeth=99, module=2e-3, width=0.025, internal=True)),
        "module of the ring = 0.002 ",
        "0.003",
    ),
    "outer diameter": (
        lambda: planets(ring=dataclasses.replace(gears()[2], outer_diameter=None)),
        "outer_diameter = None ",
        "ring gear",
    ),
    "backlash": (
        lambda: planets(backlashes=(1e-5, -1e-5)),
        "backlashes[1] = -1",
        ">= 0",
    ),
    "one position": (lambda: planets(positions=3), "positions = 3 ", "a sequence"),
    "one backlash": (lambda: planets(backlashes=1e-5), "backlashes = 1e-05 ", "2 values"),
    "backlashes": (lambda: planets(backlashes=[1e-5] * 3), "backlashes = [1e-05, ", "2 values"),
    "torque": (lambda: planets(torque=0.0), "torque = 0.0 ", "> 0"),
    "carrier": (lambda: planets(carrier_inertia=0.0), "carrier_inertia = 0.0 ", "> 0"),
    "two dampings": (
        lambda: planets(damping_ratio=0.1, material_damping=1.0),
        "damping_ratio and material_damping ",
        "one of them",
    ),
    "thickness": (
        lambda: dataclasses.replace(planets().meshes[0], tooth_thickness=(0.5, 1.0)),
        "tooth_thickness of mesh sun 1",
        "> 0 and < 1",
    ),
}


@pytest.mark.parametrize("case", REFUSED)
def test_what_cannot_be_is_refused_in_one_sentence(case):
    call, begins, holds = REFUSED[case]
    message = refused(call)
    assert message.startswith(begins), message
    assert holds in message, message
