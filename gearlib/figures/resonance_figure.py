"""Resonance characteristics: Fig. 3, and the effect of nonlinear damping.

Fig. 3 shows the largest and smallest displacement over the tuning. The upper part is the figure of
the paper, with three axes for the tuning and one for the speed. The lower part has one panel for
each damping with the sweeps from rest, up and down, which show the hysteresis.
"""

import math
import textwrap

import numpy as np
import xarray as xr
from matplotlib.patches import Patch

from gearlib.colours import MOTIONS
from gearlib.figures import measured_figure, panels, style
from gearlib.figures.branches_figure import draw_curve
from gearlib.figures.plot_curves import DIRECTION_LABELS, WARM_STARTED_STYLES

EXTREMA, FORCE = ("displacement_max", "displacement_min"), ("dynamic_force_max",)
EXTREMA_LABEL = "displacement $y_\\mathrm{max}$, $y_\\mathrm{min}$\n(static deflections)"
#: Fraction of all values that is shown if no motion has settled.
SHOWN_FRACTION = 0.95
#: Number of markers along a line.
MARKER_COUNT = 14
FROM_REST_COLOUR, TONGUE_COLOUR = "#8C8C8C", "#F0E44299"
#: Name and colour of each kind of motion, by its code in `gearlib.analysis.trust`.
MOTION_KINDS = tuple(MOTIONS.items())
_MAIN_HEIGHT, _PANEL_HEIGHT, _LEGEND_HEIGHT, _COLUMNS = 5.1, 1.6, 0.4, 2


@style.rc_context()
def draw_resonance(
    resonance, *, colours=None, labels=(), branches=(), tongues=None, measured=(), forces=False
):
    """Return a figure of resonance characteristics, above one panel for each damping.

    A characteristic is the largest and smallest displacement over the tuning (mesh frequency over
    natural frequency). Lines are settled (periodic) motions, markers other motions, carets values
    beyond the axis limits. `resonance` is a dataset over (damping, direction, tuning); `colours`
    maps names of damping combinations to colours. Optional data:

    - `labels`: datasets, one per damping, with the kinds of motion, drawn as a strip of colours;
    - `branches`: datasets, one per damping, with branches of periodic orbits, drawn as thin lines;
    - `tongues`: tuning intervals of instability, drawn as shades;
    - `measured`: measured curves, drawn as points.

    If `forces` is true, a panel of mesh forces is added, and the displacement limits do not include
    coast-side contact.
    """
    resonance = resonance.sortby("tuning")
    from_rest = sweeps_from_rest(resonance)
    curve_styles = style.curve_styles([str(name) for name in resonance.damping.values], colours)
    other_directions = [name for name in resonance.direction.values if name != from_rest.direction]
    with_panels = bool(other_directions or labels or branches or tongues is not None)
    columns = min(_COLUMNS, len(curve_styles))
    rows = math.ceil(len(curve_styles) / columns)
    heights = [_MAIN_HEIGHT + _PANEL_HEIGHT * forces, _PANEL_HEIGHT * rows + _LEGEND_HEIGHT]
    figure = style.page_figure(sum(heights[: 1 + with_panels]))
    upper_area = lower_area = figure
    if with_panels:
        upper_area, lower_area = figure.subfigures(2, 1, height_ratios=heights)
    ratios = [_MAIN_HEIGHT, _PANEL_HEIGHT][: 1 + forces]
    grid = upper_area.subplots(1 + forces, sharex=True, squeeze=False, height_ratios=ratios)
    _draw_characteristics(grid[0, 0], from_rest, curve_styles, measured, coast_side=not forces)
    if forces:
        _draw_forces(grid[1, 0], from_rest, curve_styles, measured)
    if with_panels:
        displacement_limits = _displacement_limits(
            resonance, coast_side=not forces, max_overshoot=0.0
        )
        for number, (name, curve_style) in enumerate(curve_styles.items()):
            axes = lower_area.add_subplot(rows, columns, 1 + number, ylim=displacement_limits)
            if tongues is not None and name in tongues.damping:
                _shade_tongues(axes, tongues.sel(damping=name))
            sweeps, motion_kinds = resonance.sel(damping=name), _find_damping(labels, name)
            _draw_panel(axes, sweeps, curve_style, motion_kinds, _find_damping(branches, name))
            if number >= len(curve_styles) - columns:
                axes.set_xlabel(style.TUNING_LABEL)
            if number % columns == 0:
                axes.set_ylabel(style.DISPLACEMENT_LABEL)
        handles = _legend_handles(from_rest, other_directions, labels, branches, tongues)
        style.add_legend(figure, handles, columns=5, fontsize=6.5, columnspacing=1.2)
    return figure


