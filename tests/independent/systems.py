"""The system of a described model; its equations written anew.

A description is a model as plain values, such as JSON has, from its public attributes.
"""

import dataclasses
from itertools import pairwise

import mpmath
import numpy as np

from tests.independent import program
from tests.independent.assembly import (
    System,
    contact,
    course,
    flank,
    harmonics,
    mean_stiffness,
    rectangular_course,
    with_numbers_of,
)
from tests.independent.equations import Equations, wave_series
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
    return Equations(system_of(model, tuning, context))


def move(model, tuning, periods, state=(0.0, 0.0), context=mpmath.fp, **options):
    """Return the motion of a description, see `program.move`.

    For six degrees the state may be displacement and rate of the mesh alone.
    """
    system = system_of(model, tuning, context)
    if model["kind"] == "SixDegreePair" and len(state) != 2 * system.n:
        state = _from_mesh(system, with_numbers_of(context, model), state)
    return program.move(Equations(system), periods, state, **options)


def _one_coordinate(context, units, mass, load, force, shaking):
    """Return a system without contacts, in units of length, speed and force."""
    system = System(context, 1)
    system.length, system.speed, system.force = units
    unit = system.unit(0)
    system.inertia(unit, mass)
    system.load = unit * load
    system.forces = [(unit, 0, harmonics(force)), (unit * mass, 2, harmonics(shaking))]
    return system


def _one_degree(model, tuning, context):
    """Return m y'' + k(y) y' + D2 |y'| y' + D3 y'^3 + C(tau) g(y) = F(tau) + m f''."""
    pair, none = model.get("pair", model), {"cosines": [], "sines": []}
    #: what a `OneDegreePair` adds to its pair
    extra = model if "pair" in model else {}
    mean, m, load = mean_stiffness(pair), pair["reduced_mass"], pair["load"]
    units = load / mean, tuning * context.sqrt(mean / m), mean
    waves = (extra.get(name, none) for name in ("excitation", "deviation"))
    system = _one_coordinate(context, units, m, load, *waves)
    names = ("quadratic_damping", "cubic_damping")
    laws = {"row": system.unit(0), "course": _course_of_pair(pair, extra.get("profile"), context)}
    laws["material"] = [pair["material_damping"], *(extra.get(name, 0) for name in names)]
    film = [pair["backlash_damping"], *(extra.get(f"backlash_{name}", 0) for name in names)]
    has_coast_side = context.isfinite(pair["backlash"])
    sides = flank(**laws), has_coast_side and flank(**laws, constant=pair["backlash"])
    powers = extra.get("quadratic_stiffness", 0), extra.get("cubic_stiffness", 0)
    system.contacts.append(contact(sides, film, powers=powers))
    return system


def _course_of_pair(pair, shape, context):
    """Return the ``course`` of a pair: Eq. (1), some of its harmonics, or a table of its mean."""
    if shape is None or shape["kind"] == "Rectangular":
        return rectangular_course(pair, context)
    period, mean = 2 * context.pi, mean_stiffness(pair)
    if shape["kind"] == "Fourier":
        waves = []
        for n in range(1, shape["harmonics"] + 1):
            sine = context.sin(n * context.pi * (pair["contact_ratio"] - 2)) * (-1) ** n
            size = 2 * pair["max_stiffness"] * (1 - pair["stiffness_ratio"]) / (context.pi * n)
            waves.append((n, size * sine, 0))
        return course([context.mpf(0)], [(mean, 0)], period, waves)
    rows = list(zip(shape["phase"], shape["stiffness"], strict=True))
    rows = list(pairwise([*rows, (rows[0][0] + period, rows[0][1])]))
    scale = mean * 2 * period / sum((u - t) * (a + b) for (t, a), (u, b) in rows)
    lines = [(a * scale, (b - a) / (u - t) * scale) for (t, a), (u, b) in rows]
    return course(shape["phase"], lines, period)


def _oscillator(model, tuning, context):
    """Return x'' + d x' + e x + P(x, t) = F + waves + f''; both edges have their own numbers."""
    one, period = context.mpf(1), 2 * context.pi
    waves = model["forcing"], model["deviation"]
    system = _one_coordinate(context, (one, tuning, one), one, model["load"], *waves)
    system.spring(system.unit(0), model["ground_stiffness"])

    def side(which):
        law, waves = model[f"{which}_stiffness"], []
        breaks, values = [0 * one], [law]
        if isinstance(law, dict) and law["kind"] == "Steps":
            breaks, values = law["phase"], law["stiffness"]
        elif isinstance(law, dict):
            values, waves = [law["mean"]], harmonics(law["harmonics"])
        stiffness = course(breaks, [(value, 0) for value in values], period, waves)
        material = [model[f"{which}_damping"], 0, 0]
        return flank(system.unit(0), stiffness, material, constant=-model[f"{which}_edge"])

    sides = [side("upper"), context.isfinite(model["lower_edge"]) and side("lower")]
    # The displacement counts from 0, not from the edge.
    system.contacts.append(contact(sides, [model["damping"], 0, 0], zero=-model["upper_edge"]))
    return system


