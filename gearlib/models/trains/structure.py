"""Mass, stiffness and damping matrices of a gear train in SI units.

The axis of a body moves by (x, y) and the body turns by u = r theta, an arc length on the base
circle with the radius r. Each of these motions is the product of a row vector and the coordinates
q, so that rigid supports and rigid pins of a carrier need no coordinates. With the row vectors f of
supports, pins and shafts and b of the meshes

    K = sum k f f^T,   D = sum d f f^T,   M = sum m (x x^T + y y^T) + I / r^2 u u^T,
    d_j = b_j q + e_j(t),   b_j = e . (x, y)_pinion - e . (x, y)_wheel + u_pinion + u_wheel

with the direction e of the line of action. In an internal mesh pinion and wheel change places and
the rotation of the pinion is negative; with direction -1 both rotations change their signs.
Friction acts across the line of action, positive in the direction in which the gear with +e slides
on the other gear past the pitch point.

In a frame that rotates at W, positions are relative to those that have also turned by the small
rotation of the carrier: there the static forces of pins, supports and meshes keep their directions,
and a rotation of the whole train needs no force. An axis feels the Coriolis force m (2 W y',
-2 W x') and a centrifugal force m W^2 times its displacement; a pin at the radius r also feels
m W^2 r. Fixed supports damp x' - W y and y' + W x. Derivation: `docs/theory/trains.md`.
"""

import math
from typing import Any, NamedTuple

import numpy as np


