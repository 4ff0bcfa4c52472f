"""A page on which tunings are chosen: zoomable characteristics, phase plane, time course.

Everything is in the one file, Bokeh's scripts too: the page needs no network and no server.
"""

import html
import json

import numpy as np
from bokeh.embed import json_item
from bokeh.layouts import column, row
from bokeh.models import (
    BoxAnnotation,
    ColumnDataSource,
    CustomJS,
    Div,
    Legend,
    LegendItem,
    RadioButtonGroup,
    Slider,
    Span,
)
from bokeh.plotting import figure
from bokeh.resources import Resources

from gearlib.figures import resonance_figure as fig3
from gearlib.figures import style

_EXTREMA = ("displacement_max", "displacement_min")

#: Static deflections beyond which nothing is drawn.
_HIGHEST = 1e6

#: Sweeps as they are told apart: colour (None: that of the damping), dash, width.
_SWEEPS = {
    "cold": (fig3.COLD_COLOUR, "solid", 3.5),
    "up": (None, "solid", 1.5),
    "down": (None, [7, 4], 1.5),
}
_SWEEP_WORDS = {"cold": "from rest", "up": "sweep up", "down": "sweep down"}

_COURSE = ("phase", "displacement", "force")

_INTRODUCTION = """
<p>Largest and smallest relative displacement of the gears over the tuning ν, the mesh frequency
over the mean eigenfrequency, in static deflections. Grey: every tuning from rest; in colour: the
state carried from tuning to tuning, up and down, so that hysteresis shows. Lines are motions that
have settled on a periodic orbit, dots are all others. <b>Choose a tuning</b> by a click or tap on
the characteristic, or with the slider (arrow keys move it); phase plane and time course show the
motion from rest there, its last {periods} mesh periods. Shaded: backlash, flanks apart; darker:
inverse mesh, contact on the far flank. Drag moves the picture, the wheel zooms, the tools beside
it zoom into a box and go back.</p>
"""

_PAGE = """<!doctype html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>{title}</title>
<style>
body {{ font: 15px/1.45 system-ui, sans-serif; color: #222; background: #fff; }}
body {{ margin: 1em auto; max-width: 1200px; padding: 0 1em; }}
h1 {{ font-size: 1.4em; margin: 0.4em 0; }}
p {{ max-width: 80em; margin: 0.4em 0 0.8em; }}
</style>
</head>
<body>
<h1>{title}</h1>
{introduction}
<noscript><p>This page draws with JavaScript, which is switched off.</p></noscript>
<main id="page"></main>
<script>{scripts}</script>
<script type="application/json" id="item">{item}</script>
<script>
Bokeh.embed.embed_item(JSON.parse(document.getElementById("item").textContent), "page").then(
    () => Bokeh.documents[0].get_model_by_name("choose").execute(null)
);
</script>
</body>
</html>
"""

# What follows a choice, in the browser. Typed arrays hold all orbits one after the other.
_CHOOSE = """
const last = tunings.length - 1;
const j = Math.max(0, Math.min(last, Math.round((slider.value - slider.start) / slider.step)));
const i = dampings.active * tunings.length + j;
const orbit = (values, n) => Array.prototype.slice.call(values, i * n, (i + 1) * n);
const n = phase.length;
plane.data = {x: orbit(planes.data.x, n + 1), y: orbit(planes.data.y, n + 1)};
course.data = {
    phase: Array.from(phase),
    displacement: orbit(courses.data.displacement, n),
    force: orbit(courses.data.force, n),
};
const nu = tunings[j];
marks.data = {x: [nu, nu], y: [ends.data.high[i], ends.data.low[i]]};
span.location = nu;
shown.forEach((models, k) => models.forEach(m => { m.visible = k === dampings.active; }));
lines.forEach(glyph => { glyph.line_color = colours[dampings.active]; });
dots.fill_color = colours[dampings.active];
words.text = `<b>${dampings.labels[dampings.active]}, tuning ${nu.toFixed(digits)}, ` +
    `${(nu * rate).toFixed(0)} rpm.</b> ` + motions[ends.data.motion[i]];
"""

_TAP = """
const steps = Math.round((cb_obj.x - slider.start) / slider.step);
const last = Math.round((slider.end - slider.start) / slider.step);
slider.value = slider.start + slider.step * Math.max(0, Math.min(last, steps));
"""


