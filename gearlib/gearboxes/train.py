"""`Gearbox.train`: the whole box as a `GearTrain` of gears, shafts and meshes.

The nodes of a shaft are its gears and, beside their faces, loads, couplings and bearings with a
stiffness. Springs run between facing faces, and half of their inertia goes to each end; the rest of
a shaft belongs to the node that it passes, or at which it ends. A gear is a cylinder of its
reference diameter around the shaft, a ring gear a ring from there to its rim. Rigid couplings join
nodes to one body, as do the parts of a planet carrier. Where bearings have a stiffness, nodes move
across the axis, and sections between them resist as beams whose ends do not tilt.
"""

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from gearlib import checks
from gearlib.checks import InputError
from gearlib.gearboxes.parts import RIGID
from gearlib.gearboxes.rexs import Component
from gearlib.models.geometry.gear import SpurGear
from gearlib.models.trains.elements import Body, Mesh, Shaft
from gearlib.models.trains.ready_made import proportional_damping
from gearlib.models.trains.train import GearTrain

if TYPE_CHECKING:
    from gearlib.gearboxes.gearbox import Gearbox

#: Smaller distances between faces and coordinates, in m, count as 0.
_TOUCHING = 1e-9
#: Load of an unloaded mesh over the largest one.
_LEAST_LOAD = 1e-6


class _Node:
    """Parts that turn as one body, between two coordinates of a shaft."""

    def __init__(self, parts: list, shaft: Any = None, start: float = 0.0, end: float = 0.0):
        self.parts, self.shaft, self.start, self.end = parts, shaft, start, end
        self.mass = self.inertia = self.torque = self.torsional_stiffness = 0.0
        #: Stiffness of its axis, N/m; None: as that of the body to which it belongs, else rigid.
        self.support: float | None = None
        self.owner = self

    @property
    def gear(self) -> Component | None:
        """The gear among the parts, or None."""
        gears = [part for part in self.parts if part.type.endswith("_gear")]
        if len(gears) > 1:
            problem = "are joined rigidly, which is not allowed: a shaft must lie between them"
            raise InputError(" and ".join(map(str, gears)), problem=problem)
        return gears[0] if gears else None

    @property
    def name(self) -> str:
        """The name of the body: that of its gear, carrier or load, else of a spring on a shaft."""
        named = [x for x in self.parts if x.type in ("planet_carrier", "external_load")]
        if self.gear or named:
            return (self.gear or named[0]).name
        return f"{self.parts[0].name}, {self.shaft.name}"

    def body(self) -> "_Node":
        """Return the node that stands for all nodes that are joined to this one."""
        return self if self.owner is self else self.owner.body()

    def join(self, other: "_Node") -> None:
        """Join the body of this node with that of another one."""
        mine, others = self.body(), other.body()
        if mine is not others:
            others.owner = mine
            mine.parts = mine.parts + others.parts
            for name in ("mass", "inertia", "torque", "torsional_stiffness"):
                setattr(mine, name, getattr(mine, name) + getattr(others, name))
            supports = [x for x in (mine.support, others.support) if x is not None]
            mine.support = sum(supports) if supports else None


