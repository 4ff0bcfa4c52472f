"""An orbit at a speed in SI units: what is measured of it."""

import math

import numpy as np

from gearlib.analysis.orbits.shooting import NoOrbit, periodic_orbit
from gearlib.data import summary
from gearlib.data.status import OK
from gearlib.kernels import orbit as columns
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
#: Mean force of a mesh over that of all meshes of its central gear; mesh orders of displacements.
SHARING, ORDER = "load_sharing", "order_amplitude"
#: Samples in a mesh period, of which mesh orders are sums.
SAMPLES = 64


class OrbitAtSpeed:
    """The orbit of a model near a guess at a speed in rpm."""

    def __init__(self, model, speed, guess, samples=1):
        tuning = speed / float(model.speed(1.0))
        self.orbit = periodic_orbit(model, tuning, guess=guess)
        n = self.orbit.period
        settings = {"periods": n, "record_periods": n, "initial_state": tuple(self.orbit.state)}
        done = run(model, self.orbit.tuning, samples, **settings)
        if done.status:
            raise NoOrbit(f"the motion at {speed:g} rpm could not go on")
        self._meshes = max(len(model.mesh_names), 1)
        codes = np.array([n, OK])
        table = summary.variables(model, (), done.table, done.end, codes, n)
        self._values = {name: np.atleast_1d(values) for name, (_, values) in table.items()}
        sample_columns = done.samples[:, : self._meshes * columns.SAMPLE_COLUMNS]
        #: Displacements of the samples, shape (rows, meshes).
        self._samples = sample_columns[:, columns.SAMPLE_X :: columns.SAMPLE_COLUMNS]
        self._scales = {"length": model.static_deflection, "force": model.load, "share": 1.0}

    def of(self, name, mesh=0):
        """Return a value in SI units.

        `name` is one of `STATISTICS`, `SHARING`, or `ORDER` with the number of the mesh order.
        """
        if name.startswith(ORDER):
            number = int(name.removeprefix(f"{ORDER}_"))
            return 2.0 * abs(self._wave(number, mesh)) * self._scales["length"]
        return float(self._values[name][mesh] * self._scales[STATISTICS.get(name, "share")])

    @property
    def least(self):
        """Least displacement of all meshes, m."""
        return min(self.of("displacement_min", mesh) for mesh in range(self._meshes))

    def waves(self, count, mesh=0):
        """Return the complex amplitudes of the first mesh orders, m, shape (count,).

        The displacement is twice the real part of their sum.
        """
        waves = [self._wave(number, mesh) for number in range(1, count + 1)]
        return np.array(waves) * self._scales["length"]

    def _wave(self, number, mesh):
        """Return the complex amplitude of a mesh order of the displacement, dimensionless."""
        x = self._samples[:, mesh]
        phase = math.tau * np.arange(len(x)) * self.orbit.period / len(x)
        return np.exp(-1j * number * phase) @ x / len(x)
