"""Where the flanks of a mesh touch and how they slide: plane kinematics of two base circles.

It shares nothing with gearlib but the parameters of the elements, the speeds and the phases. Both
gears turn about axes at rest, of planets in the frame of the carrier; each flank of a tooth touches
on its own line of action, one of the two tangents that the base circles have through the pitch
point.
"""

import math

import numpy as np


def _turned(vector, angle):
    c, s = math.cos(angle), math.sin(angle)
    return np.array([c * vector[0] - s * vector[1], s * vector[0] + c * vector[1]])


def _ends(mesh):
    """Return the gear at which the position of the mesh begins, and the other one."""
    return (mesh.wheel, mesh.pinion) if mesh.internal else (mesh.pinion, mesh.wheel)


def axes(train, mesh):
    """Return the axes of pinion and wheel in m, seen from the pitch point."""
    radius = [train.by_name[name].base_radius for name in _ends(mesh)]
    ahead = np.array([math.cos(mesh.centres), math.sin(mesh.centres)]) / math.cos(
        mesh.pressure_angle
    )
    # Past the pitch point, seen from a ring gear, no pinion has its axis.
    first, second = -radius[0] * ahead, (-1.0 if mesh.internal else 1.0) * radius[1] * ahead
    return (second, first) if mesh.internal else (first, second)


def sliding(train, mesh, drive, turns):
    """Return (m, m/rad): where flanks touch, seen from the pitch point, and how they slide there.

    Parameters
    ----------
    train, mesh
    drive : bool
        Whether drive-side flanks touch, else coast-side ones.
    turns : float
        Mesh periods since they were at the pitch point.

    Returns
    -------
    place, speed : ndarray, shape (2,)
        `speed`: of the pinion's flank against that of the wheel.
    """
    first, other = _ends(mesh)
    axis = axes(train, mesh)[0 if first == mesh.pinion else 1]
    radius, speed = train.by_name[first].base_radius, float(train.speeds[first])
    # The tangent in whose direction this gear, turned counterclockwise, would press: its base
    # circle touches there a pressure angle before the line of centres, in a ring gear after it.
    tilt = mesh.pressure_angle * (1.0 if mesh.internal else -1.0)
    own = mesh.direction if drive else -mesh.direction
    centre = -axis / math.hypot(*axis)
    foot = axis + radius * _turned(centre, own * tilt)
    along = -foot / math.hypot(*foot) if math.hypot(*foot) else _turned(centre, math.pi / 2.0)
    # The contact goes as the base circle does at the foot.
    flow = speed * _turned(foot - axis, math.pi / 2.0)
    along *= math.copysign(1.0, flow @ along)
    pitch = 2.0 * math.pi * radius / train.by_name[first].teeth
    place = turns * pitch * along
    centres = axes(train, mesh)
    speeds = [float(train.speeds[name]) for name in (mesh.pinion, mesh.wheel)]
    velocity = [w * _turned(place - c, math.pi / 2.0) for w, c in zip(speeds, centres, strict=True)]
    # Flanks in contact do not part: both have one speed along their normal.
    assert abs((velocity[0] - velocity[1]) @ along) < 1e-9 * abs(flow @ along)
    return place, velocity[0] - velocity[1]


def pitch_points(train, mesh):
    """Return after how many mesh periods flanks touch at the pitch point, (coast, drive).

    A tooth whose drive flank leads has its other flank there a thickness later, as wide as the
    space of the other gear but for the backlash, half of which is left on either side.
    """
    first, _ = _ends(mesh)
    thick, other = (mesh.tooth_thickness or (0.5, 0.5))[:: -1 if mesh.internal else 1]
    # The gear whose drive flanks lead drives.
    leads = mesh.direction * train.speeds[first] > 0
    pinion_drives = leads == (first == mesh.pinion)
    drive = train.phases[mesh.name] + mesh.pitch_phase / (2.0 * math.pi) * (
        1.0 if pinion_drives else -1.0
    )
    return drive + (thick + 1.0 - other) / 2.0 * (1.0 if leads else -1.0), drive


def past(train, mesh, tau):
    """Return by how many mesh periods flanks have passed it, (coast, drive), in [-1/2, 1/2)."""
    turns = float(train.rates[train.mesh_names.index(mesh.name)]) * tau / (2.0 * math.pi)
    return [(turns - at + 0.5) % 1.0 - 0.5 for at in pitch_points(train, mesh)]
