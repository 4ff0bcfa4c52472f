"""Equations of motion of every model, assembled from its description; nothing of gearlib.

    w^2 M q'' + w D q' + K q + sum_j forces of contact j = F + waves,        ' = d/dtau,

in SI units, tau the phase of the mesh, or of the forcing, that gives the period. A contact j has a
drive side, which touches where its distance d = b . q + e(tau) is positive, and a coast side, which
touches where its own, the backlash added, is negative. The numbers are those of a context of
mpmath: `mpmath.fp`, floats, or `mpmath.mp`.
"""

import mpmath
import numpy as np

from tests.references.described_models import mean_stiffness


class Course:
    """A stiffness over its phase: straight lines between breaks, and harmonics."""

    def __init__(self, breaks, lines, harmonics=(), whole=None, high=None):
        #: phases in [0, 2 pi), rising; (value, slope) from each on; (order, cosine, sine).
        self.breaks, self.lines, self.harmonics = breaks, lines, list(harmonics)
        #: below this, the mean where nothing else is said, it counts as low; 2 pi.
        self.high = high
        if high is None:
            ends = [*breaks[1:], breaks[0] + whole]
            spans = [b - a for a, b in zip(breaks, ends, strict=True)]
            parts = [w * (c + k * w / 2) for w, (c, k) in zip(spans, lines, strict=True)]
            self.high = sum(parts) / whole

    def series(self, context, phase, middle, terms, rate, bend):
        """Return Taylor coefficients at a phase of the piece that holds another phase.

        The phase goes on by rate t + bend t^2.
        """
        whole = 2 * context.pi
        at = max((i for i, b in enumerate(self.breaks) if b <= middle % whole), default=-1)
        value, slope = self.lines[at]
        # Since the break: one behind the last one may have begun a period before.
        since = (middle - self.breaks[at]) % whole + (phase - middle)
        straight = [value + slope * since, slope * rate, slope * bend]
        found = [*straight, *[context.mpf(0)] * terms][:terms]
        for order, cosine, sine in self.harmonics:
            waves = wave(context, order * phase, terms, order * rate, order * bend)
            for k, term in enumerate(waves):
                found[k] += cosine * term[0] + sine * term[1]
        return found

    @property
    def constant(self):
        return not self.harmonics and not any(slope for _, slope in self.lines)


def wave(context, phase, terms, rate, bend):
    """Return Taylor coefficients of cos and sin of phase + rate t + bend t^2, a pair a power."""
    c, s = [context.cos(phase)], [context.sin(phase)]
    for k in range(terms - 1):
        down, up = rate * s[k], rate * c[k]
        if k and bend:
            down, up = down + 2 * bend * s[k - 1], up + 2 * bend * c[k - 1]
        c.append(-down / (k + 1))
        s.append(up / (k + 1))
    return list(zip(c, s, strict=True))


class Side:
    """One flank of a contact, or one edge."""

    def __init__(self, row, course, material, constant=0, shift=0):
        self.row, self.course, self.material, self.constant = row, course, material, constant
        #: by how many of its periods the course comes later; friction coefficient; rows
        #: (frequency, cosine, sine) of the distance; periods at which the sliding turns to 1.
        self.shift, self.friction, self.waves, self.turns = shift, 0, [], 0


class Contact:
    """Two sides, of which one or none touches."""

    def __init__(self, drive, coast, film, rate=1, powers=(0, 0), across=None):
        #: coast is None where there is no such side; film, as material, (d1, d2, d3)
        self.drive, self.coast, self.film, self.rate = drive, coast, film, rate
        self.powers, self.across = powers, across

    @property
    def sides(self):
        return [side for side in (self.drive, self.coast) if side]

    @property
    def linear(self):
        laws = [self.film[1:], *(side.material[1:] for side in self.sides), self.powers]
        return not any(map(any, laws)) and all(side.course.constant for side in self.sides)

    @property
    def closed(self):
        """Whether there is no way between the flanks."""
        one, other = self.drive, self.coast
        return bool(other) and (one.constant, one.waves) == (other.constant, other.waves)

    def level(self, context, side, tau, middle, terms=1, rate=1, bend=0):
        """Return Taylor coefficients of the stiffness of a side, of the piece about a phase."""
        at, middle = (self.rate * one - 2 * context.pi * side.shift for one in (tau, middle))
        return side.course.series(context, at, middle, terms, self.rate * rate, self.rate * bend)

    def sense(self, context, side, tau):
        """Return which way the flanks of a side slide at a phase, 1 or -1."""
        return 1 if (self.rate * tau / (2 * context.pi) - side.turns) % 1 < 0.5 else -1

    def cuts(self, context):
        """Return the phases of this mesh in periods, in which a stiffness or sliding changes."""
        found = []
        for side in self.sides:
            found += [b / (2 * context.pi) + side.shift for b in side.course.breaks if b]
            found += [side.shift] if 0 in side.course.breaks and len(side.course.breaks) > 1 else []
            found += [side.turns, side.turns + context.mpf(1) / 2] if side.friction else []
        return found


