"""Parts of ready-made trains: gears by module and teeth, meshes by a `GearPair`."""

import math
from typing import Annotated

from gearlib.models.trains.elements import Body, Mesh, Shaft
from gearlib.parameters import (
    ERROR,
    MASS,
    MODULE,
    SHAFT_STIFFNESS,
    SUPPORT,
    TIME,
    TRUTH,
    Instance,
    Many,
    OneOf,
)

#: Of supports and shafts, s times their stiffness: choice, as in the trial of speed.
STRUCTURAL_DAMPING = 1e-6
#: In operation, rad.
PRESSURE_ANGLE = math.radians(20.0)

StructuralDamping = Annotated[float, TIME, "Damping of supports and shafts over their stiffness"]
AxisStiffness = Annotated[float, SUPPORT, "Of all axes"]
ShaftStiffness = Annotated[float, SHAFT_STIFFNESS, "Of each shaft against torsion"]
Modules = Annotated[tuple, Many(MODULE, 2), "Of both stages"]
PinErrors = Annotated[
    tuple | None,
    Many(Many(ERROR, 2)),
    "By how much the axis of each is misplaced, radial and tangential",
]
#: Of a planetary set.
SetSupports = Annotated[tuple, Many(SUPPORT, 4), "Of sun, ring, carrier and planets"]
SetTwists = Annotated[
    tuple, Many(SUPPORT, 3), "Of the supports of sun, ring and carrier at their radius"
]
Turning = Annotated[bool, TRUTH, "Whether the carrier turns and the ring stands: decides the rpm"]
Driving = Annotated[
    str,
    OneOf(("sun", "ring")),
    'Which gear drives, seen from the carrier; "ring" also where the carrier drives the sun',
]
Gyroscopic = Annotated[
    bool, TRUTH, "Whether axes that can move feel the turning frame, Coriolis and centrifugal"
]
#: Of three or four gears.
_REDUCED, _MASSES = (
    "I / r^2 of each; by default in proportion to z^2",
    "Of each gear; by default twice I / r^2, as of discs",
)
ThreeReduced = Annotated[tuple | None, Many(MASS, 3), _REDUCED]
FourReduced = Annotated[tuple | None, Many(MASS, 4), _REDUCED]
ThreeMasses = Annotated[tuple | None, Many(MASS, 3), _MASSES]
FourMasses = Annotated[tuple | None, Many(MASS, 4), _MASSES]


def pair_of(pair):
    """Return a `GearPair`, else raise ValueError."""
    # Here and below: a start of the workflow reads what is declared, and does not pay for models.
    from gearlib.models.pair import GearPair

    return Instance((GearPair,)).check("pair", pair)


def train_of(**parts):
    """Return a `GearTrain` of its bodies, meshes and shafts."""
    from gearlib.models.trains.train import GearTrain

    return GearTrain(**parts)


class Gears:
    """Gears in mesh as a pair, on equal bearings; one module, I / r^2 and mass for each."""

    def __init__(self, pair, teeth, modules, pressure_angle, reduced, masses, bearing):
        self.pair, self.teeth, self.pressure_angle = pair, teeth, pressure_angle
        self.reduced, self.bearing = reduced, support(*bearing)
        self.masses = masses or [2.0 * value for value in reduced]
        #: Of the base circles, m.
        self.radii = [
            module * z / 2.0 * math.cos(pressure_angle)
            for module, z in zip(modules, teeth, strict=True)
        ]

    def body(self, i, name, force=0.0, **more):
        """Return the gear of a number as a `Body`; the force acts at its base circle."""
        radius = self.radii[i]
        return Body(
            name=name,
            teeth=self.teeth[i],
            base_radius=radius,
            inertia=self.reduced[i] * radius**2,
            mass=self.masses[i],
            torque=force * radius,
            **self.bearing,
            **more,
        )

    def mesh(self, pinion, wheel, **more):
        """Return a `Mesh` with the values of the pair."""
        own = ("max_stiffness", "stiffness_ratio", "contact_ratio", "backlash", "material_damping")
        values = {name: getattr(self.pair, name) for name in (*own, "backlash_damping")}
        values["pressure_angle"] = self.pressure_angle
        return Mesh(pinion=pinion, wheel=wheel, **(values | more))


def shaft_of(bodies, stiffness, structural_damping):
    """Return a `Shaft` against torsion."""
    return Shaft(
        bodies=bodies, stiffness=stiffness, damping=damping_of(stiffness, structural_damping)
    )


def gear_masses(pair, first, second, *others):
    """Return I / r^2 in proportion to z^2, the first two gears with the reduced mass of a pair."""
    unit = pair.reduced_mass * (1.0 / first**2 + 1.0 / second**2)
    return [unit * z**2 for z in (first, second, *others)]


def support(stiffness, structural_damping):
    """Return the parameters of the support of a `Body`, N/m and N s/m."""
    damping = damping_of(stiffness, structural_damping)
    return dict(support_stiffness=stiffness, support_damping=damping)


def damping_of(stiffness, structural_damping):
    """Return the damping of a stiffness, N s/m; none of a rigid one."""
    return structural_damping * stiffness if stiffness < math.inf else 0.0
