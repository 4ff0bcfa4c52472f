"""Where the symmetric motion of equal planets in phase breaks, by exact multipliers.

N equal planets in phase may move alike; then sun, ring and carrier do not move sideways, and each
planet takes an N-th of what turns. So the symmetric motion is that of a train with one planet,
rigid supports of sun, ring and carrier, and an N-th of their inertias, torques and torsional
supports: kinetic energy, work and the forces of meshes and pins all divide by N. Its multipliers
are those of symmetric disturbances; those of all others only the full train has.
"""

import dataclasses
import math

import numpy as np
import xarray as xr

from gearlib.analysis.orbits.shooting import NoOrbit, periodic_orbit
from gearlib.data import provenance, status
from gearlib.data.variables import describe
from gearlib.models.trains.train import GearTrain
from gearlib.runs.run_arguments import MAX_EVENTS
from gearlib.runs.simulation import simulate
from gearlib.runs.sweeping import sweep
from gearlib.studies.trains.stability import with_jump

#: What the multipliers of the symmetric motion say, in the order of the codes.
VERDICTS = ("no orbit", "stable", "symmetry breaks", "unstable in itself")
#: Residual of the lifted orbit in the full train, static deflections: more is no symmetric train.
_MISS = 1e-9
#: What is kept of the motions, for each mesh.
_SEEN = ("bounces", "load_sharing", "dynamic_force_max")
_ALIKE = ("bounces", "dynamic_force_max")
#: Central gears of the meshes of the reduced train, in order.
_CENTRAL = ("sun", "ring")


def reduced(train):
    """Return the train of one planet that moves as N equal planets in phase do.

    Parameters
    ----------
    train : gearlib.GearTrain
        As `gearlib.planetary` makes it.

    Raises
    ------
    ValueError
        If its planets are not alike or not in phase.
    """
    carried = [body for body in train.bodies if body.carrier]
    n, first = len(carried), carried[0]
    for body in carried[1:]:
        alike = dataclasses.replace(body, name=first.name, angle=first.angle) == first
        ours, theirs = (_meshes(train, one.name) for one in (first, body))
        if not alike or [train.phases[a] for a in ours] != [train.phases[b] for b in theirs]:
            raise ValueError(
                f"planet {body.name} is not allowed: all must be alike and in phase, with z_s and "
                "z_r multiples of their number"
            )
    still = dict(support_stiffness=math.inf, support_damping=0.0)
    bodies = []
    for body in train.bodies:
        if body is first:
            bodies.append(body)
        elif not body.carrier:
            parts = ("inertia", "torque", "torsional_stiffness", "torsional_damping")
            share = {name: getattr(body, name) / n for name in parts}
            bodies.append(dataclasses.replace(body, **share, **still))
    own = [mesh for mesh in train.meshes if mesh.name in _meshes(train, first.name)]
    return GearTrain(
        bodies=bodies,
        meshes=[dataclasses.replace(mesh, phase=train.phases[mesh.name]) for mesh in own],
        reference_frequency=train.reference_angular_frequency / (2.0 * math.pi),
        carrier_ratio=train.carrier_ratio,
    )


def _meshes(train, body):
    """Return the names of the meshes of a body."""
    return [mesh.name for mesh in train.meshes if body in (mesh.pinion, mesh.wheel)]


def lifting(train, small):
    """Return the state of the train that belongs to one of its reduced train, as a matrix."""
    first = next(body.name for body in small.bodies if body.carrier)
    theirs = {name: i for i, name in enumerate(small.structure.coordinates)}
    matrix = np.zeros((len(train.structure.coordinates), len(theirs)))
    for i, (body, axis) in enumerate(train.structure.coordinates):
        own = (first if train.by_name[body].carrier else body), axis
        if own in theirs:
            matrix[i, theirs[own]] = 1.0
    return np.kron(np.eye(2), matrix)


def multipliers(train, tuning, state):
    """Return (those of symmetric disturbances, all others, coupling, residual) of an orbit.

    Parameters
    ----------
    train : gearlib.GearTrain
    tuning : float
    state : array_like, shape (size,)
        Symmetric state at tau = 0 of an orbit of one common period.

    Returns
    -------
    tuple
        Two complex arrays, largest first; the largest entry of the map between both spaces, which
        is rounding, and the largest residual of the orbit, static deflections.
    """
    end, maps, code = train.propagator(tuning).maps(np.array(state), train.repeats, MAX_EVENTS)
    if code != status.OK:
        raise NoOrbit(f"the motion could not go on: {status.MESSAGES[code]}")
    reduce, lift = train.reduction()
    matrix = np.eye(len(reduce))
    for one in maps:
        matrix = reduce @ one @ lift @ matrix
    alike = symmetric(train)
    parts = [np.linalg.eigvals(matrix[np.ix_(own, own)]) for own in (alike, ~alike)]
    cross = max(np.abs(matrix[np.ix_(a, ~a)]).max() for a in (alike, ~alike))
    ordered = (part[np.argsort(-np.abs(part))] for part in parts)
    return *ordered, cross, float(np.abs(reduce @ (end - state)).max())


