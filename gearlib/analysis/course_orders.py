"""Fourier integrals of a run-up over the shaft angle, to rounding: it is run again.

Between switches and events the motion is analytic in time, and so is its product with a wave of the
angle, which has no elementary integral under an acceleration. Gauss's rule takes each such arc,
with as many nodes as motion and wave ask for; nothing is sampled across a jump.
"""

import copy
import functools
import json
import math

import numpy as np

from gearlib.kernels import orbit
from gearlib.kernels.closed_form.course_waves import LEAST_NODES, MOST_NODES, WAVES
from gearlib.kernels.codes import NORMAL
from gearlib.kernels.order_sums import FEW, add_waves
from gearlib.models.from_values import model_of
from gearlib.models.one_mesh_system import matrix
from gearlib.models.propagators import courses
from gearlib.models.propagators.course_matrices import of_matrices
from gearlib.runs.run_up import inertia_of, summaries

#: name -> its column of the samples of kernels.
VARIABLES = {
    "displacement": orbit.SAMPLE_X,
    "velocity": orbit.SAMPLE_V,
    "acceleration": orbit.SAMPLE_A,
    "dynamic_force": orbit.SAMPLE_FORCE,
}
#: Nodes by which Gauss's rules grow: few sizes are done at once.
_STEP = 4
#: Of an arc below this theta nothing is taken: rounding of a long run hides where it is.
_SHORT = 1e-10
#: Error of coefficients that rounding leaves, of the root mean square: instants of a long run have
#: such digits.
ROUNDING = 1e-10
#: Events in a mesh period are no matter here: the run-up has been through.
_NO_LIMIT = 2**30
#: How often nodes are doubled until coefficients stay.
_DOUBLINGS = 3


@functools.cache
def rules():
    """Return nodes and weights on (0, 1), shape (MOST_NODES + 1, 2, MOST_NODES)."""
    table = np.zeros((MOST_NODES + 1, 2, MOST_NODES))
    for n in range(1, MOST_NODES + 1):
        nodes, weights = np.polynomial.legendre.leggauss(n)
        table[n, :, :n] = 0.5 * (nodes + 1.0), 0.5 * weights
    return table


def of_run(run):
    """Return the model of a run-up whose orders are exact; None where samples are all there is.

    Not known are the instants at which single pairs of teeth touch, or the flow of quadratic
    damping turns.
    """
    model = model_of(run.attrs.get("gear_pair") or run.attrs.get("model", ""))
    if model is None or "initial_state" not in json.loads(run.attrs["parameters"]):
        return None
    equation = model.equation
    return None if equation is not None and equation.damping[:, 1].any() else model


class _Nodes:
    """The samples of a run-up that Gauss's rules ask for, stretch by stretch."""

    def __init__(self, model, run, span, step, count, blocks, dense=1.0):
        self.natural, self.harmonics = (dense * one for one in _rates(model, run)[:2])
        self.events = np.sort(run.event_time.values) * float(model.mesh_frequency(1.0))
        self.span, self.step, self.count, self.blocks = span, step, count, blocks

    def __call__(self, piece, cut, length):
        """Return theta of the samples in their intervals, and where these begin."""
        begin, end = cut.within(length)
        interval = np.repeat(np.arange(len(cut.block)), np.diff(cut.first))
        bounds = cut.bounds(piece, length)
        met = self.events[slice(*np.searchsorted(self.events, bounds[[0, -1]]))]
        which = np.minimum(np.searchsorted(bounds, met, side="right") - 1, len(cut.block) - 1)
        # Phases and speeds from the begins of the intervals on.
        phase, speed = cut.phase[cut.first[:-1]], cut.speeds(piece)[cut.first[:-1]]
        rate, ends = 0.5 * piece.acceleration, cut.offset + cut.phase[cut.first]
        first, last = np.floor(ends[0] / self.span) + 1.0, np.ceil(ends[-1] / self.span)
        turns = self.span * np.arange(first, last)
        within = np.minimum(np.searchsorted(ends, turns, side="right") - 1, len(cut.block) - 1)
        passed = turns - ends[within]
        passed *= 2.0 / (speed[within] + piece.speed_at(turns))
        at = np.concatenate([begin, met - bounds[which], passed])
        own = np.concatenate([interval, which, within])
        order = np.lexsort((at, own))
        at, own = at[order], own[order]
        wholes = end[cut.first[1:] - 1]
        stop = np.where(np.diff(own, append=-1) == 0, np.roll(at, -1), wholes[own])
        lasts = stop - at
        kept = lasts > _SHORT
        at, own, lasts = at[kept], own[kept], lasts[kept]
        top = np.maximum(speed[own] + 2.0 * rate * at, speed[own] + 2.0 * rate * (at + lasts))
        waves = lasts * ((self.count * self.step + self.harmonics) * top + 2.0 * self.natural)
        parts = (waves / WAVES).astype(int) + 1
        wanted = LEAST_NODES + np.ceil(0.5 / _STEP * waves / parts).astype(int) * _STEP
        # An arc of many waves is one of several parts.
        part = np.arange(parts.sum()) - np.repeat(np.cumsum(parts) - parts, parts)
        at, own, lasts, wanted, parts = (
            np.repeat(one, parts) for one in (at, own, lasts, wanted, parts)
        )
        lasts, wanted = lasts / parts, np.minimum(wanted, MOST_NODES)
        at = at + part * lasts
        first = np.concatenate([[0], np.cumsum(wanted)])
        theta, self.share = np.empty((2, first[-1]))
        for size in np.unique(wanted):
            rows = np.flatnonzero(wanted == size)
            places = first[rows, None] + np.arange(size)
            nodes, weights = rules()[size, :, :size]
            theta[places] = at[rows, None] + lasts[rows, None] * nodes
            self.share[places] = lasts[rows, None] * weights
        number = np.repeat(own, wanted)
        middle = at + 0.5 * lasts
        middle = ends[own] + (speed[own] + rate * middle) * middle
        block = np.floor(middle / self.span)
        begin = (cut.offset - block * self.span + phase[own]).repeat(wanted)
        self.phase = begin + (speed[number] + rate * theta) * theta
        self.speed = speed[number] + 2.0 * rate * theta
        self.share *= self.speed
        self.rows = np.where(block < self.blocks, block, -1).astype(int).repeat(wanted)
        return theta, np.searchsorted(number, np.arange(len(cut.block) + 1))


