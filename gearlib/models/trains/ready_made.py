"""Trains with equal meshes: an idler train, two stages, and the reducer of the paper.

Without given inertias, the gears of one stage have I / r^2 in proportion to z^2, like discs of
equal width, such that the first mesh has the reduced mass of the pair.

Hortel & Skuderova, Engineering Mechanics 14 (2007) 91-104, Fig. 1 a, mention a pseudoplanetary
reducer with three double satellites and split power flow, but print only the numbers of one mesh.
All other numbers are choices:

* teeth 24 : 36 in the first stage, 24 : 36 (external) or 24 : 84 (internal second central gear) in
  the second stage, all with a module of 4 mm: equal centre distances, branches in phase, and three
  periods of the first mesh to two of the second;
* the load of the pair on each first mesh, and masses of 2 I / r^2, as those of discs;
* shafts of 1e6 N m/rad: steel of 60 mm diameter and 100 mm length;
* bearings of 1e9 N/m for all gears, about three times as stiff as a mesh.
"""

import math
from typing import Annotated

from gearlib import checks
from gearlib.models.trains.elements import Body, Mesh, Shaft
from gearlib.parameters import (
    ANGLE,
    BACKLASH,
    ERROR,
    MASS,
    MODULE,
    SHAFT_STIFFNESS,
    SUPPORT,
    TEETH,
    TIME,
    TRUTH,
    Instance,
    Integer,
    Many,
    PressureAngle,
    checked,
)

#: Default damping of supports and shafts over their stiffness, s.
STRUCTURAL_DAMPING = 1e-6
#: Default working pressure angle, rad.
PRESSURE_ANGLE = math.radians(20.0)
_REDUCED_WORDS = "I / r^2 of each; by default in proportion to z^2"
_MASS_WORDS = "Of each gear; by default twice I / r^2, as of discs"

StructuralDamping = Annotated[float, TIME, "Damping of supports and shafts over their stiffness"]
AxisStiffness = Annotated[float, SUPPORT, "Of all axes"]
ShaftStiffness = Annotated[float, SHAFT_STIFFNESS, "Of each shaft against torsion"]
Modules = Annotated[tuple, Many(MODULE, 2), "Of both stages"]
PinErrors = Annotated[
    tuple | None,
    Many(Many(ERROR, 2)),
    "By how much the axis of each is misplaced, radial and tangential",
]
FourReduced = Annotated[tuple | None, Many(MASS, 4), _REDUCED_WORDS]
FourMasses = Annotated[tuple | None, Many(MASS, 4), _MASS_WORDS]


def train_of(**parts):
    """Return the `GearTrain` of bodies, meshes, shafts and other fields."""
    # Imported here, since reading the configuration needs the signatures but no train.
    from gearlib.models.trains.train import GearTrain

    return GearTrain(**parts)


def damping_of(stiffness, structural_damping):
    """Return the damping of a spring in proportion to its stiffness, 0 for a rigid one."""
    return structural_damping * stiffness if stiffness < math.inf else 0.0


class _GearSet:
    """The gears of a train on equal supports, whose meshes all have the values of one `GearPair`.

    `stages` holds the tooth numbers of the gears of each stage; `modules`, `reduced` (I / r^2) and
    `masses` are lists over all gears in the same order.
    """

    def __init__(self, pair, stages, modules, pressure_angle, reduced, masses, support, damping):
        """Compute inertias, masses and base radii; missing inertias are those of discs."""
        from gearlib.models.pair import GearPair

        self.pair = Instance((GearPair,)).check("pair", pair)
        self.pressure_angle, self.structural_damping = pressure_angle, damping
        self.teeth = [z for stage in stages for z in stage]
        self.reduced = reduced or [mass for stage in stages for mass in self._disc_masses(*stage)]
        self.masses = masses or [2.0 * value for value in self.reduced]
        self.support_stiffness = support
        self.base_radii = [
            module * z / 2.0 * math.cos(pressure_angle)
            for module, z in zip(modules, self.teeth, strict=True)
        ]

    def _disc_masses(self, first, second, *others):
        """Return I / r^2 of gears in proportion to the squares of their tooth numbers.

        The first two gears have the reduced mass of the pair.
        """
        unit = self.pair.reduced_mass * (1.0 / first**2 + 1.0 / second**2)
        return [unit * z**2 for z in (first, second, *others)]

    def body(self, i, name, force=0.0, **fields):
        """Return gear i as a `Body` with a tangential force at its base circle, N."""
        return Body(
            name=name,
            teeth=self.teeth[i],
            base_radius=self.base_radii[i],
            inertia=self.reduced[i] * self.base_radii[i] ** 2,
            mass=self.masses[i],
            torque=force * self.base_radii[i],
            support_stiffness=self.support_stiffness,
            support_damping=damping_of(self.support_stiffness, self.structural_damping),
            **fields,
        )

    def mesh(self, pinion, wheel, **fields):
        """Return a `Mesh` with the stiffness, damping and backlash of the pair."""
        names = ("max_stiffness", "stiffness_ratio", "contact_ratio", "backlash")
        names += ("material_damping", "backlash_damping")
        values = {name: getattr(self.pair, name) for name in names}
        angle = self.pressure_angle
        return Mesh(pinion=pinion, wheel=wheel, **({"pressure_angle": angle} | values | fields))

    def shaft(self, first, second, stiffness):
        """Return a `Shaft` between two bodies with a torsional stiffness in N m/rad."""
        damping = damping_of(stiffness, self.structural_damping)
        return Shaft(bodies=(first, second), stiffness=stiffness, damping=damping)


