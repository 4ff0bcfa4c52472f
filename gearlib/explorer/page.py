"""The page of the explorer: sliders, figures, a note, the button; with Panel."""

import io
import time

import panel as pn
import yaml
from bokeh.events import Tap

from gearlib.explorer.figures import Figures, beside
from gearlib.explorer.sliders import Slider, Sliders
from gearlib.explorer.view import look


class Page:
    """The page of a configuration with one of its dampings."""

    def __init__(self, mapping: dict, damping: str):
        self.gears = Sliders(mapping, damping)
        self.figures = Figures(self.gears.drawn)
        self.sliders = {name: _widget(one) for name, one in self.gears.sliders.items()}
        self.note = pn.pane.Markdown("", sizing_mode="stretch_width", css_classes=["note"])
        self.button = pn.widgets.FileDownload(
            callback=self.file, filename="config.yaml", label="Save as config.yaml", embed=False
        )
        self.shown = pn.Column(*self.figures.rows(), sizing_mode="stretch_width")
        for widget in self.sliders.values():
            widget.param.watch(self.update, "value")
        self.figures.resonance.on_event(Tap, self.pick)
        self.update()

    def pick(self, event) -> None:
        """Show the motion where the resonance characteristic is clicked."""
        widget = self.sliders[self.gears.abscissa]
        value = widget.start + round((event.x - widget.start) / widget.step) * widget.step
        widget.value = min(max(float(f"{value:.12g}"), widget.start), widget.end)

    def configuration(self) -> dict:
        """Return the configuration that the sliders make."""
        values = {}
        for name, one in self.gears.sliders.items():
            # Rounded, so that 40 um is written as 4e-05; what was not moved keeps its last digit.
            value = self.sliders[name].value
            moved = value != _shown(one)
            values[name] = float(f"{value * one.unit:.12g}") if moved else one.start
            if isinstance(one.start, int):
                values[name] = int(values[name])
        return self.gears.configuration(values)

    def update(self, *_) -> None:
        """Compute and draw what the sliders say, or say why it cannot be."""
        start = time.perf_counter()
        try:
            words = self.figures.draw(look(self.configuration(), self.gears.damping))
        except ValueError as error:
            self._show(str(error), visible=False)
            return
        elapsed = 1e3 * (time.perf_counter() - start)
        self._show(f"{words} *Computed in {elapsed:.0f} ms.*", visible=True)

    def _show(self, words: str, visible: bool) -> None:
        self.note.object = words
        self.shown.visible = visible
        self.button.disabled = not visible

    def file(self) -> io.BytesIO:
        """Return the config.yaml of what is seen, as a file object."""
        text = yaml.safe_dump(self.configuration(), sort_keys=False, allow_unicode=True)
        return io.BytesIO(f"# Saved by gearlib explore.\n{text}".encode())

    def layout(self):
        """Return the page."""
        controls = pn.Column(*self.sliders.values(), self.button, width=300)
        figures = pn.Column(self.note, self.shown, sizing_mode="stretch_width")
        # In a narrow window the figures come below the sliders.
        figures.styles = {"flex": "1 1 360px", "min-width": "0"}
        heading = pn.pane.Markdown(f"### {self.gears.heading}", css_classes=["gears"])
        return pn.Column(heading, beside(controls, figures), sizing_mode="stretch_width")


def _shown(one: Slider) -> float:
    """Return the value of a slider at the start, in its unit."""
    return float(f"{one.start / one.unit:.12g}")


def _widget(one: Slider):
    """Return the widget of a slider."""
    return pn.widgets.FloatSlider(
        label=one.label,
        value=_shown(one),
        start=one.low,
        end=one.high,
        step=one.step,
        format="0[.][00000]",
    )


def serve(mapping: dict, damping: str, port: int = 0, show: bool = True) -> None:
    """Serve the page of a configuration and one of its dampings until interrupted.

    On this machine; port 0 takes any free one, `show` opens a browser.
    """
    pn.extension()
    # The first view loads the compiled kernels, which is nothing to wait for while dragging.
    Page(mapping, damping)
    # Every visitor has sliders of his own.
    pn.serve(
        lambda: Page(mapping, damping).layout(),
        port=port,
        show=show,
        title="gearlib explorer",
        address="127.0.0.1",
    )
