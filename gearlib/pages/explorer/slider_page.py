"""The page of the explorer: sliders, a note, figures, the button; with Panel."""

import io
import math
import time

import panel as pn
from bokeh.events import Tap

from gearlib.pages.explorer.curves import beside
from gearlib.pages.explorer.explored import setting_of

#: What rounding leaves of a whole number of steps.
_EXACT = 1e-9


def readable(one):
    """Return lowest, highest and step of a `Slider` in round numbers, and the format of its values.

    The step is 1, 2 or 5 times a power of ten, as far as that is possible from the lowest value on,
    and values have the digits of a step, but four where they start.
    """
    low, high, step = one.range
    power = 10.0 ** math.floor(math.log10(step) + _EXACT)
    step = power * max(m for m in (1.0, 2.0, 5.0) if m * power <= step * (1.0 + _EXACT))
    start = one.start / one.unit
    low = min(math.ceil(low / step - _EXACT) * step, start)
    high = max(math.ceil(high / step - _EXACT) * step, start)
    least = max(0, -math.floor(math.log10(step) + _EXACT))
    digits = 3 - math.floor(math.log10(abs(start))) if start else 0
    digits = min(max(least, digits), least + 1)
    low, high, step = (float(f"{value:.12g}") for value in (low, high, step))
    return low, high, step, f"0[.][{'0' * digits}]" if digits else "0"


class SliderPage:
    """The sliders of what is explored, as of `Explored`, and figures of what is seen there.

    `figures` has ``panes()``, its rows, ``draw(seen)``, which shows a view and returns it in words,
    and ``resonance``, a figure over the slider that is `Explored.abscissa`.
    """

    def __init__(self, explored, figures):
        self.explored, self.figures = explored, figures
        self.sliders = {
            name: pn.widgets.FloatSlider(
                label=one.label,
                value=self._on_slider(one),
                **dict(zip(("start", "end", "step", "format"), readable(one), strict=True)),
            )
            for name, one in explored.sliders.items()
        }
        self.choices = {
            name: pn.widgets.Select(label=label, options=options)
            for name, (label, options) in explored.choices.items()
        }
        self.note = pn.pane.Markdown("", sizing_mode="stretch_width", css_classes=["note"])
        self.button = pn.widgets.FileDownload(
            callback=self.file, filename="config.yaml", label="Save as config.yaml", embed=False
        )
        self.shown = pn.Column(*figures.panes(), sizing_mode="stretch_width")
        for slider in self.sliders.values():
            slider.param.watch(self.update, "value")
        for choice in self.choices.values():
            choice.param.watch(self.update, "value")
        figures.resonance.on_event(Tap, self.pick)
        self.update()

    def pick(self, event):
        """Show the motion where the resonance characteristic is clicked."""
        slider = self.sliders[self.explored.abscissa]
        value = slider.start + round((event.x - slider.start) / slider.step) * slider.step
        slider.value = min(max(float(f"{value:.12g}"), slider.start), slider.end)

    @staticmethod
    def _on_slider(one):
        return float(f"{one.start / one.unit:.12g}")

    def setting(self):
        """Return what the sliders say, in SI, and the choices."""
        said = {name: choice.value for name, choice in self.choices.items()}
        for name, one in self.explored.sliders.items():
            # Rounded, so that 40 um is written as 4e-05; what was not moved keeps its last digit.
            value = self.sliders[name].value
            moved = value != self._on_slider(one)
            said[name] = float(f"{value * one.unit:.12g}" if moved else one.start)
        return setting_of(said)

    def update(self, *_):
        """Compute and draw what the sliders say, or say why it cannot be."""
        start = time.perf_counter()
        try:
            words = self.figures.draw(self.explored.look(self.setting()))
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
        return io.BytesIO(self.explored.configuration(self.setting()).encode())

    def layout(self):
        """Return the page."""
        controls = pn.Column(*self.sliders.values(), *self.choices.values(), self.button, width=300)
        figures = pn.Column(self.note, self.shown, sizing_mode="stretch_width")
        # In a narrow window the figures come below the sliders.
        figures.styles = {"flex": "1 1 360px", "min-width": "0"}
        heading = pn.pane.Markdown(f"### {self.explored.heading}", css_classes=["gears"])
        return pn.Column(heading, beside(controls, figures), sizing_mode="stretch_width")
