"""Trains, and the pair of six degrees, in balls: their matrices and meshes from SI numbers.

    M q'' + D q' + K q = f - sum over meshes of (b_drive P + b_coast Q) - friction across them

with the elements and forces of `gearlib.models.trains.structure` and `gearlib.models.six_degrees`,
in m, N and s. All floating-point numbers of the model are exact numbers. So are, of a train, the
phases of its meshes, counted in mesh periods, and the two units that the library derives: static
deflection and reference frequency. Speeds are fractions of tooth numbers.
"""

import math
from fractions import Fraction
from typing import Any, NamedTuple

import numpy as np

from gearlib.analysis.proofs.balls import flint
from gearlib.analysis.proofs.certificate_files import Uncertain
from gearlib.analysis.proofs.path import DRIVE
from gearlib.models.trains import turning
from gearlib.models.trains.elastic import linear
from gearlib.models.trains.structure import Numbers, Structure, far_lines
from gearlib.models.trains.two_gears import TwoGears
from gearlib.models.trains.waves import excited


class MeshParts(NamedTuple):
    """One mesh; pairs are (coast side, drive side), rows are functionals of the n coordinates."""

    name: str
    lines: tuple  #: b: distances over the flanks are b q + constant + waves
    across: Any  #: of the axes, the way of the sliding past the pitch point
    constants: tuple  #: m, the backlash included; of the coast side None where there is none
    waves: dict  #: frequency by phase, `Fraction` -> rows (cosine, sine) of both sides, m
    levels: tuple  #: upper and lower stiffness, N/m
    damping: Any  #: in contact, N s/m
    film: Any  #: in the backlash
    friction: tuple
    rate: Fraction  #: mesh periods in one of the reference mesh
    phases: tuple  #: middle of the upper level, in mesh periods, `Fraction`
    pitches: tuple  #: where the sliding of both sides turns, after the phase of the drive side
    overlap: Fraction  #: contact ratio - 1
    moving: bool  #: whether the play between the flanks changes, so that it might close

    def cuts(self):
        """Return the phases in mesh periods at which stiffness or sliding changes."""
        found = set()
        if self.levels[0] != self.levels[1] and 0 < self.overlap < 1:
            found = {g + side * self.overlap / 2 for g in self.phases for side in (1, -1)}
        if any(share != 0 for share in self.friction):
            turns = {self.phases[DRIVE] + pitch for pitch in self.pitches}
            found |= {turn + half for turn in turns for half in (0, Fraction(1, 2))}
        return found

    def low(self, side, turns):
        """Return whether the stiffness is at its lower level after so many mesh periods."""
        away = abs((turns - self.phases[side] + Fraction(1, 2)) % 1 - Fraction(1, 2))
        return self.overlap == 0 or away > self.overlap / 2

    def sense(self, side, turns):
        """Return the direction of the sliding after so many mesh periods."""
        since = (turns - self.phases[DRIVE] - self.pitches[side]) % 1
        return 1 if since < Fraction(1, 2) else -1


class Parts(NamedTuple):
    """A model of n coordinates."""

    names: tuple  #: of the coordinates
    structure: Structure  #: in balls
    meshes: tuple
    length: Any  #: the unit of displacements, m
    frequency: Any  #: what the tuning is counted in, rad/s
    derived: dict  #: numbers that the library derives from the model, here exact ones
    floats: Structure  #: for its springs and masses

    def linear(self):
        """Return the `Linear` model with all flanks in contact at their upper levels."""
        rows = [[float(value) for value in mesh.lines[DRIVE]] for mesh in self.meshes]
        levels = [float(mesh.levels[0]) for mesh in self.meshes]
        directions, values = self.floats.springs
        springs = np.concatenate([directions, rows]), np.concatenate([values, levels])
        return linear(springs, self.floats.masses)

    def in_contact(self):
        """Return the stiffness with all flanks in contact at their upper levels, shape (n, n)."""
        total = self.structure.stiffness.copy()
        for mesh in self.meshes:
            total += mesh.levels[0] * np.outer(mesh.lines[DRIVE], mesh.lines[DRIVE])
        return total


