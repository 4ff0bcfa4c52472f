"""The equations of a train from the JSON of a certificate alone; it shares no code with gearlib.

mpmath in 50 digits, SI units, mesh phase as time: distances and forces written down body by body.
"""

from fractions import Fraction

from mpmath import cos, inf, lu_solve, matrix, mp, mpf, pi, sin, sqrt

from tests.proofs.tooth_meshes import Levels, Mesh, number

mp.dps = 50


class Train:
    """The equations of a claim: M Omega^2 q'' + D Omega q' + K q = f - mesh forces."""

    def __init__(self, claim):
        self.claim, model = claim, claim["pair"]
        self.names = claim["coordinates"]
        self.n = len(self.names)
        self.at = {name: i for i, name in enumerate(self.names)}
        self.mass, self.load = [mpf(0)] * self.n, [mpf(0)] * self.n
        self.springs, self.meshes, self.forcing = [], [], []
        if "equation" in claim:
            self._one_degree(claim["equation"])
        else:
            (self._train if "bodies" in model else self._pair)(model)
        tuning = claim["tuning"]
        self.nu = number(tuning) if isinstance(tuning, str) else sum(map(mpf, tuning)) / 2
        self.omega *= self.nu
        self.codes = list(claim["contacts"])
        waves = {f for mesh in self.meshes for f in mesh.waves} | {f for f, *_ in self.forcing}
        self.frequencies = sorted(waves)
        self.kept = [i for i, name in enumerate(self.names) if name not in claim["fixed"]]
        self.turning = self._free()

    def _unit(self, name, size=1):
        row = [mpf(0)] * self.n
        if name in self.at:
            row[self.at[name]] = mpf(size)
        return row

    # The train, body by body.

    def _train(self, model):
        bodies = {body["name"]: body for body in model["bodies"]}
        derived = self.claim["derived"]
        self.length = number(derived["static_deflection"])
        self.omega = number(derived["reference_angular_frequency"])
        for name, body in bodies.items():
            r = number(body["base_radius"])
            axes = {axis: self._unit(f"{name} {axis}") for axis in "xyu"}
            supports = [axes["x"], axes["y"]]
            if body["carrier"]:
                # Radial x_c cos + y_c sin - zeta, tangential -x_c sin + y_c cos + u_c - eta.
                x, y, u = (self._unit(f"{body['carrier']} {axis}") for axis in "xyu")
                c, s = cos(number(body["angle"])), sin(number(body["angle"]))
                supports = [
                    [c * a + s * b - e for a, b, e in zip(x, y, axes["x"], strict=True)],
                    [c * b - s * a + d - e for a, b, d, e in zip(x, y, u, axes["y"], strict=True)],
                ]
            for axis in "xy":
                if f"{name} {axis}" in self.at:
                    self.mass[self.at[f"{name} {axis}"]] = number(body["mass"])
            if f"{name} u" in self.at:
                self.mass[self.at[f"{name} u"]] = number(body["inertia"]) / r**2
                self.load[self.at[f"{name} u"]] = number(body["torque"]) / r
                self.springs.append(
                    (
                        number(body["torsional_stiffness"]) / r**2,
                        number(body["torsional_damping"]) / r**2,
                        axes["u"],
                    )
                )
            for row, k, d in zip(
                supports, body["support_stiffness"], body["support_damping"], strict=True
            ):
                assert number(k) < inf or not body["carrier"], "rigid pins are beyond this program"
                if number(k) < inf:
                    self.springs.append((number(k), number(d), row))
        for shaft in model["shafts"]:
            rows = []
            for name in shaft["bodies"]:
                r = number(bodies[name]["base_radius"])
                assert not bodies[name]["carrier"]
                rows.append(
                    [self._unit(f"{name} u", 1 / r)] + [self._unit(f"{name} {a}") for a in "xy"]
                )
            k, d = number(shaft["stiffness"]), number(shaft["damping"])
            bend = number(shaft["bending_stiffness"]), number(shaft["bending_damping"])
            for (one, other), values in zip(
                zip(*rows, strict=True), [(k, d), bend, bend], strict=True
            ):
                self.springs.append((*values, [a - b for a, b in zip(one, other, strict=True)]))
        self._speeds(model, bodies)
        for mesh in model["meshes"]:
            self._mesh(mesh, bodies, derived)

    def _speeds(self, model, bodies):
        """Set radians per radian of reference mesh phase: gears in mesh turn by their teeth."""
        first = next(mesh for mesh in model["meshes"] if mesh["name"] == model["reference"])
        self.speed = {first["pinion"]: Fraction(1, bodies[first["pinion"]]["teeth"])}
        links = [
            (
                mesh["pinion"],
                mesh["wheel"],
                Fraction(bodies[mesh["pinion"]]["teeth"], bodies[mesh["wheel"]]["teeth"])
                * (1 if mesh["internal"] else -1),
            )
            for mesh in model["meshes"]
        ] + [(*shaft["bodies"], Fraction(1)) for shaft in model["shafts"]]
        for _ in links:
            for one, other, ratio in links:
                if one in self.speed:
                    self.speed.setdefault(other, self.speed[one] * ratio)
                elif other in self.speed:
                    self.speed[one] = self.speed[other] / ratio
        asked = next((mesh for mesh in model["meshes"] if mesh["driving"]), first)
        if self._pinion_drives(asked) != (asked["driving"] in (None, asked["pinion"])):
            self.speed = {name: -speed for name, speed in self.speed.items()}

    def _pinion_drives(self, mesh):
        """Return whether the pinion pushes the wheel where the drive-side flanks touch."""
        turns = self.speed[mesh["pinion"]] > 0
        return turns == (mesh["direction"] == (-1 if mesh["internal"] else 1))

    def _mesh(self, mesh, bodies, derived):
        a = number(mesh["pressure_angle"]) * (-1 if mesh["internal"] else 1)
        way, position = mesh["direction"], number(mesh["position"] or "0x0p0")
        assert mesh["line_of_action"] is None
        angle = position - way * a
        line = -way * sin(angle), way * cos(angle)
        ends = [(mesh["pinion"], 1, 1), (mesh["wheel"], -1, 1)]
        if mesh["internal"]:
            ends = [(mesh["wheel"], 1, 1), (mesh["pinion"], -1, -1)]
        row, across, give = ([mpf(0)] * self.n for _ in range(3))
        own = constant = number(mesh["error"])
        # A way w of the contact past the pitch point the first gear slides on the second by
        # (speed - other speed) k x w; along the line of action it goes as the base circle does.
        (first, _, turn), (second, *_) = ends
        leads = 1 if way * turn * self.speed[first] > 0 else -1
        slides = leads * (1 if self.speed[first] > self.speed[second] else -1)
        g, runs = number(derived["phases"][mesh["name"]]), []
        for name, sign, turn in ends:
            body = bodies[name]
            psi = number(body["angle"]) if body["carrier"] else mpf(0)
            # Of a planet: along and across its own radius.
            parts = (
                line[0] * cos(psi) + line[1] * sin(psi),
                line[1] * cos(psi) - line[0] * sin(psi),
            )
            for axis, value, other in (("x", parts[0], -parts[1]), ("y", parts[1], parts[0])):
                i = self.at.get(f"{name} {axis}")
                if i is not None:
                    row[i] += sign * value
                    give[i] -= sign * value
                    across[i] += slides * sign * other
            if body["carrier"]:
                # The way of its pin: radial x_c cos + y_c sin, tangential -x_c sin + y_c cos + u_c.
                c, s = cos(psi), sin(psi)
                pin = {"x": (c, -s), "y": (s, c), "u": (mpf(0), mpf(1))}
                for axis, (radial, tangential) in pin.items():
                    i = self.at.get(f"{body['carrier']} {axis}")
                    if i is not None:
                        give[i] += sign * (parts[0] * radial + parts[1] * tangential)
            if f"{name} u" in self.at:
                row[self.at[f"{name} u"]] += way * turn
            constant += sign * sum(
                p * number(o) for p, o in zip(parts, body["offset"], strict=True)
            )
            size, phase = number(body["eccentricity"]), number(body["eccentricity_phase"])
            if size:
                # e . (cos, sin)(theta + phase), theta = speed tau
                speed = self.speed[name]
                x, y = size * cos(phase + psi), size * sin(phase + psi)
                cosine, sine = line[0] * x + line[1] * y, line[1] * x - line[0] * y
                runs.append((abs(speed), sign * cosine, sign * sine * (1 if speed > 0 else -1)))
        coast = number(derived["inverse_phases"][mesh["name"]])
        rate = abs(self.speed[mesh["pinion"]]) * bodies[mesh["pinion"]]["teeth"]
        pitch = mpf(float(number(mesh["pitch_phase"])) / (2.0 * float(pi)))
        pitch = pitch if self._pinion_drives(mesh) else -pitch
        # The other flank of a leading tooth follows by its thickness, or the space of the other.
        thick = [number(value) for value in mesh["tooth_thickness"] or ("0x1p-1",) * 2][
            :: -1 if mesh["internal"] else 1
        ]
        pitches = g + pitch + leads * (thick[0] + 1 - thick[1]) / 2, g + pitch
        # A coast side that moves with the axes, Eq. (4), meets nothing of what only they do.
        moving = mesh.get("moving_backlash", False)
        other = [a + b for a, b in zip(row, give, strict=True)] if moving else row
        found = self._append(mesh, row, other, across, Fraction(rate), (coast, g), pitches)
        found.constant = [(own if moving else constant) + found.backlash, constant]
        for frequency, cosine, sine in runs:
            found.add(frequency, (1,) if moving else (0, 1), cosine, sine)
        for side, name in ((0, "inverse_deviation"), (1, "deviation")):
            for values, shift in (("cosines", 0), ("sines", 1)):
                for i, value in enumerate(mesh[name][values], start=1):
                    lag = 2 * pi * i * g
                    # cos(x - lag), or sin(x - lag) = cos(x - lag - pi / 2)
                    lag += shift * pi / 2
                    size = number(value)
                    found.add(i * rate, (side,), size * cos(lag), size * sin(lag))

    def _append(self, mesh, drive, coast, across, rate, phases, pitches):
        names = ("max_stiffness", "stiffness_ratio", "contact_ratio", "backlash")
        values = {name: number(mesh[name]) for name in (*names, "material_damping")}
        self.meshes.append(
            Mesh(
                drive,
                coast,
                across,
                film=number(mesh["backlash_damping"]),
                friction=[number(value) for value in mesh["friction"]],
                rate=mpf(rate.numerator) / rate.denominator,
                phases=phases,
                pitches=pitches,
                **values,
            )
        )
        return self.meshes[-1]

    # The pair of six degrees, Eq. (3) and (4).

    def _pair(self, model):
        pair = model["pair"]
        radii = [number(r) for r in model["base_radii"]]
        for name, j, r, torque in zip(
            ("u3", "u2"), model["inertias"], radii, model["torques"], strict=True
        ):
            self.mass[self.at[name]] = number(j) / r**2
            self.load[self.at[name]] = number(torque) / r
        for i, name in enumerate(("y3", "z3", "y2", "z2")):
            if name in self.at:
                self.mass[self.at[name]] = number(model["masses"][i // 2])
                k, d = number(model["bearing_stiffness"][i]), number(model["bearing_damping"][i])
                self.springs.append((k, d, self._unit(name)))
        drive = [a + b for a, b in zip(self._unit("u3"), self._unit("u2"), strict=True)]
        coast = list(drive)
        for row in [drive] if model["moving_backlash"] else [drive, coast]:
            for name, sign in (("y3", 1), ("y2", -1)):
                if name in self.at:
                    row[self.at[name]] += sign
        across = [a - b for a, b in zip(self._unit("z3"), self._unit("z2"), strict=True)]
        pitch = mpf(float(number(model["pitch_phase"])) / (2.0 * float(pi)))
        mesh = self._append(
            pair | {"friction": model["friction"]},
            drive,
            coast,
            across,
            Fraction(1),
            (mpf(0), mpf(0)),
            # Nominal teeth are half a pitch thick.
            (pitch + mpf(1) / 2, pitch),
        )
        mesh.constant = [mesh.backlash, mpf(0)]
        sides = (1,) if model["moving_backlash"] else (0, 1)
        (e3, e2), delta = map(number, model["eccentricities"]), number(model["run_out_phase"])
        if e3:
            mesh.add(Fraction(1, model["teeth"][0]), sides, mpf(0), e3)
        if e2:
            # -e2 sin(Delta - phi)
            mesh.add(Fraction(1, model["teeth"][1]), sides, -e2 * sin(delta), e2 * cos(delta))
        for side, name in ((0, "inverse_deviation"), (1, "deviation")):
            for i, value in enumerate(model[name]["cosines"], start=1):
                mesh.add(i, (side,), number(value), mpf(0))
            for i, value in enumerate(model[name]["sines"], start=1):
                mesh.add(i, (side,), mpf(0), number(value))
        kappa, half = mesh.stiffness_ratio, mesh.contact_ratio - 1
        mean = mesh.max_stiffness * (kappa * (1 - half) + half)
        self.length = number(pair["load"]) / mean
        self.omega = sqrt(mean / number(pair["reduced_mass"]))

    # One degree of freedom: the numbers of an equation, without dimensions.

    def _one_degree(self, equation):
        values = {name: mpf(value) for name, value in equation["numbers"].items()}
        self.mass, self.load, self.length, self.omega = [mpf(1)], [values["load"]], mpf(1), mpf(1)
        self.springs = [(values["ground"], mpf(0), [mpf(1)])]
        self.meshes = [Levels(equation, values)]
        tuning = number(self.claim["tuning"])
        for order, a, b in equation["force"]:
            self.forcing.append((Fraction(order), mpf(a), mpf(b)))
        for order, a, b in equation["deviation"]:
            # The inertia of its second derivative.
            size = -((order * tuning) ** 2)
            self.forcing.append((Fraction(order), size * mpf(a), size * mpf(b)))

    # All of it.

    def _free(self):
        """Return the motions that no stiffness resists: of the kept coordinates, by the fixed."""
        fixed = [i for i in range(self.n) if i not in self.kept]
        if not fixed:
            return fixed, None
        total = matrix(self.n, self.n)
        rows = [(k, row) for k, _, row in self.springs]
        for k, row in rows + [(mesh.max_stiffness, mesh.drive) for mesh in self.meshes]:
            for i, a in enumerate(row):
                for j, b in enumerate(row):
                    total[i, j] += k * a * b
        inner = matrix([[total[i, j] for j in self.kept] for i in self.kept])
        columns = [lu_solve(inner, matrix([-total[i, j] for i in self.kept])) for j in fixed]
        return fixed, columns

    def reduced(self, q):
        """Return the coordinates, or rates, without the free motions."""
        fixed, columns = self.turning
        found = [q[i] for i in self.kept]
        for j, column in zip(fixed, columns or [], strict=True):
            found = [value - c * q[j] for value, c in zip(found, column, strict=True)]
        return found

    def functional(self, mesh, side):
        """Return the distance over a flank, and its rate, as rows over z."""
        n, row = self.n, list(mesh.drive if side else mesh.coast)
        waves = [mesh.waves.get(f, [[mpf(0)] * 2] * 2)[side] for f in self.frequencies]
        distance = row + [mpf(0)] * n + [mesh.constant[side]]
        rate = [mpf(0)] * n + row + [mpf(0)]
        for frequency, (c, s) in zip(self.frequencies, waves, strict=True):
            f = mpf(frequency.numerator) / frequency.denominator
            distance += [c, s]
            # (c cos + s sin)' = f (s cos - c sin)
            rate += [f * s, -f * c]
        return distance, rate

    def law(self, tau, codes):
        """Return A of dz/dtau = A z, z = (q, dq/dtau, 1, cos, sin, ...), as rows of its entries."""
        n, w = self.n, self.omega
        size = 2 * n + 1 + 2 * len(self.frequencies)
        a = [[mpf(0)] * size for _ in range(size)]
        force = [[mpf(0)] * size for _ in range(n)]
        for i in range(n):
            a[i][n + i] = mpf(1)
            force[i][2 * n] += self.load[i]
        for k, d, row in self.springs:
            for i, left in enumerate(row):
                for j, right in enumerate(row):
                    if left and right:
                        force[i][j] -= left * k * right
                        force[i][n + j] -= left * d * w * right

        def push(rows, functional, factor):
            for i, left in enumerate(rows):
                if left:
                    for j, value in enumerate(functional):
                        force[i][j] -= left * factor * value

        for mesh, code in zip(self.meshes, codes, strict=True):
            push(mesh.drive, self.functional(mesh, 1)[1], mesh.film * w)
            if code:
                side = 1 if code == 1 else 0
                distance, rate = self.functional(mesh, side)
                stiffness, sense = mesh.stiffness(side, tau)
                rows = mesh.drive if side else mesh.coast
                push(rows, distance, stiffness)
                push(rows, rate, (mesh.in_contact(side) - mesh.film) * w)
                push(mesh.across, distance, stiffness * sense * mesh.friction[1 - side])
        for frequency, c, s in self.forcing:
            column = 2 * n + 1 + 2 * self.frequencies.index(frequency)
            force[0][column] += c
            force[0][column + 1] += s
        for i in range(n):
            a[n + i] = [value / (self.mass[i] * w**2) for value in force[i]]
        for j, frequency in enumerate(self.frequencies):
            f, c = mpf(frequency.numerator) / frequency.denominator, 2 * n + 1 + 2 * j
            a[c][c + 1], a[c + 1][c] = -f, f
        return [[(j, value) for j, value in enumerate(row) if value] for row in a]
