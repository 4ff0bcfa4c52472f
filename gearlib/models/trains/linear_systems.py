"""State space of a train about its loaded state with mean stiffness, and frequency response."""

import math
from typing import Any

import numpy as np
import xarray as xr
from scipy.signal import StateSpace

from gearlib import checks
from gearlib.data.variables import add_metadata
from gearlib.models.trains.natural_modes import state_matrix, total_damping
from gearlib.models.trains.structure import AXES


def state_space(model: Any, inputs: Any = None, outputs: Any = None) -> StateSpace:
    """Return the linear state space of a train about its loaded state, in SI units.

    All flanks are in contact at mean stiffness; the states are the coordinates and their rates.

    Parameters
    ----------
    model : GearTrain or SixDegreePair
        The model; each mesh must have a damping.
    inputs : sequence of str, optional
        Forces, "x of sun", "y of sun" (N), or torques, "rotation of sun" (N m); by default the
        torques on all bodies. A train made by `GearTrain.from_matrices` also accepts the names of
        its coordinates.
    outputs : sequence of str, optional
        "displacement", "velocity" or "acceleration" followed by the name of an input, as in
        "acceleration x of sun" (m or rad, per s or s^2); "mesh force of sun 1" (N); "bearing force
        x of sun" (N). By default all mesh forces.

    Returns
    -------
    scipy.signal.StateSpace
        The matrices A, B, C and D. The attributes ``input_names`` and ``output_names`` are the
        names of inputs and outputs.

    Raises
    ------
    ValueError
        If a name is unknown, a mesh has no damping, or the model has no bodies.
    """
    train = checks.require_train(model)
    structure = train.structure
    damping = total_damping(train)
    checks.require(damping is not None, "material_damping", None, "given for each mesh")
    a, n = state_matrix(train, damping), len(damping)
    motion_rows = _motion_rows(train)
    if inputs is None:
        inputs = [f"rotation of {name}" for name in train.body_names]
    mesh_force_names = [f"mesh force of {name}" for name in train.mesh_names]
    inputs = list(inputs)
    outputs = mesh_force_names if outputs is None else list(outputs)
    for name in inputs:
        checks.check_choice("inputs", name, list(motion_rows))
    input_rows = np.array([motion_rows[name] for name in inputs])
    b = np.vstack([np.zeros((n, len(inputs))), np.linalg.solve(structure.mass, input_rows.T)])
    c, d = np.zeros((len(outputs), 2 * n)), np.zeros((len(outputs), len(inputs)))
    for i, name in enumerate(outputs):
        quantity, _, motion = name.partition(" ")
        if name in mesh_force_names:
            j = mesh_force_names.index(name)
            mesh, row = train.meshes[j], structure.mesh_jacobian[j]
            c[i] = np.concatenate([mesh.mean_stiffness * row, mesh.known_damping * row])
        elif name.startswith("bearing force "):
            c[i] = _bearing_force_row(train, name.removeprefix("bearing force "))
        elif quantity == "displacement" and motion in motion_rows:
            c[i, :n] = motion_rows[motion]
        elif quantity == "velocity" and motion in motion_rows:
            c[i, n:] = motion_rows[motion]
        elif quantity == "acceleration" and motion in motion_rows:
            c[i], d[i] = motion_rows[motion] @ a[n:], motion_rows[motion] @ b[n:]
        else:
            allowed = (
                "displacement, velocity or acceleration followed by a motion such as rotation of "
                f"{train.body_names[0]}, or {mesh_force_names[0]}, or a bearing force"
            )
            raise checks.InputError("outputs", name, allowed)
    system = StateSpace(a, b, c, d)
    system.input_names, system.output_names = tuple(inputs), tuple(outputs)
    return system


def _motion_rows(train: Any) -> dict[str, np.ndarray]:
    """Return the row vectors, shape (n,), that map the n coordinates to named motions, as a dict.

    Motions are called e.g. "x of sun", "y of sun" (m) and "rotation of sun" (rad). In a train given
    by matrices, each coordinate is also a motion under its own name.
    """
    rows = {}
    for body, motions in zip(train.bodies, train.structure.motions, strict=True):
        for axis, row in zip(AXES, motions, strict=True):
            # `motions` contains rotations as arc lengths on the base circle.
            scale = body.base_radius if axis == "rotation" else 1.0
            rows[f"{axis} of {body.name}"] = row / scale
    if train.matrices is not None:
        for name in train.matrices.coordinates:
            rows[name] = train.matrices.coordinate_row(name)
    return rows


def _bearing_force_row(train: Any, motion: str) -> np.ndarray:
    """Return the row vector that maps a state to the force of a body on its elastic support in N.

    A state consists of n coordinates and n rates, so that the row has the shape (2 n,). `motion`
    names the direction and the body, e.g. "x of sun". Raises ValueError if the body has no elastic
    support in this direction, is on a carrier, or belongs to a train given by matrices.
    """
    axis, _, body_name = motion.partition(" of ")
    checks.check_choice("bearing force of", body_name, train.body_names)
    checks.check_choice(f"bearing force of {body_name} along", axis, ("x", "y"))
    body, i = train.by_name[body_name], "xy".index(axis)
    stiffness, damping = body.support_stiffness[i], body.support_damping[i]
    allowed = "a body with an elastic support, which is not on a carrier"
    is_elastic = math.isfinite(stiffness) and stiffness > 0.0
    valid = is_elastic and body.carrier is None and train.matrices is None
    checks.require(valid, "bearing force of", body_name, allowed)
    row = train.structure.motions[train.body_names.index(body_name), i]
    return np.concatenate([stiffness * row, damping * row])


def frequency_response(system: StateSpace, frequencies: Any) -> xr.Dataset:
    """Return the frequency response of a state space, C (i omega I - A)^-1 B + D.

    Parameters
    ----------
    system : scipy.signal.StateSpace
        State space with the matrices A, B, C and D, such as the result of `GearTrain.state_space`.
    frequencies : array-like
        Frequencies omega / (2 pi), Hz.

    Returns
    -------
    xarray.Dataset
        Over ``frequency``, ``output`` and ``input``: response_amplitude and response_phase (rad).

    Raises
    ------
    ValueError
        If `system` is not a `scipy.signal.StateSpace`.
    """
    allowed = "a scipy.signal.StateSpace"
    checks.require(isinstance(system, StateSpace), "system", system, allowed)
    frequencies = np.atleast_1d(np.asarray(frequencies, float))
    identity = np.eye(len(system.A))
    responses = []
    for frequency in frequencies:
        state_response = np.linalg.solve(2j * math.pi * frequency * identity - system.A, system.B)
        responses.append(system.C @ state_response + system.D)
    response = np.array(responses)
    # Inputs and outputs of other state spaces have no names, so that numbers are used.
    output_numbers = [str(i) for i in range(len(system.C))]
    input_numbers = [str(i) for i in range(system.B.shape[1])]
    dims = "frequency", "output", "input"
    data = {
        "response_amplitude": (dims, np.abs(response)),
        "response_phase": (dims, np.angle(response)),
    }
    coords = {
        "frequency": frequencies,
        "output": list(getattr(system, "output_names", output_numbers)),
        "input": list(getattr(system, "input_names", input_numbers)),
    }
    return add_metadata(xr.Dataset(data, coords, {"title": "Frequency response of a gear train"}))
