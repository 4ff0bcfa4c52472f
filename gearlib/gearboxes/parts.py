"""Shafts, bearings, couplings and positions of a gearbox, read from a REXS file.

All shafts of a gearbox are parallel to the direction u; v and w are perpendicular to it. Angles and
torques are positive counterclockwise, from v to w. The coordinate on a shaft increases along the
axis of this shaft, which points in the direction u or opposite to it.
"""

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from gearlib.checks import InputError
from gearlib.gearboxes.rexs import Component, RexsModel
from gearlib.models.geometry.gear import Material

#: Springs of at least this stiffness, in N/m or N m/rad, are treated as rigid.
RIGID_STIFFNESS = 1e13
COUPLINGS = ("coupling", "switchable_coupling", "fixed_coupling")
BEARINGS = (
    *("concept_bearing", "slide_bearing"),
    *(f"rolling_bearing_with_{kind}_geometry" for kind in ("catalog", "detailed")),
)
#: Largest number of references from one component to the next that define a position.
_MAX_REFERENCE_DEPTH = 20
#: Gauss-Legendre nodes and weights; integrals over a cone are exact to rounding errors.
_GAUSS_NODES, _GAUSS_WEIGHTS = np.polynomial.legendre.leggauss(24)


class Section(NamedTuple):
    """A conical section of a shaft; all lengths in m."""

    start: float  #: coordinate on the shaft
    end: float  #: coordinate on the shaft
    outer: tuple[float, float]  #: outer diameters at start and end
    inner: tuple[float, float]  #: inner diameters at start and end


class Shaft(NamedTuple):
    """A shaft with its sections, in SI units."""

    name: str
    material: Material
    shear_modulus: float  #: Pa
    sections: tuple[Section, ...]
    start: np.ndarray | None  #: origin (u, v, w), m; None if unknown
    direction: int  #: 1 if the axis points along u, -1 if opposite

    @property
    def ends(self) -> tuple[float, float]:
        """Coordinates of both ends of the shaft, m; (0, 0) without sections."""
        if not self.sections:
            return 0.0, 0.0
        return self.sections[0].start, self.sections[-1].end

    def integrate(self, function: Callable, start: float, stop: float) -> float:
        """Integrate function(u, outer diameter, inner diameter) over the coordinate u on the shaft.

        The limits and the arguments of the function, which are arrays, are in m. Diameters vary
        linearly along a section; gaps between sections do not contribute.
        """
        total = 0.0
        for section in self.sections:
            lower, upper = max(start, section.start), min(stop, section.end)
            if upper > lower:
                # Gauss nodes are scaled from (-1, 1) to (lower, upper).
                u = (lower + upper) / 2.0 + (upper - lower) / 2.0 * _GAUSS_NODES
                fraction = (u - section.start) / (section.end - section.start)
                outer = section.outer[0] + (section.outer[1] - section.outer[0]) * fraction
                inner = section.inner[0] + (section.inner[1] - section.inner[0]) * fraction
                total += (upper - lower) / 2.0 * float(_GAUSS_WEIGHTS @ function(u, outer, inner))
        return total

    def mass(self, start: float, stop: float) -> float:
        """Return the mass in kg between two coordinates in m."""
        integral = self.integrate(lambda u, outer, inner: outer**2 - inner**2, start, stop)
        return math.pi / 4.0 * self.material.density * integral

    def inertia(self, start: float, stop: float) -> float:
        """Return the moment of inertia about the axis, in kg m^2, between two coordinates in m."""
        integral = self.integrate(lambda u, outer, inner: outer**4 - inner**4, start, stop)
        return math.pi / 32.0 * self.material.density * integral

    def _integrate_flexibility(self, power: int, start: float, stop: float) -> float:
        """Integrate (u - start)^power / I_p over the coordinate u from `start` to `stop`, in m.

        I_p is the polar moment of area in m^4. The power 0 determines the torsional stiffness, the
        powers 0, 1 and 2 determine the bending stiffness. Raise an `InputError` if there are gaps
        between the sections.
        """
        covered_length = self.integrate(lambda u, outer, inner: np.ones_like(u), start, stop)
        if covered_length < (stop - start) * (1.0 - 1e-6):
            problem = (
                f"are missing between {1e3 * start:.6g} and {1e3 * stop:.6g} mm: they must be "
                "given for the torsional stiffness"
            )
            raise InputError("shaft sections", problem=problem, owner=f"shaft {self.name}")
        factor = 32.0 / math.pi  # I_p = pi / 32 (outer^4 - inner^4)
        return self.integrate(
            lambda u, outer, inner: factor * (u - start) ** power / (outer**4 - inner**4),
            start,
            stop,
        )

    def torsional_stiffness(self, start: float, stop: float) -> float:
        """Return the torsional stiffness in N m/rad between two coordinates in m."""
        return self.shear_modulus / self._integrate_flexibility(0, start, stop)

    def bending_stiffness(self, start: float, stop: float) -> float:
        """Return the bending stiffness in N/m between two coordinates in m.

        The ends do not tilt. For a uniform shaft, it is 12 E I / L^3 with Young's modulus E, second
        moment of area I and length L.
        """
        # Moments of order 0, 1 and 2 of the flexibility.
        moment_0, moment_1, moment_2 = (
            self._integrate_flexibility(power, start, stop) for power in range(3)
        )
        # The beam equation for ends that do not tilt; I is half the polar moment of area I_p.
        return self.material.young / 2.0 / (moment_2 - moment_1**2 / moment_0)


