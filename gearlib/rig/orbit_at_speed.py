"""An orbit at a speed in SI units: what is measured of it, with exact derivatives at this speed."""

import math

import numpy as np

from gearlib.analysis.orbits.shooting import NoOrbit, periodic_orbit
from gearlib.data import summary
from gearlib.data.status import OK
from gearlib.kernels import orbit as columns
from gearlib.models.derivatives import STEP
from gearlib.models.trains.statics import branches
from gearlib.runs import sensitivities
from gearlib.runs.run_arguments import MAX_EVENTS
from gearlib.runs.simulation import run

#: name -> what it is measured in: static deflections, loads, shares of time
STATISTICS = {
    "displacement_max": "length",
    "displacement_min": "length",
    "dynamic_force_max": "force",
    "dynamic_force_min": "force",
    "fraction_normal": "share",
    "fraction_backlash": "share",
    "fraction_inverse": "share",
}
#: As the columns of derivatives have them, four of extrema and then of times.
_ORDERED = tuple(STATISTICS)
#: What these are in SI units.
_SCALES = {
    "length": lambda model: model.static_deflection,
    "force": lambda model: model.load,
    "share": lambda model: 1.0,
}
#: Mean force of a mesh over that of all meshes of its central gear; mesh orders of displacements.
SHARING, ORDER = "load_sharing", "order_amplitude"
#: Samples in a mesh period, of which mesh orders are sums.
SAMPLES = 64


