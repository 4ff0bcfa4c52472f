"""Random models of every kind, each with a tuning and a state to start from, for hypothesis."""

import math
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from hypothesis import strategies as st

import gearlib
from gearlib import (
    DeadZoneOscillator,
    Fourier,
    GearPair,
    Harmonics,
    LoadSharingPair,
    OneDegreePair,
    SixDegreePair,
)
from gearlib.models.profiles import Steps
from tests.geometry.stages import fzg_c, gears_of_20_teeth
from tests.independent.equations import Piece
from tests.independent.program import first_codes
from tests.independent.series import Step
from tests.independent.systems import describe, equations_of
from tests.trains.random_trains import chain_with_everything, random_problem, symmetric_problem


class Case(NamedTuple):
    """A model with its tuning and initial state."""

    model: object
    tuning: float
    state: tuple


def between(low, high):
    """Return a strategy of numbers within two bounds, without subnormal numbers."""
    return st.floats(low, high, allow_subnormal=False)


def logarithmic(low, high):
    """Return a strategy of numbers that are uniform on a logarithmic scale between two bounds."""
    return between(math.log10(low), math.log10(high)).map(lambda power: 10.0**power)


TUNINGS = logarithmic(0.3, 2.5)
STATES = st.tuples(between(-3.0, 4.0), between(-2.0, 2.0))


@st.composite
def pairs(draw):
    """Draw a `GearPair` in SI units."""
    mass, stiffness, load = draw(logarithmic(0.1, 20)), draw(logarithmic(1e7, 1e9)), 3000.0
    damping_unit = 2.0 * math.sqrt(mass * stiffness)
    return GearPair(
        max_stiffness=stiffness,
        # At the ratio 1 there is no lower level, and next to 1 rounding decides which one is lower.
        stiffness_ratio=draw(between(0.3, 1.0 - 1e-9)),
        contact_ratio=draw(between(1.0, 2.0)),
        reduced_mass=mass,
        load=load,
        backlash=draw(st.just(math.inf) | between(0.2, 6.0)) * load / stiffness,
        material_damping=draw(between(0.0, 0.1)) * damping_unit,
        backlash_damping=draw(between(0.0, 0.1)) * damping_unit,
    )


@st.composite
def waves(draw, largest_amplitude):
    """Draw `Harmonics` of one to three cosines and sines with amplitudes up to `size`."""
    values = st.lists(between(-largest_amplitude, largest_amplitude), min_size=1, max_size=3)
    return Harmonics(tuple(draw(values)), tuple(draw(values)))


@st.composite
def nonlinear_pairs(draw):
    """Draw a `OneDegreePair` with all terms of Eq. (3)."""
    pair = draw(pairs())
    deflection, speed = pair.static_deflection, pair.static_deflection * pair.mean_eigenfrequency
    damping_unit = 2.0 * pair.reduced_mass * pair.mean_eigenfrequency
    small_ratio = between(0.0, 0.05)
    return OneDegreePair(
        pair=pair,
        quadratic_damping=draw(small_ratio) * damping_unit / speed,
        cubic_damping=draw(small_ratio) * damping_unit / speed**2,
        backlash_quadratic_damping=draw(small_ratio) * damping_unit / speed,
        backlash_cubic_damping=draw(small_ratio) * damping_unit / speed**2,
        quadratic_stiffness=draw(small_ratio) / deflection,
        cubic_stiffness=draw(small_ratio) / deflection**2,
        profile=draw(st.sampled_from([gearlib.Rectangular(), Fourier(5)])),
        excitation=draw(waves(0.3 * pair.load)),
        deviation=draw(waves(0.2 * deflection)),
    )


@st.composite
def oscillators(draw):
    """Draw a `DeadZoneOscillator` whose two sides differ."""
    phases = sorted(set(draw(st.lists(between(0.01, 6.2), min_size=1, max_size=3))))
    stiffness = [draw(between(0.5, 5.0)) for _ in phases]
    return DeadZoneOscillator(
        upper_edge=draw(between(-1.0, 1.0)),
        lower_edge=draw(between(-4.0, -1.0)),
        upper_stiffness=Steps(tuple(phases), tuple(stiffness)),
        lower_stiffness=draw(between(0.5, 5.0)),
        damping=draw(between(0.0, 0.2)),
        upper_damping=draw(between(0.0, 0.2)),
        lower_damping=draw(between(0.0, 0.2)),
        ground_stiffness=draw(between(0.0, 0.5)),
        load=draw(between(-1.0, 1.0)),
        forcing=draw(waves(0.5)),
        deviation=draw(waves(0.1)),
    )


