"""`GearTrain.from_matrices`: trains from the matrices of other software, and their reduction.

Coordinates are displacements in m and rotations in rad. A gear is a node with up to four of them,
on which the mesh force acts along the line of action and, as a torque, about the axis.
"""

import hashlib
import math
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import scipy.io
import scipy.linalg
import scipy.sparse
import xarray as xr
from annotated_types import MinLen
from pydantic import AllowInfNan

from gearlib import checks, parameters
from gearlib.models.trains import waves
from gearlib.models.trains.elements import Body, Mesh
from gearlib.models.trains.structure import (
    FLOAT_ARITHMETIC,
    Arithmetic,
    Structure,
    scale_to_unit_diagonal,
    structure_from_matrices,
)
from gearlib.models.trains.train import GearTrain
from gearlib.parameters import (
    Angle,
    Finite,
    Length,
    Positive,
    Teeth,
    Text,
    Unit,
    Values,
    checked,
    declared,
    described,
)

#: Tolerance of symmetry checks, relative to the largest entry of the matrix.
_SYMMETRY_TOLERANCE = 1e-9
#: Entries of a basis or a reduced matrix below this fraction of their terms are rounding errors.
_ROUNDING_TOLERANCE = 1e-12
#: A reduction keeps the modes up to this multiple of its frequency.
_FREQUENCY_MARGIN = 1.5
#: Eigenvalues below this fraction of the squared cutoff frequency belong to rigid-body modes.
_RIGID_BODY_TOLERANCE = 1e-6
#: Smallest eigenvalue of the modal mass matrix of independent modes with unit modal mass.
_INDEPENDENCE_TOLERANCE = 1e-8


@declared()
class GearNode:
    """A gear of a structure that is given by its matrices; immutable.

    `rotation`, `x`, `y` and `axial` are names of coordinates of the structure; None means that the
    gear cannot move in this direction.
    """

    name: Annotated[Text, described("Name of the gear")]
    teeth: Annotated[Teeth, described("Number of teeth")]
    base_radius: Annotated[Length, described("Base radius")]
    rotation: Annotated[Text | None, described("Rotation about its axis, rad")] = None
    x: Annotated[Text | None, described("Displacement along x")] = None
    y: Annotated[Text | None, described("Displacement along y")] = None
    axial: Annotated[Text | None, described("Displacement along its axis")] = None
    base_helix_angle: Annotated[
        Angle, described("Base helix angle of an axial force; > 0 for a right-hand helix")
    ] = 0.0


@dataclass(frozen=True, eq=False)
class Matrices:
    """The matrices of a structure with n coordinates in SI units."""

    coordinates: tuple[str, ...]  #: names of the coordinates
    mass: np.ndarray  #: shape (n, n)
    damping: np.ndarray  #: including gyroscopic forces, shape (n, n)
    stiffness: np.ndarray  #: without the meshes, shape (n, n)
    load: np.ndarray  #: constant forces and torques, shape (n,)
    gears: tuple[GearNode, ...]
    rows: dict[str, np.ndarray]  #: mesh name -> row that replaces the computed row, (n,)
    left_out: str = ""  #: description of the coordinates neglected by a reduction

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Matrices) and self.digest() == other.digest()

    def __hash__(self) -> int:
        return hash(self.digest())

    def digest(self) -> str:
        """Return a hash (SHA-256, hexadecimal) of all names and numbers.

        Datasets store this hash instead of the matrices.
        """
        arrays = self.mass, self.damping, self.stiffness, self.load, *self.rows.values()
        hasher = hashlib.sha256(repr((self.coordinates, self.gears, list(self.rows))).encode())
        for array in arrays:
            hasher.update(np.ascontiguousarray(array).tobytes())
        return hasher.hexdigest()

    @property
    def is_symmetric(self) -> bool:
        """Whether the stiffness matrix is symmetric, so that a potential energy exists."""
        return _asymmetry(self.stiffness) <= _SYMMETRY_TOLERANCE

    def coordinate_row(self, coordinate: str | None) -> np.ndarray:
        """Return the unit row vector of the coordinate with this name, or zeros for None."""
        return np.array([float(name == coordinate) for name in self.coordinates])

    def structure(self, train: GearTrain, arithmetic: Arithmetic = FLOAT_ARITHMETIC) -> Structure:
        """Return the `Structure` of a train with these matrices, in floats or balls (intervals)."""
        return structure_from_matrices(self, train.by_name, train.meshes, arithmetic)


def _asymmetry(matrix: np.ndarray) -> float:
    """Return the maximum of |A - A^T| relative to the largest entry of a matrix A."""
    return float(np.abs(matrix - matrix.T).max() / (np.abs(matrix).max() or 1.0))


