"""Fig. 3: resonance characteristics, the largest and smallest displacement over the tuning.

Above, the paper's picture, with its three scales of tuning and the speed. Below, a panel for each
damping: the sweeps up and down over the one from rest, so that the hysteresis shows.
"""

import numpy as np
import xarray as xr
from matplotlib.patches import Patch

from gearlib.figures import measured_figure, panels, style
from gearlib.figures.branches_figure import draw_curve
from gearlib.figures.plot_curves import CARRIED, DIRECTIONS

EXTREMA, FORCE = ("displacement_max", "displacement_min"), ("dynamic_force_max",)
EXTREMA_LABEL = "displacement $y_\\mathrm{max}$, $y_\\mathrm{min}$\n(static deflections)"
#: Share of the motions within the limits of a picture where no motion has settled.
SHOWN_SHARE = 0.95
#: Symbols along a line: enough to recognise it, few enough to see through.
SYMBOLS = 14
COLD_COLOUR, TONGUE_COLOUR = "#8C8C8C", "#F0E44299"
#: Code of `gearlib.analysis.trust` -> (name, colour).
MOTIONS = (
    ("periodic", "#009E73"),
    ("quasi-periodic", "#56B4E9"),
    ("chaotic", "#D55E00"),
    ("undecided", "#CC79A7"),
    ("unbounded", "#999999"),
)
_MAIN_HEIGHT, _PANEL_HEIGHT, _FOOT, _COLUMNS = 4.8, 1.6, 0.4, 2


