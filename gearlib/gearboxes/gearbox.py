"""`read_gearbox`: stages, shafts, springs and load cases of a gearbox from a REXS file."""

import math
import textwrap
from collections.abc import Iterable, Iterator
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from gearlib import checks
from gearlib.checks import InputError
from gearlib.gearboxes import gears, parts, rexs
from gearlib.gearboxes.gears import Stage
from gearlib.gearboxes.loads import Loads, Rotors, solve
from gearlib.gearboxes.rexs import Component, RexsModel
from gearlib.models.geometry.gear_stage import GearStage
from gearlib.models.trains.ready_made import STRUCTURAL_DAMPING

if TYPE_CHECKING:
    import xarray as xr

    from gearlib.models.trains.train import GearTrain

#: Largest differences, in m and rad, of a place that is stated twice.
_DISTANCE_TOLERANCE, _ANGLE_TOLERANCE = 1e-5, 1e-3
_GEARS = ("cylindrical_gear", "ring_gear")
_WIDTH = 80  #: of printed lines
#: Name of the load case of a file without a load spectrum.
NOMINAL = "nominal"


def read_gearbox(path: Any) -> "Gearbox":
    """Read a gearbox from a REXS file: .rexs, .rexsj, .rexsz or .rexs.zip, versions 1.0 to 1.7.

    Parameters
    ----------
    path : str or path-like
        File to read.

    Returns
    -------
    Gearbox
        Its `stage`, `load` and `train` return models; printed, it is a table of the stages.

    Raises
    ------
    FileNotFoundError
        If there is no such file.
    ValueError
        If the file is damaged, of another version or without cylindrical stages.
    """
    model = rexs.read(path)
    try:
        return Gearbox(model)
    except InputError as error:
        raise ValueError(f"{path}: {error}") from None


