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
    """Teeth of the rack of ISO 53, full at the tips; a positive shift is towards these."""

    teeth: int
    shift: float = 0.0
    internal: bool = False
    module: float = 3e-3
    angle: float = math.radians(20.0)

    def __post_init__(self):
        self.sign = -1 if self.internal else 1
        self.pitch = math.tau / self.teeth
        radius = self.module * self.teeth / 2.0
        self.base = radius * math.cos(self.angle)
        self.tip = radius + self.sign * self.module * (1.0 + self.shift)
        thickness = self.module * (math.pi / 2.0 + 2.0 * self.shift * math.tan(self.angle))
        #: Half the angle of a tooth on the base circle, to which no ring gear reaches.
        self.half = thickness / radius / 2.0 + self.sign * involute(self.angle)

    def half_at(self, working):
        """Return half the angle of a tooth where the pressure angle is `working`."""
        return self.half - self.sign * involute(working)


def involute(angle):
    return math.tan(angle) - angle


def distance(one, other, loose=0.0):
    """Return a centre distance: where teeth leave no play, and so many modules looser."""
    sign = one.sign * other.sign
    low, high = 1e-3, 1.2
    for _ in range(100):
        working = (low + high) / 2.0
        filled = sum(gear.half_at(working) * gear.teeth for gear in (one, other))
        # Play grows with the distance, inside a ring gear it shrinks.
        low, high = (low, working) if (filled < math.pi) == (sign > 0) else (working, high)
    return abs(one.base + sign * other.base) / math.cos(working) + sign * loose * one.module