@checked
def from_matrices(
    mass: Any,
    damping: Any,
    stiffness: Any,
    meshes: Annotated[tuple[Mesh, ...], Values(), MinLen(1)],
    gears: Annotated[tuple[GearNode, ...], Values(), MinLen(2)],
    *,
    gyroscopic: Any = None,
    speed: Annotated[float | None, AllowInfNan(False), Unit("rad/s")] = None,
    coordinates: Annotated[tuple[Text, ...] | None, Values()] = None,
    forces: Any = None,
    rows: Any = None,
    harmonic_forces: Any = (),
    reference: Any = None,
    reference_frequency: Any = None,
    modal_damping: Any = None,
) -> GearTrain:
    """Return a gear train whose structure is given by matrices in SI units.

    Parameters
    ----------
    mass, damping, stiffness : array-like, sparse array or path
        Square matrices without the meshes, or files: .mtx (Matrix Market) or netCDF with one
        variable. The mass matrix must be symmetric and positive definite. Stiffness and damping may
        be unsymmetric, as for journal bearings; the symmetric part of the stiffness must have no
        negative eigenvalue.
    meshes : sequence of Mesh
        Meshes with the names of their gears, positions, pressure angle, stiffness levels, backlash,
        damping and deviations.
    gears : sequence of GearNode
        Gears: teeth, base radius, and the coordinates of their motions.
    gyroscopic : array-like, optional
        Skew-symmetric matrix, e.g. G of ROSS; its product with the speed is added to the damping.
    speed : float, optional
        Constant speed in rad/s of the gyroscopic forces; required with `gyroscopic`.
    coordinates : sequence of str, optional
        Names of the coordinates; "0", "1", ... by default.
    forces : dict of str to float, optional
        Constant forces (N) and torques (N m) by the name of a coordinate.
    rows : dict of str to array-like, optional
        Row vectors of meshes by name, which map the coordinates to the approach of the flanks along
        the line of action in m; they replace the row vectors computed from the gears.
    harmonic_forces : sequence of HarmonicForce, optional
        Harmonic forces and torques on gears or coordinates.
    reference, reference_frequency, modal_damping : optional
        As in `GearTrain`.

    Returns
    -------
    GearTrain
        A train whose bodies are the gears.

    Raises
    ------
    ValueError
        If shapes differ, the mass is not symmetric and positive definite, a name is unknown, or the
        structure cannot carry the load.
    """
    mass_matrix = _read_square_matrix("mass", mass)
    n = len(mass_matrix)
    stiffness_matrix = _read_square_matrix("stiffness", stiffness, n)
    damping_matrix = _read_square_matrix("damping", damping, n)
    lowest_eigenvalue = np.linalg.eigvalsh(mass_matrix)[0]
    valid = _asymmetry(mass_matrix) <= _SYMMETRY_TOLERANCE and lowest_eigenvalue > 0.0
    value = f"a matrix with the eigenvalue {lowest_eigenvalue:.6g}"
    checks.require(valid, "mass", value, "symmetric and positive definite")
    _check_no_negative_stiffness(stiffness_matrix)
    both_or_none = (gyroscopic is None) == (speed is None)
    checks.require(both_or_none, "speed", speed, "given if and only if gyroscopic is given")
    if gyroscopic is not None:
        skew = _read_square_matrix("gyroscopic", gyroscopic, n)
        tolerance = _SYMMETRY_TOLERANCE * np.abs(skew).max(initial=1e-300)
        valid = np.abs(skew + skew.T).max() <= tolerance
        checks.require(valid, "gyroscopic", "another matrix", "a skew-symmetric matrix")
        damping_matrix = damping_matrix + speed * skew
    names = tuple(map(str, range(n))) if coordinates is None else coordinates
    checks.require(len({*names}) == n == len(names), "coordinates", names, f"{n} different names")
    load = np.zeros(n)
    for name, force in _require_dict("forces", forces).items():
        checks.check_choice("forces", name, names)
        load[names.index(name)] = parameters.check(f"forces[{name!r}]", force, Finite)
    for gear in gears:
        for axis in ("rotation", "x", "y", "axial"):
            if getattr(gear, axis) is not None:
                checks.check_choice(f"{axis} of gear {gear.name}", getattr(gear, axis), names)
    mesh_rows = {}
    for name, row in _require_dict("rows", rows).items():
        checks.check_choice("rows", name, [mesh.name for mesh in meshes])
        allowed = f"{n} finite numbers, one for each coordinate"
        valid = np.shape(row) == (n,) and np.isfinite(np.asarray(row, float)).all()
        checks.require(valid, f"rows[{name!r}]", row, allowed)
        mesh_rows[name] = np.array(row, float)
    bodies = [
        Body(name=gear.name, inertia=1.0, base_radius=gear.base_radius, teeth=gear.teeth)
        for gear in gears
    ]
    matrices = Matrices(
        names, mass_matrix, damping_matrix, stiffness_matrix, load, gears, mesh_rows
    )
    return GearTrain(
        bodies=bodies,
        meshes=meshes,
        matrices=matrices,
        reference=reference,
        reference_frequency=reference_frequency,
        forces=harmonic_forces,
        modal_damping=modal_damping,
    )