def parts_of(model):
    """Return the `Parts` of a model."""
    kinds = {"several_meshes": _of_train, "piecewise_linear": _of_pair}
    kind = kinds.get(model.propagators.get("exact")) if model.equation is None else None
    if kind is not None:
        return kind(model)
    raise Uncertain(
        "model",
        "proofs are written for trains, and for one degree of freedom with linear phases of "
        f"contact, not for this {type(model).__name__}",
    )


def balls():
    """Return the balls of the present precision as `Numbers`, for the assembly of a train."""
    arb = flint().arb

    def cos_sin(angle):
        sine, cosine = arb(angle).sin_cos()
        return cosine, sine

    def polar(x, y):
        return (x * x + y * y).sqrt(), arb.atan2(y, x)

    return Numbers(object, arb, cos_sin, polar, arb.pi())


def _turns(angle):
    """Return an angle in turns, rounded once and exact from there on."""
    return Fraction(angle / (2.0 * math.pi))


def _of_train(train, floats=None):
    if train.gyroscopic:
        raise Uncertain(
            "model", "no proof is written for a train whose axes feel the turning of their frame"
        )
    arb, numbers = flint().arb, balls()
    found = train.assembled(numbers)
    far = far_lines(found, train.by_name, train.meshes, numbers)
    rows, constants = excited(train, found.arms, numbers)
    meshes = []
    for j, mesh in enumerate(train.meshes):
        waves = {
            frequency: entry[:, j].tolist()
            for frequency, entry in rows.items()
            if not all(value == 0 for value in entry[:, j].flat)
        }
        coast, drive = constants[:, j]
        pitch = _turns(train.pitch_phases[mesh.name])
        names = train.inverse_phases[mesh.name], train.phases[mesh.name]
        meshes.append(
            MeshParts(
                mesh.name,
                (far[j], found.lines[j]),
                found.across[j],
                (None if math.isinf(mesh.backlash) else coast + mesh.backlash, drive),
                waves,
                (arb(mesh.max_stiffness), arb(mesh.max_stiffness) * mesh.stiffness_ratio),
                arb(mesh.known_damping),
                arb(mesh.backlash_damping),
                tuple(map(arb, mesh.friction[::-1])),
                train.rates[j],
                tuple(map(Fraction, names)),
                (pitch + turning.thicker(mesh, train.speeds) / 2, pitch),
                Fraction(mesh.contact_ratio) - 1,
                mesh.moving_backlash or mesh.inverse_deviation != mesh.deviation,
            )
        )
    return Parts(
        tuple(f"{name} {axis}" for name, axis in found.coordinates),
        found,
        tuple(meshes),
        arb(train.static_deflection),
        arb(train.reference_angular_frequency),
        {
            "static_deflection": train.static_deflection,
            "reference_angular_frequency": train.reference_angular_frequency,
            "phases": dict(train.phases),
            "inverse_phases": dict(train.inverse_phases),
        },
        (floats or train).structure,
    )


def _of_pair(model):
    """Return the `Parts` of a `SixDegreePair`: of its train, whose units are exact too."""
    arb, pair = flint().arb, model.pair
    kappa, overlap = arb(pair.stiffness_ratio), arb(pair.contact_ratio) - 1
    mean = arb(pair.max_stiffness) * (kappa * (1 - overlap) + overlap)
    found = _of_train(TwoGears(gears=model, numbers=balls()), model.train)
    return found._replace(
        names=("u3", "u2", *(("y3", "z3", "y2", "z2")[i] for i in model.flexible())),
        length=arb(pair.load) / mean,
        frequency=(mean / pair.reduced_mass).sqrt(),
        derived={},
    )
