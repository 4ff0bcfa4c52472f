"""Sliders of the gears of a configuration, and the configuration that they make."""

import copy
import math
from typing import NamedTuple

from gearlib import config
from gearlib.config import units
from gearlib.config.gears_section import Gears
from gearlib.explorer.view import HIGHEST, LOWEST
from gearlib.models.geometry.gear import SpurGear
from gearlib.models.geometry.mesh import Mesh
from gearlib.models.pair import GearPair
from gearlib.parameters import declared_parameters, units_and_names

#: Least number of steps of a slider, and the rounding error of a number of steps.
_MIN_STEPS, _ROUNDING = 200, 1e-9
_SYMBOLS = {"um": "µm", "deg": "°"}
_GREEK = {"kappa": "κ", "epsilon": "ε", "beta": "β"}
#: Sliders that change the centre distance.
_SHAPE = {"pinion_teeth", "wheel_teeth", "module", "helix_angle", "pinion_shift", "wheel_shift"}


class Slider(NamedTuple):
    """A slider, in its unit; `start` is the value of the configuration, in SI."""

    label: str
    start: float
    low: float
    high: float
    step: float
    unit: float = 1.0  #: in SI


def slider(label: str, start: float, low: float, high: float, unit: float = 1.0) -> Slider:
    """Return a slider with steps of 1, 2 or 5 times a power of ten and ends rounded outwards.

    Initial value `start` and ends `low` and `high` are in SI; `unit` is the displayed unit in SI.
    """
    low, high, initial = low / unit, high / unit, start / unit
    max_step = (high - low) / _MIN_STEPS
    power = 10.0 ** math.floor(math.log10(max_step) + _ROUNDING)
    step = power * max(m for m in (1.0, 2.0, 5.0) if m * power <= max_step * (1.0 + _ROUNDING))
    low = min(math.floor(low / step + _ROUNDING) * step, initial)
    high = max(math.ceil(high / step - _ROUNDING) * step, initial)
    low, high, step = (float(f"{value:.12g}") for value in (low, high, step))
    return Slider(label, start, low, high, step, unit)


def of_field(thing, name: str, start: float, low: float, high: float) -> Slider:
    """Return the slider of the parameter `name` of the class `thing`, in the unit of its example.

    Initial value and ends are in SI.
    """
    kind, (_, parameter_name) = declared_parameters(thing)[name].kind, units_and_names(thing)[name]
    written = getattr(kind, "example", "").partition(" ")[2]
    # Forces are written in N.
    written = kind.unit if written.startswith("k") else written
    unit = units.read(f"1 {written}", kind.unit) if written else 1.0
    for letter, greek in _GREEK.items():
        parameter_name = parameter_name.replace(letter, greek)
    label = parameter_name
    if written:
        label += f", {_SYMBOLS.get(written, written)}"
    return slider(label, start, low, high, unit)


