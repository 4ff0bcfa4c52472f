"""Shafts, bearings, couplings and positions of a gearbox, read from a REXS file.

All shafts of a box are parallel to its direction u; v and w are perpendicular to it. Angles and
torques are positive counterclockwise, from v to w. A coordinate on a shaft increases along the axis
of this shaft, which points along u or against it.
"""

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from gearlib.checks import InputError
from gearlib.gearboxes.rexs import Component, RexsModel
from gearlib.models.geometry.gear import Material

#: Stiffness, in N/m or N m/rad, from which a spring counts as rigid.
RIGID = 1e13
COUPLINGS = ("coupling", "switchable_coupling", "fixed_coupling")
BEARINGS = (
    *("concept_bearing", "slide_bearing"),
    *(f"rolling_bearing_with_{kind}_geometry" for kind in ("catalog", "detailed")),
)
#: Gauss-Legendre nodes and weights, with which integrals over a cone are exact to rounding.
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(24)


class Section(NamedTuple):
    """A conical section of a shaft, in m."""

    start: float  #: coordinate on the shaft
    end: float  #: coordinate on the shaft
    outer: tuple[float, float]  #: outer diameters at start and end
    inner: tuple[float, float]  #: inner diameters at start and end


class Shaft(NamedTuple):
    """A shaft with its sections in SI units."""

    name: str
    material: Material
    shear_modulus: float  #: Pa
    sections: tuple[Section, ...]
    start: np.ndarray | None  #: position of its origin along u, v, w, m; None if unknown
    direction: int  #: 1 if its axis points along u, -1 if against u

    @property
    def ends(self) -> tuple[float, float]:
        """Coordinates of both ends of the shaft along its axis, m; (0, 0) without sections."""
        if not self.sections:
            return 0.0, 0.0
        return self.sections[0].start, self.sections[-1].end

    def integral(self, function: Callable, start: float, stop: float) -> float:
        """Integrate function(u, outer diameter, inner diameter) over the coordinate u on the shaft.

        The limits `start` and `stop` are in m, like the arguments of the function, which are
        arrays. Diameters vary linearly along a section. Gaps between sections do not contribute.
        """
        total = 0.0
        for section in self.sections:
            lower, upper = max(start, section.start), min(stop, section.end)
            if upper > lower:
                # The nodes for the interval from -1 to 1, moved to this part of the section.
                u = (lower + upper) / 2.0 + (upper - lower) / 2.0 * _NODES
                fraction = (u - section.start) / (section.end - section.start)
                outer = section.outer[0] + (section.outer[1] - section.outer[0]) * fraction
                inner = section.inner[0] + (section.inner[1] - section.inner[0]) * fraction
                total += (upper - lower) / 2.0 * float(_WEIGHTS @ function(u, outer, inner))
        return total

    def mass(self, start: float, stop: float) -> float:
        """Return the mass between two coordinates in m, kg."""
        integral = self.integral(lambda u, outer, inner: outer**2 - inner**2, start, stop)
        return math.pi / 4.0 * self.material.density * integral

    def inertia(self, start: float, stop: float) -> float:
        """Return the moment of inertia about the axis between two coordinates in m, kg m^2."""
        integral = self.integral(lambda u, outer, inner: outer**4 - inner**4, start, stop)
        return math.pi / 32.0 * self.material.density * integral

    def _flexibility(self, power: int, start: float, stop: float) -> float:
        """Return the integral of (u - start)^power / I_p over the coordinate u from start to stop.

        I_p is the polar moment of area in m^4. The integral determines the torsional stiffness for
        the power 0, and the bending stiffness for the powers 0, 1 and 2. Raises ValueError if the
        sections of the shaft have gaps there.
        """
        covered = self.integral(lambda u, outer, inner: np.ones_like(u), start, stop)
        if covered < (stop - start) * (1.0 - 1e-6):
            problem = (
                f"are missing between {1e3 * start:.6g} and {1e3 * stop:.6g} mm: they must be "
                "given for the torsional stiffness"
            )
            raise InputError("shaft sections", problem=problem, owner=f"shaft {self.name}")
        weight = 32.0 / math.pi  # I_p = pi / 32 (outer^4 - inner^4)
        return self.integral(
            lambda u, outer, inner: weight * (u - start) ** power / (outer**4 - inner**4),
            start,
            stop,
        )

    def torsional_stiffness(self, start: float, stop: float) -> float:
        """Return the torsional stiffness between two coordinates in m, N m/rad."""
        return self.shear_modulus / self._flexibility(0, start, stop)

    def bending_stiffness(self, start: float, stop: float) -> float:
        """Return the transverse stiffness between two points of the shaft that do not tilt, N/m.

        The points are coordinates on the shaft in m. The stiffness is 12 E I / L^3 if the shaft is
        uniform, with Young's modulus E, area moment I and distance L.
        """
        zeroth, first, second = (self._flexibility(power, start, stop) for power in range(3))
        # The force at ends that do not tilt follows from the beam equation. Its integrals have the
        # area moment for bending, which is half the polar one.
        return self.material.young / 2.0 / (second - first**2 / zeroth)


