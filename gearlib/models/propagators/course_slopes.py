"""What a run-up changes by with parameters of its model and of its course; a pair in closed forms.

All is in static deflections and natural time of the model as it is: with a parameter these units
stay, so that what is found has the scales of the run-up itself, at fixed instants.
"""

import math
from typing import NamedTuple

import numpy as np

from gearlib.kernels.closed_form.arc_tangents import (
    DECAY,
    DRAG,
    EQUILIBRIUM,
    GAP,
    PULL,
    RATES,
    SQUARE,
    STIFFNESS,
)
from gearlib.kernels.closed_form.course_tangents import TIMES, follow_stretch
from gearlib.kernels.closed_form.course_waves import OF_ACCELERATION, Waves, add_jump
from gearlib.kernels.closed_form.mesh_constants import mesh
from gearlib.models.derivatives import START, STEP
from gearlib.models.propagators.closed_form import ratios

#: What a course changes by, beside the parameters of the model.
COURSE = {
    "speed": ("1", "factor of all speeds of the course"),
    "driven_mass": ("kg", "inertia of what the mesh drives, over the square of its base radius"),
    "base_radius": ("m", "base radius of the gear whose teeth count"),
}


class Slopes(NamedTuple):
    """Derivatives of a run-up, k of them: r revolutions, s samples, e events, m meshes."""

    samples: np.ndarray  #: displacement, velocity, acceleration, force, shape (s, 4, m, k)
    events: np.ndarray  #: theta and velocity, shape (e, 2, k)
    extrema: np.ndarray  #: of displacement and force, largest and least, shape (r, 4, m, k)
    times: np.ndarray  #: in normal mesh, backlash, inverse mesh, and all, shape (r, 4, m, k)
    area: np.ndarray  #: integral of the force over theta, shape (r, m, k)
    grazing: bool
    one_sided: bool


def unknown(found, meshes, names, per):
    """Return the `Slopes` of a run-up that could not go on: no numbers."""
    k, m, count = len(names), meshes, int(rows_of(found)[0][-1]) + 1
    intervals, events = sum(len(one.block) for one in found), sum(len(one.events) for one in found)
    shapes = (intervals * per, 4, m, k), (events, 2, k), *[(count, 4, m, k)] * 2, (count, m, k)
    return Slopes._make([*(np.full(shape, math.nan) for shape in shapes), False, False])


def rows_of(found):
    """Return (row of the revolution of each interval, whether one begins at each bound)."""
    number = np.concatenate([one.block for one in found])
    new = np.diff(number, prepend=-1) != 0
    return np.cumsum(new) - 1, np.append(new, False)


def of_run_up(model, names, found, table, driver, **course):
    """Return the `Slopes` of a run-up; parameters as of `of_pair` and of `of_matrices`."""
    steps = not any(one.piece.slope for one in found)
    if model.propagators["exact"] == "closed_form" and steps:
        return of_pair(model, names, found, **course)
    from gearlib.models.propagators.course_matrices import of_matrices

    return of_matrices(model, names, found, table, driver=driver, **course)


