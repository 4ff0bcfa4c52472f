"""The page of the explorer: sliders, a note, figures, the button; with Panel."""

import io
import time

import panel as pn

from gearlib.pages.explorer.curves import beside
from gearlib.pages.explorer.explored import setting_of


class SliderPage:
    """The sliders of what is explored, as of `Explored`, and figures of what is seen there.

    `figures` has ``panes()``, its rows, and ``draw(seen)``, which shows a view and returns it in
    words.
    """

    def __init__(self, explored, figures):
        self.explored, self.figures = explored, figures
        self.sliders = {
            name: pn.widgets.FloatSlider(
                label=one.label,
                start=one.range[0],
                end=one.range[1],
                step=one.range[2],
                value=self._on_slider(one),
                format="0[.]0000",
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
            slider.param.watch(self.update, explored.event)
        for choice in self.choices.values():
            choice.param.watch(self.update, "value")
        self.update()

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
