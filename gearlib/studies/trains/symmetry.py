"""Where the symmetric motion of equal planets in phase breaks, by exact multipliers.

N equal planets in phase may move alike; then sun, ring and carrier do not move sideways, and each
planet takes an N-th of what turns. So the symmetric motion is that of a train with one planet,
rigid supports of sun, ring and carrier, and an N-th of their inertias, torques and torsional
supports: kinetic energy, work and the forces of meshes and pins all divide by N. Its multipliers
are those of symmetric disturbances; those of all others only the full train has. What becomes of
the motion is asked from many starts beside it, see `gearlib.studies.trains.motions`.
"""

import dataclasses
import math

import numpy as np
import xarray as xr

from gearlib.analysis.orbits.shooting import NoOrbit, periodic_orbit
from gearlib.data import contact_states, status
from gearlib.data.result import result
from gearlib.models.trains.train import GearTrain
from gearlib.runs.run_arguments import MAX_EVENTS
from gearlib.runs.simulation import simulate
from gearlib.studies.many_starts import in_parallel, over_starts, starts
from gearlib.studies.trains import motions
from gearlib.studies.trains.train_stability import with_jump

#: What the multipliers of the symmetric motion say, in the order of the codes.
VERDICTS = ("no orbit", "stable", "symmetry breaks", "unstable in itself")
#: Residual of the lifted orbit in the full train, static deflections: more is no symmetric train.
_MISS = 1e-9
#: What is kept of the motions, for each mesh: median and range over the starts.
_SEEN = ("bounces", "load_sharing", "dynamic_force_max")
#: What is kept of the symmetric one.
_ALIKE = ("bounces", "dynamic_force_max")
#: Forces of a start 1e-9 beside agree to this: those of rounding to far less than a line is wide.
_SEEN_BESIDE = 1e-3
#: Central gears of the meshes of the reduced train, in order.
_CENTRAL = ("sun", "ring")


