"""Equations of motion of each kind of model, derived anew from a description of the model.

A description is a model as plain values, such as JSON has, from its public attributes.
"""

import dataclasses
from itertools import pairwise

import mpmath
import numpy as np

from tests.independent import program
from tests.independent.equations import (
    Equations,
    System,
    TimeInterval,
    exact,
    harmonics,
    mean_stiffness,
)
from tests.independent.trains import Train


def describe(model):
    """Return a model as dicts, lists and numbers; ``kind`` is the name of its class.

    Trains also get the phases of their meshes, which `tests/geometry/test_phases_by_teeth.py`
    tests.
    """
    if isinstance(model, (tuple, list)):
        return [describe(item) for item in model]
    if not dataclasses.is_dataclass(model):
        return model
    kind, names = type(model).__name__, [field.name for field in dataclasses.fields(model)]
    names += ["phases", "coast_phases"] if kind == "GearTrain" else []
    return {"kind": kind} | {name: describe(getattr(model, name)) for name in names}


def system_of(model, tuning, context=mpmath.fp):
    """Return the `System` of a description at a tuning."""
    system_types = {
        "GearPair": _one_degree,
        "OneDegreePair": _one_degree,
        "DeadZoneOscillator": _oscillator,
        "SixDegreePair": _six_degrees,
        "GearTrain": Train,
    }[model["kind"]]
    return system_types(exact(context, model), context.mpf(tuning), context)


def equations_of(model, tuning, context=mpmath.fp):
    """Return the equations of a description for the program."""
    return Equations(system_of(model, tuning, context))


def move(model, tuning, periods, state=(0.0, 0.0), context=mpmath.fp, **options):
    """Return the motion of a described model as a `program.Motion`.

    For six degrees of freedom the state may be displacement and rate of the mesh alone. `options`
    are passed to `program.move`.
    """
    system = system_of(model, tuning, context)
    if model["kind"] == "SixDegreePair" and len(state) != 2 * system.n:
        state = _from_mesh(system, exact(context, model), state)
    return program.move(Equations(system), periods, state, **options)


def _one_coordinate(context, units, mass, load, force, support_motion):
    """Return a system of one coordinate without contacts.

    `units` are the units of length, speed and force; `force` and `support_motion` are harmonics of
    the external force and of the displacement of the support.
    """
    system = System(context, 1)
    system.length, system.speed, system.force = units
    unit = system.unit(0)
    system.inertia(unit, mass)
    system.load = unit * load
    system.forces = [(unit, 0, harmonics(force)), (unit * mass, 2, harmonics(support_motion))]
    return system


def _one_degree(model, tuning, context):
    """Return the system m y'' + k(y) y' + D2 |y'| y' + D3 y'^3 + C(tau) g(y) = F(tau) + m f''."""
    # A `GearPair` is described by its pair alone, without harmonic and nonlinear terms.
    pair, none = model.get("pair", model), {"cosines": [], "sines": []}
    mean, m, load = mean_stiffness(pair), pair["reduced_mass"], pair["load"]
    units = load / mean, tuning * context.sqrt(mean / m), mean
    harmonic_terms = (model.get(name, none) for name in ("excitation", "deviation"))
    system = _one_coordinate(context, units, m, load, *harmonic_terms)
    profile = _profile_of_pair(system, pair, model.get("profile", {"kind": "Rectangular"}))
    names = ("quadratic_damping", "cubic_damping")
    material_damping = [pair["material_damping"], *(model.get(name, 0) for name in names)]
    oil_damping = [pair["backlash_damping"], *(model.get(f"backlash_{name}", 0) for name in names)]
    drive = {"row": system.unit(0), "profile": profile, "material_damping": material_damping}
    coast = context.isfinite(pair["backlash"]) and drive | {"constant": pair["backlash"]}
    nonlinear_stiffness = model.get("quadratic_stiffness", 0), model.get("cubic_stiffness", 0)
    system.add_contact([drive, coast], oil_damping, nonlinear_stiffness=nonlinear_stiffness)
    return system


