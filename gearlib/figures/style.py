"""Style of all figures, and reproducible output: the same data give the same bytes.

Curves differ in colour (see `gearlib.colours`) and, for greyscale prints, in marker and line style.
"""

import math
import re
import textwrap
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

from gearlib import colours as colours_of
from gearlib.data.files import atomic_write

#: Width of a figure, inches: the text width of a page.
PAGE_WIDTH = 7.2

#: Axis labels that several figures use.
TUNING_LABEL, OWN_TUNING_LABEL = "tuning $\\nu_s$", "tuning $\\nu$"
VELOCITY_LABEL = "$dy/d\\tau$ (static defl./rad)"
DISPLACEMENT_LABEL = "$y$ (static defl.)"

#: Dashes for limits and unstable orbits; dashes for the second of two curves.
DASHED, LONG_DASHES = (0, (4, 1.5)), (0, (5, 1.5))

#: Shades of areas without drive-side contact; the area of drive-side contact is white.
AREA_COLOURS = {"no contact": "#EBEBEB", "coast-side contact": "#CFCFCF"}

#: Colours for individual curves; for categories, use `curve_styles`.
PALETTE = colours_of.PALETTE

# The first four markers are those of the paper, in the order of its damping combinations.
_MARKERS = ("s", "o", "x", "o", "^", "D")
LINE_STYLES = ("-", (0, (5, 1.5)), (0, (1.5, 1.2)), (0, (6, 1.5, 1.5, 1.5)))

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

# Metadata that depend on the run or on the version of matplotlib are not written to files.
_METADATA = {
    "png": {"Software": None},
    "pdf": {"CreationDate": None, "Creator": None, "Producer": None},
    "svg": {"Date": None, "Creator": None},
}

#: Largest number of digits of numbers entered by a user; computed numbers have more digits.
_MAX_INPUT_DIGITS = 10

#: Height of the caption with the name of the gears, inches.
_CAPTION_HEIGHT = 0.14
#: Number of characters per inch of this caption.
_CHARACTERS_PER_INCH = 20.0

#: Decimal places of positions relative to the figure size; 1e-6 is a thousandth of a pixel.
_POSITION_DIGITS = 6

#: Smallest relative span of an axis; a smaller span would show rounding errors.
MIN_RELATIVE_SPAN = 0.01

_LENGTH_UNITS = ((1.0, "m"), (1e-3, "mm"), (1e-6, "µm"), (1e-9, "nm"))


@dataclass(frozen=True)
class CurveStyle:
    """Colour, line style and marker of one curve."""

    colour: str
    line_style: str | tuple
    marker: str


@contextmanager
def rc_context():
    """Apply the matplotlib settings `_RC` in a `with` block or in a decorated function.

    Afterwards, the previous settings are restored. However, if interactive mode has been turned on
    inside, it remains on.
    """
    with matplotlib.style.context(["default", _RC]):
        yield
        interactive = matplotlib.is_interactive()
    # The first figure of a notebook turns on interactive mode, which must not be turned off again.
    matplotlib.interactive(interactive)


def curve_styles(names, colours: dict | None = None) -> dict[Any, CurveStyle]:
    """Return a dict: name of each curve -> its `CurveStyle` (colour, line style, marker).

    `colours` maps some of the names to colours. All other curves get different, unused colours, but
    not those reserved for kinds of motion, such as chaotic motion.
    """
    colours = colours or {}
    unused_colours = colours_of.distinct_colours(colours.values())
    styles = {}
    for name, line_style, marker in zip(names, cycle(LINE_STYLES), cycle(_MARKERS), strict=False):
        colour = colours[name] if name in colours else next(unused_colours)
        styles[name] = CurveStyle(colour, line_style, marker)
    return styles


def typeset_dampings(name: str) -> str:
    """Typeset the damping coefficients k1 and k1m in `name` as LaTeX math."""
    return re.sub(r"\bk1(m?)\b", lambda match: f"$k_{{1{match[1]}}}$", name).replace("+", " + ")


def has_few_digits(number: float) -> bool:
    """Return whether a number has few digits, like user input and unlike computed numbers."""
    return float(f"{number:.{_MAX_INPUT_DIGITS}g}") == number


