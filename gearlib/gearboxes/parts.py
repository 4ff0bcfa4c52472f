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
        """Coordinates of both ends on the shaft, m; (0, 0) without sections."""
        if not self.sections:
            return 0.0, 0.0
        return self.sections[0].start, self.sections[-1].end

    def integral(self, function: Callable, start: float, stop: float) -> float:
        """Integrate function(u, outer diameter, inner diameter) over the coordinate u on the shaft.

        The limits `start` and `stop` and the arguments of the function, which are arrays, are in m.
        Gaps between sections do not contribute.
        """
        total = 0.0
        for section in self.sections:
            lower, upper = max(start, section.start), min(stop, section.end)
            if upper > lower:
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

        I_p is the polar moment of area in m^4. Raises ValueError if the sections have gaps there.
        """
        covered = self.integral(lambda u, outer, inner: np.ones_like(u), start, stop)
        if covered < (stop - start) * (1.0 - 1e-6):
            problem = (
                f"are missing between {1e3 * start:.6g} and {1e3 * stop:.6g} mm: they must be "
                "given for the torsional stiffness"
            )
            raise InputError("shaft sections", problem=problem, owner=f"shaft {self.name}")
        weight = 32.0 / math.pi
        return self.integral(
            lambda u, outer, inner: weight * (u - start) ** power / (outer**4 - inner**4),
            start,
            stop,
        )

    def torsional_stiffness(self, start: float, stop: float) -> float:
        """Return the torsional stiffness between two coordinates in m, N m/rad."""
        return self.shear_modulus / self._flexibility(0, start, stop)

    def bending_stiffness(self, start: float, stop: float) -> float:
        """Return the transverse stiffness between two coordinates in m whose ends do not tilt, N/m.

        It is 12 E I / L^3 for a uniform shaft.
        """
        zeroth, first, second = (self._flexibility(power, start, stop) for power in range(3))
        # The area moment for bending is half the polar one.
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
        """Find the directions u, v and w of the box; u is the axis of the first gear or shaft."""
        self.model = model
        parts = model.of_type("cylindrical_gear", "shaft")
        frames = [frame for frame in map(self._frame, parts) if frame is not None]
        u = np.array([1.0, 0.0, 0.0])
        if frames:
            _, axes = frames[0]
            u = axes[0]
        # w is close to the third axis of the file or, if u is, to the second one.
        w = next(axis for axis in np.eye(3)[[2, 1]] if abs(axis @ u) < 0.9)
        w = w - (w @ u) * u
        w /= np.linalg.norm(w)
        self.axes = np.stack([u, np.cross(w, u), w])

    def _frame(self, part: Component, depth: int = 0) -> tuple | None:
        """Return the frame of a component in space as (origin in m, axes u, v, w as rows).

        Returns None if its position is not stated. `depth` is the number of frames to which the
        position has been referred so far; it ends cycles.
        """
        origin = part.vector("support_vector", "m")
        if origin is None or len(origin) != 3:
            return None
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
        """Return 1 if the axis of a component points along u or is unknown, -1 if against u."""
        frame = self._frame(part)
        if frame is None:
            return 1
        _, axes = frame
        return 1 if axes[0] @ self.axes[0] >= 0.0 else -1


def material(model: RexsModel, part: Component, default: Callable) -> tuple[Material, float]:
    """Return the material of a component and its shear modulus, Pa.

    Steel replaces values that the file does not state; then `default` is called with a text that
    says so and the component, as `Gearbox.default`.
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
    """Return the shafts of a model by the id of their components; see `material` for `default`."""
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
    """Return a section of a shaft from its component, or raise ValueError for wrong diameters.

    `default_start` is the coordinate in m at which it starts if the file states none.
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
    """Return whether a coupling is engaged, as it is if the file does not state otherwise.

    The file may list this for each gear of the box; the gear unit states which gear is shifted.
    """
    engaged = part.value("is_engaged")
    if isinstance(engaged, list):
        units = model.of_type("gear_unit")
        gear_number = int(units[0].number("gear_shift_index", "1") or 1) if units else 1
        engaged = engaged[gear_number - 1] if 0 < gear_number <= len(engaged) else None
    return str(engaged).strip().lower() != "false"


def springs(model: RexsModel, types: tuple, attribute: str, unit: str) -> list[Spring]:
    """Return the bearings or couplings of a model, without disengaged couplings.

    `types` are the types of their components; `attribute` is the name of the stiffness in REXS, and
    `unit` its unit here.
    """
    box_springs = []
    for part in model.of_type(*types):
        if not _is_engaged(model, part):
            continue
        # Couplings of version 1.0 have two sides, without names.
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
