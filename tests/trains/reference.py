"""A second code for gear trains: forces written down body by body, scipy's DOP853 between events.

It knows nothing of `TrainSystem` nor of `gearlib.models.trains.structure`: from `Body`, `Shaft` and
`Mesh` it takes parameters, from the train scales, mesh frequencies and phases. Steps end at
switches of the stiffness, of the sliding, and at flanks; a flank is looked for in every step
between the zeros of the distance's rate too, so that a short touch between two steps is not missed.
"""

import math

import numpy as np
from scipy.integrate import DOP853, solve_ivp
from scipy.optimize import brentq

from tests.trains.sliding import past, pitch_points, sliding

TOLERANCES = dict(rtol=1e-12, atol=1e-13)
#: Places in a step where distances are looked at.
PLACES = np.linspace(0.0, 1.0, 17)


def mean_stiffness(train):
    """Return the stiffness with all flanks in contact at mean stiffness, N/m, shape (n, n)."""
    lines, means = train.structure.lines, [mesh.mean_stiffness for mesh in train.meshes]
    return train.structure.stiffness + lines.T @ np.diag(means) @ lines


class Reference:
    """The equations of motion of a train at one tuning, in static deflections and theta."""

    def __init__(self, train, tuning):
        self.train, self.tuning = train, tuning
        self.length, self.omega = train.static_deflection, train.reference_angular_frequency
        self.mesh_speed = tuning * self.omega
        bodies = {body.name: body for body in train.bodies}
        self.columns = {}
        for body in train.bodies:
            for axis, stiffness in zip("xy", body.support_stiffness, strict=True):
                if math.isfinite(stiffness):
                    self.columns[body.name, axis] = len(self.columns)
                elif body.carrier:
                    raise NotImplementedError("rigid pins")
            if math.isfinite(body.torsional_stiffness):
                self.columns[body.name, "u"] = len(self.columns)
        self.n = n = len(self.columns)
        self.bodies = bodies
        # Turning, of gears in radians a second in the frame.
        self.turning = {name: float(v) * self.mesh_speed for name, v in train.speeds.items()}
        frame = train.carrier_ratio * self.turning[train.reference_mesh.pinion]
        self.frame = frame if train.gyroscopic else 0.0
        # Responses of the forces to unit displacements and velocities.
        inertia = self._inertia()
        still = self._linear_forces(np.zeros(n), np.zeros(n))
        units = np.eye(n)
        self.k = np.stack([self._linear_forces(e, 0 * e) - still for e in units], axis=1)
        self.d = np.stack([self._linear_forces(0 * e, e) - still for e in units], axis=1)
        self.inverse = 1.0 / inertia
        self.still = still
        self.distance = np.array([self._distance_of(mesh) for mesh in train.meshes])
        self.sliding = np.array([self._sliding_of(mesh) for mesh in train.meshes])

    def _inertia(self):
        values = np.empty(self.n)
        for (name, axis), i in self.columns.items():
            body = self.bodies[name]
            values[i] = body.inertia / body.base_radius**2 if axis == "u" else body.mass
        return values

    def _linear_forces(self, q, v):
        """Return the forces, N, of all but the meshes at displacements in m, velocities in m/s."""
        f = np.zeros(self.n)

        def motion(values, name, axis):
            i = self.columns.get((name, axis))
            return 0.0 if i is None else values[i]

        def push(name, axis, force):
            i = self.columns.get((name, axis))
            if i is not None:
                f[i] += force

        for name, body in self.bodies.items():
            r, w, m = body.base_radius, self.frame, body.mass or 0.0
            x, y, u = (motion(q, name, axis) for axis in "xyu")
            vx, vy, vu = (motion(v, name, axis) for axis in "xyu")
            # Coriolis and centrifugal forces in the frame of the carrier. Out on a pin m w^2 r is
            # balanced by a force that turns with the carrier: across it acts on what does not.
            out = self.bodies[body.carrier].base_radius if body.carrier else 0.0
            lead = motion(q, body.carrier, "u") if body.carrier else 0.0
            push(name, "x", m * (2.0 * w * vy + w * w * (x + out)))
            push(name, "y", m * (-2.0 * w * vx + w * w * (y - lead)))
            if body.carrier:
                push(body.carrier, "u", -m * w * w * (y - lead))
            (kx, ky), (cx, cy) = body.support_stiffness, body.support_damping
            if body.carrier:
                c, s = math.cos(body.angle), math.sin(body.angle)
                carrier = body.carrier
                xc, yc, uc = (motion(q, carrier, axis) for axis in "xyu")
                vxc, vyc, vuc = (motion(v, carrier, axis) for axis in "xyu")
                radial = kx * (xc * c + yc * s - x) + cx * (vxc * c + vyc * s - vx)
                along = ky * (yc * c - xc * s + uc - y) + cy * (vyc * c - vxc * s + vuc - vy)
                push(name, "x", radial)
                push(name, "y", along)
                push(carrier, "x", -radial * c + along * s)
                push(carrier, "y", -radial * s - along * c)
                push(carrier, "u", -along)
            else:
                # A support that stands still sees the velocity in the fixed frame.
                if math.isfinite(kx):
                    push(name, "x", -kx * x - cx * (vx - w * y))
                if math.isfinite(ky):
                    push(name, "y", -ky * y - cy * (vy + w * x))
            if math.isfinite(body.torsional_stiffness):
                twist = body.torsional_stiffness * u / r + body.torsional_damping * vu / r
                push(name, "u", (body.torque - twist) / r)
        for shaft in self.train.shafts:
            a, b = shaft.bodies
            ra, rb = self.bodies[a].base_radius, self.bodies[b].base_radius
            angle = motion(q, a, "u") / ra - motion(q, b, "u") / rb
            speed = motion(v, a, "u") / ra - motion(v, b, "u") / rb
            torque = shaft.stiffness * angle + shaft.damping * speed
            push(a, "u", -torque / ra)
            push(b, "u", torque / rb)
            for axis in "xy":
                gap = motion(q, a, axis) - motion(q, b, axis)
                rate = motion(v, a, axis) - motion(v, b, axis)
                force = shaft.bending_stiffness * gap + shaft.bending_damping * rate
                push(a, axis, -force)
                push(b, axis, force)
        return f

    def _distance_of(self, mesh):
        """Return d as a row over the coordinates, as `shared` formulas of planetary trains do."""
        row = np.zeros(self.n)
        lambda_ = self._line(mesh)
        for name, sign, turn in self._ends(mesh):
            body = self.bodies[name]
            # Planets count their motion along and across their own radius.
            own = lambda_ - (body.angle if body.carrier else 0.0)
            parts = (sign * math.cos(own), sign * math.sin(own), mesh.direction * turn)
            for axis, part in zip("xyu", parts, strict=True):
                if (name, axis) in self.columns:
                    row[self.columns[name, axis]] += part
        return row

    def _sliding_of(self, mesh):
        """Return how the flanks slide past the pitch point, as a row of unit speed."""
        row = np.zeros(self.n)
        lambda_ = self._line(mesh)
        _, speed = sliding(self.train, mesh, True, 0.25)
        way = np.array([-math.sin(lambda_), math.cos(lambda_)])
        way *= math.copysign(1.0, way @ speed)
        for name, sign in ((mesh.pinion, 1.0), (mesh.wheel, -1.0)):
            body = self.bodies[name]
            c, s = (math.cos(body.angle), math.sin(body.angle)) if body.carrier else (1.0, 0.0)
            own = c * way[0] + s * way[1], c * way[1] - s * way[0]
            for axis, part in zip("xy", own, strict=True):
                if (name, axis) in self.columns:
                    row[self.columns[name, axis]] += sign * part
        return row

    def _ends(self, mesh):
        if mesh.internal:
            return (mesh.wheel, 1.0, 1.0), (mesh.pinion, -1.0, -1.0)
        return (mesh.pinion, 1.0, 1.0), (mesh.wheel, -1.0, 1.0)

    def _line(self, mesh):
        """Return the angle of the line of action, from (-sin, cos)(psi -+ a)."""
        if mesh.line_of_action is not None:
            return mesh.line_of_action
        a = mesh.pressure_angle if mesh.internal else -mesh.pressure_angle
        psi = mesh.position or 0.0
        x = -math.sin(psi + mesh.direction * a) * mesh.direction
        y = math.cos(psi + mesh.direction * a) * mesh.direction
        return math.atan2(y, x)

    def local(self, j, t):
        """Return the own phase of mesh j at a time in s, rad."""
        rate = float(self.train.rates[j])
        shift = self.train.phases[self.train.meshes[j].name]
        return rate * self.mesh_speed * t - 2.0 * math.pi * shift

    def errors(self, j, side, t):
        """Return (e_j, de_j/dt) in m, m/s of the drive (1) or coast (0) side; t may be an array."""
        mesh = self.train.meshes[j]
        e, v = mesh.error + 0.0 * t, 0.0 * t
        lambda_ = self._line(mesh)
        for name, sign, _ in self._ends(mesh):
            body = self.bodies[name]
            own = lambda_ - (body.angle if body.carrier else 0.0)
            e = e + sign * (math.cos(own) * body.offset[0] + math.sin(own) * body.offset[1])
            angle = self.turning[name] * t + body.eccentricity_phase - own
            e = e + sign * body.eccentricity * np.cos(angle)
            v = v - sign * body.eccentricity * self.turning[name] * np.sin(angle)
        deviation = mesh.deviation if side else mesh.inverse_deviation
        phase, speed = self.local(j, t), float(self.train.rates[j]) * self.mesh_speed
        for i, a in enumerate(deviation.cosines, 1):
            e, v = e + a * np.cos(i * phase), v - a * i * speed * np.sin(i * phase)
        for i, b in enumerate(deviation.sines, 1):
            e, v = e + b * np.sin(i * phase), v + b * i * speed * np.cos(i * phase)
        return e, v

    def gap(self, j, side, t, z):
        """Return (distance, rate) of a flank pair, m and m/s; far flanks touch below 0."""
        e, v = self.errors(j, side, t)
        row = self.distance[j]
        s = 0.0 if side else self.train.meshes[j].backlash
        return row @ z[: self.n] + e + s, row @ z[self.n :] + v

    def levels(self, t):
        """Return (stiffness, sense of sliding), coast and drive, of every mesh just around t."""
        rows = []
        for j, mesh in enumerate(self.train.meshes):
            phase = self.local(j, t)
            back = phase
            ahead = self.train.phases[mesh.name] - self.train.inverse_phases[mesh.name]
            back += 2.0 * math.pi * ahead
            values = []
            for p in (back, phase):
                away = abs((p + math.pi) % (2.0 * math.pi) - math.pi)
                high = away <= math.pi * (mesh.contact_ratio - 1.0)
                values.append(mesh.max_stiffness * (1.0 if high else mesh.stiffness_ratio))
            since = past(self.train, mesh, self.mesh_speed * t)
            ways = [-1.0 if turns < 0.0 else 1.0 for turns in since]
            rows.append(tuple(zip(values, ways, strict=True)))
        return rows

    def switches(self, end):
        """Return the times in (0, end] at which any level or sliding changes, and the end."""
        times = [end]
        for j, mesh in enumerate(self.train.meshes):
            speed = float(self.train.rates[j]) * self.mesh_speed
            g = self.train.phases[mesh.name]
            half = (mesh.contact_ratio - 1.0) / 2.0
            cuts = []
            for shift in {g, self.train.inverse_phases[mesh.name]}:
                cuts += [shift + half, shift - half]
            if any(mesh.friction):
                cuts += [at + half for at in pitch_points(self.train, mesh) for half in (0.0, 0.5)]
            count = int(end * speed / (2.0 * math.pi)) + 3
            for k in range(-2, count + 1):
                times += [2.0 * math.pi * (c % 1.0 + k) / speed for c in cuts]
        times = sorted(t for t in times if 1e-15 < t <= end)
        kept = [times[0]]
        for t in times[1:]:
            if t - kept[-1] > 1e-13 * end:
                kept.append(t)
        kept[-1] = end
        return kept

    def right_side(self, codes, levels):
        """Return the function dz/dt, z in m and m/s, for contact codes and levels."""
        train, n = self.train, self.n
        stiff, damp = self.k.copy(), self.d.copy()
        terms = []
        for j, mesh in enumerate(train.meshes):
            row = self.distance[j]
            damp -= mesh.backlash_damping * np.outer(row, row)
            terms.append((-mesh.backlash_damping * row, j, 1, 0.0, 1.0))
            if codes[j]:
                side = 1 if codes[j] > 0 else 0
                c, way = levels[j][side]
                more = mesh.material_damping - mesh.backlash_damping
                # Against the sliding of the flanks; the coast side has distances below zero.
                mu = mesh.friction[0 if side else 1] * way * (1.0 if side else -1.0)
                across = row + mu * self.sliding[j]
                stiff -= c * np.outer(across, row)
                damp -= more * np.outer(row, row)
                terms.append((-across, j, side, c, 0.0))
                terms.append((-row, j, side, 0.0, more))
        still = self.still.copy()
        moving = []
        for vector, j, side, c, k in terms:
            mesh = train.meshes[j]
            if not side:
                still += vector * c * mesh.backlash
            moving.append((vector, j, side, c, k))

        def f(t, z):
            force = still + stiff @ z[:n] + damp @ z[n:]
            known = {}
            for vector, j, side, c, k in moving:
                if (j, side) not in known:
                    known[j, side] = self.errors(j, side, t)
                e, v = known[j, side]
                force = force + vector * (c * e + k * v)
            return np.concatenate([z[n:], self.inverse * force])

        return f

    def watched(self, codes):
        """Return (mesh, side, sign, next code): a flank is met where sign * distance falls to 0."""
        found = []
        for j, code in enumerate(codes):
            if code == 1:
                found.append((j, 1, 1.0, 0))
            elif code == -1:
                found.append((j, 0, -1.0, 0))
            else:
                found.append((j, 1, -1.0, 1))
                if math.isfinite(self.train.meshes[j].backlash):
                    found.append((j, 0, 1.0, -1))
        return found

    def run(self, state, periods):
        """Run from tau = 0; return (state at the end, events).

        Parameters
        ----------
        state : ndarray, shape (2 n,)
            q in static deflections, dq/dtheta.
        periods : float
            Of the reference mesh.

        Returns
        -------
        state : ndarray, shape (2 n,)
        events : list of (tau, mesh, code before, code after, rate of the distance by theta)
        """
        scale = np.repeat([self.length, self.length * self.omega], self.n)
        z = np.asarray(state, float) * scale
        t, end = 0.0, 2.0 * math.pi * periods / self.mesh_speed
        events, codes = [], []
        for j, mesh in enumerate(self.train.meshes):
            near = self.gap(j, 1, t, z)[0]
            closed = math.isfinite(mesh.backlash) and self.gap(j, 0, t, z)[0] <= 0.0
            codes.append(1 if near >= 0.0 else -1 if closed else 0)
        for stop in self.switches(end):
            levels = self.levels((t + stop) / 2.0)
            while t < stop:
                t, z, met = self._until(t, z, stop, scale, codes, levels)
                for j, side, _, code in met:
                    rate = self.gap(j, side, t, z)[1] / (self.length * self.omega)
                    events.append((self.mesh_speed * t, j, codes[j], code, rate))
                    codes[j] = code
        return z / scale, events

    def _until(self, t, z, stop, scale, codes, levels):
        """Return (time, z, flanks met) at the next flank or at `stop`."""
        f = self.right_side(codes, levels)

        def scaled(s, y):
            return f(s, y * scale) / scale

        watched = self.watched(codes)
        met = [w for w in watched if self._due(w, t, z)]
        if met:
            return t, z, met
        solver = DOP853(scaled, t, z / scale, stop, **TOLERANCES)
        while solver.status == "running":
            solver.step()
            dense = solver.dense_output()
            first = None
            for flank in watched:
                root = self._root(flank, dense, solver.t_old, solver.t, scale)
                if root is not None and (first is None or root < first[0]):
                    first = root, flank
            if first is not None:
                # Steps again from the last accepted state: the interpolant has fewer digits.
                old = dense(solver.t_old)
                root, flank = first
                start = solver.t_old
                for _ in range(4):
                    root = min(max(root, start), stop)
                    y = old
                    if root > start:
                        y = solve_ivp(scaled, (start, root), old, method="DOP853", **TOLERANCES).y[
                            :, -1
                        ]
                    distance, rate = self.gap(flank[0], flank[1], root, y * scale)
                    if abs(distance) < 1e-15 * self.length or rate == 0.0:
                        break
                    shift = -distance / rate
                    if abs(shift) > solver.t - start:
                        break
                    root += shift
                return root, y * scale, [flank]
        return stop, solver.y * scale, []

    def _due(self, flank, t, z):
        j, side, sign, _ = flank
        distance, rate = self.gap(j, side, t, z)
        return sign * distance < 0.0 and sign * rate < 0.0

    def _root(self, flank, dense, a, b, scale):
        j, side, sign, _ = flank

        def distance(t):
            return sign * self.gap(j, side, t, dense(t) * scale)[0]

        def rate(t):
            return sign * self.gap(j, side, t, dense(t) * scale)[1]

        places = a + PLACES * (b - a)
        states = dense(places) * scale[:, None]
        gaps, rates = (sign * values for values in self.gap(j, side, places, states))
        for i in range(1, places.size):
            low, high = places[i - 1], places[i]
            if gaps[i] >= 0.0 and rates[i - 1] < 0.0 < rates[i] and gaps[i - 1] > 0.0:
                high = brentq(rate, low, high, xtol=1e-20)
                if distance(high) < 0.0:
                    return _zero(distance, low, high)
            elif gaps[i] < 0.0:
                if gaps[i - 1] > 0.0:
                    return _zero(distance, low, high)
                # On the line at the start of the step: off it and back, or at once.
                if rates[i - 1] > 0.0:
                    top = brentq(rate, low, high, xtol=1e-20) if rates[i] < 0.0 else low
                    if distance(top) > 0.0:
                        return _zero(distance, top, high)
                elif i == 1:
                    return low
        return None


def _zero(distance, low, high):
    """Return where a distance falls through zero; its ends may be the rounding of zero."""
    if distance(high) >= 0.0:
        return high
    return low if distance(low) <= 0.0 else brentq(distance, low, high, xtol=1e-20)