def format_numbers(numbers: ArrayLike, digits=6, form="g", decimals=0) -> list[str]:
    """Format numbers with so many digits that different numbers have different strings.

    Numbers with few digits, i.e. user input, keep all digits and are padded to at least `decimals`
    decimal places. Other numbers are formatted with `digits` digits and the format character `form`
    ("g" or "f"), or with more digits if strings would be equal otherwise. Numbers are considered
    equal if they agree to ten significant digits.
    """
    numbers = np.ravel(numbers).tolist()
    full_texts = [f"{number:.{_MAX_INPUT_DIGITS}g}" for number in numbers]
    for digit_count in range(digits, _MAX_INPUT_DIGITS + 1):
        texts = []
        for number, full_text in zip(numbers, full_texts, strict=True):
            if has_few_digits(number):
                texts.append(_pad_decimals(full_text, decimals))
            else:
                texts.append(f"{number:.{digit_count}{form}}")
        if len({*texts}) == len({*full_texts}):
            break
    return texts


def _pad_decimals(text: str, decimals: int) -> str:
    """Pad the string of a number with zeros to at least `decimals` decimal places.

    Strings with an exponent, "inf" and "nan" are returned unchanged.
    """
    integer_part, _, fraction = text.partition(".")
    if not decimals or re.search("[a-z]", text):
        return text
    return f"{integer_part}.{fraction:0<{decimals}}"


def length_unit(length: float) -> tuple[float, str]:
    """Return a readable unit from m to nm for a length in m, as (unit size in m, unit name)."""
    for unit_size, unit_name in _LENGTH_UNITS:
        if length >= unit_size:
            return unit_size, unit_name
    return _LENGTH_UNITS[-1]


def readable_unit(unit: str, *values: ArrayLike) -> tuple[float, str]:
    """Return a readable unit for arrays of values in `unit`, as (unit size in `unit`, unit name).

    The unit m is replaced by one from m to nm, depending on the largest magnitude. Other units are
    returned unchanged.
    """
    if unit != "m":
        return 1.0, unit
    return length_unit(max(float(np.nanmax(np.abs(array), initial=0.0)) for array in values))


def draw_solid_and_dotted(axes: Axes, x: ArrayLike, y: ArrayLike, is_dotted, **options):
    """Draw y over x as a line that is dotted where the mask `is_dotted` is true, otherwise solid.

    `options` are passed to `Axes.plot`. A label is used only once, so that the legend has a single
    entry.
    """
    for mask, dashes in ((~is_dotted, "-"), (is_dotted, ":")):
        if mask.any():
            axes.plot(x, np.where(mask, y, np.nan), linestyle=dashes, **options)
            options["label"] = None


def shade_lost_contact(axes: Axes, backlash: float, direction: str) -> dict[str, tuple]:
    """Shade the displacements without drive-side contact; return the visible ranges by area.

    `direction` is the displacement axis, "x" or "y", whose limits must be set. `backlash`, in units
    of the static deflection, may be infinite. The returned dict maps the names of the visible areas
    ("drive-side contact", "no contact", "coast-side contact") to their displacement ranges (lower,
    upper).
    """
    lower, upper = sorted(axes.get_ylim() if direction == "y" else axes.get_xlim())
    # Drive-side contact is above 0, coast-side contact below -backlash.
    edges = np.clip([upper, 0.0, -backlash, lower], lower, upper)
    names = ("drive-side contact", "no contact", "coast-side contact")
    areas = zip(names, edges[1:], edges[:-1], strict=True)
    visible_areas = {name: (start, end) for name, start, end in areas if start < end}
    shade = axes.axhspan if direction == "y" else axes.axvspan
    for name, colour in AREA_COLOURS.items():
        if name in visible_areas:
            shade(*visible_areas[name], color=colour, linewidth=0, zorder=0)
    return visible_areas


def add_secondary_axis(
    axes: Axes, factor: float, label: str, side="top", position: float | None = None
):
    """Add a secondary axis at the "top" or "right", which shows the axis values times `factor`.

    `position` is in axes coordinates; by default the axis is at the edge of the axes.
    """
    forward_and_inverse = (lambda value: value * factor), (lambda value: value / factor)
    if side == "top":
        axes.secondary_xaxis(position or side, functions=forward_and_inverse).set_xlabel(label)
    else:
        axes.secondary_yaxis(position or side, functions=forward_and_inverse).set_ylabel(label)