class Arithmetic(NamedTuple):
    """Number type in which the matrices of a train are assembled: floats or balls.

    A ball is an interval, a midpoint with an error bound, which encloses a number.
    """

    dtype: type  #: data type of arrays, `object` for balls
    convert: Any  #: function from a float to a number of this type
    cos_sin: Any  #: function from an angle in rad to its cosine and sine
    polar: Any  #: function from components x, y of a vector to its length and angle in rad
    pi: Any

    def zeros(self, *shape: int) -> np.ndarray:
        """Return an array of zeros of this number type with the given shape.

        Each ball (an interval with a midpoint and an error bound) is a Python object.
        """
        if self.dtype is not object:
            return np.zeros(shape, self.dtype)
        return np.array([self.convert(0.0)] * math.prod(shape), object).reshape(shape)

    def rotated(self, rows: Any, angle: Any) -> np.ndarray:
        """Transform the row vectors of a motion from rotated axes to the axes x and y.

        `rows`, shape (2, n), map n coordinates to the motion along two axes that are rotated
        counterclockwise by an `angle` in rad; the result, of the same shape, maps them to x and y.
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

#: Pivots of a stiffness matrix with unit diagonal below this are rounding errors of free motions.
RELATIVE_ZERO = 1e-11
#: How a body moves: its axis along x and y, its rotation as arc length on the base circle.
AXES = ("x", "y", "rotation")


class Structure(NamedTuple):
    """Matrices of the linear elements of a train: n coordinates, m meshes, b bodies.

    A row is a row vector that maps the n coordinates to a motion.
    """

    coordinates: tuple  #: pairs (name of a body, "x", "y" or "u")
    motions: np.ndarray  #: rows of x, y, u of all bodies, along fixed axes, (b, 3, n)
    mass: np.ndarray  #: kg, shape (n, n)
    stiffness: np.ndarray  #: stiffness without the meshes, N/m, shape (n, n)
    damping: np.ndarray  #: N s/m, shape (n, n)
    lines: np.ndarray  #: rows b_j of the distances along the lines of action, shape (m, n)
    sliding: np.ndarray  #: rows of the sliding of the axes across the lines of action, (m, n)
    line_vectors: np.ndarray  #: e or -e, the signs of pinion and wheel axes in d_j, (m, 2, 2)
    load: np.ndarray  #: N, shape (n,)
    coriolis: np.ndarray  #: damping per frame speed by Coriolis forces, kg, shape (n, n)
    centrifugal: np.ndarray  #: stiffness per square of the frame speed, kg, shape (n, n)
    circulatory: np.ndarray  #: stiffness per frame speed from fixed dampers, N s/m, shape (n, n)
    centrifugal_load: np.ndarray  #: per square of the frame speed, kg m, shape (n,)
    springs: tuple  #: rows, shape (s, n), and N/m, shape (s,), of all springs but the meshes
    masses: tuple  #: rows, shape (3 b, n), and kg, shape (3 b,)


def structure(bodies, meshes, shafts, arithmetic, rotations_first=False) -> Structure:
    """Assemble the `Structure` of a train, its matrices in SI units.

    `bodies` maps names to `Body`; `meshes` and `shafts` are lists. An `Arithmetic` computes with
    floats or balls (intervals). Rotations are the first coordinates if `rotations_first`; otherwise
    coordinates are in the order of the bodies.
    """
    coordinates = _coordinates(bodies, rotations_first)
    n, convert = len(coordinates), arithmetic.convert
    rows, supports = _motions(bodies, coordinates, arithmetic)
    # Masses are pairs (row vector, mass), springs triples (row vector, stiffness k, damping d).
    motions, springs, masses = {}, [], []
    coriolis, centrifugal, circulatory = arithmetic.zeros(3, n, n)
    load, centrifugal_load = arithmetic.zeros(2, n)
    for name, body in bodies.items():
        # x, y and u are the row vectors of the axis and of the rotation as arc length on the base
        # circle with the radius r; m is the mass.
        x, y, u = rows[name]
        r, m = convert(body.base_radius), convert(body.mass or 0.0)
        masses += [(x, m), (y, m), (u, convert(body.inertia) / r**2)]
        elements = zip(supports[name], body.support_stiffness, body.support_damping, strict=True)
        springs += [(row, k, d) for row, k, d in elements if math.isfinite(k)]
        if math.isfinite(body.torsional_stiffness):
            springs.append((u, body.torsional_stiffness / r**2, body.torsional_damping / r**2))
        coriolis += 2.0 * m * (np.outer(y, x) - np.outer(x, y))
        tangential = y - rows[body.carrier][2] if body.carrier else y
        centrifugal -= m * (np.outer(x, x) + np.outer(tangential, tangential))
        if body.carrier:
            centrifugal_load += m * bodies[body.carrier].base_radius * x
        else:
            c = body.support_damping
            circulatory += c[1] * np.outer(y, x) - c[0] * np.outer(x, y)
        load += body.torque / r * u
        angle = body.angle if body.carrier else 0.0
        motions[name] = np.stack([*arithmetic.rotated(rows[name][:2], angle), u])
    for shaft in shafts:
        (xa, ya, ua), (xb, yb, ub) = (motions[name] for name in shaft.bodies)
        ra, rb = (convert(bodies[name].base_radius) for name in shaft.bodies)
        bending = shaft.bending_stiffness, shaft.bending_damping
        springs.append((ua / ra - ub / rb, shaft.stiffness, shaft.damping))
        springs += [(xa - xb, *bending), (ya - yb, *bending)]
    lines, sliding, line_vectors = _lines(meshes, motions, n, arithmetic)
    stiffnesses = [(row, k) for row, k, _ in springs]
    return Structure(
        coordinates=tuple(coordinates),
        motions=np.array(list(motions.values())),
        mass=_sum_of_squares(arithmetic, n, masses),
        stiffness=_sum_of_squares(arithmetic, n, stiffnesses),
        damping=_sum_of_squares(arithmetic, n, [(row, d) for row, _, d in springs]),
        lines=lines,
        sliding=sliding,
        line_vectors=line_vectors,
        load=load,
        coriolis=coriolis,
        centrifugal=centrifugal,
        circulatory=circulatory,
        centrifugal_load=centrifugal_load,
        springs=_as_arrays(stiffnesses, n),
        masses=_as_arrays(masses, n),
    )


def structure_of_matrices(matrices, bodies, meshes, arithmetic) -> Structure:
    """Return the `Structure` of a train with given `Matrices` in place of bodies and shafts.

    `bodies` maps the names of the gears to `Body`, `meshes` is a list, and `arithmetic` computes
    with floats or balls (intervals that enclose numbers). Triangular factors of the symmetric part
    of the stiffness matrix and of the mass matrix serve as springs and masses.
    """
    n = len(matrices.coordinates)
    convert = np.vectorize(arithmetic.convert, otypes=[arithmetic.dtype])
    motions, axial = {}, np.zeros((len(meshes), n))
    gears = {gear.name: gear for gear in matrices.gears}
    for name in bodies:
        gear = gears[name]
        rotation = matrices.motion(gear.rotation) * gear.base_radius
        motions[name] = convert([matrices.motion(gear.x), matrices.motion(gear.y), rotation])
    for j, mesh in enumerate(meshes):
        pinion, wheel = gears[mesh.pinion], gears[mesh.wheel]
        # Share of the axial motion in the approach along the line of action.
        axial_share = np.tan(pinion.base_helix_angle) * mesh.direction
        axial[j] = axial_share * (matrices.motion(pinion.axial) - matrices.motion(wheel.axial))
    lines, sliding, line_vectors = _lines(meshes, motions, n, arithmetic)
    lines = lines + convert(axial)
    for j, mesh in enumerate(meshes):
        if mesh.name in matrices.rows:
            lines[j] = convert(matrices.rows[mesh.name])
    zeros = arithmetic.zeros(3, n, n)
    return Structure(
        coordinates=tuple((name, "") for name in matrices.coordinates),
        motions=np.array(list(motions.values())),
        mass=convert(matrices.mass),
        stiffness=convert(matrices.stiffness),
        damping=convert(matrices.damping),
        lines=lines,
        sliding=sliding,
        line_vectors=line_vectors,
        load=convert(matrices.load),
        coriolis=zeros[0],
        centrifugal=zeros[1],
        circulatory=zeros[2],
        centrifugal_load=arithmetic.zeros(n),
        springs=_springs_of((matrices.stiffness + matrices.stiffness.T) / 2.0),
        masses=(np.linalg.cholesky(matrices.mass).T, np.ones(n)),
    )


def with_unit_diagonal(stiffness: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return a stiffness matrix, (n, n), scaled to a unit diagonal, and the scale factors, (n,).

    Stiffnesses of translations (N/m) and rotations (N m/rad) then have the same size, so that one
    tolerance suits both. The matrix is the scaled one times the factors of its row and column.
    """
    diagonal = np.abs(stiffness.diagonal())
    scale = np.sqrt(np.where(diagonal > 0.0, diagonal, 1.0))
    return stiffness / np.outer(scale, scale), scale


