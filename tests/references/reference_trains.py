"""Equations of motion of a gear train, from its description; nothing of gearlib.

Displacements: of a body along x, y and the arc u of its base circle; of a planet along and across
the radius of its pin, seen from the carrier. Springs, masses and distances are rows over them, by
the formulas of Lin & Parker, J. Vib. Acoust. 121 (1999) 316-321.
"""

from fractions import Fraction

import mpmath
import numpy as np

from tests.references.described_models import mean_stiffness
from tests.references.reference_equations import Contact, Machine, Side, harmonics, rectangle


def speeds_of(model):
    """Return name -> speed in radians per radian of reference mesh phase, by tooth numbers."""
    teeth = {body["name"]: body["teeth"] for body in model["bodies"]}
    first = next(mesh for mesh in model["meshes"] if mesh["name"] == model["reference"])
    found = {first["pinion"]: Fraction(1, teeth[first["pinion"]])}
    links = [
        (one, other, Fraction(teeth[one], teeth[other]) * (1 if mesh["internal"] else -1))
        for mesh in model["meshes"]
        for one, other in [(mesh["pinion"], mesh["wheel"])]
    ] + [(*shaft["bodies"], Fraction(1)) for shaft in model["shafts"]]
    for _ in links:
        for one, other, ratio in links:
            if one in found:
                found.setdefault(other, found[one] * ratio)
            elif other in found:
                found[one] = found[other] / ratio
    asked = next((mesh for mesh in model["meshes"] if mesh["driving"]), first)
    if _pinion_drives(asked, found) != (asked["driving"] in (None, asked["pinion"])):
        found = {name: -speed for name, speed in found.items()}
    return {name: found.get(name, Fraction(0)) for name in teeth}


def _pinion_drives(mesh, speeds):
    """Return whether the pinion pushes where drive-side flanks touch."""
    # Pushed counterclockwise the first gear, of an internal mesh the wheel, touches there if 1.
    first = mesh["wheel"] if mesh["internal"] else mesh["pinion"]
    leads = speeds[first] * mesh["direction"] > 0
    return leads != mesh["internal"]