def sweeps_from_rest(resonance: xr.Dataset) -> xr.Dataset:
    """Return the sweeps whose runs start from rest (direction "cold").

    If there are none, return the sweeps of the first direction.
    """
    directions = resonance.direction.values
    return resonance.sel(direction="cold" if "cold" in directions else directions[0])


def visible_range(sweeps: xr.Dataset, names: tuple, max_overshoot=1.0) -> tuple[float, float]:
    """Return the range (lower, upper) of the variables `names` of sweeps that a figure should show.

    The range includes 0 and all settled (periodic) motions, whose period is above 0. Other motions
    are included if they exceed this range by at most `max_overshoot` times its width; large motions
    of undamped gears never settle. If no motion has settled, the range includes the fraction
    `SHOWN_FRACTION` of all values.
    """
    values = np.concatenate([sweeps[name].values.ravel() for name in names])
    is_settled = np.tile(sweeps.period.values.ravel() > 0, len(names))[np.isfinite(values)]
    values = values[np.isfinite(values)]
    shown = values[is_settled]
    if values.size and not shown.size:
        shown = np.quantile(values, [(1.0 - SHOWN_FRACTION) / 2.0, (1.0 + SHOWN_FRACTION) / 2.0])
    low, high = min([0.0, *shown]), max([0.0, *shown])
    max_distance = (0.5 + max_overshoot) * (high - low)
    shown = values[np.abs(values - (low + high) / 2.0) < max_distance]
    return min([low, *shown]), max([high, *shown])


def _displacement_limits(
    sweeps: xr.Dataset, coast_side: bool, max_overshoot=1.0
) -> tuple[float, float]:
    """Return the axis limits of the displacement in sweeps.

    If `coast_side` is true, they include the displacement at which the coast-side flanks touch,
    unless it is far from all displacements. Motions that are not periodic are included if they
    exceed the range of the periodic ones by at most `max_overshoot` times this range.
    """
    low, high = visible_range(sweeps, EXTREMA, max_overshoot)
    backlash = float(sweeps.backlash_ratio)
    if coast_side and backlash < 2.0 * (high - low):
        low = min(low, -1.25 * backlash)
    return style.axis_limits((low, high))


