"""The look of all figures, and how they become files: the same bytes for the same data.

Colours are those of Okabe and Ito, which stay apart without red-green vision. Nothing rests on
colour alone: every curve also has its marker and line style, for print in grey.
"""

import re
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import cycle
from pathlib import Path
from typing import Any

import matplotlib.style
import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import BoundaryNorm, ListedColormap
from matplotlib.figure import Figure, FigureBase
from matplotlib.lines import Line2D
from numpy.typing import ArrayLike

from gearlib.data.files import replacing

#: Width of a figure, inches: the type area of a page.
PAGE_WIDTH = 7.2

#: Axis labels that several figures use.
TUNING, OWN_TUNING = "tuning $\\nu_s$", "tuning $\\nu$"
RATE = "$dy/d\\tau$ (static defl./rad)"
SHORT_DISPLACEMENT = "$y$ (static defl.)"

#: Dashes of limits and of unstable orbits, and of a curve beside a solid one.
DASHED, LONG_DASHES = (0, (4, 1.5)), (0, (5, 1.5))

#: Greys of the areas; the normal mesh stays white.
AREA_COLOURS = {"backlash": "#EBEBEB", "inverse mesh": "#CFCFCF"}

#: Colours of curves, and of dampings that have none in a configuration.
PALETTE = ("#0072B2", "#E69F00", "#009E73", "#4D4D4D", "#D55E00", "#CC79A7", "#56B4E9")

# Square, dot, cross and open circle are the paper's, in its order of the damping combinations.
_MARKERS = ("s", "o", "x", "o", "^", "D")
_LINES = ("-", (0, (5, 1.5)), (0, (1.5, 1.2)), (0, (6, 1.5, 1.5, 1.5)))

_RC = {
    "axes.linewidth": 0.6,
    "axes.titlesize": 8,
    "figure.dpi": 200,
    "font.size": 8,
    "legend.fontsize": 7.5,
    "legend.framealpha": 0.9,
    "lines.linewidth": 1.0,
    "pdf.fonttype": 42,
    "svg.hashsalt": "gearlib",
    "xtick.direction": "in",
    "xtick.labelsize": 7,
    "xtick.major.width": 0.6,
    "ytick.direction": "in",
    "ytick.labelsize": 7,
    "ytick.major.width": 0.6,
}

# Metadata that differ between two runs or versions of matplotlib are left out of files.
_METADATA = {
    "png": {"Software": None},
    "pdf": {"CreationDate": None, "Creator": None, "Producer": None},
    "svg": {"Date": None, "Creator": None},
}

#: Height of the line that names the gears, inches.
_GEARS_LINE_HEIGHT = 0.14

#: Digits of a place in shares of the figure: a thousandth of a pixel.
_POSITION_DIGITS = 6

#: Smallest span of an axis, a share of its largest value: a smaller one shows only rounding.
LEAST_SPAN = 0.01

_LENGTH_UNITS = ((1.0, "m"), (1e-3, "mm"), (1e-6, "µm"), (1e-9, "nm"))


@dataclass(frozen=True)
class Look:
    """Colour, line style and marker of one curve."""

    colour: str
    line: str | tuple
    marker: str


@contextmanager
def styled():
    """Apply the library's matplotlib settings inside a `with` block or a decorated function."""
    with matplotlib.style.context(["default", _RC]):
        yield
        interactive = matplotlib.is_interactive()
    # The context also restores interactive mode, which the first figure of a notebook turns on.
    matplotlib.interactive(interactive)


def looks(names, colours: dict | None = None) -> dict[Any, Look]:
    """Return a dict of a `Look` (colour, line style, marker) for each curve name, in this order.

    `colours` maps names to colours; the other curves take the colours of the palette in turn.
    """
    given_colours = colours or {}
    return {
        name: Look(given_colours.get(name, colour), line, marker)
        for name, colour, line, marker in zip(
            names, cycle(PALETTE), cycle(_LINES), cycle(_MARKERS), strict=False
        )
    }


def damping_label(name: str) -> str:
    """Return the label of a damping model, such as "k1+k1m", with indices as math symbols."""
    return re.sub(r"\bk1(m?)\b", lambda match: f"$k_{{1{match[1]}}}$", name).replace("+", " + ")


def length_unit(length: float) -> tuple[float, str]:
    """Return the most readable unit of a length in m: its size in m and its name (m to nm)."""
    return next(((size, name) for size, name in _LENGTH_UNITS if length >= size), _LENGTH_UNITS[-1])