def _six_degrees(model, tuning, context):
    """Return the system of Eq. (3) and (4) of the paper.

    Coordinates are u3, u2 of pinion and wheel (gears 0, 1) and those of y3, z3, y2, z2 (numbers
    i = 0 ... 3, of gear i // 2) whose bearing is not rigid; y is along the line of action.
    """
    pair, free = model["pair"], _elastic_bearings(model, context)
    system, mean = System(context, 2 + len(free)), mean_stiffness(pair)
    system.length, system.force = pair["load"] / mean, mean
    system.speed = tuning * context.sqrt(mean / pair["reduced_mass"])
    coast, across = system.unit(0) + system.unit(1), system.zeros(system.n)
    drive = coast
    for j, (inertia, r) in enumerate(zip(model["inertias"], model["base_radii"], strict=True)):
        system.inertia(system.unit(j), inertia / r**2)
        system.load = system.load + system.unit(j) * (model["torques"][j] / r)
    for row, i in zip(map(system.unit, range(2, system.n)), free, strict=True):
        gear, sign = i // 2, 1 - 2 * (i // 2)
        system.inertia(row, model["masses"][gear])
        system.spring(row, model["bearing_stiffness"][i], model["bearing_damping"][i])
        drive, across = (drive, across + sign * row) if i % 2 else (drive + sign * row, across)
    (e3, e2), (z3, z2), delta = model["eccentricities"], model["teeth"], model["run_out_phase"]
    # e3 sin(phi3) - e2 sin(Delta - phi2)
    run_out = [(context.mpf(1) / z3, 0, e3)] if e3 else []
    if e2:
        run_out.append((context.mpf(1) / z2, -e2 * context.sin(delta), e2 * context.cos(delta)))
    moving, mu = model["moving_backlash"], model["friction"]
    laws = {"course": rectangular_course(pair, context)}
    laws |= {"material": [pair["material_damping"], 0, 0]}
    laws |= {"turns": model["pitch_phase"] / (2 * context.pi)}
    sides = [flank(drive, waves=run_out + harmonics(model["deviation"]), friction=mu[0], **laws)]
    if context.isfinite(pair["backlash"]):
        waves = ([] if moving else run_out) + harmonics(model["inverse_deviation"])
        laws |= {"constant": pair["backlash"], "waves": waves, "friction": mu[1]}
        sides.append(flank(coast if moving else drive, **laws))
    system.contacts.append(contact(sides, [pair["backlash_damping"], 0, 0], across=across))
    return system


def _elastic_bearings(model, context):
    return [
        i for i, stiffness in enumerate(model["bearing_stiffness"]) if context.isfinite(stiffness)
    ]


def _from_mesh(system, model, state):
    """Return the state of all coordinates for a displacement and rate of the mesh, in units.

    Bearings rest under the load, if `preload`, in place; the gears turn for the rest, each by its
    share of the mobility r^2 / J.
    """
    q, v = system.zeros(2, system.n)
    for k, i in enumerate(_elastic_bearings(model, system.context), start=2):
        if model["preload"] and i % 2 == 0:
            q[k] = (i - 1) * model["pair"]["load"] / model["bearing_stiffness"][i]
    mobility = system.zeros(system.n)
    mobility[:2] = [r**2 / j for r, j in zip(model["base_radii"], model["inertias"], strict=True)]
    share, drive = mobility / sum(mobility), system.contacts[0]["sides"][0]
    q += share * (state[0] * system.length - system.distance(drive, q, 0))
    _, rate = wave_series(system.context, drive["waves"], 0, terms=2)
    v += share * (state[1] * system.length - rate)
    return (np.concatenate([q, v]) / system.length).tolist()


class RunUp:
    """A described model along a course: rows of s and rpm, rows of s and shares of the load.

    `turn`: rad/s of the mesh for 1 rpm; `push`: accelerations of coordinates, m/s^2 for 1 rad/s^2.
    """

    def __init__(self, model, speed, load, turn, push, context=mpmath.fp):
        self.system = system_of(model, 1.0, context)
        self.equations = Equations(self.system)
        self.pieces = program.courses(self.equations, speed, load, turn, push)

    def cuts(self, piece):
        """Return the times, in units, at which stiffness or sliding changes, and the end."""
        return program.cuts_of(self.equations, piece)

    def move(self, q, v, times):
        """Return (displacements at rising times in s, events) from coordinates in m and rates.

        Displacements are in m, shape (times, contacts); events (time, contact, before, after).
        """
        length, omega = self.system.length, self.system.speed
        state, thetas = (
            np.array([*q, *v]) / length,
            [self.system.context.mpf(t) * omega for t in times],
        )
        motion = program.integrate(self.equations, self.pieces, state, sample_times=thetas)
        moved = np.array([row[1] for row in motion.record.samples]) * length
        return moved, [(event.phase / omega, *event[1:4]) for event in motion.events]
