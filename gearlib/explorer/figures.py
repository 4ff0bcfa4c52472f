"""Figures of a view of the gears, whose lines are sources by name."""

import math

import numpy as np
import panel as pn
from bokeh.models import ColumnDataSource, Span
from bokeh.plotting import figure

from gearlib.explorer.view import LOADS, SAMPLES, SHOWN, View
from gearlib.figures.style import PALETTE

#: Share of the window's height and minimum height, px, of the resonance curve and other figures.
_LARGE, _SMALL = (0.55, 300), (0.45, 250)
#: Minimum width of a figure, width of its y-axis labels, height of heading and note, px.
_MIN_WIDTH, _ORDINATE, _HEAD = 260, 65, 200
#: Smallest amplitude that is drawn, over the mean force.
_MIN_AMPLITUDE = 1e-6
_SWEEPS = ("up", "up_min", "down", "down_min")


class Figures:
    """The figures of a pair, over its tuning, or of drawn gears, over the speed of the pinion."""

    def __init__(self, drawn: bool):
        self.drawn = drawn
        self.harris = [*(f"{load:g}" for load in LOADS), "chosen"]
        names = [*_SWEEPS, "plane", "course", "force", "roots", "orders", *self.harris, "share"]
        self.sources = {name: ColumnDataSource({"x": [], "y": []}) for name in names}
        self.table = pn.pane.Markdown("", width=290)
        self.resonance, self.marker = self._characteristic()
        self.teeth_panes = [pane(plot) for plot in self._of_teeth()] if drawn else []

    def rows(self) -> list:
        """Return the panes of the figures, one row after the other."""
        first = [beside(self.table, *self.teeth_panes)] if self.drawn else []
        return [*first, beside(pane(self.resonance, _LARGE)), beside(*map(pane, self._motion()))]

    def draw(self, view: View) -> str:
        """Draw the results of a view into all figures, and return its message."""
        rpm, tuning = float(view.pair.speed(1.0)), float(view.run.tuning)
        for name, curve in (("up", view.up), ("down", view.down)):
            x = curve.tuning.values * (rpm if self.drawn else 1.0)
            self._show(name, x, curve.displacement_max.values)
            self._show(f"{name}_min", x, curve.displacement_min.values)
        course = view.run.isel(phase=slice(-SHOWN * SAMPLES, None))
        phase, displacement = course.phase.values, course.displacement.values
        self._show("plane", displacement, course.velocity.values)
        self._show("course", phase - phase[0], displacement)
        self._show("force", phase - phase[0], course.dynamic_force.values)
        self._show("roots", view.multipliers.real, view.multipliers.imag)
        if view.orders is not None:
            self._show("orders", *_stems(view.orders))
        self.marker.location = float(view.run.speed) if self.drawn else tuning
        if self.drawn:
            self._draw_teeth(view)
        return view.message if self.drawn else f"{rpm * tuning:.0f} rpm. {view.message}"

    def _draw_teeth(self, view: View) -> None:
        """Show the derived quantities, the Harris map and the load share of drawn gears."""
        lines = [f"| {name} | {value} |" for name, value in derived(view)]
        self.table.object = "\n".join(["| derived | |", "|---|---:|", *lines])
        for teeth_pane in self.teeth_panes:
            teeth_pane.visible = view.error is not None
        if view.error is None:
            return
        # With pitch errors the curves span several mesh periods; their first point closes them.
        count = len(view.mesh.pitch_errors)
        phase = np.append(view.error.phase.values / math.tau, count)
        for name, curve in zip(self.harris, view.error.transmission_error.values, strict=True):
            self._show(name, phase, 1e6 * np.append(curve, curve[0]))
        period = view.error.isel(torque=-1, phase=slice(0, view.error.phase.size // count))
        position, share = 1e3 * period.path_position.values, period.load_share.values
        inside = np.isfinite(position)
        order = np.argsort(position[inside])
        self._show("share", position[inside][order], share[inside][order])

    def _show(self, name: str, x, y) -> None:
        self.sources[name].data = {"x": x, "y": y}

    def _plot(self, title: str, x: str, y: str, *lines, **options):
        """Return a figure with axis labels `x` and `y`.

        Each line is (source name, colour index, line options). Options are those of `figure`.
        """
        settings = {"sizing_mode": "stretch_both", "min_border_left": _ORDINATE}
        settings |= {"toolbar_location": None, "title": title} | options
        plot = figure(x_axis_label=x, y_axis_label=y, **settings)
        for name, colour, line_options in lines:
            source = self.sources[name]
            plot.line("x", "y", source=source, color=PALETTE[colour], **line_options)
        return plot

    def _characteristic(self):
        """Return the figure of the resonance curve and its marker at the chosen speed or tuning."""
        labels = {name: {"legend_label": f"sweep {name.split('_')[0]}"} for name in _SWEEPS}
        lines = [(name, 0 if "up" in name else 4, label) for name, label in labels.items()]
        x = "speed of the pinion, rpm" if self.drawn else "tuning ν"
        title, y = "Resonance characteristic: extrema", "displacement, static deflections"
        plot = self._plot(title, x, y, *lines, toolbar_location="right")
        plot.legend.click_policy = "hide"
        marker = Span(dimension="height", line_color="#999999", line_dash="dashed")
        plot.add_layout(marker)
        return plot, marker

    def _motion(self) -> list:
        """Return figures of phase plane, time history, Floquet multipliers and order spectrum."""
        plane = self._plot("Phase plane", "displacement", "velocity dx/dτ", ("plane", 0, {}))
        displacement = ("course", 0, {"legend_label": "displacement"})
        force, title = ("force", 4, {"legend_label": "dynamic force / load"}), "Time course"
        course = self._plot(title, "mesh phase τ, rad", "", displacement, force)
        course.add_layout(course.legend[0], "below")
        course.legend.orientation = "horizontal"
        roots = self._plot("Floquet multipliers", "real part", "imaginary part")
        roots.match_aspect = True
        angle = np.linspace(0.0, math.tau, 200)
        roots.line(np.cos(angle), np.sin(angle), color="#999999")
        roots.scatter("x", "y", source=self.sources["roots"], size=10, color=PALETTE[0])
        y, line = "mesh force, N, peak", ("orders", 0, {"line_width": 3})
        spectrum = self._plot("Order spectrum", "mesh order", y, line, y_axis_type="log")
        return [plane, course, roots, spectrum]

    def _of_teeth(self) -> list:
        """Return figures of the Harris map and of the load share of a pair of teeth."""
        lines = [(name, 3, {"legend_label": name}) for name in self.harris[:-1]]
        lines.append(("chosen", 0, {"line_width": 3, "legend_label": "1"}))
        title = "Harris map"
        harris = self._plot(title, "mesh phase / 2π", "transmission error, µm", *lines)
        harris.add_layout(harris.legend[0], "below")
        harris.legend.update(orientation="horizontal", title="torque over the chosen one")
        title, x = "Load share of a pair of teeth", "position on the path of contact, mm"
        return [harris, self._plot(title, x, "", ("share", 0, {}))]


def _stems(spectrum):
    """Return x and y of vertical lines, separated by NaN, for a spectrum's force amplitudes."""
    amplitude = spectrum.force_amplitude.values
    is_shown = amplitude > _MIN_AMPLITUDE * amplitude[0]
    # Order 0 is the mean force, which is no vibration.
    is_shown[0] = False
    feet = np.full(is_shown.sum(), _MIN_AMPLITUDE * amplitude[0])
    gaps = np.full(is_shown.sum(), np.nan)
    ends = np.column_stack([feet, amplitude[is_shown], gaps])
    return np.repeat(spectrum.mesh_order.values[is_shown], 3), ends.ravel()


def derived(view: View) -> list[tuple[str, str]]:
    """Return (name, value with unit) of quantities that follow from the drawing of the gears."""
    mesh, pair = view.mesh, view.pair
    quantities = [
        ("contact ratio", f"{mesh.contact_ratio:.4f}"),
        ("working pressure angle", f"{math.degrees(mesh.working_pressure_angle):.2f}°"),
        ("centre distance", f"{1e3 * mesh.centre_distance:.3f} mm"),
        ("backlash", f"{1e6 * mesh.backlash:.0f} µm"),
        ("least backlash, ISO/TR 10064-2", f"{1e6 * mesh.recommended_backlash:.0f} µm"),
        ("C_max", f"{1e-6 * pair.max_stiffness:.1f} N/µm"),
        ("κ", f"{pair.stiffness_ratio:.4f}"),
        ("ε", f"{pair.contact_ratio:.4f}"),
        ("static deflection", f"{1e6 * pair.static_deflection:.2f} µm"),
        ("mean eigenfrequency", f"{pair.mean_eigenfrequency / math.tau:.0f} Hz"),
        ("resonance speed", f"{pair.speed(1.0):.0f} rpm"),
    ]
    if view.error is not None:
        static = view.error.isel(torque=-1)
        quantities.append(
            ("peak-to-peak error", f"{1e6 * static.peak_to_peak_error.item():.2f} µm")
        )
        quantities.append(
            ("effective contact ratio", f"{static.effective_contact_ratio.item():.4f}")
        )
    return quantities


def pane(plot, size=_SMALL):
    """Return the pane of a figure, whose `size` is (share of window height, minimum px)."""
    share, min_height = size
    styles = {
        "height": f"calc({share} * (100vh - {_HEAD}px))",
        "min-height": f"{min_height}px",
        "flex": f"1 1 {_MIN_WIDTH}px",
        "min-width": "0",
    }
    return pn.Column(pn.pane.Bokeh(plot, sizing_mode="stretch_both", margin=0), styles=styles)


def beside(*panes):
    """Return a row of panes that wraps in narrow windows."""
    return pn.FlexBox(*panes, sizing_mode="stretch_width")
