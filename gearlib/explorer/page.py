"""The page of the explorer in Panel: sliders, figures, a note and a download button.

The button saves the configuration with the values of the sliders.
"""

import copy
import io
import math
import time
from typing import NamedTuple

import panel as pn
import yaml
from bokeh.events import Tap

from gearlib import config, units
from gearlib.config.gears_section import Gears
from gearlib.explorer.figures import Figures, flex_row
from gearlib.explorer.view import MAX_SPEED_RATIO, MIN_SPEED_RATIO, compute_view
from gearlib.models.from_values import build_model
from gearlib.models.geometry.gear import SpurGear
from gearlib.models.geometry.gear_stage import GearStage
from gearlib.models.pair import GearPair
from gearlib.parameters import Unit, declared_parameters

#: Smallest number of steps of a slider; tolerance for rounding errors of numbers of steps.
_MIN_STEPS, _TOLERANCE = 200, 1e-9
_SYMBOLS = {"um": "µm", "deg": "°"}
_GREEK = {"kappa": "κ", "epsilon": "ε", "beta": "β"}
#: Sliders that change the centre distance.
_GEOMETRY = {f"{gear}_{name}" for gear in ("pinion", "wheel") for name in ("teeth", "shift")}
_GEOMETRY |= {"module", "helix_angle"}


class Slider(NamedTuple):
    """A slider; all values except `initial`, which is in SI units, are in the displayed unit."""

    label: str
    initial: float
    low: float
    high: float
    step: float
    unit: float = 1.0  #: size of the displayed unit in SI


def create_slider(label: str, initial: float, low: float, high: float, unit: float = 1.0) -> Slider:
    """Create a slider with limits rounded outwards and a step of 1, 2 or 5 times a power of ten.

    The `initial` value, the limits `low` and `high`, and the size of the displayed `unit` are in SI
    units. The slider has at least `_MIN_STEPS` steps.
    """
    low, high, shown_initial = low / unit, high / unit, initial / unit
    # The step is the largest allowed one; `_TOLERANCE` absorbs rounding errors of the ratios.
    max_step = (high - low) / _MIN_STEPS
    power = 10.0 ** math.floor(math.log10(max_step) + _TOLERANCE)
    factors = [m for m in (1.0, 2.0, 5.0) if m * power <= max_step * (1.0 + _TOLERANCE)]
    step = power * max(factors)
    low = min(math.floor(low / step + _TOLERANCE) * step, shown_initial)
    high = max(math.ceil(high / step - _TOLERANCE) * step, shown_initial)
    low, high, step = (float(f"{value:.12g}") for value in (low, high, step))
    return Slider(label, initial, low, high, step, unit)


def create_parameter_slider(
    model: type, name: str, initial: float, low: float, high: float
) -> Slider:
    """Create a slider for the declared parameter `name` of a model class.

    The `initial` value and the limits `low` and `high` are in SI units. The label and the displayed
    unit are taken from the annotation of the parameter in the class.
    """
    parameter = declared_parameters(model)[name]
    number, label = parameter.numeric_unit or Unit("1"), parameter.long_name
    unit_name = number.example.partition(" ")[2]
    # Forces are shown in N rather than kN.
    unit_name = number.unit if unit_name.startswith("k") else unit_name
    unit = units.parse_quantity(f"1 {unit_name}", number.unit) if unit_name else 1.0
    for letter, greek in _GREEK.items():
        label = label.replace(letter, greek)
    if unit_name:
        label += f", {_SYMBOLS.get(unit_name, unit_name)}"
    return create_slider(label, initial, low, high, unit)


