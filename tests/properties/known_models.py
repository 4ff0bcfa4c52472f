"""Models of every kind, each with a motion that tests compare with a reference."""

import math
from dataclasses import replace
from typing import NamedTuple

import numpy as np

import gearlib
from gearlib import (
    Body,
    DeadZoneOscillator,
    Fourier,
    GearPair,
    GearTrain,
    Harmonics,
    Mesh,
    OneDegreePair,
    Series,
    Shaft,
    SixDegreePair,
    Steps,
    Tabulated,
)
from tests.paper import PAPER_PAIR
from tests.physics import published
from tests.trains.random_trains import chain_with_everything


class MotionCase(NamedTuple):
    """A model, its tuning, the dimensionless initial state and the number of mesh periods."""

    model: object
    tuning: float
    state: tuple | str
    periods: int = 5


#: Base radius (m) and mass (kg) of the equal gears on bearings, and the paper's reduced mass (kg).
BASE_RADIUS, GEAR_MASS, REDUCED_MASS = 0.1, 17.27, 3.123
LINEAR = PAPER_PAIR.replace(material_damping=1000.0, backlash_damping=300.0)
DAMPED = PAPER_PAIR.replace(material_damping=3953.7, backlash_damping=500.0)
UNDAMPED = LINEAR.replace(material_damping=0.0, backlash_damping=0.0)
#: A pair with an orbit on both flanks at the tuning 0.88, and an unstable one at 0.851.
PAIR_ON_BOTH_FLANKS = GearPair.from_ratios(
    contact_ratio=1.3, stiffness_ratio=0.7, damping=0.03, backlash_damping=0.01, backlash_ratio=0.8
)
QUADRATIC = {"quadratic_damping": 3e4, "backlash_quadratic_damping": 2e4}
CUBIC = {"cubic_damping": 4e5, "backlash_cubic_damping": 2e5}
TABLE = Tabulated((0.1, 1.0, 2.5, 4.0, 5.5), (4e8, 3.1e8, 2.4e8, 2.6e8, 3.7e8))
ALL_EXCITATIONS = {
    "friction": (0.06, 0.04),
    "pitch_phase": 0.7,
    "eccentricities": (8e-6, 5e-6),
    "run_out_phase": 0.9,
    "teeth": (24, 31),
    "deviation": Harmonics((1e-6, 0.5e-6), (0.3e-6,)),
    "coast_deviation": Harmonics((0.7e-6,), (0.0, 0.4e-6)),
}
#: An oscillator with every feature on both sides; it bounces on both within a few periods.
UNEQUAL = DeadZoneOscillator(
    upper_edge=0.4,
    lower_edge=-0.9,
    upper_stiffness=Steps((0.5, 2.0, 5.0), (6.0, 9.0, 4.0)),
    lower_stiffness=Steps((1.0, 3.0), (3.0, 5.0)),
    damping=0.05,
    upper_damping=0.2,
    lower_damping=0.1,
    ground_stiffness=0.3,
    load=0.1,
    forcing=Harmonics((0.7, 0.2), (0.1,)),
    deviation=Harmonics((), (0.05,)),
)
OSCILLATOR = DeadZoneOscillator(
    upper_edge=0.2,
    lower_edge=-0.9,
    upper_stiffness=1.3,
    lower_stiffness=0.8,
    damping=0.05,
    upper_damping=0.1,
    ground_stiffness=0.1,
    load=0.1,
    forcing=Harmonics((0.7,), (0.2,)),
    deviation=Harmonics((), (0.1,)),
)


