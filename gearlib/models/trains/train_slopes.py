"""Parameters of a train by which it is differentiated, and a train off the real axis.

A parameter of one element is called as the sentences of refusals call it, ``inertia of body sun``;
that of a mesh without an element is that of all meshes, changed alike.
"""

import dataclasses
import math
from copy import copy

import numpy as np

from gearlib.kernels.codes import INVERSE, NORMAL
from gearlib.models.derivatives import STEP, about_the_mean, check_edges, complex_step
from gearlib.models.trains import waves
from gearlib.models.trains.structure import COMPLEX, structure
from gearlib.models.trains.train_parameters import FALLBACK

_TORSION = "N m rad-1", "N m s rad-1"
#: Fields of bodies, shafts and meshes -> (CF units, words).
FIELDS: dict = {
    "body": {
        "inertia": ("kg m2", "inertia"),
        "mass": ("kg", "mass"),
        "support_stiffness": ("N m-1", "stiffness of the support"),
        "support_damping": ("N s m-1", "damping of the support"),
        "torsional_stiffness": (_TORSION[0], "torsional stiffness of the support"),
        "torsional_damping": (_TORSION[1], "torsional damping of the support"),
        "torque": ("N m", "torque"),
        "offset": ("m", "misplaced axis"),
    },
    "shaft": {
        "stiffness": (_TORSION[0], "torsional stiffness"),
        "damping": (_TORSION[1], "torsional damping"),
        "bending_stiffness": ("N m-1", "bending stiffness"),
        "bending_damping": ("N s m-1", "bending damping"),
    },
    "mesh": {
        "max_stiffness": ("N m-1", "maximum mesh stiffness"),
        "stiffness_ratio": ("1", "stiffness ratio kappa"),
        "contact_ratio": ("1", "contact ratio epsilon"),
        "backlash": ("m", "backlash"),
        "material_damping": ("N s m-1", "damping in contact"),
        "backlash_damping": ("N s m-1", "damping in the backlash"),
        "error": ("m", "error of assembly"),
    },
}
#: Share of the eigenvalue by which modes of one frequency may part and still be one.
_TOGETHER = 1e-9


def elements(train):
    """Return kind -> name -> element."""
    return {
        "body": train.by_name,
        "shaft": {"-".join(shaft.bodies): shaft for shaft in train.shafts},
        "mesh": {mesh.name: mesh for mesh in train.meshes},
    }


def parameters(train):
    """Return name -> (CF units, words) of the parameters of a train."""
    found = {"tuning": ("1", "tuning nu"), "load": ("N", "load, all torques in proportion")}
    for name, (units, words) in FIELDS["mesh"].items():
        found[name] = units, f"{words} of all meshes"
    for kind, named in elements(train).items():
        for label, element in named.items():
            for name, (units, words) in FIELDS[kind].items():
                axes = _elastic(element, name)
                if axes is None:
                    continue
                if name != "offset":
                    found[f"{name} of {kind} {label}"] = units, f"{words} of {kind} {label}"
                for axis in axes:
                    about = units, f"{words} of {kind} {label}, {axis}"
                    found[f"{name} of {kind} {label}, {axis}"] = about
    for component in train.components:
        found[f"initial_state of {component}"] = "1", f"{component} at the start"
    return found


def _elastic(element, name):
    """Return the axes that a field has, none for most; None: what it is of is rigid or absent."""
    if name == "offset":
        return "xy"
    if name == "mass":
        return None if element.mass is None else ""
    part, _, field = name.rpartition("_")
    if part not in ("support", "torsional") or field not in ("stiffness", "damping"):
        return ""
    stiffness = getattr(element, f"{part}_stiffness")
    if part == "torsional":
        return None if math.isinf(stiffness) else ""
    pairs = zip("xy", stiffness, strict=True)
    return "".join(axis for axis, one in pairs if math.isfinite(one)) or None


def direction(train, name):
    """Return what changes with one of `parameters`: (kind, label, field[, axis]) -> by what.

    Such a mapping itself, of a function that returns trains, is checked and returned.
    """
    if isinstance(name, dict):
        return _checked(train, "of a function", name)
    if name == "tuning" or name.startswith("initial_state of "):
        return {name: 1.0}
    if name == "load":
        return {("body", b.name, "torque"): b.torque / train.load for b in train.bodies}
    return _checked(train, name, dict.fromkeys(_places(train, name), 1.0))


def _checked(train, name, found):
    for key, slope in found.items():
        if key[0] == "mesh":
            mesh = train.meshes[train.mesh_names.index(key[1])]
            check_edges(name, mesh, {key[2]: slope})
            if key[2] == "stiffness_ratio" and mesh.stiffness_ratio == 1.0:
                raise ValueError(
                    f"sensitivities = {name!r} is not allowed at stiffness_ratio = 1.0: it must be "
                    "< 1, where the stiffness has switches"
                )
    return found


