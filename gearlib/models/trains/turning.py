"""How the gears of a train turn: speeds from tooth numbers, phases from positions.

Which flanks of a mesh are the drive side and in which sense its gears turn say which of them drives
through these flanks. The middle of a tooth of a gear with z teeth lies o tooth pitches from angle 0
at the start; its drive-side flank, half a thickness s (in pitches) to the side f, comes to a pitch
point at the angle alpha after

    t = sign(w) (z alpha / 2 pi - o - f s / 2)   mesh periods, modulo 1,

w being its speed, f = 1 for counterclockwise flanks. There the stiffness is past the middle of its
upper level: by `pitch_phase` where the pinion drives, before it by as much where the wheel does.
Both gears of a mesh have the same t; around every loop of meshes the orientations o have to come
out the same, or the train cannot be assembled: for equal satellites (z_s + z_r) psi_n / 2 pi has to
be an integer. Parker, J. Sound Vib. 236 (2000) 561-573; Parker & Lin, J. Mech. Des. 126 (2004)
365-370. Gears on a shaft have teeth in line, middle on middle, or as far apart as they are keyed,
unless the loops ask for another angle: of the gear that is oriented first the tooth nearest to the
line of centres of the mesh that orients it.

On the coast side the other gear drives: with the play shared by both gears, coast-side flanks come
to the pitch point (1 + s_1 - s_2) / 2 periods after the drive-side ones, s_1 being the thickness of
the gear that drives these; see Guo & Parker, Mech. Mach. Theory 78 (2014) 263-271.
"""

import math
from fractions import Fraction

from gearlib import checks

#: Of a tooth pitch: positions are angles in floating point, often with few digits.
_CLOSE = 1e-6


def speeds(bodies, meshes, shafts, reference):
    """Return name -> signed speed in radians per radian of reference mesh phase, `Fraction`.

    Bodies that neither mesh nor sit on a shaft of others have speed 0. A mesh that is not connected
    to the reference, or a locked train, is refused.
    """
    ratios = []  # of the second body's speed over that of the first
    for mesh in meshes:
        ratio = Fraction(bodies[mesh.pinion].teeth, bodies[mesh.wheel].teeth)
        ratio *= 1 if mesh.internal else -1
        ratios.append((mesh.pinion, mesh.wheel, ratio, f"mesh {mesh.name}"))
    ratios += [(*shaft.bodies, Fraction(1), f"shaft {'-'.join(shaft.bodies)}") for shaft in shafts]
    first = next(mesh for mesh in meshes if mesh.name == reference)
    speed_of = {first.pinion: Fraction(1, bodies[first.pinion].teeth)}
    count = 0
    while len(speed_of) > count:
        count = len(speed_of)
        for body, other, ratio, words in ratios:
            if body in speed_of:
                speed = speed_of[body] * ratio
                if speed_of.setdefault(other, speed) != speed:
                    raise ValueError(
                        f"teeth of body {other} = {bodies[other].teeth!r} is not allowed: by "
                        f"{words} the train is locked; speeds must agree around every loop"
                    )
            elif other in speed_of:
                speed_of[body] = speed_of[other] / ratio
    for mesh in meshes:
        if mesh.pinion not in speed_of:
            raise ValueError(
                f"mesh {mesh.name} is not allowed: it must be connected with the reference mesh "
                f"{reference} by meshes and shafts"
            )
    sense = _sense(meshes, first, speed_of)
    return {name: sense * speed_of.get(name, Fraction(0)) for name in bodies}


def _sense(meshes, first, speed):
    """Return 1 if the gears that drive turn at these speeds, -1 if they turn the other way."""
    declared = [mesh for mesh in meshes if mesh.driving]
    senses = [1 if driver(mesh, speed) == mesh.driving else -1 for mesh in declared]
    for sense, mesh in zip(senses, declared, strict=True):
        right = mesh.wheel if mesh.driving == mesh.pinion else mesh.pinion
        checks.require(
            sense == senses[0],
            f"driving of mesh {mesh.name}",
            mesh.driving,
            f"{right!r} as the gears turn and press where {declared[0].driving!r} drives in mesh "
            f"{declared[0].name}",
        )
    return senses[0] if senses else (1 if driver(first, speed) == first.pinion else -1)


def driver(mesh, speed):
    """Return the name of the gear that drives a mesh through its drive-side flanks."""
    return mesh.pinion if speed[mesh.pinion] * _side(mesh, mesh.pinion) > 0 else mesh.wheel


def pitch_phase(mesh, speed):
    """Return the phase of a mesh at which its drive-side flanks touch at the pitch point, rad."""
    return mesh.pitch_phase if driver(mesh, speed) == mesh.pinion else -mesh.pitch_phase


def sliding_turns(mesh, speed):
    """Return where the sliding turns to 1, (coast, drive), in mesh periods after the drive phase.

    Flanks of the coast side touch at the pitch point half a period from there: their force has the
    other sign.
    """
    drive = pitch_phase(mesh, speed) / math.tau
    return drive + float(thicker(mesh, speed)) / 2.0, drive


def thicker(mesh, speed):
    """Return by how much teeth of the gear that drives are thicker, in pitches, a `Fraction`."""
    if mesh.tooth_thickness is None:
        return Fraction(0)
    pinion, wheel = map(Fraction, mesh.tooth_thickness)
    return pinion - wheel if driver(mesh, speed) == mesh.pinion else wheel - pinion


