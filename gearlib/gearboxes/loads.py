"""Torques and speeds of a gearbox in a load case, computed from those stated in the file.

A rotor is a set of parts that turn together, such as shafts and carriers joined by couplings. Let a
mesh connect the rotors a and b, with z_a and z_b teeth (z_b < 0 for a ring gear), and let a carrier
c carry their axes. Their speeds w satisfy the kinematic equation

    z_a (w_a - w_c) + z_b (w_b - w_c) = 0,

and the torque per tooth, L, loads the three rotors with z_a L, z_b L and -(z_a + z_b) L. Rotors
that a coupling joins to the casing are fixed. The speeds follow from the kinematic equations, the
torques from the equilibrium of the free rotors. Angles, speeds and torques are positive
counterclockwise.
"""

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from gearlib.checks import InputError
from gearlib.gearboxes.rexs import Component

if TYPE_CHECKING:
    from gearlib.gearboxes.gearbox import Gearbox

#: Relative differences of stated torques or speeds up to this value are rounding errors.
_ROUNDING_TOLERANCE = 1e-3


class Loads(NamedTuple):
    """Torques and speeds in a load case."""

    speeds: dict[str, float] | None  #: component id -> rpm; None: unknown
    torques: dict[str, float]  #: id of an external load -> its torque, N m
    pinion_torques: dict[str, float]  #: stage -> torque of the shaft on the pinion, N m
    pinion_speeds: dict[str, float] | None  #: stage -> rpm relative to the line of centres
    #: Stage -> speed of the pinion relative to the line of centres, up to a common factor.
    pinion_motions: dict[str, float]
    rotor_motions: dict[str, float]  #: rotor -> speed, up to the same factor
    external_loads: list[tuple[Component, Component]]  #: (load, part on which it acts)
    torque_error: InputError | None  #: reason why the torques are unknown
    notes: list[str]  #: contradictions in the file

    def component_motion(self, gearbox: "Gearbox", component_id: str) -> float:
        """Return the speed of a component, up to the common factor of all speeds."""
        return self.rotor_motions.get(gearbox.rotors.find_rotor(component_id), 0.0)


class Rotors:
    """The rotors of a gearbox, named by the id of one of their parts, and their kinematics."""

    def __init__(self, gearbox: "Gearbox"):
        """Determine the rotors, i.e. the sets of parts that turn together.

        Carriers and couplings join parts to one rotor. A coupling to the casing fixes the rotor at
        its other end.
        """
        model, self.gearbox = gearbox.model, gearbox
        self._parents: dict[str, str] = {}  # id of a part -> id of a part of the same rotor
        self.casings = {part.id for part in model.components_of_type("gear_casing")}
        for carrier in model.components_of_type("planet_carrier"):
            for part in model.parts_of(carrier):
                self._join(carrier.id, part.id)
        for stage in model.components_of_type("planetary_stage"):
            carriers = [part for part in model.parts_of(stage) if part.type == "planet_carrier"]
            for relation in ("planet_pin", "planet_carrier_shaft"):
                for parts in model.find_relations(relation, planetary_stage=stage):
                    for carrier in carriers:
                        self._join(carrier.id, parts["shaft"].id)
        fixed_part_ids = []
        for coupling in gearbox.couplings:
            ends = [coupling.inner[0].id, coupling.outer[0].id]
            free_ends = [end for end in ends if end not in self.casings]
            if len(free_ends) == 1:
                fixed_part_ids += free_ends
            elif len(free_ends) == 2:
                self._join(*free_ends)
        #: Rotors that are joined to the casing.
        self.fixed_rotors = {self.find_rotor(part_id) for part_id in fixed_part_ids}
        self.stages = list(gearbox.stages.values())
        #: For each stage, the rotors of pinion, wheel and carrier.
        self.mesh_rotors = [self._find_mesh_rotors(stage) for stage in self.stages]
        #: Rotors with at least one mesh.
        self.meshing_rotors = {rotor for rotors in self.mesh_rotors for rotor in rotors if rotor}
        #: Rotors with at least one mesh that are not fixed.
        self.free_rotors = sorted(self.meshing_rotors - self.fixed_rotors)

    def find_rotor(self, component_id: str) -> str:
        """Return the name of the rotor of a component, which is the id of one of its parts."""
        while component_id in self._parents:
            component_id = self._parents[component_id]
        return component_id

    def _join(self, id_1: str, id_2: str) -> None:
        """Merge the rotors of two components, given by their ids."""
        rotor_1, rotor_2 = self.find_rotor(id_1), self.find_rotor(id_2)
        if rotor_1 != rotor_2:
            self._parents[rotor_2] = rotor_1

    def _find_mesh_rotors(self, stage) -> tuple:
        """Return the names of the rotors of pinion, wheel and carrier of a stage.

        The last name is "" if the axes of both gears are fixed in the casing.
        """
        pinion_rotor = self.find_rotor(self.gearbox.shaft_of[stage.pinion.id].id)
        wheel_rotor = self.find_rotor(self.gearbox.shaft_of[stage.wheel.id].id)
        carrier_rotor = self.find_rotor(stage.carrier) if stage.carrier else ""
        return pinion_rotor, wheel_rotor, carrier_rotor

    def mesh_equations(self) -> np.ndarray:
        """Return the matrix of the kinematic equations, shape (stages, free rotors).

        Each mesh requires z_a (w_a - w_c) + z_b (w_b - w_c) = 0 for the speeds w of pinion a, wheel
        b and carrier c with the numbers of teeth z_a and z_b.
        """
        matrix = np.zeros((len(self.stages), len(self.free_rotors)))
        for row, stage, rotors in zip(matrix, self.stages, self.mesh_rotors, strict=True):
            z_pinion, z_wheel = stage.signed_teeth
            factors = z_pinion, z_wheel, -z_pinion - z_wheel
            for rotor, factor in zip(rotors, factors, strict=True):
                if rotor in self.free_rotors:
                    row[self.free_rotors.index(rotor)] += factor
        return matrix

    def allowed_motions(self, matrix: np.ndarray) -> np.ndarray:
        """Return a basis of the speeds that satisfy all mesh equations, shape (free rotors, f).

        It spans the null space of `matrix`, the matrix of the equations; f is the number of degrees
        of freedom of the gearbox.
        """
        _, values, vectors = np.linalg.svd(matrix)
        rank = int((values > 1e-9 * values.max(initial=1.0)).sum())
        return vectors[rank:].T

    def selector(self, part: Component) -> np.ndarray:
        """Return the vector that selects the rotor of a component from the free rotors.

        Its product with the speeds of the free rotors is the speed of the component. It is zero if
        the rotor is fixed or has no mesh.
        """
        return np.array([float(rotor == self.find_rotor(part.id)) for rotor in self.free_rotors])