class OrbitAtSpeed:
    """The orbit of a model near a guess at a speed in rpm; k parameters are named."""

    def __init__(self, model, speed, guess, names, samples=1):
        rate = float(model.speed(1.0))
        self.model, self.names, self.rate = model, names, rate
        self.orbit = periodic_orbit(model, speed / rate, guess=guess)
        tuning, n = self.orbit.tuning, self.orbit.period
        asked = {"periods": n, "record_periods": n, "initial_state": tuple(self.orbit.state)}
        done = run(model, tuning, samples, **asked)
        if done.status:
            raise NoOrbit(f"the motion at {speed:g} rpm could not go on")
        self._meshes = max(len(model.mesh_names), 1)
        codes = np.array([n, OK])
        table = summary.variables(model, (), done.table, done.end, codes, n)
        self._values = {name: np.atleast_1d(values) for name, (_, values) in table.items()}
        self._samples = self._of_meshes(done.samples, columns.SAMPLE_COLUMNS)
        twins = [model.complex_step(model.direction(name)) for name in names]

        def slopes(of):
            return np.array([(of(twin) + 0j).imag / STEP for twin in twins])

        by_rate = slopes(lambda one: one.speed(1.0))
        #: What the tuning at this speed changes by with parameters, and with the speed.
        self._moved = np.append(-speed / rate**2 * by_rate, 1.0 / rate)
        self._scales = {
            kind: (of(model), np.append(slopes(of), 0.0)) for kind, of in _SCALES.items()
        }
        self._differentiate(samples, len(done.events))

    def _of_meshes(self, samples, count):
        """Return the displacements of samples, shape (rows, m, ...)."""
        shape = len(samples), -1, *samples.shape[2:]
        own = samples[:, : self._meshes * count].reshape(shape)
        if count == columns.SAMPLE_COLUMNS:
            return own[:, columns.SAMPLE_X :: columns.SAMPLE_COLUMNS]
        # Of derivatives quantities come one after the other, each of all meshes.
        return own[:, : self._meshes]

    def _differentiate(self, samples, events):
        """Find what state, samples, extrema and times change by, the speed after the names."""
        model, n, names = self.model, self.orbit.period, (*self.names, "tuning")
        propagator, z = model.propagator(self.orbit.tuning), self.orbit.state
        along = sensitivities.directions(model, names)
        matrix, ahead, code = propagator.map_slopes(z, along, n, MAX_EVENTS)
        reduce, lift = model.reduction()
        maps = np.eye(len(reduce)) - reduce @ matrix @ lift
        tangents, m, k = lift @ np.linalg.solve(maps, reduce @ ahead), self._meshes, len(names)
        width = model.empty_record()[0].shape[1] - 2 * m
        rows, events = np.empty((n * samples, width, k)), np.empty((events, 2, k))
        extrema, times = np.empty((2, 4 * m, k))
        tables = rows, events, extrema, times
        _, code, *_ = propagator.differentiate(
            z, along, tangents.copy(), (n, n, MAX_EVENTS), tables
        )
        if code != OK:
            raise NoOrbit("the motion could not go on")
        self._state = self._at_speed(tangents)
        self._sample_slopes = self._at_speed(self._of_meshes(rows, 4))
        table = np.concatenate([extrema, times / (math.tau * n)]).reshape(8, m, k)
        self._slopes = dict(zip(_ORDERED, self._at_speed(table), strict=False))

    def _at_speed(self, slopes):
        """Return derivatives by names at this speed, and by the speed, from those at a tuning."""
        by_tuning = slopes[..., -1:] * self._moved
        by_tuning[..., :-1] += slopes[..., :-1]
        return by_tuning

    def of(self, name, mesh=0):
        """Return (value, its derivatives by parameters, by the speed) in SI units.

        `name` is one of `STATISTICS`, `SHARING`, or `ORDER` with the number of the mesh order.
        """
        if name == SHARING:
            value, slopes = self._sharing(mesh)
        elif name in STATISTICS:
            value, slopes = self._values[name][mesh], self._slopes[name][mesh]
        else:
            value, slopes = self._order(int(name.removeprefix(f"{ORDER}_")), mesh)
        scale, grown = self._scales[STATISTICS.get(name, "share" if name == SHARING else "length")]
        slopes = slopes * scale + value * grown
        return float(value * scale), slopes[:-1], slopes[-1]

    @property
    def least(self):
        """What `of` returns of the least displacement of all meshes."""
        every = (self.of("displacement_min", mesh) for mesh in range(self._meshes))
        return min(every, key=lambda one: one[0])

    def _wave(self, number, mesh):
        """Return (complex amplitude of a mesh order of the displacement, its derivatives)."""
        x, moved = self._samples[:, mesh], self._sample_slopes[:, mesh]
        phase = math.tau * np.arange(len(x)) * self.orbit.period / len(x)
        wave = np.exp(-1j * number * phase) / len(x)
        return wave @ x, wave @ moved

    def waves(self, count, mesh=0):
        """Return the complex amplitudes of the first mesh orders, m, and their derivatives.

        Shapes (count,) and (count, k). The displacement is twice the real part of their sum.
        """
        rows = [self._wave(number, mesh) for number in range(1, count + 1)]
        found, moved = np.array([one for one, _ in rows]), np.array([one for _, one in rows])
        scale, grown = self._scales["length"]
        return found * scale, (moved * scale + found[:, None] * grown)[:, :-1]

    def _order(self, number, mesh):
        """Return (amplitude of a mesh order of the displacement, its derivatives)."""
        found, moved = self._wave(number, mesh)
        size = abs(found)
        return 2.0 * size, 2.0 * (found.conjugate() * moved).real / size

    def _sharing(self, mesh):
        """Return (load sharing, its derivatives; that by the speed is not known)."""
        groups, values = branches(self.model), self._values[SHARING]
        if not self.names:
            return values[mesh], np.zeros(1)
        own = [j for j, other in enumerate(groups) if other == groups[mesh]]
        if not hasattr(self, "_forces"):
            from gearlib.analysis.orbits.mean_forces import mean_forces

            self._forces = mean_forces(self.orbit, self.names, self._state[:, :-1])
        forces, slopes = self._forces
        mean, moved = forces[own].mean(), slopes[own].mean(axis=0)
        found = (slopes[mesh] - forces[mesh] / mean * moved) / mean
        return values[mesh], np.append(found, math.nan)
