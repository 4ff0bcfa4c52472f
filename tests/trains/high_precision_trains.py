"""A train in 50 digits, and what it changes by: differences, no code shared with the library.

A motor turns a pinion through a shaft, the pinion an idler on an elastic bearing, the idler a
wheel: six coordinates, two meshes. In SI units, the Taylor series of q'' = A q + ... step by step;
distances are looked at where steps end, and their zeros solved for.
"""

import mpmath
from mpmath import mpf

mpmath.mp.dps = 50

_STEP = mpf(10) ** -22
#: Of mixed differences, by start and parameter.
_MIXED = mpf(10) ** -13
_TERMS, _STEPS = 36, 24
_TURN = 2 * mpmath.pi
#: Base radii of motor, pinion, idler and wheel, m; teeth 24, 36, 48.
RADII = ("0.05", "0.045", "0.0675", "0.09")
#: By how much of a period the second mesh comes after the first, and the line of action's angle.
LAG, PRESSURE = "0.3", "0.34906585039886591538"
#: Which mode, in rising order, is the reference.
MODE = 5

#: name -> its place among the values of a case.
NAMES = (
    "inertia of body motor",
    "inertia of body pinion",
    "inertia of body idler",
    "inertia of body wheel",
    "mass of body idler",
    "support_stiffness of body idler, x",
    "support_stiffness of body idler, y",
    "support_damping of body idler, x",
    "support_damping of body idler, y",
    "stiffness of shaft motor-pinion",
    "damping of shaft motor-pinion",
    *(
        f"{name} of mesh {mesh}"
        for mesh in ("pinion-idler", "idler-wheel")
        for name in (
            "max_stiffness",
            "stiffness_ratio",
            "contact_ratio",
            "backlash",
            "material_damping",
            "backlash_damping",
            "error",
        )
    ),
    "load",
    "tuning",
)
TUNING = len(NAMES) - 1


