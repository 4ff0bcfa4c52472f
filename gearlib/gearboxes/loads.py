"""Torques and speeds of a gearbox in a load case, from those that are stated.

Parts that turn together are a rotor: shafts, carriers and what couplings join. With z teeth, a mesh
of the rotors a and b, whose axes a rotor c carries, keeps

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

    speeds: dict[str, float] | None  #: component -> rpm; None: no speed is stated
    torques: dict[str, float]  #: external load -> N m on its shaft
    pinion_torques: dict[str, float]  #: stage -> N m of its shaft on the pinion
    pinion_speeds: dict[str, float] | None  #: stage -> rpm relative to the line of centres
    #: Speeds up to a common factor: stage -> of its pinion relative to the line of centres.
    motions: dict[str, float]
    rotor_motions: dict[str, float]  #: those of the rotors
    external: list[tuple[Component, Component]]  #: external loads and the parts on which they act
    missing: InputError | None  #: why there are no torques
    notes: list[str]

    def motion_of(self, box: "Gearbox", key: str) -> float:
        """Return the speed of the component with an id, up to the common factor."""
        return self.rotor_motions.get(box.rotors.rotor(key), 0.0)


class Rotors:
    """The rotors of a gearbox and their kinematics."""

    def __init__(self, box: "Gearbox"):
        model, self.box = box.model, box
        self._parents: dict[str, str] = {}
        self.casings = {part.id for part in model.of_type("gear_casing")}
        for carrier in model.of_type("planet_carrier"):
            for part in model.parts_of(carrier):
                self._join(carrier.id, part.id)
        for stage in model.of_type("planetary_stage"):
            carriers = [x for x in model.parts_of(stage) if x.type == "planet_carrier"]
            for relation in ("planet_pin", "planet_carrier_shaft"):
                for related in model.related(relation, planetary_stage=stage):
                    for carrier in carriers:
                        self._join(carrier.id, related["shaft"].id)
        held = []
        for coupling in box.couplings:
            ends = [coupling.inner[0].id, coupling.outer[0].id]
            turning = [end for end in ends if end not in self.casings]
            held += turning if len(turning) == 1 else []
            if len(turning) == 2:
                self._join(*turning)
        self.held = {self.rotor(end) for end in held}
        self.stages = list(box.stages.values())
        self.meshing = [self._rotors_of(stage) for stage in self.stages]
        #: Rotors that take part in a mesh, and those of them that turn.
        self.turning = {rotor for row in self.meshing for rotor in row if rotor}
        self.free = sorted(self.turning - self.held)

    def rotor(self, key: str) -> str:
        """Return the name of the rotor to which the component with an id belongs."""
        while key in self._parents:
            key = self._parents[key]
        return key

    def _join(self, first: str, second: str) -> None:
        first, second = self.rotor(first), self.rotor(second)
        if first != second:
            self._parents[second] = first

    def _rotors_of(self, stage) -> tuple:
        """Return the rotors of pinion, wheel and carrier of a stage; the last may be ""."""
        gears = (self.rotor(self.box.shaft_of[gear.id].id) for gear in (stage.pinion, stage.wheel))
        return (*gears, self.rotor(stage.carrier) if stage.carrier else "")

    def matrix(self) -> np.ndarray:
        """Return the rows of the equations of the meshes for the free rotors."""
        rows = np.zeros((len(self.stages), len(self.free)))
        for row, stage, rotors in zip(rows, self.stages, self.meshing, strict=True):
            pinion, wheel = stage.signed_teeth
            for rotor, value in zip(rotors, (pinion, wheel, -pinion - wheel), strict=True):
                if rotor in self.free:
                    row[self.free.index(rotor)] += value
        return rows

    def free_motions(self, rows: np.ndarray) -> np.ndarray:
        """Return the speeds of the free rotors that all meshes allow, shape (n, f)."""
        _, values, vectors = np.linalg.svd(rows)
        rank = int((values > 1e-9 * values.max(initial=1.0)).sum())
        return vectors[rank:].T

    def column(self, part: Component) -> np.ndarray:
        """Return the unit vector of the rotor of a component, 0 if it is not free."""
        return np.array([float(rotor == self.rotor(part.id)) for rotor in self.free])


def solve(box: "Gearbox", case: str | None) -> Loads:
    """Return the torques and speeds of a gearbox in a load case."""
    model, rotors, notes = box.model.in_case(case), box.rotors, []
    rows = rotors.matrix()
    motions = rotors.free_motions(rows)
    if not motions.size:
        raise InputError("stages", problem="are locked: it must be possible to turn them")
    speeds = _speeds(box, model, rotors, motions, notes)
    torques, missing = _torques(box, model, rotors, motions, notes)
    pinion_torques = {}
    if missing is None:
        load = sum(torques[x.id] * rotors.column(shaft) for x, shaft in _external_loads(model))
        per_tooth = np.linalg.lstsq(rows.T, -load, rcond=1e-9)[0]
        for stage, value in zip(rotors.stages, per_tooth, strict=True):
            pinion_torques[stage.name] = -stage.signed_teeth[0] * float(value)
    if speeds is None:
        # Some motion in which the first stated torque drives.
        speeds_up_to_factor = motions[:, 0]
        drivers = [x for x in _external_loads(model) if x[0].number("torque_around_u_axis", "N m")]
        for load, part in drivers[:1]:
            power = torques[load.id] * float(rotors.column(part) @ speeds_up_to_factor)
            speeds_up_to_factor = math.copysign(1.0, power) * speeds_up_to_factor
    else:
        speeds_up_to_factor = speeds
    by_rotor = dict(zip(rotors.free, speeds_up_to_factor.tolist(), strict=True))
    relative = {
        stage.name: by_rotor.get(names[0], 0.0) - by_rotor.get(names[2], 0.0)
        for stage, names in zip(rotors.stages, rotors.meshing, strict=True)
    }
    by_part = {key: by_rotor.get(rotors.rotor(key), 0.0) for key in model.components}
    known = speeds is not None
    return Loads(
        by_part if known else None,
        torques,
        pinion_torques,
        relative if known else None,
        relative,
        by_rotor,
        _external_loads(model),
        missing,
        notes,
    )


def _external_loads(model) -> list[tuple[Component, Component]]:
    """Return (external load, part on which it acts) for all loads."""
    return [
        (load, sides["assembly"])
        for load in model.of_type("external_load")
        for sides in model.related("assembly", part=load)
        if sides["assembly"].type not in ("gear_unit", "gear_casing")
        and (load.is_true("transmits_torque") is not False or load.value("torque_around_u_axis"))
    ]


def _speeds(box, model, rotors, motions, notes) -> np.ndarray | None:
    """Return the speeds of the free rotors in rpm, or None if they are not stated."""
    stated = []
    for part in model.of_type("shaft"):
        speed = part.number("rotational_speed", "rpm")
        if speed and rotors.column(part).any():
            speed *= box.places.direction(part)
            stated.append((bool(part.is_true("defines_speed")), part, speed))
    defining = [x for x in stated if x[0]] or stated
    if not defining:
        return None
    columns = np.array([rotors.column(part) for _, part, _ in defining])
    values = np.array([speed for *_, speed in defining])
    if np.linalg.matrix_rank(columns @ motions, 1e-9) < motions.shape[1]:
        return None
    speeds = motions @ np.linalg.lstsq(columns @ motions, values, rcond=None)[0]
    for _, part, speed in stated:
        turns = float(rotors.column(part) @ speeds)
        if abs(turns - speed) > _ROUNDING * abs(speeds).max():
            notes.append(
                f"rotational_speed of {part} is {speed:g} rpm, but by the teeth {turns:.6g} rpm"
            )
    return speeds


def _torques(box, model, rotors, motions, notes) -> tuple[dict[str, float], InputError | None]:
    """Return the torques of external loads in N m, and an error if one of them is missing."""
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

    def work() -> np.ndarray:
        """Return the work of all torques on the free motions."""
        loads = _external_loads(model)
        return sum(torques[x.id] * (motions.T @ rotors.column(part)) for x, part in loads)

    imbalance, scale = work(), max(map(abs, torques.values())) * abs(motions).max()
    if not unknown and abs(imbalance).max() > 1e-9 * scale:
        # Stated torques are rounded, or one of them follows from the others.
        if not followers:
            followers = [(x, motions.T @ rotors.column(part)) for x, part in _external_loads(model)]
        unknown = followers[-motions.shape[1] :]
    if not unknown:
        return torques, None
    works = np.array([x for _, x in unknown]).T
    if np.linalg.matrix_rank(works, 1e-9) < len(unknown):
        problem = "is missing: it must be given, or that of all other loads but this"
        owner = str(unknown[-1][0])
        return torques, InputError("torque_around_u_axis", problem=problem, owner=owner)
    stated = [torques[load.id] for load, _ in unknown]
    values = np.linalg.lstsq(works, works @ stated - imbalance, rcond=None)[0]
    for (load, _), old, new in zip(unknown, stated, values.tolist(), strict=True):
        torques[load.id] = new
        if old and abs(new - old) > _ROUNDING * abs(new):
            notes.append(f"torque of {load} is {old:g} N m, but by balance {new:.6g} N m")
    if abs(work()).max() > 1e-6 * scale:
        problem = "do not balance: another load must be given, on a shaft that takes their torque"
        owner = "the external loads"
        return torques, InputError("torque_around_u_axis", problem=problem, owner=owner)
    return torques, None