class Machine:
    """The assembled equations at one tuning."""

    def __init__(self, context, n):
        self.context, self.n = context, n
        kind = float if context is mpmath.fp else object
        self.mass, self.stiffness, self.damping = (self.zeros(n, n) for _ in range(3))
        self.load, self.kind = self.zeros(n), kind
        #: rows (frequency, coordinate, cosine, sine) of forces
        self.forcing, self.contacts = [], []
        #: of a run-up: what it is on, see `reference_run_up`; the variable is the time then
        self.piece = None
        #: unit of length, m; mesh speed, rad/s; unit of force over that of length, N/m
        self.length = self.speed = self.force_unit = None

    @property
    def tiny(self):
        """What is rounding beside 1."""
        return 1e-13 if self.kind is float else mpmath.mpf(10) ** (5 - mpmath.mp.dps)

    def about(self, tau):
        """Return (phase, its rate, half the rate of that) where the variable is tau."""
        return (tau, 1, 0) if self.piece is None else self.piece.about(tau)

    def wave(self, frequency, tau, terms):
        """Return Taylor coefficients of cos and sin of a frequency times the phase."""
        phase, rate, bend = (frequency * one for one in self.about(tau))
        return wave(self.context, phase, terms, rate, bend)

    def zeros(self, *shape):
        if self.context is mpmath.fp:
            return np.zeros(shape)
        found = np.empty(shape, object)
        found[...] = mpmath.mpf(0)
        return found

    def unit(self, i, value=1):
        row = self.zeros(self.n)
        row[i] += value
        return row

    def spring(self, row, stiffness, damping=0):
        """Add a spring and damper between what a row of coordinates tells."""
        square = np.outer(row, row)
        self.stiffness = self.stiffness + stiffness * square
        self.damping = self.damping + damping * square

    def inertia(self, row, mass):
        self.mass = self.mass + mass * np.outer(row, row)

    def inverse_mass(self):
        if not (self.mass - np.diag(np.diag(self.mass))).any():
            return np.diag(1 / np.diag(self.mass)) if self.n else self.mass
        if self.kind is float:
            return np.linalg.inv(self.mass)
        return np.array((mpmath.matrix(self.mass.tolist()) ** -1).tolist(), object)

    def distance(self, side, q, tau):
        """Return d of a side at coordinates and a phase."""
        value = side.row @ q + side.constant
        for frequency, cosine, sine in side.waves:
            angle = frequency * self.about(tau)[0]
            value += cosine * self.context.cos(angle) + sine * self.context.sin(angle)
        return value

    def distance_rate(self, side, v, tau):
        value = side.row @ v
        for frequency, cosine, sine in side.waves:
            phase, speed, _ = self.about(tau)
            angle = frequency * phase
            value += (
                speed
                * frequency
                * (sine * self.context.cos(angle) - cosine * self.context.sin(angle))
            )
        return value


def machine_of(model, tuning, context=mpmath.fp):
    """Return the `Machine` of a description at a tuning."""
    from tests.references.reference_trains import train

    make = {
        "GearPair": one_degree,
        "OneDegreePair": one_degree,
        "DeadZoneOscillator": oscillator,
        "SixDegreePair": six_degrees,
        "GearTrain": train,
    }[model["kind"]]
    return make(number(model, context), context.mpf(tuning), context)


def number(value, context):
    """Return a description with numbers of a context; integers and truths stay."""
    if isinstance(value, dict):
        return {key: number(one, context) for key, one in value.items()}
    if isinstance(value, list):
        return [number(one, context) for one in value]
    return context.mpf(value) if isinstance(value, (float, mpmath.mpf)) else value