class Sliders:
    """The sliders of a configuration with one of its dampings.

    Drawn gears have those of their drawing and speed, others those of the pair and its tuning.
    `abscissa` names the slider over which the resonance characteristic goes.
    """

    def __init__(self, mapping: dict, damping: str):
        self.mapping, self.damping = mapping, damping
        settings = config.load(mapping)
        self.drawn = settings.gears is not None
        self.pair = GearPair(**settings.pair_parameters(damping))
        # Made of the coefficients: what was given comes back to 12 digits.
        ratios = (self.pair.damping_ratio, self.pair.backlash_damping_ratio)
        self.ratios = [float(f"{ratio:.12g}") for ratio in ratios]
        self.sliders = self._of_drawing(settings) if self.drawn else self._of_pair(settings)
        for name, symbol, ratio in zip(
            ("damping_ratio", "backlash_damping_ratio"), ("β", "β_m"), self.ratios, strict=True
        ):
            self.sliders[name] = slider(f"damping ratio {symbol}", ratio, 0.0, max(0.3, 2 * ratio))
        self.abscissa = "speed" if self.drawn else "tuning"

    def _of_pair(self, settings) -> dict[str, Slider]:
        """Return name -> slider of a gear pair without drawing: tuning and parameters."""
        pair, grid = self.pair, settings.resonance
        # Infinite backlash is shown as four static deflections.
        gap = pair.backlash if math.isfinite(pair.backlash) else 4.0 * pair.static_deflection
        self.heading = f"Gear pair, z {pair.teeth}, load {pair.load:.4g} N"
        fields = {
            "stiffness_ratio": (pair.stiffness_ratio, 0.05, 1.0),
            "contact_ratio": (pair.contact_ratio, 1.0, 2.0),
            "backlash": (gap, 0.0, max(200e-6, 3.0 * gap)),
            "load": (pair.load, 0.05 * pair.load, 5.0 * pair.load),
        }
        tuning = slider("tuning ν", settings.phase_planes.tunings[0], grid.start, grid.stop)
        sliders = {name: of_field(GearPair, name, *range) for name, range in fields.items()}
        return {"tuning": tuning} | sliders

    def _of_drawing(self, settings) -> dict[str, Slider]:
        """Return name -> slider of drawn gears: geometry, backlash, torque and speed."""
        self.mesh = mesh = settings.gears.mesh()
        torque, (pinion, wheel) = settings.gears.driving_torque(), (mesh.pinion, mesh.wheel)
        reliefs = [gear.tip_relief.amount for gear in (pinion, wheel) if gear.tip_relief]
        self.heading = (
            f"Drawn gears, z {pinion.teeth}/{wheel.teeth}, module {1e3 * pinion.module:g} mm, "
            f"width {1e3 * pinion.width:g} mm, {torque:g} N m. The motion at the speed is that of "
            "pairs of teeth, the characteristic that of the rectangular stiffness."
        )
        resonance, amount = float(self.pair.speed(1.0)), max(reliefs, default=0.0)
        speed = settings.gears.speed or float(round(0.9 * resonance))
        sliders = {
            f"{whose}_teeth": Slider(f"teeth of the {whose}", z, max(5, z // 2), 2 * z, 1)
            for whose, z in (("pinion", pinion.teeth), ("wheel", wheel.teeth))
        }
        for name in ("module", "width"):
            size = getattr(pinion, name)
            sliders[name] = of_field(SpurGear, name, size, 0.5 * size, 2.0 * size)
        steepest = math.radians(35.0)
        sliders["helix_angle"] = of_field(
            SpurGear, "helix_angle", pinion.helix_angle, 0.0, steepest
        )
        for whose, gear in (("pinion", pinion), ("wheel", wheel)):
            label = f"profile shift of the {whose}"
            sliders[f"{whose}_shift"] = slider(label, gear.shift, -1.0, 1.5)
        label = "largest tip relief, µm" if reliefs else "tip relief of both gears, µm"
        sliders["tip_relief"] = slider(label, amount, 0.0, max(50e-6, 2.0 * amount), 1e-6)
        gap, label = max(400e-6, 3.0 * mesh.backlash), "speed of the pinion, rpm"
        sliders["backlash"] = of_field(Mesh, "backlash", mesh.backlash, 0.0, gap)
        sliders["torque"] = slider("torque of the pinion, N m", torque, 0.05 * torque, 4.0 * torque)
        ends = min(LOWEST * resonance, speed), max(HIGHEST * resonance, speed)
        sliders["speed"] = slider(label, speed, *ends)
        return sliders

    def configuration(self, values: dict[str, float]) -> dict:
        """Return the configuration with slider name -> value, in SI.

        Entries of sliders that were not moved stay unchanged. ValueError if no gears can have these
        values.
        """
        moved = {name for name, s in self.sliders.items() if values[name] != s.start}
        changed = copy.deepcopy(self.mapping)
        if moved - {"tuning", "speed"}:
            ratios = {name: values[name] for name in ("damping_ratio", "backlash_damping_ratio")}
            changed["dampings"][self.damping] = ratios
        if self.drawn:
            # The other sections fit the initial gears only.
            changed = {"gears": changed["gears"], "dampings": changed["dampings"]}
            self._draw(changed["gears"], values, moved)
            settings = config.load(changed)
            pair = GearPair(**settings.pair_parameters(self.damping))
            tuning = float(pair.tuning_at(values["speed"]))
        else:
            for name in moved & {"stiffness_ratio", "contact_ratio", "backlash", "load"}:
                changed["gear_pair"][name] = values[name]
            tuning = values["tuning"]
        changed["phase_planes"] = {**changed.get("phase_planes", {}), "tunings": [tuning]}
        return changed

    def _draw(self, gears: dict, values: dict[str, float], moved: set[str]) -> None:
        """Write the values of moved sliders into the `gears` section of the configuration.

        Tip diameters follow module, teeth and shift, so that the addendum in modules stays.
        """
        for name in moved & {"module", "width", "helix_angle"}:
            gears["pinion"][name] = values[name]
            gears["wheel"].pop(name, None)
        for gear in ("pinion", "wheel"):
            drawing, old = gears[gear], getattr(self.mesh, gear)
            for name in ("teeth", "shift"):
                if f"{gear}_{name}" in moved:
                    drawing[name] = values[f"{gear}_{name}"]
            if "tip_diameter" in drawing and moved & _SHAPE:
                height = old.sign * (old.tip_diameter - old.reference_diameter) / 2.0 / old.module
                module, angle = values["module"], values["helix_angle"]
                reference = drawing["teeth"] * module / math.cos(angle)
                height += values[f"{gear}_shift"] - old.shift
                diameter = reference + 2.0 * old.sign * module * height
                drawing["tip_diameter"] = float(f"{diameter:.12g}")
            if "module" in moved and drawing.get("tip_relief"):
                length = old.tip_relief.length * values["module"] / old.module
                drawing["tip_relief"] = drawing["tip_relief"] | {"length": length}
            if drawing.get("pitch_errors") and f"{gear}_teeth" in moved:
                del drawing["pitch_errors"]
        if moved & _SHAPE:
            gears.pop("centre_distance", None)
        if "backlash" in moved:
            gears["backlash"] = values["backlash"]
        # With a given power, another speed would change the torque.
        if "torque" in moved or ("speed" in moved and "power" in gears):
            gears.pop("power", None)
            gears["torque"] = values["torque"]
        if "speed" in moved:
            gears["speed"] = values["speed"]
        if "tip_relief" in moved:
            self._relieve(gears, values["tip_relief"])

    def _relieve(self, gears: dict, amount: float) -> None:
        """Scale tip reliefs to the largest `amount`, m; gears without any get the longest one."""
        largest = self.sliders["tip_relief"].start
        if not largest:
            length = float(f"{Gears.model_validate(gears).mesh().longest_relief:.12g}")
            for gear in ("pinion", "wheel"):
                gears[gear]["tip_relief"] = {"amount": amount, "length": length}
        for gear in ("pinion", "wheel") if largest else ():
            if relief := getattr(self.mesh, gear).tip_relief:
                gears[gear]["tip_relief"]["amount"] = relief.amount / largest * amount
