"""The system of a described model, as `equations` takes it; its equations written anew.

A description is a model as plain values, such as JSON has, from its public attributes.
"""

import dataclasses

import mpmath
import numpy as np

from tests.independent import program
from tests.independent.assembly import (
    System,
    contact,
    flank,
    harmonics,
    mean_stiffness,
    rectangular_profile,
    stiffness_profile,
    with_numbers_of,
)
from tests.independent.equations import Equations
from tests.independent.trains import Train


def describe(model):
    """Return a model as dicts, lists and numbers; ``kind`` is the name of its class.

    With the phases of the meshes of a train, which `tests/geometry/test_phases_by_teeth.py` tests.
    """
    description = _plain(model)
    if description["kind"] == "GearTrain":
        description |= {name: dict(getattr(model, name)) for name in ("phases", "inverse_phases")}
    return description


def _plain(value):
    if dataclasses.is_dataclass(value):
        names = [field.name for field in dataclasses.fields(value)]
        fields = {name: _plain(getattr(value, name)) for name in names}
        return {"kind": type(value).__name__, **fields}
    return [_plain(item) for item in value] if isinstance(value, (tuple, list)) else value


def system_of(model, tuning, context=mpmath.fp):
    """Return the `System` of a description at a tuning."""
    make = {
        "GearPair": _one_degree,
        "OneDegreePair": _one_degree,
        "DeadZoneOscillator": _oscillator,
        "SixDegreePair": _six_degrees,
        "GearTrain": Train,
    }[model["kind"]]
    return make(with_numbers_of(context, model), context.mpf(tuning), context)


def equations_of(model, tuning, context=mpmath.fp):
    """Return the equations of a description for the program."""
    return Equations(system_of(model, tuning, context).json(), context)


def start_of(model, tuning, state, context=mpmath.fp):
    """Return the state of all coordinates, in units, for a state as the library takes it.

    For six degrees that may be displacement and rate of the mesh alone.
    """
    system = system_of(model, tuning, context)
    if model["kind"] == "SixDegreePair" and len(state) != 2 * system.n:
        return _from_mesh(system, with_numbers_of(context, model), state)
    return list(state)


def move(model, tuning, periods, state=(0.0, 0.0), context=mpmath.fp, **options):
    """Return the motion of a description, see `program.move`."""
    equations = equations_of(model, tuning, context)
    return program.move(equations, periods, start_of(model, tuning, state, context), **options)


def _one_degree(model, tuning, context):
    """Return m y'' + k(y) y' + D2 |y'| y' + D3 y'^3 + C(tau) g(y) = F(tau) + m f''."""
    pair, system = model.get("pair", model), System(context, 1)
    #: what a `OneDegreePair` adds to its pair
    extra = model if "pair" in model else {}
    mean, m, unit = mean_stiffness(pair), pair["reduced_mass"], system.unit(0)
    system.length, system.force = pair["load"] / mean, mean
    system.speed = tuning * context.sqrt(mean / m)
    system.inertia(unit, m)
    system.load = unit * pair["load"]
    if extra:
        system.forces, system.shaking = (
            [(n, [a], [b]) for n, a, b in harmonics(extra[name])]
            for name in ("excitation", "deviation")
        )
    names = ("quadratic_damping", "cubic_damping")
    material = [pair["material_damping"], *(extra.get(name, 0) for name in names)]
    film = [pair["backlash_damping"], *(extra.get(f"backlash_{name}", 0) for name in names)]
    stiffness = profile(pair, extra.get("profile", {"kind": "Rectangular"}), context)
    has_coast_side = context.isfinite(pair["backlash"])
    sides = [
        flank(unit, stiffness, material),
        has_coast_side and flank(unit, stiffness, material, constant=pair["backlash"]),
    ]
    powers = extra.get("quadratic_stiffness", 0), extra.get("cubic_stiffness", 0)
    system.contacts.append(contact(sides, film, powers=powers))
    return system