def _profile_of_pair(system, pair, shape):
    """Return the stiffness ``profile`` of a pair: rectangular, truncated Fourier series or table.

    `shape` is the description of the profile. A table is scaled to the mean stiffness of the pair.
    """
    if shape["kind"] == "Rectangular":
        return system.rectangular_profile(pair)
    pi, mean = system.context.pi, mean_stiffness(pair)
    if shape["kind"] == "Fourier":
        fourier_terms = []
        for n in range(1, shape["harmonics"] + 1):
            sine_factor = system.context.sin(n * pi * (pair["contact_ratio"] - 2)) * (-1) ** n
            amplitude = 2 * pair["max_stiffness"] * (1 - pair["stiffness_ratio"]) / (pi * n)
            fourier_terms.append((n, amplitude * sine_factor, 0))
        return system.profile([0 * pi], [(mean, 0)], fourier_terms)
    intervals = list(zip(shape["phase"], shape["stiffness"], strict=True))
    intervals = list(pairwise([*intervals, (intervals[0][0] + 2 * pi, intervals[0][1])]))
    scale = mean * 4 * pi / sum((u - t) * (a + b) for (t, a), (u, b) in intervals)
    segments = [(a * scale, (b - a) / (u - t) * scale) for (t, a), (u, b) in intervals]
    return system.profile(shape["phase"], segments)


def _oscillator(model, tuning, context):
    """Return the system of x'' + d x' + e x + P(x, t) = F + f(t) + h''(t) with unequal sides."""
    one, harmonic_terms = context.mpf(1), (model["forcing"], model["deviation"])
    system = _one_coordinate(context, (one, tuning, one), one, model["load"], *harmonic_terms)
    system.spring(system.unit(0), model["ground_stiffness"])

    def side(name):
        """Return the contact side at the "upper" or "lower" edge."""
        stiffness, harmonic_terms = model[f"{name}_stiffness"], []
        breakpoints, values = [0 * one], [stiffness]
        if isinstance(stiffness, dict) and stiffness["kind"] == "Steps":
            breakpoints, values = stiffness["phase"], stiffness["stiffness"]
        elif isinstance(stiffness, dict):
            values, harmonic_terms = [stiffness["mean"]], harmonics(stiffness["harmonics"])
        return {
            "row": system.unit(0),
            "profile": system.profile(
                breakpoints, [(value, 0) for value in values], harmonic_terms
            ),
            "material_damping": [model[f"{name}_damping"], 0, 0],
            "constant": -model[f"{name}_edge"],
        }

    sides = [side("upper"), context.isfinite(model["lower_edge"]) and side("lower")]
    # Displacements are measured from 0, but distances from the edge.
    system.add_contact(sides, [model["damping"], 0, 0], displacement_origin=-model["upper_edge"])
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
    coast, friction_row = system.unit(0) + system.unit(1), system.zeros(system.n)
    drive = coast
    for j, (inertia, r) in enumerate(zip(model["inertias"], model["base_radii"], strict=True)):
        system.inertia(system.unit(j), inertia / r**2)
        system.load = system.load + system.unit(j) * (model["torques"][j] / r)
    for row, i in zip(map(system.unit, range(2, system.n)), free, strict=True):
        gear, sign = i // 2, 1 - 2 * (i // 2)
        system.inertia(row, model["masses"][gear])
        system.spring(row, model["bearing_stiffness"][i], model["bearing_damping"][i])
        drive, friction_row = drive + sign * (1 - i % 2) * row, friction_row + sign * (i % 2) * row
    (e3, e2), (z3, z2), delta = model["eccentricities"], model["teeth"], model["run_out_phase"]
    # e3 sin(phi3) - e2 sin(Delta - phi2)
    run_out = [(context.mpf(1) / z3, 0, e3)] if e3 else []
    if e2:
        run_out.append((context.mpf(1) / z2, -e2 * context.sin(delta), e2 * context.cos(delta)))
    moving, friction = model["moving_backlash"], model["friction"]
    side_fields = {"profile": system.rectangular_profile(pair)}
    side_fields["material_damping"] = [pair["material_damping"], 0, 0]
    side_fields["sliding_reversal"] = model["pitch_phase"] / (2 * context.pi)
    harmonic_terms = run_out + harmonics(model["deviation"])
    sides = [
        side_fields | {"row": drive, "harmonic_terms": harmonic_terms, "friction": friction[0]}
    ]
    if context.isfinite(pair["backlash"]):
        harmonic_terms = ([] if moving else run_out) + harmonics(model["coast_deviation"])
        side_fields |= {"harmonic_terms": harmonic_terms, "friction": friction[1]}
        side_fields["constant"] = pair["backlash"]
        sides.append(side_fields | {"row": coast if moving else drive})
    system.add_contact(sides, [pair["backlash_damping"], 0, 0], friction_row=friction_row)
    return system