class _Assembly:
    """The nodes and springs of a gearbox."""

    def __init__(self, box, load_case, bearing_stiffness, gears: dict[str, SpurGear]):
        self.box, self.model, self.gears = box, box.model, gears
        self.loads = box.loads(load_case)
        bearings = box.bearings
        if bearing_stiffness is not None:
            bearings = [x._replace(stiffness=bearing_stiffness) for x in bearings]
        self.bearings = [x for x in bearings if x.stiffness and x.stiffness < RIGID]
        self.nodes: list[_Node] = []
        self.springs: list[tuple] = []  #: (node, node, N m/rad, N/m)
        #: (id of a load, coupling or bearing, id of the part that has it) -> node
        self.places: dict[tuple, _Node] = {}
        self.rigid_parts: dict[str, _Node] = {}  #: id of a carrier or of a part of it -> its node
        for carrier in {x.carrier for x in box.stages.values() if x.carrier}:
            self._add_carrier(self.model.components[carrier])
        for part in self.model.of_type("shaft"):
            rotor = box.rotors.rotor(part.id)
            if rotor in box.rotors.turning and part.id not in self.rigid_parts:
                self._add_shaft(part)
        self._add_couplings()

    def _add_carrier(self, carrier: Component) -> None:
        """Add the node of a planet carrier with its side plates and pins."""
        node = _Node([carrier])
        self.nodes.append(node)
        rotor = self.box.rotors.rotor(carrier.id)
        pins = {x["shaft"].id for x in self.model.related("planet_pin")}
        for part in self.model.components.values():
            if self.box.rotors.rotor(part.id) != rotor:
                continue
            if part.type == "side_plate":
                outer, inner, length = (
                    part.number(name, "m") or 0.0
                    for name in ("outer_diameter", "inner_diameter", "length")
                )
                density = self.box.material(part)[0].density
                node.mass += math.pi / 4.0 * density * length * (outer**2 - inner**2)
                node.inertia += math.pi / 32.0 * density * length * (outer**4 - inner**4)
            elif part.id in pins:
                pin = self.box.shafts[part.id]
                mass = pin.mass(*pin.ends)
                node.mass += mass
                node.inertia += pin.inertia(*pin.ends) + mass * self.box.pin_radius(carrier) ** 2
            elif part.type != "planet_carrier":
                continue
            self.rigid_parts[part.id] = node

    def _items(self, part: Component) -> list[tuple]:
        """Return (start, end, component) of all that a shaft carries, in their order."""
        items = [
            (*self.box.face(gear), gear)
            for gear in self.model.parts_of(part)
            if gear.id in self.gears
        ]
        for load, owner in self.loads.external:
            if owner.id == part.id:
                u = load.number("u_coordinate_on_shaft", "m", "for the place of the load")
                items.append((u, u, load))
        for spring in [*self.box.couplings, *self.bearings]:
            for owner, u in (spring.inner, spring.outer):
                if owner.id == part.id:
                    u = self.box.coordinate(spring.part, part) if u is None else u
                    items.append((u, u, spring.part))
        for key in self.rigid_parts:
            carrier = self.model.components[key]
            if carrier.type == "planet_carrier" and self._is_welded(part, key):
                u = self.box.end_at_planets(part, carrier)
                items.append((u, u, carrier))
        return sorted(items, key=lambda item: item[:2])

    def _is_welded(self, part: Component, carrier: str) -> bool:
        """Return whether a shaft belongs to a carrier without a coupling that joins them."""
        rotors = self.box.rotors
        coupled = [{x.inner[0].id, x.outer[0].id} for x in self.box.couplings]
        return rotors.rotor(part.id) == rotors.rotor(carrier) and not any(
            part.id in ends and len(ends - rotors.casings) == 2 for ends in coupled
        )

    def _add_shaft(self, part: Component) -> None:
        """Add the nodes and springs of a shaft."""
        shaft, nodes = self.box.shafts[part.id], []
        for start, end, item in self._items(part):
            last = nodes[-1] if nodes else None
            is_gear = item.id in self.gears
            if last and start <= last.end + _TOUCHING and not (is_gear and last.gear):
                last.start = start if is_gear else last.start
                last.end = max(last.end, end)
                last.parts.append(item)
            elif last and not shaft.sections and not (is_gear and last.gear):
                last.parts.append(item)
            else:
                nodes.append(_Node([item], part, start, end))
            self.places[item.id, part.id] = nodes[-1]
        if not nodes:
            return
        left = shaft.ends[0]
        for node, following in zip(nodes, [*nodes[1:], None], strict=True):
            if following is None:
                right, next_left = shaft.ends[1], 0.0
            elif following.start - node.end > _TOUCHING:
                right, next_left = node.end, following.start
                ends = right, next_left
            else:  # Faces that touch or overlap: the spring runs between the middles.
                right = next_left = (node.end + following.start) / 2.0
                ends = (node.start + node.end) / 2.0, (following.start + following.end) / 2.0
            node.mass += shaft.mass(left, right)
            node.inertia += shaft.inertia(left, right)
            if following is not None:
                stiffness = shaft.torsional_stiffness(*ends), shaft.bending_stiffness(*ends)
                self.springs.append((node, following, *stiffness))
                for end in (node, following):
                    end.mass += shaft.mass(right, next_left) / 2.0
                    end.inertia += shaft.inertia(right, next_left) / 2.0
            left = next_left
        self.nodes += nodes
        for node in nodes:
            if node.gear:
                mass, inertia = self._gear(node.gear, shaft)
                node.mass, node.inertia = node.mass + mass, node.inertia + inertia
            for item in node.parts:
                node.torque += self.loads.torques.get(item.id, 0.0)
            self._support(node, part)
            for item in node.parts:
                if item.type == "planet_carrier":
                    self.rigid_parts[item.id].join(node)

    def _support(self, node: _Node, part: Component) -> None:
        """Set the stiffness of the axis of a node on a shaft."""
        on_shaft = [x for x in self.box.bearings if part.id in (x.inner[0].id, x.outer[0].id)]
        moving = [x for x in self.bearings if part.id in (x.inner[0].id, x.outer[0].id)]
        if moving and len(moving) == len(on_shaft):
            here = [x for x in moving if self.places[x.part.id, part.id] is node]
            node.support = float(sum(x.stiffness for x in here))
        elif on_shaft:
            node.support = math.inf

    def _gear(self, gear: Component, shaft) -> tuple[float, float]:
        """Return the mass (kg) and the moment of inertia (kg m^2) of a gear beside its shaft."""
        geometry = self.gears[gear.id]
        width, diameter = geometry.width, geometry.reference_diameter
        if geometry.internal:
            moments = [width * (geometry.outer_diameter**n - diameter**n) for n in (2, 4)]
        else:
            face = self.box.face(gear)
            bores = [
                shaft.integral(lambda u, outer, inner: np.minimum(outer, diameter) ** 2, *face),
                shaft.integral(lambda u, outer, inner: np.minimum(outer, diameter) ** 4, *face),
            ]
            moments = [width * diameter**n - bore for n, bore in zip((2, 4), bores, strict=True)]
        density = geometry.material.density
        return math.pi / 4.0 * density * moments[0], math.pi / 32.0 * density * moments[1]

    def _add_couplings(self) -> None:
        """Join the nodes of couplings, or hold those that are coupled to the casing."""
        for coupling in self.box.couplings:
            ends = []
            for owner, _ in (coupling.inner, coupling.outer):
                key = coupling.part.id, owner.id
                ends.append(self.places.get(key) or self.rigid_parts.get(owner.id))
            rigid = coupling.stiffness is None or coupling.stiffness >= RIGID
            owners = coupling.inner[0].id, coupling.outer[0].id
            if None not in ends:
                if rigid:
                    ends[0].join(ends[1])
                else:
                    self.springs.append((*ends, coupling.stiffness, 0.0))
            elif any(owner in self.box.rotors.casings for owner in owners):
                for node in filter(None, ends):
                    body = node.body()
                    body.torsional_stiffness += math.inf if rigid else coupling.stiffness
                    body.support = math.inf if rigid else body.support

    def bodies(self, structural_damping: float) -> tuple[list[Body], list[Shaft]]:
        """Return the bodies and shafts of the train."""
        planets = {}  # rotor of a planet -> (stage, angle of its pin)
        for stage in self.box.stages.values():
            if stage.carrier:
                planet = self.box.planet(stage)
                angle = self.box.centre_line_angle(stage)
                # The angle is that from the axis of the central gear to that of the planet.
                angle += 0.0 if stage.wheel.id == planet.id else math.pi
                rotor = self.box.rotors.rotor(self.box.shaft_of[planet.id].id)
                planets.setdefault(rotor, (stage, math.remainder(angle, math.tau)))
        found, names = [], {}
        for node in dict.fromkeys(node.body() for node in self.nodes):
            gear, fields = node.gear, {}
            names[node] = node.name
            rotor = self.box.rotors.rotor(node.shaft.id if node.shaft else node.parts[0].id)
            if rotor in planets:
                stage, fields["angle"] = planets[rotor]
                fields["carrier"] = self.rigid_parts[stage.carrier].body().name
            carriers = [part for part in node.parts if part.type == "planet_carrier"]
            radius = self.box.pin_radius(carriers[0]) if carriers else 0.01
            if gear:
                radius, fields["teeth"] = (
                    self.gears[gear.id].base_diameter / 2.0,
                    self.gears[gear.id].teeth,
                )
            if carriers and not node.inertia:
                node.mass, node.inertia = self.box.default_carrier(carriers[0])
            if not node.inertia:
                problem = "are missing: they must be given for the inertia"
                raise InputError("shaft sections", problem=problem, owner=str(node.shaft))
            support = math.inf if node.support is None else node.support
            found.append(
                Body(
                    name=node.name,
                    inertia=node.inertia,
                    mass=node.mass,
                    base_radius=radius,
                    torque=node.torque,
                    support_stiffness=(support, support),
                    support_damping=(proportional_damping(support, structural_damping),) * 2,
                    torsional_stiffness=node.torsional_stiffness,
                    torsional_damping=proportional_damping(
                        node.torsional_stiffness, structural_damping
                    ),
                    **fields,
                )
            )
        shafts = []
        for first, second, stiffness, bending in self.springs:
            ends = names[first.body()], names[second.body()]
            moves = any(x.body().support not in (None, math.inf) for x in (first, second))
            if ends[0] != ends[1]:
                bending = bending if moves else 0.0
                shafts.append(
                    Shaft(
                        bodies=ends,
                        stiffness=stiffness,
                        damping=structural_damping * stiffness,
                        bending_stiffness=bending,
                        bending_damping=structural_damping * bending,
                    )
                )
        return found, shafts