def add_length_axis(axes: Axes, deflection: float, label: str, side="right"):
    """Add a secondary axis in m, mm, µm or nm to an axis in units of the static deflection.

    `deflection` is the static deflection, m. The unit is appended to `label`.
    """
    unit_size, unit = length_unit(deflection)
    add_secondary_axis(axes, deflection / unit_size, f"{label} ({unit})", side)


def page_figure(height: float, relative_width=1.0) -> Figure:
    """Create an empty figure; `height` is in inches, `relative_width` in page widths."""
    return Figure((PAGE_WIDTH * relative_width, height), layout="constrained")


def panel_figure(count: int, height: float, max_columns=2) -> tuple[Figure, list[Axes]]:
    """Create a figure with `count` panels, each `height` inches high; return figure and axes.

    The figure is narrower than a page if there are fewer panels than `max_columns`.
    """
    columns = min(count, max_columns)
    rows = math.ceil(count / columns)
    figure = page_figure(height * rows, columns / max_columns)
    return figure, [figure.add_subplot(rows, columns, i + 1) for i in range(count)]


def legend_handle(
    label, colour="black", line_style="-", marker: str | None = None, **options
) -> Line2D:
    """Return a legend handle for a line or, if `line_style` is "none", for a marker only."""
    return Line2D([], [], color=colour, linestyle=line_style, marker=marker, label=label, **options)


def add_legend(figure: FigureBase, handles: list | Axes, columns: int, side="lower", **options):
    """Add a legend with `columns` columns below all panels, or above them if `side` is "upper".

    `handles` are labelled lines and patches, or axes that contain them. `options` are passed to
    `Figure.legend`.
    """
    if isinstance(handles, Axes):
        handles = handles.get_legend_handles_labels()[0]
    figure.legend(handles=handles, loc=f"outside {side} center", ncols=columns, **options)


def draw_category_map(
    axes: Axes, x: ArrayLike, y: ArrayLike, categories: np.ndarray, colours: list[str]
):
    """Draw a map of categories over x and y; `colours` contains the colour of each category.

    `categories` are indices of `colours`, shape (y.size, x.size).
    """
    options = {"cmap": ListedColormap(colours), "shading": "nearest", "rasterized": True}
    norm = BoundaryNorm(np.arange(-0.5, len(colours)), len(colours))
    axes.pcolormesh(x, y, categories, norm=norm, **options)


def draw_markers(axes: Axes, x: ArrayLike, y: ArrayLike, marker, colour, size, **options):
    """Draw markers without a line; `size` is in points, and `options` are passed to `Axes.plot`."""
    axes.plot(x, y, linestyle="none", marker=marker, color=colour, markersize=size, **options)


def white_box(padding: float, opacity: float | None = None) -> dict:
    """Return the argument `bbox` for a white box around a text.

    `padding` is in multiples of the font size; `opacity` is from 0 to 1, by default 1.
    """
    return {"boxstyle": f"round,pad={padding}", "facecolor": "white", "lw": 0, "alpha": opacity}


def annotate(axes, text, point, offset=None, anchor="left center", coords="data", **options):
    """Write a small text at `point`, or at an `offset` (x, y) from it, in points.

    `anchor` is the horizontal and vertical alignment. `coords` is the coordinate system of `point`
    (`xycoords` of `Axes.annotate`), and `options` are passed to `Axes.annotate`.
    """
    ha, va = anchor.split()
    if offset:
        options |= {"xytext": offset, "textcoords": "offset points"}
    axes.annotate(text, point, xycoords=coords, ha=ha, va=va, **{"fontsize": 6} | options)