def build(resonance, orbits, colours=None, gears="a gear mesh"):
    """Return the page as a text, HTML with everything in it, the same bytes for the same data.

    `resonance` is gathered: displacement_max and displacement_min in static deflections, period,
    all over (damping, direction, tuning); speed (rpm) over tuning. `orbits` as of
    `gearlib.pages.report.ends_from_rest.compute`, dampings in the order of `resonance`. `colours`
    by the name of the damping.
    """
    title = f"Resonance characteristics of {gears}"
    periods = round(orbits.sizes["phase"] * float(orbits.phase[1]) / (2.0 * np.pi))
    resources = Resources(mode="inline", components=["bokeh", "bokeh-widgets"])
    item = _numbered(json_item(_layout(resonance.sortby("tuning"), orbits, colours)))
    return _PAGE.format(
        title=html.escape(title),
        introduction=_INTRODUCTION.format(periods=periods),
        scripts="\n".join(resources.js_raw).replace("</script", "<\\/script"),
        item=json.dumps(item, separators=(",", ":")).replace("</", "<\\/"),
    )


def _numbered(item):
    """Return the item with its models numbered from 1, in order of appearance.

    Bokeh numbers them on through the life of a process.
    """
    numbers = {}

    def walk(value):
        if isinstance(value, dict):
            return {
                key: number(entry) if key in ("id", "root_id") else walk(entry)
                for key, entry in value.items()
            }
        return [walk(entry) for entry in value] if isinstance(value, (list, tuple)) else value

    def number(name):
        return numbers.setdefault(name, f"m{len(numbers) + 1}")

    return walk(item)