class Spring(NamedTuple):
    """A bearing or a coupling between an inner and an outer part.

    Each of these is a pair (component, coordinate on it in m or None if it is not stated).
    """

    part: Component  #: component of the bearing or coupling itself
    inner: tuple[Component, float | None]
    outer: tuple[Component, float | None]
    stiffness: float | None  #: N/m for bearings, N m/rad for couplings; None: not stated


class Positions:
    """Positions, in m, and axes of the components of a gearbox in its directions u, v and w."""

    def __init__(self, model: RexsModel):
        """Determine the directions u, v and w; u is the axis of the first gear or shaft.

        All shafts are parallel to u, and v and w are perpendicular to it.
        """
        self.model = model
        parts = model.components_of_type("cylindrical_gear", "shaft")
        frames = [frame for frame in map(self._frame, parts) if frame is not None]
        u = np.array([1.0, 0.0, 0.0])
        if frames:
            _, axes = frames[0]
            u = axes[0]
        # w is the projection of the third axis of the file, or of the second one if the third is
        # nearly parallel to u.
        w = next(axis for axis in np.eye(3)[[2, 1]] if abs(axis @ u) < 0.9)
        w = w - (w @ u) * u
        w /= np.linalg.norm(w)
        self.axes = np.stack([u, np.cross(w, u), w])

    def _frame(self, part: Component, depth: int = 0) -> tuple | None:
        """Return the coordinate system of a component as (origin in m, axes u, v, w as rows).

        Both are relative to the gear unit. Return None if the position is not stated. If the file
        states it relative to another component, the method calls itself for that component; the
        recursion `depth` is limited, because references could form a cycle.
        """
        origin = part.get_vector("support_vector", "m")
        if origin is None or len(origin) != 3:
            return None
        # The default axes are the axes of the gear unit; v completes a right-handed system.
        u, w = (part.get_vector(f"{axis}_axis_vector", "mm") for axis in "uw")
        u_axis, w_axis = np.array(u or [1.0, 0.0, 0.0]), np.array(w or [0.0, 0.0, 1.0])
        axes = np.stack([u_axis, np.cross(w_axis, u_axis), w_axis])
        axes /= np.linalg.norm(axes, axis=1, keepdims=True)
        reference_id = str(part.get_value("reference_component_for_position"))
        reference = self.model.components.get(reference_id)
        if reference is None or reference.id == part.id or reference.type == "gear_unit":
            return np.array(origin), axes
        if depth > _MAX_REFERENCE_DEPTH:
            return np.array(origin), axes
        frame = self._frame(reference, depth + 1)
        if frame is None:
            return None
        reference_origin, reference_axes = frame
        return reference_origin + np.array(origin) @ reference_axes, axes @ reference_axes

    def position(self, part: Component) -> np.ndarray | None:
        """Return the coordinates u, v, w of the origin of a component in m, or None if unknown."""
        frame = self._frame(part)
        return None if frame is None else self.axes @ frame[0]

    def direction(self, part: Component) -> int:
        """Return 1 if the axis of a component points along u or is unknown, else -1."""
        frame = self._frame(part)
        if frame is None:
            return 1
        _, axes = frame
        return 1 if axes[0] @ self.axes[0] >= 0.0 else -1


