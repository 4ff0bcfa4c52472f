"""Energy of trains: what the load and the switches of stiffness put in, damping takes out.

From the state at the start of the last period, and the events that `simulate` gives, the motion is
known between them by exponentials; energies and powers follow from the parameters of `Body`,
`Shaft` and `Mesh`, body by body. An event at a wrong instant, or a lost one, leaves a jump.
"""

import math

import numpy as np
import pytest
from scipy.linalg import expm

from gearlib import planetary, simulate, split_power_reducer
from gearlib.analysis.tongues import undamped
from gearlib.models.one_mesh_system import matrix
from tests.paper import PAPER

NODES, WEIGHTS = np.polynomial.legendre.leggauss(12)


class Balance:
    """Energies and powers of a train, SI, from its states at one tuning."""

    def __init__(self, train, tuning):
        self.train, self.system = train, train.system(tuning)
        self.omega = train.reference_angular_frequency
        frame = float(train.speeds[train.reference_mesh.pinion]) * train.carrier_ratio
        self.frame = frame * tuning * self.omega if train.gyroscopic else 0.0

    def motions(self, z):
        """Return (motions of the bodies, rates, distances, rates), m and m/s."""
        n, length = self.train.size // 2, self.train.static_deflection
        bodies = self.train.structure.motions * length
        near = self.system.near * length
        rates = near[:, :n] @ z[n : 2 * n] * self.omega
        return bodies @ z[:n], bodies @ z[n : 2 * n] * self.omega, near @ z, rates

    def supports(self, bodies):
        """Return the motions that supports see, a row each: along x, y, and the rotation."""
        rows = []
        for name, (x, y, u) in zip(self.train.body_names, bodies, strict=True):
            body = self.train.by_name[name]
            if body.carrier:
                i = self.train.body_names.index(body.carrier)
                xc, yc, uc = bodies[i]
                c, s = math.cos(body.angle), math.sin(body.angle)
                x, y = x - xc, y - yc
                x, y = c * x + s * y, c * y - s * x - uc
            rows.append((x, y, u))
        return rows

    def energy(self, z, codes, levels):
        """Return what is stored, J."""
        moved, rates_of, distances, _ = self.motions(z)
        total = 0.0
        for body, rates, seen in zip(
            self.train.bodies, rates_of, self.supports(moved), strict=True
        ):
            stiff = [k if math.isfinite(k) else 0.0 for k in body.support_stiffness]
            total += 0.5 * (body.mass or 0.0) * (rates[0] ** 2 + rates[1] ** 2)
            total += 0.5 * body.inertia / body.base_radius**2 * rates[2] ** 2
            total += 0.5 * (stiff[0] * seen[0] ** 2 + stiff[1] * seen[1] ** 2)
            total += 0.5 * body.torsional_stiffness * (seen[2] / body.base_radius) ** 2
            total -= self.centrifugal(body, moved)
        for shaft in self.train.shafts:
            total += 0.5 * shaft.stiffness * self.twist(shaft, moved) ** 2
        for mesh, d, code, k in zip(self.train.meshes, distances, codes, levels, strict=True):
            total += 0.5 * k * {1: d, 0: 0.0, -1: d + mesh.backlash}[int(code)] ** 2
        return total

    def centrifugal(self, body, bodies):
        """Return the work of the centrifugal force on the way out of the turned place."""
        x, y, _ = bodies[self.train.body_names.index(body.name)]
        out = 0.0
        if body.carrier:
            c, s = math.cos(body.angle), math.sin(body.angle)
            turn = bodies[self.train.body_names.index(body.carrier)][2]
            x, y, out = c * x + s * y, c * y - s * x - turn, self.train.by_name[body.carrier]
            out = out.base_radius * x
        return (body.mass or 0.0) * self.frame**2 * (0.5 * (x**2 + y**2) + out)

    def twist(self, shaft, bodies):
        one, other = (
            bodies[self.train.body_names.index(name)][2] / self.train.by_name[name].base_radius
            for name in shaft.bodies
        )
        return one - other

    def powers(self, z, codes):
        """Return (power of the torques, dissipation), W."""
        moved, rates, _, closing = self.motions(z)
        load, lost = 0.0, 0.0
        for body, (x, y, _), (vx, vy, u), seen in zip(
            self.train.bodies, moved, rates, self.supports(rates), strict=True
        ):
            load += body.torque / body.base_radius * u
            lost += body.support_damping[0] * seen[0] ** 2 + body.support_damping[1] * seen[1] ** 2
            lost += body.torsional_damping * (seen[2] / body.base_radius) ** 2
            if not body.carrier:
                # A support that stands still sees the turning of what is off the axis.
                lost += body.support_damping[0] * self.frame * (vy * x - vx * y)
        for shaft in self.train.shafts:
            lost += shaft.damping * self.twist(shaft, rates) ** 2
        for mesh, rate, code in zip(self.train.meshes, closing, codes, strict=True):
            lost += (mesh.material_damping if code else mesh.backlash_damping) * rate**2
        return load, lost

    def levels(self, tau):
        """Return the stiffness of every mesh at a phase inside a piece, N/m."""
        values = []
        for mesh in self.train.meshes:
            rate = float(self.train.rates[self.train.mesh_names.index(mesh.name)])
            turns = rate * tau / (2.0 * math.pi) - self.train.phases[mesh.name]
            away = abs((turns + 0.5) % 1.0 - 0.5)
            high = away <= (mesh.contact_ratio - 1.0) / 2.0
            values.append(mesh.max_stiffness * (1.0 if high else mesh.stiffness_ratio))
        return values


