"""Trains with equal meshes: an idler train, two stages, and the reducer of the paper.

By default, the reduced inertias I / r^2 of a stage are proportional to z^2, as for discs of equal
width, and scaled so that the first mesh has the reduced mass of the pair.

Hortel & Skuderova, Engineering Mechanics 14 (2007) 91-104, Fig. 1 a, mention a pseudoplanetary
reducer with three double satellites and split power flow, but give only the parameters of one mesh.
All other parameters are choices:

* tooth numbers 24 : 36 in the first stage and 24 : 36 (external) or 24 : 84 (ring gear) in the
  second stage, with a module of 4 mm. The centre distances are equal, the branches are in phase,
  and three periods of the first mesh are two periods of the second;
* the load of the pair on each mesh of the first stage, and masses of 2 I / r^2, as for discs;
* shafts of 1e6 N m/rad, as of steel with a diameter of 60 mm and a length of 100 mm;
* bearings of 1e9 N/m for all gears, about three times the stiffness of a mesh.
"""

import math
from typing import Annotated, Any

from annotated_types import Ge, Le

from gearlib import checks, parameters
from gearlib.models.trains.elements import Body, Mesh, Shaft
from gearlib.parameters import (
    Angle,
    Backlash,
    Boolean,
    Error,
    Mass,
    Module,
    PressureAngle,
    ShaftStiffness,
    Support,
    Teeth,
    Time,
    Values,
    checked,
    described,
)

#: Default damping of supports and shafts over their stiffness, s.
STRUCTURAL_DAMPING = 1e-6
#: Default working pressure angle, rad.
PRESSURE_ANGLE = math.radians(20.0)
_INERTIA_DESCRIPTION = (
    "Moment of inertia of each gear over its squared base radius; by default proportional to the "
    "squared number of teeth"
)
_MASS_DESCRIPTION = "Mass of each gear; by default the mass of a disc with this inertia"

StructuralDamping = Annotated[
    Time, described("Ratio of damping to stiffness for supports and shafts")
]
SupportStiffness = Annotated[
    Support, described("Stiffness of the support of each gear along x and y")
]
TorsionalShaftStiffness = Annotated[ShaftStiffness, described("Torsional stiffness of each shaft")]
Modules = Annotated[
    tuple[Module, ...], Values(2), described("Modules of the first and the second stage")
]
PinErrors = Annotated[
    tuple[Annotated[tuple[Error, ...], Values(2)], ...] | None,
    Values(),
    described("Radial and tangential offsets of the axes of the planets or satellites by assembly"),
]
FourReducedInertias = Annotated[tuple[Mass, ...] | None, Values(4), described(_INERTIA_DESCRIPTION)]
FourMasses = Annotated[tuple[Mass, ...] | None, Values(4), described(_MASS_DESCRIPTION)]


def create_train(**fields: Any) -> Any:
    """Create a `GearTrain` from its fields, such as bodies, meshes and shafts."""
    # Imported here, because reading a configuration needs only the signatures in this module.
    from gearlib.models.trains.train import GearTrain

    return GearTrain(**fields)


def proportional_damping(stiffness: float, structural_damping: float) -> float:
    """Return the stiffness-proportional damping of a spring, or 0 if the spring is rigid.

    `stiffness` is in N/m or N m/rad, infinite for a rigid support, and `structural_damping` is the
    ratio of damping to stiffness in s. The result is in N s/m or N m s/rad.
    """
    return structural_damping * stiffness if stiffness < math.inf else 0.0


