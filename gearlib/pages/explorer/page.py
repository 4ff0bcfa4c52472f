"""The explorer's page of one pair: sliders, figures, the button; with Panel and Bokeh."""

import io
import time

import numpy as np
import panel as pn
from bokeh.models import ColumnDataSource, Span
from bokeh.plotting import figure

from gearlib import config
from gearlib.figures.style import PALETTE
from gearlib.models.pair import GearPair
from gearlib.pages.explorer import view

#: Tunings of the characteristic.
POINTS = 500

_LABELS = {
    "tuning": "tuning ν",
    "damping": "damping ratio β",
    "backlash_damping": "damping ratio in the backlash β_m",
    "stiffness_ratio": "stiffness ratio κ",
    "contact_ratio": "contact ratio ε",
    "backlash": "backlash, µm",
    "load": "load, N",
}


class Page:
    """Sliders that stand for a `view.Setting`, and the figures of its `view.View`."""

    def __init__(self, mapping, damping):
        self.mapping, self.damping = mapping, damping
        settings = config.load(mapping)
        self.base = GearPair(**settings.pair_parameters(damping))
        grid = settings.resonance
        self.grid = np.linspace(grid.start, grid.stop, POINTS)
        tuning = settings.phase_planes.tunings[0]
        self.sliders = _sliders(view.Setting.of(self.base, tuning), self.base, self.grid)
        self.note = pn.pane.Markdown("", sizing_mode="stretch_width", css_classes=["note"])
        self._sources = {
            name: ColumnDataSource({"x": [], "y": []})
            for name in ["up", "up_min", "down", "down_min", "plane", "course", "force", "roots"]
        }
        self._marker = Span(dimension="height", line_color="#999999", line_dash="dashed")
        for slider in self.sliders.values():
            slider.param.watch(self.update, "value")
        self.update()

    def setting(self):
        """Return what the sliders say."""
        values = {name: slider.value for name, slider in self.sliders.items()}
        # Rounded, so that 40 um is written as 4e-05.
        return view.Setting(**values | {"backlash": float(f"{values['backlash'] * 1e-6:.12g}")})

    def update(self, *_):
        """Compute and draw what the sliders say."""
        start = time.perf_counter()
        setting = self.setting()
        pair = setting.pair(self.base)
        seen = view.look(pair, setting.tuning, self.grid)
        sources = self._sources
        for name, curve in (("up", seen.up), ("down", seen.down)):
            sources[name].data = {"x": curve["tuning"], "y": curve["displacement_max"]}
            sources[f"{name}_min"].data = {"x": curve["tuning"], "y": curve["displacement_min"]}
        course = seen.course
        sources["plane"].data = {"x": course["displacement"], "y": course["velocity"]}
        sources["course"].data = {"x": course["phase"], "y": course["displacement"]}
        sources["force"].data = {"x": course["phase"], "y": course["force"]}
        sources["roots"].data = {"x": seen.multipliers.real, "y": seen.multipliers.imag}
        self._marker.location = setting.tuning
        elapsed = 1e3 * (time.perf_counter() - start)
        roots = ", ".join(f"{abs(m):.4g}" for m in seen.multipliers)
        found = f" Floquet multipliers in magnitude: {roots}." if roots else ""
        speed = f"{pair.speed(setting.tuning):.0f} rpm."
        self.note.object = f"{speed} {seen.message}{found} *Computed in {elapsed:.0f} ms.*"

    def file(self):
        """Return the config.yaml of what is seen, as a file object."""
        text = view.configuration(self.mapping, self.damping, self.setting())
        return io.BytesIO(text.encode())

    def layout(self):
        """Return the page."""
        button = pn.widgets.FileDownload(
            callback=self.file, filename="config.yaml", label="Save as config.yaml", embed=False
        )
        controls = pn.Column(*self.sliders.values(), button, width=320)
        figures = pn.Column(
            self.note,
            pn.pane.Bokeh(self._characteristic(), sizing_mode="stretch_width"),
            pn.Row(
                pn.pane.Bokeh(self._phase_plane()),
                pn.pane.Bokeh(self._course()),
                pn.pane.Bokeh(self._multipliers()),
            ),
            sizing_mode="stretch_width",
        )
        return pn.Row(controls, figures, sizing_mode="stretch_width")

    def _line(self, plot, name, colour, **options):
        plot.line("x", "y", source=self._sources[name], color=colour, **options)

    def _characteristic(self):
        plot = figure(
            height=330,
            title="Resonance characteristic: largest and smallest displacement",
            x_axis_label="tuning ν",
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
        plot = _small("Phase plane", "displacement", "velocity dx/dτ")
        self._line(plot, "plane", PALETTE[0])
        return plot

    def _course(self):
        plot = _small("Time course, two mesh periods", "mesh phase τ, rad", "")
        self._line(plot, "course", PALETTE[0], legend_label="displacement")
        self._line(plot, "force", PALETTE[4], legend_label="dynamic force / load")
        plot.add_layout(plot.legend[0], "below")
        plot.legend.orientation = "horizontal"
        return plot

    def _multipliers(self):
        plot = _small("Floquet multipliers", "real part", "imaginary part")
        plot.match_aspect = True
        angle = np.linspace(0.0, 2.0 * np.pi, 200)
        plot.line(np.cos(angle), np.sin(angle), color="#999999")
        plot.scatter("x", "y", source=self._sources["roots"], size=10, color=PALETTE[0])
        return plot


def _small(title, x, y):
    return figure(
        width=330, height=320, title=title, x_axis_label=x, y_axis_label=y, toolbar_location=None
    )


def _sliders(setting, pair, grid):
    """Return the sliders by the names of `view.Setting`, at what the setting says."""
    backlash = view.finite_backlash(pair) * 1e6
    ranges = {
        "tuning": (float(grid[0]), float(grid[-1]), 0.0005),
        "damping": (0.0, max(0.3, 2.0 * setting.damping), 0.0005),
        "backlash_damping": (0.0, max(0.3, 2.0 * setting.backlash_damping), 0.0005),
        "stiffness_ratio": (0.05, 1.0, 0.0005),
        "contact_ratio": (1.0, 2.0, 0.001),
        "backlash": (0.0, max(200.0, 3.0 * backlash), 0.5),
        "load": (0.05 * pair.load, 5.0 * pair.load, 0.01 * pair.load),
    }
    start = {**vars(setting), "backlash": backlash}
    return {
        name: pn.widgets.FloatSlider(
            label=_LABELS[name],
            start=low,
            end=high,
            step=step,
            value=float(start[name]),
            format="0[.]0000",
        )
        for name, (low, high, step) in ranges.items()
    }
