"""The laws of motion of a train in balls, without its free rotation: matrices between events.

The state is z = (y, dy/dtheta, 1, cos, sin, ...) with y in static deflections and theta the phase
over nu, as in `gearlib.kernels.several_meshes.train_system`; between events z' = A z. Motions V
that no stiffness resists are taken out: of as many coordinates q_p as there are such motions the
others are counted from, y = q_e - V_e q_p with V_p = I. K V = 0, b V = 0 and D V = 0 are taken as
exact: the numbers of a train have them up to their rounding only.

Matrices and functionals are those of z = basis z~, with z~ near the natural modes: there a motion
is hardly more than a rotation of each pair of components, which widens boxes least.
"""

from fractions import Fraction

import numpy as np

from gearlib.analysis.proofs.arcs import ball_of
from gearlib.analysis.proofs.balls import flint
from gearlib.analysis.proofs.certificate_files import Uncertain
from gearlib.analysis.proofs.path import COAST, DRIVE
from gearlib.analysis.proofs.train_numbers import parts_of
from gearlib.kernels.codes import INVERSE, NORMAL

#: Of the largest entry: a free motion is free up to this, a thousand roundings of floats.
_FREE = 1e-13
#: Times that differ by less have exponentials that follow from each other at little cost.
_NEAR = 1e-6
#: How many of them are kept.
_KEPT = 64


class MatrixLaw:
    """The law of motion between two events, z' = A z."""

    #: Whether the motion of an arc is known as a whole: by pieces only.
    closed = False

    def __init__(self, matrix):
        self.matrix, self._known = matrix, []

    def flow(self, t):
        """Return the exponential of a time, from a known one at nearly the same time."""
        bits = flint().ctx.prec
        for at, power, known in self._known:
            if known == bits and abs(t - at) < _NEAR:
                return (self.matrix * (t - at)).exp() * power
        at = t if t.rad() < _NEAR**2 else t.mid()
        power = (self.matrix * at).exp()
        self._known = [*self._known[-_KEPT:], (at, power, bits)]
        return power if at is t else (self.matrix * (t - at)).exp() * power

    def go(self, z, t):
        """Return z after a time."""
        return self.flow(t) * z


