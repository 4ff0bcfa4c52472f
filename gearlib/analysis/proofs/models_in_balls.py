"""Masses, springs, loads and meshes of a model in ball arithmetic.

    M q'' + D q' + K q = f - sum over meshes of (b_drive P + b_coast Q) - friction across them

P and Q are the mesh forces on the drive and coast sides, and b their directions.

The floating-point numbers of a `GearPair`, a `SixDegreePair` and a `GearTrain` in SI units are
taken as exact, as are the numbers in the `Equation` of other models with one degree of freedom. For
a train, the derived mesh phases (in mesh periods), static deflection and reference frequency are
also taken as exact. Speed ratios are fractions of tooth numbers.
"""

import math
from collections.abc import Callable
from fractions import Fraction
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from gearlib.analysis.proofs.balls import flint, to_ball
from gearlib.analysis.proofs.certificate_files import ProofFailed
from gearlib.models.six_degrees import BEARINGS, TwoGears
from gearlib.models.trains.structure import Arithmetic, coast_jacobian
from gearlib.models.trains.turning import thickness_difference
from gearlib.models.trains.waves import excitation_harmonics, force_harmonics

#: Indices of the two sides of a tooth, as in tables of the models.
COAST_SIDE, DRIVE_SIDE = 0, 1
#: Attributes of a train that are computed from its parameters in floating-point arithmetic.
_DERIVED_NUMBERS = "static_deflection", "reference_angular_frequency", "phases", "coast_phases"


class MeshTiming(NamedTuple):
    """Phases at which the stiffness and the sliding direction of a mesh change.

    Pairs are in the order (coast side, drive side).
    """

    overlap: Fraction  #: contact ratio - 1
    has_switches: bool  #: whether the two stiffness levels differ
    has_friction: bool  #: whether the sliding direction matters
    rate: Fraction = Fraction(1)  #: mesh periods per period of the reference mesh
    phases: tuple = (Fraction(0), Fraction(0))  #: middle of the upper level, in mesh periods
    #: Phases of the pitch points, relative to `phases[DRIVE_SIDE]`. The sliding becomes positive
    #: there, and negative half a mesh period later, when the next pair of teeth takes over the
    #: load.
    pitch_phases: tuple = (Fraction(0), Fraction(0))

    def changes(self) -> set[Fraction]:
        """Return the set of phases at which the stiffness or the sliding direction changes.

        Phases are fractions of a mesh period and may lie outside the interval from 0 to 1.
        """
        phases = set()
        # The upper level of the stiffness lasts for the fraction `overlap` of a mesh period.
        if self.has_switches and 0 < self.overlap < 1:
            for middle in self.phases:
                phases |= {middle + self.overlap / 2, middle - self.overlap / 2}
        if self.has_friction:
            for pitch_phase in self.pitch_phases:
                # The sliding direction changes at the pitch point and when the next pair takes
                # over.
                pitch_point = self.phases[DRIVE_SIDE] + pitch_phase
                phases |= {pitch_point, pitch_point + Fraction(1, 2)}
        return phases

    def condition(self, side: int, phase: Fraction) -> tuple[int, int]:
        """Return (stiffness level, sliding sign) of a side at a phase in mesh periods.

        `side` is COAST_SIDE or DRIVE_SIDE. Level 0 is the upper stiffness (more tooth pairs in
        contact) and 1 the lower; the sliding sign, 1 or -1, is the direction of sliding.
        """
        half = Fraction(1, 2)
        # Distance from the nearest middle of the upper level, in mesh periods.
        distance_to_middle = abs((phase - self.phases[side] + half) % 1 - half)
        is_low = self.overlap == 0 or distance_to_middle > self.overlap / 2
        since_pitch_point = (phase - self.phases[DRIVE_SIDE] - self.pitch_phases[side]) % 1
        sliding_sign = 1 if since_pitch_point < half else -1
        return int(is_low), sliding_sign


