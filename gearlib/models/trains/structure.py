"""Matrices of a gear train in SI units: every element is a stiffness times a functional, twice.

The axis of a body moves by (x, y) and the body turns by u = r theta; each is a functional of the
coordinates q, so that rigid supports and rigid pins of a carrier need no coordinates. With the
functionals f of supports, pins and shafts and b of the meshes

    K = sum k f f^T,   D = sum d f f^T,   M = sum m (x x^T + y y^T) + I / r^2 u u^T,
    d_j = b_j q + e_j(t),   b_j = e . (x, y)_pinion - e . (x, y)_wheel + u_pinion + u_wheel

with e the direction of the line of action. In an internal mesh pinion and wheel change places and
the rotation of the pinion counts negative; with direction -1 both rotations change sign. Friction
acts across the line of action, counted in the way in which the gear with +e slides on the other
one past the pitch point.

In a frame that turns by W, positions are counted from those that have turned with the carrier by
its small rotation as well: there static forces of pins, supports and meshes keep their directions,
and a turn of the whole train costs nothing. An axis feels m (2 W y', -2 W x') and the centrifugal
force m W^2 of its way out of the turned position, a pin at the radius r m W^2 r; supports that
stand still damp x' - W y and y' + W x. Derivation: `docs/theory/trains.md`.
"""

import math
from typing import Any, NamedTuple

import numpy as np


class Numbers(NamedTuple):
    """The kind of numbers that a train is assembled of: floats or balls."""

    dtype: type
    of: Any  #: a number from a float
    cos_sin: Any  #: of an angle
    polar: Any  #: length and angle of a vector
    pi: Any

    def zeros(self, *shape):
        """Return an array of zeros."""
        if self.dtype is not object:
            return np.zeros(shape, self.dtype)
        return np.array([self.of(0.0)] * math.prod(shape), object).reshape(shape)

    def turned(self, rows, angle):
        """Return the components along fixed axes of a motion along axes at an angle."""
        c, s = self.cos_sin(angle)
        return np.stack([c * rows[0] - s * rows[1], s * rows[0] + c * rows[1]])


FLOATS = Numbers(
    float,
    lambda value: value,
    lambda angle: (math.cos(angle), math.sin(angle)),
    lambda x, y: (math.hypot(x, y), math.atan2(y, x)),
    math.pi,
)

#: How a body moves: its axis along x and y, its rotation as arc length on the base circle.
AXES = ("x", "y", "rotation")


class Structure(NamedTuple):
    """The linear parts of a train: n coordinates, m meshes, b bodies."""

    coordinates: tuple  #: names, (body, "x", "y" or "u")
    motions: np.ndarray  #: x, y, u of every body as functionals, along fixed axes, (b, 3, n)
    mass: np.ndarray  #: kg, shape (n, n)
    stiffness: np.ndarray  #: of all but the meshes, N/m, shape (n, n)
    damping: np.ndarray  #: N s/m, shape (n, n)
    lines: np.ndarray  #: b_j, shape (m, n)
    across: np.ndarray  #: of the axes only, the way of the sliding past the pitch point, (m, n)
    arms: np.ndarray  #: by what an axis moves along the line: direction and sign, (m, 2, 2)
    load: np.ndarray  #: N, shape (n,)
    turning: np.ndarray  #: rate-dependent forces by unit of frame speed, kg, shape (n, n)
    centrifugal: np.ndarray  #: stiffness by the square of the frame speed, kg, shape (n, n)
    circulating: np.ndarray  #: stiffness by frame speed of supports at rest, N s/m, shape (n, n)
    outward: np.ndarray  #: centrifugal load by the square of the frame speed, kg m, shape (n,)
    springs: tuple  #: all but the meshes: functionals, shape (s, n), and N/m, shape (s,)
    masses: tuple  #: functionals, shape (3 b, n), and kg, shape (3 b,)


def structure(bodies, meshes, shafts, numbers=FLOATS, rotations_first=False):
    """Return the `Structure`; `bodies` is a dict by name, `numbers` the kind of its entries."""
    coordinates = _coordinates(bodies, rotations_first)
    n, of = len(coordinates), numbers.of
    rows, supports = _motions(bodies, coordinates, numbers)
    motions, springs, masses = {}, [], []
    turning, centrifugal, circulating = numbers.zeros(3, n, n)
    load, outward = numbers.zeros(2, n)
    for name, body in bodies.items():
        (x, y, u), r, m = rows[name], of(body.base_radius), of(body.mass or 0.0)
        masses += [(x, m), (y, m), (u, of(body.inertia) / r**2)]
        held = zip(supports[name], body.support_stiffness, body.support_damping, strict=True)
        springs += [(row, k, d) for row, k, d in held if math.isfinite(k)]
        if math.isfinite(body.torsional_stiffness):
            springs.append((u, body.torsional_stiffness / r**2, body.torsional_damping / r**2))
        turning += 2.0 * m * (np.outer(y, x) - np.outer(x, y))
        turned = y - rows[body.carrier][2] if body.carrier else y
        centrifugal -= m * (np.outer(x, x) + np.outer(turned, turned))
        if body.carrier:
            outward += m * bodies[body.carrier].base_radius * x
        else:
            c = body.support_damping
            circulating += c[1] * np.outer(y, x) - c[0] * np.outer(x, y)
        load += body.torque / r * u
        angle = body.angle if body.carrier else 0.0
        motions[name] = np.stack([*numbers.turned(rows[name][:2], angle), u])
    for shaft in shafts:
        (xa, ya, ua), (xb, yb, ub) = (motions[name] for name in shaft.bodies)
        ra, rb = (of(bodies[name].base_radius) for name in shaft.bodies)
        bending = shaft.bending_stiffness, shaft.bending_damping
        springs.append((ua / ra - ub / rb, shaft.stiffness, shaft.damping))
        springs += [(xa - xb, *bending), (ya - yb, *bending)]
    return Structure(
        tuple(coordinates),
        np.array(list(motions.values())),
        _sum_of_squares(numbers, n, masses),
        _sum_of_squares(numbers, n, [(row, k) for row, k, _ in springs]),
        _sum_of_squares(numbers, n, [(row, d) for row, _, d in springs]),
        *_lines(meshes, motions, n, numbers),
        load,
        turning,
        centrifugal,
        circulating,
        outward,
        _listed([(row, k) for row, k, _ in springs], n),
        _listed(masses, n),
    )


