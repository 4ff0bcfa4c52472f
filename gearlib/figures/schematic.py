"""Schematic of a gear train seen along its axes: pitch circles, shafts, carriers, meshes."""

import math
from typing import NamedTuple

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure, SubFigure
from matplotlib.patches import Circle

from gearlib import checks, parameters
from gearlib.figures import style
from gearlib.parameters import Angle

#: Contact state -> marker of a mesh, whether it is filled, explanation.
CONTACTS = {
    1: ("o", True, ""),
    0: ("o", False, "open: out of contact"),
    -1: ("D", True, "diamond: coast-side flanks touch"),
}
#: Kind of circle -> line width and line style.
CIRCLES = {"gear": (0.7, "-"), "ring": (1.4, "-"), "rotor": (0.5, (0, (3, 2)))}
GREY, CARRIER_COLOUR, DEFAULT_MESH_COLOUR = "#707070", "#D0D0D0", "#4D4D4D"
#: Margin and radius of a shaft, relative to the size of the train.
_MARGIN, _SHAFT_RADIUS = 0.06, 0.025
#: Outer end of the rotation mark of a ring gear, relative to its radius.
RING_MARK_RADIUS = 1.06
#: Relative tolerance within which lengths are considered equal.
SAME_LENGTH = 1e-6
#: Relative width of a train beside curves; height of a train below curves, inches.
_RELATIVE_WIDTH, _HEIGHT_BELOW = 0.3, 1.6


class Drawing(NamedTuple):
    """Circles, lines and points of a gear train at one phase, in m."""

    circles: list  #: (x, y, radius, kind of `CIRCLES`)
    marks: np.ndarray  #: lines that rotate with bodies, shape (lines, 2 ends, 2 coordinates)
    arms: np.ndarray  #: lines from a carrier axis to the axes it carries, shape (lines, 2, 2)
    shafts: np.ndarray  #: positions of shafts, shape (shafts, 2)
    meshes: np.ndarray  #: pitch points, shape (meshes, 2)


def create_drawing(layout: xr.Dataset, phase=0.0) -> Drawing:
    """Return the circles, lines and points of a gear train at a phase of the reference mesh, rad.

    `layout` is a result of `GearTrain.layout`. It contains the positions of bodies and meshes at
    phase 0, m, and rotation angles per phase: `body_turns` for each body and `frame_turns` for the
    rotation of all axes about the first.
    """
    angle = float(layout.frame_turns) * phase
    # Positions are row vectors, so the rotation matrix is multiplied from the right.
    rotation = np.array([[math.cos(angle), math.sin(angle)], [-math.sin(angle), math.cos(angle)]])
    positions = np.stack([layout.body_x, layout.body_y], axis=-1) @ rotation
    meshes = np.stack([layout.mesh_x, layout.mesh_y], axis=-1) @ rotation
    position_of = dict(zip(map(str, layout.body.values), positions, strict=True))
    circles, marks = [], []
    named_circles = body_circles(layout).items()
    for (name, radii), body_turn in zip(named_circles, layout.body_turns.values, strict=True):
        x, y = map(float, position_of[name])
        circles += [(x, y, radius, kind) for radius, kind in radii]
        if radii:
            # A radial line shows the rotation. For ring gears it lies outside the circle.
            radius, kind = max(radii)
            end_radii = radius * np.array([1.0, RING_MARK_RADIUS] if kind == "ring" else [0.0, 1.0])
            mark_direction = np.array([math.cos(body_turn * phase), math.sin(body_turn * phase)])
            marks.append(position_of[name] + np.outer(end_radii, mark_direction))
    arms = []
    for name, carrier in zip(position_of, map(str, layout.carried_by.values), strict=True):
        if carrier:
            arms.append((position_of[carrier], position_of[name]))
    # All bodies on a shaft have the same shaft number and position; 0 means no shaft.
    shaft_positions = dict(zip(layout.shaft_line.values.tolist(), positions, strict=True))
    shafts = [position for shaft_number, position in shaft_positions.items() if shaft_number]
    # Empty lists must also become arrays with these dimensions.
    marks, arms = np.reshape(marks, (-1, 2, 2)), np.reshape(arms, (-1, 2, 2))
    return Drawing(circles, marks, arms, np.reshape(shafts, (-1, 2)), meshes)


