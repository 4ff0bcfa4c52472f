"""Figures of the motion of one pair: characteristic, phase plane, time course, multipliers."""

import numpy as np
import panel as pn
from bokeh.models import ColumnDataSource, Span
from bokeh.plotting import figure

from gearlib.figures.style import PALETTE
from gearlib.pages.explorer.slider_page import small
from gearlib.pages.explorer.view import PAIR

#: Mesh periods of the phase plane and of the time course.
_SHOWN = 2


class Motion:
    """Figures that show the view of a pair, over tuning, or over the speed of its pinion."""

    def __init__(self, over_speed=False):
        self.over_speed = over_speed
        self.sources = {
            name: ColumnDataSource({"x": [], "y": []})
            for name in ["up", "up_min", "down", "down_min", "plane", "course", "force", "roots"]
        }
        self._marker = Span(dimension="height", line_color="#999999", line_dash="dashed")

    def draw(self, seen):
        """Show a view, and return it in words."""
        sources, rpm = self.sources, (seen.pair or seen.model).speed(1.0)
        unit, tuning = rpm if self.over_speed else 1.0, float(seen.run.tuning)
        for name, curve in (("up", seen.up), ("down", seen.down)):
            x = curve.tuning.values * unit
            sources[name].data = {"x": x, "y": curve["displacement_max"].values}
            sources[f"{name}_min"].data = {"x": x, "y": curve["displacement_min"].values}
        course = seen.run.isel(phase=slice(-_SHOWN * PAIR.samples, None))
        phase, displacement = course.phase.values, course.displacement.values
        phase = phase - phase[0]
        sources["plane"].data = {"x": displacement, "y": course.velocity.values}
        sources["course"].data = {"x": phase, "y": displacement}
        sources["force"].data = {"x": phase, "y": course.dynamic_force.values}
        sources["roots"].data = {"x": seen.multipliers.real, "y": seen.multipliers.imag}
        self._marker.location = tuning * unit
        roots = ", ".join(f"{abs(m):.4g}" for m in seen.multipliers)
        found = f" Floquet multipliers in magnitude: {roots}." if roots else ""
        speed = "" if self.over_speed else f"{rpm * tuning:.0f} rpm. "
        return f"{speed}{seen.message}{found}"

    def panes(self):
        """Return the figures, one row after the other."""
        beside = self._phase_plane(), self._course(), self._multipliers()
        return [
            pn.pane.Bokeh(self._characteristic(), sizing_mode="stretch_width"),
            pn.Row(*map(pn.pane.Bokeh, beside)),
        ]

    def _line(self, plot, name, colour, **options):
        plot.line("x", "y", source=self.sources[name], color=colour, **options)

    def _characteristic(self):
        plot = figure(
            height=330,
            title="Resonance characteristic: largest and smallest displacement",
            x_axis_label="speed of the pinion, rpm" if self.over_speed else "tuning ν",
            y_axis_label="displacement, static deflections",
            sizing_mode="stretch_width",
        )
        for name, colour, text in (("up", PALETTE[0], "up"), ("down", PALETTE[4], "down")):
            self._line(plot, name, colour, legend_label=f"sweep {text}")
            self._line(plot, f"{name}_min", colour)
        plot.legend.click_policy = "hide"
        plot.add_layout(self._marker)
        return plot

    def _phase_plane(self):
        plot = small("Phase plane", "displacement", "velocity dx/dτ")
        self._line(plot, "plane", PALETTE[0])
        return plot

    def _course(self):
        plot = small("Time course, two mesh periods", "mesh phase τ, rad", "")
        self._line(plot, "course", PALETTE[0], legend_label="displacement")
        self._line(plot, "force", PALETTE[4], legend_label="dynamic force / load")
        plot.add_layout(plot.legend[0], "below")
        plot.legend.orientation = "horizontal"
        return plot

    def _multipliers(self):
        plot = small("Floquet multipliers", "real part", "imaginary part")
        plot.match_aspect = True
        angle = np.linspace(0.0, 2.0 * np.pi, 200)
        plot.line(np.cos(angle), np.sin(angle), color="#999999")
        plot.scatter("x", "y", source=self.sources["roots"], size=10, color=PALETTE[0])
        return plot
