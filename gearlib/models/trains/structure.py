"""Mass, stiffness and damping matrices of a gear train in SI units.

The axis of a body moves by (x, y), and the body rotates by u = r theta, an arc length on its base
circle with the radius r. Each of these motions is the product of a row vector and the coordinates
q, so that rigid supports and rigid pins of a carrier need no coordinates. With the row vectors f of
supports, pins and shafts, the matrices are

    K = sum k f^T f,   D = sum d f^T f,   M = sum m (x^T x + y^T y) + I / r^2 u^T u.

The flank distances d are linear in q; the rows b_j are the mesh Jacobian:

    d_j = b_j q + e_j(t),   b_j = e . (x, y)_pinion - e . (x, y)_wheel + u_pinion + u_wheel

with the direction e of the line of action. In an internal mesh, pinion and wheel are exchanged and
the rotation of the pinion is negative; with direction -1 both rotations change their signs.
Friction acts across the line of action. It is positive in the direction in which the gear with +e
slides on the other gear after the pitch point.

In a frame that rotates at the speed W, displacements are measured from positions that also follow
the small rotation of the carrier. There, static forces of pins, supports and meshes keep their
directions, and a rotation of the whole train needs no force. The axis of a body is subject to the
Coriolis force m (2 W y', -2 W x') and to a centrifugal force m W^2 times its displacement; on a pin
at the radius r the force m W^2 r is added. Fixed supports damp x' - W y and y' + W x.
`docs/theory/trains.md` derives these terms.
"""

import math
from typing import Any, NamedTuple

import numpy as np


class Arithmetic(NamedTuple):
    """Number type of the matrices of a train: floats or balls.

    A ball is an interval given by a midpoint and an error bound, as in ball arithmetic.
    """

    dtype: type  #: data type of arrays, `object` for balls
    convert: Any  #: function from a float to a number of this type
    cos_sin: Any  #: function from an angle in rad to its cosine and sine
    polar: Any  #: function from components x, y of a vector to its length and angle in rad
    pi: Any

    def zeros(self, *shape: int) -> np.ndarray:
        """Return an array of zeros of this number type with the given shape."""
        if self.dtype is not object:  # Balls are Python objects.
            return np.zeros(shape, self.dtype)
        return np.array([self.convert(0.0)] * math.prod(shape), object).reshape(shape)

    def rotate_axes(self, rows: Any, angle: Any) -> np.ndarray:
        """Transform the rows of a planar motion from rotated axes to the axes x and y.

        `rows`, shape (2, n), map n coordinates to the motion along two axes that are rotated
        counterclockwise by `angle` in rad. The result, of the same shape, maps the coordinates to
        the motion along x and y.
        """
        cosine, sine = self.cos_sin(angle)
        return np.stack([cosine * rows[0] - sine * rows[1], sine * rows[0] + cosine * rows[1]])


FLOAT_ARITHMETIC = Arithmetic(
    float,
    lambda value: value,
    lambda angle: (math.cos(angle), math.sin(angle)),
    lambda x, y: (math.hypot(x, y), math.atan2(y, x)),
    math.pi,
)

#: Pivot tolerance of a stiffness matrix with unit diagonal; smaller pivots are rounding errors.
RELATIVE_ZERO = 1e-11
#: Motions of a body: x and y of its axis, and its rotation as arc length on the base circle.
AXES = ("x", "y", "rotation")


class Structure(NamedTuple):
    """Matrices of a train with n coordinates, m meshes and b bodies, without mesh stiffness.

    A row is a row vector that maps the n coordinates to a motion.
    """

    coordinates: tuple  #: pairs (name of a body, "x", "y" or "u")
    motions: np.ndarray  #: rows of x, y, u of all bodies, shape (b, 3, n)
    mass: np.ndarray  #: kg, shape (n, n)
    stiffness: np.ndarray  #: stiffness without the meshes, N/m, shape (n, n)
    damping: np.ndarray  #: N s/m, shape (n, n)
    mesh_jacobian: np.ndarray  #: rows b_j of the flank distances, shape (m, n)
    sliding_jacobian: np.ndarray  #: rows of the sliding across the lines of action, shape (m, n)
    line_vectors: np.ndarray  #: e or -e, derivatives of d_j by pinion and wheel axes, (m, 2, 2)
    load: np.ndarray  #: N, shape (n,)
    coriolis: np.ndarray  #: Coriolis damping per frame speed, kg, shape (n, n)
    centrifugal: np.ndarray  #: stiffness per squared frame speed, kg, shape (n, n)
    circulatory: np.ndarray  #: stiffness per frame speed by fixed dampers, N s/m, (n, n)
    centrifugal_load: np.ndarray  #: load per squared frame speed, kg m, shape (n,)
    springs: tuple  #: rows, shape (s, n), and N/m, shape (s,), of all springs but the meshes
    masses: tuple  #: rows, shape (3 b, n), and kg, shape (3 b,)


