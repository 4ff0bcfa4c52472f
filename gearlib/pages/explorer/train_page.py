"""The explorer's page of a gear train: sliders, figures with a curve of each mesh, the button."""

import numpy as np
import panel as pn
from bokeh.models import ColumnDataSource, Span
from bokeh.plotting import figure

from gearlib.figures.style import PALETTE
from gearlib.pages.explorer.slider_page import SliderPage, small
from gearlib.pages.explorer.trains import KINDS, Machine, Setting

#: Label, and unit of the slider in SI.
_LABELS = {
    "speed": ("speed of the reference pinion, rpm", 1.0),
    "stiffness_jump": ("stiffness jump 1 - κ", 1.0),
    "backlash": ("backlash, µm", 1e-6),
    "load": ("load on each driving mesh, N", 1.0),
    "pin_error": ("pin error of the first, µm", 1e-6),
}


class TrainPage(SliderPage):
    """Sliders that stand for a `trains.Setting`, and the figures of its `trains.View`."""

    def __init__(self, mapping, damping, kind):
        self.kind, self.machine = kind, Machine(mapping, damping, kind)
        self._sources = {
            (what, mesh): ColumnDataSource({"x": [], "y": []})
            for what in ("up", "down", "shares", "force")
            for mesh in self.machine.meshes
        }
        self._marker = Span(dimension="height", line_color="#999999", line_dash="dashed")
        start, speeds = self.machine.start, self.machine.speeds
        ranges = {
            "speed": (float(np.ceil(speeds[0])), float(np.floor(speeds[-1])), 1.0),
            "stiffness_jump": (0.0, 0.9, 0.005),
            "backlash": (0.0, max(200.0, 3e6 * start.backlash), 0.5),
            "load": (0.05 * start.load, 5.0 * start.load, 0.01 * start.load),
        }
        if self.machine.pin_errors:
            ranges["pin_error"] = (-50.0, 50.0, 0.5)
        # A view takes a second: it follows when the slider is let go.
        super().__init__(_LABELS, ranges, vars(start), event="value_throttled")

    def setting(self):
        """Return what the sliders say."""
        return Setting(**self.values())

    def figures(self):
        """Return the figures."""
        return [
            pn.pane.Bokeh(self._characteristic(), sizing_mode="stretch_width"),
            pn.Row(pn.pane.Bokeh(self._shares()), pn.pane.Bokeh(self._course())),
        ]

    def draw(self, setting):
        """Draw what is seen at a setting, and return it in words."""
        seen = self.machine.look(setting)
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
        return seen.message

    def configuration(self, setting):
        """Return the text of a config.yaml that describes what is seen."""
        return self.machine.configuration(setting)

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
        plot = small("Load sharing, sweep up", "speed, rpm", "over the mean of alike meshes", 500)
        self._lines(plot, "shares", named=False)
        return plot

    def _course(self):
        plot = small("Time course", "phase of the reference mesh, rad", "mesh force / load", 500)
        self._lines(plot, "force", named=False)
        return plot