def body_circles(layout: xr.Dataset) -> dict[str, list[tuple[float, str]]]:
    """Return a dict: name of each body -> its circles, a list of (radius in m, kind).

    The kind is "gear", "ring" (ring gear) or "rotor" (body without a mesh). Gears have a pitch
    circle for each mesh, without duplicates; carriers have none. `layout` is a result of
    `GearTrain.layout`.
    """
    circles = {str(name): {} for name in layout.body.values}
    for names, pitch_radii in zip(layout.mesh_gear.values, layout.pitch_radius.values, strict=True):
        for name, signed_radius in zip(map(str, names), map(float, pitch_radii), strict=True):
            # Ring gears have negative radii.
            radius, kind = abs(signed_radius), "ring" if signed_radius < 0.0 else "gear"
            if not any(math.isclose(radius, r, rel_tol=SAME_LENGTH) for r in circles[name]):
                circles[name][radius] = kind
    carriers = {*map(str, layout.carried_by.values)}
    for name, radius in zip(circles, layout.body_radius.values, strict=True):
        if not circles[name] and name not in carriers:
            circles[name] = {float(radius): "rotor"}
    return {name: [*radii.items()] for name, radii in circles.items()}


def draw_schematic(axes: Axes, layout: xr.Dataset, colours=None, phase=0.0, contact=None, title=()):
    """Draw a gear train at a phase of the reference mesh, rad.

    `layout` is a result of `GearTrain.layout`. `colours` maps mesh names to colours; None means
    those of `style.curve_styles`. `contact` contains the contact state of each mesh: 1 (drive
    side), 0 (no contact) or -1 (coast side); None means drive-side contact. `title` contains the
    first lines of the title.
    """
    drawing = create_drawing(layout, phase)
    for ends in drawing.arms:
        axes.plot(*ends.T, color=CARRIER_COLOUR, linewidth=3.0, solid_capstyle="round", zorder=1)
    for x, y, radius, kind in drawing.circles:
        width, dashes = CIRCLES[kind]
        options = {"linewidth": width, "linestyle": dashes, "edgecolor": GREY, "zorder": 2}
        axes.add_patch(Circle((x, y), radius, fill=False, **options))
    for ends in drawing.marks:
        axes.plot(*ends.T, color=GREY, linewidth=0.5, zorder=2)
    axes.set_aspect("equal")
    axes.margins(_MARGIN)
    axes.autoscale_view()
    radius = _SHAFT_RADIUS * max(np.ptp(axes.get_xlim()), np.ptp(axes.get_ylim()))
    for centre in drawing.shafts:
        axes.add_patch(Circle(centre, radius, facecolor=GREY, linewidth=0, zorder=3))
    names = [str(name) for name in layout.mesh.values]
    if colours is None:
        colours = {name: curve.colour for name, curve in style.curve_styles(names).items()}
    colours = [colours.get(name, DEFAULT_MESH_COLOUR) for name in names]
    contact_states = [1] * len(names) if contact is None else [int(state) for state in contact]
    for colour, (x, y), state in zip(colours, drawing.meshes, contact_states, strict=True):
        marker, is_filled, _ = CONTACTS[state]
        options = {"markerfacecolor": colour if is_filled else "white", "markeredgewidth": 0.9}
        style.draw_markers(axes, [x], [y], marker, colour, 4.0, zorder=5, **options)
    _draw_names(axes, names, drawing.meshes, colours)
    axes.set_axis_off()
    axes.set_title(
        "\n".join([*title, *contact_notes(layout, contact_states)]), fontsize=6 if title else None
    )


def _draw_names(axes: Axes, names: list[str], points: np.ndarray, colours: list[str]):
    """Write mesh names to the left and right of a gear train, with lines to the pitch points.

    `points` are the pitch points, shape (meshes, 2); `names` and `colours` have an entry per mesh.
    Each name is written on the side where its pitch point is.
    """
    (left, right), y_limits = axes.get_xlim(), axes.get_ylim()
    axes.autoscale(enable=False)
    is_left = points[:, 0] < (left + right) / 2.0 - SAME_LENGTH * (right - left)
    columns = (left, (-2, 0), "right center", is_left), (right, (2, 0), "left center", ~is_left)
    for x, offset, anchor, mask in columns:
        meshes = [i for i in np.argsort(points[:, 1], kind="stable") if mask[i]]
        # Names are equidistant and in the vertical order of the points, so that lines do not cross.
        heights = np.linspace(*y_limits, 2 * len(meshes) + 1)[1::2]
        for i, y in zip(meshes, heights, strict=True):
            line, colour = np.array([points[i], (x, y)]), colours[i]
            axes.plot(*line.T, color=colour, linewidth=0.4, zorder=4)
            style.annotate(axes, names[i], (x, y), offset, anchor, color=colour, fontsize=5.5)


