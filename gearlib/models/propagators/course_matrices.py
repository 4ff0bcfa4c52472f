"""What a run-up changes by, where it goes by matrices: one mesh or many, any number of coordinates.

The walk of `tangents` goes through each stretch, in static deflections and natural time of the
model as it is, also where a parameter changes these. Beside coordinates, rates and the constant the
state has the integrals of all mesh forces, whose means are wanted, and a ramp of the load.
"""

import numpy as np

from gearlib.kernels import orbit
from gearlib.kernels.codes import BACKLASH, INVERSE, NORMAL
from gearlib.kernels.slopes.itinerary import KIND, MET, SWITCH
from gearlib.kernels.slopes.recorded_slopes import end_record
from gearlib.kernels.slopes.turning_points import TOUCHING
from gearlib.models import acceleration
from gearlib.models.derivatives import START, STEP
from gearlib.models.propagators import courses
from gearlib.models.propagators.course_slopes import COURSE, Slopes, rows_of
from gearlib.models.propagators.matrix_slopes import MatrixSlopes
from gearlib.models.propagators.tangents import Motion, Walk
from gearlib.models.trains.system import train_system

#: Phases closer than this share of the whole phase are one.
_SAME = 1e-12
#: Columns of a summary, in the order of `recorded_slopes.Tables.best`; a share that two ways round.
_EXTREMA, _CLOSE = [orbit.X_MAX, orbit.X_MIN, orbit.FORCE_MAX, orbit.FORCE_MIN], 1e-8
#: A distance this small, as a share of its parts, is zero.
_ON_LINE = 1e-14


