"""What a gear train has to be: its names known, its gears able to mesh, its torques in balance."""

import math

import numpy as np

from gearlib import checks

#: Relative difference of base pitches that is rounding of base radii.
_PITCH = 1e-4
#: As many as the largest planetary train has.
_MAX_MESHES = 200


class Parts:
    """A sequence of elements of a train."""

    def __init__(self, kind, least=1):
        self.kind, self.least, self.words = kind, least, f"a sequence of {kind.__name__}"

    def check(self, name, values):
        """Return them as a tuple, else raise ValueError."""
        enough = isinstance(values, (tuple, list)) and len(values) >= self.least
        suits = enough and all(isinstance(value, self.kind) for value in values)
        checks.require(suits, name, values, self.words)
        return tuple(values)


def check_names(train):
    """Refuse names twice or unknown, too many meshes, supports that a turning frame rules out."""
    for kind in ("bodies", "meshes"):
        names = [value.name for value in getattr(train, kind)]
        twice = next((name for name in names if names.count(name) > 1), None)
        if twice is not None:
            raise ValueError(
                f"{kind} = {names!r} is not allowed: the name {twice!r} must occur once"
            )
    if len(train.meshes) > _MAX_MESHES:
        raise ValueError(
            f"meshes = {len(train.meshes)} meshes is not allowed: there must be at most "
            f"{_MAX_MESHES}"
        )
    for shaft in train.shafts:
        for name in shaft.bodies:
            checks.one_of("bodies of a shaft", name, train.body_names)
    for mesh in train.meshes:
        for side in ("pinion", "wheel"):
            name = getattr(mesh, side)
            checks.one_of(f"{side} of mesh {mesh.name}", name, train.body_names)
        name, words = f"wheel of mesh {mesh.name}", "another body than the pinion"
        checks.require(mesh.pinion != mesh.wheel, name, mesh.wheel, words)
    for body in train.bodies:
        if body.carrier is not None:
            checks.one_of(f"carrier of body {body.name}", body.carrier, train.body_names)
            carries = body.carrier != body.name and train.by_name[body.carrier].carrier is None
            name, words = f"carrier of body {body.name}", "another body, which no carrier carries"
            checks.require(carries, name, body.carrier, words)
        elif train.gyroscopic:
            equal = len(set(body.support_stiffness)) == len(set(body.support_damping)) == 1
            if not equal:
                raise ValueError(
                    f"support_stiffness of body {body.name} = {body.support_stiffness!r} is not "
                    "allowed: it must be, as its damping, the same along x and y in a turning frame"
                )


def check_gears(train):
    """Refuse gears that do not mesh, turn or fit together."""
    for mesh in train.meshes:
        pinion, wheel = train.by_name[mesh.pinion], train.by_name[mesh.wheel]
        for body in (pinion, wheel):
            words = f"an integer >= 3, because it is in mesh {mesh.name}"
            checks.require(body.teeth is not None, f"teeth of body {body.name}", None, words)
        pitches = [2.0 * math.pi * body.base_radius / body.teeth for body in (pinion, wheel)]
        checks.require(
            abs(pitches[0] - pitches[1]) <= _PITCH * max(pitches),
            f"base_radius of body {wheel.name}",
            wheel.base_radius,
            f"{pinion.base_radius * wheel.teeth / pinion.teeth:.6g} to have the base pitch "
            f"(module) of {pinion.name} in mesh {mesh.name}",
        )
        fits = not mesh.internal or wheel.teeth > pinion.teeth
        words = f"more than the {pinion.teeth} of {pinion.name}, which meshes inside it"
        checks.require(fits, f"teeth of body {wheel.name}", wheel.teeth, words)
    train.phases  # noqa: B018 (refuses what does not turn or fit)


def check_balance(train):
    """Refuse bodies without motion, mass or balance, and a backlash that moves with a free axis."""
    if not train.structure.coordinates:
        raise ValueError("bodies is not allowed: at least one of them must be able to move")
    # Each coordinate is that of one body, and what pins add to its mass adds to the others' too.
    if np.diagonal(train.structure.mass).min() <= 0.0:
        raise ValueError("bodies is not allowed: every motion must have a mass")
    load = train.structure.load
    for motion in train.free_motions.T:
        work = motion * load
        if abs(work.sum()) > 1e-9 * np.abs(work).sum():
            turned = [
                body.name
                for body, rows in zip(train.bodies, train.structure.motions, strict=True)
                if np.abs(rows @ motion).max() > 1e-6 * np.abs(motion).max()
            ]
            raise ValueError(
                f"torque of bodies {', '.join(turned)} is not allowed: they must balance on "
                "the free rotation of the train, whose power is now "
                f"{work.sum() / np.abs(work).sum():.3g} of that of the single torques"
            )
    sliding = np.abs(train.far_lines @ train.free_motions)
    scale = np.abs(train.far_lines) @ np.abs(train.free_motions)
    moved = sliding > 1e-9 * scale
    for mesh, slides in zip(train.meshes, moved.any(axis=1), strict=True):
        name, words = f"moving_backlash of mesh {mesh.name}", "False where an axis of its gears "
        checks.require(not (mesh.moving_backlash and slides), name, True, words + "moves freely")