def between(ahead, behind, apart):
    """Return the direction from one train to another per unit of what sets them apart.

    None where they differ in anything else than `FIELDS`.
    """
    found: dict = {}
    fixed = []
    for train in (ahead, behind):
        parts = {kind: list(own.values()) for kind, own in elements(train).items()}
        rest = {"bodies": (), "shafts": (), "meshes": ()}
        rest = {one.name: getattr(train, one.name) for one in dataclasses.fields(train)} | rest
        fixed.append((rest, [[_without(kind, one) for one in parts[kind]] for kind in FIELDS]))
    if fixed[0] != fixed[1]:
        return None
    for kind, own in elements(ahead).items():
        for label, one in own.items():
            other = elements(behind)[kind][label]
            for field in FIELDS[kind]:
                high, low = np.ravel(getattr(one, field)), np.ravel(getattr(other, field))
                for axis, (x, y) in enumerate(zip(high, low, strict=True)):
                    # Beside what is rounding, and rigid on both sides.
                    if x is not None and x != y and abs(x - y) > 1e-12 * abs(x + y):
                        place = (axis,) if high.size > 1 else ()
                        found[(kind, label, field, *place)] = (x - y) / apart
    return found


def _without(kind, element):
    """Return the fields of an element that are not differentiated."""
    names = (one.name for one in dataclasses.fields(element))
    return [getattr(element, name) for name in names if name not in FIELDS[kind]]


def settable(train):
    """Return the parameters of elements, or of all meshes where they share one value."""
    found = []
    for name in parameters(train):
        field, _, element = name.partition(" of ")
        if element and not field.startswith("initial_") and field != "torque":
            found.append(name)
        elif name in FIELDS["mesh"] and len({getattr(one, name) for one in train.meshes}) == 1:
            found.append(name)
    return tuple(found)


def value(train, name):
    """Return the value of one of `settable`."""
    (kind, label, field, *axis), *_ = _places(train, name)
    found = getattr(elements(train)[kind][label], field)
    if not isinstance(found, tuple):
        return found
    # That of both axes is that of the first which gives.
    return found[axis[0]] if axis else next(one for one in found if math.isfinite(one))


def with_values(train, changes):
    """Return the train with some of `settable` changed and checked."""
    fields: dict = {}
    for name, new in changes.items():
        for kind, label, field, *axis in _places(train, name):
            element = fields.setdefault((kind, label), {})
            old = element.get(field, getattr(elements(train)[kind][label], field))
            if isinstance(old, tuple):
                own = [i for i, one in enumerate(old) if i in axis or not axis]
                element[field] = tuple(
                    new if i in own and math.isfinite(one) else one for i, one in enumerate(old)
                )
            else:
                element[field] = new
    changed = {
        kind: tuple(
            dataclasses.replace(one, **fields[kind, label]) if (kind, label) in fields else one
            for label, one in named.items()
        )
        for kind, named in elements(train).items()
    }
    return train.replace(bodies=changed["body"], shafts=changed["shaft"], meshes=changed["mesh"])


def _places(train, name):
    """Return the (kind, label, field[, axis]) of a parameter of elements, or of all meshes."""
    if name in FIELDS["mesh"]:
        return [("mesh", label, name) for label in train.mesh_names]
    field, element = name.split(" of ", 1)
    kind, label = element.split(" ", 1)
    axes = ()
    if label not in elements(train)[kind]:
        label, axis = label.rsplit(", ", 1)
        axes = ("xy".index(axis),)
    return [(kind, label, field, *axes)]


def along_branch(train, name):
    """Return the same for one of `gearlib.models.trains.train_parameters`, of all meshes."""
    if name == "tuning":
        return {name: 1.0}
    found = {}
    for mesh in train.meshes:
        slopes = {name: train.static_deflection if name == "backlash" else 1.0}
        if name in ("stiffness_ratio", "contact_ratio"):
            slopes = about_the_mean(mesh, name)
        check_edges(name, mesh, slopes)
        found |= {("mesh", mesh.name, field): slope for field, slope in slopes.items()}
    return found


def complex_train(train, slopes):
    """Return a copy of a train off the real axis; `slopes` are of `direction`.

    It is for `gearlib.models.trains.system.train_system`: other properties are those of the train.
    """

    def of(kind, label):
        return {key[2:]: slope for key, slope in slopes.items() if key[:2] == (kind, label)}

    meshes = tuple(
        complex_step(mesh, {key[0]: slope for key, slope in of("mesh", mesh.name).items()})
        for mesh in train.meshes
    )
    bodies, moved = elements(train)["body"], train.structure
    if any(key[0] in ("body", "shaft") for key in slopes):
        bodies = {
            name: complex_step(one, _keys(one, of("body", name))) for name, one in bodies.items()
        }
        moved = _structure(train, bodies, of)
    frequencies, own, _ = train.excitation
    (deflection, speed), stretches = _scales(train, moved, meshes)
    made = copy(train)
    vars(made).pop("_system", None)
    vars(made).update(meshes=meshes, by_name=bodies)
    constants = waves.excited(made, train.structure.arms, COMPLEX)[1]
    vars(made).update(
        structure=moved,
        far_lines=train.far_lines,
        segments=train.segments,
        excitation=(frequencies, own, constants),
        static_deflection=deflection,
        loaded_stretches=stretches,
        reference_angular_frequency=speed,
        # Any: only the length of steps depends on it.
        norm=lambda parts: 1.0,
    )
    return made


