"""The page of the explorer in Panel: sliders, figures, a note and a download button."""

import io
import time

import panel as pn
import yaml
from bokeh.events import Tap

from gearlib.explorer.figures import Figures, beside
from gearlib.explorer.sliders import Slider, Sliders
from gearlib.explorer.view import compute_view


class Page:
    """The page of a configuration with one of its dampings."""

    def __init__(self, mapping: dict, damping: str):
        """Create the page of a configuration; `damping` is the name of one of its dampings."""
        self.slider_set = Sliders(mapping, damping)
        self.figures = Figures(self.slider_set.by_geometry)
        self.widgets = {name: _widget(slider) for name, slider in self.slider_set.sliders.items()}
        self.note = pn.pane.Markdown("", sizing_mode="stretch_width", css_classes=["note"])
        self.button = pn.widgets.FileDownload(
            callback=self.file, filename="config.yaml", label="Save as config.yaml", embed=False
        )
        self.figure_column = pn.Column(*self.figures.rows(), sizing_mode="stretch_width")
        for widget in self.widgets.values():
            widget.param.watch(self.update, "value")
        self.figures.resonance.on_event(Tap, self.pick)
        self.update()

    def pick(self, event) -> None:
        """Set the speed or tuning slider to the position of a click into the resonance curve."""
        widget = self.widgets[self.slider_set.abscissa]
        value = widget.start + round((event.x - widget.start) / widget.step) * widget.step
        widget.value = min(max(float(f"{value:.12g}"), widget.start), widget.end)

    def configuration(self) -> dict:
        """Return the configuration with the current values of all sliders."""
        values = {}
        for name, slider in self.slider_set.sliders.items():
            # Moved values are rounded to 12 digits; sliders not moved keep the exact value.
            value = self.widgets[name].value
            is_moved = value != _initial_value(slider)
            values[name] = float(f"{value * slider.unit:.12g}") if is_moved else slider.initial
            if isinstance(slider.initial, int):
                values[name] = int(values[name])
        return self.slider_set.configuration(values)

    def update(self, *_) -> None:
        """Compute and draw the results for the slider values, or show why they are invalid."""
        start, visible = time.perf_counter(), True
        try:
            note = self.figures.draw(compute_view(self.configuration(), self.slider_set.damping))
            note += f" *Computed in {1e3 * (time.perf_counter() - start):.0f} ms.*"
        except ValueError as error:
            note, visible = str(error), False
        self.note.object, self.button.disabled = note, not visible
        self.figure_column.visible = visible

    def file(self) -> io.BytesIO:
        """Return the current configuration as a YAML file, for the download button."""
        text = yaml.safe_dump(self.configuration(), sort_keys=False, allow_unicode=True)
        return io.BytesIO(f"# Saved by gearlib explore.\n{text}".encode())

    def layout(self):
        """Return the Panel layout of the page: heading, sliders, note and figures."""
        controls = pn.Column(*self.widgets.values(), self.button, styles={"flex": "0 0 300px"})
        figures = pn.Column(self.note, self.figure_column, sizing_mode="stretch_width")
        # In a narrow window the figures come below the sliders.
        figures.styles = {"flex": "1 1 360px", "min-width": "0"}
        heading = pn.pane.Markdown(f"### {self.slider_set.heading}", css_classes=["gears"])
        return pn.Column(heading, beside(controls, figures), sizing_mode="stretch_width")


def _initial_value(slider: Slider) -> float:
    """Return the initial value of a slider in its displayed unit, rounded to 12 digits."""
    return float(f"{slider.initial / slider.unit:.12g}")


def _widget(slider: Slider):
    """Return the Panel widget of a slider."""
    settings = {"start": slider.low, "end": slider.high, "step": slider.step}
    settings |= {"value": _initial_value(slider), "format": "0[.][00000]"}
    return pn.widgets.FloatSlider(label=slider.label, **settings)


def serve(mapping: dict, damping: str, port: int = 0, show: bool = True) -> None:
    """Serve the explorer page on this machine until interrupted.

    `mapping` is a configuration and `damping` the name of one of its dampings. Port 0 means any
    free port; `show` opens a browser.
    """
    pn.extension()
    # Computing one view loads the compiled kernels before the first slider is moved.
    Page(mapping, damping)
    settings = {"title": "gearlib explorer", "address": "127.0.0.1", "port": port, "show": show}
    # Each browser session gets its own sliders.
    pn.serve(lambda: Page(mapping, damping).layout(), **settings)
