"""The look of all figures, and how they become files: the same bytes for the same data.

Colours are those of Okabe and Ito, which stay apart without red-green vision. Nothing rests on
colour alone: every curve also has its marker and line style, for print in grey.
"""

import re
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import cycle
from pathlib import Path

import matplotlib.style
import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import BoundaryNorm, ListedColormap
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from gearlib.data.files import replacing

#: Width of a figure, inches: the type area of a page.
PAGE_WIDTH = 7.2

#: What stands at axes of several figures.
TUNING, OWN_TUNING = "tuning $\\nu_s$", "tuning $\\nu$"
RATE = "$dy/d\\tau$ (static defl./rad)"
SHORT_DISPLACEMENT = "$y$ (static defl.)"

#: Dashes of limits, of unstable orbits and of what is beside a solid line.
DASHED, LONG_DASHES = (0, (4, 1.5)), (0, (5, 1.5))

#: Greys of the areas; the normal mesh stays white.
AREA_COLOURS = {"backlash": "#EBEBEB", "inverse mesh": "#CFCFCF"}

#: For curves that are no dampings, and dampings that are drawn without a configuration.
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

# Whatever would differ between two runs, or two versions of matplotlib, for no reason of the data.
_METADATA = {
    "png": {"Software": None},
    "pdf": {"CreationDate": None, "Creator": None, "Producer": None},
    "svg": {"Date": None, "Creator": None},
}

#: Height of the line that names the gears, inches.
_LINE = 0.14

#: Digits of a place in shares of the figure: a thousandth of a pixel.
_DIGITS = 6

#: Least span of an axis, a share of the largest value on it: less is not read off a plot,
#: and of equal values would be rounding.
LEAST_SPAN = 0.01

_PREFIXES = ((1.0, "m"), (1e-3, "mm"), (1e-6, "µm"), (1e-9, "nm"))


@dataclass(frozen=True)
class Look:
    """Colour, line style and marker of one curve."""

    colour: str
    line: str | tuple
    marker: str


@contextmanager
def styled():
    """Return the context, or decorator, in which figures are made: independent of user settings."""
    with matplotlib.style.context(["default", _RC]):
        yield
        interactive = matplotlib.is_interactive()
    # Within, the first figure of a notebook turns on that figures show: that is no matter of style.
    matplotlib.interactive(interactive)


def looks(names, colours=None):
    """Return name -> `Look` of the dampings, named in the order of the data.

    A name without one among `colours` takes the next of the palette.
    """
    chosen = colours or {}
    return {
        name: Look(chosen.get(name, colour), line, marker)
        for name, colour, line, marker in zip(
            names, cycle(PALETTE), cycle(_LINES), cycle(_MARKERS), strict=False
        )
    }


def damping_label(name):
    """Return the name of a damping as it is printed: k1 and k1m as symbols with an index."""
    return re.sub(r"\bk1(m?)\b", lambda found: f"$k_{{1{found[1]}}}$", name).replace("+", " + ")


def length_unit(length):
    """Return (metres, name) of the unit in which a length (m) is best read."""
    return next(((unit, name) for unit, name in _PREFIXES if length >= unit), _PREFIXES[-1])


def readable_unit(unit, *values):
    """Return (size, name) of the unit in which values are best read, µm for lengths in m."""
    if unit != "m":
        return 1.0, unit
    return length_unit(max(float(np.nanmax(np.abs(array), initial=0.0)) for array in values))


def draw_rise_and_fall(axes, x, y, falls, **look):
    """Draw a curve over the speed, dotted where a mask says that the speed falls."""
    for mask, dashes in ((~falls, "-"), (falls, ":")):
        if mask.any():
            axes.plot(x, np.where(mask, y, np.nan), linestyle=dashes, **look)
            look["label"] = None


def shade_areas(axes, backlash, direction):
    """Shade backlash and inverse mesh along the axis of the displacement, "x" or "y".

    The limits of the axes are set; the backlash, in static deflections, may be infinite. Return the
    visible range (low, high) of every area in the picture by its name.
    """
    low, high = sorted(axes.get_ylim() if direction == "y" else axes.get_xlim())
    ends = np.clip([high, 0.0, -backlash, low], low, high)
    areas = zip(("normal mesh", "backlash", "inverse mesh"), ends[1:], ends, strict=False)
    visible = {name: (first, last) for name, first, last in areas if first < last}
    span = axes.axhspan if direction == "y" else axes.axvspan
    for name in [name for name in AREA_COLOURS if name in visible]:
        span(*visible[name], color=AREA_COLOURS[name], linewidth=0, zorder=0)
    return visible


def second_scale(axes, factor, label, side="top", position=None):
    """Add a scale, on the "top" or "right" side, whose values are those of the axis times `factor`.

    position: how far out it lies, a share of the axes; by default on the frame.
    """
    scaled = (lambda value: value * factor), (lambda value: value / factor)
    if side == "top":
        axes.secondary_xaxis(position or side, functions=scaled).set_xlabel(label)
    else:
        axes.secondary_yaxis(position or side, functions=scaled).set_ylabel(label)


def length_scale(axes, deflection, label, side="right"):
    """Add a scale in a unit of length to an axis in static deflections, of this length (m)."""
    size, unit = length_unit(deflection)
    second_scale(axes, deflection / size, f"{label} ({unit})", side)


def page(height, share=1.0):
    """Return an empty figure of this height (inches) and share of the width of a page."""
    return Figure((PAGE_WIDTH * share, height), layout="constrained")


