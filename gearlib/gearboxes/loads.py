"""Torques and speeds of a gearbox in a load case, computed from the stated ones.

A rotor is a set of parts that turn together: shafts, carriers and all that couplings join to them.
A mesh of the rotors a and b with z_a and z_b teeth, whose axes a rotor c carries, requires for the
speeds w

    z_a (w_a - w_c) + z_b (w_b - w_c) = 0,        z_b < 0 for a ring gear,

and its torque per tooth, L, loads these rotors with z_a L, z_b L and -(z_a + z_b) L. Rotors that a
coupling joins to the casing stand still. Speeds follow from the first equations, torques from the
balance of all rotors that turn. Angles, speeds and torques are positive counterclockwise.
"""

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from gearlib.checks import InputError
from gearlib.gearboxes.rexs import Component

if TYPE_CHECKING:
    from gearlib.gearboxes.gearbox import Gearbox

#: Largest relative difference between stated torques or speeds that counts as rounding.
_ROUNDING = 1e-3


class Loads(NamedTuple):
    """Torques and speeds in a load case."""

    speeds: dict[str, float] | None  #: component id -> rpm; None: no speed is stated
    torques: dict[str, float]  #: id of an external load -> torque on its shaft, N m
    pinion_torques: dict[str, float]  #: stage -> torque of the shaft on the pinion, N m
    pinion_speeds: dict[str, float] | None  #: stage -> rpm relative to the line of centres
    #: Stage -> speed of its pinion relative to the line of centres, up to a common factor.
    motions: dict[str, float]
    rotor_motions: dict[str, float]  #: rotor -> speed, up to the same factor
    external: list[tuple[Component, Component]]  #: external loads and the parts on which they act
    missing: InputError | None  #: error that says why the torques are unknown
    notes: list[str]  #: contradictions in the file

    def motion_of(self, box: "Gearbox", key: str) -> float:
        """Return the speed of the component with the id `key`, up to the common factor."""
        return self.rotor_motions.get(box.rotors.rotor(key), 0.0)


class Rotors:
    """The rotors of a gearbox, named by the id of one of their parts, and their kinematics."""

    def __init__(self, box: "Gearbox"):
        """Find the parts that turn together, and the rotors of all meshes.

        A rotor is a set of parts that turn together. Carriers and couplings join parts to one
        rotor; a coupling to the casing holds its other end, so that this rotor stands still.
        """
        model, self.box = box.model, box
        self._parents: dict[str, str] = {}  # id of a part -> id of a part of the same rotor
        self.casings = {part.id for part in model.of_type("gear_casing")}
        for carrier in model.of_type("planet_carrier"):
            for part in model.parts_of(carrier):
                self._join(carrier.id, part.id)
        for stage in model.of_type("planetary_stage"):
            carriers = [part for part in model.parts_of(stage) if part.type == "planet_carrier"]
            for relation in ("planet_pin", "planet_carrier_shaft"):
                for parts in model.related(relation, planetary_stage=stage):
                    for carrier in carriers:
                        self._join(carrier.id, parts["shaft"].id)
        held_parts = []
        for coupling in box.couplings:
            ends = [coupling.inner[0].id, coupling.outer[0].id]
            free_ends = [end for end in ends if end not in self.casings]
            if len(free_ends) == 1:
                held_parts += free_ends
            elif len(free_ends) == 2:
                self._join(*free_ends)
        #: Rotors that stand still.
        self.held = {self.rotor(part_id) for part_id in held_parts}
        self.stages = list(box.stages.values())
        #: For each stage the rotors of pinion, wheel and carrier.
        self.meshing = [self._rotors_of(stage) for stage in self.stages]
        #: Rotors that take part in a mesh.
        self.turning = {rotor for rotors in self.meshing for rotor in rotors if rotor}
        #: Rotors that take part in a mesh and are not held by the casing.
        self.free = sorted(self.turning - self.held)

    def rotor(self, key: str) -> str:
        """Return the name of the rotor to which a component belongs.

        `key` is the id of the component. The name is the id of one part of the rotor.
        """
        while key in self._parents:
            key = self._parents[key]
        return key

    def _join(self, key_1: str, key_2: str) -> None:
        """Join the rotors of two components, given by their ids, to one rotor."""
        rotor_1, rotor_2 = self.rotor(key_1), self.rotor(key_2)
        if rotor_1 != rotor_2:
            self._parents[rotor_2] = rotor_1

    def _rotors_of(self, stage) -> tuple:
        """Return the names of the rotors of pinion, wheel and carrier of a stage.

        The last name is "" if the axes of both gears are fixed in the casing.
        """
        pinion_rotor = self.rotor(self.box.shaft_of[stage.pinion.id].id)
        wheel_rotor = self.rotor(self.box.shaft_of[stage.wheel.id].id)
        carrier_rotor = self.rotor(stage.carrier) if stage.carrier else ""
        return pinion_rotor, wheel_rotor, carrier_rotor

    def matrix(self) -> np.ndarray:
        """Return the matrix of the mesh equations for the speeds of the free rotors.

        A free rotor takes part in a mesh and is not held by the casing. Each mesh requires z_a (w_a
        - w_c) + z_b (w_b - w_c) = 0 for the speeds w of pinion a, wheel b and carrier c with the
        numbers of teeth z_a and z_b. The shape of the matrix is (stages, free rotors).
        """
        matrix = np.zeros((len(self.stages), len(self.free)))
        for row, stage, rotors in zip(matrix, self.stages, self.meshing, strict=True):
            z_pinion, z_wheel = stage.signed_teeth
            factors = z_pinion, z_wheel, -z_pinion - z_wheel
            for rotor, factor in zip(rotors, factors, strict=True):
                if rotor in self.free:
                    row[self.free.index(rotor)] += factor
        return matrix

    def free_motions(self, matrix: np.ndarray) -> np.ndarray:
        """Return a basis of the speeds of the free rotors that all meshes allow.

        It is the null space of `matrix`, the matrix of the mesh equations. The basis has the shape
        (free rotors, f) for f degrees of freedom of the gearbox.
        """
        _, values, vectors = np.linalg.svd(matrix)
        rank = int((values > 1e-9 * values.max(initial=1.0)).sum())
        return vectors[rank:].T

    def column(self, part: Component) -> np.ndarray:
        """Return the unit vector of the rotor of a component among the free rotors.

        Its product with the speeds of all free rotors is the speed of the component. It is zero if
        the rotor of the component is held by the casing or takes part in no mesh.
        """
        return np.array([float(rotor == self.rotor(part.id)) for rotor in self.free])