@checked
def idler(
    pair,
    *,
    teeth: Annotated[tuple, Many(TEETH, 3), "Of pinion, idler and wheel"] = (24, 24, 24),
    angle: Annotated[
        float, ANGLE, "Between both lines of centres at the idler; pi: in a row"
    ] = math.pi,
    module: Annotated[float, MODULE, "Of all gears"] = 0.004,
    reduced_inertias: Annotated[tuple | None, Many(MASS, 3), _REDUCED_WORDS] = None,
    masses: Annotated[tuple | None, Many(MASS, 3), _MASS_WORDS] = None,
    support_stiffness: AxisStiffness = math.inf,
    structural_damping: StructuralDamping = STRUCTURAL_DAMPING,
    pressure_angle: PressureAngle = PRESSURE_ANGLE,
    **options,
):
    """Return a train of three gears, ``pinion``, ``idler`` and ``wheel``, with two meshes.

    Both meshes have the stiffness, damping, backlash and load of `pair`, a `GearPair`; the first
    mesh has its reduced mass. Other options are those of `GearTrain`.
    """
    support = support_stiffness, structural_damping
    gears = _GearSet(
        pair, [teeth], [module] * 3, pressure_angle, reduced_inertias, masses, *support
    )
    bodies = [
        gears.body(0, "pinion", pair.load),
        gears.body(1, "idler"),
        gears.body(2, "wheel", -pair.load),
    ]
    # The idler drives the wheel with the opposite flanks.
    meshes = [
        gears.mesh("pinion", "idler", position=0.0),
        gears.mesh("idler", "wheel", position=math.pi + angle, direction=-1),
    ]
    return train_of(bodies=bodies, meshes=meshes, **options)


