"""What a figure holds: every artist, axis, label and legend as numbers and words, and what moved.

A figure is read into one table, place -> facts ("axes 0, line 2" -> its points, colour, dashes),
which is stored as JSON with an artist in every line. Layout, which changes with the fonts, is not
read: where panels lie on the page, and ticks that matplotlib chose.
"""

import json

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import Collection, QuadMesh
from matplotlib.colors import to_hex
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.text import Annotation
from matplotlib.ticker import FixedFormatter, FixedLocator, FuncFormatter

#: Digits that are stored. Figures are drawn from stored data: what is left is the arithmetic of
#: limits and logarithms in matplotlib, and the last digit.
_DIGITS = 10
RELATIVE = 1e-8
#: Of the largest number of the same array, for those that are zero but for rounding.
ABSOLUTE = 1e-12

#: Sentences about one figure; a change of the layout moves everything.
_SENTENCES = 12


def read(figure):
    """Return what a figure holds.

    Parameters
    ----------
    figure : matplotlib.figure.Figure

    Returns
    -------
    dict of str to dict
        Place -> name -> text, number, or nested list of numbers.

    Raises
    ------
    TypeError
        If it holds an artist of which nothing is known here.
    """
    # Only now secondary axes get their limits.
    figure.draw_without_rendering()
    found = {"figure": {"size": numbers(figure.get_size_inches()), "dpi": figure.dpi}}
    whole = {"figure": figure} | {f"part {i}": part for i, part in enumerate(figure.subfigs)}
    for place, part in whole.items():
        for i, text in enumerate(part.texts):
            found[f"{place}, text {i}"] = _words(text)
        _legends(found, place, part.legends)
    for i, axes in enumerate(figure.axes):
        _read_axes(found, f"axes {i}", axes)
    return found


def numbers(values):
    """Return values as nested lists of floats of few digits; what is masked is NaN."""
    array = np.asarray(np.ma.filled(np.ma.asarray(values, dtype=float), np.nan))
    return np.vectorize(lambda x: float(f"{x:.{_DIGITS}g}"), otypes=[float])(array).tolist()


def _read_axes(found, place, axes):
    found[place] = {
        "colour": _colour(axes.get_facecolor()),
        "aspect": str(axes.get_aspect()),
    }
    if isinstance(axes, Axes):
        found[place]["titles"] = [axes.get_title(where) for where in ("left", "center", "right")]
    spec = axes.get_subplotspec()
    if spec is not None:
        found[place]["cell"] = [*spec.get_geometry(), *spec.get_gridspec().get_height_ratios()]
    for name, axis in (("x", axes.xaxis), ("y", axes.yaxis)):
        facts = {
            "label": axis.label.get_text() if axis.label.get_visible() else "",
            "scale": axis.get_scale(),
            "limits": numbers(axis.get_view_interval()),
            "inverted": bool(axis.get_inverted()),
            "visible": bool(axis.get_visible()),
            "numbered": _numbered(axis),
        }
        if isinstance(axis.get_major_locator(), FixedLocator):
            facts["ticks"] = numbers(axis.get_majorticklocs())
        if isinstance(axis.get_major_formatter(), (FixedFormatter, FuncFormatter)):
            facts["tick labels"] = [text.get_text() for text in axis.get_ticklabels()]
        found[f"{place}, {name} axis"] = facts
    kinds = {
        "line": (axes.lines, _line),
        "collection": (axes.collections, _collection),
        "patch": (axes.patches, _patch),
        "image": (axes.images, _image),
        "text": (axes.texts, _words),
    }
    for kind, (artists, reader) in kinds.items():
        for i, artist in enumerate(artists):
            found[f"{place}, {kind} {i}"] = reader(artist) | _common(artist)
    others = [type(one).__name__ for one in [*axes.tables, *axes.artists]]
    if others:
        raise TypeError(f"{place}: nothing here reads {', '.join(others)}")
    _legends(found, place, filter(None, [axes.get_legend()]))
    for i, child in enumerate(axes.child_axes):
        _read_axes(found, f"{place}, scale {i}", child)


def _numbered(axis):
    """Return the sides of an axis that have numbers."""
    shown = axis.get_tick_params()
    return [side for side in ("left", "right", "bottom", "top") if shown.get(f"label{side}")]