class _Train(Machine):
    def __init__(self, model, tuning, context):
        self.model, self.bodies = model, {body["name"]: body for body in model["bodies"]}
        names = []
        for body in model["bodies"]:
            for axis, k in zip("xy", body["support_stiffness"], strict=True):
                names += [(body["name"], axis)] if context.isfinite(k) else []
            if context.isfinite(body["torsional_stiffness"]):
                names.append((body["name"], "u"))
        super().__init__(context, len(names))
        self.names = names
        self.speeds = speeds_of(model)
        self.add_bodies()
        for shaft in model["shafts"]:
            self.add_shaft(shaft)
        self.contacts = [self.mesh(mesh) for mesh in model["meshes"]]
        names = [mesh["name"] for mesh in model["meshes"]]
        self.reference = names.index(model["reference"])
        #: without the forces of the frame
        self.still = self.stiffness, self.load
        self.set_scales(model, tuning)
        if model["gyroscopic"]:
            self.turn()

    def row(self, name, axis):
        key = (name, axis)
        return self.unit(self.names.index(key)) if key in self.names else self.zeros(self.n)

    def pin(self, body):
        """Return the rows of the pin of a planet, radial and tangential."""
        c, s = self.context.cos(body["angle"]), self.context.sin(body["angle"])
        x, y, u = (self.row(body["carrier"], axis) for axis in "xyu")
        return c * x + s * y, c * y - s * x + u

    def axes(self, name):
        """Return the rows of an axis along its own x and y; of rigid pins those of the pin."""
        body = self.bodies[name]
        rows = [self.row(name, axis) for axis in "xy"]
        if body["carrier"]:
            for i, pin in enumerate(self.pin(body)):
                if not self.context.isfinite(body["support_stiffness"][i]):
                    rows[i] = pin
        return rows

    def fixed(self, name):
        """Return the rows of an axis along x and y of the frame."""
        (x, y), body = self.axes(name), self.bodies[name]
        if not body["carrier"]:
            return x, y
        c, s = self.context.cos(body["angle"]), self.context.sin(body["angle"])
        return c * x - s * y, s * x + c * y

    def add_bodies(self):
        for name, body in self.bodies.items():
            r, rows, turn = body["base_radius"], self.axes(name), self.row(name, "u")
            pins = self.pin(body) if body["carrier"] else (0, 0)
            for i, row in enumerate(rows):
                if body["mass"] is not None:
                    self.inertia(row, body["mass"])
                if self.context.isfinite(body["support_stiffness"][i]):
                    values = body["support_stiffness"][i], body["support_damping"][i]
                    self.spring(row - pins[i], *values)
            self.inertia(turn, body["inertia"] / r**2)
            if self.context.isfinite(body["torsional_stiffness"]):
                values = body["torsional_stiffness"], body["torsional_damping"]
                self.spring(turn / r, *values)
            self.load = self.load + turn * (body["torque"] / r)

    def add_shaft(self, shaft):
        one, other = shaft["bodies"]
        twist = [self.row(name, "u") / self.bodies[name]["base_radius"] for name in (one, other)]
        self.spring(twist[0] - twist[1], shaft["stiffness"], shaft["damping"])
        for a, b in zip(self.fixed(one), self.fixed(other), strict=True):
            self.spring(a - b, shaft["bending_stiffness"], shaft["bending_damping"])

    def turn(self):
        """Add the forces of the frame: Coriolis, centrifugal, and of supports that stand still."""
        first = self.model["meshes"][self.reference]["pinion"]
        ratio, speed = self.model["carrier_ratio"], self.speeds[first]
        w = ratio * speed.numerator / speed.denominator * self.speed
        for name, body in self.bodies.items():
            (x, y), m = self.axes(name), body["mass"] or 0
            carrier = self.bodies.get(body["carrier"])
            # m w^2 r out on the pin goes on with the carrier: across it acts on what does not.
            lag = y - self.row(carrier["name"], "u") if carrier else y
            self.damping = self.damping - 2 * m * w * (np.outer(x, y) - np.outer(y, x))
            self.stiffness = self.stiffness - m * w**2 * (np.outer(x, x) + np.outer(lag, lag))
            if carrier:
                self.load = self.load + m * w**2 * carrier["base_radius"] * x
            else:
                cx, cy = body["support_damping"]
                drag = cy * np.outer(y, x) - cx * np.outer(x, y)
                self.stiffness = self.stiffness + w * drag

    def ends(self, mesh):
        """Return (name, sign of its axis, sign of its turning) of both gears."""
        if mesh["internal"]:
            return (mesh["wheel"], 1, 1), (mesh["pinion"], -1, -1)
        return (mesh["pinion"], 1, 1), (mesh["wheel"], -1, 1)

    def line(self, mesh):
        """Return the unit vector of the line of action, by -sin, cos of psi -+ a."""
        context, way = self.context, mesh["direction"]
        if mesh["line_of_action"] is not None:
            angle = mesh["line_of_action"]
            return context.cos(angle), context.sin(angle)
        a = mesh["pressure_angle"] * (1 if mesh["internal"] else -1)
        psi = (mesh["position"] or 0) + way * a
        return -way * context.sin(psi), way * context.cos(psi)

    def mesh(self, mesh):
        """Return the `Contact` of a mesh."""
        ex, ey = self.line(mesh)
        row, across, constant = self.zeros(self.n), self.zeros(self.n), mesh["error"]
        #: by the turning of the gears, and of a carrier with its pins: a coast side that moves
        turned = self.zeros(self.n)
        # A way w past the pitch point the first gear slides on the second by (W1 - W2) k x w;
        # along the line of action contact goes as the base circle of the first does.
        (first, _, turn), (second, *_) = ends = self.ends(mesh)
        leads = 1 if mesh["direction"] * turn * self.speeds[first] > 0 else -1
        slides = leads * (1 if self.speeds[first] > self.speeds[second] else -1)
        waves = []
        for name, sign, turn in ends:
            body, (x, y) = self.bodies[name], self.fixed(name)
            row = row + sign * (ex * x + ey * y)
            across = across + slides * sign * (ex * y - ey * x)
            row = row + mesh["direction"] * turn * self.row(name, "u")
            turned = turned + mesh["direction"] * turn * self.row(name, "u")
            psi = body["angle"] if body["carrier"] else self.context.mpf(0)
            c, s = self.context.cos(psi), self.context.sin(psi)
            if body["carrier"]:
                out, on = self.pin(body)
                turned = turned + sign * (ex * (c * out - s * on) + ey * (s * out + c * on))
            ox, oy = body["offset"]
            constant += sign * (ex * (c * ox - s * oy) + ey * (s * ox + c * oy))
            # e (cos, sin)(speed tau + phase + psi) along the line
            size, speed = sign * body["eccentricity"], self.speeds[name]
            if size:
                at = body["eccentricity_phase"] + psi
                c, s = size * self.context.cos(at), size * self.context.sin(at)
                rate = self.context.mpf(speed.numerator) / speed.denominator
                waves.append((rate, ex * c + ey * s, ey * c - ex * s))
        rate = abs(self.speeds[mesh["pinion"]]) * self.bodies[mesh["pinion"]]["teeth"]
        rate = self.context.mpf(rate.numerator) / rate.denominator
        shifts = self.model["phases"][mesh["name"]], self.model["inverse_phases"][mesh["name"]]
        course, sides = rectangle(mesh, self.context), []
        pitch = mesh["pitch_phase"] / (2 * self.context.pi)
        pitch = shifts[0] + (pitch if _pinion_drives(mesh, self.speeds) else -pitch)
        # The other flank of a leading tooth follows by its thickness, or the space of the other.
        thick = (mesh["tooth_thickness"] or [self.context.mpf(1) / 2] * 2)[
            :: -1 if mesh["internal"] else 1
        ]
        pitches = pitch, pitch + leads * (thick[0] + 1 - thick[1]) / 2
        for i, name in enumerate(("deviation", "inverse_deviation")):
            side = Side(row, course, [mesh["material_damping"], 0, 0], constant, shifts[i])
            side.friction, side.turns = mesh["friction"][i], pitches[i]
            # With phases of the drive side: of cos(n (x - g)) and sin.
            for n, a, b in harmonics(mesh[name]):
                lag = 2 * self.context.pi * n * shifts[0]
                c, s = self.context.cos(lag), self.context.sin(lag)
                side.waves.append((n * rate, a * c - b * s, a * s + b * c))
            side.waves += waves
            sides.append(side)
        if mesh["moving_backlash"]:
            # What supports give, run-out and offsets of axes do not close the backlash, Eq. (4).
            sides[1].row, constant = turned, mesh["error"]
            sides[1].waves = [wave for wave in sides[1].waves if wave not in waves]
        # Friction pushes down the slide: on the coast side, pressed by d < 0, with the other sign.
        if sides[1].friction:
            sides[1].friction = -sides[1].friction
        sides[1].constant = constant + mesh["backlash"]
        coast = sides[1] if self.context.isfinite(mesh["backlash"]) else None
        return Contact(sides[0], coast, [mesh["backlash_damping"], 0, 0], rate, across=across)

    def modes(self):
        """Return (squared frequencies, shapes as columns, stiffness) with mean stiffness."""
        stiffness, _ = self.still
        for contact, mesh in zip(self.contacts, self.model["meshes"], strict=True):
            row = contact.drive.row
            stiffness = stiffness + mean_stiffness(mesh) * np.outer(row, row)
        if self.kind is float:
            root = np.linalg.inv(np.linalg.cholesky(self.mass))
            squares, shapes = np.linalg.eigh(root @ stiffness @ root.T)
        else:
            cholesky = mpmath.cholesky(mpmath.matrix(self.mass.tolist()))
            root = np.array((cholesky**-1).tolist(), object)
            found = mpmath.eigsy(mpmath.matrix((root @ stiffness @ root.T).tolist()))
            squares, shapes = (np.array(one.tolist(), object) for one in found)
            squares = squares.ravel()
            order = sorted(range(self.n), key=lambda i: squares[i])
            squares, shapes = squares[order], shapes[:, order]
        return squares, root.T @ shapes, stiffness

    def set_scales(self, model, tuning):
        """Set units: the static deflection of the reference mesh, and the tuning's frequency."""
        if "derived" in model:
            # As a certificate takes them.
            self.length, omega = model["derived"]["length"], model["derived"]["omega"]
            self.force_unit, self.speed = 1, tuning * omega
            return
        squares, shapes, _ = self.modes()
        elastic = [i for i in range(self.n) if abs(squares[i]) > 1e-9 * max(squares)]
        self.free = shapes[:, [i for i in range(self.n) if i not in elastic]]
        squares, shapes = squares[elastic], shapes[:, elastic]
        line, mean = (
            self.contacts[self.reference].drive.row,
            mean_stiffness(model["meshes"][self.reference]),
        )
        parts = (line @ shapes) * (self.load @ shapes) / squares
        deflection = abs(sum(parts))
        there = deflection > 1e-9 * sum(abs(part) for part in parts)
        self.force_unit = mean
        self.length = deflection if there else self.context.mpf("1e-6")
        if model["reference_frequency"] is not None:
            omega = 2 * self.context.pi * model["reference_frequency"]
        else:
            share = mean * (line @ shapes) ** 2 / squares
            # Modes of one frequency count as one.
            energy = [sum(share[abs(squares - w) < 1e-6 * w]) for w in squares]
            best = next(i for i, e in enumerate(energy) if e > 0.999999 * max(energy))
            omega = self.context.sqrt(squares[best])
        self.speed = tuning * omega

    def rest(self):
        """Return the coordinates at rest at phase 0, in m."""
        codes = [1] * len(self.contacts)
        for _ in range(50):
            stiffness, force = self.still
            for contact, code in zip(self.contacts, codes, strict=True):
                side = contact.drive if code > 0 else contact.coast if code else None
                if side:
                    little = self.context.mpf(10) ** -12
                    level = contact.level(self.context, side, little, little)[0]
                    gap = self.distance(side, self.zeros(self.n), self.context.mpf(0))
                    stiffness = stiffness + level * np.outer(side.row, side.row)
                    force = force - level * gap * side.row
            held = self.mass @ self.free
            size = max(abs(value) for value in np.diag(stiffness))
            stiffness = stiffness + size * held @ held.T
            if self.kind is float:
                q = np.linalg.solve(stiffness, force)
            else:
                solved = mpmath.lu_solve(
                    mpmath.matrix(stiffness.tolist()), mpmath.matrix(list(force))
                )
                q = np.array(list(solved), object)
            found = []
            for contact in self.contacts:
                drive = self.distance(contact.drive, q, self.context.mpf(0))
                coast = self.distance(contact.coast, q, self.context.mpf(0)) if contact.coast else 1
                found.append(1 if drive >= 0 else -1 if coast <= 0 else 0)
            if found == codes:
                return q
            codes = found
        raise ArithmeticError("the flanks of the static train do not settle")

    def start(self, state):
        """Return (q, q') for a state in units, or at rest."""
        if isinstance(state, str):
            return self.rest(), self.zeros(self.n)
        values = np.array([self.context.mpf(x) for x in state], self.kind) * self.length
        return values[: self.n], values[self.n :]


def train(model, tuning, context):
    """Return the `Machine` of a described train."""
    return _Train(model, tuning, context)