class Sliders:
    """The sliders of a configuration with one of its dampings.

    For gears given by geometry, they change the geometry and the speed, otherwise the parameters of
    the gear pair and the tuning. `abscissa` is the name of the slider whose quantity is on the
    horizontal axis of the resonance curve.
    """

    def __init__(self, mapping: dict, damping: str):
        """Create the sliders of a configuration; `damping` names one of its damping combinations.

        `mapping` is the content of the configuration file.
        """
        self.mapping, self.damping = mapping, damping
        configuration = config.load(mapping)
        self.by_geometry = configuration.gears is not None
        if self.by_geometry:
            pairs_of_teeth = build_model(configuration.model_description(damping))
            self.pair, self.stiffness_model = pairs_of_teeth.pair, pairs_of_teeth.stiffness_model
        else:
            self.pair = build_model(configuration.pair_description(damping))
        # Rounding restores the ratios from which the damping coefficients have been computed.
        ratios = (self.pair.damping_ratio, self.pair.backlash_damping_ratio)
        self.ratios = [float(f"{ratio:.12g}") for ratio in ratios]
        create_sliders = self._geometry_sliders if self.by_geometry else self._pair_sliders
        self.heading, self.sliders = create_sliders(configuration)
        for name, symbol, ratio in zip(
            ("damping_ratio", "backlash_damping_ratio"), ("β", "β_m"), self.ratios, strict=True
        ):
            self.sliders[name] = create_slider(
                f"damping ratio {symbol}", ratio, 0.0, max(0.3, 2 * ratio)
            )
        self.abscissa = "speed" if self.by_geometry else "tuning"

    def _pair_sliders(self, configuration) -> tuple[str, dict[str, Slider]]:
        """Return the heading of the page and the sliders of a gear pair without geometry, by name.

        `configuration` is the validated configuration. Slider limits depend on the initial values.
        """
        pair, grid = self.pair, configuration.resonance
        tuning = configuration.phase_planes.tunings[0]
        # Infinite backlash is replaced by four static deflections.
        backlash = pair.backlash if math.isfinite(pair.backlash) else 4.0 * pair.static_deflection
        heading = f"Gear pair, z {pair.teeth}, load {pair.load:.6g} N"
        values_and_limits = {
            "stiffness_ratio": (pair.stiffness_ratio, 0.05, 1.0),
            "contact_ratio": (pair.contact_ratio, 1.0, 2.0),
            "backlash": (backlash, 0.0, max(200e-6, 3.0 * backlash)),
            "load": (pair.load, 0.05 * pair.load, 5.0 * pair.load),
        }
        sliders = {"tuning": create_slider("tuning ν", tuning, grid.start, grid.stop)}
        for name, value_and_limits in values_and_limits.items():
            sliders[name] = create_parameter_slider(GearPair, name, *value_and_limits)
        return heading, sliders

    def _geometry_sliders(self, configuration) -> tuple[str, dict[str, Slider]]:
        """Return the heading of the page and the sliders of gears given by geometry, by name.

        `configuration` is the validated configuration; its gear stage is stored as `self.stage`.
        Slider limits depend on the initial values.
        """
        self.stage = stage = configuration.gears.gear_stage()
        torque, pinion, wheel = configuration.gears.driving_torque(), stage.pinion, stage.wheel
        reliefs = [gear.tip_relief.amount for gear in (pinion, wheel) if gear.tip_relief]
        heading = (
            f"Gears, z {pinion.teeth}/{wheel.teeth}, module {1e3 * pinion.module:g} mm, "
            f"width {1e3 * pinion.width:g} mm, {torque:g} N m; {self.stiffness_model}"
        )
        resonance_speed, relief = float(self.pair.speed(1.0)), max(reliefs, default=0.0)
        speed = configuration.gears.speed or float(round(0.9 * resonance_speed))
        sliders = {
            f"{gear}_teeth": Slider(f"teeth of the {gear}", z, max(5, z // 2), 2 * z, 1)
            for gear, z in (("pinion", pinion.teeth), ("wheel", wheel.teeth))
        }
        for name in ("module", "width"):
            size = getattr(pinion, name)
            sliders[name] = create_parameter_slider(SpurGear, name, size, 0.5 * size, 2.0 * size)
        angles = pinion.helix_angle, min(pinion.helix_angle, 0.0), math.radians(35.0)
        sliders["helix_angle"] = create_parameter_slider(SpurGear, "helix_angle", *angles)
        for gear, shift in (("pinion", pinion.shift), ("wheel", wheel.shift)):
            label = f"profile shift of the {gear}"
            sliders[f"{gear}_shift"] = create_slider(label, shift, -1.0, 1.5)
        label = "largest tip relief, µm" if reliefs else "tip relief of both gears, µm"
        sliders["tip_relief"] = create_slider(label, relief, 0.0, max(50e-6, 2.0 * relief), 1e-6)
        max_backlash = max(400e-6, 3.0 * stage.backlash)
        sliders["backlash"] = create_parameter_slider(
            GearStage, "backlash", stage.backlash, 0.0, max_backlash
        )
        sliders["torque"] = create_slider(
            "torque of the pinion, N m", torque, 0.05 * torque, 4.0 * torque
        )
        min_speed = min(MIN_SPEED_RATIO * resonance_speed, speed)
        max_speed = max(MAX_SPEED_RATIO * resonance_speed, speed)
        sliders["speed"] = create_slider("speed of the pinion, rpm", speed, min_speed, max_speed)
        return heading, sliders

    def configuration(self, values: dict[str, float]) -> dict:
        """Return the configuration as a dict with the values of the sliders.

        `values` contains the value of each slider in SI units, by name. Keys whose sliders have not
        been moved remain unchanged. Raise ValueError if the gears are impossible.
        """
        moved = {name for name, slider in self.sliders.items() if values[name] != slider.initial}
        changed = copy.deepcopy(self.mapping)
        if moved - {"tuning", "speed"}:
            ratios = {name: values[name] for name in ("damping_ratio", "backlash_damping_ratio")}
            changed["dampings"][self.damping] = ratios
        if self.by_geometry:
            # The other sections only suit the initial gears.
            changed = {"gears": changed["gears"], "dampings": changed["dampings"]}
            self._apply_to_geometry(changed["gears"], values, moved)
            configuration = config.load(changed)
            pair = build_model(configuration.pair_description(self.damping))
            tuning = float(pair.tuning_at(values["speed"]))
        else:
            for name in moved & {"stiffness_ratio", "contact_ratio", "backlash", "load"}:
                changed["gear_pair"][name] = values[name]
            tuning = values["tuning"]
        changed["phase_planes"] = {**changed.get("phase_planes", {}), "tunings": [tuning]}
        return changed

    def _apply_to_geometry(self, gears: dict, values: dict[str, float], moved: set[str]) -> None:
        """Write the values of the `moved` sliders to the section `gears` of a configuration.

        `values` contains the value of each slider in SI units, by name. Values that are only valid
        for the initial gears are adapted or deleted: the addendum (of a given tip diameter) and the
        length of a tip relief remain constant in modules; pitch errors and a given centre distance
        are deleted.
        """
        for name in moved & {"module", "width", "helix_angle"}:
            gears["pinion"][name] = values[name]
            # If the wheel has no value, that of the pinion is used.
            gears["wheel"].pop(name, None)
        for gear in ("pinion", "wheel"):
            section, initial = gears[gear], getattr(self.stage, gear)
            for name in ("teeth", "shift"):
                if f"{gear}_{name}" in moved:
                    section[name] = values[f"{gear}_{name}"]
            if "tip_diameter" in section and moved & _GEOMETRY:
                height = (initial.tip_diameter - initial.reference_diameter) / 2.0
                addendum = initial.sign * height / initial.module
                addendum += values[f"{gear}_shift"] - initial.shift
                module, angle = values["module"], values["helix_angle"]
                reference_diameter = section["teeth"] * module / math.cos(angle)
                diameter = reference_diameter + 2.0 * initial.sign * module * addendum
                section["tip_diameter"] = float(f"{diameter:.12g}")
            if "module" in moved and section.get("tip_relief"):
                length = initial.tip_relief.length * values["module"] / initial.module
                section["tip_relief"] = section["tip_relief"] | {"length": length}
            # Pitch errors have an entry per tooth.
            if section.get("pitch_errors") and f"{gear}_teeth" in moved:
                del section["pitch_errors"]
        if moved & _GEOMETRY:
            gears.pop("centre_distance", None)
        if "backlash" in moved:
            gears["backlash"] = values["backlash"]
        # A given power is replaced by the torque, which would otherwise change with the speed.
        if "torque" in moved or ("speed" in moved and "power" in gears):
            gears.pop("power", None)
            gears["torque"] = values["torque"]
        if "speed" in moved:
            gears["speed"] = values["speed"]
        if "tip_relief" in moved:
            self._apply_tip_relief(gears, values["tip_relief"])

    def _apply_tip_relief(self, gears: dict, amount: float) -> None:
        """Scale the tip reliefs in the section `gears` so that the largest is `amount`, m.

        If there are none, both gears get tip relief of the maximum length. Tip relief is the
        removal of material at the tips of the teeth.
        """
        initial_amount = self.sliders["tip_relief"].initial
        if not initial_amount:
            length = float(f"{Gears.model_validate(gears).gear_stage().longest_relief:.12g}")
            for gear in ("pinion", "wheel"):
                gears[gear]["tip_relief"] = {"amount": amount, "length": length}
            return
        for gear in ("pinion", "wheel"):
            relief = getattr(self.stage, gear).tip_relief
            if relief:
                gears[gear]["tip_relief"]["amount"] = relief.amount / initial_amount * amount


class Page:
    """The page for a configuration with one of its dampings."""

    def __init__(self, mapping: dict, damping: str):
        """Create the page of a configuration; `damping` names one of its damping combinations.

        `mapping` is the content of the configuration file. `update` is called when a slider is
        moved, `handle_click` when the user clicks on the resonance curve.
        """
        self.slider_set = Sliders(mapping, damping)
        self.figures = Figures(self.slider_set.by_geometry)
        self.widgets = {
            name: _create_widget(slider) for name, slider in self.slider_set.sliders.items()
        }
        self.note = pn.pane.Markdown("", sizing_mode="stretch_width", css_classes=["note"])
        self.button = pn.widgets.FileDownload(
            callback=self.config_file,
            filename="config.yaml",
            label="Save as config.yaml",
            embed=False,
        )
        self.figure_column = pn.Column(*self.figures.rows(), sizing_mode="stretch_width")
        for widget in self.widgets.values():
            widget.param.watch(self.update, "value")
        self.figures.resonance.on_event(Tap, self.handle_click)
        self.update()

    def handle_click(self, event) -> None:
        """Set the slider of the horizontal axis to the position of a click on the resonance curve.

        This slider, `abscissa`, is the speed or the tuning (mesh frequency over natural frequency).
        The position `event.x` of the Bokeh tap event is rounded to a step of the slider.
        """
        widget = self.widgets[self.slider_set.abscissa]
        value = widget.start + round((event.x - widget.start) / widget.step) * widget.step
        widget.value = min(max(float(f"{value:.12g}"), widget.start), widget.end)

    def configuration(self) -> dict:
        """Return the configuration as a dict with the current values of all sliders."""
        values = {}
        for name, slider in self.slider_set.sliders.items():
            # Values of moved sliders are rounded; other sliders keep their exact initial values.
            value = self.widgets[name].value
            is_moved = value != _initial_value(slider)
            values[name] = float(f"{value * slider.unit:.12g}") if is_moved else slider.initial
            if isinstance(slider.initial, int):
                values[name] = int(values[name])
        return self.slider_set.configuration(values)

    def update(self, *_) -> None:
        """Compute and draw the results for the slider values, or show an error message.

        If the values are invalid, the figures are hidden and the download is disabled. The events
        passed by Panel are ignored.
        """
        start, is_valid = time.perf_counter(), True
        try:
            note = self.figures.draw(compute_view(self.configuration(), self.slider_set.damping))
            note += f" *Computed in {1e3 * (time.perf_counter() - start):.0f} ms.*"
        except ValueError as error:
            note, is_valid = str(error), False
        self.note.object = note
        self.button.disabled = not is_valid
        self.figure_column.visible = is_valid

    def config_file(self) -> io.BytesIO:
        """Return the current configuration as a YAML file for the download button."""
        text = yaml.safe_dump(self.configuration(), sort_keys=False, allow_unicode=True)
        return io.BytesIO(f"# Saved by gearlib explore.\n{text}".encode())

    def layout(self):
        """Return the Panel layout of the page: heading, sliders, note and figures."""
        controls = pn.Column(*self.widgets.values(), self.button, styles={"flex": "0 0 300px"})
        figures = pn.Column(self.note, self.figure_column, sizing_mode="stretch_width")
        # In narrow windows, the figures are below the sliders.
        figures.styles = {"flex": "1 1 360px", "min-width": "0"}
        heading = pn.pane.Markdown(f"### {self.slider_set.heading}", css_classes=["gears"])
        return pn.Column(heading, flex_row(controls, figures), sizing_mode="stretch_width")


def _initial_value(slider: Slider) -> float:
    """Return the initial value of a slider in the displayed unit, rounded to 12 digits."""
    return float(f"{slider.initial / slider.unit:.12g}")


def _create_widget(slider: Slider):
    """Create the Panel widget of a slider, in the displayed unit, with up to six decimals."""
    options = {"start": slider.low, "end": slider.high, "step": slider.step}
    options |= {"value": _initial_value(slider), "format": "0[.][00000]"}
    return pn.widgets.FloatSlider(label=slider.label, **options)


def serve(mapping: dict, damping: str, port: int = 0, show: bool = True) -> None:
    """Serve the explorer page on this machine until interrupted.

    `mapping` is the content of a configuration file, and `damping` the name of one of its damping
    combinations. Port 0 means any free port. If `show` is true, a browser is opened.
    """
    pn.extension()
    # Create a page once, so that the kernels are loaded before the first slider is moved.
    Page(mapping, damping)
    options = {"title": "gearlib explorer", "address": "127.0.0.1", "port": port, "show": show}
    # Each browser session gets its own sliders.
    pn.serve(lambda: Page(mapping, damping).layout(), **options)