def gears_on_bearings(
    bearing_stiffness,
    material_damping=0.0,
    backlash_damping=0.0,
    translating=False,
    bearing_damping_ratio=0.02,
    backlash=40e-6,
    **fields,
):
    """Return a `SixDegreePair` of equal gears on equal bearings, with the paper's reduced mass.

    If `translating`, the reduced mass includes the translation along the line of action, else only
    the rotation. `fields` are further fields of the model.
    """
    rotational_mass = REDUCED_MASS
    if translating:
        rotational_mass = 1.0 / (1.0 / REDUCED_MASS - 2.0 / GEAR_MASS)
    critical_damping = 2.0 * math.sqrt(bearing_stiffness * GEAR_MASS)
    bearing_damping = bearing_damping_ratio * critical_damping
    if math.isinf(bearing_stiffness):
        bearing_damping = 0.0
    inertia = 2.0 * rotational_mass * BASE_RADIUS**2
    pair = PAPER_PAIR.replace(
        backlash=backlash, material_damping=material_damping, backlash_damping=backlash_damping
    )
    return SixDegreePair(
        pair=pair,
        base_radii=(BASE_RADIUS, BASE_RADIUS),
        inertias=(inertia, inertia),
        masses=(GEAR_MASS, GEAR_MASS),
        bearing_stiffness=(bearing_stiffness,) * 4,
        bearing_damping=(bearing_damping,) * 4,
        **fields,
    )


#: Unequal gears on unequal bearings.
GEARS = SixDegreePair(
    pair=DAMPED,
    base_radii=(0.034, 0.05),
    inertias=(0.004, 0.01),
    masses=(3.0, 5.0),
    bearing_stiffness=(5e8, 5e8, 6e8, 6e8),
    bearing_damping=(800.0,) * 4,
    teeth=(3, 2),
    eccentricities=(1e-6, 2e-6),
    friction=(0.05, 0.05),
    pitch_phase=1.0,
)


def motor_pinion_idler_wheel():
    """Return a train of a motor, a shaft, a pinion, an idler on elastic bearings and a wheel."""
    pinion_radius, mesh_force = 0.045, 2000.0  # m, N
    torque = mesh_force * pinion_radius
    bearing = {"mass": 5.0, "support_stiffness": (5e8, 4e8), "support_damping": (500.0, 700.0)}
    bodies = [
        Body(name="motor", inertia=0.02, base_radius=0.05, torque=torque),
        Body(name="pinion", inertia=0.002, base_radius=pinion_radius, teeth=24),
        Body(name="idler", inertia=0.01, base_radius=0.0675, teeth=36, **bearing),
        Body(name="wheel", inertia=0.03, base_radius=0.09, teeth=48, torque=-2.0 * torque),
    ]
    fields = ("pinion", "wheel", "direction", "phase", "max_stiffness", "stiffness_ratio")
    fields += ("contact_ratio", "backlash", "material_damping", "backlash_damping", "error")
    rows = [
        ("pinion", "idler", 1, 0.0, 3e8, 0.7, 1.6, 20e-6, 2000.0, 300.0, 1e-6),
        ("idler", "wheel", -1, 0.3, 2.5e8, 0.6, 1.4, 15e-6, 1500.0, 200.0, -2e-6),
    ]
    meshes = [Mesh(**dict(zip(fields, row, strict=True))) for row in rows]
    shafts = [Shaft(bodies=("motor", "pinion"), stiffness=2e5, damping=0.2)]
    return GearTrain(bodies=bodies, meshes=meshes, shafts=shafts)


CHAIN = motor_pinion_idler_wheel()
SETTLING = (-4.81, -7.95, -1.49, 2.52, 6.82, 0.66, -2.32, -3.3, 3.14, 6.87, 1.15, -5.18)
STRIKING = (-9.58, 16.0, 2.03, -17.32, -0.84, -11.63, -4.41, -3.42, -4.99, 3.87, -0.44, -4.13)


def pairs_as_train(pair, count=1):
    """Return a train of `count` equal, practically uncoupled gear pairs on rigid axes."""
    names = ("max_stiffness", "stiffness_ratio", "contact_ratio", "backlash")
    names += ("material_damping", "backlash_damping")
    mesh = {name: getattr(pair, name) for name in names} | {"phase": 0.0}
    gear = {"teeth": 20, "base_radius": BASE_RADIUS, "torque": pair.load * BASE_RADIUS}
    gear["inertia"] = 2.0 * pair.reduced_mass * BASE_RADIUS**2
    # A train must be connected, so that shafts of negligible stiffness join the pairs.
    negligible = {"stiffness": 1e-200}
    return GearTrain(
        bodies=[
            Body(name=f"{kind} {i}", **gear) for i in range(count) for kind in ("pinion", "wheel")
        ],
        meshes=[Mesh(pinion=f"pinion {i}", wheel=f"wheel {i}", **mesh) for i in range(count)],
        shafts=[
            Shaft(bodies=(f"pinion {i - 1}", f"pinion {i}"), **negligible) for i in range(1, count)
        ],
        reference_frequency=None if count == 1 else pair.mean_eigenfrequency / (2.0 * math.pi),
    )