class Flanks:
    """Both gears of a mesh, first the one that drives, as they touch in drive or on the coast side.

    Parameters
    ----------
    machine : Machine
    mesh : (str, str, float, float)
        Driving and driven gear, distance of the axes, angle from the first axis to the second.
    """

    def __init__(self, machine, mesh, coast=False):
        self.names, (apart, ahead) = mesh[:2], mesh[2:]
        self.gears = [machine.gears[name] for name in self.names]
        self.speeds = [machine.speed[name] for name in self.names]
        signs = [gear.sign for gear in self.gears]
        # What drives pushes with the flanks that face forwards. Two external gears touch with those
        # of one side, a ring gear has the other side than its mate.
        self.sides = [math.copysign(1.0, self.speeds[0]) * (-1.0 if coast else 1.0)] * 2
        self.sides[1] *= signs[0] * signs[1]
        self.axes = [0j, cmath.rect(apart, ahead)]
        one, other = (sign * gear.base for sign, gear in zip(signs, self.gears, strict=True))
        self.working = math.acos(abs(one + other) / apart)
        # From each axis to the teeth in mesh: towards the other one, or away from that of a ring.
        self.places = [
            ahead if signs[1] > 0 else ahead + math.pi,
            ahead + math.pi if signs[0] > 0 else ahead,
        ]
        self.feet = [
            place - sign * side * self.working
            for place, sign, side in zip(self.places, signs, self.sides, strict=True)
        ]
        # Touching in drive, back flanks are apart. They touch if each gear has half of the play.
        play = math.pi - sum(gear.half_at(self.working) * gear.teeth for gear in self.gears)
        self.more = [play / gear.teeth if coast else 0.0 for gear in self.gears]

    def point(self, i, middle):
        """Return where the flank of a tooth of gear i at this angle crosses the line of action."""
        gear, side, foot = self.gears[i], self.sides[i], self.feet[i]
        # The normal of the involute touches the base circle where it unwinds from.
        roll = gear.sign * (gear.half + self.more[i] + side * (middle - foot))
        return self.axes[i] + gear.base * cmath.exp(1j * foot) * (1 + 1j * gear.sign * side * roll)

    def middle(self, i, point):
        """Return the angle of a tooth of gear i whose flank crosses the line of action there."""
        gear, side, foot = self.gears[i], self.sides[i], self.feet[i]
        along = (point - self.axes[i]) * cmath.exp(-1j * foot) / gear.base
        assert abs(along.real - 1.0) < 1e-9, "the line of action touches both base circles"
        return foot + side * (side * along.imag - gear.half - self.more[i])

    def tip(self, i):
        """Return where the tip circle of gear i cuts the path of contact."""
        gear, side, foot = self.gears[i], self.sides[i], self.feet[i]
        roll = math.sqrt((gear.tip / gear.base) ** 2 - 1.0)
        return self.axes[i] + gear.base * cmath.exp(1j * foot) * (1 + 1j * gear.sign * side * roll)

    @property
    def pitch_point(self):
        """Return the point at which both gears move alike."""
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
        In which the first gear of the first mesh turns.
    """

    def __init__(self, gears, meshes, shafts=(), sense=1):
        self.gears, self.meshes, self.shafts = gears, meshes, shafts
        first = meshes[0]
        name = first[0]
        self.speed = {name: sense * gears[name].pitch}
        self._spread(self._turn, self._turn_shaft)
        self.middles = {name: 0.0}
        # As if the first mesh had any phase, then turned back to have none.
        self.middles = {name: self.speed[name] * self.phase(first)}
        self._nearest(first, 0)
        self._spread(self._fit, self._key)

    def _spread(self, over_mesh, over_shaft):
        """Go from gear to gear, by all meshes before the next shaft."""
        while any([over_mesh(mesh) for mesh in self.meshes]) or any(map(over_shaft, self.shafts)):
            pass

    def _turn(self, mesh):
        one, other = (self.gears[name] for name in mesh[:2])
        return self._ratio(mesh, -one.sign * other.sign * one.teeth / other.teeth)

    def _turn_shaft(self, shaft):
        return self._ratio(shaft, 1.0)

    def _ratio(self, ends, ratio):
        one, other = ends[:2]
        known = one in self.speed, other in self.speed
        if known == (True, False):
            self.speed[other] = self.speed[one] * ratio
        elif known == (False, True):
            self.speed[one] = self.speed[other] / ratio
        return known[0] != known[1]

    def _fit(self, mesh):
        known = [name in self.middles for name in mesh[:2]]
        if known[0] == known[1]:
            return False
        i, flanks = known.index(True), Flanks(self, mesh)
        point = flanks.point(i, self.middles[mesh[i]])
        self.middles[mesh[1 - i]] = flanks.middle(1 - i, point)
        self._nearest(mesh, 1 - i)
        return True

    def _nearest(self, mesh, i):
        """Count from the tooth nearest to the line of centres; of two, that on the drive side."""
        flanks, name = Flanks(self, mesh), mesh[i]
        side, pitch = flanks.sides[i], self.gears[name].pitch
        ahead = side * (self.middles[name] - flanks.places[i]) / pitch
        self.middles[name] -= side * pitch * math.ceil(ahead - 0.5 - CLOSE)

    def _key(self, shaft):
        one, other, angle = shaft
        known = one in self.middles, other in self.middles
        if known == (True, False):
            self.middles[other] = self.middles[one] + angle
        elif known == (False, True):
            self.middles[one] = self.middles[other] - angle
        return known[0] != known[1]

    def passes(self, mesh, coast=False):
        """Return when a pair of teeth comes into contact, passes the pitch point, and leaves.

        In periods of the mesh, after the start.
        """
        flanks = Flanks(self, mesh, coast)
        # Contact begins at the tip of the gear that is driven.
        points = [flanks.tip(1), flanks.pitch_point, flanks.tip(0)]
        times = []
        for i in (0, 1):
            name, gear = mesh[i], flanks.gears[i]
            if name in self.middles:
                turns = [flanks.middle(i, point) - self.middles[name] for point in points]
                period = gear.pitch / abs(self.speed[name])
                times.append([turn / self.speed[name] / period for turn in turns])
        if len(times) == 2:
            for one, other in zip(*times, strict=True):
                assert abs(one - other - round(one - other)) < CLOSE, "flanks touch all the while"
        if coast:
            # There the other gear drives.
            times[0].reverse()
            points.reverse()
        begin, pitch, end = times[0]
        assert begin < end, "contact runs to the tip of the gear that drives"
        near = (points[2] - points[0]) / 100.0
        before, after = (flanks.slip(points[1] + step) for step in (-near, near))
        assert (before / after).real < 0.0, "sliding turns at the pitch point"
        return begin, pitch, end

    def phase(self, mesh, coast=False):
        """Return the middle of the time in which there is one pair more, in mesh periods."""
        begin, _, end = self.passes(mesh, coast)
        return begin + (end - begin) % 1.0 / 2.0

    def pitch_phase(self, mesh, coast=False):
        """Return how long after that teeth touch at the pitch point, rad."""
        return math.tau * (self.passes(mesh, coast)[1] - self.phase(mesh, coast))
