"""Rotation of the gears of a train: speeds from tooth numbers, mesh phases from positions.

The drive-side flanks of a mesh and the sense of rotation determine which gear drives through these
flanks. At the start, the middle of a tooth of a gear with z teeth lies o tooth pitches from angle
0. Its drive-side flank, half the tooth thickness s (in pitches) to the side f, reaches a pitch
point at the angle alpha after

    t = sign(w) (z alpha / 2 pi - o - f s / 2)   mesh periods, modulo 1,

with the speed w of the gear and f = 1 for counterclockwise flanks. At that time the stiffness is
past the middle of its upper level by `pitch_phase` if the pinion drives, and before it by as much
if the wheel drives. Both gears of a mesh have the same t. Around a loop of meshes the orientations
o must agree, or the train cannot be assembled: for equal satellites (z_s + z_r) psi_n / 2 pi must
be an integer. Parker, J. Sound Vib. 236 (2000) 561-573; Parker & Lin, J. Mech. Des. 126 (2004)
365-370. The teeth of gears on one shaft are in line, or apart by the angle of the keying, unless
loops of meshes require another angle. The tooth of the first gear is the tooth nearest to the line
of centres of the mesh that orients the gear.

On the coast side the other gear drives. If both gears share the backlash, coast-side flanks reach
the pitch point (1 + s_1 - s_2) / 2 periods after the drive-side flanks, where s_1 is the thickness
of the gear that drives on the drive side; Guo & Parker, Mech. Mach. Theory 78 (2014) 263-271.
"""

import math
from fractions import Fraction
from typing import NamedTuple

from gearlib import checks
from gearlib.models.trains.elements import Mesh, lies_in_housing

#: Largest misfit of teeth in pitches, which allows for positions rounded to few digits.
_POSITION_TOLERANCE = 1e-6
#: Largest denominator of the fraction that replaces the ratio of the frame speed, a float.
MAX_DENOMINATOR = 10_000_000


class Speeds(NamedTuple):
    """Signed speeds of the bodies of a train, in radians per radian of reference mesh phase."""

    in_frame: dict  #: body name -> speed relative to the frame of the positions, a `Fraction`
    frame: Fraction  #: speed of this frame in the housing

    @property
    def in_housing(self) -> dict[str, Fraction]:
        """Speeds of the bodies relative to the housing."""
        return {name: speed + self.frame for name, speed in self.in_frame.items()}

    def at(self, mesh: Mesh, bodies: dict) -> dict[str, Fraction]:
        """Return the speeds of all bodies relative to the line of centres of a mesh.

        This line stands still in the housing or in the rotating frame of the carriers. `bodies`
        maps names to `Body`, and the result maps names to speeds.
        """
        return self.in_housing if lies_in_housing(mesh, bodies) else self.in_frame


def speeds(bodies, meshes, shafts, reference, carrier_ratio) -> Speeds:
    """Compute the `Speeds` of the bodies of a train from the tooth numbers.

    Speeds are propagated from the reference pinion over meshes and shafts. `bodies` maps names to
    `Body`, `reference` is the name of the reference mesh, and `carrier_ratio` is the speed of the
    frame over the speed of the reference pinion in this frame. Bodies without a mesh or shaft have
    speed 0 in the frame. Raises ValueError for a locked train or an unconnected mesh.
    """
    reference_mesh = next(mesh for mesh in meshes if mesh.name == reference)
    frame_ratio = Fraction(carrier_ratio).limit_denominator(MAX_DENOMINATOR)
    # In a period of its mesh (2 pi of phase) the pinion turns by one of its teeth.
    reference_speed = Fraction(1, bodies[reference_mesh.pinion].teeth)
    if lies_in_housing(reference_mesh, bodies):
        reference_speed /= 1 + frame_ratio
    frame_speed = reference_speed * frame_ratio
    # Tuples (body 1, body 2, speed of body 2 over that of body 1 relative to their axes, speed of
    # the axes in the frame, name of the mesh or shaft).
    connections = []
    for mesh in meshes:
        ratio = Fraction(bodies[mesh.pinion].teeth, bodies[mesh.wheel].teeth)
        ratio *= 1 if mesh.internal else -1
        axes_speed = -frame_speed if lies_in_housing(mesh, bodies) else Fraction(0)
        connections.append((mesh.pinion, mesh.wheel, ratio, axes_speed, f"mesh {mesh.name}"))
    for shaft in shafts:
        shaft_name = f"shaft {'-'.join(shaft.bodies)}"
        connections.append((*shaft.bodies, Fraction(1), Fraction(0), shaft_name))
    # Carriers stand still in the frame of the positions.
    speed_of = {body.carrier: Fraction(0) for body in bodies.values() if body.carrier}
    speed_of[reference_mesh.pinion] = reference_speed
    known_count = 0
    # Repeat until no further body gets a speed.
    while len(speed_of) > known_count:
        known_count = len(speed_of)
        for body_1, body_2, ratio, axes_speed, connection_name in connections:
            if body_1 in speed_of:
                speed_2 = (speed_of[body_1] - axes_speed) * ratio + axes_speed
                if speed_of.setdefault(body_2, speed_2) != speed_2:
                    raise ValueError(
                        f"teeth of body {body_2} = {bodies[body_2].teeth!r} is not allowed: by "
                        f"{connection_name} the train is locked; speeds must agree around every "
                        "loop"
                    )
            elif body_2 in speed_of:
                speed_of[body_1] = (speed_of[body_2] - axes_speed) / ratio + axes_speed
    for mesh in meshes:
        if mesh.pinion not in speed_of:
            raise ValueError(
                f"mesh {mesh.name} is not allowed: it must be connected with the reference mesh "
                f"{reference} by meshes and shafts"
            )
    in_frame = {name: speed_of.get(name, Fraction(0)) for name in bodies}
    sign = _rotation_sign(meshes, reference_mesh, Speeds(in_frame, frame_speed), bodies)
    return Speeds({name: sign * speed for name, speed in in_frame.items()}, sign * frame_speed)


