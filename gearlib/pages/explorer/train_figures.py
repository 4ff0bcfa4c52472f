"""Figures of a gear train, with a curve of each mesh."""

import panel as pn
from bokeh.models import ColumnDataSource, Span
from bokeh.plotting import figure

from gearlib.figures.style import PALETTE
from gearlib.pages.explorer.slider_page import small
from gearlib.pages.explorer.trains import KINDS


class TrainFigures:
    """The figures of the view of a `Machine`, a curve for each mesh."""

    def __init__(self, machine):
        self.kind, self.meshes, self.speeds = machine.kind, machine.meshes, machine.speeds
        self.sources = {
            (what, mesh): ColumnDataSource({"x": [], "y": []})
            for what in ("up", "down", "shares", "force")
            for mesh in self.meshes
        }
        self._marker = Span(dimension="height", line_color="#999999", line_dash="dashed")

    def panes(self):
        """Return the figures, one row after the other."""
        return [
            pn.pane.Bokeh(self._characteristic(), sizing_mode="stretch_width"),
            pn.Row(pn.pane.Bokeh(self._shares()), pn.pane.Bokeh(self._course())),
        ]

    def draw(self, seen):
        """Show a view, and return it in words."""
        run = seen.run
        for mesh in self.meshes:
            curves = {
                "up": (self.speeds, seen.up.dynamic_factor),
                "down": (self.speeds, seen.down.dynamic_factor),
                "shares": (self.speeds, seen.up.load_sharing),
                "force": (run.phase.values - run.phase.values[0], run.dynamic_force),
            }
            for what, (x, values) in curves.items():
                self.sources[what, mesh].data = {"x": x, "y": values.sel(mesh=mesh).values}
        self._marker.location = float(run.speed)
        return seen.message

    def _lines(self, plot, what, named=True, **options):
        for i, mesh in enumerate(self.meshes):
            label = {"legend_label": mesh} if named else {}
            colour = PALETTE[i % len(PALETTE)]
            plot.line("x", "y", source=self.sources[what, mesh], color=colour, **label, **options)

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
