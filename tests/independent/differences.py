"""Derivatives of motions and orbits by differences of motions in many digits.

Of a step of 1e-16 in 34 digits one difference keeps 16. Orbits are solved for on both sides, in 50
digits.
"""

import copy

from mpmath import mp, mpf

from tests.independent import program
from tests.independent.equations import mean_stiffness
from tests.independent.systems import equations_of, move

mp.dps = 50
#: Variables of a run that are differentiated, in the order of the stored rows.
VARIABLES = (
    "displacement_max displacement_min dynamic_force_max dynamic_force_min event_phase "
    "event_velocity final_state contact_loss_fraction fraction_coast fraction_min_stiffness "
    "fraction_drive"
).split()
SHARES = ("fraction_drive", "contact_loss_fraction", "fraction_coast", "fraction_min_stiffness")


def columns(model, tuning, periods, state):
    """Return the variables of a run of the library that are differentiated, name -> list."""
    motion = move(model, tuning, periods, state, context=mp, recorded=1)
    record, several = motion.record, model["kind"] == "GearTrain"
    table = {"final_state": motion.state if several else motion.mesh_state()}
    for name, values in (("displacement", record.heights), ("dynamic_force", record.forces)):
        table |= {f"{name}_max": list(map(max, values)), f"{name}_min": list(map(min, values))}
    for i, name in enumerate(SHARES):
        table[name] = [times[i] / (2 * mp.pi) for times in record.durations]
    last = [event for event in motion.events if event.phase > 2 * mp.pi * (periods - 1)]
    table["event_phase"] = [event.phase for event in last]
    table["event_velocity"] = [event.rate for event in last]
    return table


def _places(model, name):
    """Return (part of a description, key) of each number that a parameter changes."""
    field, _, owner = name.partition(" of ")
    if owner:
        kind, label = owner.split(" ", 1)
        items = model[{"body": "bodies", "mesh": "meshes"}[kind]]
        return [(next(item for item in items if item["name"] == label), field)]
    if name.endswith("]"):
        field, index = name[:-1].split("[")
        return [(model[field], int(index))]
    if model["kind"] == "DeadZoneOscillator":
        # Equal dampings, or stiffnesses, of both sides follow.
        kind = name.split("_")[-1]
        return [(model, key) for key in model if key.endswith(kind) and model[key] == model[name]]
    return [(model["pair"] if name in model.get("pair", ()) else model, name)]


def _changed(model, tuning, name, share):
    """Return (description, tuning, step) with a parameter grown by a share of its size."""
    if name == "tuning":
        return model, mpf(tuning) * (1 + share), mpf(tuning) * share
    model = copy.deepcopy(model)
    if name == "backlash_ratio":
        model["backlash"] += share * model["load"] / mean_stiffness(model)
        return model, tuning, share
    for part, key in _places(model, name):
        step = share * (abs(part[key]) or 1)
        part[key] = step + part[key]
    return model, tuning, step


def of_run(model, tuning, periods, state, names):
    """Return the derivatives of a run's `columns` by the named parameters, a list for each."""
    with mp.workdps(34):
        base, rows = columns(model, tuning, periods, state), []
        for name in names:
            other, nu, step = _changed(model, tuning, name, mpf(10) ** -16)
            moved = columns(other, nu, periods, state)
            pairs = ((base[key], moved[key]) for key in VARIABLES)
            rows.append([(b - a) / step for pair in pairs for a, b in zip(*pair, strict=True)])
    return rows


def orbit_of(model, tuning, period, guess):
    """Return (state, derivatives of its change over the period) of an orbit of one degree."""
    equations = equations_of(model, tuning, mp)

    def change(*state):
        end = program.move(equations, period, state).state
        return [a - b for a, b in zip(end, state, strict=True)]

    return program.newton(change, list(map(mpf, guess)), iterations=4)


def of_orbit(model, tuning, period, guess, names):
    """Return the derivatives of an orbit by each parameter, a row for each.

    A row has those of the state, and of real and imaginary parts of both multipliers.
    """
    rows = []
    for name in names:
        both = []
        for sign in (-1, 1):
            other, nu, step = _changed(model, tuning, name, sign * mpf(10) ** -10)
            state, slopes = orbit_of(other, nu, period, guess)
            roots = mp.eig(slopes + mp.eye(2), left=False, right=False)
            # Largest first and with positive imaginary part first.
            roots.sort(key=lambda mu: (-float(abs(mu)), -mp.im(mu)))
            both.append([*state, *map(mp.re, roots), *map(mp.im, roots)])
        rows.append([(b - a) / (2 * step) for a, b in zip(*both, strict=True)])
    return rows
