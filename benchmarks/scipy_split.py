"""The models written once more, for scipy: SI units and time, DOP853, split at events.

What a careful user of scipy would write: the run is cut at every stiffness switch, and contact
events are terminal events of `solve_ivp`. It shares nothing with the library but the parameters;
benchmarks time it, tests compare with it.
"""

import math

import numpy as np
from scipy.integrate import solve_ivp

from gearlib import Fourier, OneDegreePair, Rectangular, SixDegreePair


def _wave(table, phase, derivative=0):
    """Return a sum of harmonics, or its second derivative to the phase."""
    total = 0.0
    for n, a, b in table:
        value = a * math.cos(n * phase) + b * math.sin(n * phase)
        total += value if derivative == 0 else -n * n * value
    return total


def _stiffness(model):
    """Return (C(phase, middle of the segment), phases of the kinks in one period)."""
    pair = model.pair
    half = math.pi * (pair.contact_ratio - 1.0)
    profile = model.profile or Rectangular()
    if isinstance(profile, Rectangular):
        # Decided by the middle of the segment: its ends belong to both sides.
        def stiffness(_phase, middle):
            high = middle % (2 * math.pi) < half or middle % (2 * math.pi) > 2 * math.pi - half
            return pair.max_stiffness if high else pair.min_stiffness

        return stiffness, [half, 2 * math.pi - half]
    if isinstance(profile, Fourier):
        swing = pair.max_stiffness * (1.0 - pair.stiffness_ratio) / 2.0
        terms = [
            swing * 4 / (math.pi * n) * (-1) ** n * math.sin(n * math.pi * (pair.contact_ratio - 2))
            for n in range(1, profile.harmonics + 1)
        ]

        def stiffness(phase, _middle):
            waves = sum(a * math.cos((n + 1) * phase) for n, a in enumerate(terms))
            return pair.mean_stiffness + waves

        return stiffness, []
    scale = pair.mean_stiffness / profile.mean()

    def stiffness(phase, _middle):
        at = np.interp(phase, profile.phase, profile.stiffness, period=2 * math.pi)
        return scale * float(at)

    return stiffness, list(profile.phase)


class _One:
    """Right-hand side and flank lines of one degree of freedom, SI."""

    def __init__(self, model, tuning):
        self.model = model if isinstance(model, OneDegreePair) else OneDegreePair(pair=model)
        self.pair = self.model.pair
        self.speed = self.pair.mesh_frequency(tuning)
        self.stiffness, self.kinks = _stiffness(self.model)
        self.force = self.model.excitation.table()
        self.deviation = self.model.deviation.table()

    def start(self, state):
        unit = self.pair.static_deflection
        return np.array([state[0] * unit, state[1] * unit * self.speed])

    def lines(self, t, z):
        return z[0], z[0] + self.pair.backlash

    def derivative(self, t, z, contact, middle):
        m, phase = self.model, self.speed * t
        y, v = z
        if contact:
            k, d2, d3 = self.pair.material_damping, m.quadratic_damping, m.cubic_damping
        else:
            k = self.pair.backlash_damping
            d2, d3 = m.backlash_quadratic_damping, m.backlash_cubic_damping
        g = y if contact == 1 else (y + self.pair.backlash if contact == -1 else 0.0)
        spring = g + m.quadratic_stiffness * abs(g) * g + m.cubic_stiffness * g**3
        mass = self.pair.reduced_mass
        total = self.pair.load + _wave(self.force, phase)
        total += mass * self.speed**2 * _wave(self.deviation, phase, 2)
        total -= k * v + d2 * abs(v) * v + d3 * v**3
        if contact:
            total -= self.stiffness(phase, middle) * spring
        return np.array([v, total / mass])