class BallMesh(NamedTuple):
    """A mesh in balls; pairs are (coast side, drive side), rows act on the n coordinates."""

    name: str
    rows: tuple  #: rows b of the flank distance b q + constant + harmonics
    constants: tuple  #: include the backlash; None for the coast side of an infinite backlash
    stiffness: tuple  #: stiffness levels of both sides
    damping: tuple  #: damping in contact of both sides
    backlash_damping: Any
    has_backlash: bool = True  #: without backlash the flank lines of both sides coincide
    timing: Any = None  #: `MeshTiming`, or None if the model has other segments
    harmonics: dict = {}  #: frequency (`Fraction`) by phase -> rows (cosine, sine) of both sides
    sliding_row: Any = None  #: row of the sliding distance of the flanks; None without friction
    friction: tuple = (0, 0)
    clearance_varies: bool = False  #: whether the clearance varies and may therefore close


class Segment(NamedTuple):
    """An interval of the period of the excitation with constant stiffness and sliding direction."""

    phase: Any  #: mesh phase of its start, a ball
    conditions: list  #: (index of the stiffness level, sliding sign) of both sides of each mesh


class BallModel(NamedTuple):
    """Coefficients of a model with n coordinates as balls; matrices are arrays of balls (n, n)."""

    coordinates: tuple  #: names of the coordinates
    mass: np.ndarray
    stiffness: np.ndarray  #: without the mesh stiffness
    damping: np.ndarray  #: without the mesh damping
    load: np.ndarray  #: constant forces on the coordinates, shape (n,)
    meshes: tuple  #: `BallMesh` of each mesh
    segments: list  #: `Segment`s of one period of the excitation
    length: Any  #: unit of displacements
    frequency: Any  #: unit of the tuning, rad/s
    force_harmonics: dict = {}  #: frequency by phase -> (cosine, sine) of the load, each shape (n,)
    derived: dict = {}  #: derived numbers of the model that are taken as exact


def ball_model_builder(model) -> Callable:
    """Return the function (model, tuning) -> `BallModel` that builds the `BallModel` of a model.

    A `BallModel` has the coefficients of the equations of motion as balls (intervals). Raise
    `ProofFailed` if proofs do not support the model.
    """
    if model.train is not None:
        if model.gyroscopic:
            message = "trains with gyroscopic forces of a rotating frame are not supported"
            raise ProofFailed("model", message)
        return _build_train_model if model.train is model else _build_six_degree_model
    if model.pair is model:
        return _build_pair_model
    if model.piecewise_linear:
        return _build_equation_model
    supported = "only trains and piecewise linear models with one degree of freedom are supported"
    raise ProofFailed("model", f"a {type(model).__name__} is not supported: {supported}")


def ball_arithmetic() -> Arithmetic:
    """Return the functions by which a gear train is assembled in balls instead of floats.

    Balls are intervals with error bounds; they have the current precision of python-flint.
    """
    arb = flint().arb

    def cos_sin(angle) -> tuple:
        """Return (cosine, sine) of an angle in rad as balls."""
        sine, cosine = arb(angle).sin_cos()
        return cosine, sine

    def polar(x, y) -> tuple:
        """Return (radius, angle in rad) of a point as balls."""
        return (x * x + y * y).sqrt(), arb.atan2(y, x)

    return Arithmetic(dtype=object, convert=arb, cos_sin=cos_sin, polar=polar, pi=arb.pi())


def constant_segments(timings: list[MeshTiming], common_period: int) -> list[Segment]:
    """Divide a period of the excitation into segments with constant stiffness and sliding.

    `timings` has the `MeshTiming` of each mesh. `common_period` is the period of the excitation of
    all meshes together, in periods of the reference mesh.
    """
    starts = {Fraction(0)}  # in periods of the reference mesh
    for timing in timings:
        for period in range(int(common_period * timing.rate)):
            starts |= {(change % 1 + period) / timing.rate for change in timing.changes()}
    segments = []
    for start, end in pairwise([*sorted(starts), Fraction(common_period)]):
        conditions = []
        for timing in timings:
            # Nothing changes within a segment, so its conditions are those at its midpoint.
            phase = (start + end) / 2 * timing.rate
            conditions.append([timing.condition(side, phase) for side in (COAST_SIDE, DRIVE_SIDE)])
        segments.append(Segment(2 * flint().arb.pi() * to_ball(start), conditions))
    return segments