class _Systems:
    """The systems of a model and of those off the real axis, k of them, in units that stay.

    Parameters
    ----------
    model : Model
    along : sequence of dict
        What changes with each parameter, of `Model.direction`.
    course : dict
        name of a parameter of the course -> whether each of the k is by it, shape (k,).
    push : dict
        driver, driven_mass and base_radius of the run-up.
    """

    def __init__(self, model, along, course, push):
        self.model, self.factor = model, course["speed"]
        half, omega = model.size // 2, float(model.mesh_frequency(1.0))
        self.half, self.runner = half, courses.propagator_of(model)
        twins = [model, *(self._twin(slopes) for slopes in along)]
        self.length = np.array([one.static_deflection for one in twins]) / model.static_deflection
        speed = np.array([one.mesh_frequency(1.0) for one in twins]) / omega
        base = model.system(1.0)
        self.m, self.base = len(base.near), base
        scale = self.length * [
            getattr(one, "stiffness_scale", 0) or one.mean_stiffness for one in twins
        ]
        scale = scale / scale[0].real
        self.stack = []
        for twin, length, rate, force in zip(
            twins, self.length, speed, scale / self.length, strict=True
        ):
            system = base if twin is model else self._system(twin)
            d = np.ones(len(base.free), complex)
            d[:half], d[half : 2 * half] = length, length * rate
            self.stack.append(
                system._replace(
                    free=rate * d[:, None] * system.free / d,
                    push=rate * system.push * d,
                    grip=system.grip / d,
                    near=length * system.near / d,
                    far=length * system.far / d,
                    stiffness=force * system.stiffness,
                )
            )
        self.switches = self._switches(along)
        self.push = [
            length * self._push(twin, i, course, push)
            for i, (twin, length) in enumerate(zip(twins, self.length, strict=True))
        ]

    def _twin(self, slopes):
        if self.model.mesh_names:
            return self.model.complex_step(slopes)
        return self.model.complex_step(
            {name: one for name, one in slopes.items() if name not in START}
        )

    def _system(self, twin):
        if self.model.mesh_names:
            return train_system(twin, 1.0 + 0j)
        return twin.system(1.0 + 0j)

    def _switches(self, along):
        if not self.model.mesh_names:
            return np.pi * np.array([[slopes.get("contact_ratio", 0.0) for slopes in along]])
        every = [
            [one.get(("mesh", mesh.name, "contact_ratio"), 0.0) for one in along]
            for mesh in self.model.meshes
        ]
        return (
            np.pi * np.array(every) / np.array([float(rate) for rate in self.model.rates])[:, None]
        )

    def _push(self, twin, i, course, push):
        """Return the accelerations for a unit of d2tau/dtheta2 off the real axis, shape (N,)."""
        model, step = self.model, 1j * STEP * np.array([0.0, *self.factor])[i]
        if model.train is not None:
            train = twin if model.mesh_names else twin.train
            found = acceleration.of_train(model.train, push["driver"], train.structure.mass)
            return found * model.train.static_deflection / twin.static_deflection * (1.0 + step)
        mass, radius = (
            push[name] + 1j * STEP * np.array([0.0, *course[name]])[i] if push[name] else 0.0
            for name in ("driven_mass", "base_radius")
        )
        return acceleration.of_mesh(twin.mesh, mass, radius) * (1.0 + step)

    def start(self, state, along, speed):
        """Return the tangents of the start at a first speed, shape (2 N, k)."""
        z, half = self.runner.start(state), self.half
        found = self.runner.start_tangents(state, along)
        found = found + z[:, None] * (self.length[1:].imag / STEP)
        found[half:] = (found[half:] + z[half:, None] * self.factor) * speed
        return found

    def of_piece(self, piece):
        """Return the systems of a piece of the course: its load, integrals of the forces."""
        m, half, ramp, found = self.m, self.half, int(piece.slope != 0.0), []
        one, more = 2 * half, m + ramp
        for system, push in zip(self.stack, self.push, strict=True):
            n = len(system.free) + more

            def wider(array, n=n):
                found = np.zeros((*array.shape[:-1], n), complex)
                found[..., :one], found[..., one + more :] = array[..., :one], array[..., one:]
                return found

            free, load = np.zeros((n, n), complex), system.free[half:one, one]
            free[:one] = wider(system.free[:one])
            free[half:one, -1] = load * piece.load + push * piece.acceleration
            if ramp:
                free[half:one, one + m], free[one + m, -1] = load * piece.slope, 1.0
            lines = {NORMAL: wider(system.near), INVERSE: wider(system.far)}
            # The integral of a force is a component: the force pushes it, by a term of its own.
            push, grip = np.zeros((2, m, system.push.shape[1], 3, n), complex)
            push[:, :, :2], grip[:, :, :2] = wider(system.push), wider(system.grip)
            for code, line in lines.items():
                for j, p in np.ndindex(m, self.base.effect.shape[1]):
                    effect = self.base.effect[code + 1, p, j]
                    push[j, effect, 2, one + j] = 1.0
                    grip[j, effect, 2] = system.stiffness[code + 1, p, j] * line[j]
            push[:, 0], grip[:, 0] = 0.0, 0.0
            system = system._replace(free=free, near=lines[NORMAL], far=lines[INVERSE])
            found.append(system._replace(push=push, grip=grip, tuning=1.0))
        return found

    def slopes(self, systems, starts, first, which):
        """Return the `MatrixSlopes` of such systems over some segments."""
        base = {name: getattr(self.base, name)[:, which] for name in ("effect", "low")}
        base |= {"starts": starts, "first_segment": first, "repeats": len(first) - 1}
        systems = [one._replace(stiffness=one.stiffness[:, which], **base) for one in systems]
        outputs = [np.zeros((0, 3, len(which), len(one.free))) for one in systems]
        found = MatrixSlopes(systems, 2 * self.half + self.m, self.switches, outputs)
        found.course = self.factor
        return found


