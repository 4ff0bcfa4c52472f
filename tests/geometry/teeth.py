"""Phases of gear trains from the positions of teeth in the plane, computed without gearlib.

Flanks are involutes of the base circle, cut at the tip circle. Gears are rotated until flanks
touch, and gears on a common shaft until their teeth are aligned. Flanks touch where they cross the
line of action, the common tangent of both base circles, which gives the begin and the end of each
contact. Angles are counterclockwise, complex numbers are points of the plane, and time is in
periods of the first mesh.
"""

import cmath
import math
from dataclasses import dataclass

from scipy.optimize import brentq

MODULE, PRESSURE_ANGLE = 3e-3, math.radians(20.0)
#: Tolerance of positions, as a fraction of a pitch.
POSITION_TOLERANCE = 1e-6


@dataclass
class Gear:
    """Teeth of the rack of ISO 53 without tip rounding; a positive shift is towards the tips."""

    teeth: int
    shift: float = 0.0
    internal: bool = False

    def __post_init__(self):
        """Compute pitch, base radius, tip radius and tooth thickness."""
        self.sign = -1 if self.internal else 1
        self.pitch = math.tau / self.teeth
        radius = MODULE * self.teeth / 2.0
        self.base = radius * math.cos(PRESSURE_ANGLE)
        self.tip = radius + self.sign * MODULE * (1.0 + self.shift)
        thickness = MODULE * (math.pi / 2.0 + 2.0 * self.shift * math.tan(PRESSURE_ANGLE))
        #: Half the angle of a tooth with its involutes extended to the base circle.
        self.half_base_angle = thickness / radius / 2.0 + self.sign * involute(PRESSURE_ANGLE)


def involute(angle):
    """Return the involute function tan(angle) - angle."""
    return math.tan(angle) - angle


def circumferential_backlash(gears, working):
    """Return the circumferential backlash of two gears at a working pressure angle, in pitches."""
    half_angles = [gear.half_base_angle - gear.sign * involute(working) for gear in gears]
    return 0.5 - sum(
        half_angle / gear.pitch for half_angle, gear in zip(half_angles, gears, strict=True)
    )


def axis_distance(gear, mate, added_distance=0.0):
    """Return the centre distance without backlash, increased by `added_distance` modules."""
    sign = gear.sign * mate.sign
    working = brentq(
        lambda angle: circumferential_backlash((gear, mate), angle), 1e-3, 1.2, xtol=1e-14
    )
    return abs(gear.base + sign * mate.base) / math.cos(working) + sign * added_distance * MODULE


class FlankContact:
    """Geometry of the contact of two gears on the drive side or, if `coast`, on the coast side.

    A mesh is (driving gear, driven gear, distance of the axes, angle from the first to the second).
    """

    def __init__(self, placed_gears, mesh, coast=False):
        names, (centre_distance, centre_line) = mesh[:2], mesh[2:]
        self.gears = [placed_gears.gears[name] for name in names]
        self.speeds = [placed_gears.speed[name] for name in names]
        signs = [gear.sign for gear in self.gears]
        # The driving gear pushes with the flanks that face forwards. Two external gears touch with
        # flanks of the same side, a ring gear and its mate with flanks of opposite sides.
        side = math.copysign(1.0, self.speeds[0]) * (-1.0 if coast else 1.0)
        self.sides = [side, side * signs[0] * signs[1]]
        self.axes = [0j, cmath.rect(centre_distance, centre_line)]
        radii = [sign * gear.base for sign, gear in zip(signs, self.gears, strict=True)]
        working = math.acos(abs(sum(radii)) / centre_distance)
        # These angles point from each axis to the teeth in mesh, away from the axis of a ring gear.
        self.mesh_angles = [
            centre_line if signs[1] > 0 else centre_line + math.pi,
            centre_line + math.pi if signs[0] > 0 else centre_line,
        ]
        #: Angles from each axis to where the line of action touches the base circle.
        self.tangent_angles = [
            mesh_angle - sign * side * working
            for mesh_angle, sign, side in zip(self.mesh_angles, signs, self.sides, strict=True)
        ]
        # While drive flanks touch, all backlash is between the coast flanks.
        self.half_angles = [
            gear.half_base_angle
            + (gear.pitch * circumferential_backlash(self.gears, working) if coast else 0.0)
            for gear in self.gears
        ]

    def point(self, i, tooth_angle):
        """Return the point at which the flank of a tooth of gear `i` crosses the line of action."""
        # The normal of an involute is tangent to the base circle.
        roll = self.half_angles[i] + self.sides[i] * (tooth_angle - self.tangent_angles[i])
        return self._on_line_of_action(i, self.gears[i].sign * roll)

    def tooth_angle(self, i, point):
        """Return the angle of the tooth of gear `i` whose flank passes a point of this line."""
        tangent_angle = self.tangent_angles[i]
        relative_point = (
            (point - self.axes[i]) * cmath.exp(-1j * tangent_angle) / self.gears[i].base
        )
        assert abs(relative_point.real - 1.0) < 1e-9, "the point must lie on the common tangent"
        return tangent_angle + relative_point.imag - self.sides[i] * self.half_angles[i]

    def tip(self, i):
        """Return the point at which the tip circle of gear `i` cuts the path of contact."""
        gear = self.gears[i]
        return self._on_line_of_action(i, math.sqrt((gear.tip / gear.base) ** 2 - 1.0))

    def _on_line_of_action(self, i, roll):
        """Return the point of the line of action up to which gear `i` has rolled by an angle."""
        gear, foot = self.gears[i], cmath.exp(1j * self.tangent_angles[i])
        return self.axes[i] + gear.base * foot * (1 + 1j * gear.sign * self.sides[i] * roll)

    @property
    def pitch_point(self):
        """Return the point at which both gears have the same velocity."""
        (a, b), (u, v) = self.axes, self.speeds
        return (v * b - u * a) / (v - u)

    def sliding_velocity(self, point):
        """Return the sliding velocity of the first gear relative to the second at a point."""
        (a, b), (u, v) = self.axes, self.speeds
        return 1j * (u * (point - a) - v * (point - b))


