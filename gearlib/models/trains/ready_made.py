"""Trains whose meshes are all one `GearPair`: an idler, two stages, the paper's reducer.

Where inertias are left out, gears of one stage have I / r^2 in proportion to z^2, as discs of one
width have, such that the first mesh has the reduced mass of the pair.

Hortel & Skuderova, Engineering Mechanics 14 (2007) 91-104, Fig. 1 a, name a pseudoplanetary reducer
with three double satellites and split power flow; they print no number of it beyond those of one
mesh. All others are choices:

* teeth 24 : 36 in the first stage, 24 : 36 (external) or 24 : 84 (internal second central gear) in
  the second, of one module of 4 mm: equal centre distances, the branches in phase, and three
  periods of the first mesh to two of the second;
* the load of the pair on each first mesh, and gears twice as heavy as I / r^2, as discs are;
* shafts of 1e6 N m/rad, steel of 60 mm diameter and 100 mm length;
* bearings of 1e9 N/m for all gears, some three times as stiff as a mesh.
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

#: Damping of supports and shafts over their stiffness, s; a choice.
STRUCTURAL_DAMPING = 1e-6
#: In operation, rad.
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
    """Return a `GearTrain` of its bodies, meshes and shafts."""
    # A start of the workflow reads the declarations and does not load the models.
    from gearlib.models.trains.train import GearTrain

    return GearTrain(**parts)


def damping_of(stiffness, structural_damping):
    """Return the damping of a stiffness, N s/m; none of a rigid one."""
    return structural_damping * stiffness if stiffness < math.inf else 0.0


class _Gears:
    """Gears that mesh as a pair, on equal supports; their sizes, I / r^2 and masses in order."""

    def __init__(self, pair, stages, modules, pressure_angle, reduced, masses, support, damping):
        from gearlib.models.pair import GearPair

        self.pair = Instance((GearPair,)).check("pair", pair)
        self.pressure_angle, self.structural_damping = pressure_angle, damping
        self.teeth = [z for stage in stages for z in stage]
        self.reduced = reduced or [mass for stage in stages for mass in self._disc_masses(*stage)]
        self.masses = masses or [2.0 * value for value in self.reduced]
        self.support_stiffness = support
        #: Of the base circles, m.
        self.radii = [
            module * z / 2.0 * math.cos(pressure_angle)
            for module, z in zip(modules, self.teeth, strict=True)
        ]

    def _disc_masses(self, first, second, *others):
        """Return I / r^2 in proportion to z^2; the first two have the pair's reduced mass."""
        unit = self.pair.reduced_mass * (1.0 / first**2 + 1.0 / second**2)
        return [unit * z**2 for z in (first, second, *others)]

    def body(self, i, name, force=0.0, **more):
        """Return the i-th gear as a `Body`; the force acts at its base circle."""
        return Body(
            name=name,
            teeth=self.teeth[i],
            base_radius=self.radii[i],
            inertia=self.reduced[i] * self.radii[i] ** 2,
            mass=self.masses[i],
            torque=force * self.radii[i],
            support_stiffness=self.support_stiffness,
            support_damping=damping_of(self.support_stiffness, self.structural_damping),
            **more,
        )

    def mesh(self, pinion, wheel, **more):
        """Return a `Mesh` with the values of the pair."""
        names = ("max_stiffness", "stiffness_ratio", "contact_ratio", "backlash")
        names += ("material_damping", "backlash_damping")
        values = {name: getattr(self.pair, name) for name in names}
        angle = self.pressure_angle
        return Mesh(pinion=pinion, wheel=wheel, **({"pressure_angle": angle} | values | more))

    def shaft(self, first, second, stiffness):
        """Return a `Shaft` against torsion."""
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
    """Return a train of three gears in a row, ``pinion``, ``idler``, ``wheel``, with two meshes.

    `pair`, a `GearPair`, gives stiffness, damping, backlash and load of both meshes; its reduced
    mass is that of the first. Other options are those of `GearTrain`.
    """
    support = support_stiffness, structural_damping
    gears = _Gears(pair, [teeth], [module] * 3, pressure_angle, reduced_inertias, masses, *support)
    bodies = [
        gears.body(0, "pinion", pair.load),
        gears.body(1, "idler"),
        gears.body(2, "wheel", -pair.load),
    ]
    # From the wheel's side of the idler the drive flanks are the other ones.
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
    """Return two stages, ``pinion 1`` and ``wheel 1``, ``pinion 2`` and ``wheel 2``, with a shaft.

    `pair` as of `idler`: I / r^2 of each stage follows from it. Other options are those of
    `GearTrain`.
    """
    stages, sizes = (teeth[:2], teeth[2:]), [modules[i // 2] for i in range(4)]
    support = support_stiffness, structural_damping
    gears = _Gears(pair, stages, sizes, pressure_angle, reduced_inertias, masses, *support)
    # The shaft turns clockwise, and the second wheel counterclockwise against its load.
    out = -pair.load * gears.radii[1] / gears.radii[2]
    bodies = [
        gears.body(0, "pinion 1", pair.load),
        gears.body(1, "wheel 1"),
        gears.body(2, "pinion 2"),
        gears.body(3, "wheel 2", out),
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
    """Return the reducer with double satellites whose axes stand still in the housing.

    Bodies are called ``input``, ``output``, ``satellite 1 a``, ``satellite 1 b``, ...; the meshes
    of branch i ``first i`` (input and a) and ``second i`` (b and output). Every mesh is `pair`, a
    `GearPair`, whose load acts on each of the first stage; other options are those of `GearTrain`.

    Raises
    ------
    ValueError
        If a value is impossible or the two stages have different centre distances.
    """
    n = branches
    z = teeth or ((24, 36, 24, 84) if internal else (24, 36, 24, 36))
    sizes, support = [modules[i // 2] for i in range(4)], (support_stiffness, structural_damping)
    gears = _Gears(pair, [z], sizes, pressure_angle, reduced_inertias, masses, *support)
    centres = sizes[0] * (z[0] + z[1]), sizes[2] * (z[3] - z[2] if internal else z[3] + z[2])
    if abs(centres[0] - centres[1]) > 1e-9 * centres[0]:
        raise ValueError(
            f"teeth = {z!r} is not allowed: both stages must have one centre distance, and it is "
            f"{centres[0] / 2.0:.6g} m in the first, {centres[1] / 2.0:.6g} m in the second"
        )
    errors = checks.many("pin_errors", pin_errors or [(0.0, 0.0)] * n, n)
    gaps = checks.many("backlashes", backlashes or [(pair.backlash,) * 2] * n, n)
    # The satellites turn clockwise. They push an external output counterclockwise, against its
    # load, and a ring gear clockwise.
    out = n * pair.load * gears.radii[1] / gears.radii[2] * (1.0 if internal else -1.0)
    bodies = [gears.body(0, "input", n * pair.load), gears.body(3, "output", out)]
    first, second, shafts = [], [], []
    for i, ((radial, tangential), (first_gap, second_gap)) in enumerate(
        zip(errors, gaps, strict=True)
    ):
        psi = 2.0 * math.pi * i / n
        a, b = f"satellite {i + 1} a", f"satellite {i + 1} b"
        c, s = math.cos(psi), math.sin(psi)
        offset = c * radial - s * tangential, s * radial + c * tangential
        bodies += [gears.body(1, a, offset=offset), gears.body(2, b, offset=offset)]
        name = f"first {i + 1}"
        first.append(gears.mesh("input", a, name=name, position=psi, backlash=first_gap))
        side = (
            {"internal": True, "position": psi}
            if internal
            else {"position": psi + math.pi, "direction": -1}
        )
        name = f"second {i + 1}"
        second.append(gears.mesh(b, "output", name=name, backlash=second_gap, **side))
        shafts.append(gears.shaft(a, b, shaft_stiffness))
    return train_of(bodies=bodies, meshes=first + second, shafts=shafts, **options)
