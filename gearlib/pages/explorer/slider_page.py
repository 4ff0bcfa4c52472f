"""What the pages of the explorer share: sliders, a note, figures, the button; with Panel."""

import io
import time
from abc import ABC, abstractmethod

import panel as pn
from bokeh.plotting import figure


class SliderPage(ABC):
    """Sliders that stand for a setting, and the figures of what is seen there.

    Parameters
    ----------
    labels : dict
        Name -> label of the slider and its unit in SI.
    ranges : dict
        Name -> lowest value, highest and step, in that unit.
    start : dict
        Name -> value in SI.
    choices : dict of Widget, optional
        What else is set.
    event : str, default "value"
        What is followed: "value_throttled" is a slider that is let go.
    """

    def __init__(self, labels, ranges, start, choices=None, event="value"):
        self._units = {name: unit for name, (_, unit) in labels.items()}
        self._start = {name: float(start[name]) for name in ranges}
        self.sliders = {
            name: pn.widgets.FloatSlider(
                label=labels[name][0],
                start=low,
                end=high,
                step=step,
                value=self._on_slider(name),
                format="0[.]0000",
            )
            for name, (low, high, step) in ranges.items()
        }
        self.choices = choices or {}
        self.note = pn.pane.Markdown("", sizing_mode="stretch_width", css_classes=["note"])
        self.button = pn.widgets.FileDownload(
            callback=self.file, filename="config.yaml", label="Save as config.yaml", embed=False
        )
        self.shown = pn.Column(*self.figures(), sizing_mode="stretch_width")
        for slider in self.sliders.values():
            slider.param.watch(self.update, event)
        for choice in self.choices.values():
            choice.param.watch(self.update, "value")
        self.update()

    @abstractmethod
    def setting(self):
        """Return what the sliders say."""

    @abstractmethod
    def figures(self):
        """Return the figures, one row after the other."""

    @abstractmethod
    def draw(self, setting):
        """Draw what is seen at a setting, and return it in words."""

    @abstractmethod
    def configuration(self, setting):
        """Return the text of a config.yaml that computes what is seen."""

    def _on_slider(self, name):
        return float(f"{self._start[name] / self._units[name]:.12g}")

    def values(self):
        """Return what the sliders say, in SI, and the choices."""
        said = {name: choice.value for name, choice in self.choices.items()}
        for name, slider in self.sliders.items():
            # Rounded, so that 40 um is written as 4e-05; what was not moved keeps its last digit.
            moved = slider.value != self._on_slider(name)
            said[name] = (
                float(f"{slider.value * self._units[name]:.12g}") if moved else self._start[name]
            )
        return said

    def update(self, *_):
        """Compute and draw what the sliders say, or say why it cannot be."""
        start = time.perf_counter()
        try:
            words = self.draw(self.setting())
        except ValueError as error:
            self._show(str(error), seen=False)
            return
        elapsed = 1e3 * (time.perf_counter() - start)
        self._show(f"{words} *Computed in {elapsed:.0f} ms.*", seen=True)

    def _show(self, words, seen):
        self.note.object = words
        self.shown.visible = seen
        self.button.disabled = not seen

    def file(self):
        """Return the config.yaml of what is seen, as a file object."""
        return io.BytesIO(self.configuration(self.setting()).encode())

    def layout(self):
        """Return the page."""
        controls = pn.Column(*self.sliders.values(), *self.choices.values(), self.button, width=320)
        figures = pn.Column(self.note, self.shown, sizing_mode="stretch_width")
        return pn.Row(controls, figures, sizing_mode="stretch_width")


def small(title, x, y, width=330):
    """Return an empty figure of which several stand side by side."""
    return figure(
        width=width, height=320, title=title, x_axis_label=x, y_axis_label=y, toolbar_location=None
    )