def _require_dict(name: str, value: Any) -> dict:
    """Return `value` if it is a dict, or {} if it is None; otherwise raise ValueError.

    `name` is the name of the argument for the error message.
    """
    checks.require(isinstance(value, dict | None), name, value, "a dict")
    return value or {}


def _check_no_negative_stiffness(stiffness: np.ndarray) -> None:
    """Raise ValueError if the symmetric part of a stiffness matrix has a negative eigenvalue.

    Such a structure would be unstable without its meshes. Rounding errors are tolerated.
    """
    scaled, _ = scale_to_unit_diagonal((stiffness + stiffness.T) / 2.0)
    lowest_eigenvalue = np.linalg.eigvalsh(scaled)[0]
    allowed = "a matrix whose symmetric part has no negative eigenvalue"
    value = f"a matrix with the eigenvalue {lowest_eigenvalue:.6g}, scaled to unit diagonal"
    checks.require(lowest_eigenvalue >= -_SYMMETRY_TOLERANCE, "stiffness", value, allowed)


def _read_square_matrix(name: str, value: Any, n: int | None = None) -> np.ndarray:
    """Convert an argument of `from_matrices` to a square array of finite numbers.

    `name` is the name of the argument, and `value` is an array, a sparse array or a file path.
    Raises ValueError if the array is not square, or if `n` is given and it does not have `n` rows.
    """
    array = _to_dense_array(name, value)
    allowed = "a square matrix of finite numbers"
    if n is None:
        valid = array.ndim == 2 and array.shape[0] == array.shape[1]
    else:
        valid = array.shape == (n, n)
        allowed = f"{allowed} with {n} rows, as many as in mass"
    valid = valid and array.size > 0 and bool(np.isfinite(array).all())
    checks.require(valid, name, f"an array of shape {array.shape}", allowed)
    return array


def _to_dense_array(name: str, value: Any) -> np.ndarray:
    """Convert a matrix to a dense array of floats.

    `value` is an array, nested lists, a sparse array, or the path of a .mtx file (Matrix Market) or
    a .nc file (netCDF with one variable). `name` is the name of the argument for error messages.
    """
    if isinstance(value, str | Path):
        path = Path(value)
        suffix = checks.check_choice(f"suffix of {name}", path.suffix, (".mtx", ".nc"))
        if suffix == ".nc":
            with xr.open_dataset(path) as dataset:
                count = f"{len(dataset.data_vars)} variables"
                allowed = "a netCDF file with one variable"
                checks.require(len(dataset.data_vars) == 1, f"{name} in {path}", count, allowed)
                value = next(iter(dataset.data_vars.values())).values
        else:
            path.stat()  # This raises FileNotFoundError with the name of the file.
            value = scipy.io.mmread(path)
    if scipy.sparse.issparse(value):
        value = value.toarray()
    try:
        return np.array(value, float)
    except (TypeError, ValueError):
        raise checks.InputError(name, value, "a square matrix of numbers") from None


def _project_matrix(matrix: np.ndarray, basis: np.ndarray) -> np.ndarray:
    """Return basis.T @ matrix @ basis, with rounding errors set to 0.

    `matrix` has the shape (n, n), and `basis`, shape (n, r), has one vector per column. Entries are
    rounding errors if they are below 1e-12 times the sum of the magnitudes of their terms.
    """
    projection = basis.T @ matrix @ basis
    magnitudes = np.abs(basis).T @ np.abs(matrix) @ np.abs(basis)
    return np.where(np.abs(projection) > _ROUNDING_TOLERANCE * magnitudes, projection, 0.0)