class _GearSet:
    """Gears on equal supports whose meshes all have the parameters of one `GearPair`."""

    def __init__(self, pair, stages, modules, pressure_angle, inertias, masses, support):
        """Compute the reduced inertias I / r^2, masses and base radii r of the gears.

        `pair` is the `GearPair` with the parameters of all meshes. `stages` lists the tooth numbers
        of the gears of each stage; `modules` (m), reduced `inertias` (kg) and `masses` (kg) are
        sequences over all gears in the same order. If inertias or masses are None, the gears are
        discs. `pressure_angle` is in rad. `support` is the pair (stiffness of the supports in N/m,
        ratio of damping to stiffness in s).
        """
        from gearlib.models.pair import GearPair

        checks.require(isinstance(pair, GearPair), "pair", pair, "a GearPair")
        self.pair = pair
        self.support_stiffness, self.structural_damping = support
        self.pressure_angle = pressure_angle
        self.teeth = [z for stage in stages for z in stage]
        if inertias:
            self.reduced_inertias = inertias
        else:
            self.reduced_inertias = []
            for stage in stages:
                # For discs I / r^2 is proportional to z^2. The reduced mass of the first two gears
                # is the reduced mass of the pair.
                inverse_sum = 1.0 / stage[0] ** 2 + 1.0 / stage[1] ** 2
                factor = pair.reduced_mass * inverse_sum
                self.reduced_inertias += [factor * z**2 for z in stage]
        # The inertia of a disc is I = m r^2 / 2, so that its mass is 2 I / r^2.
        self.masses = masses or [2.0 * inertia for inertia in self.reduced_inertias]
        self.base_radii = [
            module * z / 2.0 * math.cos(pressure_angle)
            for module, z in zip(modules, self.teeth, strict=True)
        ]

    def body(self, i: int, name: str, force: float = 0.0, **fields: Any) -> Body:
        """Create the `Body` called `name` for the gear with the index `i`.

        `force` is the tangential force on its base circle in N, positive counterclockwise. `fields`
        are further fields of `Body`.
        """
        return Body(
            name=name,
            teeth=self.teeth[i],
            base_radius=self.base_radii[i],
            inertia=self.reduced_inertias[i] * self.base_radii[i] ** 2,
            mass=self.masses[i],
            torque=force * self.base_radii[i],
            support_stiffness=self.support_stiffness,
            support_damping=proportional_damping(self.support_stiffness, self.structural_damping),
            **fields,
        )

    def mesh(self, pinion: str, wheel: str, **fields: Any) -> Mesh:
        """Create the `Mesh` of two gears with the stiffness, damping and backlash of the pair.

        `pinion` and `wheel` are names of bodies; `fields` are fields of `Mesh` that override the
        values of the pair.
        """
        names = ("max_stiffness", "stiffness_ratio", "contact_ratio", "backlash")
        names += ("material_damping", "backlash_damping")
        pair_fields = {name: getattr(self.pair, name) for name in names}
        pair_fields["pressure_angle"] = self.pressure_angle
        return Mesh(pinion=pinion, wheel=wheel, **(pair_fields | fields))

    def shaft(self, body_1: str, body_2: str, stiffness: float) -> Shaft:
        """Create the `Shaft` between two named bodies, with a torsional stiffness in N m/rad."""
        damping = proportional_damping(stiffness, self.structural_damping)
        return Shaft(bodies=(body_1, body_2), stiffness=stiffness, damping=damping)


@checked
def idler(
    pair,
    *,
    teeth: Annotated[
        tuple[Teeth, ...], Values(3), described("Numbers of teeth of pinion, idler and wheel")
    ] = (24, 24, 24),
    angle: Annotated[
        Angle, described("Angle between the lines of centres at the idler; pi for gears in a row")
    ] = math.pi,
    module: Annotated[Module, described("Module of all gears")] = 0.004,
    reduced_inertias: Annotated[
        tuple[Mass, ...] | None, Values(3), described(_INERTIA_DESCRIPTION)
    ] = None,
    masses: Annotated[tuple[Mass, ...] | None, Values(3), described(_MASS_DESCRIPTION)] = None,
    support_stiffness: SupportStiffness = math.inf,
    structural_damping: StructuralDamping = STRUCTURAL_DAMPING,
    pressure_angle: PressureAngle = PRESSURE_ANGLE,
    **options,
):
    """Return a train of three gears, ``pinion``, ``idler`` and ``wheel``, with two meshes.

    Both meshes have the stiffness, damping, backlash and load of `pair`, a `GearPair`; the first
    mesh also has its reduced mass. Other options are passed to `GearTrain`.
    """
    support = support_stiffness, structural_damping
    gears = _GearSet(pair, [teeth], [module] * 3, pressure_angle, reduced_inertias, masses, support)
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
    return create_train(bodies=bodies, meshes=meshes, **options)


@checked
def two_stage(
    pair,
    *,
    teeth: Annotated[
        tuple[Teeth, ...],
        Values(4),
        described("Numbers of teeth of pinion and wheel of each stage"),
    ] = (24, 36, 24, 36),
    modules: Modules = (0.004, 0.004),
    shaft_stiffness: TorsionalShaftStiffness = 1e6,
    reduced_inertias: FourReducedInertias = None,
    masses: FourMasses = None,
    support_stiffness: SupportStiffness = math.inf,
    structural_damping: StructuralDamping = STRUCTURAL_DAMPING,
    pressure_angle: PressureAngle = PRESSURE_ANGLE,
    **options,
):
    """Return a train of two gear stages: ``pinion 1``, ``wheel 1``, ``pinion 2`` and ``wheel 2``.

    A shaft joins wheel 1 and pinion 2. Both meshes have the stiffness, damping, backlash and
    reduced mass of `pair`, a `GearPair`, whose load acts on the first mesh. Other options are
    passed to `GearTrain`.
    """
    stages = teeth[:2], teeth[2:]
    gear_modules = [modules[0], modules[0], modules[1], modules[1]]
    support = support_stiffness, structural_damping
    gears = _GearSet(pair, stages, gear_modules, pressure_angle, reduced_inertias, masses, support)
    # The shaft transmits the torque of wheel 1. Wheel 2 rotates counterclockwise, so that its load
    # is negative.
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
    return create_train(bodies=bodies, meshes=meshes, shafts=shafts, **options)