def ring_driven_train():
    """Return a planetary train driven by its ring, with run-out of the ring and of a planet."""
    train = gearlib.planetary(
        planets=2, teeth=(28, 98), driving="ring", stiffness_ratio=(0.6, 0.6), load=400.0
    )
    run_out = {"eccentricity": 3e-5, "eccentricity_phase": 0.7, "offset": (2e-6, 3e-6)}
    bodies = [
        replace(body, **run_out) if body.name in ("ring", "planet 2") else body
        for body in train.bodies
    ]
    flank = {"friction": (0.05, 0.03), "pitch_phase": 1.4, "tooth_thickness": (0.53, 0.45)}
    flank |= {"backlash": 4e-6}
    return train.replace(bodies=bodies, meshes=[replace(m, **flank) for m in train.meshes])


def _idler_with_deviations():
    """Return an idler train in which each mesh has a deviation of one cosine of 1 µm."""
    train = gearlib.idler(PAPER_PAIR.replace(material_damping=3000.0))
    wave = Harmonics((1e-6,), ())
    return train.replace(meshes=[replace(mesh, deviation=wave) for mesh in train.meshes])


def _one_degree_pair(pair=LINEAR, **fields):
    """Return the `OneDegreePair` with a gear pair and further fields."""
    return OneDegreePair(pair=pair, **fields)