class Spring(NamedTuple):
    """A bearing or a coupling between an inner and an outer part.

    Each part is a pair (component, coordinate on it in m, None if it is not stated).
    """

    part: Component  #: component of the bearing or coupling itself
    inner: tuple[Component, float | None]
    outer: tuple[Component, float | None]
    stiffness: float | None  #: N/m of a bearing, N m/rad of a coupling; None: not given


class Places:
    """Positions and axes of the components of a box, along its directions u, v and w, in m."""

    def __init__(self, model: RexsModel):
        """Find the directions u, v and w of the box; u is the axis of the first gear or shaft.

        All shafts of the box are parallel to u, and v and w are perpendicular to it.
        """
        self.model = model
        parts = model.of_type("cylindrical_gear", "shaft")
        frames = [frame for frame in map(self._frame, parts) if frame is not None]
        u = np.array([1.0, 0.0, 0.0])
        if frames:
            _, axes = frames[0]
            u = axes[0]
        # w is close to the third axis of the file. If u itself is close to that axis, w is close to
        # the second one.
        w = next(axis for axis in np.eye(3)[[2, 1]] if abs(axis @ u) < 0.9)
        w = w - (w @ u) * u
        w /= np.linalg.norm(w)
        self.axes = np.stack([u, np.cross(w, u), w])

    def _frame(self, part: Component, depth: int = 0) -> tuple | None:
        """Return the position of a component and its axes u, v, w, or None if it is not stated.

        The result is (origin in m, matrix with the axes as rows), both relative to the gear unit.
        The file may state a position relative to another component, whose frame is then found
        first. `depth` is the number of these steps so far, which is limited, because references
        could form a cycle.
        """
        origin = part.vector("support_vector", "m")
        if origin is None or len(origin) != 3:
            return None
        # By default the axes are those of the gear unit; v completes a right-handed system.
        u, w = (part.vector(f"{axis}_axis_vector", "mm") for axis in "uw")
        along, up = np.array(u or [1.0, 0.0, 0.0]), np.array(w or [0.0, 0.0, 1.0])
        axes = np.stack([along, np.cross(up, along), up])
        axes /= np.linalg.norm(axes, axis=1, keepdims=True)
        other = self.model.components.get(str(part.value("reference_component_for_position")))
        if other is None or other.id == part.id or other.type == "gear_unit" or depth > 20:
            return np.array(origin), axes
        frame = self._frame(other, depth + 1)
        if frame is None:
            return None
        other_origin, other_axes = frame
        return other_origin + np.array(origin) @ other_axes, axes @ other_axes

    def position(self, part: Component) -> np.ndarray | None:
        """Return the coordinates u, v, w of the origin of a component in m, or None if unknown."""
        frame = self._frame(part)
        return None if frame is None else self.axes @ frame[0]

    def direction(self, part: Component) -> int:
        """Return 1 if the axis of a component points along u or is unknown, -1 if against u.

        u is the direction of the box to which all shafts are parallel.
        """
        frame = self._frame(part)
        if frame is None:
            return 1
        _, axes = frame
        return 1 if axes[0] @ self.axes[0] >= 0.0 else -1