def _segments(base, stretch):
    """Return ((theta, first, segments), phases, speeds) of a stretch.

    The first segment has no length: it is that before the stretch.
    """
    phase, piece = stretch.phase, stretch.piece
    close, whole = _SAME * max(phase[-1], 1.0), base.starts[-1]
    turns = np.arange(int(phase[0] / whole + _SAME) - 1, int(phase[-1] / whole) + 1)
    cuts = (turns[:, None] * whole + base.starts[:-1]).ravel()
    inner = cuts[(cuts > phase[0] + close) & (cuts < phase[-1] - close)]
    bounds = np.array([phase[0], phase[0], *inner, phase[-1]])
    middle = (bounds[:-1] + bounds[1:]) / 2.0
    middle[0] = max(phase[0] - 2.0 * close, 0.0)
    which = (np.searchsorted(cuts, middle, side="right") - 1) % (base.starts.size - 1)
    speed = piece.speed_at(bounds)
    total, length = speed[:-1] + speed[1:], np.diff(bounds)
    length = np.divide(2.0 * length, total, out=np.zeros(len(length)), where=total > 0.0)
    if not total.any():
        length[-1] = stretch.theta[-1] - stretch.theta[0]
    first = np.searchsorted(bounds[1:], phase - close) + 1
    first[0], first[-1] = 0, len(which)
    starts = np.concatenate([[0.0], np.cumsum(length)])
    return (starts, first, which), bounds, speed


def _motion(stretch, m):
    """Return the `Motion` of a stretch."""
    n, ramp = len(stretch.block), stretch.piece.slope != 0.0
    every = len(stretch.samples) // n
    own = stretch.states[::every]
    blank = np.zeros((n, m))
    more = [(stretch.theta[:-1] - stretch.piece.start)[:, None]] if ramp else []
    states = np.hstack([own, blank, *more, np.ones((n, 1))])
    events = np.zeros((len(stretch.events), orbit.EVENT_COLUMNS + 1))
    events[:, [5, 2, 3, 4, 0, 1]] = stretch.events[:, 1:7]
    codes = stretch.samples[0, :, orbit.SAMPLE_CONTACT].astype(int)
    for row in events[::-1]:
        codes[int(row[5])] = int(row[orbit.EVENT_FROM])
    return Motion(np.ascontiguousarray(states), tuple(codes.tolist()), events)


class _Walk(Walk):
    """A stretch of a run-up with its tangents, revolution by revolution.

    Beside the arguments of `Walk`: theta that bounds the intervals, phase and speed at the bounds
    of segments, and theta of the samples.
    """

    def __init__(self, slopes, motion, tangents, begins, course, when):
        super().__init__(slopes, motion, tangents)
        self.course = course
        switch = self._steps[:, KIND] == SWITCH
        phase, speed = (one[self._steps[switch, MET]] for one in course)
        own = np.array([np.ones(phase.size), -phase])
        self._times[switch] = np.divide(own, speed, out=np.zeros_like(own), where=speed > 0.0).T
        samples = np.zeros((when.size, self.k, 4 * len(self.codes)))
        tables = self._recording(0, 1, len(motion.events))
        self.tables = tables._replace(begins=begins, when=when, samples=samples)

    def shift(self, bound):
        """Return by what the bound of a revolution at the start of a segment moves, shape (k,)."""
        phase, speed = (one[bound] for one in self.course)
        return self.slopes.course * (-phase / speed if speed > 0.0 else 0.0)

    def contacts(self, i):
        """Return (codes, segments) at the start of an interval, or the end."""
        if i == len(self.motion.states):
            return self.codes, self.segments
        return self._met[self._which[self._begins[i]]]

    def revolution(self, i, j, shifts, tables, ends):
        """Go through intervals i to j of a revolution whose bounds move by `shifts`, or not.

        `tables` are best, extrema, times and apart of `recorded_slopes.Tables`, the integrals of
        the forces, shape (m, k), and the change of the duration, (k,).
        """
        m, size = len(self.codes), self.slopes.size - len(self.codes)
        *own, area, whole = tables
        names = "best", "extrema", "times", "apart"
        self.tables = self.tables._replace(**dict(zip(names, own, strict=True)))
        self.tables.apart[:] |= np.array(self.contacts(i)[0]) == BACKLASH
        sums = self.block[self.q :, size : size + m]
        begin = sums.copy()
        self._bound(i, self.motion.states[i], -shifts[0], area, whole)
        self.tables.moved[:] = shifts[0]
        self._through(i, j, True)
        area += (sums - begin).T
        self._bound(j, self.block[0], shifts[1], area, whole)
        self.tables.moved[:] = shifts[1]
        if ends:
            end_record(self.tables, self.q, self._work)

    def _bound(self, i, z, shift, area, whole):
        if not shift.any():
            return
        (codes, segments), m = self.contacts(i), len(self.codes)
        forces = self.slopes.rows(codes, segments)[0][3 * m : 4 * m] @ z
        area += forces[:, None] * shift
        whole += shift
        for j, code in enumerate(codes):
            self.tables.times[1 - code, j] += shift


