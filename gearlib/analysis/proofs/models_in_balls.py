"""Masses, springs, loads and meshes of a model in ball arithmetic.

    M q'' + D q' + K q = f - sum over meshes of (b_drive P + b_coast Q) - friction across them

The floating-point numbers of a `GearPair`, a `SixDegreePair` and a `GearTrain` in SI units are
taken as exact, and those of the `Equation` of other models with one degree of freedom in its units.
For a train, the derived mesh phases (in mesh periods), static deflection and reference frequency
are taken as exact, too. Speed ratios are fractions of tooth numbers.
"""

import math
from collections.abc import Callable
from fractions import Fraction
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from gearlib.analysis.proofs.balls import ball_of, flint
from gearlib.analysis.proofs.certificate_files import ProofFailed
from gearlib.models.six_degrees import TwoGears
from gearlib.models.trains import turning
from gearlib.models.trains.structure import Arithmetic, coast_lines
from gearlib.models.trains.waves import excitation_harmonics

#: Indices of the two sides of a tooth, as in tables of the models.
COAST, DRIVE = 0, 1
#: Attributes of a train that the library derives from its parameters.
_DERIVED_NUMBERS = "static_deflection", "reference_angular_frequency", "phases", "inverse_phases"


class MeshTiming(NamedTuple):
    """Phases at which stiffness and sliding of a mesh change, pairs (coast side, drive side)."""

    overlap: Fraction  #: contact ratio - 1
    has_switches: bool  #: whether the two stiffness levels differ
    has_friction: bool
    rate: Fraction = Fraction(1)  #: mesh periods per period of the reference mesh
    phases: tuple = (Fraction(0), Fraction(0))  #: middle of the upper level, in mesh periods
    pitches: tuple = (Fraction(0), Fraction(0))  #: phase of the sliding reversal, relative to that
    #: of the drive side

    def changes(self) -> set[Fraction]:
        """Return the phases, in mesh periods, at which stiffness or sliding direction changes."""
        phases = set()
        if self.has_switches and 0 < self.overlap < 1:
            for middle in self.phases:
                phases |= {middle + self.overlap / 2, middle - self.overlap / 2}
        if self.has_friction:
            for pitch in self.pitches:
                reversal = self.phases[DRIVE] + pitch
                phases |= {reversal, reversal + Fraction(1, 2)}
        return phases

    def condition(self, side: int, phase: Fraction) -> tuple[int, int]:
        """Return (stiffness level, sign of sliding) of a side, COAST or DRIVE, at a phase.

        Level 0 is the upper and 1 the lower stiffness; the phase is in mesh periods.
        """
        distance = abs((phase - self.phases[side] + Fraction(1, 2)) % 1 - Fraction(1, 2))
        since_reversal = (phase - self.phases[DRIVE] - self.pitches[side]) % 1
        is_low = self.overlap == 0 or distance > self.overlap / 2
        return int(is_low), 1 if since_reversal < Fraction(1, 2) else -1


class BallMesh(NamedTuple):
    """A mesh; pairs are (coast side, drive side), rows are functionals of the n coordinates."""

    name: str
    rows: tuple  #: rows b of the flank distance b q + constant + waves
    constants: tuple  #: with the backlash; None for the coast side of an infinite backlash
    stiffness: tuple  #: stiffness levels of both sides
    damping: tuple  #: damping in contact of both sides
    backlash_damping: Any
    has_backlash: bool = True  #: without backlash the flank lines of both sides coincide
    timing: Any = None  #: `MeshTiming`, or None if the model has other segments
    waves: dict = {}  #: frequency (`Fraction`) by phase -> rows (cosine, sine) of both sides
    sliding_row: Any = None  #: row of the sliding distance of the flanks; None without friction
    friction: tuple = (0, 0)
    clearance_varies: bool = False  #: whether the clearance varies, so that it may close


class Segment(NamedTuple):
    """A part of the period of the excitation with constant coefficients."""

    phase: Any  #: mesh phase of its start, a ball
    conditions: list  #: (index of the stiffness level, sliding sign) of both sides of each mesh