def _draw_characteristics(axes, sweeps: xr.Dataset, curve_styles: dict, measured, coast_side: bool):
    """Draw the displacement extrema of sweeps for all damping combinations, with measured curves.

    They are drawn over the tuning (mesh frequency over natural frequency). `curve_styles` maps
    names of damping combinations to styles. If `coast_side` is true, the limits include the
    displacement at which the coast-side flanks touch.
    """
    axes.set_xlim(style.axis_limits(sweeps.tuning.values, margin=0.01))
    axes.set_ylim(_displacement_limits(sweeps, coast_side))
    # The names of the areas have no background, which would hide curves.
    options = {"style": "italic", "fontsize": None, "zorder": 5}
    options |= {"coords": ("axes fraction", "data"), "anchor": "center center"}
    areas = style.shade_lost_contact(axes, float(sweeps.backlash_ratio), "y")
    for name, (low, high) in areas.items():
        style.annotate(axes, name, (0.25, 0.5 * (low + high)), **options)
    _draw_dampings(axes, sweeps, curve_styles, EXTREMA, width=1.6)
    handles = axes.get_legend_handles_labels()[0] + measured_figure.draw_curves(
        axes, measured, EXTREMA, curve_styles
    )
    if (sweeps.period.values == 0).any():
        handles.append(style.legend_handle("not settled", "0.3", "none", ".", markersize=3))
    # Undamped motions fill the whole panel, so the legend is placed below.
    style.add_legend(axes.figure, handles, columns=len(handles))
    axes.set(xlabel=style.TUNING_LABEL, ylabel=EXTREMA_LABEL)
    # Three secondary axes are above the panel: the tunings with the natural frequencies at maximum
    # and minimum stiffness, and the speed. Positions are relative to the height of the panel.
    for extremum, position in (("max", 1.0), ("min", 1.1)):
        factor = float(sweeps[f"tuning_factor_{extremum}"])
        label = f"tuning $\\nu_\\mathrm{{{extremum}}}$"
        style.add_secondary_axis(axes, factor, label, position=position)
    speed_per_tuning = float(sweeps.speed[-1] / sweeps.tuning[-1])
    style.add_secondary_axis(axes, speed_per_tuning, panels.axis_label(sweeps.speed), position=1.2)
    style.add_length_axis(axes, float(sweeps.static_deflection), "displacement")


def _draw_forces(axes, sweeps: xr.Dataset, curve_styles: dict, measured):
    """Draw the largest mesh forces of sweeps for all damping combinations, with measured forces.

    They are drawn over the tuning (mesh frequency over natural frequency). `curve_styles` maps
    names of damping combinations to styles. If forces jump with the stiffness, the title warns that
    no dynamic factor K_v can be derived; it is the beginning of the comment of the dataset.
    """
    axes.set_ylim(0.0, 1.05 * visible_range(sweeps, FORCE)[1])
    _draw_dampings(axes, sweeps, curve_styles, FORCE)
    axes.axhline(1.0, color="#8C8C8C", linewidth=0.6, zorder=1)
    axes.set(xlabel=style.TUNING_LABEL, ylabel=panels.axis_label(sweeps[FORCE[0]], width=24))
    warning = sweeps.attrs.get("comment", "").partition(":")[0]
    axes.set_title(textwrap.fill(warning, 70), fontsize="small")
    style.add_secondary_axis(axes, float(sweeps.force_scale) / 1e3, "mesh force (kN)", "right")
    measured_figure.draw_curves(axes, measured, FORCE, curve_styles)


def _draw_dampings(axes, sweeps: xr.Dataset, curve_styles: dict, names: tuple, width=1.0):
    """Draw the variables `names` of sweeps over the tuning, one curve for each damping combination.

    The tuning is the mesh frequency over the natural frequency. `curve_styles` maps names of
    damping combinations to styles; `width` is the line width in points.
    """
    for number, (damping, curve_style) in enumerate(curve_styles.items()):
        label, marker_shift = style.typeset_dampings(damping), number / len(curve_styles)
        sweep = sweeps.sel(damping=damping)
        draw_sweep(axes, sweep, curve_style, marker_shift, names, width, label)


def _find_damping(datasets, damping: str) -> xr.Dataset | None:
    """Return the first of the datasets with the damping combination `damping`, or None."""
    return next((data for data in datasets if data.damping == damping), None)