def reduced(train):
    """Return the train of one planet that moves as N equal planets in phase do.

    train: as `gearlib.planetary` makes it.

    ValueError if its planets are not alike or not in phase.
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

    state: shape (size,), symmetric state at tau = 0 of an orbit of one common period.

    Two complex arrays, largest first; the largest entry of the map between both spaces, which is
    rounding, and the largest residual of the orbit, static deflections.
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


def symmetric_orbits(small, tunings, settings):
    """Return the state of an orbit of one common period at each tuning, None where none is found.

    Where all starts of the reduced train settle on one such orbit it is that. Elsewhere the orbit
    of a neighbouring tuning leads to it, from below and then from above: from where a run without
    end happens to be, Newton's method would find now one orbit, now another or none.

    small: as of `reduced`; tunings: shape (t,); settings: as of `gearlib.studies.trains.motions`.
    """
    found = motions.from_rest(small, tunings, settings)
    once = [one.settled and one.periods[0] == small.repeats for one in found]
    states = [one.states[0] if own else None for one, own in zip(found, once, strict=True)]
    rising = np.argsort(tunings)
    for order in (rising, rising[::-1]):
        for before, i in zip(order, order[1:], strict=False):
            if states[i] is None and states[before] is not None:
                states[i] = _near(small, float(tunings[i]), states[before])
    return states


def _near(small, tuning, state):
    try:
        return periodic_orbit(small, tuning, guess=state, period=small.repeats).state
    except NoOrbit:
        return None


def _course(train, tuning, state, settings):
    """Return the forces after the first start, NaN where a start beside has others, and contacts.

    They are drawn as lines: so these must be the same to `_SEEN_BESIDE` for all that rounding does.
    """
    first = starts(train, state, settings | {"starts": 1})[0]
    recorded = settings["record_periods"]
    one, other = (
        simulate(
            train,
            tuning,
            periods=settings["shown_after"] + recorded,
            record_periods=recorded,
            samples_per_period=settings["samples_per_period"],
            initial_state=tuple(begin),
        )
        for begin in (first, motions.beside(first))
    )
    force, beside = one.dynamic_force.values, other.dynamic_force.values
    same = np.abs(force - beside).max() <= _SEEN_BESIDE * np.abs(force).max()
    return force if same else np.full_like(force, np.nan), one.contact.values


def compute(train, tunings, settings):
    """Return where the symmetric motion breaks, and what becomes of it.

    train: keyword arguments of `gearlib.planetary`; tunings: shape (t,), mesh frequencies over the
    reference frequency; settings (reference_frequency, Hz; teeth: (z_s, z_r); jump: of the
    stiffness over its mean; shown: the tuning of the course; shown_after, mesh periods;
    samples_per_period; those of `gearlib.studies.trains.motions`).

    Motions are those from all starts beside the symmetric one, as of `motions.summarise`; forces
    and contacts those at the tuning that is shown, after the first start. `GearTrain.layout` too.
    """
    train = with_jump(train | {"teeth": settings["teeth"]}, settings["jump"], settings)
    small = reduced(train)
    lift = lifting(train, small)
    tunings = np.asarray(tunings, float)
    states = symmetric_orbits(small, tunings, settings)
    ranges = [f"{name}{end}" for name in _SEEN for end in ("", "_low", "_high")]
    names = [*ranges, *(f"symmetric_{name}" for name in _ALIKE)]
    found = {name: np.full((tunings.size, len(train.meshes)), np.nan) for name in names}
    shares = {name: np.zeros(tunings.size) for name in motions.SHARES}
    largest, verdict = np.full((2, tunings.size), np.nan), np.zeros(tunings.size, np.int8)
    samples = settings["record_periods"] * settings["samples_per_period"]
    course = np.full((samples, len(train.meshes)), np.nan)
    contact = np.full(course.shape, contact_states.NORMAL, np.int8)

    def look(i):
        if states[i] is None:
            return None
        inside, outside, _, miss = multipliers(train, tunings[i], lift @ states[i])
        if miss > _MISS:
            return None
        largest[:, i] = abs(inside[0]), abs(outside[0])
        begin = starts(train, lift @ states[i], settings)
        if largest[:, i].max() < 1.0:
            # Starts beside it come back: that is its multipliers' word.
            begin = np.tile(lift @ states[i], (settings["first_starts"], 1))
        return motions.ends(train, float(tunings[i]), begin, settings)

    for i, becomes in enumerate(in_parallel(look, range(tunings.size))):
        if becomes is None:
            continue
        verdict[i] = 3 if largest[0, i] > 1.0 else 2 if largest[1, i] > 1.0 else 1
        one = motions.summarise(train, [becomes], settings, _SEEN).isel(tuning=0)
        for name, values in over_starts(one, _SEEN).items():
            found[name][i] = values
        for name in motions.SHARES:
            shares[name][i] = one[name]
        own = simulate(small, tunings[i], periods=1, initial_state=tuple(states[i]))
        for name in _ALIKE:
            alike = dict(zip(_CENTRAL, own[name].values, strict=True))
            found[f"symmetric_{name}"][i] = [alike[mesh.split()[0]] for mesh in train.mesh_names]
        if np.isclose(tunings[i], settings["shown"]):
            course, contact = _course(train, tunings[i], lift @ states[i], settings)
    first = settings["shown_after"] * settings["samples_per_period"]
    phase = (first + np.arange(samples)) * (2.0 * math.pi / settings["samples_per_period"])
    whole = {"settled": np.int8, "motion_count": np.int32, "period": np.int32}
    data = {
        "verdict": ("tuning", verdict, status.flags_of(VERDICTS)),
        "symmetric_multiplier": ("tuning", largest[0]),
        "other_multiplier": ("tuning", largest[1]),
        **{
            name: ("tuning", values.astype(whole.get(name, float)))
            for name, values in shares.items()
        },
        **{name: (("tuning", "mesh"), values) for name, values in found.items()},
        "dynamic_force": (("phase", "mesh"), course),
        "contact": (("phase", "mesh"), contact),
        "shown": settings["shown"],
        "reference_frequency": settings["reference_frequency"],
    }
    coords = {"tuning": tunings, "mesh": list(train.mesh_names), "phase": phase}
    title = "Symmetry breaking of a planetary train"
    data = xr.Dataset(data, coords).merge(train.layout())
    dataset = result(title, train, data, method="exact", **settings)
    dataset["settled"].attrs |= motions.SETTLED_FLAGS
    return dataset
