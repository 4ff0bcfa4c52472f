"""The system of a gear train, from its description.

Coordinates are the displacements x and y of each body and the arc u on its base circle. Those of a
planet are along and across the radius of its pin, seen from the carrier. Springs, masses and
distances are rows over these coordinates, by the formulas of Lin & Parker, J. Vib. Acoust. 121
(1999) 316-321.
"""

from fractions import Fraction

import mpmath
import numpy as np
import scipy.linalg

from tests.independent.equations import System, harmonics, mean_stiffness


def speeds_of(model):
    """Return the speed of each body, in radians per radian of the reference mesh phase, by name.

    Speeds follow from numbers of teeth, and their signs from the driving gear.
    """
    teeth = {body["name"]: body["teeth"] for body in model["bodies"]}
    reference_mesh = next(mesh for mesh in model["meshes"] if mesh["name"] == model["reference"])
    speeds, links = {reference_mesh["pinion"]: Fraction(1, teeth[reference_mesh["pinion"]])}, []
    for mesh in model["meshes"]:
        body_a, body_b = mesh["pinion"], mesh["wheel"]
        links.append(
            (
                body_a,
                body_b,
                Fraction(teeth[body_a], teeth[body_b]) * (1 if mesh["internal"] else -1),
            )
        )
    links += [(*shaft["bodies"], Fraction(1)) for shaft in model["shafts"]]
    for body_a, body_b, ratio in links * len(links):
        if body_a in speeds:
            speeds.setdefault(body_b, speeds[body_a] * ratio)
        elif body_b in speeds:
            speeds[body_a] = speeds[body_b] / ratio
    driving = next((mesh for mesh in model["meshes"] if mesh["driving"]), reference_mesh)
    if _pinion_drives(driving, speeds) != (driving["driving"] in (None, driving["pinion"])):
        speeds = {name: -speed for name, speed in speeds.items()}
    return {name: speeds.get(name, Fraction(0)) for name in teeth}


def _pinion_drives(mesh, speeds):
    """Return whether the pinion drives if the drive-side flanks touch."""
    # The pinion, or a ring gear, drives with these flanks if it rotates in the mesh's `direction`.
    first = mesh["wheel"] if mesh["internal"] else mesh["pinion"]
    return (speeds[first] * mesh["direction"] > 0) != mesh["internal"]


