"""`Gearbox.train`: the whole gearbox as a `GearTrain` of gears, shafts and meshes.

The nodes of a shaft are its gears and, outside their faces, loads, couplings and elastic bearings.
The free lengths of shaft between nodes are springs, and half of their mass and inertia is added to
each adjacent node; the remaining parts of the shaft belong to the node at which they are. A gear is
a cylinder with the reference diameter around the shaft, a ring gear a ring from that diameter to
the rim. Rigid couplings merge nodes to one body; a planet carrier and its parts are also one body.
With elastic bearings, nodes also move perpendicular to the axis, and the shaft between them acts as
a beam whose ends do not tilt.
"""

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from gearlib import checks
from gearlib.checks import InputError
from gearlib.gearboxes.parts import RIGID_STIFFNESS
from gearlib.gearboxes.rexs import Component
from gearlib.models.geometry.gear import SpurGear
from gearlib.models.trains.elements import Body, Mesh, Shaft
from gearlib.models.trains.ready_made import proportional_damping
from gearlib.models.trains.train import GearTrain

if TYPE_CHECKING:
    from gearlib.gearboxes.gearbox import Gearbox

#: Differences of coordinates up to this value, in m, are treated as zero.
_COORDINATE_TOLERANCE = 1e-9
#: Force of an unloaded mesh, relative to the largest mesh force.
_MIN_RELATIVE_FORCE = 1e-6


class _Node:
    """Parts that move as one body, e.g. a gear with the length of shaft inside it."""

    def __init__(self, parts: list, shaft: Any = None, start: float = 0.0, end: float = 0.0):
        """Create a node without mass from a list of components.

        `shaft` is the component of the shaft, None for a carrier; the node extends from `start` to
        `end`, coordinates on the shaft in m.
        """
        self.parts, self.shaft, self.start, self.end = parts, shaft, start, end
        self.mass = self.inertia = self.torque = self.torsional_stiffness = 0.0
        #: Stiffness that supports the axis, N/m; None if this node has no bearings.
        self.support_stiffness: float | None = None
        #: The node with which this node was merged, or the node itself.
        self.parent = self

    @property
    def gear(self) -> Component | None:
        """The gear of the node, or None.

        Raises an `InputError` if there are several, because a body can have only one gear.
        """
        gears = [part for part in self.parts if part.type.endswith("_gear")]
        if len(gears) > 1:
            problem = "are joined rigidly, which is not allowed: a shaft must lie between them"
            raise InputError(" and ".join(map(str, gears)), problem=problem)
        return gears[0] if gears else None

    @property
    def name(self) -> str:
        """The name of the gear, carrier or load, else of the first part and the shaft."""
        if self.gear:
            return self.gear.name
        for part in self.parts:
            if part.type in ("planet_carrier", "external_load"):
                return part.name
        return f"{self.parts[0].name}, {self.shaft.name}"

    def body(self) -> "_Node":
        """Return the node that represents all nodes merged with this one."""
        return self if self.parent is self else self.parent.body()

    def merge(self, other: "_Node") -> None:
        """Merge the body of another node into the body of this node.

        Masses, inertias, torques and stiffnesses are added; a support stiffness of None is ignored.
        """
        body, other_body = self.body(), other.body()
        if body is other_body:
            return
        other_body.parent = body
        body.parts = body.parts + other_body.parts
        body.mass += other_body.mass
        body.inertia += other_body.inertia
        body.torque += other_body.torque
        body.torsional_stiffness += other_body.torsional_stiffness
        if body.support_stiffness is None:
            body.support_stiffness = other_body.support_stiffness
        elif other_body.support_stiffness is not None:
            body.support_stiffness += other_body.support_stiffness