_NARROW, _SERIES = LINEAR.replace(backlash=12e-6), Series(1.4, Harmonics((0.4,), (0.2, -0.1)))
_WAVES = {"excitation": Harmonics((0.0, 4000.0)), "deviation": Harmonics((2e-6,))}
_CHAINS = [chain_with_everything(np.random.default_rng(seed)) for seed in range(3)]
_BOUNCING = {"stiffness_ratio": (0.7, 0.7), "reference_frequency": 1475.7}
_RIGID_PINS = {"support_stiffness": (1e8, 1e8, 1e8, math.inf), "backlash": 5e-6}
_RIGID_PINS["stiffness_ratio"] = (0.6, 0.6)
_TURNING = {"turning": True, "gyroscopic": True, "stiffness_ratio": (0.7, 0.7)}
MOTION_CASES = {
    "pair": MotionCase(DAMPED, 0.9, (1.0, -3.0)),
    "pair without damping": MotionCase(UNDAMPED, 0.82, (0.0, 0.0)),
    "pair on both flanks": MotionCase(PAIR_ON_BOTH_FLANKS, 0.88, (0.3, -2.0)),
    "pair without backlash": MotionCase(DAMPED.replace(backlash=0.0), 0.8, (0.5, -2.0)),
    "pair without coast-side flank": MotionCase(
        DAMPED.replace(backlash=math.inf), 0.8, (0.5, -2.0)
    ),
    "quadratic damping": MotionCase(_one_degree_pair(UNDAMPED, **QUADRATIC), 0.9, (1.0, -3.0)),
    "cubic damping": MotionCase(_one_degree_pair(UNDAMPED, **CUBIC), 0.9, (0.0, 0.0)),
    "both dampings": MotionCase(_one_degree_pair(**QUADRATIC, **CUBIC), 0.6, (1.0, -3.0)),
    "powers": MotionCase(
        _one_degree_pair(quadratic_stiffness=5e3, cubic_stiffness=2e9), 0.85, (1.0, -3.0)
    ),
    "one harmonic": MotionCase(_one_degree_pair(profile=Fourier(1)), 0.8, (1.0, -3.0)),
    "seven harmonics": MotionCase(_one_degree_pair(profile=Fourier(7), **CUBIC), 0.5, (1.0, -3.0)),
    "table": MotionCase(_one_degree_pair(profile=TABLE), 0.8, (1.0, -3.0)),
    "excited": MotionCase(
        _one_degree_pair(excitation=Harmonics((500.0, 200.0), (-800.0,))), 0.8, (1.0, -3.0)
    ),
    "deviating": MotionCase(
        _one_degree_pair(deviation=Harmonics((3e-6,), (1e-6, 1e-6))), 0.7, (1.0, -3.0)
    ),
    "everything": MotionCase(
        _one_degree_pair(_NARROW, profile=TABLE, **QUADRATIC, **_WAVES), 0.6, (1.0, -3.0)
    ),
    "oscillator": MotionCase(OSCILLATOR, 0.8, (0.3, -1.0)),
    "unequal sides": MotionCase(UNEQUAL, 1.3, (0.2, 0.9)),
    "series": MotionCase(OSCILLATOR.replace(upper_stiffness=_SERIES), 0.8, (0.3, -1.0)),
    **{name: MotionCase(*problem, (0.2, 0.9)) for name, problem in published.PROBLEMS.items()},
    "soft bearings": MotionCase(gears_on_bearings(3e7, translating=True), 0.66, (0.0, 0.0), 8),
    "rigid bearings": MotionCase(gears_on_bearings(math.inf, 3953.7, 500.0), 0.8, (1.0, -4.0)),
    "free bearings": MotionCase(
        gears_on_bearings(3e7, 3953.7, 500.0, translating=True, **ALL_EXCITATIONS),
        0.9,
        (0.0, 0.0),
        8,
    ),
    "narrow backlash": MotionCase(
        gears_on_bearings(1e8, 3953.7, 3953.7, **ALL_EXCITATIONS, backlash=12e-6),
        0.55,
        (1.0, -2.5),
        8,
    ),
    "stiff bearings": MotionCase(
        gears_on_bearings(1e9, 1000.0, 0.0, **ALL_EXCITATIONS), 0.8, (0.5, 1.0), 8
    ),
    "no preload": MotionCase(
        gears_on_bearings(1e8, 3953.7, 500.0, preload=False), 0.8, (0.0, 0.0), 8
    ),
    "coast-side flank at rest": MotionCase(
        gears_on_bearings(1e8, 100.0, 0.0, **ALL_EXCITATIONS, moving_backlash=False),
        0.6,
        (1.0, -4.5),
        8,
    ),
    "coast-side contact": MotionCase(
        gears_on_bearings(3e9, 1500.0, 300.0, **ALL_EXCITATIONS, backlash=14e-6), 0.8, (5.0, 0.0), 3
    ),
    "coast-side contact in oil": MotionCase(
        gears_on_bearings(3e9, 600.0, 1200.0, backlash=14e-6), 0.8, (5.0, 0.0), 3
    ),
    "unequal gears": MotionCase(GEARS, 0.9, (0.3, -5.0)),
    "chain that settles": MotionCase(CHAIN, 0.8, SETTLING, 3),
    "chain that strikes": MotionCase(CHAIN, 0.7, STRIKING, 2),
    "pair as a train": MotionCase(pairs_as_train(DAMPED), 0.9, (0.15, 0.15, -3.0, -3.0)),
    "idler that deviates": MotionCase(_idler_with_deviations(), 0.9, (0.0,) * 6, 2),
    **{
        f"chain with everything {i}": MotionCase(x, 0.9, "static", 6) for i, x in enumerate(_CHAINS)
    },
    "ring that drives": MotionCase(ring_driven_train(), 3.0, "static", 4),
    "bouncing planets": MotionCase(gearlib.planetary(**_BOUNCING), 1.0, "static", 4),
    "turning planets": MotionCase(gearlib.planetary(**_TURNING, backlash=1e-6), 0.2, "static", 3),
    "two stages": MotionCase(gearlib.two_stage(PAPER_PAIR), 0.8, "static", 3),
    "reducer": MotionCase(
        gearlib.split_power_reducer(PAPER_PAIR, internal=True), 0.95, "static", 3
    ),
    "rigid pins": MotionCase(gearlib.planetary(**_RIGID_PINS), 1.0, "static", 3),
}