def _pair_units(pair) -> dict[str, Any]:
    """Return the units "length" and "frequency" of a `GearPair` as balls (intervals).

    They are the static deflection in m, and the natural frequency in rad/s at the mean stiffness.
    """
    kappa = flint().arb(pair.stiffness_ratio)  # minimum over maximum stiffness
    # The overlap is the fraction of time with two tooth pairs in contact and maximum stiffness.
    overlap = flint().arb(pair.contact_ratio) - 1
    mean_stiffness = pair.max_stiffness * (kappa * (1 - overlap) + overlap)
    frequency = (mean_stiffness / pair.reduced_mass).sqrt()
    return {"length": pair.load / mean_stiffness, "frequency": frequency}


def _build_one_degree_model(
    mass, ground_stiffness, load, flank_positions, stiffness, damping, **fields
):
    """Build the `BallModel` of a model with one coordinate, the displacement.

    `ground_stiffness` acts without contact, and `flank_positions` are the displacements at which
    the (coast, drive) flanks touch. `stiffness` lists the stiffness levels of the (coast, drive)
    side, to which the segments refer by index, and `damping` the coefficients for (coast-side
    contact, no contact, drive-side contact). `fields` are other fields of `BallModel`: segments and
    units.
    """
    arb = flint().arb
    unit_row = (arb(1),)
    coast, no_contact, drive = map(arb, damping)
    mesh = BallMesh(
        name="mesh",
        rows=(unit_row, unit_row),
        constants=tuple(-arb(x) if math.isfinite(x) else None for x in flank_positions),
        stiffness=[[arb(level) for level in levels] for levels in stiffness],
        damping=(coast, drive),
        backlash_damping=no_contact,
        has_backlash=flank_positions[COAST_SIDE] < flank_positions[DRIVE_SIDE],
    )
    return BallModel(
        coordinates=("displacement",),
        mass=np.array([[arb(mass)]]),
        stiffness=np.array([[arb(ground_stiffness)]]),
        damping=np.array([[arb(0)]]),
        load=np.array([arb(load)]),
        meshes=(mesh,),
        **fields,
    )


def _build_pair_model(pair, tuning: float) -> BallModel:
    """Build the `BallModel` of a `GearPair`, whose coefficients are balls (intervals), in SI units.

    They do not depend on `tuning`, which is an argument of all builders.
    """
    max_stiffness = flint().arb(pair.max_stiffness)
    kappa = pair.stiffness_ratio  # minimum over maximum stiffness
    overlap = Fraction(pair.contact_ratio) - 1
    timing = MeshTiming(overlap, has_switches=kappa != 1.0, has_friction=False)
    return _build_one_degree_model(
        pair.reduced_mass,
        ground_stiffness=0,
        load=pair.load,
        flank_positions=(-pair.backlash, 0.0),
        stiffness=[(max_stiffness, max_stiffness * kappa)] * 2,
        damping=(pair.material_damping, pair.backlash_damping, pair.material_damping),
        segments=constant_segments([timing], common_period=1),
        **_pair_units(pair),
    )


def _build_equation_model(model, tuning: float) -> BallModel:
    """Build the `BallModel` of a model with one degree of freedom from its `Equation`.

    The tuning nu (mesh frequency over natural frequency) is taken as an exact number. It is needed
    because the force of a profile deviation is proportional to its square.
    """
    arb, equation = flint().arb, model.equation
    drive_side, coast_side = equation.stiffness_of_both_sides()
    harmonics = []
    for order, cosine, sine in equation.force.tolist():
        harmonics.append((order, arb(cosine), arb(sine)))
    # A profile deviation f causes the inertia force f''.
    for order, cosine, sine in equation.deviation.tolist():
        derivative_factor = -((arb(tuning) * order) ** 2)
        harmonics.append((order, derivative_factor * cosine, derivative_factor * sine))
    force_harmonics: dict = {}
    for order, cosine, sine in harmonics:
        amplitudes = force_harmonics.setdefault(Fraction(order), np.full((2, 1), arb(0)))
        amplitudes[:, 0] += cosine, sine
    # On segment i both sides have the stiffness level i and the sliding sign 1 (no friction).
    starts = [0.0, *drive_side.breakpoints[1:-1].tolist()]
    segments = [Segment(arb(start), [[(i, 1), (i, 1)]]) for i, start in enumerate(starts)]
    return _build_one_degree_model(
        mass=1,
        ground_stiffness=equation.ground_stiffness,
        load=equation.load,
        flank_positions=(equation.lower, equation.upper),
        stiffness=[side.values_and_slopes[:, 0].tolist() for side in (coast_side, drive_side)],
        damping=equation.damping[:, 0].tolist(),
        segments=segments,
        length=arb(1),
        frequency=arb(1),
        force_harmonics=force_harmonics,
    )


