"""Figures of the motion of one pair: characteristic, phase plane, course, multipliers, orders."""

import numpy as np

from gearlib.figures.style import PALETTE
from gearlib.pages.explorer.curves import LARGE, Curves, beside, empty, empty_orders, pane
from gearlib.pages.explorer.view import PAIR, SHOWN


class Motion(Curves):
    """Figures that show the view of a pair, over tuning, or over the speed of its pinion."""

    def __init__(self, over_speed=False):
        self.over_speed = over_speed
        sweeps = "up", "up_min", "down", "down_min"
        super().__init__((*sweeps, "plane", "course", "force", "roots", "orders"))
        self.resonance = self._characteristic()

    def draw(self, seen):
        """Show a view, and return it in words."""
        rpm = (seen.pair or seen.model).speed(1.0)
        unit, tuning = rpm if self.over_speed else 1.0, float(seen.run.tuning)
        for name, curve in (("up", seen.up), ("down", seen.down)):
            x = curve.tuning.values * unit
            self.show(name, x, curve["displacement_max"].values)
            self.show(f"{name}_min", x, curve["displacement_min"].values)
        course = seen.run.isel(phase=slice(-SHOWN * PAIR.samples, None))
        phase, displacement = course.phase.values, course.displacement.values
        phase = phase - phase[0]
        self.show("plane", displacement, course.velocity.values)
        self.show("course", phase, displacement)
        self.show("force", phase, course.dynamic_force.values)
        self.show("roots", seen.multipliers.real, seen.multipliers.imag)
        if seen.orders is not None:
            self.stems("orders", seen.orders)
        self.marker.location = float(seen.run.speed) if self.over_speed else tuning
        roots = ", ".join(f"{abs(m):.4g}" for m in seen.multipliers)
        found = f" Floquet multipliers in magnitude: {roots}." if roots else ""
        speed = "" if self.over_speed else f"{rpm * tuning:.0f} rpm. "
        return f"{speed}{seen.message}{found}"

    def panes(self):
        """Return the figures, one row after the other."""
        small_ones = self._phase_plane(), self._course(), self._multipliers(), self._orders()
        return [
            beside(pane(self.resonance, LARGE)),
            beside(*map(pane, small_ones)),
        ]

    def _characteristic(self):
        title = "Resonance characteristic: extrema"
        x = "speed of the pinion, rpm" if self.over_speed else "tuning ν"
        plot = empty(title, x, "displacement, static deflections", tools=True)
        for name, colour in (("up", PALETTE[0]), ("down", PALETTE[4])):
            for end in (name, f"{name}_min"):
                self.line(plot, end, colour, legend_label=f"sweep {name}")
        plot.legend.click_policy = "hide"
        return self.marked(plot)

    def _phase_plane(self):
        plot = empty("Phase plane", "displacement", "velocity dx/dτ")
        self.line(plot, "plane", PALETTE[0])
        return plot

    def _course(self):
        plot = empty(f"Time course, {SHOWN} mesh periods", "mesh phase τ, rad", "")
        self.line(plot, "course", PALETTE[0], legend_label="displacement")
        self.line(plot, "force", PALETTE[4], legend_label="dynamic force / load")
        plot.add_layout(plot.legend[0], "below")
        plot.legend.orientation = "horizontal"
        return plot

    def _multipliers(self):
        plot = empty("Floquet multipliers", "real part", "imaginary part")
        plot.match_aspect = True
        angle = np.linspace(0.0, 2.0 * np.pi, 200)
        plot.line(np.cos(angle), np.sin(angle), color="#999999")
        plot.scatter("x", "y", source=self.sources["roots"], size=10, color=PALETTE[0])
        return plot

    def _orders(self):
        plot = empty_orders()
        self.line(plot, "orders", PALETTE[0], line_width=3)
        return plot