def of_matrices(model, names, found, table, state, per, along=None, waves=None, **push):
    """Return the `Slopes` of a run-up of a piecewise-linear model.

    Parameters as of `gearlib.models.propagators.course_slopes.of_pair`, the driver, and `table`,
    the summaries of the revolutions, shape (r, m, 10); `along`: what changes with each parameter,
    by default as of `Model.direction`; `waves`: what takes the samples instead, with ``when(i)``,
    their theta in a stretch, from its begin, and ``take(i, samples)``.
    """
    k, (rows, bounds) = len(names), rows_of(found)
    by = {one: np.array([float(name == one) for name in names]) for one in COURSE}
    along = along or [{} if name in COURSE else model.direction(name) for name in names]
    systems = _Systems(model, along, by, push)
    m, count, half = systems.m, int(rows[-1]) + 1, systems.half
    moving = systems.start(state, along, found[0].piece.speed)
    # Where the extrema are is looked for only where a curve comes near them.
    best = np.moveaxis(table[..., _EXTREMA], 2, 1)
    close = _CLOSE * np.abs(best).max(axis=1, keepdims=True)
    best = best - close * np.array([1.0, -1.0, 1.0, -1.0])[:, None]
    extrema, times = np.full((count, 4, m, k), np.nan), np.zeros((count, 4, m, k))
    area, whole, apart = np.zeros((count, m, k)), np.zeros((count, k)), np.zeros((count, m), bool)
    samples, met, grazing, one_sided, at, last = [], [], False, False, 0, None
    for number, one in enumerate(found):
        if one.piece is not last:
            last, loaded = one.piece, systems.of_piece(one.piece)
        (starts, first, which), *course = _segments(systems.base, one)
        slopes = systems.slopes(loaded, starts, first, which)
        tangents = np.vstack([moving, np.zeros((m, k))])
        begins = starts[first]
        steps = np.arange(per) / max(per, 1) * np.diff(begins)[:, None] + begins[:-1, None]
        when = waves.when(number) if waves else steps.ravel()
        walk = _Walk(slopes, _motion(one, m), tangents, begins, course, when)
        one_sided = one_sided or (at == 0 and walk.on_a_line(_ON_LINE))
        n = len(one.block)
        new = np.flatnonzero(np.diff(rows[at : at + n], prepend=-1)).tolist()
        for i, j in zip(new, [*new[1:], n], strict=True):
            row = rows[at + i]
            # The first segment of a stretch has no length.
            shifts = [walk.shift(max(first[p], 1)) * bounds[at + p] for p in (i, j)]
            tables = best[row], extrema[row], times[row], apart[row], area[row], whole[row]
            ends = bool(bounds[at + j]) or at + j == len(rows)
            walk.revolution(i, j, shifts, tables, ends)
        taken = np.moveaxis(walk.tables.samples.reshape(-1, k, 4, m), 1, 3)
        samples.append(waves.take(number, taken) if waves else taken)
        met.append(walk.tables.events)
        grazing = grazing or walk.grazing or bool(walk.tables.counts[TOUCHING])
        moving, at = walk.tangents[: 2 * half].copy(), at + n
    times[:, 3] = whole[:, None]
    return Slopes(
        np.concatenate(samples), np.concatenate(met), extrema, times, area, grazing, one_sided
    )