def _build_train_model(train, tuning: float) -> BallModel:
    """Build the `BallModel` of a `GearTrain`, whose coefficients are balls (intervals).

    They do not depend on `tuning`, which is an argument of all builders.
    """
    arb, arithmetic = flint().arb, ball_arithmetic()
    structure = train.assemble(arithmetic)
    coast_rows = coast_jacobian(structure, train.by_name, train.meshes, arithmetic)
    harmonics, constants = excitation_harmonics(train, structure.line_vectors, arithmetic)
    meshes = []
    for j, mesh in enumerate(train.meshes):
        max_stiffness = arb(mesh.max_stiffness)
        coast_constant, drive_constant = constants[:, j]
        # With infinite backlash there is no coast-side contact and no flank distance.
        coast_constant = None if math.isinf(mesh.backlash) else coast_constant + mesh.backlash
        # The phase of the pitch point in mesh periods is rounded once, and exact thereafter.
        pitch_phase = Fraction(train.pitch_phases[mesh.name] / math.tau)
        thickness = thickness_difference(mesh, train.speeds_at(mesh))
        timing = MeshTiming(
            overlap=Fraction(mesh.contact_ratio) - 1,
            has_switches=mesh.stiffness_ratio != 1.0,
            has_friction=any(mesh.friction),
            rate=train.frequency_ratios[j],
            phases=(Fraction(train.coast_phases[mesh.name]), Fraction(train.phases[mesh.name])),
            pitch_phases=(pitch_phase + thickness / 2, pitch_phase),
        )
        drive_friction, coast_friction = map(arb, mesh.friction)  # in the order of the train
        meshes.append(
            BallMesh(
                name=mesh.name,
                rows=(coast_rows[j], structure.mesh_jacobian[j]),
                constants=(coast_constant, drive_constant),
                stiffness=((max_stiffness, max_stiffness * mesh.stiffness_ratio),) * 2,
                damping=(arb(mesh.known_damping),) * 2,  # an error is raised if it is unknown
                backlash_damping=arb(mesh.backlash_damping),
                timing=timing,
                harmonics={
                    frequency: amplitudes[:, j].tolist()
                    for frequency, amplitudes in harmonics.items()
                    if not (amplitudes[:, j] == 0).all()
                },
                sliding_row=structure.sliding_jacobian[j] if timing.has_friction else None,
                friction=(coast_friction, drive_friction),
                clearance_varies=mesh.moving_backlash or mesh.coast_deviation != mesh.deviation,
            )
        )
    return BallModel(
        coordinates=tuple(f"{name} {axis}" for name, axis in structure.coordinates),
        mass=structure.mass,
        stiffness=structure.stiffness,
        damping=structure.damping,
        load=structure.load,
        meshes=tuple(meshes),
        segments=constant_segments([mesh.timing for mesh in meshes], common_period=train.repeats),
        length=arb(train.static_deflection),
        frequency=arb(train.reference_angular_frequency),
        force_harmonics=force_harmonics(train, structure.motions, arithmetic),
        derived={name: getattr(train, name) for name in _DERIVED_NUMBERS},
    )


def _build_six_degree_model(model, tuning: float) -> BallModel:
    """Build the `BallModel` of a `SixDegreePair` from its train, but with its own units.

    The coefficients are balls (intervals) and do not depend on `tuning`.
    """
    train = TwoGears(gears=model, arithmetic=ball_arithmetic())
    # u3 and u2 are rotations, as displacements along the line of action; y is along and z across
    # it.
    coordinates = ("u3", "u2", *(BEARINGS[i] for i in model.elastic_bearings()))
    return _build_train_model(train, tuning)._replace(
        coordinates=coordinates, derived={}, **_pair_units(model.pair)
    )
