"""Shafts, springs and places of a gearbox, read from the components of a REXS file.

The shafts of a box have one direction u; v and w are across it. Angles and torques are positive
counterclockwise, from v to w. A coordinate on a shaft is counted along the axis of this shaft.
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
#: Nodes and weights of an integral over a part of a conical section, exact to rounding.
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(24)


class Section(NamedTuple):
    """A conical section of a shaft, in m; diameters are those where it starts and ends."""

    start: float
    end: float
    outer: tuple[float, float]
    inner: tuple[float, float]


class Shaft(NamedTuple):
    """A shaft with its sections in SI units."""

    name: str
    material: Material
    shear_modulus: float  #: Pa
    sections: tuple[Section, ...]
    start: np.ndarray | None  #: its origin along u, v, w, m
    direction: int  #: 1 if its axis points along u, -1 if against u

    @property
    def ends(self) -> tuple[float, float]:
        """Coordinates of both ends, m; (0, 0) without sections."""
        return (self.sections[0].start, self.sections[-1].end) if self.sections else (0.0, 0.0)

    def integral(self, function: Callable, start: float, stop: float) -> float:
        """Return the integral of function(u, outer, inner diameter) over the coordinate u."""
        total = 0.0
        for section in self.sections:
            a, b = max(start, section.start), min(stop, section.end)
            if b > a:
                u = (a + b) / 2.0 + (b - a) / 2.0 * _NODES
                fraction = (u - section.start) / (section.end - section.start)
                outer, inner = (d[0] + (d[1] - d[0]) * fraction for d in section[2:])
                total += (b - a) / 2.0 * float(_WEIGHTS @ function(u, outer, inner))
        return total

    def mass(self, start: float, stop: float) -> float:
        """Return the mass between two coordinates, kg."""
        area = self.integral(lambda u, outer, inner: outer**2 - inner**2, start, stop)
        return math.pi / 4.0 * self.material.density * area

    def inertia(self, start: float, stop: float) -> float:
        """Return the moment of inertia about the axis between two coordinates, kg m^2."""
        polar = self.integral(lambda u, outer, inner: outer**4 - inner**4, start, stop)
        return math.pi / 32.0 * self.material.density * polar

    def _flexibility(self, power: int, start: float, stop: float) -> float:
        """Return the integral of (u - start)^power over the polar moment of area, from 0 gaps."""
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
        """Return the torsional stiffness between two coordinates, N m/rad."""
        return self.shear_modulus / self._flexibility(0, start, stop)

    def bending_stiffness(self, start: float, stop: float) -> float:
        """Return the stiffness, N/m, against a displacement across the axis of ends without tilt.

        It is 12 E I / L^3 for a uniform shaft.
        """
        zeroth, first, second = (self._flexibility(power, start, stop) for power in range(3))
        # The area moment for bending is half the polar one.
        return self.material.young / 2.0 / (second - first**2 / zeroth)


class Spring(NamedTuple):
    """A bearing or a coupling between two parts; a part is (component, coordinate on it in m)."""

    part: Component
    inner: tuple[Component, float | None]
    outer: tuple[Component, float | None]
    stiffness: float | None  #: N/m of a bearing, N m/rad of a coupling; None: not given


class Places:
    """Positions and axes of the components of a box, along its directions u, v and w, in m."""

    def __init__(self, model: RexsModel):
        self.model = model
        # The direction of the first gear or shaft is that of the box.
        parts = model.of_type("cylindrical_gear", "shaft")
        frames = [frame for frame in map(self._frame, parts) if frame is not None]
        u = frames[0][1][0] if frames else np.array([1.0, 0.0, 0.0])
        w = next(x for x in np.eye(3)[[2, 1]] if abs(x @ u) < 0.9)
        w = w - (w @ u) * u
        w /= np.linalg.norm(w)
        self.axes = np.stack([u, np.cross(w, u), w])

    def _frame(self, part: Component, depth: int = 0) -> tuple | None:
        """Return (origin, axes as rows) of a component in space, or None if it states none."""
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
        return frame[0] + np.array(origin) @ frame[1], axes @ frame[1]

    def position(self, part: Component) -> np.ndarray | None:
        """Return where the origin of a component lies along u, v and w, or None if unknown."""
        frame = self._frame(part)
        return None if frame is None else self.axes @ frame[0]

    def direction(self, part: Component) -> int:
        """Return 1 if the axis of a component points along u, -1 if against u."""
        frame = self._frame(part)
        return 1 if frame is None or frame[1][0] @ self.axes[0] >= 0.0 else -1


def material(model: RexsModel, part: Component, default: Callable) -> tuple[Material, float]:
    """Return the material of a component and its shear modulus, Pa.

    The function `default` takes the text of a default and the component.
    """
    steel, source = Material(), model.referenced(part, "material")
    names = {"young": "elastic_modulus", "poisson": "poisson_ratio", "density": "density"}
    found = {
        field: source and source.number(names[field], unit)
        for field, unit in (("young", "Pa"), ("poisson", "1"), ("density", "kg/m^3"))
    }
    if missing := [names[field] for field, value in found.items() if value is None]:
        default(f"{', '.join(missing)} of steel: 206 GPa, 0.3, 7850 kg/m^3", part)
    values = {x: getattr(steel, x) if value is None else value for x, value in found.items()}
    chosen = Material(**values)
    shear = source.number("shear_modulus", "Pa") if source else None
    return chosen, shear or chosen.young / (2.0 * (1.0 + chosen.poisson))


def shafts(model: RexsModel, places: Places, default: Callable) -> dict[str, Shaft]:
    """Return the shafts of a model by id; `default` is that of `material`."""
    found = {}
    for part in model.of_type("shaft"):
        sections, end = [], 0.0
        for x in (x for x in model.parts_of(part) if x.type == "shaft_section"):
            purpose = "for the stiffness and inertia of the shaft"
            start = x.number("u_coordinate_on_shaft", "m")
            start = end if start is None else start
            end = start + x.number("length", "m", purpose)
            outer = [x.number(f"outer_diameter_{at}", "m", purpose) for at in ("begin", "end")]
            inner = [x.number(f"inner_diameter_{at}", "m") or 0.0 for at in ("begin", "end")]
            for at, d, bore in zip(("begin", "end"), outer, inner, strict=True):
                if not d > bore >= 0.0:
                    allowed = f"above the inner diameter, {bore:g} m"
                    raise InputError(f"outer_diameter_{at}", d, allowed, owner=str(x))
            if end > start:
                sections.append(Section(start, end, tuple(outer), tuple(inner)))
        chosen, shear = material(model, part, default)
        sections.sort()
        origin = places.position(part)
        found[part.id] = Shaft(
            part.name, chosen, shear, tuple(sections), origin, places.direction(part)
        )
    return found


def _is_engaged(model: RexsModel, part: Component) -> bool:
    """Return whether a coupling, which may list this for each gear of the box, is engaged."""
    engaged = part.value("is_engaged")
    if isinstance(engaged, list):
        units = model.of_type("gear_unit")
        gear = int(units[0].number("gear_shift_index", "1") or 1) if units else 1
        engaged = engaged[gear - 1] if 0 < gear <= len(engaged) else None
    return str(engaged).strip().lower() != "false"


def springs(model: RexsModel, types: tuple, attribute: str, unit: str) -> list[Spring]:
    """Return the bearings or couplings of some types; a disengaged coupling is left out."""
    found = []
    for part in model.of_type(*types):
        if not _is_engaged(model, part):
            continue
        # Couplings of version 1.0 have two sides, without names.
        for relation, roles, ends in (
            ("side", ("inner_part", "outer_part"), ("inner_side", "outer_side")),
            ("coupling", ("side_1", "side_2"), ("side_1", "side_2")),
        ):
            for sides in model.related(relation, assembly=part):
                if {*roles} <= sides.keys():
                    coordinates = [part.number(f"u_coordinate_on_shaft_{x}", "m") for x in ends]
                    inner, outer = zip((sides[role] for role in roles), coordinates, strict=True)
                    found.append(Spring(part, inner, outer, part.number(attribute, unit)))
    return found
