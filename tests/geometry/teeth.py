"""A second code for the phases of gear trains: teeth in the plane, one by one; nothing of gearlib.

Gears have involutes on a base circle, cut at the tip circle. They are turned until flanks touch,
those on a shaft until teeth are in line. Where flanks cross the line of action, the common tangent
of both base circles, they touch; so contacts come and go with each tooth. Angles are
counterclockwise, complex numbers points of the plane, time is in periods of the first mesh.
"""

import cmath
import math
from dataclasses import dataclass

#: Of a pitch: rounding.
CLOSE = 1e-6


@dataclass
class Gear:
    """Teeth of the rack of ISO 53 without tip rounding; a positive shift is towards the tips."""

    teeth: int
    shift: float = 0.0
    internal: bool = False
    module: float = 3e-3
    pressure_angle: float = math.radians(20.0)

    def __post_init__(self):
        self.sign = -1 if self.internal else 1
        self.pitch = math.tau / self.teeth
        radius = self.module * self.teeth / 2.0
        self.base = radius * math.cos(self.pressure_angle)
        self.tip = radius + self.sign * self.module * (1.0 + self.shift)
        thickness = self.module * (math.pi / 2.0 + 2.0 * self.shift * math.tan(self.pressure_angle))
        #: Half the angle of a tooth with its involutes extended to the base circle.
        self.half_base_angle = thickness / radius / 2.0 + self.sign * involute(self.pressure_angle)

    def half_angle_at(self, working):
        """Return half the angle of a tooth where the pressure angle is `working`."""
        return self.half_base_angle - self.sign * involute(working)


def involute(angle):
    return math.tan(angle) - angle


def axis_distance(gear, mate, loosening=0.0):
    """Return the distance of the axes without backlash, made looser by some modules."""
    sign = gear.sign * mate.sign
    low, high = 1e-3, 1.2
    for _ in range(100):
        working = (low + high) / 2.0
        filled = sum(one.half_angle_at(working) * one.teeth for one in (gear, mate))
        # Play grows with the distance, inside a ring gear it shrinks.
        low, high = (low, working) if (filled < math.pi) == (sign > 0) else (working, high)
    return abs(gear.base + sign * mate.base) / math.cos(working) + sign * loosening * gear.module


class Flanks:
    """Both gears of a mesh, first the one that drives, as they touch in drive or, `coast`, behind.

    Parameters
    ----------
    machine : Machine
    mesh : (str, str, float, float)
        Driving and driven gear, distance of the axes, angle from the first axis to the second.
    """

    def __init__(self, machine, mesh, coast=False):
        self.names, (centre_distance, centre_line) = mesh[:2], mesh[2:]
        self.gears = [machine.gears[name] for name in self.names]
        self.speeds = [machine.speed[name] for name in self.names]
        signs = [gear.sign for gear in self.gears]
        # What drives pushes with the flanks that face forwards. Two external gears touch with those
        # of one side, a ring gear has the other side than its mate.
        self.sides = [math.copysign(1.0, self.speeds[0]) * (-1.0 if coast else 1.0)] * 2
        self.sides[1] *= signs[0] * signs[1]
        self.axes = [0j, cmath.rect(centre_distance, centre_line)]
        radii = [sign * gear.base for sign, gear in zip(signs, self.gears, strict=True)]
        self.working = math.acos(abs(sum(radii)) / centre_distance)
        # From each axis to the teeth in mesh: away from the other axis where that is a ring gear's.
        self.mesh_angles = [
            centre_line if signs[1] > 0 else centre_line + math.pi,
            centre_line + math.pi if signs[0] > 0 else centre_line,
        ]
        #: Angles from each axis to where the line of action touches the base circle.
        self.tangent_angles = [
            mesh_angle - sign * side * self.working
            for mesh_angle, sign, side in zip(self.mesh_angles, signs, self.sides, strict=True)
        ]
        # While drive flanks touch, coast flanks have all the play: by these angles on each gear.
        play = math.pi - sum(gear.half_angle_at(self.working) * gear.teeth for gear in self.gears)
        self.backlash_angles = [play / gear.teeth if coast else 0.0 for gear in self.gears]

    def point(self, i, tooth_angle):
        """Return where the flank of a tooth of gear i at this angle crosses the line of action."""
        gear, side = self.gears[i], self.sides[i]
        # The normal of the involute touches the base circle where it unwinds from.
        half = gear.half_base_angle + self.backlash_angles[i]
        roll = half + side * (tooth_angle - self.tangent_angles[i])
        return self._on_line_of_action(i, gear.sign * roll)

    def tooth_angle(self, i, point):
        """Return the angle of the tooth of gear i whose flank crosses the line of action there."""
        gear, side, tangent_angle = self.gears[i], self.sides[i], self.tangent_angles[i]
        along = (point - self.axes[i]) * cmath.exp(-1j * tangent_angle) / gear.base
        assert abs(along.real - 1.0) < 1e-9, "the point must lie on the common tangent"
        half = gear.half_base_angle + self.backlash_angles[i]
        return tangent_angle + side * (side * along.imag - half)

    def tip(self, i):
        """Return where the tip circle of gear i cuts the path of contact."""
        gear = self.gears[i]
        return self._on_line_of_action(i, math.sqrt((gear.tip / gear.base) ** 2 - 1.0))

    def _on_line_of_action(self, i, roll):
        """Return the point of the line of action up to which gear i has rolled by an angle."""
        gear, foot = self.gears[i], cmath.exp(1j * self.tangent_angles[i])
        return self.axes[i] + gear.base * foot * (1 + 1j * gear.sign * self.sides[i] * roll)

    @property
    def pitch_point(self):
        """Return the point at which both gears have one velocity."""
        (a, b), (u, v) = self.axes, self.speeds
        return (v * b - u * a) / (v - u)

    def slip(self, point):
        """Return the velocity of the first gear over the second at a point."""
        return sum(
            1j * sign * speed * (point - axis)
            for sign, speed, axis in zip((1, -1), self.speeds, self.axes, strict=True)
        )


