"""Figures of the explorer. Each curve has a named Bokeh data source."""

import math
from collections import defaultdict

import numpy as np
import panel as pn
from bokeh.models import ColumnDataSource, Span
from bokeh.plotting import figure

from gearlib.analysis.duty_point import iso_dynamic_factor
from gearlib.explorer.view import SAMPLES, SHOWN_PERIODS, TORQUE_RATIOS, View
from gearlib.figures.style import PALETTE

#: Heights (fraction of the window height, minimum in px) of the resonance curve and of others.
_LARGE_HEIGHT, _SMALL_HEIGHT = (0.55, 300), (0.45, 250)
#: Minimum width of a figure, width of its y axis labels, height of heading and note, px.
_MIN_WIDTH, _LABEL_WIDTH, _HEADING_HEIGHT = 260, 65, 200
#: Smallest amplitude to draw, relative to the mean force.
_MIN_AMPLITUDE = 1e-6
#: Curves of the resonance figure: extrema of both sweeps.
_SWEEPS = ("up", "up_min", "down", "down_min")
#: Indices of `PALETTE`.
_FIRST_COLOUR, _SECOND_COLOUR, _GREY = 0, 4, 3
_SPEED_LABEL = "speed of the pinion, rpm"


class Figures:
    """The figures of the explorer, over the tuning or, with gear geometry, over the speed."""

    def __init__(self, by_geometry: bool):
        """Create empty figures; for gears given by geometry, add figures of the teeth and a table.

        Each curve has a name, which is a key of `sources`; when the points of this data source are
        set, the curve is redrawn.
        """
        self.by_geometry = by_geometry
        # Names of the curves of the Harris map: relative torques; the chosen torque is the last.
        self.harris_names = [*(f"{ratio:g}" for ratio in TORQUE_RATIOS), "chosen"]
        self.sources = defaultdict(lambda: ColumnDataSource({"x": [], "y": []}))
        self.table = pn.pane.Markdown("", width=290)
        self.resonance, self.marker = self._resonance_figure()
        self.teeth_panes = (
            [figure_pane(plot) for plot in self._teeth_figures()] if by_geometry else []
        )

    def rows(self) -> list:
        """Return the rows of the page as Panel objects: teeth, resonance curve, motion."""
        rows = [flex_row(self.table, *self.teeth_panes)] if self.by_geometry else []
        motion_panes = map(figure_pane, self._motion_figures())
        return [
            *rows,
            flex_row(figure_pane(self.resonance, _LARGE_HEIGHT)),
            flex_row(*motion_panes),
        ]

    def draw(self, view: View) -> str:
        """Draw the results of a view in all figures, and return its message.

        A `View` contains the results for one position of the sliders. For gears given by geometry,
        curves are over the speed, otherwise over the tuning (mesh frequency over natural
        frequency).
        """
        tuning = float(view.run.tuning)
        if self.by_geometry:
            self._draw_curves(view.curves)
        else:
            for name, curve in (("up", view.sweep_up), ("down", view.sweep_down)):
                self._set_points(name, curve.tuning.values, curve.displacement_max.values)
                self._set_points(f"{name}_min", curve.tuning.values, curve.displacement_min.values)
        history = view.run.isel(phase=slice(-SHOWN_PERIODS * SAMPLES, None))
        phase, displacement = history.phase.values, history.displacement.values
        self._set_points("plane", displacement, history.velocity.values)
        self._set_points("history", phase - phase[0], displacement)
        self._set_points("force", phase - phase[0], history.dynamic_force.values)
        # Floquet multipliers are complex numbers, drawn as points of the complex plane.
        self._set_points("multipliers", view.multipliers.real, view.multipliers.imag)
        if view.orders is not None:
            self._set_points("orders", *_stem_lines(view.orders))
        if self.by_geometry:
            self.marker.location = float(view.run.speed)
            self._draw_teeth(view)
            return view.message
        self.marker.location = tuning
        return f"{float(view.run.speed):.6g} rpm. {view.message}"

    def _draw_curves(self, curves) -> None:
        """Draw dynamic factor and transmission error over the speed, and lines at the jumps.

        `curves` is a result of `gearlib.studies.teeth_over_speed.sweep_speeds`, for rising ("up")
        and falling ("down") speed.
        """
        speed = curves.speed.values
        for name in ("up", "down"):
            curve = curves.sel(direction=name)
            self._set_points(name, speed, curve.dynamic_factor.values)
            self._set_points(f"{name}_error", speed, 1e6 * curve.error_peak_to_peak.values)
        iso = curves.get("iso_dynamic_factor")
        factors = np.full(speed.size, np.nan) if iso is None else iso.values
        self._set_points("iso", speed, factors)
        # If the speeds of both jumps are equal, the directions differ only at this speed.
        jump_up, jump_down = curves.jump_up_speed.values, curves.jump_down_speed.values
        is_wide = jump_up > jump_down
        jumps = np.concatenate([jump_up[is_wide], jump_down[is_wide]])
        max_factor = float(np.nanmax(curves.dynamic_factor))
        # Vertical lines are separated by NaN; the last NaN avoids an empty curve without jumps.
        x = np.column_stack([jumps, jumps, np.full(jumps.size, np.nan)]).ravel()
        y = np.tile([0.0, max_factor, np.nan], jumps.size)
        self._set_points("jumps", np.append(x, np.nan), np.append(y, np.nan))

    def _draw_teeth(self, view: View) -> None:
        """Show the results for gears given by geometry: table, Harris map and load share.

        A Harris map shows the transmission error at several torques. The load share is the fraction
        of the load that one tooth pair carries.
        """
        rows = [f"| {name} | {value} |" for name, value in derived_quantities(view)]
        self.table.object = "\n".join(["| derived | |", "|---|---:|", *rows])
        error = view.harris_map
        # With pitch errors, curves span several mesh periods. The first point is repeated at the
        # end.
        period_count = len(view.stage.pitch_errors)
        phase = np.append(error.phase.values / math.tau, period_count)
        for name, curve in zip(self.harris_names, error.transmission_error.values, strict=True):
            self._set_points(name, phase, 1e6 * np.append(curve, curve[0]))
        self._set_points("share", *_load_share_along_path(error, error.phase.size // period_count))

    def _set_points(self, name: str, x, y) -> None:
        """Set the points of the curve `name`."""
        self.sources[name].data = {"x": x, "y": y}

    def _create_plot(self, title: str, x: str, y: str, *lines, **options):
        """Create a Bokeh figure with the axis labels `x` and `y` and a curve for each of `lines`.

        A line is a tuple (name of its data source, colour index in `PALETTE`, options of
        `figure.line`). `options` are passed to `bokeh.plotting.figure`.
        """
        figure_options = {"sizing_mode": "stretch_both", "min_border_left": _LABEL_WIDTH}
        figure_options |= {"toolbar_location": None, "title": title} | options
        plot = figure(x_axis_label=x, y_axis_label=y, **figure_options)
        for name, colour_index, line_options in lines:
            source = self.sources[name]
            plot.line("x", "y", source=source, color=PALETTE[colour_index], **line_options)
        return plot

    def _resonance_figure(self):
        """Create the figure of the resonance curve; return it and the line that marks the abscissa.

        The curve is the dynamic factor over the speed for gears given by geometry, otherwise the
        displacement extrema over the tuning (mesh frequency over natural frequency).
        """
        if self.by_geometry:
            title, y = "Tooth pairs: dynamic factor", "dynamic factor"
            x = _SPEED_LABEL
            lines = [
                ("up", _FIRST_COLOUR, {"legend_label": "running up"}),
                ("down", _SECOND_COLOUR, {"legend_label": "running down"}),
                ("iso", _GREY, {"legend_label": "ISO 6336-1, method B"}),
                ("jumps", _GREY, {"legend_label": "jumps", "line_dash": "dotted"}),
            ]
        else:
            title, y = "Resonance characteristic: extrema", "displacement, static deflections"
            x = "tuning ν"
            labels = [{"legend_label": f"sweep {name.split('_')[0]}"} for name in _SWEEPS]
            colours = (_FIRST_COLOUR, _FIRST_COLOUR, _SECOND_COLOUR, _SECOND_COLOUR)
            lines = list(zip(_SWEEPS, colours, labels, strict=True))
        plot = self._create_plot(title, x, y, *lines, toolbar_location="right")
        plot.legend.click_policy = "hide"
        marker = Span(dimension="height", line_color="#999999", line_dash="dashed")
        plot.add_layout(marker)
        return plot, marker

    def _motion_figures(self) -> list:
        """Create the figures of the motion at the chosen speed.

        They show the phase plane, the time history, the Floquet multipliers (growth of
        perturbations per period) with the unit circle, and the order spectrum of the mesh force.
        """
        orbit = ("plane", _FIRST_COLOUR, {})
        plane = self._create_plot("Phase plane", "displacement", "velocity dx/dτ", orbit)
        displacement = ("history", _FIRST_COLOUR, {"legend_label": "displacement"})
        force = ("force", _SECOND_COLOUR, {"legend_label": "dynamic force / load"})
        history = self._create_plot("Time history", "mesh phase τ, rad", "", displacement, force)
        history.add_layout(history.legend[0], "below")
        history.legend.orientation = "horizontal"
        multipliers = self._create_plot("Floquet multipliers", "real part", "imaginary part")
        multipliers.match_aspect = True
        angle = np.linspace(0.0, math.tau, 200)
        multipliers.line(np.cos(angle), np.sin(angle), color="#999999")
        source = self.sources["multipliers"]
        multipliers.scatter("x", "y", source=source, size=10, color=PALETTE[_FIRST_COLOUR])
        y, stems = "mesh force, N, peak", ("orders", _FIRST_COLOUR, {"line_width": 3})
        spectrum = self._create_plot("Order spectrum", "mesh order", y, stems, y_axis_type="log")
        return [plane, history, multipliers, spectrum]

    def _teeth_figures(self) -> list:
        """Create the figures of Harris map, load share, and transmission error over the speed.

        A Harris map shows the transmission error over the mesh phase at several torques. The load
        share is that of one tooth pair along its path of contact.
        """
        lines = [(name, _GREY, {"legend_label": name}) for name in self.harris_names[:-1]]
        lines.append(("chosen", _FIRST_COLOUR, {"line_width": 3, "legend_label": "1"}))  # ratio
        x, y = "mesh phase / 2π", "transmission error, µm"
        harris_map = self._create_plot("Harris map", x, y, *lines)
        harris_map.add_layout(harris_map.legend[0], "below")
        harris_map.legend.update(orientation="horizontal", title="torque / chosen torque")
        title, x = "Load share of a tooth pair", "position on the path of contact, mm"
        share = self._create_plot(title, x, "", ("share", _FIRST_COLOUR, {}))
        lines = [("up_error", _FIRST_COLOUR, {}), ("down_error", _SECOND_COLOUR, {})]
        title = "Transmission error, peak to peak"
        return [harris_map, share, self._create_plot(title, _SPEED_LABEL, "µm", *lines)]


def _load_share_along_path(error, phases: int):
    """Return the position on the path of contact, mm, and the load share of a tooth pair.

    Both are arrays over the phases at which the pair is in contact. `error` is a result of
    `GearStage.transmission_error`, of which the last torque is used; `phases` is the number of
    phases per mesh period.
    """
    static = error.isel(torque=-1)
    position, load_share = static.path_position.values, static.load_share.values
    # The pair enters the path of contact at this phase.
    start = int(np.argmin(position[:phases, 0]))
    steps = np.arange(phases * position.shape[1])
    # After each mesh period, the index of the pair increases by one.
    entries = (start + steps) % len(position), steps // phases
    on_path = np.isfinite(position[entries])
    return 1e3 * position[entries][on_path], load_share[entries][on_path]


def _stem_lines(spectrum):
    """Return x and y of vertical lines, separated by NaN, for the amplitudes of an order spectrum.

    `spectrum` is a result of `gearlib.orders`. The mean force (order 0) and amplitudes far below it
    are omitted.
    """
    amplitude = spectrum.force_amplitude.values
    is_shown = amplitude > _MIN_AMPLITUDE * amplitude[0]
    is_shown[0] = False
    # On a logarithmic axis, lines cannot start at zero.
    lower_ends = np.full(is_shown.sum(), _MIN_AMPLITUDE * amplitude[0])
    gaps = np.full(is_shown.sum(), np.nan)
    y = np.column_stack([lower_ends, amplitude[is_shown], gaps]).ravel()
    return np.repeat(spectrum.mesh_order.values[is_shown], 3), y


def derived_quantities(view: View) -> list[tuple[str, str]]:
    """Return pairs (name, value with unit) of quantities computed from the gear geometry.

    Dynamic factors and transmission error are those at the chosen speed and torque.
    """
    stage, pair = view.stage, view.pair
    quantities = [
        ("contact ratio", f"{stage.contact_ratio:.4f}"),
        ("working pressure angle", f"{math.degrees(stage.working_pressure_angle):.2f}°"),
        ("centre distance", f"{1e3 * stage.centre_distance:.3f} mm"),
        ("K_v by simulation, without gear quality", f"{float(view.run.dynamic_factor):.4f}"),
        ("stiffness", str(view.run.attrs["stiffness_model"])),
        ("backlash", f"{1e6 * stage.backlash:.4g} µm"),
        ("recommended backlash, ISO/TR 10064-2", f"{1e6 * stage.recommended_backlash:.4g} µm"),
        ("C_max", f"{1e-6 * pair.max_stiffness:.4g} N/µm"),
        ("κ", f"{pair.stiffness_ratio:.4f}"),
        ("ε", f"{pair.contact_ratio:.4f}"),
        ("static deflection", f"{1e6 * pair.static_deflection:.4g} µm"),
        ("mean eigenfrequency", f"{pair.mean_eigenfrequency / math.tau:.6g} Hz"),
        ("resonance speed", f"{pair.speed(1.0):.6g} rpm"),
    ]
    factor = iso_dynamic_factor(stage, float(view.curves.torque), float(view.run.speed))
    if factor is not None:
        quantities.append(("K_v by ISO 6336-1, with gear quality", f"{factor:.4f}"))
    static = view.harris_map.isel(torque=-1)  # at the chosen torque
    error, ratio = static.peak_to_peak_error.item(), static.effective_contact_ratio.item()
    quantities.append(("peak-to-peak error", f"{1e6 * error:.2f} µm"))
    quantities.append(("effective contact ratio", f"{ratio:.4f}"))
    return quantities


def figure_pane(plot, height=_SMALL_HEIGHT):
    """Return a Panel object with a Bokeh figure that fills a given part of the window.

    `height` is a pair: fraction of the window height, and minimum height in pixels.
    """
    fraction, min_height = height
    styles = {
        "height": f"calc({fraction} * (100vh - {_HEADING_HEIGHT}px))",
        "min-height": f"{min_height}px",
        "flex": f"1 1 {_MIN_WIDTH}px",
        "min-width": "0",
    }
    return pn.Column(pn.pane.Bokeh(plot, sizing_mode="stretch_both", margin=0), styles=styles)


def flex_row(*panes):
    """Return a row of panes that wraps in narrow windows."""
    return pn.FlexBox(*panes, sizing_mode="stretch_width")