def _rotation_sign(meshes, reference_mesh: Mesh, speeds: Speeds, bodies: dict) -> int:
    """Return 1, or -1 if all `speeds` must be reversed so that the intended gears drive.

    These gears are named by `Mesh.driving`; if no mesh names one, the pinion of the reference mesh
    drives. `bodies` maps names to `Body`. Raises ValueError if meshes contradict each other.
    """
    meshes = [mesh for mesh in meshes if mesh.driving]
    signs = []
    for mesh in meshes:
        driver = driving_gear(mesh, speeds.at(mesh, bodies))
        signs.append(1 if driver == mesh.driving else -1)
    for sign, mesh in zip(signs, meshes, strict=True):
        other_gear = mesh.wheel if mesh.driving == mesh.pinion else mesh.pinion
        checks.require(
            sign == signs[0],
            f"driving of mesh {mesh.name}",
            mesh.driving,
            f"{other_gear!r} as the gears turn and press where {meshes[0].driving!r} drives in "
            f"mesh {meshes[0].name}",
        )
    if signs:
        return signs[0]
    driver = driving_gear(reference_mesh, speeds.at(reference_mesh, bodies))
    return 1 if driver == reference_mesh.pinion else -1


def driving_gear(mesh: Mesh, speed: dict[str, Fraction]) -> str:
    """Return the name of the gear that drives a mesh through the drive-side flanks.

    It is the gear that moves towards the side on which its drive-side flanks lie. `speed` maps the
    name of a body to its signed speed relative to the line of centres.
    """
    pinion_drives = speed[mesh.pinion] * _drive_side_sign(mesh, mesh.pinion) > 0
    return mesh.pinion if pinion_drives else mesh.wheel


def pitch_phase(mesh: Mesh, speed: dict[str, Fraction]) -> float:
    """Return the mesh phase at which drive-side flanks touch at the pitch point, rad.

    If the wheel drives, the flanks pass through the mesh in the opposite order, so that the sign
    changes. `speed` maps the name of a body to its signed speed.
    """
    return mesh.pitch_phase if driving_gear(mesh, speed) == mesh.pinion else -mesh.pitch_phase


def sliding_phases(mesh: Mesh, speed: dict[str, Fraction]) -> tuple[float, float]:
    """Return the phases at which the sliding becomes positive on the (coast, drive) side.

    Phases are in mesh periods after the middle of the upper stiffness level of the drive side. On
    the drive side this is the phase at which flanks touch at the pitch point. On the coast side it
    is half a period earlier or later, because the mesh force has the opposite sign. `speed` maps
    the name of a body to its signed speed.
    """
    drive = pitch_phase(mesh, speed) / math.tau
    return drive + float(thickness_difference(mesh, speed)) / 2.0, drive


def thickness_difference(mesh: Mesh, speed: dict[str, Fraction]) -> Fraction:
    """Return the tooth thickness of the driving gear minus that of the driven gear, in pitches.

    It is 0 if the mesh has no `tooth_thickness`. `speed` maps the name of a body to its signed
    speed.
    """
    if mesh.tooth_thickness is None:
        return Fraction(0)
    pinion, wheel = map(Fraction, mesh.tooth_thickness)
    return pinion - wheel if driving_gear(mesh, speed) == mesh.pinion else wheel - pinion