def solve(box: "Gearbox", case: str | None) -> Loads:
    """Return the torques and speeds of a gearbox in a load case.

    `case` is the name of the load case, or None for a file without load cases. Raises ValueError if
    the meshes allow no motion.
    """
    model, rotors = box.model.in_case(case), box.rotors
    notes: list[str] = []
    matrix = rotors.matrix()
    motions = rotors.free_motions(matrix)
    if not motions.size:
        raise InputError("stages", problem="are locked: it must be possible to turn them")
    speeds = _speeds(box, model, rotors, motions, notes)
    torques, missing = _torques(box, model, rotors, motions, notes)
    pinion_torques = {}
    if missing is None:
        rotor_torques = sum(
            torques[load.id] * rotors.column(part) for load, part in _external_loads(model)
        )
        # Each mesh loads its rotors in proportion to the coefficients of its equation. Together the
        # meshes balance the external torques.
        torques_per_tooth = np.linalg.lstsq(matrix.T, -rotor_torques, rcond=1e-9)[0]
        for stage, torque_per_tooth in zip(rotors.stages, torques_per_tooth, strict=True):
            pinion_torques[stage.name] = -stage.signed_teeth[0] * float(torque_per_tooth)
    relative_speeds = speeds
    if relative_speeds is None:
        # Choose the direction of motion in which the first stated torque does positive work. The
        # magnitude of these speeds has no meaning.
        relative_speeds = motions[:, 0]
        for load, part in _external_loads(model):
            if load.number("torque_around_u_axis", "N m"):
                power = torques[load.id] * float(rotors.column(part) @ relative_speeds)
                relative_speeds = math.copysign(1.0, power) * relative_speeds
                break
    rotor_motions = dict(zip(rotors.free, relative_speeds.tolist(), strict=True))
    pinion_motions = {}
    for stage, (pinion_rotor, _, carrier_rotor) in zip(rotors.stages, rotors.meshing, strict=True):
        carrier_motion = rotor_motions.get(carrier_rotor, 0.0)
        pinion_motions[stage.name] = rotor_motions.get(pinion_rotor, 0.0) - carrier_motion
    part_speeds = pinion_speeds = None
    if speeds is not None:
        part_speeds = {key: rotor_motions.get(rotors.rotor(key), 0.0) for key in model.components}
        pinion_speeds = pinion_motions
    return Loads(
        speeds=part_speeds,
        torques=torques,
        pinion_torques=pinion_torques,
        pinion_speeds=pinion_speeds,
        motions=pinion_motions,
        rotor_motions=rotor_motions,
        external=_external_loads(model),
        missing=missing,
        notes=notes,
    )


def _external_loads(model) -> list[tuple[Component, Component]]:
    """Return the external loads of a `RexsModel` as pairs (load, part on which it acts).

    Loads on the gear unit or the casing are left out, as are loads that transmit no torque.
    """
    external_loads = []
    for load in model.of_type("external_load"):
        for parts in model.related("assembly", part=load):
            is_external = parts["assembly"].type not in ("gear_unit", "gear_casing")
            has_torque = load.is_true("transmits_torque") is not False or load.value(
                "torque_around_u_axis"
            )
            if is_external and has_torque:
                external_loads.append((load, parts["assembly"]))
    return external_loads