def _draw_panel(axes, sweeps: xr.Dataset, curve_style: style.CurveStyle, motion_kinds, branches):
    """Draw the sweeps of one damping combination in all directions: from rest, up and down.

    Sweeps from rest are broad and grey, the others have the colour of `curve_style`. `motion_kinds`
    and `branches` are datasets or None: the kind of motion from rest at each tuning (mesh frequency
    over natural frequency), drawn as a strip at the lower edge, and branches of periodic orbits,
    drawn as thin lines.
    """
    axes.set_title(style.typeset_dampings(str(sweeps.damping.item())))
    axes.set_xlim(style.axis_limits(sweeps.tuning.values, margin=0.01))
    style.shade_lost_contact(axes, float(sweeps.backlash_ratio), "y")
    if branches is not None:
        for variable in EXTREMA:
            draw_curve(axes, branches, variable, "black", 0.7, zorder=1.5)
    from_rest = sweeps_from_rest(sweeps)
    draw_sweep(axes, from_rest, style.CurveStyle(FROM_REST_COLOUR, "-", "."), width=3.0)
    other_directions = [name for name in sweeps.direction.values if name != from_rest.direction]
    for number, direction in enumerate(other_directions):
        direction_style = style.CurveStyle(curve_style.colour, *WARM_STARTED_STYLES[direction])
        sweep = sweeps.sel(direction=direction)
        draw_sweep(axes, sweep, direction_style, marker_shift=number / 2)
    if motion_kinds is not None:
        tuning = motion_kinds.tuning.values
        low, high = axes.get_ylim()
        step = np.diff(tuning).min() if tuning.size > 1 else 0.01
        colours = [MOTION_KINDS[code][1] for code in motion_kinds.label.values]
        axes.bar(tuning, 0.04 * (high - low), step, low, color=colours, linewidth=0, zorder=4)


def _shade_tongues(axes, tongues: xr.Dataset):
    """Shade the instability tongues, i.e. tuning intervals with parametric resonance.

    The tuning is the mesh frequency over the natural frequency. Empty tongues are skipped.
    """
    for low, high in zip(tongues.tuning_from.values, tongues.tuning_to.values, strict=True):
        if low < high:
            axes.axvspan(low, high, color=TONGUE_COLOUR, linewidth=0, zorder=0.5)


def _legend_handles(from_rest, other_directions: list[str], motion_kinds, branches, tongues):
    """Return the legend handles that are common to the panels of all damping combinations.

    `from_rest` are the sweeps drawn as broad lines, `other_directions` the directions of the other
    sweeps. `motion_kinds` (motions from rest, classified by a code `label`) and `branches` of
    periodic orbits are sequences of datasets, which may be empty; `tongues` (tuning intervals with
    parametric resonance) is a dataset or None.
    """
    label = DIRECTION_LABELS[from_rest.direction.item()]
    handles = [style.legend_handle(label, FROM_REST_COLOUR, linewidth=3.0)]
    for name in other_directions:
        dashes_and_marker = WARM_STARTED_STYLES[name]
        handles.append(style.legend_handle(DIRECTION_LABELS[name], "black", *dashes_and_marker))
    if branches:
        handles.append(style.legend_handle("stable orbit", linewidth=0.7))
        handles.append(
            style.legend_handle("unstable orbit", line_style=style.DASHED, linewidth=0.7)
        )
    codes = {code for data in motion_kinds for code in data.label.values}
    handles += [
        Patch(facecolor=colour, label=f"from rest: {name}")
        for code, (name, colour) in enumerate(MOTION_KINDS)
        if code in codes
    ]
    if tongues is not None:
        handles.append(Patch(facecolor=TONGUE_COLOUR, label="tongue"))
    return handles


