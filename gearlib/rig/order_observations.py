"""Mesh orders of a measured time course beside those of a model: what all such have in common.

Regressions turn samples into the complex amplitudes of the mesh orders of each revolution: offset
and eccentricity are other orders and do not enter. An unknown gain is eliminated, and so is the
mesh phase at which the course begins, unless ``known.phase`` has it (rad).
"""

import numpy as np

from gearlib import checks
from gearlib.rig import fitted_data
from gearlib.rig.projection import projected
from gearlib.rig.shaft_phase import turned

#: Mesh orders compared.
ORDERS = 4
#: Waves once, twice, ... a turn that are the encoder's; samples for each mesh order at least.
_OF_SHAFT, _DENSE = 3, 2.5


class MeshOrders:
    """A measured time course; `modelled`, `blocks` and `measured` are those of its kind."""

    #: Mesh orders, shape (blocks, orders), what lowers the variance of noise, what is compared.
    measured: np.ndarray
    share: np.ndarray
    kept: np.ndarray
    #: Blocks at which the motion jumps.
    jumps: list = []
    #: Number of the mesh whose displacement it is.
    mesh = 0

    def __init__(self, model, data):
        self.known = fitted_data.known(data)
        phase = self.known.get("phase", "unknown")
        #: Mesh phase at which the course begins, rad, None where nobody knows.
        self.phase = None if phase == "unknown" else checks.number(
            "known.phase", phase, "a number in rad, or unknown", np.isfinite
        )  # fmt: skip
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
        return int(self.gain) + int(self.phase is None)

    def modelled(self, model, names):
        """Return (orders of a model, their derivatives), None where it could not go on."""
        raise NotImplementedError

    def jump(self, i, orders, slopes, gain):
        """Return (residual, its derivatives) of the jump at a block."""
        raise NotImplementedError

    def compared(self, model, names):
        """Return (orders, their derivatives) at the phase of the rig, None as `modelled`."""
        found = self.modelled(model, names)
        if found is None:
            return None
        orders, slopes = found
        if self.phase is None:
            weights = np.where(self.kept, 1.0 / self.share, 0.0)
            return turned(self.measured, orders, slopes, weights)[:2]
        turn = np.exp(1j * self.phase * np.arange(1, orders.shape[1] + 1))
        return orders * turn, slopes * turn[:, None]

    def residuals(self, model, names):
        """Return (residuals, derivatives), None where the model could not go on."""
        found = self.compared(model, names)
        if found is None:
            return None
        orders, slopes = found
        scale = np.repeat(self._deviations(), 2 * orders.shape[1])

        def flat(values):
            part = np.stack([values.real, values.imag], 2)[self.kept]
            return part.reshape(len(scale), *values.shape[2:]) / scale.reshape(
                -1, *[1] * (values.ndim - 2)
            )

        measured, none = flat(self.measured), np.zeros((scale.size, 0))
        rest, moved, gain = projected(measured, flat(orders), flat(slopes), none, self.gain)
        more = [self.jump(i, orders, slopes, gain or 1.0) for i in self.jumps]
        return (
            np.concatenate([rest, [one[0] for one in more]]),
            np.vstack([moved, *[one[1] for one in more]]),
        )

    def _deviations(self):
        """Return the standard deviations of both parts of an order, in each block compared."""
        return self.deviation * np.sqrt(0.5 * self.share[self.kept])

    def fitted(self, model):
        """Return the orders as the sensor has those of a model; NaN of blocks left out."""
        shape = (int(self.kept.sum()), self.measured.shape[1], 2)
        apart = self.residuals(model, ())[0][: np.prod(shape)].reshape(shape)
        found = np.full(self.measured.shape, complex(np.nan))
        away = (apart[..., 0] + 1j * apart[..., 1]) * self._deviations()[:, None]
        found[self.kept] = self.measured[self.kept] + away
        return found


def regressed(turns, values, bounds, teeth):
    """Return (mesh orders, shape (blocks, ORDERS), what the variance of noise is lowered by).

    Samples lie anywhere: of each block, between two of the `bounds`, a regression on offset, the
    first waves of the shaft and mesh orders. Samples weigh as much as the part of the block that
    is next to them, so that of waves that grow it has the Fourier integral. The variance of either
    part of an order is half the share.
    """
    cells = np.concatenate([[-np.inf], 0.5 * (turns[1:] + turns[:-1]), [np.inf]])
    blocks = len(bounds) - 1
    inside = np.diff(np.searchsorted(turns, bounds))
    dense = float((inside / np.diff(bounds)).min() / teeth)
    count = min(2 * ORDERS, int(dense / _DENSE))
    said = f"of {_DENSE * ORDERS:g} or more"
    checks.require(count >= ORDERS, "displacement", f"{dense:.3g} samples in a mesh period", said)
    # Less than a turn does not tell them from the offset.
    shaft = _OF_SHAFT if bounds[1] - bounds[0] >= 1.0 else 0
    waves = np.array([*range(1, shaft + 1), *(teeth * np.arange(1, count + 1))])
    found, share = np.zeros((blocks, ORDERS), complex), np.zeros(blocks)
    real = np.arange(ORDERS) + 1 + shaft
    imaginary = real + waves.size
    for k, (low, high) in enumerate(zip(bounds[:-1], bounds[1:], strict=True)):
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