class _TrainBuilder:
    """Builder of the bodies and shafts of a gear train from the nodes and springs of a gearbox."""

    def __init__(self, gearbox, load_case, bearing_stiffness, gears: dict[str, SpurGear]):
        """Create the nodes and springs of all rotors that have a mesh.

        `load_case` is a name, or None for the first one. If `bearing_stiffness` in N/m is not None,
        it replaces all stated values. `gears` maps component ids to geometries.
        """
        self.gearbox, self.model, self.gears = gearbox, gearbox.model, gears
        self.loads = gearbox.loads(load_case)
        bearings = gearbox.bearings
        if bearing_stiffness is not None:
            bearings = [bearing._replace(stiffness=bearing_stiffness) for bearing in bearings]
        self.elastic_bearings = [
            x for x in bearings if x.stiffness and x.stiffness < RIGID_STIFFNESS
        ]
        self.nodes: list[_Node] = []
        #: Tuples (node, node, torsional stiffness in N m/rad, bending stiffness in N/m).
        self.springs: list[tuple] = []
        #: (id of a load, coupling or bearing, id of its shaft) -> node
        self.attachment_nodes: dict[tuple, _Node] = {}
        self.carrier_nodes: dict[str, _Node] = {}  #: id of a carrier or of one of its parts -> node
        for carrier_id in {stage.carrier for stage in gearbox.stages.values() if stage.carrier}:
            self._add_carrier(self.model.components[carrier_id])
        for part in self.model.components_of_type("shaft"):
            rotor = gearbox.rotors.find_rotor(part.id)
            if rotor in gearbox.rotors.meshing_rotors and part.id not in self.carrier_nodes:
                self._add_shaft(part)
        self._add_couplings()

    def _add_carrier(self, carrier: Component) -> None:
        """Add a node for a planet carrier with the mass and inertia of its side plates and pins.

        The node is stored in `carrier_nodes` for the carrier and each of these parts.
        """
        node = _Node([carrier])
        self.nodes.append(node)
        rotor = self.gearbox.rotors.find_rotor(carrier.id)
        pin_ids = {roles["shaft"].id for roles in self.model.find_relations("planet_pin")}
        for part in self.model.components.values():
            if self.gearbox.rotors.find_rotor(part.id) != rotor:
                continue
            if part.type == "side_plate":
                outer = part.get_number("outer_diameter", "m") or 0.0
                inner = part.get_number("inner_diameter", "m") or 0.0
                length = part.get_number("length", "m") or 0.0
                density = self.gearbox.material(part)[0].density
                node.mass += math.pi / 4.0 * density * length * (outer**2 - inner**2)
                node.inertia += math.pi / 32.0 * density * length * (outer**4 - inner**4)
            elif part.id in pin_ids:
                pin = self.gearbox.shafts[part.id]
                mass = pin.mass(*pin.ends)
                node.mass += mass
                node.inertia += (
                    pin.inertia(*pin.ends) + mass * self.gearbox.pin_radius(carrier) ** 2
                )
            elif part.type != "planet_carrier":
                continue
            self.carrier_nodes[part.id] = node

    def _list_attachments(self, part: Component) -> list[tuple]:
        """Return what is attached to a shaft as sorted tuples (start, end, component).

        These are gears, loads, couplings, elastic bearings and carriers. `start` and `end` are
        coordinates on the shaft in m, which differ only for gears. `part` is the component of the
        shaft.
        """
        attachments = [
            (*self.gearbox.face(gear), gear)
            for gear in self.model.parts_of(part)
            if gear.id in self.gears
        ]
        for load, owner in self.loads.external_loads:
            if owner.id == part.id:
                u = load.get_number("u_coordinate_on_shaft", "m", "for the place of the load")
                attachments.append((u, u, load))
        for spring in [*self.gearbox.couplings, *self.elastic_bearings]:
            for owner, u in (spring.inner, spring.outer):
                if owner.id == part.id:
                    u = self.gearbox.coordinate(spring.part, part) if u is None else u
                    attachments.append((u, u, spring.part))
        for key in self.carrier_nodes:
            carrier = self.model.components[key]
            if carrier.type == "planet_carrier" and self._is_one_piece(part, key):
                u = self.gearbox.end_at_planets(part, carrier)
                attachments.append((u, u, carrier))
        return sorted(attachments, key=lambda attachment: attachment[:2])

    def _is_one_piece(self, part: Component, carrier_id: str) -> bool:
        """Return whether a shaft, given by its component, and a planet carrier are one piece.

        They are one piece if they belong to the same rotor, and no coupling joins the shaft to a
        part other than the casing.
        """
        rotors = self.gearbox.rotors
        if rotors.find_rotor(part.id) != rotors.find_rotor(carrier_id):
            return False
        for coupling in self.gearbox.couplings:
            ends = {coupling.inner[0].id, coupling.outer[0].id}
            if part.id in ends and len(ends - rotors.casings) == 2:
                return False
        return True

    def _add_shaft(self, part: Component) -> None:
        """Add the nodes of a shaft, given by its component, and the springs between them.

        Each gear has its own node. An attachment that touches the preceding node is added to this
        node. A shaft without sections is rigid, so that only its gears are separate nodes.
        """
        shaft, nodes = self.gearbox.shafts[part.id], []
        for start, end, attachment in self._list_attachments(part):
            previous = nodes[-1] if nodes else None
            is_gear = attachment.id in self.gears
            if (
                previous
                and start <= previous.end + _COORDINATE_TOLERANCE
                and not (is_gear and previous.gear)
            ):
                previous.start = start if is_gear else previous.start
                previous.end = max(previous.end, end)
                previous.parts.append(attachment)
            elif previous and not shaft.sections and not (is_gear and previous.gear):
                previous.parts.append(attachment)
            else:
                nodes.append(_Node([attachment], part, start, end))
            self.attachment_nodes[attachment.id, part.id] = nodes[-1]
        if nodes:
            self._distribute_shaft(shaft, nodes)
        self.nodes += nodes
        for node in nodes:
            if node.gear:
                mass, inertia = self._compute_gear_inertia(node.gear, shaft)
                node.mass += mass
                node.inertia += inertia
            for component in node.parts:
                node.torque += self.loads.torques.get(component.id, 0.0)
            self._set_support(node, part)
            for component in node.parts:
                if component.type == "planet_carrier":
                    self.carrier_nodes[component.id].merge(node)

    def _distribute_shaft(self, shaft, nodes: list[_Node]) -> None:
        """Add the mass and inertia of a shaft to its nodes, and add the springs between nodes.

        The springs are the free lengths of shaft between two nodes; half of their mass and inertia
        is added to each of these. The remaining parts of the shaft belong to the node at which they
        are. `shaft` is a `gearlib.gearboxes.parts.Shaft`; the nodes are sorted by coordinate.
        """
        # The shaft belongs to the node from `left` to `right`, and to a spring up to `next_left`.
        left = shaft.ends[0]
        for node, following in zip(nodes, [*nodes[1:], None], strict=True):
            if following is None:
                right, next_left = shaft.ends[1], 0.0
            elif following.start - node.end > _COORDINATE_TOLERANCE:
                right, next_left = node.end, following.start
                spring_ends = right, next_left
            else:  # The faces touch or overlap: the spring connects the middles of the nodes.
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
        """Set the stiffness with which bearings support a node perpendicular to the shaft axis.

        `part` is the component of the shaft. The support stiffness is the sum of the bearing
        stiffnesses at the node, which may be 0, if all bearings of the shaft are elastic; infinity
        if a bearing is rigid; and None if the shaft has no bearings.
        """
        all_bearings = _select_bearings(part, self.gearbox.bearings)
        elastic_bearings = _select_bearings(part, self.elastic_bearings)
        if elastic_bearings and len(elastic_bearings) == len(all_bearings):
            node.support_stiffness = float(
                sum(
                    bearing.stiffness
                    for bearing in elastic_bearings
                    if self.attachment_nodes[bearing.part.id, part.id] is node
                )
            )
        elif all_bearings:
            node.support_stiffness = math.inf

    def _compute_gear_inertia(self, gear: Component, shaft) -> tuple[float, float]:
        """Return the mass (kg) and moment of inertia (kg m^2) of a gear without its shaft.

        An external gear is a cylinder with the reference diameter around the shaft, a ring gear a
        ring from the reference diameter to the outer diameter. `shaft` is a
        `gearlib.gearboxes.parts.Shaft`.
        """
        geometry = self.gears[gear.id]
        width, diameter = geometry.width, geometry.reference_diameter
        # Integrals over the face width of outer^n - inner^n for n = 2 and n = 4.
        if geometry.internal:
            moments = [width * (geometry.outer_diameter**n - diameter**n) for n in (2, 4)]
        else:
            face = self.gearbox.face(gear)
            # Where the shaft is thicker than the gear, the gear has no material.
            bore_moments = [
                shaft.integrate(lambda u, outer, inner: np.minimum(outer, diameter) ** 2, *face),
                shaft.integrate(lambda u, outer, inner: np.minimum(outer, diameter) ** 4, *face),
            ]
            moments = [width * diameter**2 - bore_moments[0], width * diameter**4 - bore_moments[1]]
        density = geometry.material.density
        return math.pi / 4.0 * density * moments[0], math.pi / 32.0 * density * moments[1]

    def _add_couplings(self) -> None:
        """Merge or connect the nodes at the ends of each coupling.

        A rigid coupling merges its nodes, an elastic one adds a spring between them. A coupling to
        the casing gives the node a torsional stiffness, which is infinite if the coupling is rigid.
        """
        for coupling in self.gearbox.couplings:
            end_nodes = []
            for owner, _ in (coupling.inner, coupling.outer):
                key = coupling.part.id, owner.id
                end_nodes.append(self.attachment_nodes.get(key) or self.carrier_nodes.get(owner.id))
            is_rigid = coupling.stiffness is None or coupling.stiffness >= RIGID_STIFFNESS
            owner_ids = coupling.inner[0].id, coupling.outer[0].id
            if None not in end_nodes:
                if is_rigid:
                    end_nodes[0].merge(end_nodes[1])
                else:
                    self.springs.append((*end_nodes, coupling.stiffness, 0.0))
            elif any(owner_id in self.gearbox.rotors.casings for owner_id in owner_ids):
                for node in end_nodes:
                    if node is None:
                        continue
                    body = node.body()
                    body.torsional_stiffness += math.inf if is_rigid else coupling.stiffness
                    # A rigid coupling to the casing also fixes the axis.
                    body.support_stiffness = math.inf if is_rigid else body.support_stiffness

    def _find_pin_angles(self) -> dict[str, tuple]:
        """Return a dict: rotor of a planet -> (stage, angle of its pin on the carrier in rad).

        The angle is the direction from the central gear (sun or ring) to the planet.
        """
        pin_angles: dict[str, tuple] = {}
        for stage in self.gearbox.stages.values():
            if stage.carrier:
                planet = self.gearbox.planet(stage)
                angle = self.gearbox.centre_line_angle(stage)
                # The line of centres points from pinion to wheel; if the planet is the pinion, it
                # points to the central gear and is reversed.
                angle += 0.0 if stage.wheel.id == planet.id else math.pi
                rotor = self.gearbox.rotors.find_rotor(self.gearbox.shaft_of[planet.id].id)
                pin_angles.setdefault(rotor, (stage, math.remainder(angle, math.tau)))
        return pin_angles

    def _make_body(
        self, node: _Node, pin_angles: dict[str, tuple], structural_damping: float
    ) -> Body:
        """Make the `Body` for a node and all nodes merged with it.

        `pin_angles` is the result of `_find_pin_angles`; `structural_damping` is the ratio of
        damping to stiffness in s. Raise an `InputError` if the inertia is unknown.
        """
        gear, fields = node.gear, {}
        rotor = self.gearbox.rotors.find_rotor(node.shaft.id if node.shaft else node.parts[0].id)
        if rotor in pin_angles:
            stage, fields["angle"] = pin_angles[rotor]
            fields["carrier"] = self.carrier_nodes[stage.carrier].body().name
        carriers = [part for part in node.parts if part.type == "planet_carrier"]
        # The radius of a body that is neither a gear nor a carrier is not used.
        radius = self.gearbox.pin_radius(carriers[0]) if carriers else 0.01
        if gear:
            radius = self.gears[gear.id].base_diameter / 2.0
            fields["teeth"] = self.gears[gear.id].teeth
        if carriers and not node.inertia:
            node.mass, node.inertia = self.gearbox.default_carrier(carriers[0])
        if not node.inertia:
            problem = "are missing: they must be given for the inertia"
            raise InputError("shaft sections", problem=problem, owner=str(node.shaft))
        support = math.inf if node.support_stiffness is None else node.support_stiffness
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

    def make_bodies_and_shafts(self, structural_damping: float) -> tuple[list[Body], list[Shaft]]:
        """Make the bodies of the gear train and its shafts, i.e. the springs between bodies.

        `structural_damping` is the ratio of damping to stiffness in s.
        """
        pin_angles = self._find_pin_angles()
        bodies = [
            self._make_body(node, pin_angles, structural_damping)
            for node in dict.fromkeys(node.body() for node in self.nodes)
        ]
        shafts = []
        for node_1, node_2, stiffness, bending_stiffness in self.springs:
            body_1, body_2 = node_1.body(), node_2.body()
            if body_1.name == body_2.name:
                continue  # A rigid coupling has merged both ends.
            # Bending has no effect between bodies that are fixed perpendicular to their axes.
            if body_1.support_stiffness in (None, math.inf) and body_2.support_stiffness in (
                None,
                math.inf,
            ):
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


