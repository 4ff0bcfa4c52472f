"""State space of a train about its loaded state in mean stiffness, and its frequency response."""

import math
from typing import Any

import numpy as np
import xarray as xr
from scipy.signal import StateSpace

from gearlib import checks
from gearlib.data.variables import describe
from gearlib.models.trains.natural_modes import mean_stiffness_matrix, total_damping

_AXES = ("x", "y", "rotation")


def state_space(model: Any, inputs: Any = None, outputs: Any = None) -> StateSpace:
    """Return the linear state space of a train about its loaded state, in SI units.

    All flanks touch with their mean stiffness; states are the coordinates and their rates.

    Parameters
    ----------
    model : GearTrain or SixDegreePair
        The gears; every mesh must have a damping.
    inputs : sequence of str, optional
        Forces, "x of sun", "y of sun" (N), or torques, "rotation of sun" (N m); by default the
        torques on all bodies. Of given matrices also the name of a coordinate.
    outputs : sequence of str, optional
        "displacement", "velocity" or "acceleration" followed by one of these, as in "acceleration x
        of sun" (m or rad, by s and s^2); "mesh force of sun 1" (N); "bearing force x of sun" (N).
        By default all mesh forces.

    Returns
    -------
    scipy.signal.StateSpace
        A, B, C and D; its attributes ``input_names`` and ``output_names`` are these names.

    Raises
    ------
    ValueError
        If a name is unknown, a mesh has no damping, or the model has no bodies.
    """
    train = checks.train_of(model)
    structure = train.structure
    damping = total_damping(train)
    checks.require(damping is not None, "material_damping", None, "given for every mesh")
    stiffness, inverse = mean_stiffness_matrix(train), np.linalg.inv(structure.mass)
    n = len(stiffness)
    a = np.zeros((2 * n, 2 * n))
    a[:n, n:] = np.eye(n)
    a[n:] = np.hstack([-inverse @ stiffness, -inverse @ damping])
    rows = _motion_rows(train)
    torques = [f"rotation of {name}" for name in train.body_names]
    inputs = torques if inputs is None else list(inputs)
    forces = [f"mesh force of {name}" for name in train.mesh_names]
    outputs = forces if outputs is None else list(outputs)
    for name in inputs:
        checks.one_of("inputs", name, list(rows))
    b = np.vstack([np.zeros((n, len(inputs))), inverse @ np.array([rows[x] for x in inputs]).T])
    c, d = np.zeros((len(outputs), 2 * n)), np.zeros((len(outputs), len(inputs)))
    for i, name in enumerate(outputs):
        kind, _, place = name.partition(" ")
        if name in forces:
            j = forces.index(name)
            mesh, line = train.meshes[j], structure.lines[j]
            c[i] = np.concatenate([mesh.mean_stiffness * line, mesh.known_damping * line])
        elif name.startswith("bearing force "):
            c[i] = _bearing_force(train, name.removeprefix("bearing force "))
        elif kind in ("displacement", "velocity", "acceleration") and place in rows:
            row = rows[place]
            if kind == "acceleration":
                c[i], d[i] = row @ a[n:], row @ b[n:]
            else:
                half = slice(0, n) if kind == "displacement" else slice(n, 2 * n)
                c[i, half] = row
        else:
            allowed = (
                "displacement, velocity or acceleration and a motion, such as rotation of "
                f"{train.body_names[0]}, or {forces[0]}, or a bearing force"
            )
            raise checks.refusal("outputs", name, allowed)
    system = StateSpace(a, b, c, d)
    system.input_names, system.output_names = tuple(inputs), tuple(outputs)
    return system


def _motion_rows(train: Any) -> dict[str, np.ndarray]:
    """Return the row vector of each motion by its name; rotations in rad."""
    rows = {}
    for body, motions in zip(train.bodies, train.structure.motions, strict=True):
        for axis, row in zip(_AXES, motions, strict=True):
            scale = body.base_radius if axis == "rotation" else 1.0
            rows[f"{axis} of {body.name}"] = row / scale
    if train.matrices is not None:
        for name in train.matrices.coordinates:
            rows[name] = train.matrices.motion(name)
    return rows


def _bearing_force(train: Any, name: str) -> np.ndarray:
    """Return the row of the force of an elastic support on the states, for "x of sun"."""
    axis, _, owner = name.partition(" of ")
    checks.one_of("bearing force of", owner, train.body_names)
    checks.one_of(f"bearing force of {owner} along", axis, ("x", "y"))
    body, i = train.by_name[owner], "xy".index(axis)
    stiffness, damping = body.support_stiffness[i], body.support_damping[i]
    allowed = "a body with an elastic support, which is not on a carrier"
    valid = math.isfinite(stiffness) and stiffness > 0.0 and body.carrier is None
    checks.require(valid and train.matrices is None, "bearing force of", owner, allowed)
    row = train.structure.motions[train.body_names.index(owner), i]
    return np.concatenate([stiffness * row, damping * row])


def frequency_response(system: StateSpace, frequencies: Any) -> xr.Dataset:
    """Return the frequency response of a state space, C (i omega - A)^-1 B + D.

    Parameters
    ----------
    system : scipy.signal.StateSpace
        System, such as that of `GearTrain.state_space`.
    frequencies : array-like
        Frequencies, Hz.

    Returns
    -------
    xarray.Dataset
        Over ``frequency``, ``output`` and ``input``: response_amplitude and response_phase (rad).

    Raises
    ------
    ValueError
        If `system` is no state space.
    """
    valid, allowed = isinstance(system, StateSpace), "a scipy.signal.StateSpace"
    checks.require(valid, "system", system, allowed)
    frequencies = np.atleast_1d(np.asarray(frequencies, float))
    identity = np.eye(len(system.A))
    values = np.array(
        [
            system.C @ np.linalg.solve(2j * math.pi * f * identity - system.A, system.B) + system.D
            for f in frequencies
        ]
    )
    outputs, inputs = (
        list(getattr(system, f"{kind}_names", map(str, range(count))))
        for kind, count in (("output", len(system.C)), ("input", system.B.shape[1]))
    )
    dims = "frequency", "output", "input"
    data = {
        "response_amplitude": (dims, np.abs(values)),
        "response_phase": (dims, np.angle(values)),
    }
    coords = {"frequency": frequencies, "output": outputs, "input": inputs}
    return describe(xr.Dataset(data, coords, {"title": "Frequency response of a gear train"}))
