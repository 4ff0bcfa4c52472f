"""A run-up of one gear pair by Taylor series of many digits, for differences: a second code.

It knows the order of events only, and shares nothing with the library: SI units throughout,
``m y'' + k y' + C (y - line) = force``, contact left and met at zeros of y and y + backlash.
"""

import mpmath as mp
import numpy as np

_TERMS = 36
#: Longest piece of a series, in 1 / Omega_s; steps of Newton's method.
_REACH, _NEWTON = 0.8, 5


def _course(rows, t):
    """Return (value, slope) of a piecewise linear course just after t."""
    rows = [(mp.mpf(a), mp.mpf(b)) for a, b in rows]
    i = max([i for i, row in enumerate(rows) if row[0] <= t], default=-1)
    if i < 0 or i == len(rows) - 1:
        return rows[max(i, 0)][1], mp.mpf(0)
    (a, b), (c, d) = rows[i : i + 2]
    return b + (d - b) / (c - a) * (t - a), (d - b) / (c - a)


def _cuts(p, speed, load):
    """Return rows (time, phase there, acceleration behind, whether a revolution begins)."""
    end = mp.mpf(speed[-1][0])
    marks = sorted({mp.mpf(t) for t, _ in [*speed, *load] if mp.mpf(t) < end} | {end})
    turn, phase, cuts = p["speed"] * p["teeth"] * 2 * mp.pi / 60, mp.mpf(0), []
    for begin, stop in zip(marks[:-1], marks[1:], strict=True):
        rpm, slope = _course(speed, begin)
        a, b, length = rpm * turn, slope * turn, stop - begin
        last = phase + a * length + b * length**2 / 2
        cuts.append((begin, phase, b, False))
        for k in range(int(min(phase, last) / (2 * mp.pi)) - 1, int(last / (2 * mp.pi)) + 2):
            half = mp.pi * (p["contact_ratio"] - 1)
            levels = [2 * mp.pi * k - half, 2 * mp.pi * k + half]
            whole = [2 * mp.pi * k] if k > 0 and k % p["teeth"] == 0 else []
            for level in levels + whole:
                if phase < level < last:
                    t = 2 * (level - phase) / (a + mp.sqrt(a**2 + 2 * b * (level - phase)))
                    cuts.append((begin + t, level, b, level in whole))
        phase = last
    return [*sorted(cuts), (end, phase, mp.mpf(0), False)]


def _series(x, v, loss, stiff, force, ramp):
    c = [x, v]
    for n in range(_TERMS):
        own = force if n == 0 else ramp if n == 1 else 0
        c.append((own - loss * (n + 1) * c[n + 1] - stiff * c[n]) / ((n + 1) * (n + 2)))
    return c


def _value(c, t):
    """Return a series at t."""
    total = mp.mpf(0)
    for one in reversed(c):
        total = total * t + one
    return total


def _rate(c):
    return [n * one for n, one in enumerate(c)][1:]


def _highest(series, sign):
    """Return the largest of sign x on series of some lengths: where a grid has it, refined."""
    found = []
    for c, length in series:
        grid = np.linspace(0.0, float(length), 17)
        values = sign * np.polynomial.polynomial.polyval(grid, [float(one) for one in c])
        i = int(np.argmax(values))
        found.append((values[i], c, length, mp.mpf(grid[i])))
    best, refined = max(one[0] for one in found), []
    for value, c, length, t in found:
        # A turning point next to the end of a series is found from both sides.
        if value < best - 1e-2 * abs(best):
            continue
        rate = _rate(c)
        bend = _rate(rate)
        for _ in range(_NEWTON + 3):
            t -= _value(rate, t) / _value(bend, t)
            if not 0 < t < length:
                break
        inside = [t] if 0 < t < length else []
        refined += [sign * _value(c, one) for one in (mp.mpf(0), length, *inside)]
    return max(refined)