def _select_bearings(part: Component, bearings: list) -> list:
    """Return the bearings whose inner or outer part is the shaft with the component `part`."""
    return [x for x in bearings if part.id in (x.inner[0].id, x.outer[0].id)]


def build_train(
    gearbox: "Gearbox",
    load_case: str | None,
    *,
    bearing_stiffness: float | None,
    structural_damping: float,
    reference: str | None,
    **mesh_options: Any,
) -> GearTrain:
    """Build the gear train of a gearbox in a load case.

    `Gearbox.train` describes the arguments; `mesh_options` are those for damping and stiffness of
    the meshes. Raise ValueError if torques are unknown or a stage cannot be computed.
    """
    loads = gearbox.loads(load_case)
    if loads.torque_error is not None:
        raise loads.torque_error
    for name, reason in gearbox.refused.items():
        raise ValueError(f"stage {name} is refused, and the train needs all stages: {reason}")
    geometries = {name: gearbox.stage(name, load_case) for name in gearbox.stages}
    gears = {}
    for name, stage in gearbox.stages.items():
        gears |= {stage.pinion.id: geometries[name].pinion, stage.wheel.id: geometries[name].wheel}
    builder = _TrainBuilder(gearbox, load_case, bearing_stiffness, gears)
    bodies, shafts = builder.make_bodies_and_shafts(structural_damping)
    meshes = _make_meshes(gearbox, loads, geometries, mesh_options)
    carrier_speeds = {
        loads.component_motion(gearbox, stage.carrier)
        for stage in gearbox.stages.values()
        if stage.carrier
    }
    # A train with planets is described in a frame that rotates with the carriers.
    frame_speed = carrier_speeds.pop() if carrier_speeds else 0.0
    if any(abs(speed - frame_speed) > 1e-9 * abs(frame_speed) for speed in carrier_speeds):
        raise ValueError(
            "planetary stages whose carriers turn at different speeds are not allowed in a train; "
            "each stage by itself can be computed"
        )
    speeds_in_frame = {
        name: loads.component_motion(gearbox, gearbox.shaft_of[stage.pinion.id].id) - frame_speed
        for name, stage in gearbox.stages.items()
    }
    # Speeds are scaled by the speed of the reference pinion in this frame, which must not be 0.
    min_speed = 1e-9 * max(map(abs, speeds_in_frame.values()))
    choices = [name for name, speed in speeds_in_frame.items() if abs(speed) > min_speed]
    reference = checks.check_choice("reference", reference or choices[0], choices)
    return GearTrain(
        bodies=bodies,
        meshes=meshes,
        shafts=shafts,
        reference=reference,
        carrier_ratio=frame_speed / speeds_in_frame[reference],
    )


