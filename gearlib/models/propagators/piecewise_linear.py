"""Matrix exponentials between events: piecewise-linear models with any number of coordinates."""

import math

import numpy as np

from gearlib.kernels import orbit
from gearlib.kernels.codes import OK
from gearlib.kernels.piecewise_linear.run import run_linear
from gearlib.kernels.piecewise_linear.system import ORDER
from gearlib.kernels.piecewise_linear.variation import vary_linear
from gearlib.kernels.polynomial import bernstein_matrix
from gearlib.kernels.slopes.itinerary import Places
from gearlib.models.derivatives import START, STEP
from gearlib.models.propagators.matrices import Matrices
from gearlib.models.propagators.tangents import Motion
from gearlib.models.propagators.varied import Varied

_TO_BERNSTEIN = bernstein_matrix(ORDER)


class VariedSystem(Varied):
    """A model with one mesh."""

    def __init__(self, model, propagator, along):
        super().__init__()
        system = propagator.system
        self.twins = [_twin(model, system.tuning, slopes) for slopes in along]
        pairs = [(system, propagator.outputs), *(twin[1:] for twin in self.twins)]
        self._a, self._stiffness = (
            np.array([getattr(one, name) for one, _ in pairs]) + 0j for name in ("a", "stiffness")
        )
        self._outputs = np.array([outputs for _, outputs in pairs]) + 0j
        # An infinite backlash stays infinite.
        self._outputs[~np.isfinite(self._outputs).all(axis=-1)] = 0.0
        self.near, self.far, self.position = (
            np.array([[getattr(one, name)] for one, _ in pairs]) + 0j
            for name in ("near", "far", "position")
        )
        self.size, self.tuning, self.repeats = model.size, system.tuning, system.repeats
        self._low, self._starts = system.low, system.starts
        self.switches = math.pi * np.array([[slopes.get("contact_ratio", 0.0) for slopes in along]])
        self._longest = np.diff(system.starts) / system.substeps
        p = system.low.size
        low = np.tile(system.low.astype(bool)[None, :, None], (3, 1, 1))
        effect = np.arange(3 * p).reshape(3, p, 1)
        self.places = Places(effect, low, system.starts, np.array([0, p]))

    def stack(self, effects):
        """As of `Varied`."""
        return self._a[:, effects[0] + 1, effects[1]]

    def effects(self, codes, segments):
        """As of `Varied`."""
        return codes[0], segments[0]

    def stiffness(self, codes, segments):
        """As of `Varied`."""
        return self._stiffness[:, codes[0] + 1, segments[0]][:, None]

    def low(self, code, segment, mesh):
        """As of `Varied`."""
        return self._low[segment]

    def longest(self, segments):
        """As of `Varied`."""
        return self._longest[segments[0]]

    def cuts(self, number):
        """As of `Varied`."""
        return [(start, p) for p, start in enumerate(self._starts[:-1])]

    def outputs(self, codes, segments):
        """As of `Varied`."""
        return self._outputs[:, :, codes[0] + 1, segments[0]]


def _twin(model, tuning, slopes):
    """Return a model off the real axis, with its system and outputs."""
    fields = {name: slope for name, slope in slopes.items() if name not in ("tuning", *START)}
    twin = model.off_axis(fields)
    return twin, *twin.system(tuning + 1j * STEP * slopes.get("tuning", 0.0))


class Propagator(Matrices):
    """A piecewise-linear model at one tuning."""

    def __init__(self, model, tuning):
        super().__init__(model, tuning)
        self.system, self.outputs = model.system(tuning)
        self.part = model.part(self.system)
        self.components, self.pieces = self.system.near.size, int(self.system.substeps.sum())

    def start(self, state):
        """Return the state z; see `Base.start`."""
        if len(state) == self.model.size > 2:
            return np.array(state, float)
        return self.model.initial(self.system, state)[: self.model.size]

    def _full(self, z):
        """Return z with room for the constant and the harmonics, which the kernels fill in."""
        full = np.zeros(self.components)
        full[: z.size] = z
        return full

    def run(self, z, *arguments, first=0):
        """Run from z; see `Base.run`."""
        full, system = self._full(z), self.system._replace(first=first)
        done = run_linear(system, self.part, self.outputs, _TO_BERNSTEIN, full, *arguments)
        z[:] = full[: z.size]
        # Matrix exponentials evaluate no right-hand side: 0.
        return *done, 0

    def vary(self, z, periods, limit, maps, first):
        """Fill the maps; see `Base.vary`."""
        full, system = self._full(z), self.system._replace(first=first)
        code = vary_linear(system, _TO_BERNSTEIN, full, z.size, periods, limit, maps)
        z[:] = full[: z.size]
        return code

    def vary_along(self, along):
        """Return what the system changes by; see `Matrices`."""
        return VariedSystem(self.model, self, along)

    def motion(self, z, periods, limit):
        """Return the motion with all of its events; see `Matrices.motion`."""
        full, n = self._full(z), self.components
        # The whole state is put out at the start of every period.
        outputs = np.zeros((n, 3, self.outputs.shape[2], n))
        outputs[:] = np.eye(n)[:, None, None]
        samples = np.empty((periods, orbit.SAMPLE_COLUMNS + n))
        _, events, summary = self.model.room()
        rest = periods, periods, samples, events, limit, summary
        done = run_linear(self.system, self.part, outputs, _TO_BERNSTEIN, full, *rest)
        events, found, code = done[3:6]
        events = np.column_stack([events[:found], np.zeros(found)])
        first = events[0, orbit.EVENT_FROM] if found else samples[0, orbit.SAMPLE_CONTACT]
        states = samples[:, orbit.SAMPLE_COLUMNS :]
        return Motion(states, (int(first),), events) if code == OK else None, code

    def start_tangents(self, state, along):
        """Return what the start changes by, shape (size, k); see `Matrices.start_tangents`."""
        if len(state) > 2:
            if any(name in slopes for slopes in along for name in START):
                raise ValueError(
                    f"sensitivities = {' and '.join(map(repr, START))} is not allowed with all "
                    f"{len(state)} components of initial_state: it must have two"
                )
            return np.zeros((len(state), len(along)))
        columns = []
        for twin, system, _ in self.varied(along).twins:
            slopes = along[len(columns)]
            moved = [
                x + 1j * STEP * slopes.get(name, 0.0) for x, name in zip(state, START, strict=True)
            ]
            columns.append(twin.initial(system, moved)[: self.model.size].imag / STEP)
        return np.array(columns).T

    def final(self, walk):
        """Return the derivatives of displacement and velocity; see `Matrices.final`."""
        rows, slopes = walk.varied.rows(walk.codes, walk.segments)
        return rows[:2] @ walk.block[walk.q :].T + (slopes[:, :2] @ walk.block[0]).T

    def switches(self, mesh):
        """Return the phases of switches, rising, 2 pi the last; see `Base.differentiate`."""
        return self.system.starts