def balance(train, tuning, periods):
    """Return what the last common period of a run has of energies, and how it ends.

    Returns
    -------
    tuple
        (work of the load, of switches of the stiffness, dissipation, gain) in J; the largest jump
        of the energy at an event; the codes met; the difference of the last state from that of
        `simulate`.
    """
    whole = train.repeats
    start = {"initial_state": "static"}
    run = simulate(train, tuning, periods=periods, record_periods=whole, **start)
    begin = simulate(train, tuning, periods=periods - whole, **start).final_state.values
    book, system, n = Balance(train, tuning), train.system(tuning), train.size // 2
    assert system.harmonics.size == 0
    scale = np.repeat([1.0, tuning], n)
    z = np.append(begin * scale, 1.0)
    near, far = system.near @ z, system.far @ z
    codes = np.where(near >= 0.0, 1, np.where(far <= 0.0, -1, 0))
    met = set(codes)
    phases = run.event_phase.values - 2.0 * math.pi * (periods - whole)
    stops = [(tau, None) for tau in system.starts[1:]]
    stops += list(zip(phases, range(phases.size), strict=True))
    load = switched = lost = jump = 0.0
    tau, levels = 0.0, book.levels(1e-9)
    first = before = book.energy(z, codes, levels)
    for stop, event in sorted(stops, key=lambda one: one[0]):
        segment = np.searchsorted(system.starts, 0.5 * (tau + stop)) - 1
        span = (stop - tau) / tuning
        steps = max(1, math.ceil(span / system.longest))
        if span > 1e-13:
            now = book.levels(0.5 * (tau + stop))
            after = book.energy(z, codes, now)
            switched, levels = switched + after - before, now
            effects = [system.effect[code + 1, segment, j] for j, code in enumerate(codes)]
            a, h = matrix(system, effects), span / steps
            inside = [expm(a * (0.5 * h * (node + 1.0))) for node in NODES]
            step = expm(a * h)
            for _ in range(steps):
                for part, weight in zip(inside, WEIGHTS, strict=True):
                    power, dissipated = book.powers(part @ z, codes)
                    share = 0.5 * h * weight / book.omega
                    load, lost = load + share * power, lost + share * dissipated
                z = step @ z
        before = book.energy(z, codes, levels)
        if event is not None:
            codes[run.event_mesh.values[event]] = run.event_to.values[event]
            after = book.energy(z, codes, levels)
            jump, before = max(jump, abs(after - before)), after
            met |= set(codes)
        tau = stop
    miss = np.abs(z[: 2 * n] / scale - run.final_state.values).max()
    return load, switched, lost, before - first, jump, met, miss


def jumping(jump, **options):
    ratios = [undamped.stiffness_ratio(jump, epsilon) for epsilon in (1.4, 1.6)]
    return planetary(stiffness_ratio=ratios, reference_frequency=1000.0, **options)


@pytest.mark.parametrize(
    ("train", "tuning", "periods", "codes"),
    [
        # Suns that bounce all at once; planets that bounce one after the other, and on far flanks.
        (jumping(0.6), 11.0, 40, {1, 0}),
        (jumping(0.6, pin_errors=[(0.0, 1e-6), (0.0, 0.0), (0.0, 0.0)]), 13.5, 60, {1, 0}),
        (jumping(0.6, backlash=1e-7), 8.0, 60, {1, 0, -1}),
        (jumping(0.3), 1.475, 2, {1}),
        # In the frame of the carrier, at 4200 rpm.
        (jumping(0.6, turning=True, gyroscopic=True, backlash=1e-7), 7.0, 40, {1, 0, -1}),
        (split_power_reducer(PAPER), 0.95, 9, {1, 0, -1}),
    ],
)
def test_energy_balance_closes_between_all_events(train, tuning, periods, codes):
    load, switched, lost, gain, jump, met, miss = balance(train, tuning, periods)
    scale = max(abs(load), abs(switched), lost)
    assert met == codes
    assert miss < 1e-10
    # In contact the energy of a mesh is 0 on its flank line.
    assert jump < 1e-14 * scale
    assert abs(load + switched - lost - gain) < 1e-10 * scale


def test_in_a_period_of_an_orbit_damping_takes_out_what_is_put_in():
    """Switches of the stiffness put it in; the load works on the free rotation alone."""
    load, switched, lost, gain, *_ = balance(jumping(0.6), 11.0, 12_000)
    assert abs(switched / lost - 1.0) < 1e-10
    assert abs(load - gain) < 1e-10 * lost