def _make_meshes(gearbox: "Gearbox", loads, geometries: dict, mesh_options: dict) -> list[Mesh]:
    """Make the meshes of all stages under the torques of the `Loads` of a gearbox.

    `geometries` maps stage names to `GearStage` objects. `mesh_options` are the arguments of
    `GearStage.train_parameters` for damping and stiffness.
    """
    # Torque over base diameter is half of the mesh force; only ratios of forces are needed.
    half_forces = {
        name: abs(loads.pinion_torques[name]) / geometries[name].pinion.base_diameter
        for name in gearbox.stages
    }
    # Meshes without load get a very small one, because the model requires a load > 0.
    min_half_force = _MIN_RELATIVE_FORCE * max(half_forces.values())
    # Equal meshes, e.g. of a planetary stage, have the same parameters, which are computed once.
    parameters: dict = {}
    meshes = []
    for name, stage in gearbox.stages.items():
        geometry, torque = geometries[name], loads.pinion_torques[name]
        magnitude = max(half_forces[name], min_half_force) * geometry.pinion.base_diameter
        key = geometry, f"{magnitude:.10g}"
        if key not in parameters:
            parameters[key] = geometry.train_parameters(torque=magnitude, **mesh_options)
        position, sign = gearbox.centre_line_angle(stage), 1.0
        if stage.internal:
            # The position of an internal mesh is the direction from the wheel to the pinion, and
            # the torque on the wheel determines its direction of load.
            position, sign = position + math.pi, -1.0
        # A torque in the direction of rotation does positive work.
        pinion_drives = torque * loads.pinion_motions[name] >= 0.0
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