class Gearbox:
    """A gearbox: stages, shafts, bearings, couplings and load cases of a REXS file.

    Parameters
    ----------
    model : gearlib.gearboxes.rexs.RexsModel
        Content of the file.

    Attributes
    ----------
    stages : dict of str to gearlib.gearboxes.gears.Stage
        Cylindrical stages by name.
    refused : dict of str to str
        Stages that cannot be computed, and the reason.
    shafts : dict of str to gearlib.gearboxes.parts.Shaft
        Shafts by the id of their component.
    bearings, couplings : list of gearlib.gearboxes.parts.Spring
        Bearings, and couplings that are engaged.
    planetary_stages : list of str
        Names of the planetary stages.
    load_cases : dict of str to float
        Load cases and their fractions of the load duration, NaN if they are not stated; "nominal"
        alone if the file has no load spectrum.
    notes : list of str
        Where the file contradicts itself, and what is used.
    """

    def __init__(self, model: RexsModel):
        self.model = model
        self._defaults: dict[str, list[str]] = {}  # text -> components
        self.notes: list[str] = []
        self.refused: dict[str, str] = {}
        self.places = parts.Places(model)
        self.shafts = parts.shafts(model, self.places, self.default)
        self.bearings = parts.springs(model, parts.BEARINGS, "radial_stiffness", "N/m")
        self.couplings = parts.springs(model, parts.COUPLINGS, "rotational_stiffness", "N m/rad")
        self.planetary_stages = [part.name for part in model.of_type("planetary_stage")]
        self.load_cases = model.load_fractions() or {NOMINAL: math.nan}
        self.shaft_of = {
            gear.id: shaft
            for shaft in model.of_type("shaft")
            for gear in model.parts_of(shaft)
            if gear.type in _GEARS
        }
        self.stages = self._read_stages()
        self._loads: dict[str, Loads] = {}
        self.loads()  # Raises the error of gears that are locked.
        for name in self.stages:
            try:
                self.stage(name)
            except ValueError as error:
                self.refused[name] = str(error)

    @property
    def defaults(self) -> list[str]:
        """What the file leaves open, with the value in its place and the components."""
        return [f"{text}: {', '.join(names)}" for text, names in self._defaults.items()]

    def default(self, text: str, part: Component) -> None:
        """List the text of a default for a component."""
        names = self._defaults.setdefault(text, [])
        if part.name not in names:
            names.append(part.name)

    def note(self, text: str) -> None:
        """List a contradiction in the file."""
        if text not in self.notes:
            self.notes.append(text)

    def _read_stages(self) -> dict[str, Stage]:
        """Return the cylindrical stages by name; other stages are refused."""
        carriers = {}  # id of the shaft of a planet -> id of its carrier
        for planetary in self.model.of_type("planetary_stage"):
            owners = [x for x in self.model.parts_of(planetary) if x.type == "planet_carrier"]
            for sides in self.model.related("planet_shaft", planetary_stage=planetary):
                carriers[sides["shaft"].id] = (owners or [planetary])[0].id
        found = {}
        for part in self.model.components.values():
            if not part.type.endswith("_stage") or part.type == "planetary_stage":
                continue
            sides = next(self.model.related("stage", stage=part), {})
            pair = [sides.get("gear_1"), sides.get("gear_2")]
            if part.type != "cylindrical_stage":
                reason = "a cylindrical_stage, with spur or helical gears"
            elif None in pair or any(gear.id not in self.shaft_of for gear in pair):
                reason = "a stage of two gears that lie on shafts"
            else:
                pair.sort(key=lambda gear: (gear.type == "ring_gear", gears.teeth(gear)))
                carried = [carriers.get(self.shaft_of[gear.id].id) for gear in pair]
                carrier = next(filter(None, carried), None)
                found[part.name] = Stage(part.name, part, pair[0], pair[1], carrier)
                continue
            self.refused[part.name] = f"{part} is not allowed: it must be {reason}"
        if not found:
            reasons = "; ".join(self.refused.values())
            problem = "are missing: it must have a cylindrical_stage with two gears"
            raise InputError("stages", problem=f"{problem}{': ' if reasons else ''}{reasons}")
        return found

    @cached_property
    def rotors(self) -> Rotors:
        """What turns together, and the kinematics."""
        return Rotors(self)

    def loads(self, load_case: str | None = None) -> Loads:
        """Return all torques and speeds in a load case, by default in the first one."""
        case = next(iter(self.load_cases)) if load_case is None else load_case
        checks.one_of("load_case", case, list(self.load_cases))
        if case not in self._loads:
            self._loads[case] = solve(self, None if case == NOMINAL else case)
            for text in self._loads[case].notes:
                self.note(text)
        return self._loads[case]

    def _named(self, name: str) -> Stage:
        return self.stages[checks.one_of("stage", name, list(self.stages))]

    def load(self, stage: str, load_case: str | None = None) -> dict[str, float]:
        """Return the torque (N m) and the speed (rpm) of the pinion of a stage in a load case.

        They have no signs and are arguments of `gearlib.duty_point`. The speed is relative to the
        line of centres; it is left out if the file states none. By default the load case is the
        first one.

        Raises
        ------
        ValueError
            If a torque is missing, or the stage or load case is unknown.
        """
        name, loads = self._named(stage).name, self.loads(load_case)
        if loads.missing is not None:
            raise loads.missing
        load = {"torque": abs(loads.pinion_torques[name])}
        if loads.pinion_speeds is not None:
            load["speed"] = abs(loads.pinion_speeds[name])
        # The digits beyond are rounding errors of the balance.
        return {name: float(f"{value:.12g}") for name, value in load.items()}

    def stage(self, name: str, load_case: str | None = None) -> GearStage:
        """Return the geometry of a stage with the flanks that carry the load in a load case.

        Without a torque these are the left flanks. By default the load case is the first one.

        Raises
        ------
        ValueError
            If the geometry is incomplete or impossible; the message names component and attribute.
        """
        stage, torque = self._named(name), self.loads(load_case).pinion_torques.get(name, 0.0)
        sides = [self._loaded_side(gear, torque) for gear in (stage.pinion, stage.wheel)]
        return gears.geometry(self, stage, sides, self.centre_distance(stage))

    def _loaded_side(self, gear: Component, torque: float) -> str:
        """Return the side of the flank that presses for a torque on the pinion, left or right.

        Seen on the datum face of a gear with upright teeth, as in ISO 21771, left is on the left.
        Both gears of a mesh press with flanks on the same side.
        """
        face = str(gear.value("datum_face_orientation") or "negative").lower()
        towards = 1 if face.startswith("pos") or face == "+" else -1
        turn = torque * self.places.direction(gear) * towards
        return "right" if turn < 0.0 or (turn == 0.0 and towards < 0) else "left"

    def shaft_diameters(self, gear: Component) -> tuple[float, float]:
        """Return inner and outer diameter of the shaft in the middle of a gear, m; 0 without it."""
        shaft = self.shafts[self.shaft_of[gear.id].id]
        middle = sum(self.face(gear)) / 2.0
        for section in shaft.sections:
            if section.start <= middle <= section.end:
                fraction = (middle - section.start) / (section.end - section.start)
                inner, outer = (
                    d[0] + (d[1] - d[0]) * fraction for d in (section.inner, section.outer)
                )
                return inner, outer
        return 0.0, 0.0

    def face(self, gear: Component) -> tuple[float, float]:
        """Return where the face of a gear begins and ends on its shaft, m."""
        width = gear.number("face_width", "m", "for the contact ratios and the stiffness")
        shaft, start = self.shaft_of[gear.id], gear.number("u_coordinate_on_shaft", "m")
        if start is None or self._is_placed(gear, shaft):
            # Where the middle lies, whatever the coordinate means in this version of the format.
            middle = self.coordinate(gear, shaft)
        else:
            middle = start + (width / 2.0 if self.model.version == "1.0" else 0.0)
        return middle - width / 2.0, middle + width / 2.0

    def _is_placed(self, part: Component, shaft: Component) -> bool:
        """Return whether the file has the positions of a component and of its shaft."""
        return self.places.position(part) is not None and self.shafts[shaft.id].start is not None

    def coordinate(self, part: Component, shaft: Component) -> float:
        """Return the coordinate on a shaft at which a component lies by its position, m."""
        others = [x for x in self.model.parts_of(shaft) if x.type in _GEARS and x.id != part.id]
        if not self._is_placed(part, shaft) and part.type in parts.COUPLINGS and others:
            self.default(f"lies at {others[0].name}", part)
            return sum(self.face(others[0])) / 2.0
        if not self._is_placed(part, shaft):
            problem = f"is missing: it must be given for the place on {shaft}"
            raise InputError("u_coordinate_on_shaft", problem=problem, owner=str(part))
        line = self.shafts[shaft.id]
        return line.direction * float((self.places.position(part) - line.start)[0])

    def line_of_centres(self, stage: Stage) -> np.ndarray | None:
        """Return the vector from the axis of the pinion to that of the wheel along v and w, m.

        It is None if the file does not state where both of them lie.
        """
        places = []
        for gear in (stage.pinion, stage.wheel):
            place = self.places.position(gear)
            places.append(
                place if place is not None else self.shafts[self.shaft_of[gear.id].id].start
            )
        if any(place is None for place in places):
            return None
        vector = (places[1] - places[0])[1:]
        return vector if math.hypot(*vector) > _DISTANCE_TOLERANCE else None

    def centre_distance(self, stage: Stage) -> float:
        """Return the centre distance of a stage, m: that stated, else that of the positions."""
        stated, vector = stage.part.number("center_distance", "m"), self.line_of_centres(stage)
        placed = None if vector is None else math.hypot(*vector)
        if stated is None and placed is None:
            problem = "is missing: it must be given, or support_vector of both gears"
            raise InputError("center_distance", problem=problem, owner=str(stage.part))
        if None not in (stated, placed) and abs(placed - stated) > _DISTANCE_TOLERANCE:
            self.note(
                f"center_distance of {stage.part} is {1e3 * stated:.7g} mm, but by support_vector "
                f"{1e3 * placed:.7g} mm; the first is used"
            )
        return float(placed if stated is None else stated)

    def centre_line_angle(self, stage: Stage) -> float:
        """Return the angle from v of the line from the axis of the pinion to that of the wheel.

        It is that of the positions, else the angle that the stage states, in rad.
        """
        vector = self.line_of_centres(stage)
        stated = stage.part.number("rotating_angle_around_neg_u_axis", "rad")
        if stated is not None:
            stated = math.pi / 2.0 - stated  # from w towards v
            first = next(self.model.related("stage", stage=stage.part))["gear_1"]
            stated += 0.0 if first.id == stage.pinion.id else math.pi
        if vector is None:
            if stated is None:
                self.default("the wheel lies along v from the pinion", stage.part)
            return stated or 0.0
        angle = math.atan2(vector[1], vector[0])
        if stated is not None and abs(math.remainder(angle - stated, math.tau)) > _ANGLE_TOLERANCE:
            degrees = math.degrees(math.remainder(stated - angle, math.tau))
            self.note(
                f"rotating_angle_around_neg_u_axis of {stage.part} puts the wheel {degrees:.4g} "
                "degrees from its support_vector, which is used"
            )
        return angle

    def material(self, part: Component) -> tuple:
        """Return the material of a component and its shear modulus, Pa."""
        return parts.material(self.model, part, self.default)

    def planet(self, stage: Stage) -> Component:
        """Return the gear of a planetary stage that a carrier carries."""
        shafts = {x["shaft"].id for x in self.model.related("planet_shaft")}
        pair = stage.pinion, stage.wheel
        return next(gear for gear in pair if self.shaft_of[gear.id].id in shafts)

    def _stages_on(self, carrier: Component) -> list[Stage]:
        return [stage for stage in self.stages.values() if stage.carrier == carrier.id]

    def pin_radius(self, carrier: Component) -> float:
        """Return the radius of the pins of a carrier, m."""
        return self.centre_distance(self._stages_on(carrier)[0])

    def default_carrier(self, carrier: Component) -> tuple[float, float]:
        """Return mass (kg) and inertia (kg m^2) of a carrier that the file does not describe.

        It is a disc with the width and material of a planet and the radius of the pins.
        """
        planet, radius = self.planet(self._stages_on(carrier)[0]), self.pin_radius(carrier)
        width = planet.number("face_width", "m", "for the inertia of the carrier")
        mass = math.pi * radius**2 * width * self.material(planet)[0].density
        self.default("the carrier is a disc with the width and material of a planet", carrier)
        return mass, mass * radius**2 / 2.0

    def end_at_planets(self, part: Component, carrier: Component) -> float:
        """Return the coordinate of the end of a carrier shaft that is next to the planets, m."""
        shaft, planet = self.shafts[part.id], self.planet(self._stages_on(carrier)[0])
        u = self.coordinate(planet, part)
        return min(shaft.ends, key=lambda end: abs(end - u))

    def train(
        self,
        load_case: str | None = None,
        *,
        bearing_stiffness: float | None = None,
        damping_ratio: float = 0.05,
        structural_damping: float = STRUCTURAL_DAMPING,
        model: str = "teeth",
        stiffness: str | None = None,
        options: dict | None = None,
        reference: str | None = None,
    ) -> "GearTrain":
        """Return the whole box as a gear train in a load case, by default the first one.

        Parameters
        ----------
        load_case : str, optional
            Name of a load case.
        bearing_stiffness : float, optional
            Stiffness of all bearings, N/m. By default bearings have their own; axes without a
            bearing stiffness are rigid.
        damping_ratio : float, default 0.05
            Damping ratio of each mesh, of its two gears alone.
        structural_damping : float, default 1e-6
            Damping of shafts, couplings and bearings over their stiffness, s.
        model, stiffness, options
            Model and stiffness of the meshes, see `gearlib.Mesh.from_geometry`.
        reference : str, optional
            Stage whose mesh sets scales and tuning, by default the first.

        Returns
        -------
        GearTrain
            Meshes have the names of the stages, bodies those of gears, loads and carriers.

        Raises
        ------
        ValueError
            If something is missing or impossible; the message names component and attribute.
        """
        from gearlib.gearboxes.train import build  # Loads the compiled code of trains.

        return build(
            self,
            load_case,
            bearing_stiffness=bearing_stiffness,
            structural_damping=structural_damping,
            reference=reference,
            damping_ratio=damping_ratio,
            model=model,
            stiffness=stiffness,
            options=options,
        )

    def outline(self) -> "xr.Dataset":
        """Return the outlines of sections and gears to scale, seen across the box.

        Returns
        -------
        xarray.Dataset
            Over ``part``, ``corner`` and ``coordinate`` (along the shafts, and across them in the
            direction in which the axes lie furthest apart): corner_position in m; over ``part``:
            part_stage, the stage of a gear, "" for shafts. Parts without positions are left out.
        """
        from gearlib.data.result import result_of_many

        placed = {key: x for key, x in self.shafts.items() if x.start is not None}
        axes = np.array([shaft.start[1:] for shaft in placed.values()]).reshape(-1, 2)
        across = np.linalg.svd(axes - axes.mean(axis=0))[2][0] if placed else np.array([0.0, 1.0])
        across = across * (1.0 if across[1] >= 0.0 else -1.0)
        found: list[tuple] = []  # (shaft, ends, inner diameters, outer diameters, stage)
        for shaft in placed.values():
            found += [(shaft, x[:2], x.inner, x.outer, "") for x in shaft.sections]
        drawn: set = set()
        for name, stage in self.stages.items():
            geometry = None if name in self.refused else self.stage(name)
            for gear, side in ((stage.pinion, "pinion"), (stage.wheel, "wheel")):
                shaft = placed.get(self.shaft_of[gear.id].id)
                if geometry and shaft and gear.id not in drawn:
                    drawn.add(gear.id)
                    made = getattr(geometry, side)
                    ends = made.bore, made.tip_diameter
                    inner, outer = ends[::-1] if made.internal else ends
                    outer = made.outer_diameter if made.internal else outer
                    found.append((shaft, self.face(gear), (inner,) * 2, (outer,) * 2, name))
        corners, stages = [], []
        for shaft, ends, inner, outer, name in found:
            u = shaft.start[0] + shaft.direction * np.array(ends)
            height = float(shaft.start[1:] @ across)
            for side in (0.5, -0.5):
                y = height + side * np.array([*outer, *inner[::-1]])
                corners.append(np.stack([[*u, *u[::-1]], y], axis=1))
                stages.append(name)
        data = {
            "corner_position": (("part", "corner", "coordinate"), np.reshape(corners, (-1, 4, 2))),
            "part_stage": ("part", np.array(stages, object)),
        }
        coords = {"coordinate": ["along", "across"]}
        return result_of_many("Outline of a gearbox", data, coords)

    def rows(self, load_case: str | None = None) -> Iterator[list]:
        """Yield the names of the columns, then the values of each stage in a load case.

        A value that is not known is None.
        """
        yield [name for name, _ in _COLUMNS]
        loads = self.loads(load_case)
        for name, stage in self.stages.items():
            geometry = None if name in self.refused else self.stage(name, load_case)
            torque = abs(loads.pinion_torques[name]) if loads.missing is None else None
            speed = None if loads.pinion_speeds is None else abs(loads.pinion_speeds[name])
            yield [
                value(name, stage.signed_teeth, geometry, torque, speed) for _, value in _COLUMNS
            ]

    def __str__(self) -> str:
        """Return the tables of all load cases, and what the file leaves open."""
        lines = [f"gearbox, REXS {self.model.version}, {self.model.application}".rstrip(", ")]
        for case, fraction in self.load_cases.items():
            share = "" if math.isnan(fraction) else f", {100.0 * fraction:.4g} % of the duration"
            lines += ["", f"load case {case}{share}", *_aligned(self.rows(case))]
            lines += ["", *_aligned(self._load_rows(case))]
            if (missing := self.loads(case).missing) is not None:
                lines += _wrapped(str(missing))
        for title, texts in (
            ("not stated in the file", self.defaults),
            ("contradictions in the file", self.notes),
            ("stages that are not computed", self.refused.values()),
        ):
            lines += ["", f"{title}:", *(x for text in texts for x in _wrapped(text))] * bool(texts)
        return "\n".join(lines)

    def _load_rows(self, case: str) -> Iterator[list]:
        """Yield the rows of the table of external loads, whose torques are counterclockwise."""
        yield ["external load", "on", "torque (N m)", "speed (rpm)"]
        loads = self.loads(case)
        for load, part in loads.external:
            speed = None if loads.speeds is None else loads.speeds[part.id]
            yield [
                load.name,
                part.name,
                loads.torques[load.id] if not loads.missing else None,
                speed,
            ]