def draw_sweep(axes, sweep, curve_style, marker_shift=0.0, names=EXTREMA, width=1.0, label=None):
    """Draw the variables `names` of one sweep over the tuning, within the limits of the axes.

    The tuning is the mesh frequency over the natural frequency. Settled (periodic) motions are
    drawn as a line, other motions as markers only, values beyond the limits as carets at the
    limits. `marker_shift`, from 0 to 1, moves the markers along the line, so that they do not hide
    those of other curves. `width` is the line width in points, `label` the legend label.
    """
    tuning = sweep.tuning.values
    low, high = axes.get_ylim()
    marker_step = max(1, tuning.size // MARKER_COUNT)
    for name in names:
        values = sweep[name].values
        is_inside = (values >= low) & (values <= high)
        # A line connects adjacent settled motions (period above 0). The array is padded, so that
        # the first and the last tuning also have two neighbours.
        is_settled = np.pad(is_inside & (sweep.period.values > 0), 1)
        has_line = is_settled[1:-1] & (is_settled[:-2] | is_settled[2:])
        line = {
            "color": curve_style.colour,
            "linestyle": curve_style.line_style,
            "linewidth": width,
        }
        line["label"] = label if name == names[0] else None
        markers = {"marker": curve_style.marker, "markersize": 3.5}
        markers["markevery"] = int(marker_shift * marker_step), marker_step
        axes.plot(tuning, np.where(has_line, values, np.nan), **line, **markers)
        # Motions that have not settled are drawn behind the settled ones.
        mask = is_inside & ~has_line
        marker_style = curve_style.marker, curve_style.colour, 1.8
        options = {"markeredgewidth": 0.4, "zorder": 1.8}
        style.draw_markers(axes, tuning[mask], values[mask], *marker_style, **options)
        for limit, mask, caret in ((low, values < low, "v"), (high, values > high, "^")):
            y = np.full(mask.sum(), limit)
            marker_style = caret, curve_style.colour, 2.5
            style.draw_markers(axes, tuning[mask], y, *marker_style, markeredgewidth=0)


@style.rc_context()
def draw_cases(curves: list[xr.Dataset], labels: list[str]):
    """Return a figure of the resonance characteristics of several gear pairs.

    A characteristic is the largest and smallest displacement, or the largest mesh force, over the
    tuning (mesh frequency over natural frequency). `curves` contains the sweeps of each pair, over
    (damping, direction, tuning), and `labels` the names of the pairs. Displacements are in
    micrometres, forces in units of the static load. Each pair has a colour, each damping
    combination a line style.
    """
    figure = style.page_figure(height=6.0)
    displacement_axes, force_axes = figure.subplots(2, 1, sharex=True, height_ratios=[2.0, 1.0])
    sweeps = [_convert_to_micrometres(sweeps_from_rest(data.sortby("tuning"))) for data in curves]
    displacement_axes.set_ylim(
        style.axis_limits(*(visible_range(data, EXTREMA) for data in sweeps))
    )
    force_axes.set_ylim(0.0, 1.05 * max(visible_range(data, FORCE)[1] for data in sweeps))
    cases = zip(sweeps, labels, style.curve_styles(range(len(sweeps))).values(), strict=True)
    for number, (case_sweeps, case, case_style) in enumerate(cases):
        dampings = [str(name) for name in case_sweeps.damping.values]
        curve_styles = style.curve_styles(dampings, dict.fromkeys(dampings, case_style.colour))
        for name, curve_style in curve_styles.items():
            sweep, marker_shift = case_sweeps.sel(damping=name), number / len(sweeps)
            label = case if len(dampings) == 1 else f"{case}, {style.typeset_dampings(name)}"
            draw_sweep(displacement_axes, sweep, curve_style, marker_shift, label=label)
            draw_sweep(force_axes, sweep, curve_style, marker_shift, FORCE)
    displacement_axes.set_ylabel("displacement (µm)")
    force_axes.set_ylabel(panels.axis_label(sweeps[0][FORCE[0]], width=24))
    force_axes.set_xlabel(style.TUNING_LABEL)
    style.add_legend(figure, displacement_axes, columns=3)
    return figure


def _convert_to_micrometres(sweeps: xr.Dataset) -> xr.Dataset:
    """Convert the displacements of sweeps from static deflections to micrometres."""
    micrometres = 1e6 * sweeps.static_deflection
    return sweeps.assign({name: micrometres * sweeps[name] for name in EXTREMA})


#: Height of a panel with a height ratio of 1, inches.
_UNIT_HEIGHT = 2.3


@style.rc_context()
def draw_nonlinear_damping(studies: list[xr.Dataset]):
    """Return a figure of nonlinear damping: resonance sweeps above phase planes.

    `studies` are results of `gearlib.studies.nonlinear_damping.compute_damping_study`, one for each
    power of the velocity in the damping force and each location of the damping (`place`),
    "material" or "oil". Each location is one column; each of the tunings `shown` (mesh frequency
    over natural frequency) is one row of phase planes.
    """
    damping_locations = list(dict.fromkeys(study.place.item() for study in studies))
    tunings = studies[0].shown.values
    height_ratios = [1.4] + [1.0] * tunings.size
    figure = style.page_figure(_UNIT_HEIGHT * sum(height_ratios))
    options = {"squeeze": False, "sharey": "row", "height_ratios": height_ratios}
    grid = figure.subplots(len(height_ratios), len(damping_locations), **options)
    for column, location in zip(grid.T, damping_locations, strict=True):
        studies_of_location = [study for study in studies if study.place.item() == location]
        data = xr.concat(studies_of_location, "power", coords="minimal", compat="override")
        styles = panels.plot_options(data.power)
        _draw_extrema(column[0], data, styles)
        speeds = tunings * float(data.speed[0, -1] / data.tuning[-1])
        labels = panels.format_tunings(tunings, speeds)
        for axes, tuning, label in zip(column[1:], tunings, labels, strict=True):
            _draw_phase_planes(axes, data.sel(shown=tuning), styles)
            axes.set_title(f"tuning ν = {label}, from rest")
    grid[0, 0].set_ylabel("$y_\\mathrm{max}$, $y_\\mathrm{min}$ (static defl.)")
    for axes in grid[1:, 0]:
        axes.set_ylabel(style.VELOCITY_LABEL)
    # Fix the automatic limits, so that shades do not change them.
    grid[0, 0].set_ylim(grid[0, 0].get_ylim())
    for axes in grid[0]:
        style.shade_lost_contact(axes, float(studies[0].backlash_ratio), "y")
    options = {"title": "damping (pale: sweep down)", "title_fontsize": 7.5}
    style.add_legend(figure, panels.legend_handles(styles), columns=len(styles), **options)
    return figure


def _draw_extrema(axes, data: xr.Dataset, styles: dict[str, dict]):
    """Draw the displacement extrema of sweeps up (thin) and down (thick, pale) over the tuning.

    The tuning is the mesh frequency over the natural frequency. `styles` maps each power of the
    velocity in the damping force to options of `Axes.plot`.
    """
    pale = {"linestyle": "-", "linewidth": 2.6, "alpha": 0.3}
    for direction, options in (("down", pale), ("up", {"linewidth": 0.8})):
        for name in EXTREMA:
            sweep = data.sel(direction=direction)
            curve_options = {"colour_dim": "power", "styles": styles} | options
            panels.draw_curves(axes, sweep, "tuning", name, **curve_options)
    axes.set(title=f"damping of the {data.place.item()} only", ylabel="")
    axes.set_xlim(data.tuning[0], data.tuning[-1])
    style.add_secondary_axis(axes, float(data.speed[0, -1] / data.tuning[-1]), "speed (rpm)")


def _draw_phase_planes(axes, data: xr.Dataset, styles: dict[str, dict]):
    """Draw the phase plane (velocity over displacement) of one run for each damping power.

    `styles` maps each power of the velocity in the damping force to options of `Axes.plot`.
    """
    curve_options = {"colour_dim": "power", "styles": styles, "linewidth": 0.8}
    panels.draw_curves(axes, data, "displacement", "velocity", **curve_options)
    style.shade_lost_contact(axes, float(data.backlash_ratio[0]), "x")
    axes.set(ylabel="")