def _legends(found, place, legends):
    for i, legend in enumerate(legends):
        name = f"{place}, legend {i}"
        found[name] = {"title": legend.get_title().get_text()}
        pairs = zip(legend.get_texts(), legend.legend_handles, strict=True)
        for j, (text, handle) in enumerate(pairs):
            readers = {Line2D: _line, Patch: _patch, Collection: _collection}
            (reader,) = (reader for kind, reader in readers.items() if isinstance(handle, kind))
            facts = reader(handle)
            # Where in the legend a handle lies is layout.
            for key in ("x", "y", "points", "offsets"):
                facts.pop(key, None)
            found[f"{name}, entry {j}"] = {"text": text.get_text()} | facts


def _common(artist):
    facts = {"order": artist.get_zorder(), "visible": bool(artist.get_visible())}
    label = str(artist.get_label())
    if label and not label.startswith("_"):
        facts["label"] = label
    if not artist.get_clip_on():
        facts["clipped"] = False
    return facts


def _line(line):
    facts = {
        "x": numbers(line.get_xdata()),
        "y": numbers(line.get_ydata()),
        "coordinates": _coordinates(line.axes, line.get_transform()),
        "colour": _colour(line.get_color(), line.get_alpha()),
        "dashes": line.get_linestyle(),
        "width": line.get_linewidth(),
        "marker": str(line.get_marker()),
    }
    offset, pattern = line._unscaled_dash_pattern
    if pattern:
        facts["dashes"] = numbers([offset, *pattern])
    if line.get_drawstyle() != "default":
        facts["drawstyle"] = line.get_drawstyle()
    if facts["marker"] != "None":
        facts["marker colours"] = [
            _colour(one, line.get_alpha())
            for one in (line.get_markerfacecolor(), line.get_markeredgecolor())
        ]
        facts["marker sizes"] = numbers([line.get_markersize(), line.get_markeredgewidth()])
        facts["marked"] = str(line.get_markevery())
    return facts


def _collection(collection):
    facts = {
        "kind": type(collection).__name__,
        "colours": _colours(collection.get_facecolor()),
        "edges": _colours(collection.get_edgecolor()),
        "widths": numbers(collection.get_linewidth()),
        "dashes": str(collection.get_linestyle()),
        "coordinates": _coordinates(collection.axes, collection.get_transform()),
    }
    if isinstance(collection, QuadMesh):
        facts["points"] = numbers(collection.get_coordinates())
    else:
        facts["points"] = numbers(_joined(path.vertices for path in collection.get_paths()))
        facts["offsets"] = numbers(collection.get_offsets())
        facts["offset coordinates"] = _coordinates(
            collection.axes, collection.get_offset_transform()
        )
    if hasattr(collection, "get_sizes"):
        facts["sizes"] = numbers(collection.get_sizes())
    if collection.get_array() is not None:
        facts |= _mapped(collection)
    return facts


def _image(image):
    facts = {"extent": numbers(image.get_extent()), "origin": image.origin}
    array = image.get_array()
    # With a third axis these are colours.
    return facts | (_mapped(image) if array.ndim == 2 else {"values": numbers(array)})


def _mapped(artist):
    """Return what a picture of colours shows: its numbers, and the colours that stand for them."""
    norm, colours = artist.norm, artist.get_cmap()
    samples = np.arange(colours.N) if colours.N <= 16 else np.linspace(0.0, 1.0, 9)
    return {
        "values": numbers(artist.get_array()),
        "scale": type(norm).__name__,
        "limits": numbers(getattr(norm, "boundaries", [norm.vmin, norm.vmax])),
        "map": [to_hex(colour) for colour in colours(samples)],
        # Of what is masked or lies without.
        "colours": [_colour(one) for one in colours([np.nan, -np.inf, np.inf])],
    }


def _patch(patch):
    path = patch.get_patch_transform().transform_path(patch.get_path())
    return {
        "points": numbers(path.vertices),
        "coordinates": _coordinates(patch.axes, patch.get_data_transform()),
        "colour": _colour(patch.get_facecolor()),
        "edge": _colour(patch.get_edgecolor()),
        "width": patch.get_linewidth(),
        "dashes": str(patch.get_linestyle()),
        "hatch": str(patch.get_hatch()),
    }


