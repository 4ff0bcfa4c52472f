"""How the gears of a train turn: speeds from tooth numbers, phases from positions.

A flank that is wanted at the angle alpha of a gear with z teeth, speed w and orientation o (in
tooth pitches, at the start) comes there after

    g = sign(w) (z alpha / 2 pi - o - b)   mesh periods, modulo 1,

with b = 1/2 for the other flank of a tooth of nominal thickness, half a pitch; of a thickness s in
pitches the flanks lie at b = s/2 - 1/4 and 3/4 - s/2. It is wanted at the pitch point, where the
stiffness is `pitch_phase` past the middle of its upper level. Both gears of a mesh have the same g;
around every loop of meshes the orientations have to come out the same, or the train cannot be
assembled: for equal satellites (z_s + z_r) psi_n / 2 pi has to be an integer. Parker, J. Sound Vib.
236 (2000) 561-573; Parker & Lin, J. Mech. Des. 126 (2004) 365-370. The second gear of a shaft is
keyed with its teeth in line with the first's, unless the loops ask for another angle.
"""

import math
from fractions import Fraction

#: Of a tooth pitch: positions are angles in floating point, often with few digits.
_CLOSE = 1e-6


def speeds(bodies, meshes, shafts, reference):
    """Return name -> signed speed in radians per radian of reference mesh phase, `Fraction`.

    Bodies that neither mesh nor sit on a shaft of others have speed 0.

    Raises
    ------
    ValueError
        If a mesh is not connected to the reference, or the train is locked.
    """
    ratios = [
        (mesh.pinion, mesh.wheel, _ratio(bodies, mesh), f"mesh {mesh.name}") for mesh in meshes
    ]
    ratios += [(*s.bodies, Fraction(1), f"shaft {'-'.join(s.bodies)}") for s in shafts]
    first = next(mesh for mesh in meshes if mesh.name == reference)
    sense = -first.direction if first.internal else first.direction
    found = {first.pinion: Fraction(sense, bodies[first.pinion].teeth)}
    before = -1
    while len(found) > before:
        before = len(found)
        for one, other, ratio, words in ratios:
            if one in found:
                speed = found[one] * ratio
                if found.setdefault(other, speed) != speed:
                    raise ValueError(
                        f"teeth of body {other} = {bodies[other].teeth!r} is not allowed: by "
                        f"{words} the train is locked; speeds must agree around every loop"
                    )
            elif other in found:
                found[one] = found[other] / ratio
    for mesh in meshes:
        if mesh.pinion not in found:
            raise ValueError(
                f"mesh {mesh.name} is not allowed: it must be connected with the reference mesh "
                f"{reference} by meshes and shafts"
            )
    return {name: found.get(name, Fraction(0)) for name in bodies}


def _ratio(bodies, mesh):
    """Return the speed of the wheel over that of the pinion."""
    ratio = Fraction(bodies[mesh.pinion].teeth, bodies[mesh.wheel].teeth)
    return ratio if mesh.internal else -ratio


def phases(bodies, meshes, shafts, reference, speed):
    """Return name of a mesh -> its phase in mesh periods, in [0, 1).

    Raises
    ------
    ValueError
        If the train cannot be assembled.
    """
    orientation, found = {}, {}
    free = [mesh for mesh in meshes if mesh.phase is None or mesh.name == reference]

    def tie(mesh):
        """Orient a gear by the other one; return whether anything is new."""
        known = [name for name in (mesh.pinion, mesh.wheel) if name in orientation]
        if not known or mesh.name in found:
            return False
        g = _arrival(mesh, known[0], bodies, speed, orientation[known[0]])
        for name in (mesh.pinion, mesh.wheel):
            own = _arrival(mesh, name, bodies, speed, 0.0)
            wanted = math.copysign(1.0, speed[name]) * (own - g)
            if name not in orientation:
                orientation[name] = wanted
            elif abs(_modulo(orientation[name] - wanted)) > _CLOSE:
                raise ValueError(
                    f"position of mesh {mesh.name} = {mesh.centres!r} is not allowed: the teeth of "
                    f"{mesh.pinion} and {mesh.wheel} do not fit together there; around every loop "
                    "the positions must be whole tooth pitches apart, for equal satellites "
                    "(z_s + z_r) / N an integer"
                )
        found[mesh.name] = g - _at_pitch_point(mesh)
        return True

    def start(mesh):
        g = (mesh.phase or 0.0) + _at_pitch_point(mesh)
        own = _arrival(mesh, mesh.pinion, bodies, speed, 0.0)
        orientation[mesh.pinion] = math.copysign(1.0, speed[mesh.pinion]) * (own - g)

    start(next(mesh for mesh in meshes if mesh.name == reference))
    while len(found) < len(free):
        while any([tie(mesh) for mesh in free]):
            pass
        keyed = next(
            (
                (one, other)
                for shaft in shafts
                for one, other in (shaft.bodies, shaft.bodies[::-1])
                if one in orientation and other not in orientation
            ),
            None,
        )
        if keyed:
            one, other = keyed
            teeth = (bodies[one].teeth or 1), (bodies[other].teeth or 1)
            orientation[other] = orientation[one] * teeth[1] / teeth[0]
        elif len(found) < len(free):
            start(next(mesh for mesh in free if mesh.name not in found))
    found |= {mesh.name: mesh.phase for mesh in meshes if mesh.phase is not None}
    # Equal phases are to be equal in all digits: 1e-13 of a mesh period is rounding of the angles.
    return {name: round(g % 1.0, 13) % 1.0 for name, g in found.items()}


def _at_pitch_point(mesh):
    """Return the phase of the stiffness with contact at the pitch point, in mesh periods."""
    return mesh.pitch_phase / (2.0 * math.pi)


def _arrival(mesh, name, bodies, speed, orientation):
    """Return after how many mesh periods the flank of a gear comes to the mesh."""
    turned = mesh.internal or name == mesh.pinion
    angle = mesh.centres + (0.0 if turned else math.pi)
    thickness = mesh.tooth_thickness[0 if name == mesh.pinion else 1]
    flank = thickness / 2.0 - 0.25
    if (mesh.internal and name == mesh.pinion) != (mesh.direction < 0):
        flank = 0.5 - flank
    pitches = bodies[name].teeth * angle / (2.0 * math.pi) - orientation - flank
    return math.copysign(1.0, speed[name]) * pitches


def _modulo(value):
    """Return a value modulo 1, in [-1/2, 1/2]."""
    return value - round(value)