def symmetric(train):
    """Return which modal coordinates are symmetric motions, displacements then rates, bool."""
    kinds = train.modes().mode_kind.values[train.free_motions.shape[1] :]
    return np.tile(kinds == "rotational", 2)


def _aside(train):
    """Return a turn of one planet less what of it is alike for all, of largest entry 1."""
    reduce, lift = train.reduction()
    alike = symmetric(train)
    turn = np.zeros(train.size)
    planet = next(body.name for body in train.bodies if body.carrier)
    turn[train.structure.coordinates.index((planet, "u"))] = 1.0
    rest = lift[:, ~alike] @ (reduce[~alike] @ turn)
    return rest / np.abs(rest).max()


def compute(train, tunings, settings):
    """Return where the symmetric motion breaks, and what becomes of it.

    Parameters
    ----------
    train : dict
        Keyword arguments of `gearlib.planetary`.
    tunings : sequence of float, shape (t,)
        Mesh frequencies over the reference frequency.
    settings : dict
        reference_frequency, Hz; teeth: (z_s, z_r); jump: of the stiffness over its mean;
        disturbance: of the symmetric orbit, static deflections; settle, record_periods: mesh
        periods of the motion that follows; shown: the tuning of its course; samples_per_period.

    Returns
    -------
    xarray.Dataset
        Over tuning: the largest multipliers of symmetric and other disturbances, the verdict;
        over tuning and mesh what the disturbed motion does: bounces, load sharing, largest force.
        Over mesh and phase: the forces at the tuning that is shown.
    """
    train = with_jump(train | {"teeth": settings["teeth"]}, settings["jump"], settings)
    small = reduced(train)
    lift = lifting(train, small)
    tunings = np.asarray(tunings, float)
    run = {name: settings[name] for name in ("record_periods", "samples_per_period")}
    rest = {"initial_state": "static", "periods": settings["settle"]}
    settled = sweep(small, tunings, record_periods=1, threads=1, **rest)
    aside = settings["disturbance"] * _aside(train)
    largest = np.full((2, tunings.size), np.nan)
    verdict, period = np.zeros(tunings.size, np.int8), np.zeros(tunings.size, np.int32)
    shape = tunings.size, len(train.meshes)
    names = [*_SEEN, *(f"symmetric_{name}" for name in _ALIKE)]
    found = {name: np.full(shape, np.nan) for name in names}
    samples = run["record_periods"] * run["samples_per_period"]
    course = np.full((samples, len(train.meshes)), np.nan)
    for i, tuning in enumerate(tunings):
        try:
            orbit = periodic_orbit(small, tuning, guess=settled.final_state.values[i])
            state = lift @ orbit.state
            inside, outside, _, miss = multipliers(train, tuning, state)
        except NoOrbit:
            continue
        if miss > _MISS:
            continue
        largest[:, i] = abs(inside[0]), abs(outside[0])
        verdict[i] = 3 if largest[0, i] > 1.0 else 2 if largest[1, i] > 1.0 else 1
        own = simulate(small, tuning, periods=1, initial_state=tuple(orbit.state))
        becomes = simulate(
            train,
            tuning,
            periods=settings["settle"] + settings["record_periods"],
            initial_state=tuple(state + aside),
            **run,
        )
        period[i] = becomes.period
        for name in _SEEN:
            found[name][i] = becomes[name]
        for name in _ALIKE:
            alike = dict(zip(_CENTRAL, own[name].values, strict=True))
            found[f"symmetric_{name}"][i] = [alike[mesh.split()[0]] for mesh in train.mesh_names]
        if np.isclose(tuning, settings["shown"]):
            course = becomes.dynamic_force.values
    first = settings["settle"] * run["samples_per_period"]
    phase = (first + np.arange(samples)) * (2.0 * math.pi / run["samples_per_period"])
    dataset = xr.Dataset(
        {
            "verdict": ("tuning", verdict),
            "symmetric_multiplier": ("tuning", largest[0]),
            "other_multiplier": ("tuning", largest[1]),
            "period": ("tuning", period),
            **{name: (("tuning", "mesh"), values) for name, values in found.items()},
            "dynamic_force": (("phase", "mesh"), course),
            "shown": settings["shown"],
            "reference_frequency": settings["reference_frequency"],
        },
        {"tuning": tunings, "mesh": list(train.mesh_names), "phase": phase},
    )
    dataset.attrs = provenance.attributes(
        "Symmetry breaking of a planetary train", train, method="exact", **settings
    )
    dataset = describe(dataset)
    dataset.verdict.attrs |= {
        "flag_values": np.arange(len(VERDICTS), dtype=np.int8),
        "flag_meanings": " ".join(words.replace(" ", "_") for words in VERDICTS),
    }
    return dataset