def assemble_structure(bodies, meshes, shafts, arithmetic, rotations_first=False) -> Structure:
    """Assemble the `Structure` of a train, its matrices in SI units.

    `bodies` maps names to `Body`; `meshes` and `shafts` are lists. `arithmetic` is the number type,
    floats or balls (intervals). If `rotations_first` is true, the rotations are the first
    coordinates; otherwise the coordinates are in the order of the bodies.
    """
    coordinates = _coordinates(bodies, rotations_first)
    n, convert = len(coordinates), arithmetic.convert
    motion_rows, support_rows = _motion_and_support_rows(bodies, coordinates, arithmetic)
    # Springs are tuples (row vector, stiffness k, damping d), and masses are (row vector, mass).
    motions, springs, masses = {}, [], []
    coriolis, centrifugal, circulatory = arithmetic.zeros(3, n, n)
    load, centrifugal_load = arithmetic.zeros(2, n)
    for name, body in bodies.items():
        x, y, u = motion_rows[name]  # axis and rotation as arc length on the base circle
        r, m = convert(body.base_radius), convert(body.mass or 0.0)
        masses += [(x, m), (y, m), (u, convert(body.inertia) / r**2)]
        elements = zip(
            support_rows[name], body.support_stiffness, body.support_damping, strict=True
        )
        springs += [(row, k, d) for row, k, d in elements if math.isfinite(k)]
        if math.isfinite(body.torsional_stiffness):
            springs.append((u, body.torsional_stiffness / r**2, body.torsional_damping / r**2))
        coriolis += 2.0 * m * (np.outer(y, x) - np.outer(x, y))
        tangential = y - motion_rows[body.carrier][2] if body.carrier else y
        centrifugal -= m * (np.outer(x, x) + np.outer(tangential, tangential))
        if body.carrier:
            centrifugal_load += m * bodies[body.carrier].base_radius * x
        else:
            c = body.support_damping
            circulatory += c[1] * np.outer(y, x) - c[0] * np.outer(x, y)
        load += body.torque / r * u
        angle = body.angle if body.carrier else 0.0
        motions[name] = np.stack([*arithmetic.rotate_axes(motion_rows[name][:2], angle), u])
    for shaft in shafts:
        (xa, ya, ua), (xb, yb, ub) = (motions[name] for name in shaft.bodies)
        ra, rb = (convert(bodies[name].base_radius) for name in shaft.bodies)
        bending = shaft.bending_stiffness, shaft.bending_damping
        springs.append((ua / ra - ub / rb, shaft.stiffness, shaft.damping))
        springs += [(xa - xb, *bending), (ya - yb, *bending)]
    mesh_jacobian, sliding_jacobian, line_vectors = _mesh_jacobians(meshes, motions, n, arithmetic)
    stiffnesses = [(row, k) for row, k, _ in springs]
    return Structure(
        coordinates=tuple(coordinates),
        motions=np.array(list(motions.values())),
        mass=_sum_outer_products(arithmetic, n, masses),
        stiffness=_sum_outer_products(arithmetic, n, stiffnesses),
        damping=_sum_outer_products(arithmetic, n, [(row, d) for row, _, d in springs]),
        mesh_jacobian=mesh_jacobian,
        sliding_jacobian=sliding_jacobian,
        line_vectors=line_vectors,
        load=load,
        coriolis=coriolis,
        centrifugal=centrifugal,
        circulatory=circulatory,
        centrifugal_load=centrifugal_load,
        springs=_stack_terms(stiffnesses, n),
        masses=_stack_terms(masses, n),
    )


