"""Symmetry breaking of a planetary train: multipliers, and the motions that follow."""

import math

import numpy as np
from matplotlib.patches import Patch

from gearlib.figures import schematic, style
from gearlib.figures.starts import draw_shares, entries

#: Verdict -> words and shade.
_SHADES = {
    0: ("planets alike: no orbit of one period", "#D9D9D9"),
    2: ("symmetry breaks", "#FBE3D3"),
    3: ("planets alike: unstable in itself", "#C6DDEE"),
}
_MARKERS = ("o", "x", "^", "s", "D", "v")


@style.styled()
def draw(data, periods_shown):
    """Draw multipliers, bounces and largest forces over the mesh frequency, and one course.

    `data` is that of `gearlib.studies.trains.symmetry.compute`, the course has so many mesh
    periods. Markers are medians over all starts beside the symmetric motion, bars their range.
    """
    figure = style.page(8.6)
    upper, lower = figure.subfigures(2, 1, height_ratios=[3.3, 1.3])
    axes = upper.subplots(4, 1, height_ratios=[1.0, 1.0, 1.0, 0.3])
    unit = float(data.reference_frequency) / 1e3
    frequency = data.tuning.values * unit
    for panel in axes:
        _shade(panel, frequency, data.verdict.values)
        panel.set_xlim(frequency[0], frequency[-1])
        panel.axvline(float(data.shown) * unit, color="black", linewidth=0.6, linestyle=(0, (1, 2)))
    for key, colour, line in (
        ("symmetric_multiplier", style.PALETTE[0], (0, (4, 2))),
        ("other_multiplier", style.PALETTE[4], "-"),
    ):
        axes[0].plot(frequency, data[key].values, color=colour, linestyle=line)
    axes[0].axhline(1.0, color="black", linewidth=0.5)
    axes[0].set_ylabel("largest |multiplier|")
    draw_shares(axes[3], frequency, data)
    axes[3].set_ylabel("share of\nthe starts")
    axes[3].set_xlabel("mesh frequency, kHz")
    suns = [str(name) for name in data.mesh.values if str(name).startswith("sun")]
    for panel, key, words in (
        (axes[1], "bounces", "bounces per mesh period"),
        (axes[2], "dynamic_force_max", "largest force over load"),
    ):
        alike = data[f"symmetric_{key}"].sel(mesh=suns[0]).values
        panel.plot(frequency, alike, color=style.PALETTE[0], linestyle=(0, (4, 2)))
        for i, name in enumerate(suns):
            ends = (data[f"{key}_{end}"].sel(mesh=name).values for end in ("low", "high"))
            panel.vlines(frequency, *ends, color=_colour(i), linewidth=1.5, alpha=0.4)
            marker, colour = _mark(i)
            style.dots(panel, frequency, data[key].sel(mesh=name).values, marker, colour, 2.6)
        panel.set_ylabel(f"{words},\nmeshes of the sun")
        panel.set_ylim(bottom=0.0 if key != "bounces" else -0.05)
    _draw_course(lower, data, suns, periods_shown)
    lines = [
        style.entry("planets alike", style.PALETTE[0], (0, (4, 2))),
        style.entry("all other disturbances", style.PALETTE[4]),
        *(
            style.entry(f"mesh {name}", _colour(i), "none", _mark(i)[0], markersize=3.5)
            for i, name in enumerate(suns)
        ),
        *entries("on one orbit", "0.4", linewidth=1.5),
    ]
    present = [_SHADES[code] for code in _SHADES if code in data.verdict.values]
    shades = [Patch(color=colour, label=words) for words, colour in present]
    style.legend(figure, [*lines, *shades], 3, "upper")
    return figure


def _colour(i):
    return (style.PALETTE[3], style.PALETTE[2], style.PALETTE[1])[i % 3]


def _mark(i):
    return _MARKERS[i % len(_MARKERS)], _colour(i)


def _shade(axes, frequency, verdict):
    """Shade where the verdict is none of stability, half a step to either side."""
    half = 0.5 * (frequency[1] - frequency[0])
    for i, code in enumerate(verdict):
        if int(code) in _SHADES:
            colour = _SHADES[int(code)][1]
            axes.axvspan(frequency[i] - half, frequency[i] + half, color=colour, linewidth=0)


def _draw_course(figure, data, suns, periods):
    """Draw the forces of the last periods at the tuning that is shown, and the train beside."""
    phase = data.phase.values / (2.0 * math.pi)
    last = phase >= phase[-1] - periods
    at, now = phase[last][0], {}
    if "contact" in data and np.isfinite(data.dynamic_force.values).all():
        # When most meshes are out of contact.
        apart = (data.contact.values[last] == schematic.BACKLASH).sum(axis=-1)
        at = phase[last][apart.argmax()]
        now = {"contact": data.contact.values[last][apart.argmax()]}
    colours = {name: _colour(i) for i, name in enumerate(suns)}
    axes = schematic.with_train(figure, data, colours, phase=2.0 * math.pi * at, **now).subplots()
    if now:
        axes.axvline(at - phase[last][0], color="black", linewidth=0.6, linestyle=(0, (1, 2)))
    for i, name in enumerate(suns):
        force = data.dynamic_force.sel(mesh=name).values
        axes.plot(phase[last] - phase[last][0], force[last], color=_colour(i), linewidth=1.0)
    unit = float(data.reference_frequency) / 1e3
    axes.set_xlabel(f"mesh periods, at {float(data.shown) * unit:g} kHz")
    axes.set_ylabel("mesh force over load")
    axes.set_xlim(0.0, periods)
    if not np.isfinite(data.dynamic_force.values).all():
        axes.text(0.5, 0.5, "no symmetric orbit, or chaos", ha="center", transform=axes.transAxes)