def material(model: RexsModel, part: Component, default: Callable) -> tuple[Material, float]:
    """Return the material of a component and its shear modulus, Pa.

    Values that the file does not state are those of steel. Then `default` is called with text that
    says so and with the component; it is the method `Gearbox.default`, which lists default values.
    """
    fields = (
        ("young", "elastic_modulus", "Pa"),
        ("poisson", "poisson_ratio", "1"),
        ("density", "density", "kg/m^3"),
    )
    steel, source = Material(), model.referenced(part, "material")
    values, missing = {}, []
    for field, attribute, unit in fields:
        value = source.number(attribute, unit) if source else None
        if value is None:
            missing.append(attribute)
            value = getattr(steel, field)
        values[field] = value
    if missing:
        default(f"{', '.join(missing)} of steel: 206 GPa, 0.3, 7850 kg/m^3", part)
    chosen = Material(**values)
    shear_modulus = source.number("shear_modulus", "Pa") if source else None
    return chosen, shear_modulus or chosen.young / (2.0 * (1.0 + chosen.poisson))


def shafts(model: RexsModel, places: Places, default: Callable) -> dict[str, Shaft]:
    """Return the shafts of a model by the id of their components.

    `default` is called for each material value that the file does not state; it is the method
    `Gearbox.default`, which lists default values.
    """
    shafts_by_id = {}
    for part in model.of_type("shaft"):
        sections, end = [], 0.0
        for component in model.parts_of(part):
            if component.type != "shaft_section":
                continue
            section = _section(component, end)
            end = section.end
            if end > section.start:
                sections.append(section)
        shaft_material, shear_modulus = material(model, part, default)
        sections.sort()
        properties = part.name, shaft_material, shear_modulus, tuple(sections)
        shafts_by_id[part.id] = Shaft(*properties, places.position(part), places.direction(part))
    return shafts_by_id


def _section(component: Component, default_start: float) -> Section:
    """Return a conical section of a shaft, or raise ValueError for wrong diameters.

    `component` is the component of the section in the file. `default_start` is the coordinate in m
    at which it starts if the file states none: the end of the section before it.
    """
    purpose = "for the stiffness and inertia of the shaft"
    start = component.number("u_coordinate_on_shaft", "m")
    if start is None:
        start = default_start
    end = start + component.number("length", "m", purpose)
    places = "begin", "end"
    outer = [component.number(f"outer_diameter_{place}", "m", purpose) for place in places]
    inner = [component.number(f"inner_diameter_{place}", "m") or 0.0 for place in places]
    for place, outer_diameter, inner_diameter in zip(places, outer, inner, strict=True):
        if not outer_diameter > inner_diameter >= 0.0:
            allowed = f"above the inner diameter, {inner_diameter:g} m"
            raise InputError(
                f"outer_diameter_{place}", outer_diameter, allowed, owner=str(component)
            )
    return Section(start, end, tuple(outer), tuple(inner))


def _is_engaged(model: RexsModel, part: Component) -> bool:
    """Return whether a coupling is engaged; it is unless the file states otherwise.

    The file may state a list with a value for each gear (speed) of the box. Then the component
    "gear_unit" states the number of the gear that is shifted.
    """
    engaged = part.value("is_engaged")
    if isinstance(engaged, list):
        units = model.of_type("gear_unit")
        gear_number = int(units[0].number("gear_shift_index", "1") or 1) if units else 1
        engaged = engaged[gear_number - 1] if 0 < gear_number <= len(engaged) else None
    return str(engaged).strip().lower() != "false"


def springs(model: RexsModel, types: tuple, attribute: str, unit: str) -> list[Spring]:
    """Return the bearings or couplings of a model as springs, without disengaged couplings.

    `types` are the types of their components in REXS; `attribute` is the name of their stiffness in
    the file, and `unit` the unit of the result.
    """
    box_springs = []
    for part in model.of_type(*types):
        if not _is_engaged(model, part):
            continue
        # The parts of a spring are related as inner and outer part. Couplings of version 1.0 have
        # two numbered sides instead.
        for relation, roles, side_names in (
            ("side", ("inner_part", "outer_part"), ("inner_side", "outer_side")),
            ("coupling", ("side_1", "side_2"), ("side_1", "side_2")),
        ):
            for parts in model.related(relation, assembly=part):
                if not {*roles} <= parts.keys():
                    continue
                ends = []
                for role, side in zip(roles, side_names, strict=True):
                    ends.append((parts[role], part.number(f"u_coordinate_on_shaft_{side}", "m")))
                stiffness = part.number(attribute, unit)
                box_springs.append(Spring(part, ends[0], ends[1], stiffness))
    return box_springs