class BallModel(NamedTuple):
    """Coefficients of a model with n coordinates in balls; matrices are arrays of balls."""

    coordinates: tuple  #: names of the coordinates
    mass: np.ndarray
    stiffness: np.ndarray  #: without that of the meshes
    damping: np.ndarray  #: without that of the meshes
    load: np.ndarray
    meshes: tuple
    segments: list
    length: Any  #: unit of displacements
    frequency: Any  #: unit of the tuning, rad/s
    force_waves: dict = {}  #: frequency by phase -> (cosine, sine) of the load, each shape (n,)
    derived: dict = {}  #: numbers that the library derives from the model, taken as exact


def model_reader(model) -> Callable:
    """Return the function from (model, tuning) to `BallModel` for the class of a model.

    Raise `ProofFailed` for models without proofs.
    """
    if model.train is not None:
        if model.gyroscopic:
            text = "no proof is written for a train whose axes feel the turning of their frame"
            raise ProofFailed("model", text)
        return _of_train if model.train is model else _of_six_degrees
    if model.mesh is model:
        return _of_pair
    if model.piecewise_linear:
        return _of_equation
    text = "proofs are written for trains, and for one degree of freedom with linear phases of"
    raise ProofFailed("model", f"{text} contact, not for this {type(model).__name__}")


def ball_model(model, tuning: float) -> BallModel:
    """Return masses, springs, loads and meshes of a model at a tuning in balls."""
    return model_reader(model)(model, tuning)


def ball_arithmetic() -> Arithmetic:
    """Return the arithmetic for the assembly of a train in balls of the current precision."""
    arb = flint().arb
    return Arithmetic(
        object,
        arb,
        cos_sin=lambda angle: arb(angle).sin_cos()[::-1],
        polar=lambda x, y: ((x * x + y * y).sqrt(), arb.atan2(y, x)),
        pi=arb.pi(),
    )


def segments_of(timings: list[MeshTiming], common_period: int) -> list[Segment]:
    """Return the segments of constant stiffness and sliding in one period of the excitation.

    `timings` are those of all meshes, `common_period` is in periods of the reference mesh.
    """
    starts = {Fraction(0)}
    for timing in timings:
        for count in range(int(common_period * timing.rate)):
            starts |= {(change % 1 + count) / timing.rate for change in timing.changes()}
    segments = []
    for start, end in pairwise([*sorted(starts), Fraction(common_period)]):
        conditions = [
            [timing.condition(side, (start + end) / 2 * timing.rate) for side in (COAST, DRIVE)]
            for timing in timings
        ]
        segments.append(Segment(2 * flint().arb.pi() * ball_of(start), conditions))
    return segments


def _units(pair) -> dict[str, Any]:
    """Return {"length": static deflection, "frequency": natural frequency} of a pair in balls."""
    kappa, overlap = flint().arb(pair.stiffness_ratio), flint().arb(pair.contact_ratio) - 1
    mean = pair.max_stiffness * (kappa * (1 - overlap) + overlap)
    return {"length": pair.load / mean, "frequency": (mean / pair.reduced_mass).sqrt()}


def _of_one_degree(mass, ground, load, lines, stiffness, damping, **values) -> BallModel:
    """Return the coefficients of a model with one coordinate.

    `ground` is its stiffness without contact, `lines` and `stiffness` are displacements of the
    flanks and stiffness levels of (coast, drive) side, `damping` is that of (coast side, backlash,
    drive side). `values` are other fields of `BallModel`.
    """
    arb = flint().arb
    unit_row, (coast, backlash, drive) = (arb(1),), map(arb, damping)
    mesh = BallMesh(
        "mesh",
        (unit_row, unit_row),
        tuple(-arb(line) if math.isfinite(line) else None for line in lines),
        [[arb(level) for level in levels] for levels in stiffness],
        (coast, drive),
        backlash,
        has_backlash=lines[COAST] < lines[DRIVE],
    )
    mass_matrix, ground_matrix, no_damping = (np.array([[arb(x)]]) for x in (mass, ground, 0))
    loads = np.array([arb(load)])
    return BallModel(
        ("displacement",), mass_matrix, ground_matrix, no_damping, loads, (mesh,), **values
    )


def _of_pair(pair, tuning: float) -> BallModel:
    """Return the coefficients of a `GearPair`, which do not depend on the tuning."""
    upper, kappa = flint().arb(pair.max_stiffness), pair.stiffness_ratio
    timing = MeshTiming(Fraction(pair.contact_ratio) - 1, kappa != 1.0, has_friction=False)
    return _of_one_degree(
        pair.reduced_mass,
        0,
        pair.load,
        (-pair.backlash, 0.0),
        [(upper, upper * kappa)] * 2,
        (pair.material_damping, pair.backlash_damping, pair.material_damping),
        segments=segments_of([timing], 1),
        **_units(pair),
    )