class Machine:
    """Gears placed so that the first mesh has the middle of its double contact at time 0.

    Parameters
    ----------
    gears : dict of name -> Gear
    meshes : list of (str, str, float, float)
        See `Flanks`.
    shafts : list of (name, name, float)
        With the angle by which the second is keyed ahead.
    sense : {1, -1}
        1 where the first gear of the first mesh turns counterclockwise.
    """

    def __init__(self, gears, meshes, shafts=(), sense=1):
        self.gears, self.meshes, self.shafts = gears, meshes, shafts
        first, name = meshes[0], meshes[0][0]
        #: Name -> rad per period of the first mesh, and angle of one tooth at time 0.
        self.speed, self.tooth_angles = {name: sense * gears[name].pitch}, {name: 0.0}
        self._spread(self._turn_mates, self._turn_shaft)
        # With a tooth at angle 0 the first mesh has some phase: the gear is turned back by it.
        self.tooth_angles = {name: self.speed[name] * self.phase(first)}
        self._choose_reference_tooth(first, 0)
        self._spread(self._place_mate, self._place_on_shaft)

    def _spread(self, over_mesh, over_shaft):
        """Apply both until they change nothing, over all meshes before the next shaft."""
        while any([over_mesh(mesh) for mesh in self.meshes]) or any(map(over_shaft, self.shafts)):
            pass

    def _turn_mates(self, mesh):
        gear, mate = (self.gears[name] for name in mesh[:2])
        return self._propagate_speed(mesh, -gear.sign * mate.sign * gear.teeth / mate.teeth)

    def _turn_shaft(self, shaft):
        return self._propagate_speed(shaft, 1.0)

    def _propagate_speed(self, ends, ratio):
        """Set the speed of one end if only that of the other is known; return whether it was."""
        first, second = ends[:2]
        known = first in self.speed, second in self.speed
        if known == (True, False):
            self.speed[second] = self.speed[first] * ratio
        elif known == (False, True):
            self.speed[first] = self.speed[second] / ratio
        return known[0] != known[1]

    def _place_mate(self, mesh):
        """Place a tooth of one gear on a flank of the other, the only placed one; return if so."""
        known = [name in self.tooth_angles for name in mesh[:2]]
        if known[0] == known[1]:
            return False
        i, flanks = known.index(True), Flanks(self, mesh)
        point = flanks.point(i, self.tooth_angles[mesh[i]])
        self.tooth_angles[mesh[1 - i]] = flanks.tooth_angle(1 - i, point)
        self._choose_reference_tooth(mesh, 1 - i)
        return True

    def _choose_reference_tooth(self, mesh, i):
        """Count from the tooth nearest to the line of centres; of two, that on the drive side."""
        flanks, name = Flanks(self, mesh), mesh[i]
        side, pitch = flanks.sides[i], self.gears[name].pitch
        pitches_ahead = side * (self.tooth_angles[name] - flanks.mesh_angles[i]) / pitch
        self.tooth_angles[name] -= side * pitch * math.ceil(pitches_ahead - 0.5 - CLOSE)

    def _place_on_shaft(self, shaft):
        """Place a tooth of one gear by its keying if only the other is placed; return whether."""
        first, second, keying = shaft
        known = first in self.tooth_angles, second in self.tooth_angles
        if known == (True, False):
            self.tooth_angles[second] = self.tooth_angles[first] + keying
        elif known == (False, True):
            self.tooth_angles[first] = self.tooth_angles[second] - keying
        return known[0] != known[1]

    def contact_times(self, mesh, coast=False):
        """Return when a pair of teeth comes into contact, passes the pitch point, and leaves.

        In periods of the mesh, after the start.
        """
        flanks = Flanks(self, mesh, coast)
        # Contact begins at the tip of the gear that is driven.
        points = [flanks.tip(1), flanks.pitch_point, flanks.tip(0)]
        times = []
        for i in (0, 1):
            name, gear = mesh[i], flanks.gears[i]
            if name in self.tooth_angles:
                placed = self.tooth_angles[name]
                turns = [flanks.tooth_angle(i, point) - placed for point in points]
                period = gear.pitch / abs(self.speed[name])
                times.append([turn / self.speed[name] / period for turn in turns])
        if len(times) == 2:
            for first, second in zip(*times, strict=True):
                difference = first - second
                assert abs(difference - round(difference)) < CLOSE, "flanks do not stay in touch"
        if coast:
            # There the other gear drives.
            times[0].reverse()
            points.reverse()
        begin, pitch, end = times[0]
        assert begin < end, "contact must end at the tip of the gear that drives"
        step = (points[2] - points[0]) / 100.0
        before, after = (flanks.slip(points[1] + offset) for offset in (-step, step))
        assert (before / after).real < 0.0, "sliding must turn at the pitch point"
        return begin, pitch, end

    def phase(self, mesh, coast=False):
        """Return the middle of the time in which there is one pair more, in mesh periods."""
        begin, _, end = self.contact_times(mesh, coast)
        return begin + (end - begin) % 1.0 / 2.0

    def pitch_phase(self, mesh, coast=False):
        """Return how long after its `phase` teeth touch at the pitch point, rad."""
        return math.tau * (self.contact_times(mesh, coast)[1] - self.phase(mesh, coast))
