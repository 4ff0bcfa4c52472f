"""What a fit compares of a measured run-up: mesh orders, block by block, and where it jumps.

Around a jump, where the deviations of a motion grow, nothing is compared but the speed at which it
happens.
"""

import math

import numpy as np

from gearlib import checks
from gearlib.analysis.order_sums import Turning
from gearlib.rig import fitted_data
from gearlib.rig.fitted_curves import Curve
from gearlib.rig.order_observations import ORDERS, MeshOrders, complete_blocks, regressed
from gearlib.runs.run_up import run_up

#: Samples of the model in a mesh period: of waves that fall with the third power of their order.
SAMPLES = 32
#: Phases closer than this count as equal.
_SAME_PHASE = 1e-9
#: A step of the first mesh order from one revolution to the next that is a jump, as a share.
_JUMP = 0.15
#: Revolutions left out before a jump and behind it: in these the motion comes to its new orbit.
_BEFORE, _BEHIND = 4, 24
#: First revolutions left out: what begins from rest dies out.
_FIRST = 6


class RunUpOrders(MeshOrders):
    """A measured time course of a run-up."""

    kind = "run-up"

    def __init__(self, model, data):
        super().__init__(model, data)
        self.course, self.options = fitted_data.course_of(self.known)
        self.turning = Turning(self.course)
        times, (end, _) = data.time.values, self.course[-1]
        turns = self.turning.revolutions(times)
        self.blocks, count = int(turns[-1]), float(self.turning.revolutions(np.array([end]))[0])
        said = f"{times[0]:.6g} to {times[-1]:.6g} s"
        within = turns[0] < 1.0 and self.blocks <= count + 1e-9
        allowed = f"within known.course, 0 to {end:.6g} s, from its first revolution on"
        checks.require(within, "time", said, allowed)
        allowed = f"of more than {2 * _FIRST} whole revolutions of known.course, not {self.blocks}"
        checks.require(self.blocks > 2 * _FIRST, "time", said, allowed)
        bounds = np.arange(self.blocks + 1)
        complete, revolutions = complete_blocks(turns, bounds, self.teeth), self.blocks - _FIRST
        allowed = f"of one without a gap behind the first {_FIRST}"
        said = f"of {revolutions} revolutions with gaps"
        checks.require(complete[_FIRST:].any(), "time", said, allowed)
        self.measured, self.share = regressed(turns, self.values, bounds, self.teeth, complete)
        there = np.isfinite(self.share)
        self.kept = there & (np.arange(self.blocks) >= _FIRST)
        if missing := revolutions - int(self.kept.sum()):
            self.left_out = (
                f"{missing} of {revolutions} revolutions are left out of the run-up: they have "
                "gaps or too few samples"
            )
        # A block without samples has the height of the one before it.
        last = np.maximum.accumulate(np.where(there, bounds[:-1], there.argmax()))
        #: Heights of the first mesh order.
        self.level = np.abs(self.measured[last, 0])
        self.jumps = _jumps(self.level)
        for i in self.jumps:
            self.kept[max(i - _BEFORE, 0) : i + _BEHIND] = False
        #: Speed in rpm of the middle of each block, by the course.
        self.speeds = self.turning.at(np.arange(self.blocks) + 0.5)[1]
        self._regular: _FourierSums | None = None

    def modelled(self, model):
        """Return the orders of a model, shape (blocks, ORDERS), None of a run that stops."""
        run = run_up(model, speed=self.course, samples_per_period=SAMPLES, **self.options)
        if int(run.status):
            return None
        count = run.sizes["time"]
        if self._regular is None or self._regular.count != count:
            # The phases are those of the course, whatever the parameters of the model are.
            self._regular = _FourierSums(run.phase.values, self.blocks, math.tau * self.teeth)
        return self._regular.orders(run.displacement.values.reshape(count, -1)[:, self.mesh])

    def curves(self, model):
        """Return the amplitudes of the mesh orders over the speed, each a `Curve`."""
        falls, found = np.gradient(self.speeds) < 0.0, []
        for k, (own, fitted) in enumerate(zip(self.measured.T, self.fitted(model).T, strict=True)):
            words = f"order {k + 1 if k else ''}z"
            heights = 2.0 * np.abs(own), 2.0 * np.abs(fitted)
            found.append(Curve(words, self.units, "speed", self.speeds, heights, falls))
        return found

    def deepest(self, model):
        """Return the largest way of the model into the backlash in what is compared, m."""
        run = run_up(model, speed=self.course, **self.options)
        least = run.displacement_min.values[: self.blocks]
        return max(0.0, -float(least[self.kept[: least.size]].min()))

    def jump(self, i, orders, gain):
        """Return the residual of the speed of a jump, over a few revolutions.

        Where the first mesh order of the model crosses the middle of the levels measured.
        """
        level = self.level
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
            return 100.0
        j = cross[np.abs(cross - i).argmin()]
        share = (middle - height[j - 1]) / (height[j] - height[j - 1])
        place = self.speeds[j - 1] + share * (self.speeds[j] - self.speeds[j - 1])
        own = np.interp(0.5, [0.0, 1.0], [self.speeds[i - 1], self.speeds[i]])
        return (place - own) / width


class _FourierSums:
    """Mesh orders of samples at given phases by trapezia over the phase, block by block."""

    def __init__(self, phase, blocks, span):
        self.count = phase.size
        edges = span * np.arange(blocks + 1)
        places = np.searchsorted(phase, edges - _SAME_PHASE)
        #: First sample of each block, and the one that closes it.
        self.first, self.closing = places[:-1], np.minimum(places[1:], phase.size - 1)
        phase = phase[: places[-1]]
        ends = np.append(phase[1:], edges[-1])
        widths = (ends - np.append(phase[:1], phase[:-1])) / (2.0 * span)
        steps = (ends - phase) / (2.0 * span)
        widths[self.first] = steps[self.first]
        self.closing_weights = steps[places[1:] - 1]
        waves = np.exp(-1j * np.outer(phase, np.arange(1, ORDERS + 1)))
        self.weights = widths[:, None] * waves

    def orders(self, values):
        """Return complex amplitudes of the mesh orders of samples, shape (blocks, ORDERS)."""
        sums = np.add.reduceat(self.weights * values[: len(self.weights), None], self.first)
        return sums + (self.closing_weights * values[self.closing])[:, None]


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