def read_material(model: RexsModel, part: Component, default: Callable) -> tuple[Material, float]:
    """Return the material of a component and its shear modulus in Pa.

    Missing values are replaced by values of steel, and `default`, the method `Gearbox.default`, is
    called with a text that lists them and with the component.
    """
    fields = (
        ("young", "elastic_modulus", "Pa"),
        ("poisson", "poisson_ratio", "1"),
        ("density", "density", "kg/m^3"),
    )
    steel, source = Material(), model.find_referenced(part, "material")
    values, missing = {}, []
    for field, attribute, unit in fields:
        value = source.get_number(attribute, unit) if source else None
        if value is None:
            missing.append(attribute)
            value = getattr(steel, field)
        values[field] = value
    if missing:
        default(f"{', '.join(missing)} of steel: 206 GPa, 0.3, 7850 kg/m^3", part)
    material = Material(**values)
    shear_modulus = source.get_number("shear_modulus", "Pa") if source else None
    return material, shear_modulus or material.young / (2.0 * (1.0 + material.poisson))


def read_shafts(model: RexsModel, positions: Positions, default: Callable) -> dict[str, Shaft]:
    """Return the shafts of a model as a dict: id of the component -> shaft.

    `default`, the method `Gearbox.default`, records the material values that are not stated.
    """
    shafts_by_id = {}
    for part in model.components_of_type("shaft"):
        sections, end = [], 0.0
        for component in model.parts_of(part):
            if component.type != "shaft_section":
                continue
            section = _read_section(component, end)
            end = section.end
            if end > section.start:
                sections.append(section)
        shaft_material, shear_modulus = read_material(model, part, default)
        sections.sort()
        properties = part.name, shaft_material, shear_modulus, tuple(sections)
        shafts_by_id[part.id] = Shaft(
            *properties, positions.position(part), positions.direction(part)
        )
    return shafts_by_id


def _read_section(component: Component, default_start: float) -> Section:
    """Read a conical section of a shaft; raise an `InputError` if its diameters are invalid.

    `component` is the section in the file. If its start is not stated, it is `default_start`, the
    coordinate in m at which the preceding section ends.
    """
    purpose = "for the stiffness and inertia of the shaft"
    start = component.get_number("u_coordinate_on_shaft", "m")
    if start is None:
        start = default_start
    end = start + component.get_number("length", "m", purpose)
    end_names = "begin", "end"
    outer = [
        component.get_number(f"outer_diameter_{end_name}", "m", purpose) for end_name in end_names
    ]
    inner = [
        component.get_number(f"inner_diameter_{end_name}", "m") or 0.0 for end_name in end_names
    ]
    for end_name, outer_diameter, inner_diameter in zip(end_names, outer, inner, strict=True):
        if not outer_diameter > inner_diameter >= 0.0:
            allowed = f"above the inner diameter, {inner_diameter:g} m"
            raise InputError(
                f"outer_diameter_{end_name}", outer_diameter, allowed, owner=str(component)
            )
    return Section(start, end, tuple(outer), tuple(inner))


def _is_engaged(model: RexsModel, part: Component) -> bool:
    """Return whether a coupling is engaged, which is the default.

    The file may state a list with one value per speed of the gearbox. The component "gear_unit"
    then states the index, from 1, of the selected speed.
    """
    engaged = part.get_value("is_engaged")
    if isinstance(engaged, list):
        units = model.components_of_type("gear_unit")
        speed_index = int(units[0].get_number("gear_shift_index", "1") or 1) if units else 1
        engaged = engaged[speed_index - 1] if 0 < speed_index <= len(engaged) else None
    return str(engaged).strip().lower() != "false"


def read_springs(model: RexsModel, types: tuple, attribute: str, unit: str) -> list[Spring]:
    """Read bearings or couplings of the given component types as springs.

    `attribute` is the name of their stiffness in the file, and `unit` is the unit of the result.
    Disengaged couplings are skipped.
    """
    springs = []
    for part in model.components_of_type(*types):
        if not _is_engaged(model, part):
            continue
        # The relation names an inner and an outer part. Couplings in version 1.0 have two numbered
        # sides instead.
        for relation, roles, side_names in (
            ("side", ("inner_part", "outer_part"), ("inner_side", "outer_side")),
            ("coupling", ("side_1", "side_2"), ("side_1", "side_2")),
        ):
            for parts in model.find_relations(relation, assembly=part):
                if not {*roles} <= parts.keys():
                    continue
                ends = []
                for role, side in zip(roles, side_names, strict=True):
                    ends.append(
                        (parts[role], part.get_number(f"u_coordinate_on_shaft_{side}", "m"))
                    )
                stiffness = part.get_number(attribute, unit)
                springs.append(Spring(part, ends[0], ends[1], stiffness))
    return springs