def coast_side_phase(mesh: Mesh, speed: dict[str, Fraction], phase: float) -> float:
    """Return the stiffness phase of the coast side, the flanks that carry a reversed load.

    It is `Mesh.coast_phase` if given; otherwise it follows from `phase`, the stiffness phase of the
    drive side, and from the tooth thickness. Both are the middle of the upper stiffness level, in
    mesh periods. `speed` maps the name of a body to its signed speed.
    """
    if mesh.coast_phase is not None:
        return mesh.coast_phase % 1.0
    if mesh.tooth_thickness is None:
        return phase
    coast, drive = sliding_phases(mesh, speed)
    # Coast-side flanks touch at the pitch point half a period after the sliding phase `coast`. The
    # other gear drives there, so that the middle of their upper level comes `drive` later.
    return _rounded_phase(phase + (coast + drive) + 0.5)


def phases(bodies, meshes, shafts, reference, speeds) -> dict:
    """Return the stiffness phase of each mesh: name of the mesh -> mesh periods, in [0, 1).

    It is the middle of the upper stiffness level. It follows from the positions of the teeth unless
    the mesh has its own. `bodies` maps names to `Body`, `reference` is the name of the reference
    mesh, and `speeds` are the `Speeds` of the bodies. Raises ValueError if the teeth do not fit
    together, so that the train cannot be assembled.
    """
    meshes_by_teeth = [mesh for mesh in meshes if mesh.phase is None or mesh.name == reference]
    # Given keyings come before those that follow from the loops of meshes.
    shafts = sorted(shafts, key=lambda shaft: shaft.keying is None)
    teeth = _ToothPositions(bodies, shafts, speeds)
    teeth.place_pinion(next(mesh for mesh in meshes if mesh.name == reference))
    while len(teeth.phases) < len(meshes_by_teeth):
        # Follow meshes first, then shafts; start anew at a mesh that neither of them reaches.
        # The list makes `any` place all meshes in each pass.
        while any([teeth.place_by_mesh(mesh) for mesh in meshes_by_teeth]):
            pass
        if not teeth.place_by_shaft() and len(teeth.phases) < len(meshes_by_teeth):
            teeth.place_pinion(
                next(mesh for mesh in meshes_by_teeth if mesh.name not in teeth.phases)
            )
    for shaft in shafts:
        if shaft.keying is not None and set(shaft.bodies) <= set(teeth.positions):
            _check_keying(shaft, bodies, teeth.positions)
    given_phases = {mesh.name: mesh.phase for mesh in meshes if mesh.phase is not None}
    phase_of = teeth.phases | given_phases
    return {mesh.name: _rounded_phase(phase_of[mesh.name]) for mesh in meshes}


def _check_keying(shaft, bodies: dict, positions: dict) -> None:
    """Raise ValueError if the keying of a shaft contradicts the positions of its gears.

    The keying is the angle from a tooth of the first gear to a tooth of the second. `bodies` maps
    names to `Body`, and `positions` maps names to the tooth pitches from angle 0 to the middle of a
    tooth.
    """
    tooth_counts = [bodies[name].teeth or 1 for name in shaft.bodies]
    # Angles of a tooth middle of both bodies, in revolutions.
    angles = [positions[name] / z for name, z in zip(shaft.bodies, tooth_counts, strict=True)]
    difference = angles[1] - angles[0]
    # Any two teeth may be in line, so that keying angles are equal modulo 2 pi / count.
    count = math.lcm(*tooth_counts)
    misfit = count * (difference - shaft.keying / math.tau)
    if abs(misfit - round(misfit)) > count * _POSITION_TOLERANCE / max(tooth_counts):
        required = math.tau / count * ((count * difference) % 1.0)
        raise ValueError(
            f"keying of shaft {'-'.join(shaft.bodies)} = {shaft.keying!r} is not allowed: "
            f"around the loops of meshes it must be {required:.9g}, or a whole multiple of "
            f"2 pi / {count} from there"
        )