def run_up(p, speed, load, events, times, orders=()):
    """Return name -> values of a run-up, the names of `gearlib.run_up`.

    `p` has the fields of a `GearPair`, driven_mass, base_radius, initial_displacement,
    initial_velocity and speed, a factor of all speeds; `events` are rows (time, from, to) in order,
    the time roughly; samples are at `times`. ``order_displacement`` and so on have the root mean
    squares of `orders` above 0, of one whole revolution after the other.
    """
    p = {name: value if name == "teeth" else mp.mpf(value) for name, value in p.items()}
    high, m = p["max_stiffness"], p["reduced_mass"]
    mean = high * (p["stiffness_ratio"] * (2 - p["contact_ratio"]) + p["contact_ratio"] - 1)
    natural, unit = mp.sqrt(mean / m), p["load"] / mean
    cuts = _cuts(p, speed, load)
    x = p["initial_displacement"] * unit
    v = p["initial_velocity"] * unit * _course(speed, 0)[0] * p["speed"] * p["teeth"] * mp.pi / 30
    code, waiting, arcs, met = events[0][1], list(events), [], []
    for (t, before, rate, new), (end, behind, _, _) in zip(cuts[:-1], cuts[1:], strict=True):
        middle = (before + behind) / 2 / (2 * mp.pi)
        begin, fast = t, _course(speed, t)[0] * p["speed"] * p["teeth"] * mp.pi / 30
        near = abs(middle - mp.nint(middle)) * 2 < p["contact_ratio"] - 1
        while t < end:
            share, ramp = _course(load, t)
            line = {1: 0, 0: 0, -1: -p["backlash"]}[code]
            stiff = (high if near else high * p["stiffness_ratio"]) if code else mp.mpf(0)
            force = p["load"] * share + p["driven_mass"] * p["base_radius"] * rate / p["teeth"]
            loss = p["material_damping"] if code else p["backlash_damping"]
            args = loss / m, stiff / m, force / m + stiff / m * line, p["load"] * ramp / m
            c, length, after = _series(x, v, *args), min(end - t, _REACH / natural), code
            if waiting and waiting[0][0] <= t + length * (1 + mp.mpf("1e-9")):
                _, code, after = waiting.pop(0)
                place = 0 if 1 in (code, after) else -p["backlash"]
                length = _waited(c, mp.mpf(events[len(met)][0]) - t, place)
            gone = t - begin
            turn = before + fast * gone + rate * gone**2 / 2, fast + rate * gone, rate
            arcs.append((t, length, c, code, stiff, line, turn, new))
            x, v = _value(c, length), _value(_rate(c), length)
            t, new = t + length, False
            if after != code:
                met.append((t, v))
                x, code = place, after
    return _recorded(arcs, met, times) | _waves(arcs, orders, p["teeth"])


def _waited(c, t, place):
    """Return how long a series takes to a place, by Newton's method from t."""
    rate = _rate(c)
    for _ in range(_NEWTON):
        t -= (_value(c, t) - place) / _value(rate, t)
    return t


def _recorded(arcs, met, times):
    found = {"event_time": [t for t, _ in met], "event_velocity": [v for _, v in met]}
    names = "displacement", "velocity", "acceleration", "dynamic_force"
    found |= {name: [] for name in names}
    for begin, length, c, _, stiff, line, _, _ in arcs:
        rate = _rate(c)
        for t in times:
            if begin <= t < begin + length:
                x, v, a = (_value(one, mp.mpf(t) - begin) for one in (c, rate, _rate(rate)))
                for name, value in zip(names, (x, v, a, stiff * (x - line)), strict=True):
                    found[name].append(value)
    bounds = [0, *(i for i, arc in enumerate(arcs) if arc[-1]), len(arcs)]
    own = {}
    for first, stop in zip(bounds[:-1], bounds[1:], strict=True):
        part = arcs[first:stop]
        whole = sum(arc[1] for arc in part)
        area, forces = mp.mpf(0), []
        for _, length, c, code, stiff, line, _, _ in part:
            if code:
                pull = [stiff * (one - (line if n == 0 else 0)) for n, one in enumerate(c)]
                forces.append((pull, length))
                area += sum(one * length ** (n + 1) / (n + 1) for n, one in enumerate(pull))
            else:
                forces.append(([mp.mpf(0), mp.mpf(0), mp.mpf(1)], mp.mpf(0)))
        row = {"mean_force": area / whole}
        for name, sign in (("max", 1), ("min", -1)):
            row[f"displacement_{name}"] = sign * _highest([(a[2], a[1]) for a in part], sign)
            row[f"dynamic_force_{name}"] = sign * _highest(forces, sign)
        for name, code in (("normal", 1), ("backlash", 0), ("inverse", -1)):
            row[f"fraction_{name}"] = sum(arc[1] for arc in part if arc[3] == code) / whole
        for name, value in row.items():
            own.setdefault(name, []).append(value)
    return found | own


def _waves(arcs, orders, teeth):
    """Return the amplitudes of orders, by Gauss's rule with more nodes than any arc asks for."""
    span, names = 2 * mp.pi * teeth, ("displacement", "velocity", "acceleration", "dynamic_force")
    count = int((arcs[-1][6][0] + arcs[-1][6][1] * arcs[-1][1]) / span) if orders else 0
    sums = {(name, i, n): mp.mpc(0) for name in names for i in range(count) for n in orders}
    nodes = [(mp.mpf(a), mp.mpf(b)) for a, b in np.transpose(np.polynomial.legendre.leggauss(24))]
    for _, length, c, _, stiff, line, (phase, fast, rate), _ in arcs:
        i = int((phase + fast * length / 2) / span)
        series = c, _rate(c), _rate(_rate(c))
        for node, weight in nodes if i < count else ():
            t = length * (1 + node) / 2
            x, v, a = (_value(one, t) for one in series)
            share = weight / 2 * length * (fast + rate * t) / span
            angle = (phase + fast * t + rate * t**2 / 2) / teeth
            for n in orders:
                wave = share * mp.expj(-n * angle)
                for name, value in zip(names, (x, v, a, stiff * (x - line)), strict=True):
                    sums[name, i, n] += value * wave
    found = {f"order_{name}": [] for name in names} if orders else {}
    for (name, _, _), value in sums.items():
        found[f"order_{name}"].append(mp.sqrt(2) * abs(value))
    return found