def compute_loads(gearbox: "Gearbox", case: str | None) -> Loads:
    """Compute the torques and speeds of a gearbox in a load case.

    `case` is the name of the load case, or None for a file without load cases. Raise an
    `InputError` if the gearbox is locked.
    """
    model, rotors = gearbox.model.with_load_case(case), gearbox.rotors
    notes: list[str] = []
    matrix = rotors.mesh_equations()
    motions = rotors.allowed_motions(matrix)
    if not motions.size:
        raise InputError("stages", problem="are locked: it must be possible to turn them")
    speeds = _compute_speeds(gearbox, model, rotors, motions, notes)
    torques, torque_error = _compute_torques(gearbox, model, rotors, motions, notes)
    pinion_torques = {}
    if torque_error is None:
        rotor_torques = sum(
            torques[load.id] * rotors.selector(part) for load, part in _find_external_loads(model)
        )
        # The torques of a mesh on its rotors are proportional to the coefficients of its equation.
        # Together, the meshes balance the external torques.
        torques_per_tooth = np.linalg.lstsq(matrix.T, -rotor_torques, rcond=1e-9)[0]
        for stage, torque_per_tooth in zip(rotors.stages, torques_per_tooth, strict=True):
            pinion_torques[stage.name] = -stage.signed_teeth[0] * float(torque_per_tooth)
    relative_speeds = speeds
    if relative_speeds is None:
        # The first stated torque does positive work in the chosen direction of motion. The
        # magnitude of these speeds is arbitrary.
        relative_speeds = motions[:, 0]
        for load, part in _find_external_loads(model):
            if load.get_number("torque_around_u_axis", "N m"):
                power = torques[load.id] * float(rotors.selector(part) @ relative_speeds)
                relative_speeds = math.copysign(1.0, power) * relative_speeds
                break
    rotor_motions = dict(zip(rotors.free_rotors, relative_speeds.tolist(), strict=True))
    pinion_motions = {}
    for stage, (pinion_rotor, _, carrier_rotor) in zip(
        rotors.stages, rotors.mesh_rotors, strict=True
    ):
        carrier_motion = rotor_motions.get(carrier_rotor, 0.0)
        pinion_motions[stage.name] = rotor_motions.get(pinion_rotor, 0.0) - carrier_motion
    part_speeds = pinion_speeds = None
    if speeds is not None:
        part_speeds = {
            key: rotor_motions.get(rotors.find_rotor(key), 0.0) for key in model.components
        }
        pinion_speeds = pinion_motions
    return Loads(
        speeds=part_speeds,
        torques=torques,
        pinion_torques=pinion_torques,
        pinion_speeds=pinion_speeds,
        pinion_motions=pinion_motions,
        rotor_motions=rotor_motions,
        external_loads=_find_external_loads(model),
        torque_error=torque_error,
        notes=notes,
    )


def _find_external_loads(model) -> list[tuple[Component, Component]]:
    """Return the external loads of a `RexsModel` as pairs (load, part on which it acts).

    Loads on the gear unit or the casing and loads without torque are skipped.
    """
    external_loads = []
    for load in model.components_of_type("external_load"):
        for parts in model.find_relations("assembly", part=load):
            is_external = parts["assembly"].type not in ("gear_unit", "gear_casing")
            has_torque = load.is_true("transmits_torque") is not False or load.get_value(
                "torque_around_u_axis"
            )
            if is_external and has_torque:
                external_loads.append((load, parts["assembly"]))
    return external_loads