def readable_unit(unit: str, *values: ArrayLike) -> tuple[float, str]:
    """Return (size, name) of the most readable unit: m to nm, or `unit` itself if not m."""
    if unit != "m":
        return 1.0, unit
    return length_unit(max(float(np.nanmax(np.abs(array), initial=0.0)) for array in values))


def draw_rise_and_fall(axes: Axes, x: ArrayLike, y: ArrayLike, falls: np.ndarray, **options):
    """Draw y over x, solid, and dotted where the mask `falls` is true; options of `Axes.plot`."""
    for mask, dashes in ((~falls, "-"), (falls, ":")):
        if mask.any():
            axes.plot(x, np.where(mask, y, np.nan), linestyle=dashes, **options)
            options["label"] = None


def shade_areas(axes: Axes, backlash: float, direction: str) -> dict[str, tuple[float, float]]:
    """Shade backlash and inverse mesh; return the visible (lower, upper) range of each area.

    `direction` is the axis of displacement, "x" or "y", with its limits set before; `backlash` is
    in static deflections and may be infinite.
    """
    lower, upper = sorted(axes.get_ylim() if direction == "y" else axes.get_xlim())
    edges = np.clip([upper, 0.0, -backlash, lower], lower, upper)
    areas = zip(("normal mesh", "backlash", "inverse mesh"), edges[1:], edges, strict=False)
    visible = {name: (start, end) for name, start, end in areas if start < end}
    shade = axes.axhspan if direction == "y" else axes.axvspan
    for name in [name for name in AREA_COLOURS if name in visible]:
        shade(*visible[name], color=AREA_COLOURS[name], linewidth=0, zorder=0)
    return visible


def second_scale(axes: Axes, factor: float, label: str, side="top", position: float | None = None):
    """Add a labelled scale on the "top" or "right" side: the axis values times `factor`.

    `position` is its distance from the opposite side in axes sizes, 1 (on the frame) by default.
    """
    scaled = (lambda value: value * factor), (lambda value: value / factor)
    if side == "top":
        axes.secondary_xaxis(position or side, functions=scaled).set_xlabel(label)
    else:
        axes.secondary_yaxis(position or side, functions=scaled).set_ylabel(label)


def length_scale(axes: Axes, deflection: float, label: str, side="right"):
    """Add a scale in m, mm, µm or nm to an axis in static deflections; `deflection` is one in m."""
    size, unit = length_unit(deflection)
    second_scale(axes, deflection / size, f"{label} ({unit})", side)


def page(height: float, share=1.0) -> Figure:
    """Return an empty figure, `height` inches high and `share` of the page width wide."""
    return Figure((PAGE_WIDTH * share, height), layout="constrained")