def _springs_of(stiffness: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return springs, as (rows, stiffnesses), that have a given symmetric stiffness matrix.

    `stiffness` has the shape (n, n). The s rows, shape (s, n), satisfy rows.T @ rows = stiffness,
    and all s stiffnesses are 1. Cholesky factorisation with diagonal pivoting leaves out motions
    that no spring resists, up to rounding.
    """
    from scipy.linalg.lapack import dpstrf

    scaled, scale = with_unit_diagonal(stiffness)
    factor, order, rank, _ = dpstrf(scaled, lower=1, tol=RELATIVE_ZERO)
    rows = np.zeros((rank, len(stiffness)))
    # LAPACK counts the pivots in `order` from 1.
    rows[:, order - 1] = np.tril(factor)[:, :rank].T
    return rows * scale, np.ones(rank)


def _coordinates(bodies: dict, rotations_first: bool) -> list:
    """Return the coordinates of a train as pairs (name of a body, "x", "y" or "u").

    x and y are the motions of the axis, u is the rotation as arc length on the base circle. A
    motion is a coordinate if the stiffness of its support is finite, 0 included; otherwise it is
    prevented. `bodies` maps names to `Body`. If `rotations_first`, rotations come first.
    """
    coordinates = []
    for body in bodies.values():
        stiffness = *body.support_stiffness, body.torsional_stiffness
        axes = zip("xyu", stiffness, strict=True)
        coordinates += [(body.name, axis) for axis, k in axes if math.isfinite(k)]
    if rotations_first:
        coordinates.sort(key=lambda coordinate: coordinate[1] != "u")
    return coordinates


def _motions(bodies: dict, coordinates: list, arithmetic: Arithmetic) -> tuple[dict, dict]:
    """Return the row vectors of body motions and of support deflections as dicts (rows, supports).

    Both map body names to arrays that n coordinates are multiplied by. An entry of `rows`, shape
    (3, n), gives x and y of the axis and the rotation u as arc length; for a body on a carrier x is
    radial and y tangential. An entry of `supports`, shape (2, n), gives the deflections of its
    support along these axes. `coordinates` is the result of `_coordinates`.
    """
    n = len(coordinates)
    rows = {name: arithmetic.zeros(3, n) for name in bodies}
    for i, (name, axis) in enumerate(coordinates):
        rows[name]["xyu".index(axis), i] = arithmetic.convert(1.0)
    supports = {name: rows[name][:2].copy() for name in bodies}
    for name, body in bodies.items():
        if body.carrier:
            # `pin` is the motion of the pin along its radius and across it.
            x, y, rotation = rows[body.carrier]
            radial, tangential = arithmetic.rotated([x, y], -body.angle)
            pin = np.stack([radial, tangential + rotation])
            supports[name] = supports[name] - pin
            # A body on a rigid support moves with the pin.
            for axis, stiffness in enumerate(body.support_stiffness):
                if math.isinf(stiffness):
                    rows[name][axis] = pin[axis]
    return rows, supports


def _sum_of_squares(arithmetic: Arithmetic, n: int, terms: list) -> np.ndarray:
    """Return the sum of value row^T row over all terms, a matrix of shape (n, n).

    `terms` are springs, masses or dampers: pairs (row vector of shape (n,), value). `arithmetic` is
    the number type, floats or balls.
    """
    total = arithmetic.zeros(n, n)
    for row, value in terms:
        total += value * np.outer(row, row)
    return total


def _lines(meshes, motions, n, arithmetic) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the row vectors of m meshes as (lines, sliding, line_vectors), fields of `Structure`.

    `lines` and `sliding`, (m, n) each, map the n coordinates to the approach of the flanks along
    the line of action, and to the sliding of the axes across it. `line_vectors`, (m, 2, 2), are the
    unit vectors of the line of action with the signs of pinion and wheel. `motions` maps the name
    of a body to rows of shape (3, n): its axis along x and y, and its rotation as arc length on the
    base circle.
    """
    lines, sliding = arithmetic.zeros(2, len(meshes), n)
    line_vectors = arithmetic.zeros(len(meshes), 2, 2)
    for j, mesh in enumerate(meshes):
        # With the unit vector e of the line of action, flanks approach each other if the axis of
        # the gear `plus` moves along e, or the axis of the gear `minus` against it.
        e = np.array(arithmetic.cos_sin(mesh.line_angle(arithmetic.pi)))
        if mesh.internal:
            plus, minus = motions[mesh.wheel], motions[mesh.pinion]
            line_vectors[j] = (-e, e)
            sign = -1.0
        else:
            plus, minus = motions[mesh.pinion], motions[mesh.wheel]
            line_vectors[j] = (e, -e)
            sign = 1.0
        lines[j] = e @ (plus[:2] - minus[:2]) + mesh.direction * (plus[2] + sign * minus[2])
        # At direction 1 the gear `plus`, a pinion, slides past the pitch point along e turned by 90
        # degrees counterclockwise. Its mirror image (direction -1) slides the opposite way, and so
        # does a ring gear as `plus`, because it is slower than its pinion.
        across = np.array([-e[1], e[0]])
        sliding[j] = mesh.direction * sign * (across @ (plus[:2] - minus[:2]))
    return lines, sliding, line_vectors


def coast_lines(structure, bodies, meshes, arithmetic=FLOAT_ARITHMETIC) -> np.ndarray:
    """Return the row vectors that map n coordinates to coast-side distances of m meshes, (m, n).

    The coast side has the flanks that touch when the load is reversed. In a mesh with moving
    backlash they follow the axes, so that deflections of the supports do not change their distance;
    in other meshes the rows are those of the drive side. `structure` is the `Structure` of the
    train, and `bodies` maps names to `Body`.
    """
    lines = structure.lines.copy()
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
            lines[j] -= line_vector @ deflection
    return lines


def _as_arrays(terms: list, n: int) -> tuple[np.ndarray, np.ndarray]:
    """Return a list of s pairs (row vector, value) as arrays of shapes (s, n) and (s,)."""
    rows = np.array([row for row, _ in terms]).reshape(len(terms), n)
    return rows, np.array([value for _, value in terms])
