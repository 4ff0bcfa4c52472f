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
from tests.independent.equations import TimeInterval
from tests.independent.program import initial_contact_states
from tests.independent.series import Step
from tests.independent.systems import describe, equations_of
from tests.trains.random_trains import chain_with_everything, random_problem, symmetric_problem


class Case(NamedTuple):
    """A model with its tuning and initial state."""

    model: object
    tuning: float
    state: tuple


def floats_between(low, high):
    """Return a strategy of floats between two bounds, without subnormal numbers."""
    return st.floats(low, high, allow_subnormal=False)


def log_uniform(low, high):
    """Return a strategy of numbers between two bounds on a logarithmic scale."""
    return floats_between(math.log10(low), math.log10(high)).map(lambda power: 10.0**power)


TUNINGS = log_uniform(0.3, 2.5)
STATES = st.tuples(floats_between(-3.0, 4.0), floats_between(-2.0, 2.0))


@st.composite
def gear_pairs(draw):
    """Draw a `GearPair` in SI units."""
    mass = draw(log_uniform(0.1, 20))  # kg
    stiffness = draw(log_uniform(1e7, 1e9))  # N/m
    load = 3000.0  # N
    critical_damping = 2.0 * math.sqrt(mass * stiffness)
    return GearPair(
        max_stiffness=stiffness,
        # At a ratio of 1 both stiffness levels are equal, and rounding decides which one is lower.
        stiffness_ratio=draw(floats_between(0.3, 1.0 - 1e-9)),
        contact_ratio=draw(floats_between(1.0, 2.0)),
        reduced_mass=mass,
        load=load,
        backlash=draw(st.just(math.inf) | floats_between(0.2, 6.0)) * load / stiffness,
        material_damping=draw(floats_between(0.0, 0.1)) * critical_damping,
        backlash_damping=draw(floats_between(0.0, 0.1)) * critical_damping,
    )


@st.composite
def random_harmonics(draw, largest_amplitude):
    """Draw `Harmonics` with one to three cosines and sines up to `largest_amplitude`."""
    values = st.lists(floats_between(-largest_amplitude, largest_amplitude), min_size=1, max_size=3)
    return Harmonics(tuple(draw(values)), tuple(draw(values)))


@st.composite
def nonlinear_pairs(draw):
    """Draw a `OneDegreePair` with all terms of Eq. (3)."""
    pair = draw(gear_pairs())
    deflection = pair.static_deflection
    speed = deflection * pair.mean_eigenfrequency
    critical_damping = 2.0 * pair.reduced_mass * pair.mean_eigenfrequency
    small_ratio = floats_between(0.0, 0.05)
    return OneDegreePair(
        pair=pair,
        quadratic_damping=draw(small_ratio) * critical_damping / speed,
        cubic_damping=draw(small_ratio) * critical_damping / speed**2,
        backlash_quadratic_damping=draw(small_ratio) * critical_damping / speed,
        backlash_cubic_damping=draw(small_ratio) * critical_damping / speed**2,
        quadratic_stiffness=draw(small_ratio) / deflection,
        cubic_stiffness=draw(small_ratio) / deflection**2,
        profile=draw(st.sampled_from([gearlib.Rectangular(), Fourier(5)])),
        excitation=draw(random_harmonics(0.3 * pair.load)),
        deviation=draw(random_harmonics(0.2 * deflection)),
    )


@st.composite
def oscillators(draw):
    """Draw a `DeadZoneOscillator` whose two sides differ."""
    step_phases = sorted(set(draw(st.lists(floats_between(0.01, 6.2), min_size=1, max_size=3))))
    stiffness_levels = [draw(floats_between(0.5, 5.0)) for _ in step_phases]
    return DeadZoneOscillator(
        upper_edge=draw(floats_between(-1.0, 1.0)),
        lower_edge=draw(floats_between(-4.0, -1.0)),
        upper_stiffness=Steps(tuple(step_phases), tuple(stiffness_levels)),
        lower_stiffness=draw(floats_between(0.5, 5.0)),
        damping=draw(floats_between(0.0, 0.2)),
        upper_damping=draw(floats_between(0.0, 0.2)),
        lower_damping=draw(floats_between(0.0, 0.2)),
        ground_stiffness=draw(floats_between(0.0, 0.5)),
        load=draw(floats_between(-1.0, 1.0)),
        forcing=draw(random_harmonics(0.5)),
        deviation=draw(random_harmonics(0.1)),
    )