@style.styled()
def draw(
    resonance, *, colours=None, labels=(), branches=(), tongues=None, measured=(), forces=False
):
    """Return a figure of resonance characteristics: a dataset over (damping, direction, tuning).

    `colours` maps dampings to colours. `labels`, datasets of `gearlib.analysis.trust.scan`, are
    drawn as a strip, `branches`, of `gearlib.studies.resonance`, as thin lines, `tongues` as
    shades, `measured` curves as points. `forces` adds a panel of mesh forces and leaves the far
    flank out. Lines are settled motions, symbols others; a caret marks values beyond the limits.
    """
    resonance = resonance.sortby("tuning")
    main = sweeps_from_rest(resonance)
    looks = style.looks([str(name) for name in resonance.damping.values], colours)
    others = [name for name in resonance.direction.values if name != main.direction]
    with_panels = bool(others or labels or branches or tongues is not None)
    columns = min(_COLUMNS, len(looks))
    rows = -(-len(looks) // columns)
    heights = [_MAIN_HEIGHT + _PANEL_HEIGHT * forces, _PANEL_HEIGHT * rows + _FOOT]
    figure = style.page(sum(heights[: 1 + with_panels]))
    above, below = figure.subfigures(2, 1, height_ratios=heights) if with_panels else (figure, None)
    ratios = [_MAIN_HEIGHT, _PANEL_HEIGHT][: 1 + forces]
    grid = above.subplots(1 + forces, sharex=True, squeeze=False, height_ratios=ratios)
    _draw_characteristics(grid[0, 0], main, looks, measured, far_flank=not forces)
    if forces:
        _draw_forces(grid[1, 0], main, looks, measured)
    if with_panels:
        limits = _limits(resonance, far_flank=not forces, beyond=0.0)
        for number, (name, look) in enumerate(looks.items()):
            axes = below.add_subplot(rows, columns, 1 + number, ylim=limits)
            if tongues is not None and name in tongues.damping:
                _shade_tongues(axes, tongues.sel(damping=name))
            own_labels, own_branches = _of_damping(labels, name), _of_damping(branches, name)
            _draw_panel(axes, resonance.sel(damping=name), look, own_labels, own_branches)
            if number >= len(looks) - columns:
                axes.set_xlabel(style.TUNING)
            if number % columns == 0:
                axes.set_ylabel(style.SHORT_DISPLACEMENT)
        handles = _entries(main, others, labels, branches, tongues)
        style.legend(figure, handles, 5, fontsize=6.5, columnspacing=1.2)
    return figure


def sweeps_from_rest(resonance: xr.Dataset) -> xr.Dataset:
    """Return the sweeps from rest ("cold"), or of the first direction if there are none."""
    directions = resonance.direction.values
    return resonance.sel(direction="cold" if "cold" in directions else directions[0])


def shown_range(sweeps: xr.Dataset, names: tuple, beyond=1.0) -> tuple[float, float]:
    """Return the (lower, upper) end of the variables `names` of sweeps to be shown, 0 included.

    All settled motions are shown, and others up to `beyond` times their range outside it: motions
    of an undamped mesh that never settle would flatten the picture.
    """
    values = np.concatenate([sweeps[name].values.ravel() for name in names])
    settled = np.tile(sweeps.period.values.ravel() > 0, len(names))[np.isfinite(values)]
    values = values[np.isfinite(values)]
    shown = values[settled]
    if values.size and not shown.size:
        shown = np.quantile(values, [(1.0 - SHOWN_SHARE) / 2.0, (1.0 + SHOWN_SHARE) / 2.0])
    low, high = min([0.0, *shown]), max([0.0, *shown])
    near = values[np.abs(values - (low + high) / 2.0) < (0.5 + beyond) * (high - low)]
    return min([low, *near]), max([high, *near])


def _limits(sweeps: xr.Dataset, far_flank: bool, beyond=1.0) -> tuple[float, float]:
    """Return axis limits of displacement, with `far_flank` also of back-side contact if near."""
    low, high = shown_range(sweeps, EXTREMA, beyond)
    backlash = float(sweeps.backlash_ratio)
    if far_flank and backlash < 2.0 * (high - low):
        low = min(low, -1.25 * backlash)
    return style.limits((low, high))


def _draw_characteristics(axes, sweeps: xr.Dataset, looks: dict, measured, far_flank: bool):
    """Draw displacements of all dampings, keys of `looks`, with all scales, and measured curves.

    `far_flank` includes the displacement of back-side contact in the limits.
    """
    axes.set_xlim(style.limits(sweeps.tuning.values, margin=0.01))
    axes.set_ylim(_limits(sweeps, far_flank))
    for name, (low, high) in style.shade_areas(axes, float(sweeps.backlash_ratio), "y").items():
        point, of = (0.99, 0.5 * (low + high)), ("axes fraction", "data")
        options = {"style": "italic", "fontsize": None, "zorder": 5}
        style.note(axes, name, point, side="right center", of=of, white=(0.2, 0.8), **options)
    _draw_dampings(axes, sweeps, looks, EXTREMA, width=1.6)
    handles = axes.get_legend_handles_labels()[0] + measured_figure.draw_curves(
        axes, measured, EXTREMA
    )
    if (sweeps.period.values == 0).any():
        handles.append(style.entry("not settled", "0.3", "none", ".", markersize=3))
    axes.legend(handles=handles, loc="upper right", ncols=2)
    axes.set(xlabel=style.TUNING, ylabel=EXTREMA_LABEL)
    for index, position in (("max", 1.0), ("min", 1.115)):
        factor, label = sweeps[f"tuning_factor_{index}"], f"tuning $\\nu_\\mathrm{{{index}}}$"
        style.second_scale(axes, float(factor), label, position=position)
    rate = float(sweeps.speed[-1] / sweeps.tuning[-1])
    style.second_scale(axes, rate, panels.axis_label(sweeps.speed), position=1.23)
    style.length_scale(axes, float(sweeps.static_deflection), "displacement")


def _draw_forces(axes, sweeps: xr.Dataset, looks: dict, measured):
    """Draw the largest mesh forces of all dampings, keys of `looks`, and the measured ones."""
    axes.set_ylim(0.0, 1.05 * shown_range(sweeps, FORCE)[1])
    _draw_dampings(axes, sweeps, looks, FORCE)
    axes.axhline(1.0, color="#8C8C8C", linewidth=0.6, zorder=1)
    axes.set(xlabel=style.TUNING, ylabel=panels.axis_label(sweeps[FORCE[0]], 24))
    title = "rectangular stiffness: the force jumps by 1/κ at every speed, it is not a $K_v$"
    axes.set_title(title, fontsize="small")
    style.second_scale(axes, float(sweeps.force_scale) / 1e3, "mesh force (kN)", "right")
    measured_figure.draw_curves(axes, measured, FORCE)


def _draw_dampings(axes, sweeps: xr.Dataset, looks: dict, names: tuple, width=1.0):
    """Draw the variables `names` of sweeps over the tuning for all dampings, keys of `looks`."""
    for number, (name, look) in enumerate(looks.items()):
        label, shift = style.damping_label(name), number / len(looks)
        draw_sweep(axes, sweeps.sel(damping=name), look, shift, names, width, label)


def _of_damping(datasets, name: str) -> xr.Dataset | None:
    """Return the dataset of the damping `name` among datasets, None if there is none."""
    return next((data for data in datasets if data.damping == name), None)


def _draw_panel(axes, sweeps: xr.Dataset, look: style.Look, labels, branches):
    """Draw the sweeps of one damping in all directions, in the colour of `look`.

    `branches` of orbits and `labels` of motions, drawn as a strip, are datasets or None.
    """
    axes.set_title(style.damping_label(str(sweeps.damping.item())))
    axes.set_xlim(style.limits(sweeps.tuning.values, margin=0.01))
    style.shade_areas(axes, float(sweeps.backlash_ratio), "y")
    for name in EXTREMA if branches is not None else ():
        draw_curve(axes, branches, name, "black", 0.7, zorder=1.5)
    main = sweeps_from_rest(sweeps)
    draw_sweep(axes, main, style.Look(COLD_COLOUR, "-", "."), width=3.0)
    others = [name for name in sweeps.direction.values if name != main.direction]
    for number, name in enumerate(others):
        direction_look = style.Look(look.colour, *CARRIED[name])
        draw_sweep(axes, sweeps.sel(direction=name), direction_look, number / 2)
    if labels is not None:
        tuning, (low, high) = labels.tuning.values, axes.get_ylim()
        step = np.diff(tuning).min() if tuning.size > 1 else 0.01
        colours = [MOTIONS[code][1] for code in labels.label.values]
        axes.bar(tuning, 0.04 * (high - low), step, low, color=colours, linewidth=0, zorder=4)


def _shade_tongues(axes, tongues: xr.Dataset):
    """Shade the tongues of parametric resonance, from `tuning_from` to `tuning_to`."""
    for low, high in zip(tongues.tuning_from.values, tongues.tuning_to.values, strict=True):
        if low < high:
            axes.axvspan(low, high, color=TONGUE_COLOUR, linewidth=0, zorder=0.5)


def _entries(main: xr.Dataset, others: list[str], labels, branches, tongues) -> list:
    """Return legend handles for the panels of dampings.

    `main` are the sweeps drawn broad, `others` names of other directions; see `draw` for the rest.
    """
    handles = [style.entry(DIRECTIONS[main.direction.item()], COLD_COLOUR, linewidth=3.0)]
    handles += [style.entry(DIRECTIONS[name], "black", *CARRIED[name]) for name in others]
    if branches:
        handles.append(style.entry("stable orbit", linewidth=0.7))
        handles.append(style.entry("unstable orbit", line=style.DASHED, linewidth=0.7))
    codes = {code for data in labels for code in data.label.values}
    handles += [
        Patch(facecolor=colour, label=f"from rest: {name}")
        for code, (name, colour) in enumerate(MOTIONS)
        if code in codes
    ]
    if tongues is not None:
        handles.append(Patch(facecolor=TONGUE_COLOUR, label="tongue"))
    return handles


def draw_sweep(
    axes, sweep: xr.Dataset, look: style.Look, shift=0.0, names=EXTREMA, width=1.0, label=None
):
    """Draw the variables `names` of one sweep over its tunings, within the limits of the axes.

    `shift`, from 0 to 1, moves the symbols along the line, so that they do not cover those of other
    curves; `width` is the line's, in points, `label` the legend's.
    """
    tuning, (low, high) = sweep.tuning.values, axes.get_ylim()
    step = max(1, tuning.size // SYMBOLS)
    for name in names:
        values = sweep[name].values
        inside = (values >= low) & (values <= high)
        # A line joins two neighbours that have both settled.
        settled = np.pad(inside & (sweep.period.values > 0), 1)
        linked = settled[1:-1] & (settled[:-2] | settled[2:])
        axes.plot(
            tuning,
            np.where(linked, values, np.nan),
            color=look.colour,
            linestyle=look.line,
            linewidth=width,
            marker=look.marker,
            markersize=3.5,
            markevery=(int(shift * step), step),
            label=label if name == names[0] else None,
        )
        # Many motions that have not settled would hide the settled ones: they lie behind them.
        single, thin = inside & ~linked, {"markeredgewidth": 0.4, "zorder": 1.8}
        style.dots(axes, tuning[single], values[single], look.marker, look.colour, 1.8, **thin)
        for limit, beyond, caret in ((low, values < low, "v"), (high, values > high, "^")):
            edge = np.full(beyond.sum(), limit)
            style.dots(axes, tuning[beyond], edge, caret, look.colour, 2.5, markeredgewidth=0)


@style.styled()
def draw_cases(curves: list[xr.Dataset], labels: list[str]):
    """Return a figure of the resonance characteristics of several gears, one dataset each.

    Displacements are in micrometres, mesh forces in static loads. Gears differ in colour and have
    `labels`; their dampings differ in dashes.
    """
    figure = style.page(6.0)
    above, below = figure.subplots(2, 1, sharex=True, height_ratios=[2.0, 1.0])
    mains = [_in_micrometres(sweeps_from_rest(data.sortby("tuning"))) for data in curves]
    above.set_ylim(style.limits(*(shown_range(main, EXTREMA) for main in mains)))
    below.set_ylim(0.0, 1.05 * max(shown_range(main, FORCE)[1] for main in mains))
    for number, (main, case) in enumerate(zip(mains, labels, strict=True)):
        colour = style.PALETTE[number % len(style.PALETTE)]
        for name, look in style.looks([str(name) for name in main.damping.values]).items():
            sweep, shift = main.sel(damping=name), number / len(mains)
            look = style.Look(colour, look.line, look.marker)
            label = f"{case}, {style.damping_label(name)}" if main.damping.size > 1 else case
            draw_sweep(above, sweep, look, shift, label=label)
            draw_sweep(below, sweep, look, shift, FORCE)
    above.set_ylabel("displacement (µm)")
    below.set_ylabel(panels.axis_label(mains[0][FORCE[0]], 24))
    below.set_xlabel(style.TUNING)
    style.legend(figure, above, 3)
    return figure


def _in_micrometres(sweeps: xr.Dataset) -> xr.Dataset:
    """Return sweeps with displacements in micrometres instead of static deflections."""
    micrometres = 1e6 * sweeps.static_deflection
    return sweeps.assign({name: micrometres * sweeps[name] for name in EXTREMA})