def of_pair(pair, names, found, state, per, driven_mass, base_radius, waves=None):
    """Return the `Slopes` of a run-up of a `GearPair` whose load changes by steps only.

    Parameters
    ----------
    pair : GearPair
    names : sequence of str
        Of `GearPair.derivatives` without the tuning, and of `COURSE`.
    found : list of gearlib.models.propagators.courses.Stretch
        Of the run-up, with samples.
    state : tuple of float
        Displacement and dx/dtau at the start.
    per : int
        Samples in each interval whose derivatives are asked for.
    driven_mass, base_radius : float
        As of `gearlib.run_up`; the radius may be None.
    waves : Waves, optional
        Fourier integrals whose derivatives are filled.
    """
    k, (rows, bounds) = len(names), rows_of(found)
    constants, own = mesh(ratios(pair), 1.0), _Constants(pair, names, driven_mass, base_radius)
    begin = found[0].piece.speed
    tangents = np.zeros((2, k))
    tangents[0] = state[0] * own.length + own.named("initial_displacement")
    tangents[1] = state[1] * (own.length + own.named("speed")) + own.named("initial_velocity")
    tangents[1] *= begin
    on_line = pair.damping_ratio != pair.backlash_damping_ratio and state[0] in pair.flank_lines
    line = own.rates[GAP] if state[0] else 0.0
    one_sided = bool(on_line and (tangents[0] + line).any())
    moves = np.array([own.half_high, own.named("speed")])
    events = np.concatenate([one.events for one in found])
    first = found[0].samples
    contact = int(events[0, 2] if len(events) else first[0, 0, 3])
    count = int(rows[-1]) + 1
    best = np.tile([-math.inf, math.inf, -math.inf, math.inf], (count, 1))
    extrema, times = np.zeros((count, 4, k)), np.zeros((count, TIMES, k))
    area, grazing, at = np.zeros((count, k)), False, 0
    samples, met, before = [], [], 0.0
    if waves is None:
        waves = Waves(0, 1.0, 1.0, 1.0, np.zeros((1, 2, 1)), np.zeros((0, 2, 1, k)))
    for one in found:
        n, piece = len(one.block), one.piece
        # Samples of the run at the starts of intervals: their states.
        start = one.samples[:: len(one.samples) // n, 0, :2].copy()
        force, rates = own.of_piece(piece)
        if at and waves.what == OF_ACCELERATION:
            # It jumps with the load, at a phase that moves with the speed.
            phase = float(one.phase[0])
            add_jump(phase, (before - force) * phase * moves[1], waves)
        before = force
        samples.append(np.zeros((n * per, 4, k)))
        met.append(np.zeros((len(one.events), 2, k)))
        contact, touches = follow_stretch(
            loaded(constants, force),
            rates,
            own.mass,
            moves,
            (one.phase, piece.speed_at(one.phase), one.theta, piece.acceleration),
            (rows[at : at + n], bounds[at : at + n + 1]),
            start,
            contact,
            np.ascontiguousarray(one.events[:, [5, 6, 3]]),
            tangents,
            per,
            (samples[-1], met[-1], best, extrema, times, area),
            waves,
        )
        grazing, at = grazing or touches, at + n
    return Slopes(
        np.concatenate(samples)[:, :, None],
        np.concatenate(met),
        extrema[:, :, None],
        times[:, :, None],
        area[:, None],
        grazing,
        one_sided,
    )


def loaded(constants, force):
    """Return the constants of a mesh under a share of its load."""
    low, high = (
        one._replace(equilibrium=force * one.equilibrium) for one in (constants.low, constants.high)
    )
    return constants._replace(low=low, high=high, pull=force * constants.pull)


class _Constants:
    """What the constants of a mesh change by, in units that stay, for each of some names."""

    def __init__(self, pair, names, driven_mass, base_radius):
        self.pair, self.names = pair, names
        speed, length = pair.mean_eigenfrequency, pair.static_deflection
        twins = [
            pair.complex_step({} if name in (*COURSE, *START) else pair.direction(name))
            for name in names
        ]

        def of(value):
            found = np.array([value(one) + 0j for one in twins]).imag / STEP
            # An infinite backlash stays infinite.
            return np.where(np.isfinite(found), found, 0.0)

        self.length = of(lambda one: one.static_deflection) / length
        self.mass = of(lambda one: one.reduced_mass) / pair.reduced_mass
        self.half_high = math.pi * of(lambda one: one.contact_ratio)
        rates = self.rates = np.zeros((RATES, len(names)))
        rates[DECAY] = of(lambda one: one.material_damping / one.reduced_mass) / (2.0 * speed)
        rates[DRAG] = of(lambda one: one.backlash_damping / one.reduced_mass) / (2.0 * speed)
        levels = [
            lambda one: one.stiffness_ratio * one.max_stiffness,
            lambda one: one.max_stiffness,
        ]
        for i, level in enumerate(levels):
            rates[SQUARE + i] = of(lambda one, f=level: f(one) / one.reduced_mass) / speed**2
            rates[STIFFNESS + i] = of(level) / pair.mean_stiffness
        rates[GAP] = of(lambda one: one.backlash) / length
        #: By a unit of force each: mass, and both levels.
        self._softer = [of(lambda one, f=level: 1.0 / f(one)) for level in levels]
        self._load = of(lambda one: one.load)
        # What a unit of d2tau/dtheta2 takes, and by what that changes.
        self._push = driven_mass * (base_radius or 0.0) * speed**2 / pair.teeth
        by = self.named("driven_mass") * (base_radius or 0.0)
        self._pushed = (by + driven_mass * self.named("base_radius")) * speed**2 / pair.teeth
        self._pushed += self._push * self.named("speed")

    def named(self, name):
        """Return 1 for one of the names and 0 for the others."""
        return np.array([float(one == name) for one in self.names])

    def of_piece(self, piece):
        """Return (share of the load, rates) on a piece of a course."""
        pair, rates = self.pair, self.rates.copy()
        force = pair.load * piece.load + self._push * piece.acceleration
        by = self._load * piece.load + self._pushed * piece.acceleration
        levels = pair.min_stiffness, pair.max_stiffness
        for i, (softer, level) in enumerate(zip(self._softer, levels, strict=True)):
            rates[EQUILIBRIUM + i] = (by / level + force * softer) / pair.static_deflection
        rates[PULL] = (by - force * self.mass) / pair.load
        return force / pair.load, rates
