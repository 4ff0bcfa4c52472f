"""Figures of a gear train, with a curve of each mesh."""

import math
from itertools import product

from gearlib.figures.style import mesh_colours
from gearlib.pages.explorer.curves import LARGE, Curves, beside, empty, empty_orders, pane
from gearlib.pages.explorer.turning_train import TurningTrain
from gearlib.pages.explorer.view import SHOWN, TRAIN


class TrainFigures(Curves):
    """The figures of the view of a `Machine`, a curve for each mesh."""

    def __init__(self, machine):
        self.meshes, self.speeds = machine.meshes, machine.speeds
        super().__init__(product(("up", "down", "shares", "force", "orders"), self.meshes))
        self.train = TurningTrain()
        self.resonance = self._characteristic()
        #: Of these the limits follow what is drawn.
        self._sharing, self._courses = self._shares(), self._course()

    def panes(self):
        """Return the figures, one row after the other."""
        return [
            beside(pane(self.resonance, LARGE), self.train.pane()),
            beside(pane(self._sharing), pane(self._courses), pane(self._orders())),
        ]

    def draw(self, seen):
        """Show a view, and return it in words."""
        run, course = seen.run, seen.run.isel(phase=slice(-SHOWN * TRAIN.samples, None))
        periods = (course.phase.values - course.phase.values[0]) / math.tau
        for mesh in self.meshes:
            curves = {
                "up": (self.speeds, seen.up.dynamic_factor),
                "down": (self.speeds, seen.down.dynamic_factor),
                "shares": (self.speeds, seen.up.load_sharing),
                "force": (periods, course.dynamic_force),
            }
            for what, (x, values) in curves.items():
                self.show((what, mesh), x, values.sel(mesh=mesh).values)
            if seen.orders is not None:
                self.stems(("orders", mesh), seen.orders.sel(mesh=mesh))
        for what, plot in (("shares", self._sharing), ("force", self._courses)):
            self.limit(plot, [(what, mesh) for mesh in self.meshes])
        self.marker.location = float(run.speed)
        self.train.draw(seen.model, course)
        return seen.message

    def _lines(self, plot, what, named=True, **options):
        for mesh, colour in mesh_colours(self.meshes).items():
            label = {"legend_label": mesh} if named else {}
            self.line(plot, (what, mesh), colour, **label, **options)

    def _characteristic(self):
        title = "Resonance characteristic: down dashed"
        plot = empty(title, "speed, rpm", "largest force over its static value", tools=True)
        self._lines(plot, "up")
        self._lines(plot, "down", line_dash="dashed")
        plot.legend.click_policy = "hide"
        return self.marked(plot)

    def _shares(self):
        plot = empty("Load sharing, sweep up", "speed, rpm", "over the mean of alike meshes")
        self._lines(plot, "shares", named=False)
        return plot

    def _course(self):
        plot = empty(
            f"Time course, {SHOWN} mesh periods",
            "mesh periods of the reference mesh",
            "mesh force / load",
        )
        self._lines(plot, "force", named=False)
        plot.add_layout(self.train.marker)
        return plot

    def _orders(self):
        plot = empty_orders()
        self._lines(plot, "orders", named=False)
        return plot
