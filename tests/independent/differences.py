"""Derivatives of motions and orbits by differences of motions in many digits.

Of a step of 1e-16 in 34 digits one difference keeps 16. Orbits are solved for on both sides, in 50
digits.
"""

import copy

import mpmath
from mpmath import mp, mpf

from tests.independent import program
from tests.independent.assembly import mean_stiffness
from tests.independent.systems import equations_of, move

mp.dps = 50
#: Differences of states, and of parameters on both sides or on one side, over their sizes.
_STEP, _TWO_SIDED, _ONE_SIDED = mpf(10) ** -22, mpf(10) ** -10, mpf(10) ** -16


def columns(model, tuning, periods, state):
    """Return the variables of a run of the library that are differentiated, name -> list."""
    motion = move(model, tuning, periods, state, context=mp, recorded=1)
    record = motion.record
    several = model["kind"] == "GearTrain"
    table = {"final_state": list(motion.state if several else motion.mesh_state())}
    for name, values in (("displacement", record.heights), ("dynamic_force", record.forces)):
        table[f"{name}_max"] = [max(contact) for contact in values]
        table[f"{name}_min"] = [min(contact) for contact in values]
    for i, name in enumerate(("normal", "backlash", "inverse", "min_stiffness")):
        table[f"fraction_{name}"] = [times[i] / (2 * mp.pi) for times in record.durations]
    last = [event for event in motion.events if event.phase > 2 * mp.pi * (periods - 1)]
    table["event_phase"] = [event.phase for event in last]
    table["event_velocity"] = [event.rate for event in last]
    return table


def fields_of(model, name):
    """Return the fields that depend on a parameter: path in the description -> derivative."""
    if " of " in name:
        field, rest = name.split(" of ", 1)
        kind, label = rest.split(" ", 1)
        group = {"body": "bodies", "mesh": "meshes"}[kind]
        return {(group, [item["name"] for item in model[group]].index(label), field): 1}
    if "[" in name:
        field, index = name[:-1].split("[")
        return {(field, int(index)): 1}
    if model["kind"] == "DeadZoneOscillator":
        followers = {
            "upper_stiffness": ["lower_stiffness"],
            "damping": ["upper_damping", "lower_damping"],
        }[name]
        return {(key,): 1 for key in (name, *followers) if model[key] == model[name]}
    root = ("pair",) if name in model.get("pair", ()) else ()
    if name == "backlash_ratio":
        return {(*root, "backlash"): model["load"] / mean_stiffness(model)}
    return {(*root, name): 1}


def changed(model, tuning, name, share):
    """Return (description, tuning, step) with a parameter grown by a share of its size."""
    if name == "tuning":
        return model, mpf(tuning) * (1 + share), mpf(tuning) * share
    other, step = copy.deepcopy(model), share
    for path, slope in fields_of(model, name).items():
        inner = other
        for key in path[:-1]:
            inner = inner[key]
        step = share if name == "backlash_ratio" else share * (abs(inner[path[-1]]) or 1)
        inner[path[-1]] = slope * step + inner[path[-1]]
    return other, tuning, step


def of_run(model, tuning, periods, state, names):
    """Return the derivatives of a run's `columns` by the named parameters, a list for each."""
    with mp.workdps(34):
        base, rows = columns(model, tuning, periods, state), []
        for name in names:
            other, nu, step = changed(model, tuning, name, _ONE_SIDED)
            moved, row = columns(other, nu, periods, state), []
            for key in sorted(base):
                same = len(moved[key]) == len(base[key])
                values = moved[key] if same else [mp.nan] * len(base[key])
                row += [(b - a) / step for a, b in zip(base[key], values, strict=True)]
            rows.append(row)
    return rows


def _flow(model, tuning, period):
    """Return the motion of a model of one degree over some periods, a function of its state."""
    equations = equations_of(model, tuning, mp)
    return lambda state: program.move(equations, period, state).state


def orbit_of(model, tuning, period, guess, iterations=4):
    """Return (state, map of small deviations) of an orbit of one degree of freedom."""
    start = list(map(mpf, guess))
    return program.orbit(_flow(model, tuning, period), start, _STEP, iterations)


def _central_difference(model, tuning, name, numbers):
    """Return the derivatives by a parameter of `numbers(description, tuning)`, a list."""
    both = []
    for sign in (-1, 1):
        other, nu, step = changed(model, tuning, name, sign * _TWO_SIDED)
        both.append(numbers(other, nu))
    return [(b - a) / (2 * step) for a, b in zip(*both, strict=True)]


def of_orbit(model, tuning, period, guess, names):
    """Return the derivatives of an orbit by each parameter, a row for each.

    A row has those of the state, and of real and imaginary parts of both multipliers.
    """

    def orbit_numbers(other, nu):
        state, matrix = orbit_of(other, nu, period, guess)
        # Largest first and with positive imaginary part first.
        roots = program.multipliers(matrix)
        roots.sort(key=lambda mu: (-float(abs(mu)), -mpmath.im(mu)))
        return [*state, *map(mpmath.re, roots), *map(mpmath.im, roots)]

    return [_central_difference(model, tuning, name, orbit_numbers) for name in names]