class _Six:
    """Right-hand side and flank lines of six degrees of freedom, SI: u3 u2 y3 z3 y2 z2."""

    def __init__(self, model, tuning):
        self.model, self.pair = model, model.pair
        self.speed = self.pair.mesh_frequency(tuning)
        self.stiffness, self.kinks = _stiffness(model)
        if any(model.friction):
            self.kinks = [*self.kinks, model.pitch_phase, model.pitch_phase + math.pi]
        self.deviation = model.deviation.table()
        self.coast_deviation = model.coast_deviation.table()
        j, r = np.array(model.inertias), np.array(model.base_radii)
        self.mass = np.array([*(j / r**2), *np.repeat(model.masses, 2)])

    def _run_out(self, phase):
        m = self.model
        e3, e2 = m.eccentricities
        angles = phase / m.teeth[0], m.run_out_phase - phase / m.teeth[1]
        value = e3 * math.sin(angles[0]) - e2 * math.sin(angles[1])
        slope = e3 * math.cos(angles[0]) / m.teeth[0] + e2 * math.cos(angles[1]) / m.teeth[1]
        return value, slope

    def excited_rates(self, phase):
        """Return what run-out and deviations add to the rates of `lines`, m/s."""
        near, far = (
            sum(n * (b * math.cos(n * phase) - a * math.sin(n * phase)) for n, a, b in f)
            for f in (self.deviation, self.coast_deviation)
        )
        run_out = self._run_out(phase)[1]
        far += 0.0 if self.model.moving_backlash else run_out
        return self.speed * (near + run_out), self.speed * far

    def start(self, state):
        unit = self.pair.static_deflection
        shares = 1.0 / self.mass[:2] / (1.0 / self.mass[:2]).sum()
        z = np.zeros(12)
        if self.model.preload:
            z[2] = -self.pair.load / self.model.bearing_stiffness[0]
            z[4] = self.pair.load / self.model.bearing_stiffness[2]
        z[:2] = shares * (state[0] * unit - self.lines(0.0, z)[0])
        z[6:8] = shares * (state[1] * unit * self.speed - self.excited_rates(0.0)[0])
        return z

    def lines(self, t, z):
        phase = self.speed * t
        turn = z[0] + z[1]
        near = turn + z[2] - z[4] + self._run_out(phase)[0] + _wave(self.deviation, phase)
        far = turn + _wave(self.coast_deviation, phase) + self.pair.backlash
        if not self.model.moving_backlash:
            far += z[2] - z[4] + self._run_out(phase)[0]
        return near, far

    def derivative(self, t, z, contact, middle):
        m, phase = self.model, self.speed * t
        y, w = self.lines(t, z)
        excited, far_excited = self.excited_rates(phase)
        turn, bearings = z[6] + z[7], z[8] - z[10]
        rests = 0.0 if m.moving_backlash else 1.0
        speed = turn + bearings + excited
        c = self.stiffness(phase, middle)
        elastic = c * y if contact == 1 else (c * w if contact == -1 else 0.0)
        more = self.pair.material_damping - self.pair.backlash_damping
        p, q = self.pair.backlash_damping * speed, 0.0
        if contact == 1:
            p += elastic + more * speed
        elif contact == -1:
            q = elastic + more * (turn + rests * bearings + far_excited)
        sense = 1.0 if (middle - m.pitch_phase) % (2 * math.pi) < math.pi else -1.0
        mu = m.friction[0] if contact == 1 else m.friction[1]
        friction = mu * sense * elastic
        along = p + rests * q
        force = np.array([-p - q, -p - q, -along, -friction, along, friction])
        force[0] += m.torques[0] / m.base_radii[0]
        force[1] += m.torques[1] / m.base_radii[1]
        force[2:] -= np.array(m.bearing_stiffness) * z[2:6] + np.array(m.bearing_damping) * z[8:12]
        return np.concatenate([z[6:], force / self.mass])


def run(model, tuning, periods, state=(0.0, 0.0), rtol=1e-10):
    """Return (displacement, dx/dtau, events, evaluations) after `periods` mesh periods.

    Dimensionless as the library's; events as (phase, contact before, contact after).
    """
    problem = (_Six if isinstance(model, SixDegreePair) else _One)(model, tuning)
    speed, unit = problem.speed, problem.pair.static_deflection
    z = problem.start(state)
    y, w = problem.lines(0.0, z)
    contact = 1 if y >= -1e-18 and state[1] >= 0 or y > 1e-18 else (-1 if w < 0 else 0)
    events, evaluations = [], 0
    cuts = sorted({c % (2 * math.pi) for c in problem.kinks} | {0.0}) + [2 * math.pi]

    def crossing(line, direction):
        def function(t, z, *_):
            return problem.lines(t, z)[line] / unit

        function.terminal, function.direction = True, direction
        return function

    choices = {
        1: [(crossing(0, -1), 0, 0)],
        0: [(crossing(0, 1), 0, 1), (crossing(1, -1), 1, -1)],
        -1: [(crossing(1, 1), 1, 0)],
    }
    for n in range(periods):
        for a, b in zip(cuts, cuts[1:], strict=False):
            t, end = (2 * math.pi * n + a) / speed, (2 * math.pi * n + b) / speed
            middle = (a + b) / 2
            while t < end:
                options = choices[contact]
                done = solve_ivp(
                    problem.derivative,
                    (t, end),
                    z,
                    method="DOP853",
                    rtol=rtol,
                    atol=rtol * unit,
                    events=[option[0] for option in options],
                    args=(contact, middle),
                )
                evaluations += done.nfev
                z, t = done.y[:, -1].copy(), done.t[-1]
                if done.status == 1:
                    hit = next(i for i, times in enumerate(done.t_events) if times.size)
                    _, line, target = options[hit]
                    # Exactly on the line solve_ivp would find, or miss, the same event again.
                    side = -1.0 if (contact, target) in ((1, 0), (0, -1)) else 1.0
                    z[0] += side * 1e-14 * unit - problem.lines(t, z)[line]
                    events.append((t * speed, contact, target))
                    contact = target
    if isinstance(problem, _One):
        return z[0] / unit, z[1] / unit / speed, events, evaluations
    t = 2 * math.pi * periods / speed
    rate = z[6] + z[7] + z[8] - z[10] + problem.excited_rates(2 * math.pi * periods)[0]
    return problem.lines(t, z)[0] / unit, rate / unit / speed, events, evaluations