def _words(text):
    facts = {
        "text": text.get_text(),
        "colour": _colour(text.get_color()),
        "size": text.get_fontsize(),
        "style": [text.get_fontstyle(), str(text.get_fontweight())],
        "aligned": [text.get_horizontalalignment(), text.get_verticalalignment()],
        "rotation": text.get_rotation(),
    }
    if isinstance(text, Annotation):
        facts["points"] = numbers(text.xy)
        facts["coordinates"] = [str(text.xycoords), str(text.anncoords)]
        # Shifts in points, or the place itself.
        facts["shift"] = numbers(text.xyann)
    elif text.axes is not None:
        facts["points"] = numbers(text.get_position())
        facts["coordinates"] = _coordinates(text.axes, text.get_transform())
    return facts


def _joined(parts):
    """Return arrays of points as one, a row of NaN after each."""
    gap = np.full((1, 2), np.nan)
    return np.concatenate([gap, *(each for part in parts for each in (part, gap))])


def _coordinates(axes, transform):
    """Return what the coordinates of an artist are counted in."""
    if axes is None:
        return "figure"
    known = {
        "data": axes.transData,
        "axes": axes.transAxes,
        "data, axes": axes.get_xaxis_transform(),
        "axes, data": axes.get_yaxis_transform(),
    }
    return next((name for name, one in known.items() if transform == one), "other")


def _colour(colour, alpha=None):
    return to_hex(colour, keep_alpha=True) if alpha is None else to_hex((colour, alpha), True)


def _colours(colours):
    """Return colours, one where all are the same."""
    found = [_colour(colour) for colour in colours]
    return found[:1] if len(set(found)) == 1 else found


def write(found, path):
    """Write what a figure holds."""
    lines = (
        f"{json.dumps(place)}: {json.dumps(facts, default=float)}" for place, facts in found.items()
    )
    path.write_text("{\n" + ",\n".join(lines) + "\n}\n", encoding="utf-8")


def load(path):
    """Return what `write` wrote."""
    return json.loads(path.read_text(encoding="utf-8"))


def differences(name, golden, found):
    """Return sentences on how the figure `name` differs from what was stored of it."""
    sentences = [f"{name}, {place}: gone" for place in golden if place not in found]
    sentences += [f"{name}, {place}: new" for place in found if place not in golden]
    for place in golden:
        old, new = golden[place], found.get(place, golden[place])
        called = next((f" {old[key]!r}" for key in ("label", "text") if old.get(key)), "")
        for key in dict.fromkeys([*old, *new]):
            words = _difference(key, old, new)
            sentences += [f"{name}, {place}{called}: {words}"] if words else []
    more = len(sentences) - _SENTENCES
    return [*sentences[:_SENTENCES], f"{name}: {more} more"] if more > 1 else sentences


def _difference(key, old, new):
    """Return how one fact of an artist differs, in words, "" if it does not."""
    before, after = old.get(key), new.get(key)
    if before == after:
        return ""
    try:
        first, second = np.array(before, dtype=float), np.array(after, dtype=float)
    except (TypeError, ValueError):
        return f"{key} was {before!r}, is {after!r}"
    if first.shape != second.shape or first.size < 3:
        same = first.shape == second.shape and _near(first, second).all()
        both = f"{_short(first, before)}, is {_short(second, after)}"
        return "" if same else f"{key} was {both}"
    far = ~_near(first, second)
    if not far.any():
        return ""
    change = np.where(far, np.abs(second - first), -1.0)
    change[np.isnan(change)] = np.inf
    place = np.unravel_index(change.argmax(), change.shape)
    # Where on the picture: along a line by its x, else by the place in the array.
    along = np.ravel(old["x"])[place[0]] if key == "y" and "x" in old else None
    where = f"at {tuple(map(int, place))}" if along is None else f"at x = {along:.6g}"
    of = "points" if key in "xy" else "numbers"
    return f"{key} differs at {far.sum()} of {first.size} {of}, largest {change.max():.3g} {where}"


def _near(first, second):
    finite = np.abs(first[np.isfinite(first)])
    allowed = RELATIVE * np.abs(first) + ABSOLUTE * finite.max(initial=0.0)
    with np.errstate(invalid="ignore"):
        close = np.abs(second - first) <= allowed
    return close | (first == second) | (np.isnan(first) & np.isnan(second))


def _short(array, value):
    return repr(value) if array.size < 5 else f"{array.shape} numbers"
