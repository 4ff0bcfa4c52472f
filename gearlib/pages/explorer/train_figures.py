"""Figures of a gear train, with a curve of each mesh."""

from itertools import product

import panel as pn

from gearlib.figures.style import PALETTE
from gearlib.pages.explorer.curves import Curves, beside, small, wide
from gearlib.pages.explorer.trains import KINDS
from gearlib.pages.explorer.view import SHOWN, TRAIN


class TrainFigures(Curves):
    """The figures of the view of a `Machine`, a curve for each mesh."""

    def __init__(self, machine):
        self.kind, self.meshes, self.speeds = machine.kind, machine.meshes, machine.speeds
        super().__init__(product(("up", "down", "shares", "force"), self.meshes))
        #: Of these the limits follow what is drawn.
        self._sharing, self._courses = self._shares(), self._course()

    def panes(self):
        """Return the figures, one row after the other."""
        return [
            pn.pane.Bokeh(self._characteristic(), sizing_mode="stretch_width"),
            beside(pn.pane.Bokeh(self._sharing), pn.pane.Bokeh(self._courses)),
        ]

    def draw(self, seen):
        """Show a view, and return it in words."""
        run, course = seen.run, seen.run.isel(phase=slice(-SHOWN * TRAIN.samples, None))
        for mesh in self.meshes:
            curves = {
                "up": (self.speeds, seen.up.dynamic_factor),
                "down": (self.speeds, seen.down.dynamic_factor),
                "shares": (self.speeds, seen.up.load_sharing),
                "force": (course.phase.values - course.phase.values[0], course.dynamic_force),
            }
            for what, (x, values) in curves.items():
                self.show((what, mesh), x, values.sel(mesh=mesh).values)
        for what, plot in (("shares", self._sharing), ("force", self._courses)):
            self.limit(plot, [(what, mesh) for mesh in self.meshes])
        self.marker.location = float(run.speed)
        return seen.message

    def _lines(self, plot, what, named=True, **options):
        for i, mesh in enumerate(self.meshes):
            label = {"legend_label": mesh} if named else {}
            self.line(plot, (what, mesh), PALETTE[i % len(PALETTE)], **label, **options)

    def _characteristic(self):
        title = f"Resonance characteristic of the {KINDS[self.kind]}: up solid, down dashed"
        plot = wide(title, "speed, rpm", "largest force over its static value")
        self._lines(plot, "up")
        self._lines(plot, "down", line_dash="dashed")
        plot.legend.click_policy = "hide"
        return self.marked(plot)

    def _shares(self):
        plot = small("Load sharing, sweep up", "speed, rpm", "over the mean of alike meshes", 500)
        self._lines(plot, "shares", named=False)
        return plot

    def _course(self):
        plot = small(
            f"Time course, {SHOWN} mesh periods",
            "phase of the reference mesh, rad",
            "mesh force / load",
            500,
        )
        self._lines(plot, "force", named=False)
        return plot
