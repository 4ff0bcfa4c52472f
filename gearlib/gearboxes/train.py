"""`Gearbox.train`: the whole box as a `GearTrain` of gears, shafts and meshes.

The nodes of a shaft are its gears and, outside their faces, loads, couplings and bearings with a
stiffness. Springs run between facing faces, and half of their inertia goes to each end; the rest of
a shaft belongs to the node that it passes, or at which it ends. A gear is a cylinder of its
reference diameter around the shaft, a ring gear a ring from there to its rim. Rigid couplings join
nodes to one body, and so do planet carriers with their parts. Where bearings have a stiffness,
nodes move across the axis, and sections between them resist as beams whose ends do not tilt.
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

#: Distances between faces and coordinates, in m, below this count as 0.
_TOUCHING = 1e-9
#: Force that an unloaded mesh gets, over the largest mesh force.
_LEAST_LOAD = 1e-6


class _Node:
    """Parts that turn as one body, between two coordinates of a shaft."""

    def __init__(self, parts: list, shaft: Any = None, start: float = 0.0, end: float = 0.0):
        """Create a node, a set of components that turn as one body, without mass so far.

        `shaft` is the component of its shaft, None for a carrier; `start` and `end` are the
        coordinates on the shaft, in m, between which the node lies.
        """
        self.parts, self.shaft, self.start, self.end = parts, shaft, start, end
        self.mass = self.inertia = self.torque = self.torsional_stiffness = 0.0
        #: Stiffness of its axis, N/m; None: as of the body to which it belongs, else rigid.
        self.support: float | None = None
        #: The node to which this node was joined, or itself.
        self.owner = self

    @property
    def gear(self) -> Component | None:
        """The gear among the components of the node, or None.

        Raises ValueError if there are several, because a body of a train can have only one gear.
        """
        gears = [part for part in self.parts if part.type.endswith("_gear")]
        if len(gears) > 1:
            problem = "are joined rigidly, which is not allowed: a shaft must lie between them"
            raise InputError(" and ".join(map(str, gears)), problem=problem)
        return gears[0] if gears else None

    @property
    def name(self) -> str:
        """The name of the body: of its gear, carrier or load, else of a spring and its shaft."""
        if self.gear:
            return self.gear.name
        for part in self.parts:
            if part.type in ("planet_carrier", "external_load"):
                return part.name
        return f"{self.parts[0].name}, {self.shaft.name}"

    def body(self) -> "_Node":
        """Return the node that represents all nodes joined to this one."""
        return self if self.owner is self else self.owner.body()

    def join(self, other: "_Node") -> None:
        """Join the body of another node to the body of this node, which gets its mass and loads.

        The support of the joined body is the sum of both supports, as far as they are known.
        """
        body, other_body = self.body(), other.body()
        if body is other_body:
            return
        other_body.owner = body
        body.parts = body.parts + other_body.parts
        body.mass += other_body.mass
        body.inertia += other_body.inertia
        body.torque += other_body.torque
        body.torsional_stiffness += other_body.torsional_stiffness
        if body.support is None:
            body.support = other_body.support
        elif other_body.support is not None:
            body.support += other_body.support


class _Assembly:
    """The nodes and springs of a gearbox, from which its gear train is made."""

    def __init__(self, box, load_case, bearing_stiffness, gears: dict[str, SpurGear]):
        """Create the nodes and springs of all shafts that take part in a mesh.

        A node is a set of parts that turn as one body, and springs are elastic parts between two
        nodes. `load_case` is a name, or None for the first one. Unless it is None,
        `bearing_stiffness` in N/m replaces all stated values. `gears` maps ids of components to
        geometries.
        """
        self.box, self.model, self.gears = box, box.model, gears
        self.loads = box.loads(load_case)
        bearings = box.bearings
        if bearing_stiffness is not None:
            bearings = [bearing._replace(stiffness=bearing_stiffness) for bearing in bearings]
        #: Elastic bearings.
        self.bearings = [x for x in bearings if x.stiffness and x.stiffness < RIGID]
        self.nodes: list[_Node] = []
        #: Tuples (node, node, torsional stiffness in N m/rad, bending stiffness in N/m).
        self.springs: list[tuple] = []
        #: (id of a load, coupling or bearing, id of the part that has it) -> node
        self.places: dict[tuple, _Node] = {}
        self.rigid_parts: dict[str, _Node] = {}  #: id of a carrier or of a part of it -> its node
        for carrier_id in {stage.carrier for stage in box.stages.values() if stage.carrier}:
            self._add_carrier(self.model.components[carrier_id])
        for part in self.model.of_type("shaft"):
            rotor = box.rotors.rotor(part.id)
            if rotor in box.rotors.turning and part.id not in self.rigid_parts:
                self._add_shaft(part)
        self._add_couplings()

    def _add_carrier(self, carrier: Component) -> None:
        """Add a node for a planet carrier with its side plates and pins.

        The mass and inertia of the node are those of these parts; a pin lies at the radius of the
        planets. The ids of all parts are stored, so that the node can be found by them.
        """
        node = _Node([carrier])
        self.nodes.append(node)
        rotor = self.box.rotors.rotor(carrier.id)
        pin_ids = {roles["shaft"].id for roles in self.model.related("planet_pin")}
        for part in self.model.components.values():
            if self.box.rotors.rotor(part.id) != rotor:
                continue
            if part.type == "side_plate":
                outer = part.number("outer_diameter", "m") or 0.0
                inner = part.number("inner_diameter", "m") or 0.0
                length = part.number("length", "m") or 0.0
                density = self.box.material(part)[0].density
                node.mass += math.pi / 4.0 * density * length * (outer**2 - inner**2)
                node.inertia += math.pi / 32.0 * density * length * (outer**4 - inner**4)
            elif part.id in pin_ids:
                pin = self.box.shafts[part.id]
                mass = pin.mass(*pin.ends)
                node.mass += mass
                node.inertia += pin.inertia(*pin.ends) + mass * self.box.pin_radius(carrier) ** 2
            elif part.type != "planet_carrier":
                continue
            self.rigid_parts[part.id] = node

    def _items(self, part: Component) -> list[tuple]:
        """Return all that a shaft carries as tuples (start, end, component), in their order.

        These are gears, loads, couplings, elastic bearings and carriers. `start` and `end` are
        coordinates on the shaft in m, which are equal for all items but gears. `part` is the
        component of the shaft.
        """
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

    def _is_welded(self, part: Component, carrier_id: str) -> bool:
        """Return whether a shaft and a planet carrier are one piece.

        `part` is the component of the shaft. They are one piece if they belong to the same rotor, a
        set of parts that turn together, and no coupling joins the shaft to another part than the
        casing.
        """
        rotors = self.box.rotors
        if rotors.rotor(part.id) != rotors.rotor(carrier_id):
            return False
        for coupling in self.box.couplings:
            ends = {coupling.inner[0].id, coupling.outer[0].id}
            if part.id in ends and len(ends - rotors.casings) == 2:
                return False
        return True

    def _add_shaft(self, part: Component) -> None:
        """Add the nodes of a shaft, given by its component, and the springs between them.

        Each gear has a node of its own. An item that touches the previous node is added to this
        node, and so is each item of a shaft without sections, which has no elasticity.
        """
        shaft, nodes = self.box.shafts[part.id], []
        for start, end, item in self._items(part):
            previous = nodes[-1] if nodes else None
            is_gear = item.id in self.gears
            if previous and start <= previous.end + _TOUCHING and not (is_gear and previous.gear):
                previous.start = start if is_gear else previous.start
                previous.end = max(previous.end, end)
                previous.parts.append(item)
            elif previous and not shaft.sections and not (is_gear and previous.gear):
                previous.parts.append(item)
            else:
                nodes.append(_Node([item], part, start, end))
            self.places[item.id, part.id] = nodes[-1]
        if nodes:
            self._distribute_shaft(shaft, nodes)
        self.nodes += nodes
        for node in nodes:
            if node.gear:
                mass, inertia = self._gear_mass_and_inertia(node.gear, shaft)
                node.mass += mass
                node.inertia += inertia
            for item in node.parts:
                node.torque += self.loads.torques.get(item.id, 0.0)
            self._set_support(node, part)
            for item in node.parts:
                if item.type == "planet_carrier":
                    self.rigid_parts[item.id].join(node)

    def _distribute_shaft(self, shaft, nodes: list[_Node]) -> None:
        """Add the mass and inertia of a shaft to its nodes, and the springs between them.

        The springs are the free lengths of the shaft between two nodes, and half of their mass and
        inertia goes to each of these. The rest belongs to the node that it passes or at which it
        ends. `shaft` is a `gearlib.gearboxes.parts.Shaft`; the nodes are in the order of their
        coordinates.
        """
        # Between `left` and `right` the shaft belongs to a node; then a spring follows.
        left = shaft.ends[0]
        for node, following in zip(nodes, [*nodes[1:], None], strict=True):
            if following is None:
                right, next_left = shaft.ends[1], 0.0
            elif following.start - node.end > _TOUCHING:
                right, next_left = node.end, following.start
                spring_ends = right, next_left
            else:  # Faces that touch or overlap: the spring runs between the middles.
                right = next_left = (node.end + following.start) / 2.0
                middle = (node.start + node.end) / 2.0
                spring_ends = middle, (following.start + following.end) / 2.0
            node.mass += shaft.mass(left, right)
            node.inertia += shaft.inertia(left, right)
            if following is not None:
                torsional_stiffness = shaft.torsional_stiffness(*spring_ends)
                bending_stiffness = shaft.bending_stiffness(*spring_ends)
                self.springs.append((node, following, torsional_stiffness, bending_stiffness))
                for end_node in (node, following):
                    end_node.mass += shaft.mass(right, next_left) / 2.0
                    end_node.inertia += shaft.inertia(right, next_left) / 2.0
            left = next_left

    def _set_support(self, node: _Node, part: Component) -> None:
        """Set the stiffness at which a node of a shaft is supported across its axis.

        `part` is the component of the shaft. If all of its bearings are elastic, the stiffness is
        the sum of those at the node, which may be 0; if one of them is rigid, it is infinite.
        Without bearings it stays None (unknown).
        """
        on_shaft = _bearings_of(part, self.box.bearings)
        elastic = _bearings_of(part, self.bearings)
        if elastic and len(elastic) == len(on_shaft):
            at_node = [x for x in elastic if self.places[x.part.id, part.id] is node]
            node.support = float(sum(bearing.stiffness for bearing in at_node))
        elif on_shaft:
            node.support = math.inf

    def _gear_mass_and_inertia(self, gear: Component, shaft) -> tuple[float, float]:
        """Return the mass (kg) and moment of inertia (kg m^2) of a gear without its shaft.

        An external gear is a cylinder of its reference diameter around the shaft, a ring gear a
        ring from there to its outer diameter. `shaft` is the `gearlib.gearboxes.parts.Shaft` of the
        gear.
        """
        geometry = self.gears[gear.id]
        width, diameter = geometry.width, geometry.reference_diameter
        # Integrals of the 2nd and 4th power of the diameter over the width of the gear.
        if geometry.internal:
            moments = [width * (geometry.outer_diameter**n - diameter**n) for n in (2, 4)]
        else:
            face = self.box.face(gear)
            # Where the shaft is thicker than the gear, nothing of the gear remains.
            bore_moments = [
                shaft.integral(lambda u, outer, inner: np.minimum(outer, diameter) ** 2, *face),
                shaft.integral(lambda u, outer, inner: np.minimum(outer, diameter) ** 4, *face),
            ]
            moments = [width * diameter**2 - bore_moments[0], width * diameter**4 - bore_moments[1]]
        density = geometry.material.density
        return math.pi / 4.0 * density * moments[0], math.pi / 32.0 * density * moments[1]

    def _add_couplings(self) -> None:
        """Join the nodes at both ends of each coupling, or hold a node coupled to the casing.

        A rigid coupling joins two nodes to one body, an elastic one adds a spring. A coupling to
        the casing gives the body a torsional stiffness, which is infinite if the coupling is rigid.
        """
        for coupling in self.box.couplings:
            end_nodes = []
            for owner, _ in (coupling.inner, coupling.outer):
                key = coupling.part.id, owner.id
                end_nodes.append(self.places.get(key) or self.rigid_parts.get(owner.id))
            is_rigid = coupling.stiffness is None or coupling.stiffness >= RIGID
            owner_ids = coupling.inner[0].id, coupling.outer[0].id
            if None not in end_nodes:
                if is_rigid:
                    end_nodes[0].join(end_nodes[1])
                else:
                    self.springs.append((*end_nodes, coupling.stiffness, 0.0))
            elif any(owner_id in self.box.rotors.casings for owner_id in owner_ids):
                for node in end_nodes:
                    if node is None:
                        continue
                    body = node.body()
                    body.torsional_stiffness += math.inf if is_rigid else coupling.stiffness
                    # A rigid coupling to the casing also keeps the axis from moving.
                    body.support = math.inf if is_rigid else body.support

    def _pin_angles(self) -> dict[str, tuple]:
        """Return a dict: rotor of a planet -> (stage, angle of its pin on the carrier in rad).

        A rotor is a set of parts that turn together, here those on the shaft of the planet. The
        angle is the direction from the central gear (sun or ring) to the planet.
        """
        pin_angles: dict[str, tuple] = {}
        for stage in self.box.stages.values():
            if stage.carrier:
                planet = self.box.planet(stage)
                angle = self.box.centre_line_angle(stage)
                # The line of centres points from pinion to wheel. If the planet is the pinion, the
                # direction from the central gear to the planet is the opposite one.
                angle += 0.0 if stage.wheel.id == planet.id else math.pi
                rotor = self.box.rotors.rotor(self.box.shaft_of[planet.id].id)
                pin_angles.setdefault(rotor, (stage, math.remainder(angle, math.tau)))
        return pin_angles

    def _body(self, node: _Node, pin_angles: dict[str, tuple], structural_damping: float) -> Body:
        """Return the `Body` of a gear train for a node that represents all nodes joined to it.

        `pin_angles` maps the rotor of a planet to (stage, angle of its pin on the carrier in rad),
        and `structural_damping` is the ratio of damping to stiffness in s. Raises ValueError if the
        inertia is unknown.
        """
        gear, fields = node.gear, {}
        rotor = self.box.rotors.rotor(node.shaft.id if node.shaft else node.parts[0].id)
        if rotor in pin_angles:
            stage, fields["angle"] = pin_angles[rotor]
            fields["carrier"] = self.rigid_parts[stage.carrier].body().name
        carriers = [part for part in node.parts if part.type == "planet_carrier"]
        # A body that is neither a gear nor a carrier needs no radius, so that any number serves.
        radius = self.box.pin_radius(carriers[0]) if carriers else 0.01
        if gear:
            radius = self.gears[gear.id].base_diameter / 2.0
            fields["teeth"] = self.gears[gear.id].teeth
        if carriers and not node.inertia:
            node.mass, node.inertia = self.box.default_carrier(carriers[0])
        if not node.inertia:
            problem = "are missing: they must be given for the inertia"
            raise InputError("shaft sections", problem=problem, owner=str(node.shaft))
        support = math.inf if node.support is None else node.support
        return Body(
            name=node.name,
            inertia=node.inertia,
            mass=node.mass,
            base_radius=radius,
            torque=node.torque,
            support_stiffness=(support, support),
            support_damping=(proportional_damping(support, structural_damping),) * 2,
            torsional_stiffness=node.torsional_stiffness,
            torsional_damping=proportional_damping(node.torsional_stiffness, structural_damping),
            **fields,
        )

    def bodies_and_shafts(self, structural_damping: float) -> tuple[list[Body], list[Shaft]]:
        """Return the bodies of the gear train, and its shafts, the springs between bodies.

        `structural_damping` is the ratio of damping to stiffness in s.
        """
        pin_angles = self._pin_angles()
        bodies = [
            self._body(node, pin_angles, structural_damping)
            for node in dict.fromkeys(node.body() for node in self.nodes)
        ]
        shafts = []
        for node_1, node_2, stiffness, bending_stiffness in self.springs:
            body_1, body_2 = node_1.body(), node_2.body()
            if body_1.name == body_2.name:
                continue  # A rigid coupling has joined both ends.
            # Bending has no effect between bodies that cannot move across their axes.
            if body_1.support in (None, math.inf) and body_2.support in (None, math.inf):
                bending_stiffness = 0.0
            shafts.append(
                Shaft(
                    bodies=(body_1.name, body_2.name),
                    stiffness=stiffness,
                    damping=structural_damping * stiffness,
                    bending_stiffness=bending_stiffness,
                    bending_damping=structural_damping * bending_stiffness,
                )
            )
        return bodies, shafts


def _bearings_of(part: Component, bearings: list) -> list:
    """Return those bearings whose inner or outer part is a shaft, given by its component."""
    return [x for x in bearings if part.id in (x.inner[0].id, x.outer[0].id)]


def build(
    box: "Gearbox",
    load_case: str | None,
    *,
    bearing_stiffness: float | None,
    structural_damping: float,
    reference: str | None,
    **mesh_options: Any,
) -> GearTrain:
    """Return the gear train of a whole gearbox in a load case.

    `bearing_stiffness` in N/m replaces the stated values unless it is None, `structural_damping` is
    the ratio of damping to stiffness in s, and `reference` is the stage whose mesh sets the scales.
    `mesh_options` describe damping and stiffness of the meshes, as in `Gearbox.train`.
    """
    loads = box.loads(load_case)
    if loads.missing is not None:
        raise loads.missing
    for name, reason in box.refused.items():
        raise ValueError(f"stage {name} is refused, and the train needs all stages: {reason}")
    geometries = {name: box.stage(name, load_case) for name in box.stages}
    gears = {}
    for name, stage in box.stages.items():
        gears |= {stage.pinion.id: geometries[name].pinion, stage.wheel.id: geometries[name].wheel}
    assembly = _Assembly(box, load_case, bearing_stiffness, gears)
    bodies, shafts = assembly.bodies_and_shafts(structural_damping)
    meshes = _meshes(box, loads, geometries, mesh_options)
    carrier_speeds = {
        loads.motion_of(box, stage.carrier) for stage in box.stages.values() if stage.carrier
    }
    # A train with planets is described in the frame that turns with their carriers.
    frame_speed = carrier_speeds.pop() if carrier_speeds else 0.0
    if any(abs(other - frame_speed) > 1e-9 * abs(frame_speed) for other in carrier_speeds):
        raise ValueError(
            "planetary stages whose carriers turn at different speeds are not allowed in a train; "
            "each stage by itself can be computed"
        )
    speeds_in_frame = {
        name: loads.motion_of(box, box.shaft_of[stage.pinion.id].id) - frame_speed
        for name, stage in box.stages.items()
    }
    # The speed of the reference pinion in this frame is the scale of all speeds, so that it must
    # not be 0.
    least_speed = 1e-9 * max(map(abs, speeds_in_frame.values()))
    choices = [name for name, speed in speeds_in_frame.items() if abs(speed) > least_speed]
    reference = checks.check_choice("reference", reference or choices[0], choices)
    return GearTrain(
        bodies=bodies,
        meshes=meshes,
        shafts=shafts,
        reference=reference,
        carrier_ratio=frame_speed / speeds_in_frame[reference],
    )


def _meshes(box: "Gearbox", loads, geometries: dict, mesh_options: dict) -> list[Mesh]:
    """Return the meshes of the stages of a gearbox under the torques of its `Loads`.

    `geometries` maps the name of a stage to its `GearStage`. `mesh_options` are the arguments of
    `GearStage.train_parameters` for damping and stiffness.
    """
    # Half of each mesh force; the factor does not matter, as forces are only compared.
    forces = {
        name: abs(loads.pinion_torques[name]) / geometries[name].pinion.base_diameter
        for name in box.stages
    }
    # Meshes without a load get a very small one, because the model needs a load above 0.
    least_force = _LEAST_LOAD * max(forces.values())
    # The equal meshes of a planetary stage have the same parameters, which are computed once.
    parameters: dict = {}
    meshes = []
    for name, stage in box.stages.items():
        geometry, torque = geometries[name], loads.pinion_torques[name]
        magnitude = max(forces[name], least_force) * geometry.pinion.base_diameter
        key = geometry, f"{magnitude:.10g}"
        if key not in parameters:
            parameters[key] = geometry.train_parameters(torque=magnitude, **mesh_options)
        position, sign = box.centre_line_angle(stage), 1.0
        if stage.internal:
            # The position of an internal mesh is the direction from the wheel to the pinion,
            # and its direction of load is that of the wheel.
            position, sign = position + math.pi, -1.0
        # A torque in the direction of rotation does positive work.
        pinion_drives = torque * loads.motions[name] >= 0.0
        meshes.append(
            Mesh(
                name=name,
                pinion=stage.pinion.name,
                wheel=stage.wheel.name,
                position=position,
                direction=1 if torque * sign >= 0.0 else -1,
                driving=stage.pinion.name if pinion_drives else stage.wheel.name,
                **parameters[key],
            )
        )
    return meshes