class _ToothPositions:
    """Angular positions of the gears of a train at mesh phase 0, computed gear by gear."""

    def __init__(self, bodies: dict, shafts: list, speeds: Speeds):
        self.bodies, self.shafts, self.speeds = bodies, shafts, speeds
        self.positions: dict = {}  #: body name -> tooth pitches from angle 0 to a tooth middle
        self.phases: dict = {}  #: mesh name -> phase in mesh periods

    def place_pinion(self, mesh: Mesh) -> None:
        """Set the position of the pinion of a mesh so that the mesh has its given phase, or 0."""
        sliding_phase = sliding_phases(mesh, self.speeds.at(mesh, self.bodies))[1]
        self._place(mesh, mesh.pinion, (mesh.phase or 0.0) + sliding_phase)

    def place_by_mesh(self, mesh: Mesh) -> bool:
        """Set the position of a gear from the gear that it meshes with, and the phase of the mesh.

        Returns whether this was done: False if neither gear has a position yet, or the mesh already
        has its phase. Raises ValueError if the teeth of two gears with positions do not fit
        together.
        """
        placed_gears = [name for name in (mesh.pinion, mesh.wheel) if name in self.positions]
        if not placed_gears or mesh.name in self.phases:
            return False
        gear, speed = placed_gears[0], self.speeds.at(mesh, self.bodies)
        pitches = _contact_position(mesh, gear, self.bodies) - self.positions[gear]
        # Time until the drive-side flank of this gear reaches the pitch point.
        periods = math.copysign(1.0, speed[gear]) * pitches
        for name in (mesh.pinion, mesh.wheel):
            if self._place(mesh, name, periods) > _POSITION_TOLERANCE:
                raise ValueError(
                    f"position of mesh {mesh.name} = {mesh.centre_line_angle!r} is not allowed: "
                    f"the teeth of {mesh.pinion} and {mesh.wheel} do not fit together there; "
                    "around every loop the positions must be whole tooth pitches apart, for equal "
                    "satellites (z_s + z_r) / N an integer"
                )
        self.phases[mesh.name] = periods - sliding_phases(mesh, speed)[1]
        return True

    def place_by_shaft(self) -> bool:
        """Set the position of one body from another body on the same shaft, and return True.

        The angle between their teeth is the keying of the shaft, 0 by default. Returns False if no
        shaft joins a body that has a position to one without.
        """
        for shaft in self.shafts:
            for (placed, unplaced), sign in ((shaft.bodies, 1.0), (shaft.bodies[::-1], -1.0)):
                if placed in self.positions and unplaced not in self.positions:
                    # Positions count tooth pitches; a body without teeth counts revolutions.
                    revolutions = self.positions[placed] / (self.bodies[placed].teeth or 1)
                    revolutions += sign * ((shaft.keying or 0.0) / math.tau)
                    self.positions[unplaced] = revolutions * (self.bodies[unplaced].teeth or 1)
                    return True
        return False

    def _place(self, mesh: Mesh, name: str, periods: float) -> float:
        """Set the position of a gear so that its drive-side flank reaches the pitch point in time.

        The time is a number of mesh `periods`, in which the flank of the gear called `name` comes
        to the pitch point of the mesh. If the gear already has a position, keep it and return the
        misfit in tooth pitches, modulo one pitch; otherwise return 0.
        """
        contact, side = _contact_position(mesh, name, self.bodies), _drive_side_sign(mesh, name)
        speed = self.speeds.at(mesh, self.bodies)[name]
        position = contact - math.copysign(1.0, speed) * periods
        if name in self.positions:
            misfit = self.positions[name] - position
            return abs(misfit - round(misfit))
        # Take the tooth nearest to the line of centres. Half-way between two teeth, take that on
        # the side of its drive-side flank, so that a mirror image of the train has the same tooth.
        pitches = side * (position - contact) - _thickness(mesh, name) / 2.0
        self.positions[name] = position - side * math.ceil(pitches - 0.5 - _POSITION_TOLERANCE)
        return 0.0


def _drive_side_sign(mesh: Mesh, name: str) -> int:
    """Return 1 if the drive-side flanks of a gear are on the counterclockwise side, else -1.

    `name` is the name of a gear of the mesh. The pinion of an internal mesh touches with the side
    opposite to that of the ring gear.
    """
    return -mesh.direction if mesh.internal and name == mesh.pinion else mesh.direction


def _thickness(mesh: Mesh, name: str) -> float:
    """Return the tooth thickness of a gear of a mesh in pitches, half a pitch by default.

    `name` is the name of the gear.
    """
    if mesh.tooth_thickness is None:
        return 0.5
    # `tooth_thickness` is the pair (pinion, wheel).
    return mesh.tooth_thickness[1 if name == mesh.wheel else 0]


def _contact_position(mesh: Mesh, name: str, bodies: dict) -> float:
    """Return the angle of the middle of a tooth whose drive-side flank is at the pitch point.

    The angle is in tooth pitches of this gear, counterclockwise from angle 0; the flank lies half a
    tooth thickness from the middle. `name` is the name of a gear of the mesh, and `bodies` maps
    names to `Body`.
    """
    angle = mesh.centre_line_angle
    if not mesh.internal and name == mesh.wheel:
        # The pitch point lies opposite to the direction from the pinion to the wheel.
        angle = angle + math.pi
    pitches = bodies[name].teeth * angle / math.tau
    return pitches - _drive_side_sign(mesh, name) * _thickness(mesh, name) / 2.0


def _rounded_phase(phase: float) -> float:
    """Return a phase in periods, modulo 1 and rounded so that equal meshes have equal phases."""
    return round(phase % 1.0, 13) % 1.0
