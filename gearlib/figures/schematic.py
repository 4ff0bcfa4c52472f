"""A gear train seen along its axes: pitch circles, shafts, carriers, and its meshes by name."""

import math
from typing import NamedTuple

import numpy as np
from matplotlib.patches import Circle

from gearlib import checks
from gearlib.figures import style

#: Codes of `gearlib.engines.codes`.
NORMAL, BACKLASH, INVERSE = 1, 0, -1
#: Phase of contact of a mesh -> its mark, whether it is filled, and what is said of it.
CONTACTS = {
    NORMAL: ("o", True, ""),
    BACKLASH: ("o", False, "open: out of contact"),
    INVERSE: ("D", True, "diamond: far flanks touch"),
}
#: Kind of a circle -> its line in the figures: width, dashes.
CIRCLES = {"gear": (0.7, "-"), "ring": (1.4, "-"), "rotor": (0.5, (0, (3, 2)))}
#: Colours of circles and of carriers; of meshes that have no curve.
GREY, CARRIER, NO_CURVE = "#707070", "#D0D0D0", "#4D4D4D"
#: Shares of the width or height of the picture: room beside it, from name to name, a shaft.
_ROOM, _ROW, _SHAFT = 0.06, 0.085, 0.025
#: How far a mark of a ring gear goes beyond its circle.
_BEYOND = 1.06
#: Of a circle: those that are closer are one.
_SAME = 1e-6
#: Share of the width of a page, and height in inches, of a train beside and below its curves.
_BESIDE, _BELOW = 0.3, 1.6


class Instant(NamedTuple):
    """Circles, lines and points of a train at one phase, in m."""

    circles: list  #: (x, y, radius, kind of `CIRCLES`)
    marks: np.ndarray  #: lines that turn with the bodies, from (x, y) to (x, y), shape (k, 2, 2)
    arms: np.ndarray  #: lines from the axis of a carrier to those that it carries, (a, 2, 2)
    shafts: np.ndarray  #: axes on which shafts join bodies, (s, 2)
    meshes: np.ndarray  #: pitch points, (m, 2)


def instant(layout, phase=0.0):
    """Return the `Instant` of a `GearTrain.layout` at a phase of the reference mesh, rad."""
    c, s = (f(float(layout.frame_turns) * phase) for f in (math.cos, math.sin))
    turned = np.array([[c, s], [-s, c]])
    axes = np.stack([layout.body_x, layout.body_y], axis=-1) @ turned
    at = dict(zip(map(str, layout.body.values), axes, strict=True))
    radii = _radii(layout)
    circles, marks = [], []
    for name, turns in zip(at, layout.body_turns.values, strict=True):
        for radius, kind in radii[name]:
            circles.append((*map(float, at[name]), radius, kind))
        way = np.array([math.cos(turns * phase), math.sin(turns * phase)])
        if radii[name]:
            largest, kind = max(radii[name])
            ends = (1.0, _BEYOND) if kind == "ring" else (0.0, 1.0)
            marks.append([at[name] + end * largest * way for end in ends])
    carriers = zip(at, map(str, layout.carried_by.values), strict=True)
    arms = [(at[carrier], at[name]) for name, carrier in carriers if carrier]
    lines = dict(zip(layout.shaft_line.values.tolist(), axes, strict=True))
    lines.pop(0, None)
    meshes = np.stack([layout.mesh_x, layout.mesh_y], axis=-1) @ turned
    turning, carried = (np.reshape(found, (-1, 2, 2)) for found in (marks, arms))
    return Instant(circles, turning, carried, np.reshape([*lines.values()], (-1, 2)), meshes)


def _radii(layout):
    """Return name of a body -> its circles, (radius, kind), none of a carrier."""
    found: dict = {str(name): [] for name in layout.body.values}
    for names, radii in zip(layout.mesh_gear.values, layout.pitch_radius.values, strict=True):
        for name, radius in zip(map(str, names), map(float, radii), strict=True):
            one = abs(radius), "ring" if radius < 0.0 else "gear"
            if all(abs(one[0] - other) > _SAME * one[0] for other, _ in found[name]):
                found[name].append(one)
    carriers = set(map(str, layout.carried_by.values))
    for name, radius in zip(found, layout.body_radius.values, strict=True):
        if not found[name] and name not in carriers:
            found[name].append((float(radius), "rotor"))
    return found


def extent(layout):
    """Return (left, right, low, high) of what a train takes at any phase."""
    circles = instant(layout).circles
    x, y, r = (np.array([one[i] for one in circles]) for i in range(3))
    r = r * np.where([one[3] == "ring" for one in circles], _BEYOND, 1.0)
    if layout.frame_turns:
        reach = float((np.hypot(x, y) + r).max())
        return -reach, reach, -reach, reach
    ends = (x - r).min(), (x + r).max(), (y - r).min(), (y + r).max()
    return tuple(map(float, ends))


def labels(layout, points):
    """Return where the names of meshes stand, x, y and "left" or "right", in two columns.

    points: pitch points, shape (m, 2), of which a line leads to each name.
    """
    left, right, low, high = extent(layout)
    size, middle = max(right - left, high - low), (left + right) / 2.0
    found = [(0.0, 0.0, "left")] * len(points)
    on_left = points[:, 0] < middle - _SAME * size
    for side, own in (("left", on_left), ("right", ~on_left)):
        order = [i for i in np.argsort(points[:, 1], kind="stable") if own[i]]
        heights: list = []
        for i in order:
            heights.append(max([points[i, 1], *(h + _ROW * size for h in heights[-1:])]))
        # Pushed up on the whole as far as down.
        shift = np.mean(heights - points[order, 1]) if order else 0.0
        x = left - _ROOM * size if side == "left" else right + _ROOM * size
        for i, height in zip(order, heights, strict=True):
            found[i] = x, float(height - shift), side
    return found