def structure_from_matrices(matrices, bodies, meshes, arithmetic) -> Structure:
    """Create the `Structure` of a train whose bodies and shafts are replaced by `Matrices`.

    `bodies` maps the names of the gears to `Body`, `meshes` is a list, and `arithmetic` is the
    number type, floats or balls (intervals). Triangular factors of the symmetric part of the
    stiffness matrix and of the mass matrix are used as springs and masses.
    """
    n = len(matrices.coordinates)
    convert = np.vectorize(arithmetic.convert, otypes=[arithmetic.dtype])
    motions, axial = {}, np.zeros((len(meshes), n))
    gears = {gear.name: gear for gear in matrices.gears}
    for name in bodies:
        gear = gears[name]
        x, y = matrices.coordinate_row(gear.x), matrices.coordinate_row(gear.y)
        rotation = matrices.coordinate_row(gear.rotation) * gear.base_radius
        motions[name] = convert([x, y, rotation])
    for j, mesh in enumerate(meshes):
        pinion, wheel = gears[mesh.pinion], gears[mesh.wheel]
        # A helical mesh converts an axial motion to a motion along the line of action.
        axial_factor = np.tan(pinion.base_helix_angle) * mesh.direction
        pinion_row, wheel_row = map(matrices.coordinate_row, (pinion.axial, wheel.axial))
        axial[j] = axial_factor * (pinion_row - wheel_row)
    mesh_jacobian, sliding_jacobian, line_vectors = _mesh_jacobians(meshes, motions, n, arithmetic)
    mesh_jacobian = mesh_jacobian + convert(axial)
    for j, mesh in enumerate(meshes):
        if mesh.name in matrices.rows:
            mesh_jacobian[j] = convert(matrices.rows[mesh.name])
    zeros = arithmetic.zeros(3, n, n)
    return Structure(
        coordinates=tuple((name, "") for name in matrices.coordinates),
        motions=np.array(list(motions.values())),
        mass=convert(matrices.mass),
        stiffness=convert(matrices.stiffness),
        damping=convert(matrices.damping),
        mesh_jacobian=mesh_jacobian,
        sliding_jacobian=sliding_jacobian,
        line_vectors=line_vectors,
        load=convert(matrices.load),
        coriolis=zeros[0],
        centrifugal=zeros[1],
        circulatory=zeros[2],
        centrifugal_load=arithmetic.zeros(n),
        springs=_springs_from_stiffness((matrices.stiffness + matrices.stiffness.T) / 2.0),
        masses=(np.linalg.cholesky(matrices.mass).T, np.ones(n)),
    )