def inverse_phase(mesh, speed, phase):
    """Return the phase of the coast side of a mesh in mesh periods; `phase` of its drive side."""
    if mesh.inverse_phase is not None:
        return mesh.inverse_phase % 1.0
    if mesh.tooth_thickness is None:
        return phase
    # The other gear drives there: its middle lies as far past the pitch point as before it here.
    return _rounded(phase + sum(sliding_turns(mesh, speed)) + 0.5)


def phases(bodies, meshes, shafts, reference, speed):
    """Return name of a mesh -> its phase in mesh periods, in [0, 1), if it can be assembled."""
    middles: dict = {}
    phase_of: dict = {}
    free = [mesh for mesh in meshes if mesh.phase is None or mesh.name == reference]
    # What is asked for comes before what is left to the loops.
    shafts = sorted(shafts, key=lambda shaft: shaft.keying is None)

    def orient(mesh, name, t):
        """Turn a gear so that its flank is at the mesh after t periods; return what is missing."""
        flank, side = _flank(mesh, name, bodies), _side(mesh, name)
        wanted = flank - math.copysign(1.0, speed[name]) * t
        if name in middles:
            return abs(_modulo(middles[name] - wanted))
        # The tooth nearest to the line of centres; half-way between two, that on the side of its
        # drive-side flank, so that a mirror image has the same.
        ahead = side * (wanted - flank) - _thickness(mesh, name) / 2.0
        middles[name] = wanted - side * math.ceil(ahead - 0.5 - _CLOSE)
        return 0.0

    def tie(mesh):
        """Orient a gear by the other one; return whether anything is new."""
        known = [name for name in (mesh.pinion, mesh.wheel) if name in middles]
        if not known or mesh.name in phase_of:
            return False
        gear = known[0]
        t = math.copysign(1.0, speed[gear]) * (_flank(mesh, gear, bodies) - middles[gear])
        for name in (mesh.pinion, mesh.wheel):
            if orient(mesh, name, t) > _CLOSE:
                raise ValueError(
                    f"position of mesh {mesh.name} = {mesh.centres!r} is not allowed: the teeth of "
                    f"{mesh.pinion} and {mesh.wheel} do not fit together there; around every loop "
                    "the positions must be whole tooth pitches apart, for equal satellites "
                    "(z_s + z_r) / N an integer"
                )
        phase_of[mesh.name] = t - sliding_turns(mesh, speed)[1]
        return True

    def key():
        """Orient a body by the other one on its shaft; return whether there was one."""
        for shaft in shafts:
            for (body, other), sign in ((shaft.bodies, 1.0), (shaft.bodies[::-1], -1.0)):
                if body in middles and other not in middles:
                    turns = middles[body] / (bodies[body].teeth or 1) + sign * _keyed(shaft)
                    middles[other] = turns * (bodies[other].teeth or 1)
                    return True
        return False

    def start(mesh):
        orient(mesh, mesh.pinion, (mesh.phase or 0.0) + sliding_turns(mesh, speed)[1])

    start(next(mesh for mesh in meshes if mesh.name == reference))
    while len(phase_of) < len(free):
        while any([tie(mesh) for mesh in free]):
            pass
        if not key() and len(phase_of) < len(free):
            start(next(mesh for mesh in free if mesh.name not in phase_of))
    for shaft in shafts:
        if shaft.keying is not None and set(shaft.bodies) <= set(middles):
            _check_keying(shaft, bodies, middles)
    phase_of |= {mesh.name: mesh.phase for mesh in meshes if mesh.phase is not None}
    return {mesh.name: _rounded(phase_of[mesh.name]) for mesh in meshes}


def _check_keying(shaft, bodies, middles):
    """Refuse an angle between the teeth of two gears that is not what the loops make it."""
    teeth = [bodies[name].teeth or 1 for name in shaft.bodies]
    first, second = (middles[name] / z for name, z in zip(shaft.bodies, teeth, strict=True))
    # Which teeth are in line does not matter.
    count = math.lcm(*teeth)
    if abs(_modulo(count * (second - first - _keyed(shaft)))) > count * _CLOSE / max(teeth):
        right = math.tau / count * ((count * (second - first)) % 1.0)
        raise ValueError(
            f"keying of shaft {'-'.join(shaft.bodies)} = {shaft.keying!r} is not allowed: around "
            f"the loops of meshes it must be {right:.9g}, or a whole multiple of 2 pi / {count} "
            "from there"
        )


def _keyed(shaft):
    """Return by how many turns the second body of a shaft is ahead of being in line."""
    return (shaft.keying or 0.0) / math.tau


def _side(mesh, name):
    """Return whether the drive-side flanks of a gear are the counterclockwise ones, 1, or -1."""
    return -mesh.direction if mesh.internal and name == mesh.pinion else mesh.direction


def _thickness(mesh, name):
    """Return the tooth thickness of a gear of a mesh in pitches."""
    return 0.5 if mesh.tooth_thickness is None else mesh.tooth_thickness[name == mesh.wheel]


def _flank(mesh, name, bodies):
    """Return at how many pitches the middle of a tooth lies whose flank is at the pitch point."""
    turned = mesh.internal or name == mesh.pinion
    angle = mesh.centres + (0.0 if turned else math.pi)
    pitches = bodies[name].teeth * angle / math.tau
    return pitches - _side(mesh, name) * _thickness(mesh, name) / 2.0


def _modulo(value):
    """Return a value modulo 1, in [-1/2, 1/2]."""
    return value - round(value)


def _rounded(phase):
    """Return a phase in [0, 1); equal ones equal in all digits: 1e-13 is rounding of the angles."""
    return round(phase % 1.0, 13) % 1.0