def build(
    box: "Gearbox",
    load_case: str | None,
    *,
    bearing_stiffness: float | None,
    structural_damping: float,
    reference: str | None,
    **mesh_options: Any,
) -> GearTrain:
    """Return the train of a gearbox; the arguments are those of `Gearbox.train`."""
    loads = box.loads(load_case)
    if loads.missing is not None:
        raise loads.missing
    for name, reason in box.refused.items():
        raise ValueError(f"stage {name} is refused, and the train needs all stages: {reason}")
    geometries = {name: box.stage(name, load_case) for name in box.stages}
    gears = {}
    for name, stage in box.stages.items():
        gears |= {stage.pinion.id: geometries[name].pinion, stage.wheel.id: geometries[name].wheel}
    bodies, shafts = _Assembly(box, load_case, bearing_stiffness, gears).bodies(structural_damping)
    forces = {
        name: abs(loads.pinion_torques[name]) / geometries[name].pinion.base_diameter
        for name in box.stages
    }
    least_force = _LEAST_LOAD * max(forces.values())
    parameters: dict = {}  # of equal meshes, which a planetary stage has
    meshes = []
    for name, stage in box.stages.items():
        geometry, torque = geometries[name], loads.pinion_torques[name]
        size = max(forces[name], least_force) * geometry.pinion.base_diameter
        key = geometry, f"{size:.10g}"
        if key not in parameters:
            parameters[key] = geometry.train_parameters(torque=size, **mesh_options)
        sign = -1.0 if stage.internal else 1.0
        drives = torque * loads.motions[name] >= 0.0
        meshes.append(
            Mesh(
                name=name,
                pinion=stage.pinion.name,
                wheel=stage.wheel.name,
                position=box.centre_line_angle(stage) + (math.pi if stage.internal else 0.0),
                direction=1 if torque * sign >= 0.0 else -1,
                driving=(stage.pinion if drives else stage.wheel).name,
                **parameters[key],
            )
        )
    frames = {loads.motion_of(box, x.carrier) for x in box.stages.values() if x.carrier}
    frame = frames.pop() if frames else 0.0
    if any(abs(other - frame) > 1e-9 * abs(frame) for other in frames):
        raise ValueError(
            "planetary stages whose carriers turn at different speeds are not allowed in a train; "
            "each stage by itself can be computed"
        )
    in_frame = {
        name: loads.motion_of(box, box.shaft_of[stage.pinion.id].id) - frame
        for name, stage in box.stages.items()
    }
    # A pinion that stands still among the planets cannot set the scale of speeds.
    fastest = max(map(abs, in_frame.values()))
    choices = [name for name, speed in in_frame.items() if abs(speed) > 1e-9 * fastest]
    reference = checks.one_of("reference", reference or choices[0], choices)
    return GearTrain(
        bodies=bodies,
        meshes=meshes,
        shafts=shafts,
        reference=reference,
        carrier_ratio=frame / in_frame[reference],
    )