def contact_notes(layout: xr.Dataset, contact_states: list[int]) -> list[str]:
    """Return lines of text that explain contact markers and report inconsistent positions.

    `contact_states` contains 1 (drive side), 0 (no contact) or -1 (coast side) for each mesh.
    `layout` is a result of `GearTrain.layout`; its variable misfit is the largest difference, m,
    between positions of the same axis computed along different meshes and shafts.
    """
    notes = [text for state, (_, _, text) in CONTACTS.items() if text and state in contact_states]
    misfit = float(layout.misfit)
    if misfit > SAME_LENGTH * float(layout.body_radius.max()):
        unit_size, unit = style.length_unit(misfit)
        notes.append(f"positions given differ by {misfit / unit_size:.3g} {unit}")
    return notes


def select_phase_and_contact(layout: xr.Dataset, run=None, phase=None) -> tuple:
    """Return the phase to draw, rad, and the contact states of all meshes at this phase.

    Contact states are 1 (drive side), 0 (no contact) and -1 (coast side), or None without a run.
    `run` is a recorded run or a static equilibrium of the train with this `layout`. The default
    phase is the first recorded phase, or 0 without a run. Raise ValueError if the phase is outside
    the record, if the run has failed, or if its meshes differ from those of `layout`.
    """
    if run is None:
        phase = 0.0 if phase is None else phase
        return parameters.check("phase", phase, Angle), None
    if "mesh" not in run.coords or not run.mesh.equals(layout.mesh):
        raise ValueError("run is not allowed: it must have the same meshes as the train")
    if int(run.status):
        raise ValueError(f"run has no contact states to show: {run.status.attrs['message']}")
    if "phase" not in run.contact.dims:
        return float(run.reference_phase), run.contact.values
    start, stop = run.phase.values[[0, -1]]
    allowed = f"from {start:.9g} to {stop:.9g}"
    phase = start if phase is None else parameters.check("phase", phase, Angle)
    checks.require(start <= phase <= stop, "phase", phase, allowed)
    return phase, run.contact.sel(phase=phase, method="nearest").values


@style.rc_context()
def draw_beside(axes: Axes, train, run=None) -> Axes:
    """Widen the figure of `axes` and draw a `GearTrain` on its right; return `axes`.

    If `run` is given and has not failed (`status` is 0), the markers of the meshes show the contact
    states at the first recorded phase.
    """
    grid = axes.figure.add_gridspec(1, 2, width_ratios=(1.0 - _RELATIVE_WIDTH, _RELATIVE_WIDTH))
    axes.set_subplotspec(grid[0])
    width, height = axes.figure.get_size_inches()
    axes.figure.set_size_inches(width / (1.0 - _RELATIVE_WIDTH), height)
    layout = train.layout()
    phase, contact = select_phase_and_contact(
        layout, None if run is None or int(run.status) else run
    )
    title = "meshes of the train" if contact is None else "meshes at the first instant shown"
    draw_schematic(axes.figure.add_subplot(grid[1]), layout, None, phase, contact, title=[title])
    return axes


def draw_train(figure: Figure, data: xr.Dataset, colours=None, below=False) -> Figure | SubFigure:
    """Draw the gear train of a dataset on the right of a figure; return the remaining area.

    If `below` is true, the height of the figure is increased and the train is drawn below. Nothing
    is drawn if `data` does not contain the variables of `GearTrain.layout`. `colours` maps mesh
    names to colours.
    """
    if "pitch_radius" not in data:
        return figure
    if below:
        width, height = figure.get_size_inches()
        figure.set_size_inches(width, height + _HEIGHT_BELOW)
        remaining, train_area = figure.subfigures(2, 1, height_ratios=(height, _HEIGHT_BELOW))
    else:
        width_ratios = (1.0 - _RELATIVE_WIDTH, _RELATIVE_WIDTH)
        remaining, train_area = figure.subfigures(1, 2, width_ratios=width_ratios)
    draw_schematic(train_area.subplots(), data, colours, title=["meshes of the train"])
    return remaining