@st.composite
def six_degree_pairs(draw, allow_rigid_bearings=False):
    """Draw a `SixDegreePair` with run-out, deviations and friction.

    If `allow_rigid_bearings`, one bearing in six is rigid on average.
    """
    pair = draw(gear_pairs())
    pair = pair.replace(backlash=max(pair.backlash, 2.0 * pair.static_deflection))
    deflection, radius = pair.static_deflection, draw(floats_between(0.03, 0.2))
    teeth = draw(st.sampled_from([(4, 6), (3, 3), (6, 3)]))
    radii = radius, radius * teeth[1] / teeth[0]
    inertia_ratio = draw(floats_between(1.0, 3.0))
    masses = 4.0 * inertia_ratio * pair.reduced_mass, 5.0 * pair.reduced_mass
    bearing_stiffness = pair.mean_stiffness * draw(floats_between(0.05, 3.0))
    return SixDegreePair(
        pair=pair,
        base_radii=radii,
        inertias=tuple(
            2.0 * pair.reduced_mass * ratio * r**2
            for ratio, r in zip((1.0, inertia_ratio), radii, strict=True)
        ),
        masses=masses,
        bearing_stiffness=tuple(
            math.inf
            if allow_rigid_bearings and draw(st.integers(0, 5)) == 0
            else r * bearing_stiffness
            for r in (1.0, 0.8, 1.2, 1.0)
        ),
        bearing_damping=(0.02 * math.sqrt(bearing_stiffness * masses[0]),) * 4,
        eccentricities=tuple(draw(floats_between(0.0, 0.2)) * deflection for _ in range(2)),
        run_out_phase=draw(floats_between(0.0, 6.0)),
        teeth=teeth,
        deviation=draw(random_harmonics(0.1 * deflection)),
        coast_deviation=draw(random_harmonics(0.1 * deflection)),
        friction=(draw(floats_between(0.0, 0.1)), draw(floats_between(0.0, 0.1))),
        pitch_phase=draw(floats_between(0.0, 6.0)),
        moving_backlash=draw(st.booleans()),
    )


@st.composite
def load_sharing_pairs(draw):
    """Draw a `LoadSharingPair` of gears given by their geometry."""
    stage = draw(st.sampled_from([fzg_c, gears_of_20_teeth]))()
    return LoadSharingPair.from_geometry(
        stage,
        torque=draw(floats_between(50.0, 500.0)),
        damping_ratio=draw(floats_between(0.0, 0.1)),
    )


@st.composite
def train_cases(draw):
    """Draw the `Case` of a random train: a chain, a planetary train or a reducer."""
    seed = draw(st.integers(0, 2**32 - 1))
    rng = np.random.default_rng(seed)
    # One train in four is a chain that has every feature of a mesh.
    if seed % 4:
        model, tuning, state = random_problem(rng)
    else:
        model, tuning = chain_with_everything(rng), 0.9
        state = model.start_state("static")
        state[: state.size // 2] += rng.normal(0.0, 0.3, state.size // 2)
    return Case(model, tuning, tuple(state.tolist()))


def _case_strategy(models, states=STATES):
    """Return a strategy that draws a `Case` from strategies of models and initial states."""
    return st.builds(Case, models, TUNINGS, states)


CASE_STRATEGIES = {
    "gear pair": _case_strategy(gear_pairs()),
    "one degree": _case_strategy(nonlinear_pairs()),
    "oscillator": _case_strategy(oscillators()),
    "pairs of teeth": _case_strategy(load_sharing_pairs()),
    "six degrees": _case_strategy(six_degree_pairs(allow_rigid_bearings=True)),
    "train": train_cases(),
}


def random_train_case(seed):
    """Return the random `Case` of a train for a seed, whose kind depends on `seed % 4`.

    0: no special feature. 1: the backlash varies with the support motion, and coast sides come into
    contact. 2: the motion starts close to a grazing. 3: contact events coincide.
    """
    rng = np.random.default_rng(seed)
    if seed % 4 == 3:
        model, tuning, state = symmetric_problem(rng)
    else:
        model, tuning, state = random_problem(rng)
        if seed % 4 == 2:
            state = grazing_start(rng, model, tuning, state)
        if seed % 4 == 1:
            # The backlash is small enough for coast-side contact, but too large for the support
            # motion to close it.
            mesh_changes = {"moving_backlash": True, "backlash": 1.5 * model.static_deflection}
            model = model.replace(meshes=[replace(mesh, **mesh_changes) for mesh in model.meshes])
    scale = np.repeat([1.0, tuning], model.size // 2)
    return Case(model, tuning, tuple((state / scale).tolist()))


def state_grazing_at_phase(equations, phase, contact, depth, q, v):
    """Return an initial state from which a drive-side distance has the minimum `depth` at `phase`.

    The dimensionless displacements q and velocities v at `phase` are shifted so that the distance
    is `depth` and its rate is zero. The motion is then integrated back to phase 0. The result is
    None if the distance has a maximum instead of a minimum at `phase`.
    """
    # The interval has no length: it only gives the phase at which the motion is expanded.
    instant = TimeInterval(phase, phase, phase, 1.0)
    side = equations.contacts[contact].drive
    gradient = np.zeros(q.size)
    for i, coefficient in side.row:
        gradient[i] = coefficient
    squared_norm = gradient @ gradient
    q = q + gradient * (depth - equations.distance(side, q, phase)) / squared_norm
    v = v - gradient * equations.distance(side, v, phase, order=1) / squared_norm
    state, t = [*q.tolist(), *v.tolist()], phase
    contact_states, _ = initial_contact_states(equations, instant, state, phase)
    contact_states[contact] = 1
    *_, curvature = Step(equations, instant, t, state, contact_states, phase).curves[side][:3]
    if curvature <= 0:
        return None
    while t > 0:
        # Stiffness and friction are taken at the middle of the interval.
        middle = phase / 2
        step = Step(equations, instant, t, state, contact_states, middle)
        step_length = step.length(t)
        state, t = step.state_at(-step_length), t - step_length
    return state


def grazing_start(rng, train, tuning, state):
    """Return an initial state from which a mesh of a train nearly grazes its flank line.

    The smallest distance of the mesh from the line is 1e-10 to 1e-5 static deflections on either
    side. Random states around `state` are tried until one has such a minimum.
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
    raise ValueError("none of 100 random states has a minimum of a mesh distance")