def _layout(resonance, orbits, colours):
    names = [str(name) for name in orbits.damping.values]
    hues = [look.colour for look in style.looks(names, colours).values()]
    backlash = float(orbits.backlash_ratio)
    marks, plane, course = _to_come("x", "y"), _to_come("x", "y"), _to_come(*_COURSE)

    characteristic, shown = _characteristic(resonance.sel(damping=names), hues)
    span = Span(dimension="height", line_color="#444444", line_dash="dotted", line_width=1.5)
    characteristic.add_layout(span)
    dots = characteristic.scatter("x", "y", source=marks, size=10, line_color="white").glyph
    phase_plane = _small("Phase plane", "displacement y", "velocity dy/dτ")
    _shade(phase_plane, backlash, "left", "right")
    displacement = _small("Displacement", "mesh phase τ, rad", "displacement y")
    _shade(displacement, backlash, "bottom", "top")
    force = _small("Dynamic force", "mesh phase τ, rad", "dynamic force / load")
    lines = [
        _only_line(phase_plane, "x", "y", plane),
        _only_line(displacement, "phase", "displacement", course),
        _only_line(force, "phase", "force", course),
    ]

    tunings = [float(nu) for nu in orbits.tuning.values]
    rate = float(resonance.speed[-1] / resonance.tuning[-1])
    step = round(min(np.diff(tunings), default=1.0), 9)
    digits = max(2, len(f"{step:.9f}".rstrip("0").partition(".")[2]))
    dampings = RadioButtonGroup(labels=names, active=0, name="damping")
    words = Div(text="", sizing_mode="stretch_width", styles={"font-size": "15px"})
    slider = Slider(
        name="tuning",
        title="tuning ν",
        start=tunings[0],
        end=max(tunings[-1], tunings[0] + step),
        step=step,
        value=tunings[len(tunings) // 3],
        format="0." + "0" * digits,
        sizing_mode="stretch_width",
    )
    choose = CustomJS(
        name="choose",
        code=_CHOOSE,
        args={
            **_stored(orbits),
            **{"dampings": dampings, "slider": slider, "words": words, "span": span},
            **{"marks": marks, "plane": plane, "course": course, "shown": shown},
            **{"tunings": tunings, "digits": digits, "rate": rate},
            **{"lines": lines, "dots": dots, "colours": hues},
        },
    )
    slider.js_on_change("value", choose)
    dampings.js_on_change("active", choose)
    characteristic.js_on_event("tap", CustomJS(code=_TAP, args={"slider": slider}))
    return column(
        row(dampings, slider, sizing_mode="stretch_width", spacing=30),
        characteristic,
        words,
        row(
            phase_plane,
            displacement,
            force,
            sizing_mode="stretch_width",
            styles={"flex-wrap": "wrap"},
        ),
        sizing_mode="stretch_width",
    )


def _to_come(*names):
    """Return a source that is filled when the page opens; ranges want two points before."""
    return ColumnDataSource({name: [0.0, 1.0] for name in names})


def _stored(orbits):
    """Return what `_CHOOSE` cuts from: all orbits one after the other, damping by damping."""

    def flat(values):
        return _single(values).ravel()

    closed = {
        axis: _closed(orbits[name].values, orbits.final_state.values[..., k])
        for k, (axis, name) in enumerate({"x": "displacement", "y": "velocity"}.items())
    }
    motions = sorted({str(text) for text in orbits.motion.values.flat})
    ends = {
        "high": flat(orbits.displacement_max),
        "low": flat(orbits.displacement_min),
        "motion": [motions.index(str(text)) for text in orbits.motion.values.flat],
    }
    courses = {"displacement": flat(orbits.displacement), "force": flat(orbits.dynamic_force)}
    return {
        "phase": _single(orbits.phase),
        "planes": ColumnDataSource({axis: flat(values) for axis, values in closed.items()}),
        "courses": ColumnDataSource(courses),
        "ends": ColumnDataSource(ends),
        "motions": motions,
    }


def _closed(courses, ends):
    """Return courses with the end of the run, which closes the orbit in the phase plane."""
    return np.concatenate([courses, ends[..., np.newaxis]], axis=-1)


def _characteristic(resonance, hues):
    """Return the plot, and for each damping what is visible when it is chosen."""
    plot = figure(
        height=360,
        x_axis_label="tuning ν",
        y_axis_label="displacement y, static deflections",
        sizing_mode="stretch_width",
        tools="pan,wheel_zoom,box_zoom,reset,save,tap",
        active_drag="pan",
        active_scroll="wheel_zoom",
    )
    plot.toolbar.logo = None
    directions = [name for name in _SWEEPS if name in resonance.direction.values]
    limits = fig3.displacement_limits(resonance.sel(direction=directions[0]))
    plot.y_range.start, plot.y_range.end = limits
    plot.x_range.range_padding = 0.01
    _shade(plot, float(resonance.backlash_ratio), "bottom", "top")
    tuning = resonance.tuning.values
    shown, legend = [], []
    for number, hue in enumerate(hues):
        models = []
        for direction in directions:
            curve = resonance.isel(damping=number).sel(direction=direction)
            drawn = _draw_sweep(plot, tuning, curve, hue, direction)
            legend.append(LegendItem(label=_SWEEP_WORDS[direction], renderers=drawn[:1]))
            models += [*drawn, legend[-1]]
        for model in models:
            model.visible = number == 0
        shown.append(models)
    plot.add_layout(Legend(items=legend, location="top_right"))
    return plot, shown


def _draw_sweep(plot, tuning, curve, hue, direction):
    """Draw one sweep of one damping, as lines where orbits repeat and dots where not."""
    colour, dash, width = _SWEEPS[direction]
    drawn = []
    for name in _EXTREMA:
        values = curve[name].values
        # Sweeps of an undamped mesh can run away beyond single precision.
        values = np.where(np.abs(values) < _HIGHEST, values, np.nan)
        linked = fig3.where_linked(np.isfinite(values) & (curve.period.values > 0))
        line = {"x": _single(tuning), "y": _single(np.where(linked, values, np.nan))}
        drawn.append(
            plot.line(
                "x",
                "y",
                source=ColumnDataSource(line),
                line_color=colour or hue,
                line_dash=dash,
                line_width=width,
            )
        )
        dots = {"x": _single(tuning[~linked]), "y": _single(values[~linked])}
        drawn.append(
            plot.scatter(
                "x",
                "y",
                source=ColumnDataSource(dots),
                size=3.5,
                line_color=colour or hue,
                # Hollow, so that what lies below shows.
                fill_color=None if direction == "down" else colour or hue,
            )
        )
    return drawn


def _small(title, x, y):
    plot = figure(
        title=title,
        x_axis_label=x,
        y_axis_label=y,
        height=280,
        min_width=300,
        sizing_mode="stretch_width",
        tools="pan,wheel_zoom,box_zoom,reset,save",
        styles={"flex": "1 1 300px"},
    )
    plot.toolbar.logo = None
    plot.toolbar.autohide = True
    return plot


def _only_line(plot, x, y, source):
    """Draw a line to which alone the ranges of the plot are fitted; return its glyph."""
    line = plot.line(x, y, source=source, line_width=1.5)
    plot.x_range.renderers = plot.y_range.renderers = [line]
    return line.glyph


def _shade(plot, backlash, low, high):
    """Shade backlash and inverse mesh of a plot whose displacement runs from `low` to `high`."""
    areas = {"backlash": (-backlash, 0.0), "inverse mesh": (None, -backlash)}
    for name, (start, stop) in areas.items():
        if np.isfinite(backlash) or start is not None:
            shade = BoxAnnotation(
                fill_color=style.AREA_COLOURS[name], fill_alpha=1.0, line_color=None, level="image"
            )
            setattr(shade, high, stop)
            if start is not None and np.isfinite(start):
                setattr(shade, low, start)
            plot.add_layout(shade)


def _single(values):
    return np.ascontiguousarray(values, np.float32)