def draw(axes, layout, colours=None, phase=0.0, contact=None):
    """Draw a train in an axes.

    layout: of `GearTrain.layout`, or a dataset that holds it; colours: name of a mesh -> that of
    its curve; phase: of the reference mesh, rad; contact: code of each mesh, if it is known.
    """
    now, (left, right, low, high) = instant(layout, phase), extent(layout)
    size = max(right - left, high - low)
    for ends in now.arms:
        axes.plot(*ends.T, color=CARRIER, linewidth=3.0, solid_capstyle="round", zorder=1)
    for x, y, radius, kind in now.circles:
        width, dashes = CIRCLES[kind]
        look = {"linewidth": width, "linestyle": dashes, "edgecolor": GREY, "zorder": 2}
        axes.add_patch(Circle((x, y), radius, fill=False, **look))
    for ends in now.marks:
        axes.plot(*ends.T, color=GREY, linewidth=0.5, zorder=2)
    for place in now.shafts:
        axes.add_patch(Circle(place, _SHAFT * size, facecolor=GREY, linewidth=0, zorder=3))
    names = list(map(str, layout.mesh.values))
    chosen = style.mesh_colours(names) if colours is None else colours
    codes = [NORMAL] * len(names) if contact is None else contact
    for name, (x, y), code in zip(names, now.meshes, codes, strict=True):
        marker, filled, _ = CONTACTS[int(code)]
        colour = chosen.get(name, NO_CURVE)
        face = {"markerfacecolor": colour if filled else "white", "markeredgewidth": 0.9}
        style.dots(axes, [x], [y], marker, colour, 4.0, zorder=5, **face)
    for name, at, (x, y, side) in zip(names, now.meshes, labels(layout, now.meshes), strict=True):
        colour = chosen.get(name, NO_CURVE)
        axes.plot([at[0], x], [at[1], y], color=colour, linewidth=0.4, zorder=4)
        away, towards = ((-2, 0), "right") if side == "left" else ((2, 0), "left")
        style.note(axes, name, (x, y), away, f"{towards} center", color=colour, fontsize=5.5)
    axes.set_xlim(left - _ROOM * size, right + _ROOM * size)
    axes.set_ylim(low - _ROOM * size, high + _ROOM * size)
    axes.set_aspect("equal")
    axes.set_axis_off()


def words(layout, contact=None):
    """Return what has to be said of a schematic, lines of text."""
    there = [] if contact is None else np.unique(contact)
    found = [said for code, (_, _, said) in CONTACTS.items() if said and code in there]
    misfit = float(layout.misfit)
    if misfit > _SAME * float(layout.body_radius.max()):
        unit, name = style.length_unit(misfit)
        found.append(f"positions given differ by {misfit / unit:.3g} {name}")
    return found


def at(layout, run=None, phase=None):
    """Return (phase, contacts of all meshes or None) of a run, or of a static equilibrium.

    The phase is by default that at which the record of the run begins, 0 without one; ValueError if
    it lies beside the record, if the run has other meshes, or no motion.
    """
    if run is None:
        phase = 0.0 if phase is None else phase
        return checks.number("phase", phase, "finite", math.isfinite), None
    if "mesh" not in run.coords or not run.mesh.equals(layout.mesh):
        raise ValueError("mesh of the run is not allowed: its meshes must be those of the train")
    if int(run.status):
        raise ValueError(f"the run has no contacts to show: {run.status.attrs['message']}")
    if "phase" not in run.contact.dims:
        return float(run.reference_phase), run.contact.values
    first, last = run.phase.values[[0, -1]]
    phase, words = first if phase is None else phase, f"from {first:.9g} to {last:.9g}"
    phase = checks.number("phase", phase, words, lambda value: first <= value <= last)
    return phase, run.contact.values[np.abs(run.phase.values - phase).argmin()]


@style.styled()
def beside(axes, train, run=None, colours=None):
    """Draw a train, at the beginning of a run, beside axes that fill a figure; return these."""
    grid = axes.figure.add_gridspec(1, 2, width_ratios=(1.0 - _BESIDE, _BESIDE))
    axes.set_subplotspec(grid[0])
    width, height = axes.figure.get_size_inches()
    axes.figure.set_size_inches(width / (1.0 - _BESIDE), height)
    own, layout = axes.figure.add_subplot(grid[1]), train.layout()
    phase, contact = at(layout, None if run is None or int(run.status) else run)
    draw(own, layout, colours, phase, contact)
    when = "of the train" if contact is None else "at the first instant shown"
    own.set_title("\n".join([f"meshes {when}", *words(layout, contact)]), fontsize=6)
    return axes


def with_train(figure, data, colours=None, below=False):
    """Draw the train that a dataset is about beside, or below, what else a figure has.

    Nothing of a dataset without a `GearTrain.layout`. Return the part of the figure that is left.
    """
    if "pitch_radius" not in data:
        return figure
    if below:
        width, height = figure.get_size_inches()
        figure.set_size_inches(width, height + _BELOW)
        part, own = figure.subfigures(2, 1, height_ratios=(height, _BELOW))
    else:
        part, own = figure.subfigures(1, 2, width_ratios=(1.0 - _BESIDE, _BESIDE))
    axes = own.subplots()
    draw(axes, data, colours)
    axes.set_title("\n".join(["meshes of the train", *words(data)]), fontsize=6)
    return part