@checked
def reduce_train(train: GearTrain, frequency: Positive) -> GearTrain:
    """Reduce a train given by matrices by the method of Craig and Bampton.

    Interior coordinates, on which no mesh, load or harmonic force acts, are replaced by modes, and
    correction modes add the quasi-static response of the neglected modes. The dynamics remain
    unchanged up to half the `frequency`, which is in Hz.
    """
    matrices = train.matrices
    allowed = "a train made by GearTrain.from_matrices"
    checks.require(matrices is not None, "train", type(train).__name__, allowed)
    structure, n = train.structure, len(matrices.coordinates)
    boundary = _boundary_coordinates(train)
    interior = np.setdiff1d(np.arange(n), boundary)
    if interior.size == 0:
        return train
    stiffness = (matrices.stiffness + matrices.stiffness.T) / 2.0
    mass = matrices.mass
    interior_mass = mass[np.ix_(interior, interior)]
    interior_stiffness = stiffness[np.ix_(interior, interior)]
    coupling = np.ix_(interior, boundary)
    cutoff_eigenvalue = (math.tau * frequency * _FREQUENCY_MARGIN) ** 2
    eigenvalues, shapes = scipy.linalg.eigh(interior_stiffness, interior_mass)
    interior_modes = shapes[:, eigenvalues < cutoff_eigenvalue]
    # An additional spring resists rigid-body modes of the interior, for which the matrix would be
    # singular.
    is_rigid_body_mode = eigenvalues < _RIGID_BODY_TOLERANCE * cutoff_eigenvalue
    momentum = interior_mass @ shapes[:, is_rigid_body_mode]
    spring = cutoff_eigenvalue * (momentum @ momentum.T)
    factor = scipy.linalg.cho_factor(interior_stiffness + spring)
    constraint_modes = -scipy.linalg.cho_solve(factor, stiffness[coupling])
    # The correction modes are the quasi-static response of the neglected modes to the inertia
    # forces of the constraint modes.
    inertia = interior_mass @ constraint_modes + mass[coupling]
    responses = scipy.linalg.cho_solve(factor, inertia)
    responses = responses - interior_modes @ (interior_modes.T @ (interior_mass @ responses))
    correction_modes = _orthonormalize(responses, interior_mass)
    interior_modes = np.hstack([interior_modes, correction_modes])
    basis = np.zeros((n, boundary.size + interior_modes.shape[1]))
    basis[boundary, : boundary.size] = np.eye(boundary.size)
    basis[interior, : boundary.size] = constraint_modes
    basis[interior, boundary.size :] = interior_modes
    weighted = np.sqrt(mass.diagonal())[:, None] * np.abs(basis)
    basis[weighted < _ROUNDING_TOLERANCE * np.linalg.norm(weighted, axis=0)] = 0.0
    names = [matrices.coordinates[i] for i in boundary]
    names += [f"interior mode {i + 1}" for i in range(interior_modes.shape[1])]
    reduced_mass = _project_matrix(mass, basis)
    mesh_jacobian = structure.mesh_jacobian @ basis
    reduced_matrices = replace(
        matrices,
        coordinates=tuple(names),
        mass=(reduced_mass + reduced_mass.T) / 2.0,
        damping=_project_matrix(matrices.damping, basis),
        stiffness=_project_matrix(matrices.stiffness, basis),
        load=matrices.load @ basis,
        rows={mesh.name: row for mesh, row in zip(train.meshes, mesh_jacobian, strict=True)},
        left_out=(
            f"{n - basis.shape[1]} of {n} coordinates: interior modes above "
            f"{frequency * _FREQUENCY_MARGIN:.6g} Hz, except their response to the inertia forces "
            "of the boundary"
        ),
    )
    return train.replace(matrices=reduced_matrices)


def _orthonormalize(vectors: np.ndarray, mass: np.ndarray) -> np.ndarray:
    """Orthonormalize the columns of `vectors`, (n, k), with respect to the mass matrix, (n, n).

    Nearly linearly dependent combinations are omitted.
    """
    norms = np.sqrt(np.einsum("ij,ik,kj->j", vectors, mass, vectors))
    vectors = vectors[:, norms > 0.0] / norms[norms > 0.0]
    eigenvalues, eigenvectors = np.linalg.eigh(vectors.T @ mass @ vectors)
    is_independent = eigenvalues > _INDEPENDENCE_TOLERANCE
    return vectors @ eigenvectors[:, is_independent] / np.sqrt(eigenvalues[is_independent])


def _boundary_coordinates(train: GearTrain) -> np.ndarray:
    """Return the indices of the boundary coordinates of a train given by matrices.

    A reduction must keep these coordinates, because meshes, gears, constant loads or harmonic
    forces act on them.
    """
    structure = train.structure
    motions = structure.motions.reshape(-1, structure.motions.shape[2])
    rows = [structure.mesh_jacobian, motions, train.matrices.load[None]]
    rows += [waves.force_direction(train, force, structure.motions)[None] for force in train.forces]
    return np.flatnonzero(np.abs(np.concatenate(rows)).max(axis=0) > 0.0)