def _oscillator(model, tuning, context):
    """Return x'' + d x' + e x + P(x, t) = F + waves + f''; both edges have their own numbers."""
    system, period = System(context, 1), 2 * context.pi
    unit = system.unit(0)
    system.length, system.speed, system.force = context.mpf(1), tuning, context.mpf(1)
    system.inertia(unit, 1)
    system.spring(unit, model["ground_stiffness"])
    system.load = unit * model["load"]
    system.forces, system.shaking = (
        [(n, [a], [b]) for n, a, b in harmonics(model[name])] for name in ("forcing", "deviation")
    )

    def side(which):
        law = model[f"{which}_stiffness"]
        if not isinstance(law, dict):
            stiffness = stiffness_profile([context.mpf(0)], [(law, 0)], period)
        elif law["kind"] == "Steps":
            lines = [(value, 0) for value in law["stiffness"]]
            stiffness = stiffness_profile(law["phase"], lines, period)
        else:
            waves = harmonics(law["harmonics"])
            stiffness = stiffness_profile([context.mpf(0)], [(law["mean"], 0)], period, waves)
        material = [model[f"{which}_damping"], 0, 0]
        return flank(unit, stiffness, material, constant=-model[f"{which}_edge"])

    sides = [side("upper"), context.isfinite(model["lower_edge"]) and side("lower")]
    # The displacement counts from 0, not from the edge.
    system.contacts.append(contact(sides, [model["damping"], 0, 0], zero=-model["upper_edge"]))
    return system


def _six_degrees(model, tuning, context):
    """Return the system of Eq. (3) and (4) of the paper.

    Coordinates are u3, u2 of pinion and wheel (gears 0, 1) and those of y3, z3, y2, z2 (numbers
    i = 0 ... 3, of gear i // 2) whose bearing is not rigid; y is along the line of action.
    """
    pair, bearings = model["pair"], model["bearing_stiffness"]
    free = [i for i in range(4) if context.isfinite(bearings[i])]
    system, mean = System(context, 2 + len(free)), mean_stiffness(pair)
    system.length, system.force = pair["load"] / mean, mean
    system.speed = tuning * context.sqrt(mean / pair["reduced_mass"])
    coast, across = system.unit(0) + system.unit(1), system.zeros(system.n)
    drive = coast
    for j, (inertia, r) in enumerate(zip(model["inertias"], model["base_radii"], strict=True)):
        system.inertia(system.unit(j), inertia / r**2)
        system.load = system.load + system.unit(j) * (model["torques"][j] / r)
    for k, i in enumerate(free):
        row, gear = system.unit(2 + k), i // 2
        system.inertia(row, model["masses"][gear])
        system.spring(row, bearings[i], model["bearing_damping"][i])
        if i % 2:
            across = across + (1 - 2 * gear) * row
        else:
            drive = drive + (1 - 2 * gear) * row
    (e3, e2), delta = model["eccentricities"], model["run_out_phase"]
    run_out = [
        (context.mpf(1) / teeth, e * cosine, e * sine)
        for e, teeth, cosine, sine in (
            (e3, model["teeth"][0], 0, 1),
            # -e2 sin(Delta - phi2)
            (e2, model["teeth"][1], -context.sin(delta), context.cos(delta)),
        )
        if e
    ]
    moving, laws = model["moving_backlash"], {"stiffness": rectangular_profile(pair, context)}
    laws |= {"material": [pair["material_damping"], 0, 0]}
    laws |= {"turns": model["pitch_phase"] / (2 * context.pi)}
    waves, mu = run_out + harmonics(model["deviation"]), model["friction"]
    sides = [flank(drive, waves=waves, friction=mu[0], **laws)]
    waves = ([] if moving else run_out) + harmonics(model["inverse_deviation"])
    laws |= {"constant": pair["backlash"], "waves": waves, "friction": mu[1]}
    sides.append(flank(coast if moving else drive, **laws))
    if not context.isfinite(pair["backlash"]):
        sides.pop()
    system.contacts.append(contact(sides, [pair["backlash_damping"], 0, 0], across=across))
    return system


