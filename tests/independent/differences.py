"""Derivatives of motions and orbits by differences of motions in many digits.

In 34 digits a difference over a step of 1e-16 keeps 16 digits. Orbits are solved for in 50 digits
on both sides of the parameter.
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


def compute_variables(model, tuning, periods, state):
    """Return the differentiated variables of a run of the independent program, name -> list."""
    motion = move(model, tuning, periods, state, context=mp, recorded=1)
    record, is_train = motion.record, model["kind"] == "GearTrain"
    values_by_name = {"final_state": motion.state if is_train else motion.mesh_state()}
    for name, values in (("displacement", record.displacements), ("dynamic_force", record.forces)):
        values_by_name |= {
            f"{name}_max": list(map(max, values)),
            f"{name}_min": list(map(min, values)),
        }
    for i, name in enumerate(SHARES):
        values_by_name[name] = [times[i] / (2 * mp.pi) for times in record.durations]
    recorded_events = [event for event in motion.events if event.phase > 2 * mp.pi * (periods - 1)]
    values_by_name["event_phase"] = [event.phase for event in recorded_events]
    values_by_name["event_velocity"] = [event.rate for event in recorded_events]
    return values_by_name


def _find_numbers(model, name):
    """Return (part of a description, key) of each number that a named parameter changes."""
    field, _, owner = name.partition(" of ")
    if owner:
        kind, label = owner.split(" ", 1)
        items = model[{"body": "bodies", "mesh": "meshes"}[kind]]
        return [(next(item for item in items if item["name"] == label), field)]
    if name.endswith("]"):
        field, index = name[:-1].split("[")
        return [(model[field], int(index))]
    if model["kind"] == "DeadZoneOscillator":
        # Both sides share a damping or stiffness if their values are equal.
        kind = name.split("_")[-1]
        return [(model, key) for key in model if key.endswith(kind) and model[key] == model[name]]
    return [(model["pair"] if name in model.get("pair", ()) else model, name)]


def _perturb(model, tuning, name, fraction):
    """Return (description, tuning, step) with a parameter increased by a fraction of its size.

    A parameter of value 0 is increased by the fraction itself.
    """
    if name == "tuning":
        return model, mpf(tuning) * (1 + fraction), mpf(tuning) * fraction
    model = copy.deepcopy(model)
    if name == "backlash_ratio":
        model["backlash"] += fraction * model["load"] / mean_stiffness(model)
        return model, tuning, fraction
    for part, key in _find_numbers(model, name):
        step = fraction * (abs(part[key]) or 1)
        part[key] = step + part[key]
    return model, tuning, step


def of_run(model, tuning, periods, state, names):
    """Return the derivatives of all variables of a run, one list for each named parameter."""
    with mp.workdps(34):
        base_columns, rows = compute_variables(model, tuning, periods, state), []
        for name in names:
            changed_model, nu, step = _perturb(model, tuning, name, mpf(10) ** -16)
            changed_columns = compute_variables(changed_model, nu, periods, state)
            pairs = ((base_columns[key], changed_columns[key]) for key in VARIABLES)
            rows.append([(b - a) / step for pair in pairs for a, b in zip(*pair, strict=True)])
    return rows


def orbit_of(model, tuning, period, guess):
    """Return (state, derivatives of its change over the period) of an orbit of one coordinate."""
    equations = equations_of(model, tuning, mp)

    def change(*state):
        """Return the change of the state over the period."""
        end = program.move(equations, period, state).state
        return [a - b for a, b in zip(end, state, strict=True)]

    return program.newton(change, list(map(mpf, guess)), iterations=4)


def of_orbit(model, tuning, period, guess, names):
    """Return the derivatives of an orbit, one row for each named parameter.

    A row holds derivatives of the state, then of real and of imaginary parts of both multipliers.
    """
    rows = []
    for name in names:
        values_on_both_sides = []
        for sign in (-1, 1):
            changed_model, nu, step = _perturb(model, tuning, name, sign * mpf(10) ** -10)
            state, slopes = orbit_of(changed_model, nu, period, guess)
            roots = mp.eig(slopes + mp.eye(2), left=False, right=False)
            # The order is by falling size, and a positive imaginary part comes first.
            roots.sort(key=lambda mu: (-float(abs(mu)), -mp.im(mu)))
            values_on_both_sides.append([*state, *map(mp.re, roots), *map(mp.im, roots)])
        rows.append([(b - a) / (2 * step) for a, b in zip(*values_on_both_sides, strict=True)])
    return rows