def scale_to_unit_diagonal(stiffness: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Scale a stiffness matrix, (n, n), to unit diagonal; return it and the scale factors, (n,).

    The scaled matrix times the factors of row and column is the given matrix. Scaling makes
    stiffnesses of translations (N/m) and rotations (N m/rad) comparable, so that one tolerance
    suits both.
    """
    diagonal = np.abs(stiffness.diagonal())
    scale = np.sqrt(np.where(diagonal > 0.0, diagonal, 1.0))
    return stiffness / np.outer(scale, scale), scale


def _springs_from_stiffness(stiffness: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Represent a symmetric stiffness matrix, shape (n, n), by s springs (rows, stiffnesses).

    The rows, shape (s, n), satisfy rows.T @ rows = stiffness, and all s stiffnesses are 1. The
    Cholesky factorisation with diagonal pivoting omits motions that no spring resists, up to
    rounding.
    """
    from scipy.linalg.lapack import dpstrf

    scaled, scale = scale_to_unit_diagonal(stiffness)
    factor, order, rank, _ = dpstrf(scaled, lower=1, tol=RELATIVE_ZERO)
    rows = np.zeros((rank, len(stiffness)))
    # LAPACK counts the indices in `order` from 1.
    rows[:, order - 1] = np.tril(factor)[:, :rank].T
    return rows * scale, np.ones(rank)


def _coordinates(bodies: dict, rotations_first: bool) -> list:
    """Return the coordinates of a train as pairs (name of a body, "x", "y" or "u").

    x and y are the motions of the axis, and u is the rotation as arc length on the base circle. A
    motion is a coordinate if its support is not rigid. `bodies` maps names to `Body`. If
    `rotations_first` is true, the rotations are the first coordinates.
    """
    coordinates = []
    for body in bodies.values():
        stiffness = *body.support_stiffness, body.torsional_stiffness
        axes = zip("xyu", stiffness, strict=True)
        coordinates += [(body.name, axis) for axis, k in axes if math.isfinite(k)]
    if rotations_first:
        coordinates.sort(key=lambda coordinate: coordinate[1] != "u")
    return coordinates


def _motion_and_support_rows(
    bodies: dict, coordinates: list, arithmetic: Arithmetic
) -> tuple[dict, dict]:
    """Return the rows (motions, support deflections) of the bodies as dicts name -> array.

    The motions, shape (3, n), are x and y of the axis and the rotation u as arc length; for a body
    on a carrier, x is radial and y is tangential. The deflections of its support, shape (2, n), are
    along the same axes. `coordinates` is the result of `_coordinates`.
    """
    n = len(coordinates)
    rows = {name: arithmetic.zeros(3, n) for name in bodies}
    for i, (name, axis) in enumerate(coordinates):
        rows[name]["xyu".index(axis), i] = arithmetic.convert(1.0)
    supports = {name: rows[name][:2].copy() for name in bodies}
    for name, body in bodies.items():
        if body.carrier:
            # `pin` is the radial and tangential motion of the pin.
            x, y, rotation = rows[body.carrier]
            radial, tangential = arithmetic.rotate_axes([x, y], -body.angle)
            pin = np.stack([radial, tangential + rotation])
            supports[name] = supports[name] - pin
            # A body on a rigid support moves with its pin.
            for axis, stiffness in enumerate(body.support_stiffness):
                if math.isinf(stiffness):
                    rows[name][axis] = pin[axis]
    return rows, supports


def _sum_outer_products(arithmetic: Arithmetic, n: int, terms: list) -> np.ndarray:
    """Return the sum of value * row^T row over all terms, a matrix of shape (n, n).

    `terms` are springs, masses or dampers as pairs (row vector of shape (n,), value). `arithmetic`
    is the number type, floats or balls (intervals).
    """
    total = arithmetic.zeros(n, n)
    for row, value in terms:
        total += value * np.outer(row, row)
    return total


def _mesh_jacobians(meshes, motions, n, arithmetic) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return (mesh_jacobian, sliding_jacobian, line_vectors) of m meshes, fields of `Structure`.

    The Jacobians, shape (m, n), map the n coordinates to the approach of the flanks along the line
    of action and to the sliding across it. `line_vectors`, shape (m, 2, 2), are the unit vectors of
    the line of action with the signs of pinion and wheel. `motions` maps body names to rows of
    shape (3, n): x and y of the axis, and the rotation as arc length on the base circle.
    """
    mesh_jacobian, sliding_jacobian = arithmetic.zeros(2, len(meshes), n)
    line_vectors = arithmetic.zeros(len(meshes), 2, 2)
    for j, mesh in enumerate(meshes):
        # The flanks approach each other if the axis of the gear `plus` moves along the unit vector
        # e of the line of action, or the axis of the gear `minus` in the opposite direction.
        e = np.array(arithmetic.cos_sin(mesh.line_angle(arithmetic.pi)))
        if mesh.internal:
            plus, minus = motions[mesh.wheel], motions[mesh.pinion]
            line_vectors[j] = (-e, e)
            sign = -1.0
        else:
            plus, minus = motions[mesh.pinion], motions[mesh.wheel]
            line_vectors[j] = (e, -e)
            sign = 1.0
        mesh_jacobian[j] = e @ (plus[:2] - minus[:2]) + mesh.direction * (plus[2] + sign * minus[2])
        # With direction 1, a pinion `plus` slides after the pitch point along `across`, which is e
        # rotated counterclockwise by 90 degrees. With direction -1 it slides the opposite way, and
        # so does a ring gear `plus`, because it is slower than its pinion.
        across = np.array([-e[1], e[0]])
        sliding_jacobian[j] = mesh.direction * sign * (across @ (plus[:2] - minus[:2]))
    return mesh_jacobian, sliding_jacobian, line_vectors


def coast_jacobian(structure, bodies, meshes, arithmetic=FLOAT_ARITHMETIC) -> np.ndarray:
    """Return the Jacobian of the coast-side flank distances of m meshes, shape (m, n).

    In a mesh with moving backlash, the coast-side flanks follow the axes, so that deflections of
    the supports do not change their distance. In other meshes, the rows equal those of the drive
    side. `structure` is the `Structure` of the train, and `bodies` maps names to `Body`.
    """
    jacobian = structure.mesh_jacobian.copy()
    motions = dict(zip(bodies, structure.motions, strict=True))
    for j, mesh in enumerate(meshes):
        if not mesh.moving_backlash:
            continue
        gears = zip((mesh.pinion, mesh.wheel), structure.line_vectors[j], strict=True)
        for name, line_vector in gears:
            body, deflection = bodies[name], motions[name][:2].copy()
            if body.carrier:
                # The deflection of a planet is its motion relative to its pin.
                cosine, sine = arithmetic.cos_sin(body.angle)
                x, y, rotation = motions[body.carrier]
                deflection -= np.stack([x - sine * rotation, y + cosine * rotation])
            jacobian[j] -= line_vector @ deflection
    return jacobian


def _stack_terms(terms: list, n: int) -> tuple[np.ndarray, np.ndarray]:
    """Convert a list of s pairs (row vector, value) to arrays of shapes (s, n) and (s,)."""
    rows = np.array([row for row, _ in terms]).reshape(len(terms), n)
    return rows, np.array([value for _, value in terms])
