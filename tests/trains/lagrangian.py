"""A turning train by its energies in the fixed frame, with finite rotations, in 120 digits.

Axes, rotations and flanks are where they are: a pin goes round with its carrier, involute flanks
touch on the common tangent of base circles whose axes move. Nothing is linear but the springs.
Derivatives of these energies at the steadily turning, loaded state are the equations of small
motions. Springs are `STIFF` times as stiff as those of the train, so that static displacements are
nothing beside radii while their forces stay.

Coordinates are those of `gearlib.models.trains.structure`; central axes are counted along axes that
have turned with the carrier.
"""

from mpmath import acos, atan2, cos, inf, lu_solve, matrix, mp, mpf, sin

STIFF = mpf(10) ** 20
_STEP = mpf(10) ** -45


class Exact:
    """Energies of a train with one carrier, SI, whose frame turns at `frame` rad/s."""

    def __init__(self, train, frame):
        self.train, self.frame = train, mpf(frame)
        self.names = train.structure.coordinates
        self.n = len(self.names)
        self.at = {key: i for i, key in enumerate(self.names)}
        self.carrier = next(body.carrier for body in train.bodies if body.carrier)
        self.time = mpf(1) / 7
        self.closed = [mpf(0)] * len(train.meshes)
        self.closed = self.distances([mpf(0)] * self.n)

    def _of(self, values, name, axis):
        i = self.at.get((name, axis))
        return mpf(0) if i is None else values[i]

    def _place(self, values, body, rates=False):
        """Return where an axis is, or its rate, along axes that have turned with the carrier."""
        x, y = (self._of(values, body.name, axis) for axis in "xy")
        if body.carrier is None:
            return x, y
        c, s = cos(mpf(body.angle)), sin(mpf(body.angle))
        xc, yc = (self._of(values, self.carrier, axis) for axis in "xy")
        pin = c * xc + s * yc, c * yc - s * xc
        rigid = [k == inf for k in body.support_stiffness]
        radial = pin[0] if rigid[0] else x
        along = pin[1] if rigid[1] else y - self._of(values, self.carrier, "u")
        radius = mpf(0) if rates else mpf(self.train.by_name[self.carrier].base_radius)
        radial += radius
        return c * radial - s * along, s * radial + c * along

    def _turn(self, values, name):
        """Return by how much a body has turned in the fixed frame, but for its steady rolling."""
        radius = mpf(self.train.by_name[name].base_radius)
        return self.frame * self.time + self._of(values, name, "u") / radius

    def _fixed(self, q, body):
        """Return where an axis is in the fixed frame."""
        x, y = self._place(q, body)
        angle = self._turn(q, self.carrier)
        return cos(angle) * x - sin(angle) * y, sin(angle) * x + cos(angle) * y

    def _speed(self, q, v, body):
        """Return the velocity of an axis in the fixed frame, along axes turned by the carrier."""
        (x, y), (vx, vy) = self._place(q, body), self._place(v, body, rates=True)
        spin = self.frame + self._of(v, self.carrier, "u") / mpf(
            self.train.by_name[self.carrier].base_radius
        )
        return vx - spin * y, vy + spin * x

    def kinetic(self, q, v):
        """Return the kinetic energy."""
        total = mpf(0)
        for body in self.train.bodies:
            if body.mass is not None:
                total += mpf(body.mass) / 2 * sum(s * s for s in self._speed(q, v, body))
            spin = self.frame + self._of(v, body.name, "u") / mpf(body.base_radius)
            total += mpf(body.inertia) / 2 * spin**2
        return total

    def lost(self, q, v):
        """Return half of the power that supports dissipate."""
        total = mpf(0)
        for body in self.train.bodies:
            if body.carrier is None:
                seen = self._speed(q, v, body)
            else:
                c, s = cos(mpf(body.angle)), sin(mpf(body.angle))
                (x, y), (xc, yc) = (
                    self._place(v, one, rates=True)
                    for one in (body, self.train.by_name[self.carrier])
                )
                seen = c * (x - xc) + s * (y - yc), c * (y - yc) - s * (x - xc)
            for d, speed in zip(body.support_damping, seen, strict=True):
                total += mpf(d) / 2 * speed**2
            turn = self._of(v, body.name, "u") / mpf(body.base_radius)
            total += mpf(body.torsional_damping) / 2 * turn**2
        return total

    def distances(self, q):
        """Return by how much the flanks of every mesh overlap, m."""
        found = []
        for mesh, closed in zip(self.train.meshes, self.closed, strict=True):
            ends = (mesh.wheel, mesh.pinion) if mesh.internal else (mesh.pinion, mesh.wheel)
            one, other = (self.train.by_name[name] for name in ends)
            (x, y), (x2, y2) = self._fixed(q, one), self._fixed(q, other)
            r, r2 = mpf(one.base_radius), mpf(other.base_radius)
            turned = -1 if mesh.internal else 1
            apart = ((x2 - x) ** 2 + (y2 - y) ** 2) ** (mpf(1) / 2)
            alpha = acos((r + turned * r2) / apart)
            # The line of action leaves the base circle of the first gear at this angle.
            foot = atan2(y2 - y, x2 - x) - turned * mesh.direction * alpha
            way = r * (self._turn(q, one.name) - foot)
            way += turned * r2 * (self._turn(q, other.name) - foot)
            found.append(mesh.direction * way - turned * apart * sin(alpha) - closed)
        return found

    def potential(self, q):
        """Return the potential energy, that of the torques with it."""
        total = mpf(0)
        for body in self.train.bodies:
            x, y = self._place(q, body)
            if body.carrier:
                c, s = cos(mpf(body.angle)), sin(mpf(body.angle))
                xc, yc = self._place(q, self.train.by_name[self.carrier])
                x, y = x - xc, y - yc
                x, y = c * x + s * y, c * y - s * x
                x -= mpf(self.train.by_name[self.carrier].base_radius)
            for k, way in zip(body.support_stiffness, (x, y), strict=True):
                if k != inf:
                    total += STIFF * mpf(k) / 2 * way**2
            turn = self._of(q, body.name, "u") / mpf(body.base_radius)
            if body.torsional_stiffness != inf:
                total += STIFF * mpf(body.torsional_stiffness) / 2 * turn**2
            total -= mpf(body.torque) * turn
        return total + self.flanks(q)

    def flanks(self, q):
        """Return the energy of the meshes."""
        meshes = zip(self.train.meshes, self.distances(q), strict=True)
        return sum(STIFF * mpf(mesh.mean_stiffness) / 2 * d**2 for mesh, d in meshes)

    # Derivatives by differences, whose error is far below 1e-20 of what is sought.

    def _moved(self, q, *indices):
        moved = list(q)
        for i in indices:
            moved[i] += _STEP
        return moved

    def curvature(self, function, q):
        """Return the second derivatives of a function of the coordinates, and the first."""
        value, n = function(q), self.n
        first = [function(self._moved(q, i)) for i in range(n)]
        found = matrix(n, n)
        for i in range(n):
            for j in range(i, n):
                both = function(self._moved(q, i, j))
                found[i, j] = found[j, i] = (both - first[i] - first[j] + value) / _STEP**2
        return found, matrix([(one - value) / _STEP for one in first])

    def mixed(self, function, q):
        """Return d2 f / dv dq of a function of coordinates and rates, at rest in the frame."""
        n, rest = self.n, [mpf(0)] * self.n
        value = function(q, rest)
        by_q = [function(self._moved(q, j), rest) for j in range(n)]
        by_v = [function(q, self._moved(rest, i)) for i in range(n)]
        found = matrix(n, n)
        for i in range(n):
            for j in range(n):
                both = function(self._moved(q, j), self._moved(rest, i))
                found[i, j] = (both - by_q[j] - by_v[i] + value) / _STEP**2
        return found

    def linear(self):
        """Return name -> matrix of the equations of small motions.

        ``springs``, by their stiffness; ``forces``, what static forces and the turning add to it;
        ``lines``, the part of these that comes of lines of action that turn with their axes.
        """
        rest = [mpf(0)] * self.n

        def action(q):
            return self.potential(q) - self.kinetic(q, rest)

        springs, slope = self.curvature(action, rest)
        found = lu_solve(springs, -slope)
        loaded = list(found)
        # At rest no static force bends the energy: the springs alone, and the kinetic energy.
        spin, _ = self.curvature(lambda q: self.kinetic(q, rest), rest)
        springs = springs + spin
        whole, rest_slope = self.curvature(action, loaded)
        assert max(abs(value) for value in rest_slope) < mpf(10) ** -9 * max(map(abs, slope))
        lines = self.curvature(self.flanks, loaded)[0] - self.curvature(self.flanks, rest)[0]
        coriolis = self.mixed(self.kinetic, loaded)
        return {
            "springs": springs / STIFF,
            "forces": whole - springs,
            "lines": lines,
            "load": -slope,
            "mass": self.curvature(lambda v: self.kinetic(loaded, v), rest)[0],
            "coriolis": coriolis - coriolis.T,
            "damping": self.curvature(lambda v: self.lost(loaded, v), rest)[0],
            "circulating": self.mixed(self.lost, loaded),
        }


def linear(train, frame):
    """Return the matrices of `Exact.linear` in floats."""
    with mp.workdps(120):
        found = Exact(train, frame).linear()
        return {name: [[float(v) for v in row] for row in m.tolist()] for name, m in found.items()}