def _speeds(box, model, rotors, motions, notes) -> np.ndarray | None:
    """Return the speeds of the free rotors in rpm, or None if the file does not state enough.

    `model` is the `RexsModel` in the load case, and `motions` is a basis of the speeds that the
    meshes allow, shape (free rotors, f). Shafts marked as defining the speed have priority over
    others. A stated speed that contradicts the numbers of teeth is added to `notes`, a list of
    strings.
    """
    stated, defining = [], []
    for part in model.of_type("shaft"):
        speed = part.number("rotational_speed", "rpm")
        if speed and rotors.column(part).any():
            stated.append((part, speed * box.places.direction(part)))
            if part.is_true("defines_speed"):
                defining.append(stated[-1])
    defining = defining or stated
    if not defining:
        return None
    columns = np.array([rotors.column(part) for part, _ in defining])
    values = np.array([speed for _, speed in defining])
    if np.linalg.matrix_rank(columns @ motions, 1e-9) < motions.shape[1]:
        return None  # The stated speeds do not determine those of all rotors.
    speeds = motions @ np.linalg.lstsq(columns @ motions, values, rcond=None)[0]
    for part, stated_speed in stated:
        speed = float(rotors.column(part) @ speeds)
        if abs(speed - stated_speed) > _ROUNDING * abs(speeds).max():
            notes.append(
                f"rotational_speed of {part} is {stated_speed:g} rpm, but by the teeth "
                f"{speed:.6g} rpm"
            )
    return speeds


def _torques(box, model, rotors, motions, notes) -> tuple[dict[str, float], InputError | None]:
    """Return the torques of external loads in N m by id, and an error if one of them is missing.

    `model` is the `RexsModel` in the load case, and `motions` is a basis of the speeds that the
    meshes allow, shape (free rotors, f). In equilibrium all external torques together do no work on
    any of these motions; this gives the torques that are not stated. A stated torque that
    contradicts the balance is added to `notes`, a list of strings.
    """
    # `followers` are stated torques that may be corrected. Both lists hold pairs (load, work of a
    # unit torque on the motions).
    torques, unknown, followers = {}, [], []
    for load, part in _external_loads(model):
        torque = load.number("torque_around_u_axis", "N m")
        direction = box.places.direction(part)
        works = motions.T @ rotors.column(part)
        if torque is None and works.any():
            unknown.append((load, works))
        elif torque is not None and not load.is_true("defines_torque") and works.any():
            followers.append((load, works))
        torques[load.id] = (torque or 0.0) * direction
    if not any(torques.values()):
        loads = [load for load, _ in _external_loads(model)] or model.of_type("gear_unit")
        problem = "is missing: it must be given for the load of the stages"
        owner = str(loads[0]) if loads else "the gear unit"
        return torques, InputError("torque_around_u_axis", problem=problem, owner=owner)

    def total_work() -> np.ndarray:
        """Return the work of all torques on each motion that the meshes allow, shape (f,)."""
        loads = _external_loads(model)
        return sum(torques[load.id] * (motions.T @ rotors.column(part)) for load, part in loads)

    imbalance, scale = total_work(), max(map(abs, torques.values())) * abs(motions).max()
    if not unknown and abs(imbalance).max() > 1e-9 * scale:
        # The stated torques are rounded, or one of them follows from the others. Correct as many
        # of them as there are degrees of freedom.
        if not followers:
            for load, part in _external_loads(model):
                followers.append((load, motions.T @ rotors.column(part)))
        unknown = followers[-motions.shape[1] :]
    if not unknown:
        return torques, None
    work_matrix = np.array([works for _, works in unknown]).T
    if np.linalg.matrix_rank(work_matrix, 1e-9) < len(unknown):  # too few equations
        problem = "is missing: it must be given for this load, or for all other loads"
        owner = str(unknown[-1][0])
        return torques, InputError("torque_around_u_axis", problem=problem, owner=owner)
    stated = [torques[load.id] for load, _ in unknown]
    balanced = np.linalg.lstsq(work_matrix, work_matrix @ stated - imbalance, rcond=None)[0]
    for (load, _), old, new in zip(unknown, stated, balanced.tolist(), strict=True):
        torques[load.id] = new
        if old and abs(new - old) > _ROUNDING * abs(new):
            notes.append(f"torque of {load} is {old:g} N m, but by balance {new:.6g} N m")
    if abs(total_work()).max() > 1e-6 * scale:
        problem = "do not balance: another load must be given, on a shaft that takes their torque"
        owner = "the external loads"
        return torques, InputError("torque_around_u_axis", problem=problem, owner=owner)
    return torques, None