def _of_equation(model, tuning: float) -> BallModel:
    """Return the coefficients of a model with one degree of freedom from its `Equation`."""
    arb, equation = flint().arb, model.equation
    drive_side, coast_side = equation.stiffness_pieces()
    starts, waves = [0.0, *drive_side.breaks[1:-1].tolist()], {}
    harmonics = [(order, arb(a), arb(b)) for order, a, b in equation.force.tolist()]
    # A profile deviation f adds the inertia force f''.
    for order, cosine, sine in equation.deviation.tolist():
        inertia = -((arb(tuning) * order) ** 2)
        harmonics.append((order, inertia * cosine, inertia * sine))
    for order, cosine, sine in harmonics:
        wave = waves.setdefault(Fraction(order), np.full((2, 1), arb(0)))
        wave[:, 0] += cosine, sine
    return _of_one_degree(
        1,
        equation.ground_stiffness,
        equation.load,
        (equation.lower, equation.upper),
        [side.lines[:, 0].tolist() for side in (coast_side, drive_side)],
        equation.damping[:, 0].tolist(),
        segments=[Segment(arb(start), [[(i, 1), (i, 1)]]) for i, start in enumerate(starts)],
        length=arb(1),
        frequency=arb(1),
        force_waves=waves,
    )


def _of_train(train, tuning: float) -> BallModel:
    """Return the coefficients of a `GearTrain`, which do not depend on the tuning."""
    arb, arithmetic = flint().arb, ball_arithmetic()
    structure = train.assemble(arithmetic)
    coast_rows = coast_lines(structure, train.by_name, train.meshes, arithmetic)
    waves, constants = excitation_harmonics(train, structure.line_vectors, arithmetic)
    meshes = []
    for j, mesh in enumerate(train.meshes):
        upper, (coast, drive) = arb(mesh.max_stiffness), constants[:, j]
        # The phase of the pitch point in mesh periods is rounded once, and exact thereafter.
        pitch = Fraction(train.pitch_phases[mesh.name] / math.tau)
        timing = MeshTiming(
            Fraction(mesh.contact_ratio) - 1,
            mesh.stiffness_ratio != 1.0,
            any(mesh.friction),
            train.frequency_ratios[j],
            (Fraction(train.inverse_phases[mesh.name]), Fraction(train.phases[mesh.name])),
            (pitch + turning.thickness_difference(mesh, train.speeds) / 2, pitch),
        )
        meshes.append(
            BallMesh(
                mesh.name,
                (coast_rows[j], structure.lines[j]),
                (None if math.isinf(mesh.backlash) else coast + mesh.backlash, drive),
                ((upper, upper * mesh.stiffness_ratio),) * 2,
                (arb(mesh.known_damping),) * 2,
                arb(mesh.backlash_damping),
                timing=timing,
                waves={
                    frequency: rows[:, j].tolist()
                    for frequency, rows in waves.items()
                    if not (rows[:, j] == 0).all()
                },
                sliding_row=structure.sliding[j] if timing.has_friction else None,
                friction=tuple(map(arb, mesh.friction[::-1])),
                clearance_varies=mesh.moving_backlash or mesh.inverse_deviation != mesh.deviation,
            )
        )
    linear_parts = structure.mass, structure.stiffness, structure.damping, structure.load
    return BallModel(
        tuple(f"{name} {axis}" for name, axis in structure.coordinates),
        *linear_parts,
        tuple(meshes),
        segments_of([mesh.timing for mesh in meshes], train.repeats),
        arb(train.static_deflection),
        arb(train.reference_angular_frequency),
        derived={name: getattr(train, name) for name in _DERIVED_NUMBERS},
    )


def _of_six_degrees(model, tuning: float) -> BallModel:
    """Return the coefficients of a `SixDegreePair`: those of its train, with units in balls."""
    train = TwoGears(gears=model, arithmetic=ball_arithmetic())
    bearings = (("y3", "z3", "y2", "z2")[i] for i in model.elastic_bearings())
    return _of_train(train, tuning)._replace(
        coordinates=("u3", "u2", *bearings), derived={}, **_units(model.pair)
    )