class TrainLaws:
    """All matrices of a train at a tuning.

    ``kept``, ``fixed``    numbers of the coordinates y, and of those that are counted from
    ``size``               components of z
    ``basis``, ``inverse`` of the components z~ of laws and distances, shape (size, size)
    ``distances``          functionals over the flanks of every mesh, a row (1, size) each:
                           (coast side or None, drive side); ``rows``: the same over z
    ``segments``           (phase at which a segment begins, its number) within the common period,
                           which begins with the first
    ``frequencies``        of the harmonics, by phase; ``tuned``: whether the laws depend on the
                           tuning, because there are any
    """

    framed = True

    def __init__(self, model, tuning):
        module = flint()
        self.parts, self.tuning = parts_of(model), module.arb(tuning)
        self.repeats = model.repeats
        self._laws: dict = {}
        self._take_out_free_motions()
        meshes = self.parts.meshes
        self.frequencies = sorted({frequency for mesh in meshes for frequency in mesh.waves})
        self.tuned = bool(self.frequencies)
        self.mesh_names = tuple(mesh.name for mesh in meshes)
        self.moving = [mesh.moving for mesh in meshes]
        self.coordinates, self.derived = self.parts.names, self.parts.derived
        e = len(self.kept)
        self.size = 2 * e + 1 + 2 * len(self.frequencies)
        self._free = self._without_meshes()
        rate = self.parts.frequency
        self.rows, self._rates = [], []
        for mesh in meshes:
            rows = [self._distance(mesh, side) for side in (COAST, DRIVE)]
            self.rows.append(rows)
            # The rates of distances: the accelerations have no part in them.
            self._rates.append([None if row is None else row * self._free for row in rows])
        self._pushes = [
            [self._push(mesh.lines[side]) for side in (COAST, DRIVE)] for mesh in meshes
        ]
        self._across = [self._push(mesh.across) for mesh in meshes]
        for push, rates, mesh in zip(self._pushes, self._rates, meshes, strict=True):
            self._free += push[DRIVE] * (rates[DRIVE] * (mesh.film / rate))
        self._cut()
        self._take_modes()

    def _take_out_free_motions(self):
        module, parts = flint(), self.parts
        total = parts.in_contact()
        found = parts.linear()
        self.fixed = _pivots(found.free)
        self.kept = [i for i in range(len(total)) if i not in self.fixed]
        inverse = module.arb_mat(parts.structure.mass.tolist()).inv()
        e, n = len(self.kept), len(total)
        reduce = module.arb_mat(e, n)
        for i, row in enumerate(self.kept):
            reduce[i, row] = 1
        if self.fixed:
            inner = module.arb_mat(total[np.ix_(self.kept, self.kept)].tolist())
            outer = module.arb_mat(total[np.ix_(self.kept, self.fixed)].tolist())
            motions = inner.solve(outer) * -1
            for i in range(e):
                for j, column in enumerate(self.fixed):
                    reduce[i, column] = -motions[i, j]
            self._check_free(motions)
        self.reduce, self._respond = reduce, reduce * inverse
        middle = np.array([[float(value) for value in row] for row in reduce.tolist()])
        self._modes = middle @ found.shapes, np.sqrt(found.squares) / float(parts.frequency)

    def _check_free(self, motions):
        """Refuse a train whose free motion is none, or is damped."""
        module, parts = flint(), self.parts
        e, n = len(self.kept), len(parts.names)
        whole = module.arb_mat(n, len(self.fixed))
        for j, column in enumerate(self.fixed):
            whole[column, j] = 1
            for i in range(e):
                whole[self.kept[i], j] = motions[i, j]
        lines = [list(row) for mesh in parts.meshes for row in mesh.lines]
        for rows in (parts.structure.stiffness.tolist(), parts.structure.damping.tolist(), lines):
            largest = max(float(abs(value).upper()) for row in rows for value in row)
            for value in (module.arb_mat(rows) * whole).entries():
                if not abs(value) <= _FREE * largest * n:
                    raise Uncertain(
                        "model", "no proof is written for a train whose free rotation is damped"
                    )

    def _without_meshes(self):
        parts, rate, e = self.parts, self.parts.frequency, len(self.kept)
        free = flint().arb_mat(self.size, self.size)
        stiffness, damping = (
            self._respond * flint().arb_mat([[row[i] for i in self.kept] for row in matrix])
            for matrix in (parts.structure.stiffness, parts.structure.damping)
        )
        load = self._respond * flint().arb_mat([[value] for value in parts.structure.load])
        for i in range(e):
            free[i, e + i] = 1
            for j in range(e):
                free[e + i, j] = -stiffness[i, j] / rate**2
                free[e + i, e + j] = -damping[i, j] / rate
            free[e + i, 2 * e] = load[i, 0] / (rate**2 * parts.length)
        for j, frequency in enumerate(self.frequencies):
            c, turning = 2 * e + 1 + 2 * j, ball_of(frequency) * self.tuning
            free[c, c + 1], free[c + 1, c] = -turning, turning
        return free

    def _distance(self, mesh, side):
        constant, unit, e = mesh.constants[side], self.parts.length, len(self.kept)
        if constant is None:
            return None
        row = flint().arb_mat(1, self.size)
        for i, column in enumerate(self.kept):
            row[0, i] = mesh.lines[side][column]
        row[0, 2 * e] = constant / unit
        for j, frequency in enumerate(self.frequencies):
            if frequency in mesh.waves:
                for k, value in enumerate(mesh.waves[frequency][side]):
                    row[0, 2 * e + 1 + 2 * j + k] = value / unit
        return row

    def _take_modes(self):
        """Set the basis; an exact matrix of floats, its inverse in balls."""
        module, e = flint(), len(self.kept)
        shapes, rates = self._modes
        # Of like size, so that all components are.
        shapes = shapes / np.abs(shapes).max(axis=0)
        self.basis = module.arb_mat(self.size, self.size)
        for i in range(self.size):
            self.basis[i, i] = 1
        for i in range(e):
            for j in range(e):
                self.basis[i, j] = float(shapes[i, j])
                self.basis[e + i, e + j] = float(shapes[i, j] * rates[j])
        self.inverse = self.basis.inv()
        self.distances = [
            [None if row is None else row * self.basis for row in rows] for rows in self.rows
        ]

    def _push(self, row):
        """Return dz/dtheta by a unit of force against a functional, shape (size, 1)."""
        e, column = len(self.kept), flint().arb_mat(self.size, 1)
        response = self._respond * flint().arb_mat([[value] for value in row])
        for i in range(e):
            column[e + i, 0] = -response[i, 0]
        return column

    def _cut(self):
        """Set the segments: all in exact fractions of a period of the reference mesh."""
        found = {Fraction(0)}
        for mesh in self.parts.meshes:
            for cut in mesh.cuts():
                count = int(self.repeats * mesh.rate)
                found |= {(cut % 1 + k) / mesh.rate for k in range(count)}
        cuts = sorted(found)
        ends = [*cuts[1:], Fraction(self.repeats)]
        turn = 2 * flint().arb.pi()
        self.segments = [(turn * ball_of(cut), i) for i, cut in enumerate(cuts)]
        middles = [(a + b) / 2 for a, b in zip(cuts, ends, strict=True)]
        self._levels = [
            [
                [(mesh.low(side, at), mesh.sense(side, at)) for side in (COAST, DRIVE)]
                for mesh, at in ((mesh, middle * mesh.rate) for mesh in self.parts.meshes)
            ]
            for middle in middles
        ]

    def law(self, codes, segment):
        """Return the matrix A for the contact codes of all meshes on a segment."""
        levels = self._levels[segment]
        key = tuple(
            (code, *level[COAST if code == INVERSE else DRIVE]) if code else code
            for code, level in zip(codes, levels, strict=True)
        )
        name = flint().ctx.prec, key
        if name not in self._laws:
            matrix, rate = self._free * 1, self.parts.frequency
            for j, (mesh, code) in enumerate(zip(self.parts.meshes, codes, strict=True)):
                if not code:
                    continue
                side = DRIVE if code == NORMAL else COAST
                _, low, sense = key[j]
                elastic = self.rows[j][side] * (mesh.levels[low] / rate**2)
                more = self._rates[j][side] * ((mesh.damping - mesh.film) / rate)
                matrix += self._pushes[j][side] * (elastic + more)
                matrix += self._across[j] * (elastic * (mesh.friction[side] * sense))
            self._laws[name] = MatrixLaw(self.inverse * matrix * self.basis)
        return self._laws[name]

    def kick(self, before, after, z, row):
        """Return by what a crossing changes z~ over the distance, shape (size, 1)."""
        speed = (row * (before.matrix * z))[0, 0]
        return (after.matrix - before.matrix) * z * (1 / speed)

    def on_line(self, side):
        """Return None: a state at a contact stays as it is."""
        return None

    def start(self, state):
        """Return (y, dy/dtheta) of a state (q, dq/dtau) in floats, a list of balls."""
        arb_mat, n = flint().arb_mat, len(self.parts.names)
        halves = [
            self.reduce * arb_mat([[flint().arb(float(value))] for value in half])
            for half in (state[:n], state[n:])
        ]
        return [*halves[0].entries(), *(value * self.tuning for value in halves[1].entries())]

    def spread(self, box, scale):
        """Return displacements and dq/dtau of all coordinates, 0 of the fixed."""
        e, found = len(self.kept), [[flint().arb(0)] * len(self.coordinates) for _ in range(2)]
        for i, row in enumerate(self.kept):
            found[0][row], found[1][row] = box[i], box[e + i] * scale
        return found


def _pivots(motions):
    """Return as many coordinates as there are free motions, which tell these apart."""
    found, rest = [], np.array(motions)
    while rest.shape[1]:
        size = np.abs(rest).max(axis=1)
        # The first that is large enough, not the largest: rounding decides nothing.
        row = int(np.flatnonzero(size >= 0.5 * size.max())[0])
        column = int(np.abs(rest[row]).argmax())
        rest = rest - np.outer(rest[:, column] / rest[row, column], rest[row])
        rest = np.delete(rest, column, axis=1)
        found.append(row)
    return sorted(found)