def panels(count, height, most=2):
    """Return a figure, and `count` axes of this height (inches) in rows of `most`."""
    columns = min(count, most)
    rows = -(-count // columns)
    figure = page(height * rows, columns / most)
    return figure, [figure.add_subplot(rows, columns, i + 1) for i in range(count)]


def entry(label, colour="black", line="-", marker=None, **options):
    """Return what a legend says of a line, or with the line "none" of a marker."""
    return Line2D([], [], color=colour, linestyle=line, marker=marker, label=label, **options)


def legend(figure, handles, columns, side="lower", **options):
    """Put a legend outside of all panels, on the lower or upper side of a figure.

    handles: those that `entry` and patches are, or an axes whose labels are explained.
    """
    if isinstance(handles, Axes):
        handles = handles.get_legend_handles_labels()[0]
    figure.legend(handles=handles, loc=f"outside {side} center", ncols=columns, **options)


def map_of_codes(axes, x, y, codes, colours):
    """Draw a map of codes 0, 1, ..., shape (y, x), each in its colour."""
    look = {"cmap": ListedColormap(colours), "shading": "nearest", "rasterized": True}
    norm = BoundaryNorm(np.arange(-0.5, len(colours)), len(colours))
    axes.pcolormesh(x, y, codes, norm=norm, **look)


def dots(axes, x, y, marker, colour, size, **options):
    """Draw markers without a line."""
    axes.plot(x, y, linestyle="none", marker=marker, color=colour, markersize=size, **options)


def note(axes, words, at, away=None, side="left center", of="data", white=None, **options):
    """Write small words at a place of an axes, or points away from it.

    side: which of theirs lies there; of: coordinates of the place; white: (room around the words,
    opacity) of a white box behind them.
    """
    ha, va = side.split()
    if white:
        box = {"boxstyle": f"round,pad={white[0]}", "facecolor": "white", "lw": 0}
        options["bbox"] = box | ({"alpha": white[1]} if len(white) > 1 else {})
    if away:
        options |= {"xytext": away, "textcoords": "offset points"}
    axes.annotate(words, at, xycoords=of, ha=ha, va=va, **{"fontsize": 6} | options)


def limits(*values, margin=0.05):
    """Return limits (low, high) around the finite ones of arrays, of a span that means something.

    margin: room on either side, a share of the span, which is `LEAST_SPAN` of the largest magnitude
    or more; without finite values, and of zeros, -1 and 1.
    """
    finite = np.concatenate([np.ravel(array) for array in values])
    finite = finite[np.isfinite(finite)]
    if not finite.any():
        return -1.0, 1.0
    low, high = float(finite.min()), float(finite.max())
    half = max(high - low, LEAST_SPAN * max(abs(low), abs(high))) * (0.5 + margin)
    return (low + high) / 2.0 - half, (low + high) / 2.0 + half


def _widen(axes):
    """Give the linear scales of an axes, where the data alone set them, their least span."""
    for name in "xy":
        low, high = getattr(axes, f"get_{name}lim")()
        free = getattr(axes, f"get_autoscale{name}_on")()
        linear = getattr(axes, f"get_{name}scale")() == "linear"
        if free and linear and high - low < LEAST_SPAN * max(abs(low), abs(high)):
            getattr(axes, f"set_{name}lim")(*limits((low, high)))


def note_absent(figure, methods):
    """Note above a figure which methods are left out because their packages are not installed."""
    if methods:
        words = f"not installed, left out: {', '.join(methods)} (make peers)"
        # Above: legends lie below.
        figure.suptitle(words, fontsize=6, x=0.99, ha="right")


def name_gears(figure, name):
    """Write below a figure, in a line that is added to its height, the gears that it is about."""
    width, height = figure.get_size_inches()
    figure.set_size_inches(width, height + _LINE)
    low = _LINE / (height + _LINE)
    if figure.get_layout_engine() is None:
        figure.set_layout_engine("constrained")
    figure.get_layout_engine().set(rect=(0.0, low, 1.0, 1.0 - low))
    look = {"fontsize": 6, "color": "#707070", "ha": "left", "va": "bottom"}
    figure.text(0.01, 0.2 * low, name, in_layout=False, **look)


def _freeze(figure):
    """Lay a figure out once, and round the places that the layout found.

    The solver of the layout goes through its constraints in an order that differs between
    processes, and so does the last digit of its result, which here and there shifts the shade of a
    pixel.
    """
    for axes in figure.axes:
        _widen(axes)
    if figure.get_layout_engine() is None:
        return
    figure.draw_without_rendering()
    # The layout leaves room for legends outside of the panels, and they stay on the rim.
    room = figure.get_layout_engine().get()["rect"]
    for shown in figure.legends if room[1] else ():
        shown.set_bbox_to_anchor(room, transform=figure.transSubfigure)
    # None and not "none", with which every file would be drawn twice, once for its layout.
    figure.set_layout_engine(None)
    for axes in figure.axes:
        left, bottom, width, height = axes.get_position(original=True).bounds
        axes.set_position([round(x, _DIGITS) for x in (left, bottom, width, height)])
    for text in figure.texts:
        text.set_position([round(x, _DIGITS) for x in text.get_position()])


def save(figure, path):
    """Write a figure as PNG, PDF or SVG, by the suffix of `path`, replacing it in one step.

    ValueError if the suffix is none of .png, .pdf, .svg.
    """
    path = Path(path)
    form = path.suffix.removeprefix(".")
    if form not in _METADATA:
        raise ValueError(f"path = {str(path)!r} is not allowed: it must end in .png, .pdf or .svg")
    with replacing(path) as temporary, styled():
        _freeze(figure)
        figure.savefig(temporary, format=form, dpi=figure.dpi, metadata=_METADATA[form])