class _Train:
    def __init__(self, values):
        v = [mpf(x) for x in values]
        rm, rp, ri, rw = map(mpf, RADII)
        (motor, pinion, idler, wheel, mass, kx, ky, cx, cy, shaft, rub), rest = v[:11], v[11:]
        self.meshes, force, tuning = (rest[:7], rest[7:14]), rest[14], rest[15]
        # u of motor, pinion; x, y, u of idler; u of wheel.
        self.mass = [motor / rm**2, pinion / rp**2, mass, mass, idler / ri**2, wheel / rw**2]
        twist = mpmath.matrix([[1 / rm, -1 / rp, 0, 0, 0, 0]])
        own = mpmath.diag([0, 0, kx, ky, 0, 0]) + shaft * twist.T * twist
        self.damping = mpmath.diag([0, 0, cx, cy, 0, 0]) + rub * twist.T * twist
        angle = mpf(PRESSURE)
        s, c = mpmath.sin(angle), mpmath.cos(angle)
        # The first line of action points at 90 - 20 degrees, the second at 20 - 90.
        self.lines = mpmath.matrix([[0, 1, -s, -c, 1, 0], [0, 0, s, -c, -1, -1]])
        self.stiffness = own
        means = [m[0] * (m[1] + (1 - m[1]) * (m[2] - 1)) for m in self.meshes]
        whole = own.copy()
        for j, mean in enumerate(means):
            whole += mean * self.lines[j, :].T * self.lines[j, :]
        # The load is that of the meshes.
        self.load = mpmath.matrix([force * rp / rm, 0, 0, 0, 0, -force])
        root = [1 / mpmath.sqrt(m) for m in self.mass]
        scaled = mpmath.matrix(6, 6)
        for a in range(6):
            for b in range(6):
                scaled[a, b] = whole[a, b] * root[a] * root[b]
        squares = sorted(mpmath.eigsy(scaled, eigvals_only=True))
        self.speed = tuning * mpmath.sqrt(squares[MODE])
        # The linear train: without part in the free rotation, all u by their radii.
        self.free = mpmath.matrix([rm / rp, 1, 0, 0, -1, 1])
        self.unit = self.rest(whole, self.load)
        self.length = abs((self.lines[0, :] * self.unit)[0])

    def rest(self, stiffness, force):
        """Return where the train rests."""
        size = max(abs(x) for x in stiffness)
        weighed = mpmath.matrix([m * f for m, f in zip(self.mass, self.free, strict=True)])
        return mpmath.lu_solve(stiffness + size * weighed * weighed.T, force)

    def start(self, state):
        """Return (q, q') for a state in static deflections and phase, or at rest."""
        if state != "static":
            v = [self.length * mpf(x) for x in state]
            return v[:6], [self.speed * x for x in v[6:]]
        stiffness, force = self.stiffness.copy(), self.load.copy()
        for j, mesh in enumerate(self.meshes):
            level, row = self.level(j, mpf(0)), self.lines[j, :]
            stiffness += level * row.T * row
            force -= level * mesh[6] * row.T
        return list(self.rest(stiffness, force)), [mpf(0)] * 6

    def switches(self):
        """Return (phase, mesh, whether to the higher level) within a period, rising."""
        found = []
        for j, mesh in enumerate(self.meshes):
            for sign in (1, -1):
                phase = _TURN * (j * mpf(LAG)) + sign * mpmath.pi * (mesh[2] - 1)
                found.append((phase % _TURN, j, sign < 0))
        return sorted(found)

    def level(self, j, phase):
        """Return the stiffness of a mesh at a phase."""
        mesh = self.meshes[j]
        away = (phase - _TURN * j * mpf(LAG) + mpmath.pi) % _TURN - mpmath.pi
        return mesh[0] * (1 if abs(away) <= mpmath.pi * (mesh[2] - 1) else mesh[1])

    def series(self, q, v, levels, codes):
        """Return the coefficients of q over time, lists of six."""
        k, d, f = self.stiffness.copy(), self.damping.copy(), self.load.copy()
        for j, (mesh, code) in enumerate(zip(self.meshes, codes, strict=True)):
            row = self.lines[j, :]
            d += (mesh[4] if code else mesh[5]) * row.T * row
            if code:
                k += levels[j] * row.T * row
                f -= levels[j] * (mesh[6] + (mesh[3] if code < 0 else 0)) * row.T
        k, d, f = k.tolist(), d.tolist(), list(f)
        coefficients = [list(q), list(v)]
        for n in range(_TERMS):
            a, b = coefficients[n], coefficients[n + 1]
            new = []
            for i in range(6):
                total = sum(-k[i][c] * a[c] - d[i][c] * (n + 1) * b[c] for c in range(6))
                total += f[i] if n == 0 else 0
                new.append(total / self.mass[i] / ((n + 1) * (n + 2)))
            coefficients.append(new)
        return coefficients

    def distances(self, coefficients):
        """Return the distance polynomials of both meshes from their drive sides."""
        rows = self.lines.tolist()
        found = []
        for row, mesh in zip(rows, self.meshes, strict=True):
            curve = [sum(a * b for a, b in zip(row, one, strict=True)) for one in coefficients]
            curve[0] += mesh[6]
            found.append(curve)
        return found


def _at(curve, t):
    value = mpf(0)
    for coefficient in reversed(curve):
        value = value * t + coefficient
    return value


def _rate(curve):
    return [n * c for n, c in enumerate(curve)][1:]


def _root(curve, low, high):
    """Return the zero of a polynomial between two places of unlike signs."""
    slope, t = _rate(curve), (low + high) / 2
    for _ in range(80):
        value = _at(curve, t)
        if (value > 0) == (_at(curve, high) > 0):
            high = t
        else:
            low = t
        t, last = t - value / _at(slope, t), t
        if not low <= t <= high:
            t = (low + high) / 2
        if abs(t - last) < mpf(10) ** -47 * high:
            break
    return t


