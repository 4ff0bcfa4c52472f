"""Rotation of the gears of a train: speeds from tooth numbers, mesh phases from positions.

The drive-side flanks of a mesh and the sense of rotation determine which gear drives through these
flanks. The angular position o of a gear with z teeth is the angle of a tooth centre at phase 0, in
tooth pitches. The drive-side flank of this tooth lies half the tooth thickness s (in pitches) to
the side f. It reaches a pitch point at the angle alpha after the time

    t = sign(w) (z alpha / 2 pi - o - f s / 2)   mesh periods, modulo 1,

where w is the speed of the gear and f = 1 for counterclockwise flanks. If the pinion drives, the
middle of the upper stiffness level precedes this time by `pitch_phase`; if the wheel drives, it
follows by the same phase. Both gears of a mesh have the same t. Around a loop of meshes the
positions o must be consistent, or the train cannot be assembled: for equal satellites
(z_s + z_r) psi_n / 2 pi must be an integer. Parker, J. Sound Vib. 236 (2000) 561-573; Parker & Lin,
J. Mech. Des. 126 (2004) 365-370. The teeth of gears on the same shaft are aligned, or offset by the
keying angle, unless loops of meshes require another angle. The angle refers to the tooth nearest to
the line of centres of the mesh that determines the position of the gear.

On the coast side the other gear drives. If both gears share the backlash, coast-side flanks reach
the pitch point (1 + s_1 - s_2) / 2 periods after the drive-side flanks, where s_1 is the tooth
thickness of the gear that drives on the drive side; Guo & Parker, Mech. Mach. Theory 78 (2014)
263-271.
"""

import math
from fractions import Fraction
from typing import NamedTuple

from gearlib import checks
from gearlib.models.trains.elements import Mesh, lies_in_housing

#: Largest misfit of teeth in pitches, to allow for rounded positions.
_POSITION_TOLERANCE = 1e-6
#: Largest denominator of the fraction that approximates the speed ratio of the frame.
MAX_DENOMINATOR = 10_000_000


class Speeds(NamedTuple):
    """Signed speeds of the bodies of a train, in radians per radian of reference mesh phase."""

    in_frame: dict  #: body name -> speed in the frame of the positions, a `Fraction`
    frame: Fraction  #: speed of this frame relative to the housing

    @property
    def in_housing(self) -> dict[str, Fraction]:
        """Speeds of the bodies relative to the housing."""
        return {name: speed + self.frame for name, speed in self.in_frame.items()}

    def at(self, mesh: Mesh, bodies: dict) -> dict[str, Fraction]:
        """Return the speeds of all bodies relative to the line of centres of a mesh, as a dict.

        This line is fixed in the housing or in the rotating frame of the carriers. `bodies` maps
        names to `Body`.
        """
        return self.in_housing if lies_in_housing(mesh, bodies) else self.in_frame