def _from_mesh(system, model, state):
    """Return the state of all coordinates for a displacement and rate of the mesh, in units.

    Bearings rest under the load, if `preload`, in place; the gears turn for the rest, each by its
    share of the mobility r^2 / J.
    """
    q, v, n = system.zeros(system.n), system.zeros(system.n), system.n
    if model["preload"]:
        rows = [i for i in range(4) if system.context.isfinite(model["bearing_stiffness"][i])]
        for k, i in enumerate(rows):
            if i % 2 == 0:
                sign = -1 if i == 0 else 1
                q[2 + k] = sign * model["pair"]["load"] / model["bearing_stiffness"][i]
    shares = [r**2 / j for r, j in zip(model["base_radii"], model["inertias"], strict=True)]
    drive = system.contacts[0]["sides"][0]
    missing_rate = state[1] * system.length - sum(f * b for f, _, b in drive["waves"])
    missing = state[0] * system.length - system.distance(drive, q, 0)
    for i in range(2):
        q[i] += shares[i] / sum(shares) * missing
        v[i] += shares[i] / sum(shares) * missing_rate
    return (np.concatenate([q, v]) / system.length).tolist()[: 2 * n]


def profile(pair, shape, context):
    """Return the ``course`` of a pair: Eq. (1), some of its harmonics, or a table of its mean."""
    kind, period = shape["kind"], 2 * context.pi
    if kind == "Rectangular":
        return rectangular_profile(pair, context)
    if kind == "Fourier":
        amplitude = pair["max_stiffness"] * (1 - pair["stiffness_ratio"]) / 2
        rows = []
        for n in range(1, shape["harmonics"] + 1):
            sine = context.sin(n * context.pi * (pair["contact_ratio"] - 2))
            rows.append((n, amplitude * 4 / (context.pi * n) * (-1) ** n * sine, 0))
        lines = [(mean_stiffness(pair), 0)]
        return stiffness_profile([context.mpf(0)], lines, period, rows)
    phases = [*shape["phase"], shape["phase"][0] + period]
    values = [*shape["stiffness"], shape["stiffness"][0]]
    rows = list(zip(phases, phases[1:], values, values[1:], strict=False))
    scale = mean_stiffness(pair) * 2 * period / sum((u - t) * (a + b) for t, u, a, b in rows)
    lines = [(a * scale, (b - a) / (u - t) * scale) for t, u, a, b in rows]
    return stiffness_profile(phases[:-1], lines, period)


class RunUp:
    """A described model along a course: rows of s and rpm, rows of s and shares of the load.

    `turn`: rad/s of the mesh for 1 rpm; `push`: accelerations of coordinates, m/s^2 for 1 rad/s^2.
    """

    def __init__(self, model, speed, load, turn, push, context=mpmath.fp):
        self.system = system_of(model, 1.0, context)
        self.equations = Equations(self.system.json(), context)
        self.pieces = program.courses(self.equations, speed, load, turn, push)

    def cuts(self, piece):
        """Return the times, in units, at which stiffness or sliding changes, and the end."""
        return program.cuts_of(self.equations, piece)

    def move(self, q, v, times):
        """Return (displacements at rising times in s, events) from coordinates in m and rates.

        Displacements are in m, shape (times, contacts); events (time, contact, before, after).
        """
        length, omega = self.system.length, self.system.speed
        state = [x / length for x in (*q, *v)]
        thetas = [self.equations.context.mpf(t) * omega for t in times]
        motion = program.integrate(self.equations, self.pieces, state, sample_times=thetas)
        kind = float if self.equations.context is mpmath.fp else object
        moved = np.array([row[1] for row in motion.record.samples], kind) * length
        return moved, [(event.phase / omega, *event[1:4]) for event in motion.events]