def panels(count: int, height: float, most=2) -> tuple[Figure, list[Axes]]:
    """Return a figure and a list of its `count` axes, `height` inches high, `most` in a row."""
    columns = min(count, most)
    rows = -(-count // columns)
    figure = page(height * rows, columns / most)
    return figure, [figure.add_subplot(rows, columns, i + 1) for i in range(count)]


def entry(label: str, colour="black", line="-", marker: str | None = None, **options) -> Line2D:
    """Return a legend handle for a line style; with line="none" for a marker alone."""
    return Line2D([], [], color=colour, linestyle=line, marker=marker, label=label, **options)


def legend(figure: FigureBase, handles: list | Axes, columns: int, side="lower", **options):
    """Add a legend outside all panels, on the "lower" or "upper" side of a figure.

    `handles` are lines and patches with labels, or the axes to take them from; `columns` is the
    number of legend columns.
    """
    if isinstance(handles, Axes):
        handles = handles.get_legend_handles_labels()[0]
    figure.legend(handles=handles, loc=f"outside {side} center", ncols=columns, **options)


def map_of_codes(axes: Axes, x: ArrayLike, y: ArrayLike, codes: np.ndarray, colours: list[str]):
    """Draw integer codes 0, 1, ..., shape (y, x), as a coloured map; `colours` has one per code."""
    options = {"cmap": ListedColormap(colours), "shading": "nearest", "rasterized": True}
    norm = BoundaryNorm(np.arange(-0.5, len(colours)), len(colours))
    axes.pcolormesh(x, y, codes, norm=norm, **options)


def dots(axes: Axes, x: ArrayLike, y: ArrayLike, marker: str, colour: str, size: float, **options):
    """Draw markers without a line; `size` is in points, `options` are those of `Axes.plot`."""
    axes.plot(x, y, linestyle="none", marker=marker, color=colour, markersize=size, **options)


def note(axes, text, at, away=None, side="left center", of="data", white=None, **options):
    """Write a small text at the point `at`, or `away` from it by (x, y) in printer's points.

    `side` is the text's anchor, "horizontal vertical"; `of` are the coordinates of `at` as in
    `Axes.annotate`; `white` is the (padding, opacity) of a white box behind the text.
    """
    ha, va = side.split()
    if white:
        box = {"boxstyle": f"round,pad={white[0]}", "facecolor": "white", "lw": 0}
        options["bbox"] = box | ({"alpha": white[1]} if len(white) > 1 else {})
    if away:
        options |= {"xytext": away, "textcoords": "offset points"}
    axes.annotate(text, at, xycoords=of, ha=ha, va=va, **{"fontsize": 6} | options)


def limits(*values: ArrayLike, margin=0.05) -> tuple[float, float]:
    """Return axis limits (lower, upper) around the finite values of arrays.

    `margin` is the room on either side, a share of the span. The span is at least `LEAST_SPAN` of
    the largest magnitude; the limits are (-1, 1) if there are only zeros or no finite values.
    """
    finite = np.concatenate([np.ravel(array) for array in values])
    finite = finite[np.isfinite(finite)]
    if not finite.any():
        return -1.0, 1.0
    low, high = float(finite.min()), float(finite.max())
    half = max(high - low, LEAST_SPAN * max(abs(low), abs(high))) * (0.5 + margin)
    return (low + high) / 2.0 - half, (low + high) / 2.0 + half


def _widen(axes: Axes):
    """Widen automatic linear axis limits to at least `LEAST_SPAN` of their largest magnitude."""
    for name in "xy":
        low, high = getattr(axes, f"get_{name}lim")()
        automatic = getattr(axes, f"get_autoscale{name}_on")()
        linear = getattr(axes, f"get_{name}scale")() == "linear"
        if automatic and linear and high - low < LEAST_SPAN * max(abs(low), abs(high)):
            getattr(axes, f"set_{name}lim")(*limits((low, high)))


def note_absent(figure: Figure, methods: list[str]):
    """Write above a figure the names of methods left out because their packages are missing."""
    if methods:
        text = f"not installed, left out: {', '.join(methods)} (make peers)"
        # Legends lie below the panels.
        figure.suptitle(text, fontsize=6, x=0.99, ha="right")


def name_gears(figure: Figure, name: str):
    """Write the name of the gears in a line below a figure; the figure becomes higher by it."""
    width, height = figure.get_size_inches()
    figure.set_size_inches(width, height + _GEARS_LINE_HEIGHT)
    bottom = _GEARS_LINE_HEIGHT / (height + _GEARS_LINE_HEIGHT)
    if figure.get_layout_engine() is None:
        figure.set_layout_engine("constrained")
    figure.get_layout_engine().set(rect=(0.0, bottom, 1.0, 1.0 - bottom))  # type: ignore[call-arg]
    options = {"fontsize": 6, "color": "#707070", "ha": "left", "va": "bottom"}
    figure.text(0.01, 0.2 * bottom, name, in_layout=False, **options)


def _freeze(figure: Figure):
    """Lay a figure out once, then fix all positions, rounded, so that its files are reproducible.

    The constraint solver's last digit differs between processes and would change some pixels.
    """
    for axes in figure.axes:
        _widen(axes)
    if figure.get_layout_engine() is None:
        return
    figure.draw_without_rendering()
    # Below the layout's rectangle may lie a line of `name_gears`: legends must stay above it.
    rectangle = figure.get_layout_engine().get()["rect"]
    for legend_box in figure.legends if rectangle[1] else ():
        legend_box.set_bbox_to_anchor(rectangle, transform=figure.transSubfigure)
    # With "none" instead of None, matplotlib would draw every file twice.
    figure.set_layout_engine(None)
    for axes in figure.axes:
        left, bottom, width, height = axes.get_position(original=True).bounds
        axes.set_position([round(x, _POSITION_DIGITS) for x in (left, bottom, width, height)])
    for text in figure.texts:
        text.set_position([round(x, _POSITION_DIGITS) for x in text.get_position()])


def save(figure: Figure, path: str | Path):
    """Write a figure to `path`, a .png, .pdf or .svg file (else ValueError), in one atomic step."""
    path = Path(path)
    file_format = path.suffix.removeprefix(".")
    if file_format not in _METADATA:
        raise ValueError(f"path = {str(path)!r} is not allowed: it must end in .png, .pdf or .svg")
    with replacing(path) as temporary, styled():
        _freeze(figure)
        metadata = _METADATA[file_format]
        figure.savefig(temporary, format=file_format, dpi=figure.dpi, metadata=metadata)