def _elastic_bearings(model, context):
    """Return the numbers of the bearings of finite stiffness."""
    return [i for i, k in enumerate(model["bearing_stiffness"]) if context.isfinite(k)]


def _from_mesh(system, model, state):
    """Return the state of all coordinates for a given displacement and rate of the mesh, in units.

    With `preload` the bearings are displaced by the load. The rotations make up the remaining
    displacement, each gear in proportion to its mobility r^2 / J.
    """
    q, v = system.zeros(2, system.n)
    for k, i in enumerate(_elastic_bearings(model, system.context), start=2):
        if model["preload"] and i % 2 == 0:
            q[k] = (i - 1) * model["pair"]["load"] / model["bearing_stiffness"][i]
    mobility = system.zeros(system.n)
    mobility[:2] = [r**2 / j for r, j in zip(model["base_radii"], model["inertias"], strict=True)]
    share, drive = mobility / sum(mobility), system.contacts[0]["sides"][0]
    q += share * (state[0] * system.length - system.distance(drive, q, 0))
    v += share * (state[1] * system.length - sum(f * b for f, _, b in drive["harmonic_terms"]))
    return (np.concatenate([q, v]) / system.length).tolist()


class RunUp:
    """A described model on courses of speed, (s, rpm), and of load, (s, share of its load).

    `turn` is the mesh frequency, rad/s, at 1 rpm. `push` holds the accelerations of the
    coordinates, m/s^2, for an acceleration of the mesh by 1 rad/s^2.
    """

    def __init__(self, model, speed, load, turn, push, context=mpmath.fp):
        self.system = system_of(model, 1.0, context)
        self.equations, self.intervals = Equations(self.system), []
        number, omega, phase = context.mpf, self.system.speed, context.mpf(0)
        phase_coupling = [number(x) / self.system.length for x in push]
        speeds = [(number(t) * omega, number(v) * turn / omega) for t, v in speed]
        loads = [(number(t) * omega, number(v)) for t, v in load]
        breakpoints = sorted({t for t, _ in loads if t < speeds[-1][0]} | {t for t, _ in speeds})
        for begin, end in pairwise(breakpoints):
            (v, w), (a, b), span = (
                _values_at_ends(speeds, begin, end),
                _values_at_ends(loads, begin, end),
                end - begin,
            )
            slopes = {"acceleration": (w - v) / span, "load_slope": (b - a) / span}
            self.intervals.append(
                TimeInterval(begin, end, phase, v, load=a, phase_coupling=phase_coupling, **slopes)
            )
            phase += (v + w) / 2 * span

    def switch_times(self, interval):
        """Return the times, in units, at which stiffness or sliding changes, and the last one."""
        return program.find_switch_times(self.equations, interval)

    def move(self, q, v, times):
        """Return (displacements, events) of the motion from coordinates `q`, m, and rates `v`, m/s.

        Displacements are in m at rising `times`, s, with shape (times, contacts). Events are rows
        (time, contact, before, after).
        """
        length, omega = self.system.length, self.system.speed
        state, thetas = np.array([*q, *v]) / length, [omega * t for t in np.array(times).tolist()]
        motion = program.Motion(self.equations, self.intervals, state, sample_times=thetas)
        displacements = np.array([row[1] for row in motion.record.samples]) * length
        return displacements, [(event.phase / omega, *event[1:4]) for event in motion.events]


def _values_at_ends(rows, begin, end):
    """Return the values of a piecewise linear course at both ends of an interval on one line."""
    # The course is constant before its first row and after its last one.
    rows = [(begin, rows[0][1]), *rows, (end, rows[-1][1])]
    segment = next((*a, *b) for a, b in pairwise(rows) if a[0] <= begin and end <= b[0])
    start_time, start_value, end_time, end_value = segment
    return [
        start_value + (end_value - start_value) * (time - start_time) / (end_time - start_time)
        for time in (begin, end)
    ]