def _product(first: float | None, second: float) -> float | None:
    return None if first is None else first * second


#: Name and unit of a column of the table of the stages, and its value from the name of a stage, its
#: numbers of teeth, its geometry (None if it is refused), and torque and speed of the pinion.
_COLUMNS: tuple = (
    ("stage", lambda name, z, stage, torque, speed: name),
    ("teeth", lambda name, z, stage, torque, speed: f"{z[0]}/{abs(z[1])}"),
    ("m_n (mm)", lambda name, z, stage, torque, speed: stage and 1e3 * stage.pinion.module),
    ("beta (deg)", lambda name, z, stage, *_: stage and math.degrees(stage.pinion.helix_angle)),
    ("a (mm)", lambda name, z, stage, torque, speed: stage and 1e3 * stage.centre_distance),
    ("b (mm)", lambda name, z, stage, torque, speed: stage and 1e3 * stage.width),
    ("eps_alpha", lambda name, z, stage, torque, speed: stage and round(stage.contact_ratio, 4)),
    ("eps_beta", lambda name, z, stage, torque, speed: stage and round(stage.overlap_ratio, 4)),
    ("ratio", lambda name, z, stage, torque, speed: abs(z[1]) / z[0]),
    ("n_1 (rpm)", lambda name, z, stage, torque, speed: speed),
    ("n_2 (rpm)", lambda name, z, stage, torque, speed: _product(speed, z[0] / abs(z[1]))),
    ("T_1 (N m)", lambda name, z, stage, torque, speed: torque),
    ("T_2 (N m)", lambda name, z, stage, torque, speed: _product(torque, abs(z[1]) / z[0])),
    ("f_mesh (Hz)", lambda name, z, stage, torque, speed: _product(speed, z[0] / 60.0)),
    (
        "F_bt (N)",
        lambda name, z, stage, torque, speed: (
            None if None in (stage, torque) else stage.load(torque)
        ),
    ),
)


def _wrapped(text: str) -> list[str]:
    """Return the lines of a text of a list."""
    return textwrap.wrap(text, _WIDTH, initial_indent="  ", subsequent_indent="    ")


def _aligned(rows: Iterable[list]) -> list[str]:
    """Return rows of cells as lines with aligned columns; numbers have six digits.

    Columns that do not fit on a line follow below, after the first column.
    """
    texts = [
        ["-" if x is None else f"{x + 0.0:.6g}" if isinstance(x, float) else str(x) for x in row]
        for row in rows
    ]
    widths = [max(map(len, column)) + 2 for column in zip(*texts, strict=True)]
    blocks: list[list[int]] = []
    for i, width in enumerate(widths[1:], 1):
        if not blocks or widths[0] + sum(widths[j] for j in blocks[-1]) + width > _WIDTH:
            blocks.append([])
        blocks[-1].append(i)
    return [
        "".join(row[i].ljust(widths[i]) for i in [0, *block]).rstrip()
        for block in blocks
        for row in texts
    ]
