"""Mesh orders of a measured time course beside those of a model: what all such have in common.

Regressions turn samples into the complex amplitudes of the mesh orders of each revolution: offset
and eccentricity are other orders and do not enter. An unknown gain is eliminated. The course begins
at the mesh phase ``known.phase`` (rad), 0 where nothing is said.
"""

import numpy as np

from gearlib import checks
from gearlib.rig import fitted_data
from gearlib.rig.projection import projected

#: Mesh orders compared.
ORDERS = 4
#: Waves once, twice, ... a turn that are the encoder's; samples for each mesh order at least.
_OF_SHAFT, _DENSE = 3, 2.5


class MeshOrders:
    """A measured time course; `modelled`, `blocks` and `measured` are those of its kind."""

    kind: str
    #: Mesh orders, shape (blocks, orders), what lowers the variance of noise, what is compared.
    measured: np.ndarray
    share: np.ndarray
    kept: np.ndarray
    #: Blocks at which the motion jumps.
    jumps: list = []
    #: A sentence on revolutions that are left out.
    left_out = ""
    #: Number of the mesh whose displacement it is.
    mesh = 0

    def __init__(self, model, data):
        self.known = fitted_data.known(data)
        #: Mesh phase at which the course begins, rad.
        self.phase = checks.number(
            "known.phase", self.known.get("phase", 0.0), "a number in rad", np.isfinite
        )
        sensor = data.displacement.attrs
        self.gain = bool(sensor.get("unknown_gain", 0))
        self.units = sensor.get("units", "m")
        self.values = np.asarray(data.displacement.values, float)
        checks.require((np.diff(data.time.values) > 0.0).all(), "time", "unsorted", "rising")
        size = float(np.std(self.values))
        checks.require(size > 0.0, "displacement", float(self.values[0]), "no constant")
        self.noise = float(sensor.get("noise_std", 0.0))
        #: Standard deviation of a sample; a scale where it is unknown.
        self.deviation = self.noise or size
        self.teeth = checks.number(
            "mesh periods of a revolution",
            round(model.periods_per_revolution, 9),
            "a whole number, as of a train whose carrier stands",
            float.is_integer,
        )

    @property
    def size(self):
        """How many residuals there are."""
        return 2 * int(self.kept.sum()) * self.measured.shape[1] + len(self.jumps)

    @property
    def blocks_of_noise(self):
        """How many residuals, and whether their noise is known."""
        return [(self.size, bool(self.noise))]

    @property
    def eliminated(self):
        """How many numbers are taken from the data besides the parameters."""
        return int(self.gain)

    def sequences(self, residuals):
        """Return residuals of unknown noise in the order of time: name -> (sequences, blocks)."""
        rows = residuals[: residuals.size - len(self.jumps)].reshape(-1, 2 * ORDERS)
        return {} if self.noise else {self.kind: rows.T}

    def modelled(self, model):
        """Return the orders of a model, shape (blocks, orders), None where it could not go on."""
        raise NotImplementedError

    def jump(self, i, orders, gain):
        """Return the residual of the jump at a block."""
        raise NotImplementedError

    def compared(self, model):
        """Return the orders of a model at the phase of the rig, None as `modelled`."""
        orders = self.modelled(model)
        if orders is None:
            return None
        return orders * np.exp(1j * self.phase * np.arange(1, orders.shape[1] + 1))

    def residuals(self, model):
        """Return the residuals, None where the model could not go on."""
        orders = self.compared(model)
        if orders is None:
            return None
        scale = np.repeat(self._deviations(), 2 * orders.shape[1])

        def flat(values):
            kept = values[self.kept]
            return np.stack([kept.real, kept.imag], 2).ravel() / scale

        measured, no_basis = flat(self.measured), np.zeros((scale.size, 0))
        residuals, gain = projected(measured, flat(orders), no_basis, self.gain)
        jumps = [self.jump(i, orders, gain or 1.0) for i in self.jumps]
        return np.concatenate([residuals, jumps])

    def _deviations(self):
        """Return the standard deviations of both parts of an order, in each block compared."""
        return self.deviation * np.sqrt(0.5 * self.share[self.kept])

    def fitted(self, model):
        """Return the orders as the sensor has those of a model; NaN of blocks left out."""
        shape = (int(self.kept.sum()), self.measured.shape[1], 2)
        apart = self.residuals(model)[: np.prod(shape)].reshape(shape)
        found = np.full(self.measured.shape, complex(np.nan))
        away = (apart[..., 0] + 1j * apart[..., 1]) * self._deviations()[:, None]
        found[self.kept] = self.measured[self.kept] + away
        return found


def complete_blocks(turns, bounds, teeth):
    """Return which blocks, between two of the `bounds`, have no gap between their samples.

    A gap is longer than a mesh period, and than three steps between samples as a rule.
    """
    steps, complete = np.diff(turns), np.ones(len(bounds) - 1, bool)
    for i in np.flatnonzero(steps > max(1.0 / teeth, 3.0 * np.median(steps))):
        first, last = np.searchsorted(bounds, turns[i : i + 2], "right") - 1
        complete[max(first, 0) : last + 1] = False
    return complete


def regressed(turns, values, bounds, teeth, complete=True):
    """Return (mesh orders, shape (blocks, ORDERS), what the variance of noise is lowered by).

    Samples lie anywhere: of each block, between two of the `bounds`, a regression on offset, the
    first waves of the shaft and mesh orders. Samples weigh as much as the part of the block that
    is next to them, so that of waves that grow it has the Fourier integral. The variance of either
    part of an order is half the share. Blocks that are not complete or have too few samples have
    NaN.
    """
    cells = np.concatenate([[-np.inf], 0.5 * (turns[1:] + turns[:-1]), [np.inf]])
    blocks = len(bounds) - 1
    inside = np.diff(np.searchsorted(turns, bounds))
    dense = inside / np.diff(bounds) / teeth
    there = complete & (dense >= _DENSE * ORDERS)
    said = f"of {_DENSE * ORDERS:g} or more"
    least = f"{dense.min():.3g} samples in a mesh period"
    checks.require(there.any(), "displacement", least, said)
    count = min(2 * ORDERS, int(dense[there].min() / _DENSE))
    # Less than a turn does not tell them from the offset.
    shaft = _OF_SHAFT if bounds[1] - bounds[0] >= 1.0 else 0
    waves = np.array([*range(1, shaft + 1), *(teeth * np.arange(1, count + 1))])
    found, share = np.full((blocks, ORDERS), complex(np.nan)), np.full(blocks, np.nan)
    real = np.arange(ORDERS) + 1 + shaft
    imaginary = real + waves.size
    for k in np.flatnonzero(there):
        low, high = bounds[k : k + 2]
        own = slice(np.searchsorted(cells, low, "right") - 1, np.searchsorted(cells, high))
        weights = np.diff(np.clip(cells[own.start : own.stop + 1], low, high))[:, None]
        turn = np.exp(2j * np.pi * np.outer(turns[own], waves))
        columns = np.hstack([np.ones((len(turn), 1)), turn.real, turn.imag])
        heavy = weights * columns
        inverse = np.linalg.inv(columns.T @ heavy)
        best = inverse @ (heavy.T @ values[own])
        found[k] = 0.5 * (best[real] - 1j * best[imaginary])
        spread = np.diag(inverse @ (heavy.T @ heavy) @ inverse)
        share[k] = 0.5 * spread[[*real, *imaginary]].mean()
    return found, share