def axis_limits(*values: ArrayLike, margin=0.05) -> tuple[float, float]:
    """Return axis limits (lower, upper) that include all finite values of arrays.

    `margin` is the margin on either side, relative to the span of the values. The span is at least
    `MIN_RELATIVE_SPAN` times the largest magnitude, so that rounding errors remain invisible. If
    there are no finite values, or all are zero, the limits are (-1, 1).
    """
    finite_values = np.concatenate([np.ravel(array) for array in values])
    finite_values = finite_values[np.isfinite(finite_values)]
    if not finite_values.any():
        return -1.0, 1.0
    low, high = float(finite_values.min()), float(finite_values.max())
    half_span = max(high - low, MIN_RELATIVE_SPAN * max(abs(low), abs(high))) * (0.5 + margin)
    return (low + high) / 2.0 - half_span, (low + high) / 2.0 + half_span


def _widen_limits(axes: Axes):
    """Widen narrow automatic limits of linear axes, so that rounding errors remain invisible."""
    for name in "xy":
        low, high = getattr(axes, f"get_{name}lim")()
        automatic = getattr(axes, f"get_autoscale{name}_on")()
        linear = getattr(axes, f"get_{name}scale")() == "linear"
        if automatic and linear and high - low < MIN_RELATIVE_SPAN * max(abs(low), abs(high)):
            getattr(axes, f"set_{name}lim")(*axis_limits((low, high)))


def add_missing_package_note(figure: Figure, methods: list[str]):
    """Write above a figure which integration methods are not shown, because packages are missing.

    The command `make peers` installs the packages of these `methods`.
    """
    if methods:
        text = f"not shown, because not installed: {', '.join(methods)} (make peers)"
        # The note is above the panels, because legends lie below them.
        figure.suptitle(text, fontsize=6, x=0.99, ha="right")


def add_gear_caption(figure: Figure, name: str):
    """Write the name of the gears below a figure and increase its height accordingly.

    Long names are wrapped.
    """
    width, height = figure.get_size_inches()
    lines = textwrap.wrap(name, int(_CHARACTERS_PER_INCH * width)) or [""]
    added_height = _CAPTION_HEIGHT * (1.0 + 0.6 * (len(lines) - 1))
    figure.set_size_inches(width, height + added_height)
    relative_height = added_height / (height + added_height)
    if figure.get_layout_engine() is None:
        figure.set_layout_engine("constrained")
    figure.get_layout_engine().set(rect=(0.0, relative_height, 1.0, 1.0 - relative_height))  # type: ignore[call-arg]
    options = {"fontsize": 6, "color": "#707070", "ha": "left", "va": "bottom"}
    offset = 0.2 * _CAPTION_HEIGHT / (height + added_height)
    figure.text(0.01, offset, "\n".join(lines), in_layout=False, **options)


def _freeze(figure: Figure):
    """Apply the layout of a figure, then fix and round the positions of its axes and texts.

    The last digits of the layout solver differ between processes; without rounding, they would
    change some pixels of the files.
    """
    for axes in figure.axes:
        _widen_limits(axes)
    if figure.get_layout_engine() is None:
        return
    figure.draw_without_rendering()
    # Legends must stay above the caption that `add_gear_caption` writes below the layout rectangle.
    rectangle = figure.get_layout_engine().get()["rect"]
    if rectangle[1]:
        for legend_box in figure.legends:
            legend_box.set_bbox_to_anchor(rectangle, transform=figure.transSubfigure)
    # With "none" instead of None, matplotlib would draw each file twice.
    figure.set_layout_engine(None)
    for axes in figure.axes:
        left, bottom, width, height = axes.get_position(original=True).bounds
        axes.set_position([round(x, _POSITION_DIGITS) for x in (left, bottom, width, height)])
    for text in figure.texts:
        text.set_position([round(x, _POSITION_DIGITS) for x in text.get_position()])


def save(figure: Figure, path: str | Path):
    """Write a figure to a .png, .pdf or .svg file; an existing file is replaced atomically.

    Raise ValueError if `path` has another suffix.
    """
    path = Path(path)
    file_format = path.suffix.removeprefix(".")
    if file_format not in _METADATA:
        raise ValueError(f"path = {str(path)!r} is not allowed: it must end in .png, .pdf or .svg")
    with atomic_write(path) as temporary, rc_context():
        _freeze(figure)
        metadata = _METADATA[file_format]
        figure.savefig(temporary, format=file_format, dpi=figure.dpi, metadata=metadata)