def _structure(train, bodies, of):
    """Return the `Structure` off the real axis; `of` gives the slopes of an element."""
    own = train.structure
    shafts = [
        complex_step(one, _keys(one, of("shaft", label)))
        for label, one in elements(train)["shaft"].items()
    ]
    moved = structure(bodies, train.meshes, shafts, COMPLEX)
    force = moved.load.imag / STEP
    turning = np.abs(train.free_motions.T @ force)
    if (turning > 1e-9 * np.abs(train.free_motions.T) @ np.abs(force)).any():
        raise ValueError(
            "sensitivities is not allowed by a torque that turns the train: it must be 'load', "
            "all torques in proportion"
        )
    # Directions lie on the axis.
    directions = ("motions", "lines", "across", "arms", "springs", "masses")
    return moved._replace(**{name: getattr(own, name) for name in directions})


def _keys(element, slopes):
    """Return slopes by field and axis as `complex_step` has them: of two axes each for itself."""
    found: dict = {}
    for (name, *axes), slope in slopes.items():
        if isinstance(getattr(element, name), tuple):
            keys = [(name, axis) for axis in axes or (0, 1)]
        else:
            keys = [name]
        for key in keys:
            found[key] = found.get(key, 0.0) + slope
    return found


def _scales(train, moved, meshes):
    """Return scales and stretches under the load off the real axis.

    The scales are the static deflection and the reference angular frequency.
    """
    lines, (squares, shapes) = train.structure.lines, train.linear_modes
    means = np.array([mesh.mean_stiffness for mesh in meshes])
    change = (moved.stiffness + lines.T @ (means[:, None] * lines)).imag
    force = moved.load.imag - change @ train.linear_deflection
    rates = train.linear_stretches @ (shapes.T @ force / squares)
    stretches, deflection = train.loaded_stretches + 1j * rates, train.static_deflection + 0j
    if deflection != FALLBACK:
        own = stretches[train.mesh_names.index(train.reference)]
        deflection += 1j * own.imag * np.sign(own.real)
    speed = train.reference_angular_frequency + 0j
    if train.reference_frequency is None:
        square = speed.real**2
        modes = shapes[:, np.abs(squares - square) < 1e-6 * square]
        # Modes of one frequency have a derivative where they stay together.
        rates = np.linalg.eigvalsh(modes.T @ (change - square * moved.mass.imag) @ modes) / STEP
        size = np.linalg.norm(change) + square * np.linalg.norm(moved.mass.imag)
        size *= np.linalg.norm(modes) ** 2 / STEP
        if np.ptp(rates) > _TOGETHER * size:
            raise ValueError(
                "reference_frequency = None is not allowed for derivatives by what parts the modes "
                f"of that frequency: it must be given, as {speed.real / (2.0 * math.pi):.6g} (Hz)"
            )
        speed += 1j * STEP * rates[0] / (2.0 * speed.real)
    return (deflection, speed), stretches


def static_state(train, found, twin):
    """Return the start in static equilibrium, `found`, off the real axis, shape (size,)."""
    n = train.size // 2
    _, waves, constants = train.excitation
    low = train.segments_of(0, 1).low[:, 0]
    stiffness, force = twin.structure.stiffness.astype(complex), twin.structure.load + 0j
    for j, (mesh, line) in enumerate(zip(twin.meshes, twin.structure.lines, strict=True)):
        code = found.contact[j]
        if code in (NORMAL, INVERSE):
            side = 1 if code == NORMAL else 0
            level = mesh.max_stiffness * (mesh.stiffness_ratio if low[side, j] else 1.0)
            gap = twin.excitation[2][side, j] + waves[side, j, ::2].sum()
            line = line if side else twin.far_lines[j]
            stiffness += level * np.outer(line, line)
            force -= level * (gap + (0.0 if side else mesh.backlash)) * line
    # No part in free motions.
    free = twin.structure.mass @ train.free_motions
    size = np.abs(stiffness).max() / max(np.abs(free).max(initial=0.0), 1e-300)
    whole = np.block([[stiffness, size * free], [size * free.T, np.zeros((free.shape[1],) * 2)]])
    found = np.linalg.solve(whole, np.append(force, np.zeros(free.shape[1])))[:n]
    return np.append(found / twin.static_deflection, np.zeros(n, complex))