def _coordinates(bodies: dict, rotations_first: bool) -> list:
    """Return the coordinates (body, axis) along which supports are elastic."""
    coordinates = []
    for body in bodies.values():
        stiffness = *body.support_stiffness, body.torsional_stiffness
        axes = zip("xyu", stiffness, strict=True)
        coordinates += [(body.name, axis) for axis, k in axes if math.isfinite(k)]
    return sorted(coordinates, key=lambda pair: pair[1] != "u") if rotations_first else coordinates


def _motions(bodies: dict, coordinates: list, numbers: Numbers) -> tuple[dict, dict]:
    """Return x, y and u of each body, (3, n), and its way against its support or pin, (2, n)."""
    n = len(coordinates)
    rows = {body: numbers.zeros(3, n) for body in bodies}
    for i, (name, axis) in enumerate(coordinates):
        rows[name]["xyu".index(axis), i] = numbers.of(1.0)
    supports = {name: rows[name][:2].copy() for name in bodies}
    for name, body in bodies.items():
        if body.carrier:
            # Along the radius of the pin and across it; no carrier is carried itself.
            x, y, turn = rows[body.carrier]
            radial, tangential = numbers.turned([x, y], -body.angle)
            pin = np.stack([radial, tangential + turn])
            supports[name] = supports[name] - pin
            for axis, stiffness in enumerate(body.support_stiffness):
                if math.isinf(stiffness):
                    rows[name][axis] = pin[axis]
    return rows, supports


def _sum_of_squares(numbers: Numbers, n: int, parts: list) -> np.ndarray:
    """Return the matrix, shape (n, n), of the sum of value * functional^2 over the parts."""
    total = numbers.zeros(n, n)
    for row, value in parts:
        total += value * np.outer(row, row)
    return total


def _lines(
    meshes: list, motions: dict, n: int, numbers: Numbers
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return lines, across and arms of the meshes, see `Structure`."""
    lines, across = numbers.zeros(2, len(meshes), n)
    arms = numbers.zeros(len(meshes), 2, 2)
    for j, mesh in enumerate(meshes):
        pinion, wheel = motions[mesh.pinion], motions[mesh.wheel]
        first, second = (wheel, pinion) if mesh.internal else (pinion, wheel)
        e = np.array(numbers.cos_sin(mesh.line_by(numbers.pi)))
        arms[j] = (-e, e) if mesh.internal else (e, -e)
        turn = -1.0 if mesh.internal else 1.0
        lines[j] = e @ (first[:2] - second[:2]) + mesh.direction * (first[2] + turn * second[2])
        # At direction 1 a pinion slides past the pitch point a quarter turn counterclockwise of e;
        # its mirror image, and a ring gear, which turns more slowly than its pinion, clockwise.
        sliding = mesh.direction * turn
        across[j] = sliding * (np.array([-e[1], e[0]]) @ (first[:2] - second[:2]))
    return lines, across, arms


def far_lines(structure, bodies, meshes, numbers=FLOATS):
    """Return coast-side distances by coordinates, (m, n): without supports where backlash moves."""
    lines, motions = structure.lines.copy(), dict(zip(bodies, structure.motions, strict=True))
    for j, mesh in enumerate(meshes):
        for name, arm in zip((mesh.pinion, mesh.wheel), structure.arms[j], strict=True):
            if mesh.moving_backlash:
                body, give = bodies[name], motions[name][:2].copy()
                if body.carrier:
                    (c, s), (x, y, turn) = numbers.cos_sin(body.angle), motions[body.carrier]
                    give -= np.stack([x - s * turn, y + c * turn])
                lines[j] -= arm @ give
    return lines


def _listed(parts: list, n: int) -> tuple[np.ndarray, np.ndarray]:
    """Return functionals, shape (s, n), and values of pairs as arrays."""
    rows = np.array([row for row, _ in parts]).reshape(len(parts), n)
    return rows, np.array([value for _, value in parts])