class _Sums:
    """Integrals of b blocks, of m variables and n orders."""

    def __init__(self, step, blocks, variables, count):
        self.step, self.count = step, count
        self.sums = np.zeros((2, blocks, variables, -(-count // FEW), FEW))
        self.squares = np.zeros((blocks, variables))

    def add(self, nodes, values):
        """Add values at nodes, shape (k, m)."""
        add_waves(nodes.phase, nodes.share, values, nodes.rows, self.step, self.sums, self.squares)

    def coefficients(self):
        """Return them complex, shape (b, n, m)."""
        real, imag = np.swapaxes(self.sums.reshape(*self.sums.shape[:3], -1), 2, 3)
        return (real + 1j * imag)[:, : self.count]


def again(model, run, samples):
    """Yield the stretches of a run-up, with samples as of `courses.run_through`."""
    asked = json.loads(run.attrs["parameters"])
    course = np.array(asked["speed"]), np.array(asked["load"])
    push = inertia_of(model, asked["driver"], asked["driven_mass"], asked["base_radius"])
    every = model.periods_per_revolution
    runner, pieces, z = courses.set_out(model, *course, start_of(asked))
    yield from courses.run_through(runner, pieces, z, samples, _NO_LIMIT, push, every)


def start_of(asked):
    """Return the initial state that a run-up was asked for, of its `parameters`."""
    state = asked["initial_state"]
    return state if isinstance(state, str) else tuple(state)


def scale_of(model, column):
    """Return the unit in SI of a column of samples by theta."""
    omega, length = float(model.mesh_frequency(1.0)), model.static_deflection
    return {
        orbit.SAMPLE_X: length,
        orbit.SAMPLE_V: length * omega,
        orbit.SAMPLE_A: length * omega**2,
        orbit.SAMPLE_FORCE: model.scales()["force_scale"],
    }[column]


class _Moving:
    """Derivatives at the nodes of a run-up: what `course_matrices.of_matrices` gives samples to."""

    def __init__(self, sums, kept, row, by_speed):
        self.sums, self.kept, self.row, self.by_speed = sums, kept, row, by_speed

    def when(self, i):
        """Return theta of the nodes of a stretch."""
        return self.kept[i][0]

    def take(self, i, samples):
        """Take derivatives by k names at fixed time, shape (n, 4, m, k)."""
        _, nodes, drift = self.kept[i]
        # A factor of the speeds moves the time at which a phase is reached.
        values = samples[:, self.row] + drift[..., None] * self.by_speed
        self.sums.add(nodes, values.reshape(len(values), -1))
        return samples[:0]


def slopes(model, run, names, column, blocks, span, step, count):
    """Return what coefficients of `integrals` change by, complex, shape (k, b, n, ...), SI.

    Of models that go by matrices, of what is continuous at phases that move; `names` are k.
    """
    nodes, kept = _Nodes(model, run, span, step, count, blocks), []
    row = list(VARIABLES.values()).index(column)
    growth = {orbit.SAMPLE_X: orbit.SAMPLE_V, orbit.SAMPLE_V: orbit.SAMPLE_A}.get(column)

    def wanted(piece, cut, length):
        theta, taken = nodes(piece, cut, length)
        bounds = cut.bounds(piece, length)
        when = theta + np.repeat(bounds[:-1] - bounds[0], np.diff(taken))
        kept.append([when, copy.copy(nodes), None])
        return theta, taken

    for i, one in enumerate(again(model, run, wanted)):
        own = kept[i][1]
        reached = own.phase + np.maximum(own.rows, 0) * span
        rate = one.samples[..., growth] if growth is not None else np.zeros(one.samples.shape[:2])
        late = np.divide(reached, own.speed, out=np.zeros_like(reached), where=own.speed > 0.0)
        kept[i][2] = -rate * late[:, None]
    found = list(again(model, run, courses.equal_steps(1)))
    asked, meshes = json.loads(run.attrs["parameters"]), len(model.mesh_names) or 1
    sums = _Sums(step, blocks, meshes * len(names), count)
    by_speed = np.array([float(name == "speed") for name in names])
    push = {name: asked[name] for name in ("driver", "driven_mass", "base_radius")}
    waves = _Moving(sums, kept, row, by_speed)
    of_matrices(model, names, found, summaries(found), start_of(asked), 1, waves=waves, **push)
    changes = sums.coefficients().reshape(blocks, count, meshes, -1)
    changes *= scale_of(model, column) / span
    return np.moveaxis(changes if model.mesh_names else changes[:, :, 0], -1, 0)


def integrals(model, run, column, blocks, span, step, count):
    """Return (coefficients, mean squares, errors) of a run-up, (blocks, count, ...), in SI.

    Parameters
    ----------
    model : Model
        Of `of_run`.
    run : xarray.Dataset
        Of `gearlib.run_up`.
    column : int
        Of the samples of `orbit`: what is integrated.
    blocks : int
    span, step : float
        Of the phase: a block, and the wave number of the first order.
    count : int
        Orders, from 0.
    """
    closed, meshes = _rates(model, run)[2], len(model.mesh_names) or 1

    def found(dense):
        nodes, sums = (
            _Nodes(model, run, span, step, count, blocks, dense),
            _Sums(step, blocks, meshes, count),
        )
        for one in again(model, run, nodes):
            sums.add(nodes, np.ascontiguousarray(one.samples[..., column]))
        return sums.coefficients() / span, sums.squares / span

    sums, squares = found(1.0)
    error = ROUNDING * np.sqrt(squares)[:, None] * np.ones(sums.shape)
    for k in range(0 if closed else _DOUBLINGS):
        before = sums
        sums, squares = found(2.0 ** (k + 1))
        change = np.abs(sums - before)
        if (change <= error).all():
            break
    else:
        error = error if closed else np.maximum(error, change)
    scale = scale_of(model, column)
    if not model.mesh_names:
        sums, squares, error = sums[..., 0], squares[:, 0], error[..., 0]
    return scale * sums, scale**2 * squares, scale * error


def _rates(model, run):
    """Return (highest rate of the motion by theta, highest harmonic, whether that is all)."""
    equation = model.equation
    if equation is None or equation.is_piecewise_linear():
        system = model.system(1.0)
        harmonics = float(system.harmonics.max(initial=0.0))
        return _highest(system, model.size), harmonics, True
    reach = float(np.abs(run.displacement.values).max()) / model.static_deflection
    quadratic, cubic = equation.powers
    hardened = 1.0 + (2.0 * quadratic + 3.0 * cubic * reach) * reach
    stiff, orders = equation.ground, [0.0]
    for side in (equation.near, equation.far):
        most = (np.abs(side.lines) @ [1.0, math.tau]).max() + np.abs(side.harmonics[:, 1:]).sum()
        stiff = max(stiff, most * hardened)
        orders += [float(n) for n in side.harmonics[:, 0]]
    orders += [float(n) for n in (*equation.force[:, 0], *equation.deviation[:, 0])]
    return math.sqrt(stiff), max(orders), False


def _highest(system, size):
    """Return the largest eigenvalue of a system whose meshes all touch: contacts stiffen."""
    kinds = np.unique(system.effect[NORMAL + 1], axis=0)
    highest = 0.0
    for kind in kinds:
        rates = np.linalg.eigvals(matrix(system, kind)[:size, :size])
        highest = max(highest, float(np.abs(rates).max()))
    return highest