def record(values, periods, state):
    """Return [final state, extrema and times of both meshes, events], those of the last period."""
    train = _Train(values)
    q, v = train.start(state)
    speed, length = train.speed, train.length
    gaps = [mesh[3] for mesh in train.meshes]

    def code_of(d, gap):
        return 1 if d > 0 else (-1 if d + gap < 0 else 0)

    first = train.distances([q, v])
    codes = [code_of(d[0], gap) for d, gap in zip(first, gaps, strict=True)]
    seen = [{"x": [], "f": [], "t": [mpf(0)] * 4} for _ in range(2)]
    events = []
    for period in range(periods):
        cuts = [(_TURN * n / _STEPS, None, None) for n in range(1, _STEPS + 1)]
        stops, at = sorted(cuts + train.switches(), key=lambda cut: cut[0]), mpf(0)
        levels = [train.level(j, mpf(10) ** -30) for j in range(2)]
        for stop, switched, _ in stops:
            while at < stop:
                span = (stop - at) / speed
                terms = train.series(q, v, levels, codes)
                curves, hit, crossed = train.distances(terms), span, None
                for j in range(2):
                    for line in (0, gaps[j]):
                        curve = [curves[j][0] + line, *curves[j][1:]]
                        if events and events[-1][3:] == (j, line) and at == events[-1][0]:
                            # From the line on: the zero at the start is divided out.
                            curve = curve[1:]
                        if (_at(curve, mpf(0)) > 0) != (_at(curve, hit) > 0):
                            hit, crossed = _root(curve, mpf(0), hit), (j, line)
                _note(train, seen, terms, curves, hit, codes, levels, period == periods - 1)
                q, v = (
                    [_at([one[i] for one in part], hit) for i in range(6)]
                    for part in (terms, [[n * x for x in c] for n, c in enumerate(terms)][1:])
                )
                at = stop if crossed is None else at + hit * speed
                if crossed:
                    j, line = crossed
                    rate = sum(a * b for a, b in zip(train.lines[j, :], v, strict=True))
                    codes[j] = (1 if line == 0 else 0) if rate > 0 else (0 if line == 0 else -1)
                    row = (at, period, rate / (length * speed), j, line)
                    events.append(row)
            if switched is not None:
                low = [m[0] * m[1] for m in train.meshes]
                j = switched
                levels[j] = low[j] if levels[j] != low[j] else train.meshes[j][0]
    found = [x / length for x in q] + [x / (length * speed) for x in v]
    for one in seen:
        found += [max(one["x"]) / length, min(one["x"]) / length]
        force = length * train.meshes[0][0] * _over(train.meshes[0])
        found += [max(one["f"]) / force, min(one["f"]) / force]
        found += one["t"]
    for at, period, rate, *_ in events:
        if period == periods - 1:
            found += [at + _TURN * period, rate]
    return found


def _over(mesh):
    return mesh[1] + (1 - mesh[1]) * (mesh[2] - 1)


def _note(train, seen, terms, curves, hit, codes, levels, recorded):
    """Take extrema and times of a step."""
    if not recorded:
        return
    for j, (code, one) in enumerate(zip(codes, seen, strict=True)):
        slope, places = _rate(curves[j]), [mpf(0), hit]
        if (_at(slope, mpf(0)) > 0) != (_at(slope, hit) > 0):
            places.append(_root(slope, mpf(0), hit))
        values = [_at(curves[j], place) for place in places]
        shift = train.meshes[j][3] if code < 0 else 0
        one["x"] += values
        one["f"] += [levels[j] * (value + shift) if code else mpf(0) for value in values]
        one["t"][1 - code] += hit * train.speed
        if code and levels[j] != train.meshes[j][0]:
            one["t"][3] += hit * train.speed


def of_run(values, periods, state):
    """Return the derivatives of `record` by all parameters of `NAMES`, a row each."""
    base = record(values, periods, state)
    return [_row(base, values, periods, state, j) for j in range(len(NAMES))]


def _row(base, values, periods, state, j):
    moved = list(map(mpf, values))
    step = _STEP * moved[j]
    moved[j] += step
    pairs = zip(base, record(moved, periods, state), strict=True)
    return [(b - a) / step for a, b in pairs]


def of_one(values, periods, state, name):
    """Return one row of `of_run`."""
    return _row(record(values, periods, state), values, periods, state, NAMES.index(name))


def of_start(values, periods, state):
    """Return the derivatives of `record` by all components of the start, a row each."""
    base, rows = record(values, periods, state), []
    for j in range(12):
        moved = list(map(mpf, state))
        moved[j] += _STEP
        pairs = zip(base, record(values, periods, moved), strict=True)
        rows.append([(b - a) / _STEP for a, b in pairs])
    return rows


def of_map(values, periods, state, components, parameters):
    """Return by what columns of the map from start to end change with parameters, a row each."""
    rows = []
    for component in components:
        for parameter in parameters:
            ends = []
            for one, other in ((0, 0), (0, 1), (1, 0), (1, 1)):
                start, moved = list(map(mpf, state)), list(map(mpf, values))
                start[component] += one * _MIXED
                step = _MIXED * moved[parameter]
                moved[parameter] += other * step
                ends.append(record(moved, periods, start)[:12])
            zero, b, a, both = ends
            quotients = zip(zero, b, a, both, strict=True)
            rows.append([(w - x - y + z) / (_MIXED * step) for z, x, y, w in quotients])
    return rows
