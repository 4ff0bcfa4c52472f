"""What a fit compares of a measured run-up: mesh orders, block by block, and where it jumps.

Sums over the phase turn samples into the complex amplitudes of the mesh orders of each revolution:
offset and eccentricity are other orders and do not enter. Around a jump, where the deviations of a
motion grow, nothing is compared but the speed at which it happens.
"""

import json
import math

import numpy as np

from gearlib import checks
from gearlib.analysis.order_maps import summed
from gearlib.analysis.turning import Turning
from gearlib.rig.projection import projected
from gearlib.runs.run_up import run_up

#: Samples of the model in a mesh period: of waves that fall with the third power of their order.
SAMPLES = 32
#: Mesh orders compared.
ORDERS = 4
#: A step of the first mesh order from one revolution to the next that is a jump, as a share.
_JUMP = 0.15
#: Revolutions left out before a jump and behind it: in these the motion comes to its new orbit.
_BEFORE, _BEHIND = 4, 24
#: First revolutions left out: what begins from rest dies out.
_FIRST = 6


class RunUpOrders:
    """A measured time course of a run-up."""

    kind = "run-up"

    def __init__(self, model, data):
        known = json.loads(data.attrs.get("known", "{}"))
        if "course" not in known:
            raise ValueError(
                "known.course is missing: a run-up needs its course of speed, rows of s and rpm"
            )
        self.course, self.options = known["course"], known.get("options", {})
        sensor = data.displacement.attrs
        self.noise = float(sensor.get("noise_std", 0.0))
        self.gain = bool(sensor.get("unknown_gain", 0))
        values = data.displacement.values
        checks.require(np.isfinite(values).all(), "displacement", "NaN", "finite in each sample")
        checks.require(np.ptp(values) > 0.0, "displacement", float(values[0]), "no constant")
        turning = Turning(self.course)
        turned, self.teeth = turning.revolutions(data.time.values), model.mesh.teeth
        self.blocks = int(turned[-1])
        checks.require(
            self.blocks > 2 * _FIRST, "revolutions", self.blocks, f"more than {2 * _FIRST}"
        )
        self.measured, self.share = self._orders(math.tau * self.teeth * turned, values)
        self.jumps = _jumps(np.abs(self.measured[:, 0]))
        self.kept = np.arange(self.blocks) >= _FIRST
        for i in self.jumps:
            self.kept[max(i - _BEFORE, 0) : i + _BEHIND] = False
        #: Speed in rpm of the middle of each block, by the course.
        self.speeds = turning.at(np.arange(self.blocks) + 0.5)[1]

    def _orders(self, phase, table):
        """Return (mesh orders, shape (blocks, ORDERS, ...), what noise is lowered by)."""
        span = math.tau * self.teeth
        found, _, share = summed(phase, table, self.blocks, span, 1.0, ORDERS + 1)
        return found[:, 1:], share

    def modelled(self, model, names):
        """Return (orders, shape (blocks, ORDERS), their derivatives, the run-up)."""
        run = run_up(
            model,
            speed=self.course,
            samples_per_period=SAMPLES,
            sensitivities=names,
            **self.options,
        )
        if int(run.status):
            return None
        columns = [run.displacement.values]
        columns += [run[f"d_displacement_d_{name}"].values for name in names]
        table = np.column_stack(columns)
        found, _ = self._orders(run.phase.values, table)
        return found[:, :, 0], found[:, :, 1:], run

    def residuals(self, model, names):
        """Return (residuals, derivatives), None where the model could not go on."""
        found = self.modelled(model, names)
        if found is None:
            return None
        orders, slopes, _ = found
        deviation = (self.noise or 1.0) * np.sqrt(0.5 * self.share[self.kept])
        scale = np.repeat(deviation, 2 * ORDERS)

        def flat(values):
            part = np.stack([values.real, values.imag], 2)[self.kept]
            return part.reshape(len(scale), *values.shape[2:]) / scale.reshape(
                -1, *[1] * (values.ndim - 2)
            )

        measured, none = flat(self.measured), np.zeros((scale.size, 0))
        rest, moved, gain = projected(measured, flat(orders), flat(slopes), none, self.gain)
        more = [self._jump(i, orders, slopes, gain or 1.0) for i in self.jumps]
        return (
            np.concatenate([rest, [one[0] for one in more]]),
            np.vstack([moved, *[one[1] for one in more]]),
        )

    def deepest(self, model):
        """Return the largest way of the model into the backlash in what is compared, m."""
        run = run_up(model, speed=self.course, **self.options)
        least = run.displacement_min.values[: self.blocks]
        return max(0.0, -float(least[self.kept[: least.size]].min()))

    def _jump(self, i, orders, slopes, gain):
        """Return (residual, derivatives) of the speed of a jump, over a few revolutions.

        Where the first mesh order of the model crosses the middle of the levels measured.
        """
        level = np.abs(self.measured[:, 0])
        before, behind = level[i - _BEFORE], level[min(i + _BEFORE, len(level) - 1)]
        middle = 0.5 * (before + behind) / gain
        height = np.abs(orders[:, 0])
        rises = behind > before
        # On the same way, up or down: the half of the course in which the jump was.
        way = np.sign(np.gradient(self.speeds))
        fits = (height > middle) == rises
        cross = np.flatnonzero(fits[1:] & ~fits[:-1] & (way[1:] == way[i])) + 1
        width = _BEHIND * abs(self.speeds[i] - self.speeds[i - 1]) + 1e-9
        if not cross.size:
            return 100.0, np.zeros(slopes.shape[2])
        j = cross[np.abs(cross - i).argmin()]
        rate = (orders[:, 0].conj()[:, None] * slopes[:, 0]).real / height[:, None]
        step = height[j] - height[j - 1]
        share = (middle - height[j - 1]) / step
        moved = -((1.0 - share) * rate[j - 1] + share * rate[j]) / step
        apart = self.speeds[j] - self.speeds[j - 1]
        place = self.speeds[j - 1] + share * apart
        own = np.interp(0.5, [0.0, 1.0], [self.speeds[i - 1], self.speeds[i]])
        return (place - own) / width, moved * apart / width


def _jumps(height):
    """Return the blocks at which a height jumps, each once."""
    step = np.abs(np.log(height[1:] / height[:-1]))
    found = []
    for i in np.argsort(-step):
        if step[i] < _JUMP or i < _FIRST:
            break
        if all(abs(i + 1 - one) > _BEHIND for one in found):
            found.append(int(i + 1))
    return sorted(found)