class PlacedGears:
    """Gears of a train, placed so that the first mesh is in the middle of double contact at time 0.

    Parameters
    ----------
    gears : dict of name -> Gear
    meshes : list of (str, str, float, float)
        See `FlankContact`.
    shafts : list of (name, name, float)
        The angle is that by which the second gear is keyed ahead of the first.
    rotation_direction : {1, -1}
        1 if the first gear of the first mesh rotates counterclockwise.
    """

    def __init__(self, gears, meshes, shafts=(), rotation_direction=1):
        self.gears, self.meshes, self.shafts = gears, meshes, shafts
        first, name = meshes[0], meshes[0][0]
        #: Speed of each gear by name, rad per period of the first mesh.
        self.speed = {name: rotation_direction * gears[name].pitch}
        self._propagate(self.speed, self._speed_of_mate, lambda shaft, i, speed: speed)
        # With a tooth at angle 0 the first mesh has some phase, by which the gear is turned back.
        self.tooth_angles = {name: 0.0}
        angle = self._reference_tooth(first, 0, self.speed[name] * self.phase(first))
        #: Angle of one tooth of each gear by name, at time 0.
        self.tooth_angles = {name: angle}
        self._propagate(self.tooth_angles, self._tooth_of_mate, self._tooth_on_shaft)

    def _propagate(self, values, over_mesh, over_shaft):
        """Complete the dict `values`, name -> number, along meshes and shafts.

        `over_mesh` and `over_shaft` return the value of the other gear from (link, index, value).
        """
        links = [(mesh, over_mesh) for mesh in self.meshes]
        links += [(shaft, over_shaft) for shaft in self.shafts]
        while True:
            for link, over in links:
                has_value = [name in values for name in link[:2]]
                if has_value[0] != has_value[1]:
                    i = has_value.index(True)
                    values[link[1 - i]] = over(link, i, values[link[i]])
                    break
            else:
                return

    def _speed_of_mate(self, mesh, i, speed):
        """Return the speed of the mate of gear `i` of a mesh."""
        gear, mate = self.gears[mesh[i]], self.gears[mesh[1 - i]]
        return -speed * gear.sign * mate.sign * gear.teeth / mate.teeth

    def _tooth_of_mate(self, mesh, i, angle):
        """Return the angle of a tooth of the mate that touches a tooth of gear `i` of a mesh."""
        flanks = FlankContact(self, mesh)
        touching = flanks.tooth_angle(1 - i, flanks.point(i, angle))
        return self._reference_tooth(mesh, 1 - i, touching)

    def _reference_tooth(self, mesh, i, angle):
        """Return the angle of the tooth nearest to the line of centres, from any tooth of gear i.

        If two teeth are equally near, the one on the drive side counts.
        """
        flanks, pitch = FlankContact(self, mesh), self.gears[mesh[i]].pitch
        pitches_ahead = flanks.sides[i] * (angle - flanks.mesh_angles[i]) / pitch
        return angle - flanks.sides[i] * pitch * math.ceil(pitches_ahead - 0.5 - POSITION_TOLERANCE)

    def _tooth_on_shaft(self, shaft, i, angle):
        """Return the angle of the tooth of the other gear on a shaft that is keyed to a tooth."""
        return angle + (1 - 2 * i) * shaft[2]

    def contact_times(self, mesh, coast=False):
        """Return when a tooth pair begins contact, passes the pitch point and ends contact."""
        flanks, name = FlankContact(self, mesh, coast), mesh[0]
        points = [flanks.tip(1), flanks.pitch_point, flanks.tip(0)]
        rotations = [flanks.tooth_angle(0, point) - self.tooth_angles[name] for point in points]
        # Contact begins at the tip of the driven gear, which is the first gear on the coast side.
        pitch = math.copysign(self.gears[name].pitch, self.speed[name])
        return [rotation / pitch for rotation in (reversed(rotations) if coast else rotations)]

    def phase(self, mesh, coast=False):
        """Return the middle of the interval with one more pair in contact, in mesh periods."""
        begin, _, end = self.contact_times(mesh, coast)
        return begin + (end - begin) % 1.0 / 2.0

    def pitch_phase(self, mesh):
        """Return the time from `phase` to contact at the pitch point, in radians of the mesh."""
        return math.tau * (self.contact_times(mesh)[1] - self.phase(mesh))