def _compute_speeds(gearbox, model, rotors, motions, notes) -> np.ndarray | None:
    """Compute the speeds of the free rotors in rpm; return None if the file states too few.

    `model` is the `RexsModel` in the load case, and `motions` is a basis of the allowed speeds,
    shape (free rotors, f). Shafts with the attribute "defines_speed" have priority. Stated speeds
    that contradict the numbers of teeth are reported in `notes`, a list of strings.
    """
    stated, defining = [], []
    for part in model.components_of_type("shaft"):
        speed = part.get_number("rotational_speed", "rpm")
        if speed and rotors.selector(part).any():
            stated.append((part, speed * gearbox.positions.direction(part)))
            if part.is_true("defines_speed"):
                defining.append(stated[-1])
    defining = defining or stated
    if not defining:
        return None
    selectors = np.array([rotors.selector(part) for part, _ in defining])
    values = np.array([speed for _, speed in defining])
    if np.linalg.matrix_rank(selectors @ motions, 1e-9) < motions.shape[1]:
        return None  # The stated speeds do not determine all others.
    speeds = motions @ np.linalg.lstsq(selectors @ motions, values, rcond=None)[0]
    for part, stated_speed in stated:
        speed = float(rotors.selector(part) @ speeds)
        if abs(speed - stated_speed) > _ROUNDING_TOLERANCE * abs(speeds).max():
            notes.append(
                f"rotational_speed of {part} is {stated_speed:g} rpm, but by the teeth "
                f"{speed:.6g} rpm"
            )
    return speeds


def _compute_torques(
    gearbox, model, rotors, motions, notes
) -> tuple[dict[str, float], InputError | None]:
    """Return the external torques in N m by load id, and an error if they cannot be determined.

    Torques that are not stated follow from the principle of virtual work: in equilibrium, the
    external torques do no work on any allowed motion. `motions` is a basis of these, shape (free
    rotors, f), and `model` is the `RexsModel` in the load case. Stated torques that contradict the
    equilibrium are reported in `notes`, a list of strings.
    """
    # Pairs (load, work of a unit torque on the motions) of torques that are not stated, and of
    # stated torques that may be corrected.
    torques, unknown, adjustable = {}, [], []
    for load, part in _find_external_loads(model):
        torque = load.get_number("torque_around_u_axis", "N m")
        direction = gearbox.positions.direction(part)
        unit_work = motions.T @ rotors.selector(part)
        if torque is None and unit_work.any():
            unknown.append((load, unit_work))
        elif torque is not None and not load.is_true("defines_torque") and unit_work.any():
            adjustable.append((load, unit_work))
        torques[load.id] = (torque or 0.0) * direction
    if not any(torques.values()):
        loads = [load for load, _ in _find_external_loads(model)] or model.components_of_type(
            "gear_unit"
        )
        problem = "is missing: it must be given for the load of the stages"
        owner = str(loads[0]) if loads else "the gear unit"
        return torques, InputError("torque_around_u_axis", problem=problem, owner=owner)

    def total_work() -> np.ndarray:
        """Return the work of all torques on each allowed motion, shape (f,)."""
        loads = _find_external_loads(model)
        return sum(torques[load.id] * (motions.T @ rotors.selector(part)) for load, part in loads)

    imbalance, scale = total_work(), max(map(abs, torques.values())) * abs(motions).max()
    if not unknown and abs(imbalance).max() > 1e-9 * scale:
        # The stated torques are not in equilibrium, e.g. because they are rounded. Correct as many
        # of them as there are degrees of freedom.
        if not adjustable:
            for load, part in _find_external_loads(model):
                adjustable.append((load, motions.T @ rotors.selector(part)))
        unknown = adjustable[-motions.shape[1] :]
    if not unknown:
        return torques, None
    work_matrix = np.array([unit_work for _, unit_work in unknown]).T
    if np.linalg.matrix_rank(work_matrix, 1e-9) < len(unknown):
        problem = "is missing: it must be given for this load, or for all other loads"
        owner = str(unknown[-1][0])
        return torques, InputError("torque_around_u_axis", problem=problem, owner=owner)
    stated = [torques[load.id] for load, _ in unknown]
    balanced = np.linalg.lstsq(work_matrix, work_matrix @ stated - imbalance, rcond=None)[0]
    for (load, _), old_torque, torque in zip(unknown, stated, balanced.tolist(), strict=True):
        torques[load.id] = torque
        if old_torque and abs(torque - old_torque) > _ROUNDING_TOLERANCE * abs(torque):
            notes.append(f"torque of {load} is {old_torque:g} N m, but by balance {torque:.6g} N m")
    if abs(total_work()).max() > 1e-6 * scale:
        problem = "do not balance: another load must be given, on a shaft that takes their torque"
        owner = "the external loads"
        return torques, InputError("torque_around_u_axis", problem=problem, owner=owner)
    return torques, None