class Train(System):
    """The system of a described train.

    `stiffness_and_load_at_rest` holds stiffness matrix and load vector with the carrier at rest.
    """

    def __init__(self, model, tuning, context):
        self.model, self.bodies = model, {body["name"]: body for body in model["bodies"]}
        self.names = []
        for name, body in self.bodies.items():
            springs = [*body["support_stiffness"], body["torsional_stiffness"]]
            axes = zip("xyu", springs, strict=True)
            self.names += [(name, axis) for axis, k in axes if context.isfinite(k)]
        super().__init__(context, len(self.names))
        self.speeds = speeds_of(model)
        self.reference = next(m for m in model["meshes"] if m["name"] == model["reference"])
        self.add_bodies()
        for shaft in model["shafts"]:
            self.add_shaft(shaft)
        for mesh in model["meshes"]:
            self.add_mesh(mesh)
        self.stiffness_and_load_at_rest = self.stiffness, self.load
        self.set_units(tuning)
        if model["gyroscopic"]:
            self.add_rotating_frame_forces()

    def row(self, name, axis):
        """Return the row of a displacement of a body along an axis, zeros if it is fixed."""
        key = (name, axis)
        return self.unit(self.names.index(key)) if key in self.names else self.zeros(self.n)

    def pin(self, body):
        """Return the radial and tangential rows of the pin of a planet, zeros for other bodies."""
        c, s = self.context.cos(body["angle"]), self.context.sin(body["angle"])
        x, y, u = (self.row(body["carrier"], axis) for axis in "xyu")
        return c * x + s * y, c * y - s * x + u

    def axes(self, body):
        """Return the rows of the centre of a body along its own x and y, or of its rigid pin."""
        rows = zip("xy", body["support_stiffness"], self.pin(body), strict=True)
        return [
            self.row(body["name"], axis) if self.context.isfinite(stiffness) else pin
            for axis, stiffness, pin in rows
        ]

    def frame_rotation(self, body):
        """Return e^(i angle) for the angle of the frame of a body."""
        return self.context.expj(body["angle"] if body["carrier"] else 0)

    def centre_rows(self, name):
        """Return the rows of the centre of a body along x and y of the common frame."""
        (x, y), rotation = self.axes(self.bodies[name]), self.frame_rotation(self.bodies[name])
        return rotation.real * x - rotation.imag * y, rotation.imag * x + rotation.real * y

    def add_bodies(self):
        """Add inertias, supports and torques of all bodies."""
        for name, body in self.bodies.items():
            r, rotation = body["base_radius"], self.row(name, "u")
            rows = zip(self.axes(body), self.pin(body), strict=True)
            springs = zip(body["support_stiffness"], body["support_damping"], strict=True)
            for (row, pin), spring in zip(rows, springs, strict=True):
                self.inertia(row, body["mass"] or 0)
                if self.context.isfinite(spring[0]):
                    self.spring(row - pin, *spring)
            self.inertia(rotation, body["inertia"] / r**2)
            if self.context.isfinite(body["torsional_stiffness"]):
                self.spring(rotation / r, body["torsional_stiffness"], body["torsional_damping"])
            self.load = self.load + rotation * (body["torque"] / r)

    def add_shaft(self, shaft):
        """Add the torsion and bending springs of a shaft between two bodies."""
        a, b = shaft["bodies"]
        twist = [self.row(name, "u") / self.bodies[name]["base_radius"] for name in (a, b)]
        self.spring(twist[0] - twist[1], shaft["stiffness"], shaft["damping"])
        for x, y in zip(self.centre_rows(a), self.centre_rows(b), strict=True):
            self.spring(x - y, shaft["bending_stiffness"], shaft["bending_damping"])

    def add_rotating_frame_forces(self):
        """Add Coriolis and centrifugal forces, and damping forces of supports at rest."""
        pinion = self.reference["pinion"]
        w = self.model["carrier_ratio"] * self.context.mpf(self.speeds[pinion]) * self.speed
        for body in self.bodies.values():
            (x, y), m, (cx, cy) = self.axes(body), body["mass"] or 0, body["support_damping"]
            # The constant force m w^2 r keeps the direction of the carrier's radius, so that motion
            # across this radius, relative to the carrier, changes its components.
            relative = y - self.row(body["carrier"], "u")
            centrifugal_stiffness = np.outer(x, x) + np.outer(relative, relative)
            self.damping = self.damping - 2 * m * w * (np.outer(x, y) - np.outer(y, x))
            self.stiffness = self.stiffness - m * w**2 * centrifugal_stiffness
            if body["carrier"]:
                radius = self.bodies[body["carrier"]]["base_radius"]
                self.load = self.load + m * w**2 * radius * x
            else:
                self.stiffness += w * (cy * np.outer(y, x) - cx * np.outer(x, y))

    def line_of_action(self, mesh):
        """Return the direction of the line of action as a complex number of modulus 1.

        With the angle psi of the line of centres and the pressure angle a it is +-i e^(i(psi -+
        a)).
        """
        context, direction = self.context, mesh["direction"]
        if mesh["line_of_action"] is not None:
            return context.expj(mesh["line_of_action"])
        a = mesh["pressure_angle"] * (1 if mesh["internal"] else -1)
        return direction * context.j * context.expj((mesh["position"] or 0) + direction * a)

    def add_mesh(self, mesh):
        """Add a mesh with stiffness, deviations, friction and backlash of both flanks."""
        context, name, pinion = self.context, mesh["name"], mesh["pinion"]
        # An end is (body, sign of its motion along the line of action, sign of its rotation).
        gear_ends = (pinion, 1, 1), (mesh["wheel"], -1, 1)
        gear_ends = ((mesh["wheel"], 1, 1), (pinion, -1, -1)) if mesh["internal"] else gear_ends
        first, second = (self.speeds[end[0]] for end in gear_ends)
        # At a vector w from the pitch point the first gear slides on the second by (W1 - W2) k x w;
        # along the line of action contact moves as the base circle of the first gear does.
        drive_sense = 1 if mesh["direction"] * first > 0 else -1
        sliding_sense = drive_sense * (1 if first > second else -1)
        friction_row, *distances = self.distances(mesh, gear_ends)
        frequency_ratio = self.context.mpf(abs(self.speeds[pinion]) * self.bodies[pinion]["teeth"])
        shifts = self.model["phases"][name], self.model["coast_phases"][name]
        pitch = mesh["pitch_phase"] / (2 * context.pi)
        pitch = shifts[0] + (pitch if _pinion_drives(mesh, self.speeds) else -pitch)
        # The coast flank follows the drive flank by the thickness of the leading tooth, or by the
        # space of its mate; the pitch point is passed in the middle of both.
        thickness = mesh["tooth_thickness"] or [context.mpf(1) / 2] * 2
        thickness = thickness[::-1] if mesh["internal"] else thickness
        pitches = pitch, pitch + drive_sense * (thickness[0] + 1 - thickness[1]) / 2
        sides = []
        for i, deviation in enumerate(("deviation", "coast_deviation")):
            row, constant, harmonic_terms = distances[i == 1 and mesh["moving_backlash"]]
            for n, a, b in harmonics(mesh[deviation]):
                # Harmonics of both sides are referred to the phase of the drive side.
                z = (a + b * context.j) * context.expj(2 * context.pi * n * shifts[0])
                harmonic_terms = [*harmonic_terms, (n * frequency_ratio, z.real, z.imag)]
            # Friction opposes sliding. On the coast side the elastic force has the opposite sign.
            side_fields = {"friction": (1 - 2 * i) * mesh["friction"][i]}
            side_fields["sliding_reversal"] = pitches[i]
            side_fields |= {"row": row, "profile": self.rectangular_profile(mesh, shifts[i])}
            side_fields["constant"] = constant + (mesh["backlash"] if i else 0)
            side_fields["harmonic_terms"] = harmonic_terms
            sides.append(side_fields | {"material_damping": [mesh["material_damping"], 0, 0]})
        if not context.isfinite(mesh["backlash"]):
            sides.pop()
        oil_damping = [mesh["backlash_damping"], 0, 0]
        friction_row = friction_row * sliding_sense
        fields = {"frequency_ratio": frequency_ratio, "friction_row": friction_row}
        self.add_contact(sides, oil_damping, **fields)

    def distances(self, mesh, gear_ends):
        """Return the row of friction of a mesh and two distances (row, constant, run-out).

        The first distance includes all displacements. The second, for a moving backlash, Eq. (4),
        omits bearings, run-out and offsets. `gear_ends` is described in `add_mesh`.
        """
        row, friction_row, rigid_row = self.zeros(3, self.n)
        constant, run_out = mesh["error"], []
        for name, sign, rotation_sign in gear_ends:
            body = self.bodies[name]
            # This is the line of action in the frame of the body.
            line = sign * self.line_of_action(mesh) / self.frame_rotation(body)
            rotation = mesh["direction"] * rotation_sign * self.row(name, "u")
            x, y = self.axes(body)
            row += line.real * x + line.imag * y + rotation
            friction_row += line.real * y - line.imag * x
            x, y = self.pin(body)
            rigid_row += line.real * x + line.imag * y + rotation
            x, y = body["offset"]
            constant += line.real * x + line.imag * y
            # Run-out moves the centre by e (cos, sin)(speed tau + phase).
            if body["eccentricity"]:
                z = line * body["eccentricity"] * self.context.expj(-body["eccentricity_phase"])
                run_out.append((self.context.mpf(self.speeds[name]), z.real, z.imag))
        return friction_row, (row, constant, run_out), (rigid_row, mesh["error"], [])

    def modes(self):
        """Return (squared frequencies, shapes as columns, stiffness) at mean stiffness, at rest."""
        context, (stiffness, _) = self.context, self.stiffness_and_load_at_rest
        for gears, mesh in zip(self.contacts, self.model["meshes"], strict=True):
            row = gears["sides"][0]["row"]
            stiffness = stiffness + mean_stiffness(mesh) * np.outer(row, row)
        if context is mpmath.fp:
            return *scipy.linalg.eigh(stiffness, self.mass), stiffness
        root = np.array((context.cholesky(context.matrix(self.mass.tolist())) ** -1).tolist())
        squares, shapes = context.eigsy(context.matrix((root @ stiffness @ root.T).tolist()))
        return np.array(list(squares)), root.T @ np.array(shapes.tolist()), stiffness

    def set_units(self, tuning):
        """Set units of length, speed and force from the reference mesh and its strongest mode."""
        model, context = self.model, self.context
        if "derived" in model:
            # A certificate states its units.
            self.length, self.force = model["derived"]["length"], 1
            self.speed = tuning * model["derived"]["omega"]
            return
        squares, shapes, _ = self.modes()
        elastic = abs(squares) > 1e-9 * max(squares)
        squares, shapes = squares[elastic], shapes[:, elastic]
        reference_row = self.contacts[model["meshes"].index(self.reference)]["sides"][0]["row"]
        self.force = mean_stiffness(self.reference)
        modal_displacements = (reference_row @ shapes) * (self.load @ shapes) / squares
        is_loaded = abs(sum(modal_displacements)) > 1e-9 * sum(abs(modal_displacements))
        self.length = abs(sum(modal_displacements)) if is_loaded else context.mpf("1e-6")
        if model["reference_frequency"] is not None:
            self.speed = tuning * 2 * context.pi * model["reference_frequency"]
            return
        share = self.force * (reference_row @ shapes) ** 2 / squares
        # Modes of equal frequency count as one, and the first one wins if energies are equal.
        energy = [sum(share[abs(squares - square) < 1e-6 * square]) for square in squares]
        strongest = next(
            square
            for square, energy_sum in zip(squares, energy, strict=True)
            if energy_sum > 0.999999 * max(energy)
        )
        self.speed = tuning * context.sqrt(strongest)