def harmonics(wave):
    """Return rows (order, cosine, sine) of described harmonics."""
    cosines, sines = (list(wave[name]) for name in ("cosines", "sines"))
    count = max(len(cosines), len(sines))
    cosines, sines = (one + [0] * (count - len(one)) for one in (cosines, sines))
    return list(zip(range(1, count + 1), cosines, sines, strict=True))


def rectangle(mesh, context):
    """Return the stiffness of Eq. (1): C_max about phase 0."""
    half, high = context.pi * (mesh["contact_ratio"] - 1), mesh["max_stiffness"]
    low = high * mesh["stiffness_ratio"]
    if half == 0 or half == context.pi:
        return Course([context.mpf(0)], [(low if half == 0 else high, 0)], high=high)
    return Course([half, 2 * context.pi - half], [(low, 0), (high, 0)], high=high)


def profile(pair, given, context):
    """Return the course of the stiffness of a pair with a profile of Eq. (1), cut or tabulated."""
    kind = given["kind"]
    if kind == "Rectangular":
        return rectangle(pair, context)
    if kind == "Fourier":
        swing = pair["max_stiffness"] * (1 - pair["stiffness_ratio"]) / 2
        rows = []
        for n in range(1, given["harmonics"] + 1):
            sine = context.sin(n * context.pi * (pair["contact_ratio"] - 2))
            rows.append((n, swing * 4 / (context.pi * n) * (-1) ** n * sine, 0))
        return Course([context.mpf(0)], [(mean_stiffness(pair), 0)], rows, 2 * context.pi)
    phases, values = given["phase"], given["stiffness"]
    phases, values = [*phases, phases[0] + 2 * context.pi], [*values, values[0]]
    spans = [b - a for a, b in zip(phases, phases[1:], strict=False)]
    both = list(zip(values, values[1:], strict=False))
    mean = sum(w * (a + b) / 2 for w, (a, b) in zip(spans, both, strict=True)) / (2 * context.pi)
    scale = mean_stiffness(pair) / mean
    lines = [(a * scale, (b - a) / w * scale) for w, (a, b) in zip(spans, both, strict=True)]
    return Course(phases[:-1], lines, whole=2 * context.pi)


def one_degree(model, tuning, context):
    """Return m y'' + k(y) y' + D2 |y'| y' + D3 y'^3 + C(tau) g(y) = F(tau) + m f''."""
    pair = model.get("pair", model)
    found, own = Machine(context, 1), model if "pair" in model else {}
    mean, m = mean_stiffness(pair), pair["reduced_mass"]
    found.length, found.speed = pair["load"] / mean, tuning * context.sqrt(mean / m)
    found.force_unit = mean
    found.inertia(found.unit(0), m)
    found.load[0] = found.load[0] + pair["load"]
    for order, cosine, sine in harmonics(own["excitation"]) if own else ():
        found.forcing.append((order, 0, cosine, sine))
    for order, cosine, sine in harmonics(own["deviation"]) if own else ():
        inertia = -m * (order * found.speed) ** 2
        found.forcing.append((order, 0, inertia * cosine, inertia * sine))
    names = ("quadratic_damping", "cubic_damping")
    material = [pair["material_damping"], *(own.get(name, 0) for name in names)]
    film = [pair["backlash_damping"], *(own.get(f"backlash_{name}", 0) for name in names)]
    course = profile(pair, own.get("profile", {"kind": "Rectangular"}), context)
    drive, coast = (Side(found.unit(0), course, material) for _ in range(2))
    coast.constant = pair["backlash"]
    powers = own.get("quadratic_stiffness", 0), own.get("cubic_stiffness", 0)
    far = coast if context.isfinite(pair["backlash"]) else None
    found.contacts.append(Contact(drive, far, film, powers=powers))
    return found