@checked
def two_stage(
    pair,
    *,
    teeth: Annotated[tuple, Many(TEETH, 4), "Of both gears of each stage"] = (24, 36, 24, 36),
    modules: Modules = (0.004, 0.004),
    shaft_stiffness: ShaftStiffness = 1e6,
    reduced_inertias: FourReduced = None,
    masses: FourMasses = None,
    support_stiffness: AxisStiffness = math.inf,
    structural_damping: StructuralDamping = STRUCTURAL_DAMPING,
    pressure_angle: PressureAngle = PRESSURE_ANGLE,
    **options,
):
    """Return a train of two stages that a shaft joins: pinion 1, wheel 1, pinion 2 and wheel 2.

    Both meshes have the stiffness, damping, backlash and reduced mass of `pair`, a `GearPair`,
    whose load acts on the first mesh. Other options are those of `GearTrain`.
    """
    stages, gear_modules = (teeth[:2], teeth[2:]), [modules[i // 2] for i in range(4)]
    support = support_stiffness, structural_damping
    gears = _GearSet(pair, stages, gear_modules, pressure_angle, reduced_inertias, masses, *support)
    # The shaft rotates clockwise, and the second wheel counterclockwise against its load.
    output_force = -pair.load * gears.base_radii[1] / gears.base_radii[2]
    bodies = [
        gears.body(0, "pinion 1", pair.load),
        gears.body(1, "wheel 1"),
        gears.body(2, "pinion 2"),
        gears.body(3, "wheel 2", output_force),
    ]
    meshes = [
        gears.mesh("pinion 1", "wheel 1", position=0.0),
        gears.mesh("pinion 2", "wheel 2", position=0.0, direction=-1),
    ]
    shafts = [gears.shaft("wheel 1", "pinion 2", shaft_stiffness)]
    return train_of(bodies=bodies, meshes=meshes, shafts=shafts, **options)


@checked
def split_power_reducer(
    pair,
    *,
    branches: Annotated[int, Integer(1, limit=100), "Double satellites, equally spaced"] = 3,
    teeth: Annotated[
        tuple | None,
        Many(TEETH, 4),
        "Of input, both gears of a satellite, output; by default (24, 36, 24, 36), with a ring "
        "gear (24, 36, 24, 84)",
    ] = None,
    internal: Annotated[bool, TRUTH, "Whether the output is a ring gear"] = False,
    modules: Modules = (0.004, 0.004),
    pressure_angle: PressureAngle = PRESSURE_ANGLE,
    reduced_inertias: FourReduced = None,
    masses: FourMasses = None,
    shaft_stiffness: ShaftStiffness = 1e6,
    support_stiffness: AxisStiffness = 1e9,
    structural_damping: StructuralDamping = STRUCTURAL_DAMPING,
    pin_errors: PinErrors = None,
    backlashes: Annotated[
        tuple | None,
        Many(Many(BACKLASH, 2)),
        "Of the first and second mesh of each branch; by default that of the pair",
    ] = None,
    **options,
):
    """Return the reducer of the paper, with double satellites on fixed axes.

    Bodies are called ``input``, ``output``, ``satellite 1 a``, ``satellite 1 b``, ...; the meshes
    of branch i are ``first i`` (input and a) and ``second i`` (b and output). All meshes have the
    values of `pair`, a `GearPair`, whose load acts on each mesh of the first stage. Other options
    are those of `GearTrain`.

    Raises
    ------
    ValueError
        If a value is impossible or the two stages have different centre distances.
    """
    n = branches
    z = teeth or ((24, 36, 24, 84) if internal else (24, 36, 24, 36))
    gear_modules = [modules[i // 2] for i in range(4)]
    support = support_stiffness, structural_damping
    gears = _GearSet(pair, [z], gear_modules, pressure_angle, reduced_inertias, masses, *support)
    output_teeth = z[3] - z[2] if internal else z[3] + z[2]
    diameters = gear_modules[0] * (z[0] + z[1]), gear_modules[2] * output_teeth
    if abs(diameters[0] - diameters[1]) > 1e-9 * diameters[0]:
        raise ValueError(
            f"teeth = {z!r} is not allowed: both stages must have one centre distance, and it is "
            f"{diameters[0] / 2.0:.6g} m in the first, {diameters[1] / 2.0:.6g} m in the second"
        )
    errors = checks.many("pin_errors", pin_errors or [(0.0, 0.0)] * n, n)
    backlashes = checks.many("backlashes", backlashes or [(pair.backlash,) * 2] * n, n)
    # The satellites rotate clockwise. They drive an external output counterclockwise and a ring
    # gear clockwise, against the load.
    output_force = n * pair.load * gears.base_radii[1] / gears.base_radii[2]
    output_force *= 1.0 if internal else -1.0
    bodies = [gears.body(0, "input", n * pair.load), gears.body(3, "output", output_force)]
    first, second, shafts = [], [], []
    for i, ((radial, tangential), (backlash_1, backlash_2)) in enumerate(
        zip(errors, backlashes, strict=True)
    ):
        angle = 2.0 * math.pi * i / n
        a, b = f"satellite {i + 1} a", f"satellite {i + 1} b"
        c, s = math.cos(angle), math.sin(angle)
        offset = c * radial - s * tangential, s * radial + c * tangential
        bodies += [gears.body(1, a, offset=offset), gears.body(2, b, offset=offset)]
        name = f"first {i + 1}"
        first.append(gears.mesh("input", a, name=name, position=angle, backlash=backlash_1))
        fields = {"position": angle + math.pi, "direction": -1}
        if internal:
            fields = {"position": angle, "internal": True}
        name = f"second {i + 1}"
        second.append(gears.mesh(b, "output", name=name, backlash=backlash_2, **fields))
        shafts.append(gears.shaft(a, b, shaft_stiffness))
    return train_of(bodies=bodies, meshes=first + second, shafts=shafts, **options)
