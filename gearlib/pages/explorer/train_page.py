"""The explorer's page of a gear train: sliders, figures with a curve of each mesh, the button."""

import io
import time

import numpy as np
import panel as pn
from bokeh.models import ColumnDataSource, Span
from bokeh.plotting import figure

from gearlib.figures.style import PALETTE
from gearlib.pages.explorer.trains import KINDS, Machine, Setting

#: Label, and units of the slider in SI.
_LABELS = {
    "speed": ("speed of the reference pinion, rpm", 1.0),
    "stiffness_jump": ("stiffness jump 1 - κ", 1.0),
    "backlash": ("backlash, µm", 1e-6),
    "load": ("load on each driving mesh, N", 1.0),
    "pin_error": ("pin error of the first, µm", 1e-6),
}


class TrainPage:
    """Sliders that stand for a `trains.Setting`, and the figures of its `trains.View`."""

    def __init__(self, mapping, damping, kind):
        self.kind, self.machine = kind, Machine(mapping, damping, kind)
        self.sliders = _sliders(self.machine.start, self.machine.speeds)
        self.note = pn.pane.Markdown("", sizing_mode="stretch_width", css_classes=["note"])
        self._sources = {
            (what, mesh): ColumnDataSource({"x": [], "y": []})
            for what in ("up", "down", "shares", "force")
            for mesh in self.machine.meshes
        }
        self._marker = Span(dimension="height", line_color="#999999", line_dash="dashed")
        for slider in self.sliders.values():
            # A view takes a second: it follows when the slider is let go.
            slider.param.watch(self.update, "value_throttled")
        self.update()

    def setting(self):
        """Return what the sliders say."""
        # Rounded, so that 40 um is written as 4e-05.
        values = {
            name: float(f"{slider.value * _LABELS[name][1]:.12g}")
            for name, slider in self.sliders.items()
        }
        return Setting(**values)

    def update(self, *_):
        """Compute and draw what the sliders say."""
        start = time.perf_counter()
        setting = self.setting()
        try:
            seen = self.machine.look(setting)
        except ValueError as error:
            self.note.object = str(error)
            return
        run = seen.run
        for mesh in self.machine.meshes:
            curves = {
                "up": (seen.speeds, seen.up.dynamic_factor),
                "down": (seen.speeds, seen.down.dynamic_factor),
                "shares": (seen.speeds, seen.up.load_sharing),
                "force": (run.phase.values - run.phase.values[0], run.dynamic_force),
            }
            for what, (x, values) in curves.items():
                self._sources[what, mesh].data = {"x": x, "y": values.sel(mesh=mesh).values}
        self._marker.location = setting.speed
        elapsed = 1e3 * (time.perf_counter() - start)
        self.note.object = f"{seen.message} *Computed in {elapsed:.0f} ms.*"

    def file(self):
        """Return the config.yaml of what is seen, as a file object."""
        return io.BytesIO(self.machine.configuration(self.setting()).encode())

    def layout(self):
        """Return the page."""
        button = pn.widgets.FileDownload(
            callback=self.file, filename="config.yaml", label="Save as config.yaml", embed=False
        )
        controls = pn.Column(*self.sliders.values(), button, width=320)
        figures = pn.Column(
            self.note,
            pn.pane.Bokeh(self._characteristic(), sizing_mode="stretch_width"),
            pn.Row(pn.pane.Bokeh(self._shares()), pn.pane.Bokeh(self._course())),
            sizing_mode="stretch_width",
        )
        return pn.Row(controls, figures, sizing_mode="stretch_width")

    def _lines(self, plot, what, named=True, **options):
        for i, mesh in enumerate(self.machine.meshes):
            label = {"legend_label": mesh} if named else {}
            colour = PALETTE[i % len(PALETTE)]
            plot.line("x", "y", source=self._sources[what, mesh], color=colour, **label, **options)

    def _characteristic(self):
        plot = figure(
            height=330,
            title=f"Resonance characteristic of the {KINDS[self.kind]}: up solid, down dashed",
            x_axis_label="speed, rpm",
            y_axis_label="largest force over its static value",
            sizing_mode="stretch_width",
        )
        self._lines(plot, "up")
        self._lines(plot, "down", line_dash="dashed")
        plot.legend.click_policy = "hide"
        plot.add_layout(self._marker)
        return plot

    def _shares(self):
        plot = _plot("Load sharing, sweep up", "speed, rpm", "over the mean of alike meshes")
        self._lines(plot, "shares", named=False)
        return plot

    def _course(self):
        plot = _plot("Time course", "phase of the reference mesh, rad", "mesh force / load")
        self._lines(plot, "force", named=False)
        return plot


def _plot(title, x, y):
    return figure(
        width=500, height=320, title=title, x_axis_label=x, y_axis_label=y, toolbar_location=None
    )


def _sliders(start, speeds):
    """Return the sliders by the names of `trains.Setting`, at what the setting says."""
    ranges = {
        "speed": (float(np.ceil(speeds[0])), float(np.floor(speeds[-1])), 1.0),
        "stiffness_jump": (0.0, 0.9, 0.005),
        "backlash": (0.0, max(200.0, 3e6 * start.backlash), 0.5),
        "load": (0.05 * start.load, 5.0 * start.load, 0.01 * start.load),
        "pin_error": (-50.0, 50.0, 0.5),
    }
    return {
        name: pn.widgets.FloatSlider(
            label=_LABELS[name][0],
            start=low,
            end=high,
            step=step,
            value=float(f"{getattr(start, name) / _LABELS[name][1]:.12g}"),
            format="0[.]0000",
        )
        for name, (low, high, step) in ranges.items()
    }