@st.composite
def six_degrees(draw, rigid=False):
    """Draw a `SixDegreePair` with run-out, deviations and friction; `rigid` allows rigid axes."""
    pair = draw(pairs())
    pair = pair.replace(backlash=max(pair.backlash, 2.0 * pair.static_deflection))
    deflection, radius = pair.static_deflection, draw(between(0.03, 0.2))
    teeth = draw(st.sampled_from([(4, 6), (3, 3), (6, 3)]))
    radii = radius, radius * teeth[1] / teeth[0]
    factor = draw(between(1.0, 3.0))
    masses = tuple(pair.reduced_mass * f for f in (4.0 * factor, 5.0))
    bearings = pair.mean_stiffness * draw(between(0.05, 3.0))
    return SixDegreePair(
        pair=pair,
        base_radii=radii,
        inertias=tuple(
            2.0 * pair.reduced_mass * f * r**2 for f, r in zip((1.0, factor), radii, strict=True)
        ),
        masses=masses,
        bearing_stiffness=tuple(
            math.inf if rigid and draw(st.integers(0, 5)) == 0 else share * bearings
            for share in (1.0, 0.8, 1.2, 1.0)
        ),
        bearing_damping=(0.02 * math.sqrt(bearings * masses[0]),) * 4,
        eccentricities=tuple(draw(between(0.0, 0.2)) * deflection for _ in range(2)),
        run_out_phase=draw(between(0.0, 6.0)),
        teeth=teeth,
        deviation=draw(waves(0.1 * deflection)),
        coast_deviation=draw(waves(0.1 * deflection)),
        friction=(draw(between(0.0, 0.1)), draw(between(0.0, 0.1))),
        pitch_phase=draw(between(0.0, 6.0)),
        moving_backlash=draw(st.booleans()),
    )


@st.composite
def tooth_pairs(draw):
    """Draw a `LoadSharingPair` of gears given by their geometry."""
    stage = draw(st.sampled_from([fzg_c, gears_of_20_teeth]))()
    return LoadSharingPair.from_geometry(
        stage, torque=draw(between(50.0, 500.0)), damping_ratio=draw(between(0.0, 0.1))
    )


@st.composite
def trains(draw):
    """Draw the `Case` of a chain, a planetary train or a reducer."""
    seed = draw(st.integers(0, 2**32 - 1))
    rng = np.random.default_rng(seed)
    if seed % 4:
        model, tuning, state = random_problem(rng)
    else:
        model, tuning = chain_with_everything(rng), 0.9
        state = model.start_state("static")
        state[: state.size // 2] += rng.normal(0.0, 0.3, state.size // 2)
    return Case(model, tuning, tuple(state.tolist()))


def _cases(models, states=STATES):
    """Return a strategy of cases with models, tunings and initial states."""
    return st.builds(Case, models, TUNINGS, states)


CASES = {
    "gear pair": _cases(pairs()),
    "one degree": _cases(nonlinear_pairs()),
    "oscillator": _cases(oscillators()),
    "pairs of teeth": _cases(tooth_pairs()),
    "six degrees": _cases(six_degrees(rigid=True)),
    "train": trains(),
}


def random_trains_case(seed):
    """Return the random `Case` of a seed, by its remainder modulo 4.

    It is ordinary for 0, has coast sides that move with supports for 1, starts near a grazing for
    2, and has coinciding events for 3.
    """
    rng = np.random.default_rng(seed)
    if seed % 4 == 3:
        model, tuning, state = symmetric_problem(rng)
    else:
        model, tuning, state = random_problem(rng)
        if seed % 4 == 2:
            state = grazing_start(rng, model, tuning, state)
        if seed % 4 == 1:
            # The backlash is small, so that coast sides touch, but supports do not close it.
            flanks = {"moving_backlash": True, "backlash": 1.5 * model.static_deflection}
            model = model.replace(meshes=[replace(mesh, **flanks) for mesh in model.meshes])
    scale = np.repeat([1.0, tuning], model.size // 2)
    return Case(model, tuning, tuple((state / scale).tolist()))


def state_grazing_at_phase(equations, phase, contact, depth, q, v):
    """Return a start whose motion has a minimum of a drive-side distance, `depth`, at `phase`.

    At this phase the other coordinates are near (q, v), in units, and the motion is followed back
    to phase 0. The result is None if the distance has no minimum there.
    """
    instant, side = Piece(phase, phase, phase, 1.0), equations.contacts[contact].drive
    row = np.zeros(q.size)
    for i, x in side.row:
        row[i] = x
    q = q + row * (depth - equations.distance(side, q, phase)) / (row @ row)
    v = v - row * equations.distance(side, v, phase, order=1) / (row @ row)
    state, t = [*q.tolist(), *v.tolist()], phase
    codes, _ = first_codes(equations, instant, state, phase)
    codes[contact] = 1
    *_, curvature = Step(equations, instant, t, state, codes, phase).curves[side][:3]
    if curvature <= 0:
        return None
    while t > 0:
        # The phase in the middle decides on stiffness and friction.
        middle = phase / 2
        step = Step(equations, instant, t, state, codes, middle)
        h = step.length(t)
        state, t = step.at(-h), t - h
    return state


def grazing_start(rng, train, tuning, state):
    """Return an initial state of a train that nearly grazes a flank line.

    The distance of a mesh has an extremum 1e-10 to 1e-5 off its flank line. `state` is the centre
    of the random states that are tried.
    """
    equations, n = equations_of(describe(train), tuning), train.size // 2
    phase = 0.5 * min(train.segments.starts[1], 0.2)
    for _ in range(100):
        depth = rng.choice([-1.0, 1.0]) * 10.0 ** rng.uniform(-10.0, -5.0)
        q = state[:n] + rng.normal(0.0, 1.0, n)
        v = rng.normal(0.0, 1.0 / tuning, n)
        mesh_index = int(rng.integers(len(train.meshes)))
        grazing_state = state_grazing_at_phase(equations, phase, mesh_index, depth, q, v)
        if grazing_state is not None:
            return grazing_state * np.repeat([1.0, tuning], n)
    raise ValueError("no distance turns upwards")