def speeds(bodies, meshes, shafts, reference, carrier_ratio) -> Speeds:
    """Compute the `Speeds` of the bodies of a train from the tooth numbers.

    `bodies` maps names to `Body`, `reference` is the name of the reference mesh, and
    `carrier_ratio` is the speed of the frame over the speed of the reference pinion in this frame.
    Speeds are propagated from the reference pinion through meshes and shafts; the speed of other
    bodies in the frame is 0. Raises ValueError if the train is locked or a mesh is not connected.
    """
    reference_mesh = next(mesh for mesh in meshes if mesh.name == reference)
    frame_ratio = Fraction(carrier_ratio).limit_denominator(MAX_DENOMINATOR)
    # In a mesh period (2 pi of phase) the pinion rotates by one tooth.
    reference_speed = Fraction(1, bodies[reference_mesh.pinion].teeth)
    if lies_in_housing(reference_mesh, bodies):
        reference_speed /= 1 + frame_ratio
    frame_speed = reference_speed * frame_ratio
    # A connection is a tuple (body 1, body 2, ratio of their speeds relative to the axes, speed of
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
    # Carriers are fixed in the frame of the positions.
    speed_of = {body.carrier: Fraction(0) for body in bodies.values() if body.carrier}
    speed_of[reference_mesh.pinion] = reference_speed
    known_count = 0
    # Repeat until no more speeds can be determined.
    while len(speed_of) > known_count:
        known_count = len(speed_of)
        for body_1, body_2, ratio, axes_speed, connection_name in connections:
            if body_1 in speed_of:
                speed_2 = (speed_of[body_1] - axes_speed) * ratio + axes_speed
                if speed_of.setdefault(body_2, speed_2) != speed_2:
                    raise ValueError(
                        f"teeth of body {body_2} = {bodies[body_2].teeth!r} is not allowed: due to "
                        f"{connection_name} the train is locked; speeds must be consistent around "
                        "each loop"
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
    """Return 1, or -1 if all speeds must be reversed so that the intended gears drive.

    `Mesh.driving` is the intended gear; if no mesh has one, the pinion of the reference mesh
    drives. `speeds` are the `Speeds` of the bodies, and `bodies` maps names to `Body`. Raises
    ValueError if the meshes contradict each other.
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
            f"{other_gear!r} if {meshes[0].driving!r} drives in mesh {meshes[0].name}",
        )
    if signs:
        return signs[0]
    driver = driving_gear(reference_mesh, speeds.at(reference_mesh, bodies))
    return 1 if driver == reference_mesh.pinion else -1


def driving_gear(mesh: Mesh, speeds: dict[str, Fraction]) -> str:
    """Return the name of the gear that drives a mesh through the drive-side flanks.

    This gear rotates towards its drive-side flanks. `speeds` maps body names to signed speeds
    relative to the line of centres.
    """
    pinion_drives = speeds[mesh.pinion] * _drive_side_sign(mesh, mesh.pinion) > 0
    return mesh.pinion if pinion_drives else mesh.wheel


def pitch_phase(mesh: Mesh, speeds: dict[str, Fraction]) -> float:
    """Return the mesh phase at which drive-side flanks touch at the pitch point, rad.

    If the wheel drives, the contact passes through the mesh in the opposite direction, so that the
    sign changes. `speeds` maps body names to signed speeds relative to the line of centres.
    """
    return mesh.pitch_phase if driving_gear(mesh, speeds) == mesh.pinion else -mesh.pitch_phase


def sliding_phases(mesh: Mesh, speeds: dict[str, Fraction]) -> tuple[float, float]:
    """Return the phases at which the sliding becomes positive on the (coast, drive) sides.

    The phases are in mesh periods after the middle of the upper stiffness level of the drive side.
    On the drive side, sliding becomes positive when the flanks touch at the pitch point. On the
    coast side, it becomes positive half a period earlier or later, because the mesh force has the
    opposite sign. `speeds` maps body names to signed speeds relative to the line of centres.
    """
    drive = pitch_phase(mesh, speeds) / math.tau
    return drive + float(thickness_difference(mesh, speeds)) / 2.0, drive


def thickness_difference(mesh: Mesh, speeds: dict[str, Fraction]) -> Fraction:
    """Return the tooth thickness of the driving minus the driven gear, in pitches.

    It is 0 if the mesh has no `tooth_thickness`. `speeds` maps body names to signed speeds relative
    to the line of centres.
    """
    if mesh.tooth_thickness is None:
        return Fraction(0)
    pinion, wheel = map(Fraction, mesh.tooth_thickness)
    return pinion - wheel if driving_gear(mesh, speeds) == mesh.pinion else wheel - pinion


def coast_phase(mesh: Mesh, speeds: dict[str, Fraction], phase: float) -> float:
    """Return the stiffness phase of the coast side, the middle of its upper stiffness level.

    It is `Mesh.coast_phase` if that is given; otherwise it follows from `phase`, the stiffness
    phase of the drive side, and the tooth thickness. Both phases are in mesh periods. `speeds` maps
    body names to signed speeds relative to the line of centres.
    """
    if mesh.coast_phase is not None:
        return mesh.coast_phase % 1.0
    if mesh.tooth_thickness is None:
        return phase
    coast_sliding_phase, drive_sliding_phase = sliding_phases(mesh, speeds)
    # Coast-side flanks touch at the pitch point half a period after `coast_sliding_phase`. On the
    # coast side the other gear drives, so that `drive_sliding_phase` is added, not subtracted.
    return _round_phase(phase + (coast_sliding_phase + drive_sliding_phase) + 0.5)


def phases(bodies, meshes, shafts, reference, speeds) -> dict:
    """Return the stiffness phases of the meshes, a dict mesh name -> phase in mesh periods.

    The stiffness phase, in [0, 1), is the middle of the upper stiffness level. It is computed from
    the positions of the teeth unless `Mesh.phase` is given. `bodies` maps names to `Body`,
    `reference` is the name of the reference mesh, and `speeds` are the `Speeds` of the bodies.
    Raises ValueError if the train cannot be assembled, because its teeth do not fit together.
    """
    meshes_by_teeth = [mesh for mesh in meshes if mesh.phase is None or mesh.name == reference]
    # Shafts with a given keying are used first.
    shafts = sorted(shafts, key=lambda shaft: shaft.keying is None)
    teeth = _ToothPositions(bodies, shafts, speeds)
    teeth.position_pinion(next(mesh for mesh in meshes if mesh.name == reference))
    while len(teeth.phases) < len(meshes_by_teeth):
        # Propagate positions through meshes first, then through shafts. If neither is possible,
        # start again at another mesh. The list makes `any` process all meshes in each pass.
        while any([teeth.position_by_mesh(mesh) for mesh in meshes_by_teeth]):
            pass
        if not teeth.position_by_shaft() and len(teeth.phases) < len(meshes_by_teeth):
            teeth.position_pinion(
                next(mesh for mesh in meshes_by_teeth if mesh.name not in teeth.phases)
            )
    for shaft in shafts:
        if shaft.keying is not None and set(shaft.bodies) <= set(teeth.positions):
            _check_keying(shaft, bodies, teeth.positions)
    given_phases = {mesh.name: mesh.phase for mesh in meshes if mesh.phase is not None}
    phase_of = teeth.phases | given_phases
    return {mesh.name: _round_phase(phase_of[mesh.name]) for mesh in meshes}


def _check_keying(shaft, bodies: dict, positions: dict) -> None:
    """Raise ValueError if the keying of a shaft contradicts the positions of its gears.

    The keying is the angle from a tooth of the first gear to a tooth of the second gear. `bodies`
    maps names to `Body`, and `positions` maps names to the angle of a tooth centre in pitches.
    """
    tooth_counts = [bodies[name].teeth or 1 for name in shaft.bodies]
    # Angles of a tooth centre of both gears, in revolutions.
    angles = [positions[name] / z for name, z in zip(shaft.bodies, tooth_counts, strict=True)]
    difference = angles[1] - angles[0]
    # Any two teeth may be aligned, so that keying angles are equivalent modulo 2 pi / count.
    count = math.lcm(*tooth_counts)
    misfit = count * (difference - shaft.keying / math.tau)
    if abs(misfit - round(misfit)) > count * _POSITION_TOLERANCE / max(tooth_counts):
        required = math.tau / count * ((count * difference) % 1.0)
        raise ValueError(
            f"keying of shaft {'-'.join(shaft.bodies)} = {shaft.keying!r} is not allowed: due to "
            f"the loops of meshes it must be {required:.9g} plus a multiple of 2 pi / {count}"
        )


class _ToothPositions:
    """Angular positions of the gears of a train at mesh phase 0, computed gear by gear."""

    def __init__(self, bodies: dict, shafts: list, speeds: Speeds):
        self.bodies, self.shafts, self.speeds = bodies, shafts, speeds
        self.positions: dict = {}  #: body name -> angle of a tooth centre in tooth pitches
        self.phases: dict = {}  #: mesh name -> phase in mesh periods

    def position_pinion(self, mesh: Mesh) -> None:
        """Set the position of the pinion such that the mesh has its given phase, by default 0."""
        _, drive_sliding_phase = sliding_phases(mesh, self.speeds.at(mesh, self.bodies))
        self._set_position(mesh, mesh.pinion, (mesh.phase or 0.0) + drive_sliding_phase)

    def position_by_mesh(self, mesh: Mesh) -> bool:
        """Set the position of a gear from its mating gear, and the phase of the mesh.

        Returns False, and does nothing, if neither gear has a position yet or if the mesh already
        has its phase; otherwise returns True. Raises ValueError if both gears have positions, but
        their teeth do not fit together.
        """
        known_gears = [name for name in (mesh.pinion, mesh.wheel) if name in self.positions]
        if not known_gears or mesh.name in self.phases:
            return False
        gear, speeds = known_gears[0], self.speeds.at(mesh, self.bodies)
        pitches = _contact_position(mesh, gear, self.bodies) - self.positions[gear]
        # The time until the drive-side flank of this gear reaches the pitch point.
        periods = math.copysign(1.0, speeds[gear]) * pitches
        for name in (mesh.pinion, mesh.wheel):
            if self._set_position(mesh, name, periods) > _POSITION_TOLERANCE:
                raise ValueError(
                    f"position of mesh {mesh.name} = {mesh.centre_line_angle!r} is not allowed: "
                    f"the teeth of {mesh.pinion} and {mesh.wheel} do not fit together there; "
                    "around each loop, positions must differ by whole tooth pitches, which for "
                    "equal satellites means (z_s + z_r) / N an integer"
                )
        _, drive_sliding_phase = sliding_phases(mesh, speeds)
        self.phases[mesh.name] = periods - drive_sliding_phase
        return True

    def position_by_shaft(self) -> bool:
        """Set the position of a body from another body on the same shaft.

        The angle between their teeth is the keying of the shaft, by default 0. Returns True, or
        False if no shaft joins a body with a position to a body without one.
        """
        for shaft in self.shafts:
            for (known, unknown), sign in ((shaft.bodies, 1.0), (shaft.bodies[::-1], -1.0)):
                if known in self.positions and unknown not in self.positions:
                    # Positions are in tooth pitches, or in revolutions for bodies without teeth.
                    revolutions = self.positions[known] / (self.bodies[known].teeth or 1)
                    revolutions += sign * ((shaft.keying or 0.0) / math.tau)
                    self.positions[unknown] = revolutions * (self.bodies[unknown].teeth or 1)
                    return True
        return False

    def _set_position(self, mesh: Mesh, name: str, periods: float) -> float:
        """Set the position of a gear from the time when its flank reaches the pitch point.

        `name` is the name of the gear, and `periods` is the time in mesh periods until one of its
        drive-side flanks reaches the pitch point of the mesh. If the gear already has a position,
        it is not changed, and the misfit in tooth pitches is returned; otherwise 0 is returned.
        """
        contact, side = _contact_position(mesh, name, self.bodies), _drive_side_sign(mesh, name)
        speed = self.speeds.at(mesh, self.bodies)[name]
        position = contact - math.copysign(1.0, speed) * periods
        if name in self.positions:
            misfit = self.positions[name] - position
            return abs(misfit - round(misfit))
        # Choose the tooth nearest to the line of centres. If two teeth are equally near, choose the
        # tooth on the drive-side flank side, so that a mirrored train has the same tooth.
        pitches = side * (position - contact) - _tooth_thickness(mesh, name) / 2.0
        self.positions[name] = position - side * math.ceil(pitches - 0.5 - _POSITION_TOLERANCE)
        return 0.0


def _drive_side_sign(mesh: Mesh, name: str) -> int:
    """Return 1 if the drive-side flanks of a gear are on the counterclockwise side, else -1.

    `name` is the name of a gear of the mesh. In an internal mesh, the drive-side flanks of the
    pinion and the ring gear are on opposite sides.
    """
    return -mesh.direction if mesh.internal and name == mesh.pinion else mesh.direction


def _tooth_thickness(mesh: Mesh, name: str) -> float:
    """Return the tooth thickness of the gear `name` of a mesh in pitches, by default 0.5."""
    if mesh.tooth_thickness is None:
        return 0.5
    pinion_thickness, wheel_thickness = mesh.tooth_thickness
    return wheel_thickness if name == mesh.wheel else pinion_thickness


def _contact_position(mesh: Mesh, name: str, bodies: dict) -> float:
    """Return the angle of a tooth centre at the time when its flank is at the pitch point.

    The angle is in tooth pitches, counterclockwise from angle 0. The drive-side flank lies half a
    tooth thickness from the centre. `name` is the name of a gear of the mesh, and `bodies` maps
    names to `Body`.
    """
    angle = mesh.centre_line_angle
    if not mesh.internal and name == mesh.wheel:
        # The direction from the wheel to the pitch point is opposite to the line of centres.
        angle = angle + math.pi
    pitches = bodies[name].teeth * angle / math.tau
    return pitches - _drive_side_sign(mesh, name) * _tooth_thickness(mesh, name) / 2.0


def _round_phase(phase: float) -> float:
    """Return a phase in periods modulo 1, rounded so that equal meshes have equal phases."""
    return round(phase % 1.0, 13) % 1.0