def oscillator(model, tuning, context):
    """Return x'' + d x' + e x + P(x, t) = F + waves + f''; both edges have their own numbers."""
    found = Machine(context, 1)
    found.length, found.speed, found.force_unit = context.mpf(1), tuning, context.mpf(1)
    found.inertia(found.unit(0), context.mpf(1))
    found.spring(found.unit(0), model["ground_stiffness"])
    found.load[0] = found.load[0] + model["load"]
    found.forcing += [(n, 0, a, b) for n, a, b in harmonics(model["forcing"])]
    for n, a, b in harmonics(model["deviation"]):
        found.forcing.append((n, 0, -a * (n * tuning) ** 2, -b * (n * tuning) ** 2))

    def side(which):
        given, whole = model[f"{which}_stiffness"], 2 * context.pi
        if not isinstance(given, dict):
            course = Course([context.mpf(0)], [(given, 0)], whole=whole)
        elif given["kind"] == "Steps":
            values = [(value, 0) for value in given["stiffness"]]
            course = Course(given["phase"], values, whole=whole)
        else:
            rows = harmonics(given["harmonics"])
            course = Course([context.mpf(0)], [(given["mean"], 0)], rows, whole)
        material = [model[f"{which}_damping"], 0, 0]
        return Side(found.unit(0), course, material, constant=-model[f"{which}_edge"])

    lower = side("lower") if context.isfinite(model["lower_edge"]) else None
    found.contacts.append(Contact(side("upper"), lower, [model["damping"], 0, 0]))
    return found


def six_degrees(model, tuning, context):
    """Return Eq. (3) and (4): u3, u2 and the bearing motions y3, z3, y2, z2 that are free."""
    pair, bearings = model["pair"], model["bearing_stiffness"]
    free = [i for i in range(4) if context.isfinite(bearings[i])]
    found = Machine(context, 2 + len(free))
    mean = mean_stiffness(pair)
    found.length, found.force_unit = pair["load"] / mean, mean
    found.speed = tuning * context.sqrt(mean / pair["reduced_mass"])
    drive = found.unit(0) + found.unit(1)
    coast, across = drive, found.zeros(found.n)
    for j, (inertia, r) in enumerate(zip(model["inertias"], model["base_radii"], strict=True)):
        found.inertia(found.unit(j), inertia / r**2)
        found.load[j] = found.load[j] + model["torques"][j] / r
    for k, i in enumerate(free):
        row, gear = found.unit(2 + k), i // 2
        found.inertia(row, model["masses"][gear])
        found.spring(row, bearings[i], found.speed * 0 + model["bearing_damping"][i])
        if i % 2:
            across = across + (1 - 2 * gear) * row
        else:
            drive = drive + (1 - 2 * gear) * row
    if not model["moving_backlash"]:
        coast = drive
    course = rectangle(pair, context)
    sides = [Side(row, course, [pair["material_damping"], 0, 0]) for row in (drive, coast)]
    sides[1].constant = pair["backlash"]
    (e3, e2), delta = model["eccentricities"], model["run_out_phase"]
    for side in sides[:1] if model["moving_backlash"] else sides:
        for e, teeth, cosine, sine in (
            (e3, model["teeth"][0], 0, 1),
            # -e2 sin(Delta - phi2)
            (e2, model["teeth"][1], -context.sin(delta), context.cos(delta)),
        ):
            side.waves += [(context.mpf(1) / teeth, e * cosine, e * sine)] if e else []
    for side, name, mu in zip(
        sides, ("deviation", "inverse_deviation"), model["friction"], strict=True
    ):
        side.waves += harmonics(model[name])
        side.friction, side.turns = mu, model["pitch_phase"] / (2 * context.pi)
    far = sides[1] if context.isfinite(pair["backlash"]) else None
    contact = Contact(sides[0], far, [pair["backlash_damping"], 0, 0], across=across)
    found.contacts.append(contact)
    found.start = lambda state: _from_mesh(found, model, free, state)
    return found


def _from_mesh(machine, model, free, state):
    """Return (q, q') of six degrees for a displacement and velocity of the mesh, both by units."""
    q, v = machine.zeros(machine.n), machine.zeros(machine.n)
    if model["preload"]:
        for k, i in enumerate(free):
            if i % 2 == 0:
                sign = -1 if i == 0 else 1
                q[2 + k] = sign * model["pair"]["load"] / model["bearing_stiffness"][i]
    shares = [r**2 / j for r, j in zip(model["base_radii"], model["inertias"], strict=True)]
    side = machine.contacts[0].drive
    missing = state[0] * machine.length - machine.distance(side, q, 0)
    slow = state[1] * machine.length - machine.distance_rate(side, v, 0)
    for i in range(2):
        q[i] += shares[i] / sum(shares) * missing
        v[i] += shares[i] / sum(shares) * slow
    return q, v