@checked
def split_power_reducer(
    pair,
    *,
    branches: Annotated[
        int,
        Ge(1),
        Le(100),
        parameters.INTEGER,
        described("Number of double satellites, equally spaced"),
    ] = 3,
    teeth: Annotated[
        tuple[Teeth, ...] | None,
        Values(4),
        described(
            "Numbers of teeth of input, both gears of a satellite, and output; by default "
            "(24, 36, 24, 36), with a ring gear (24, 36, 24, 84)"
        ),
    ] = None,
    internal: Annotated[Boolean, described("Whether the output is a ring gear")] = False,
    modules: Modules = (0.004, 0.004),
    pressure_angle: PressureAngle = PRESSURE_ANGLE,
    reduced_inertias: FourReducedInertias = None,
    masses: FourMasses = None,
    shaft_stiffness: TorsionalShaftStiffness = 1e6,
    support_stiffness: SupportStiffness = 1e9,
    structural_damping: StructuralDamping = STRUCTURAL_DAMPING,
    pin_errors: PinErrors = None,
    backlashes: Annotated[
        tuple[Annotated[tuple[Backlash, ...], Values(2)], ...] | None,
        Values(),
        described(
            "Backlashes of the first and second mesh of each branch; by default the backlash of "
            "the pair"
        ),
    ] = None,
    **options,
):
    """Return the split-power reducer of the paper, with double satellites on fixed axes.

    Bodies are called ``input``, ``output``, ``satellite 1 a``, ``satellite 1 b``, ...; the meshes
    of branch i are ``first i`` (input and a) and ``second i`` (b and output). All meshes have the
    parameters of `pair`, a `GearPair`, whose load acts on each mesh of the first stage. Other
    options are passed to `GearTrain`.

    Raises
    ------
    ValueError
        If a value is impossible or the two stages have different centre distances.
    """
    n = branches
    if teeth is None:
        teeth = (24, 36, 24, 84) if internal else (24, 36, 24, 36)
    gear_modules = [modules[0], modules[0], modules[1], modules[1]]
    support = support_stiffness, structural_damping
    gears = _GearSet(pair, [teeth], gear_modules, pressure_angle, reduced_inertias, masses, support)
    # Compare twice the centre distances, which are sums or differences of pitch diameters.
    diameter_sum_1 = modules[0] * (teeth[0] + teeth[1])
    diameter_sum_2 = modules[1] * (teeth[3] - teeth[2] if internal else teeth[3] + teeth[2])
    if abs(diameter_sum_1 - diameter_sum_2) > 1e-9 * diameter_sum_1:
        raise ValueError(
            f"teeth = {teeth!r} is not allowed: both stages must have the same centre distance, "
            f"but it is {diameter_sum_1 / 2.0:.6g} m in the first stage and "
            f"{diameter_sum_2 / 2.0:.6g} m in the second stage"
        )
    pin_errors = [(0.0, 0.0)] * n if pin_errors is None else pin_errors
    pin_errors = checks.check_sequence("pin_errors", pin_errors, n)
    backlashes = [(pair.backlash,) * 2] * n if backlashes is None else backlashes
    backlashes = checks.check_sequence("backlashes", backlashes, n)
    # The satellites rotate clockwise. They drive an external output gear counterclockwise and a
    # ring gear clockwise; the load has the opposite direction.
    output_force = n * pair.load * gears.base_radii[1] / gears.base_radii[2]
    output_force *= 1.0 if internal else -1.0
    bodies = [gears.body(0, "input", n * pair.load), gears.body(3, "output", output_force)]
    first_meshes, second_meshes, shafts = [], [], []
    for i in range(n):
        angle = 2.0 * math.pi * i / n
        gear_a, gear_b = f"satellite {i + 1} a", f"satellite {i + 1} b"
        cosine, sine = math.cos(angle), math.sin(angle)
        radial, tangential = pin_errors[i]
        offset = cosine * radial - sine * tangential, sine * radial + cosine * tangential
        bodies += [gears.body(1, gear_a, offset=offset), gears.body(2, gear_b, offset=offset)]
        fields = {"name": f"first {i + 1}", "backlash": backlashes[i][0], "position": angle}
        first_meshes.append(gears.mesh("input", gear_a, **fields))
        fields = {"name": f"second {i + 1}", "backlash": backlashes[i][1]}
        if internal:
            fields |= {"position": angle, "internal": True}
        else:
            fields |= {"position": angle + math.pi, "direction": -1}
        second_meshes.append(gears.mesh(gear_b, "output", **fields))
        shafts.append(gears.shaft(gear_a, gear_b, shaft_stiffness))
    meshes = first_meshes + second_meshes
    return create_train(bodies=bodies, meshes=meshes, shafts=shafts, **options)
