"""Fig. 3: resonance characteristics, the largest and smallest displacement over the tuning.

Above, the paper's picture alone, with its three scales of tuning and the speed. Below, one panel
for each damping: the sweeps up and down over the cold one, so that the hysteresis shows, and what
else is known of the motions.
"""

import numpy as np
from matplotlib.patches import Patch

from gearlib.figures import measured_figure, style
from gearlib.figures.branches_figure import draw_curve

#: The picture holds all steady orbits and this share of the others; chaotic orbits of an undamped
#: mesh are now and then ten times larger than the rest, and would flatten it.
SHOWN_SHARE = 0.95

#: Symbols along a line: enough to recognise it, few enough to see through.
SYMBOLS = 14

EXTREMA, FORCE = ("displacement_max", "displacement_min"), ("dynamic_force_max",)
_MAIN_HEIGHT, _PANEL_HEIGHT, _FOOT, _COLUMNS = 4.4, 1.8, 0.4, 2
_Y_LABEL = r"$y_\mathrm{max}$, $y_\mathrm{min}$ (static deflections)"

#: How sweeps that carry their state are told apart, and from the cold one below them.
CARRIED = {"up": ("-", ">"), "down": ((0, (3, 1)), "<")}
DIRECTIONS = {"cold": "from rest", "up": "tuning going up", "down": "tuning going down"}
COLD_COLOUR = "#8C8C8C"

#: Where the motion without loss of contact is unstable.
TONGUE_COLOUR = "#F0E44299"

#: In the order of the codes of `gearlib.analysis.trust`.
_LABEL_COLOURS = (
    ("periodic", "#009E73"),
    ("quasi-periodic", "#56B4E9"),
    ("chaotic", "#D55E00"),
    ("undecided", "#CC79A7"),
    ("unbounded", "#999999"),
)
#: So many of them are explained even where they do not occur.
_ALWAYS = 4


@style.styled()
def draw(
    resonance, *, colours=None, labels=(), branches=(), tongues=None, measured=(), forces=False
):
    """Draw resonance characteristics.

    resonance (as gathered: displacement_max and displacement_min in static deflections, period, all
    over (damping, direction, tuning); speed (rpm) over tuning; the scalars static_deflection (m),
    backlash_ratio, tuning_factor_max and tuning_factor_min); colours: colours of the dampings by
    name; labels (for each damping its label over the tuning, as in `gearlib.analysis.trust.scan`,
    for cold runs: a strip on the lower rim of its panel); branches (for each damping its branches
    of periodic orbits, as in `gearlib.studies.resonance_branches.compute`: thin lines in its panel,
    solid where stable, dashed where unstable); tongues (tuning_from and tuning_to over (damping,
    order) as in `gearlib.studies.contact_loss`: shades in the panel of each damping); measured
    (curves of `gearlib.studies.measured_comparison`: points over the paper's picture); forces
    (whether dynamic_force_max has a panel below the displacements, whose limits then are those of
    the curves that settle: the paper's picture goes down to the far flank).

    Lines are motions that have settled on a periodic orbit, symbols are the others. What lies
    beyond the picture is marked by a caret on its rim. Runs that could not go on (NaN) are left
    out.
    """
    resonance = resonance.sortby("tuning")
    labels, branches = _by_damping(labels), _by_damping(branches)
    looks = style.looks([str(name) for name in resonance.damping.values], colours)
    directions = [str(name) for name in resonance.direction.values]
    main_direction = "cold" if "cold" in directions else directions[0]
    carried = [name for name in directions if name != main_direction]
    beside = [one for one in (carried, labels, branches, tongues) if one is not None and len(one)]
    columns = min(_COLUMNS, len(looks))
    rows = -(-len(looks) // columns) if beside else 0
    main = resonance.sel(direction=main_direction)
    limits = displacement_limits(main, flank=not forces)

    heights = [_MAIN_HEIGHT, *[_PANEL_HEIGHT] * (forces + rows)]
    figure = style.page(sum(heights) + (_FOOT if rows else 0.0))
    grid = figure.add_gridspec(len(heights), _COLUMNS, height_ratios=heights)
    axes = figure.add_subplot(grid[0, :])
    _prepare(axes, resonance, limits, named=True)
    _draw_all(axes, main, looks, measured_figure.draw_curves(axes, measured, EXTREMA))
    _add_scales(axes, resonance)
    axes.set_ylabel(_Y_LABEL)
    if forces:
        below = figure.add_subplot(grid[1, :], sharex=axes)
        _draw_forces(below, main, looks)
        measured_figure.draw_curves(below, measured, FORCE)
    if rows:
        panels = (
            grid[1 + forces :, :]
            .subgridspec(rows, columns)
            .subplots(sharex=True, sharey=True, squeeze=False)
        )
        for panel in panels.flat[len(looks) :]:
            panel.remove()
        limits = (
            displacement_limits(resonance, flank=False) if forces else _wider(limits, resonance)
        )
        for panel, (name, look) in zip(panels.flat, looks.items(), strict=False):
            _prepare(panel, resonance, limits)
            _draw_branches(panel, branches, name)
            _draw_hysteresis(panel, resonance.sel(damping=name), look, main_direction, carried)
            panel.set_title(style.damping_label(name))
            if name in labels:
                _mark_labels(panel, labels[name])
            if tongues is not None and name in tongues.damping.values:
                shade_tongues(panel, tongues.sel(damping=name))
        handles = _handles(main_direction, carried, labels, branches, tongues)
        style.legend(figure, handles, 5, fontsize=6.5, columnspacing=1.2)
        # The lowest ones: the last row may be short.
        for panel in panels.flat[: len(looks)][-columns:]:
            panel.set_xlabel(style.TUNING)
            panel.tick_params(labelbottom=True)
        for panel in panels[:, 0]:
            panel.set_ylabel(style.SHORT_DISPLACEMENT)
    return figure


def _by_damping(datasets):
    return {str(one.damping.values): one for one in datasets}


def displacement_limits(curves, flank=True):
    """Return the limits (low, high) of displacement for the curves of one direction.

    flank: whether the far flank is taken in where it does not make the picture much higher, and
    most motions that do not settle, as the paper has them.
    """
    low, high = extent(curves, EXTREMA, settled=not flank)
    backlash = float(curves.backlash_ratio)
    if flank and backlash < 2.0 * (high - low):
        low = min(low, -1.25 * backlash)
    margin = 0.05 * (high - low) or 1.0
    return low - margin, high + margin


def extent(curves, names, settled=False):
    """Return the lowest and the highest value to show, 0 among them.

    settled: whether motions that have settled decide, where there are any.
    """
    shown = [0.0]
    for name in names:
        values = curves[name].values
        finite = np.isfinite(values)
        steady = finite & (curves.period.values > 0)
        shown += [*values[steady]]
        if finite.any() and not (settled and steady.any()):
            rest = (1.0 - SHOWN_SHARE) / 2.0
            shown += [*np.quantile(values[finite], [rest, 1.0 - rest])]
    low, high = min(shown), max(shown)
    # What has not settled yet is seen as well, up to as far again beyond.
    span, damped = high - low, _settling(curves)
    rest = np.concatenate([damped[name].values.ravel() for name in names])
    rest = rest[(rest > low - span) & (rest < high + span)]
    return min([low, *rest]), max([high, *rest])


def _settling(curves):
    """Return the curves of the dampings with which some motions settle, all where none does."""
    if "damping" not in curves.period.dims:
        return curves
    others = [dim for dim in curves.period.dims if dim != "damping"]
    some = np.nonzero((curves.period > 0).any(others).values)[0]
    return curves.isel(damping=some) if some.size else curves


def _wider(limits, curves):
    """Return limits that also hold the motions up to nearly as far again beyond them.

    Sweeps that carry their state go where none from rest does; undamped ones, whose motions never
    settle, without bound.
    """
    low, high = limits
    span, damped = high - low, _settling(curves)
    extrema = np.array([damped[name].values for name in EXTREMA])
    near = (extrema > low - 0.9 * span) & (extrema < high + 0.9 * span)
    shown = extrema[near]
    margin = 0.05 * span
    return min([low, *(shown - margin)]), max([high, *(shown + margin)])


def _prepare(axes, resonance, limits, named=False):
    """Give an axes its limits, its areas and, if wanted, their names."""
    tuning = resonance.tuning.values
    margin = 0.01 * (tuning[-1] - tuning[0]) or 0.05
    axes.set_xlim(tuning[0] - margin, tuning[-1] + margin)
    axes.set_ylim(*limits)
    areas = style.shade_areas(axes, float(resonance.backlash_ratio), "y")
    if named:
        for name, (low, high) in areas.items():
            at, of = (0.99, 0.5 * (low + high)), ("axes fraction", "data")
            look = {"style": "italic", "fontsize": None, "zorder": 5}
            style.note(axes, name, at, side="right center", of=of, white=(0.2, 0.8), **look)


def _draw_all(axes, curves, looks, handles):
    """Draw the curves of all dampings; handles: what the legend explains beside them."""
    handles = list(handles)
    for number, (name, look) in enumerate(looks.items()):
        curve = curves.sel(damping=name)
        offset = number / len(looks)
        draw_sweep(axes, curve, look.colour, look.line, look.marker, offset, width=1.6)
        label = style.damping_label(name)
        entry = style.entry(label, look.colour, look.line, look.marker, markersize=4)
        handles.insert(number, entry)
    if (curves.period.values == 0).any():
        handles.append(style.entry("not settled", "0.3", "none", ".", markersize=3))
    axes.legend(handles=handles, loc="upper right", ncols=2)


def _draw_forces(axes, curves, looks):
    """Draw the largest mesh force of all dampings, over the load and in newtons."""
    top = 1.05 * extent(curves, FORCE, settled=True)[1]
    axes.set_ylim(0.0, top)
    for number, (name, look) in enumerate(looks.items()):
        offset = number / len(looks)
        one = curves.sel(damping=name)
        draw_sweep(axes, one, look.colour, look.line, look.marker, offset, names=FORCE)
    axes.axhline(1.0, color="#8C8C8C", linewidth=0.6, zorder=1)
    axes.set_xlabel(style.TUNING)
    axes.set_ylabel("mesh force over load")
    note = "rectangular stiffness: the force jumps by 1/κ at every speed, it is not a $K_v$"
    axes.set_title(note, fontsize="small")
    scale = axes.secondary_yaxis("right", functions=_scaling(float(curves.force_scale) / 1e3))
    scale.set_ylabel("mesh force (kN)")


def _draw_hysteresis(axes, curves, look, main_direction, carried):
    """Draw the sweeps of one damping: those that carry their state over the main one."""
    main = curves.sel(direction=main_direction)
    draw_sweep(axes, main, COLD_COLOUR, "-", ".", 0.0, width=3.0)
    for number, name in enumerate(carried):
        line, marker = CARRIED[name]
        draw_sweep(axes, curves.sel(direction=name), look.colour, line, marker, number / 2)


def _draw_branches(axes, branches, name):
    """Draw the branches of one damping, if there are any, behind everything else."""
    if name in branches:
        for variable in EXTREMA:
            draw_curve(axes, branches[name], variable, "black", 0.7, zorder=1.5)


def _handles(main_direction, carried, labels, branches, tongues):
    """Return what the legend of the panels explains."""
    handles = [style.entry(DIRECTIONS[main_direction], COLD_COLOUR, linewidth=3.0)]
    handles += [style.entry(DIRECTIONS[name], "black", *CARRIED[name]) for name in carried]
    if branches:
        handles.append(style.entry("stable orbit", linewidth=0.7))
        handles.append(style.entry("unstable orbit", line=style.DASHED, linewidth=0.7))
    if labels:
        met = {int(code) for one in labels.values() for code in one.label.values}
        shown = [
            named for code, named in enumerate(_LABEL_COLOURS) if code in {*range(_ALWAYS), *met}
        ]
        handles += [Patch(facecolor=c, label=f"from rest: {n}") for n, c in shown]
    if tongues is not None:
        handles.append(Patch(facecolor=TONGUE_COLOUR, label="tongue"))
    return handles


def _mark_labels(axes, labels):
    """Draw a strip on the lower rim, in the colours of the labels."""
    tuning, low = labels.tuning.values, axes.get_ylim()[0]
    height = 0.04 * (axes.get_ylim()[1] - low)
    step = np.diff(tuning).min() if tuning.size > 1 else 0.01
    colours = [_LABEL_COLOURS[code][1] for code in labels.label.values]
    axes.bar(tuning, height, step, low, color=colours, linewidth=0, zorder=4)


def shade_tongues(axes, tongues):
    """Shade the tunings of parametric resonance: tuning_from and tuning_to over order."""
    for low, high in zip(tongues.tuning_from.values, tongues.tuning_to.values, strict=True):
        if low < high:
            axes.axvspan(low, high, color=TONGUE_COLOUR, linewidth=0, zorder=0.5)


def draw_sweep(axes, curve, colour, line, marker, offset, width=1.0, names=EXTREMA):
    """Draw the largest and smallest displacement, or others, of one sweep over its tunings.

    `offset`, from 0 to 1, shifts the symbols, so that curves on top of each other alternate.
    """
    tuning = curve.tuning.values
    low, high = axes.get_ylim()
    every = max(1, tuning.size // SYMBOLS)
    for name in names:
        values = curve[name].values
        with np.errstate(invalid="ignore"):
            inside = (values >= low) & (values <= high)
        linked = where_linked(inside & (curve.period.values > 0))
        axes.plot(
            tuning,
            np.where(linked, values, np.nan),
            color=colour,
            linestyle=line,
            linewidth=width,
            marker=marker,
            markersize=3.5,
            markevery=(int(offset * every), every),
        )
        single = inside & ~linked
        # Behind the orbits that repeat, which a cloud of these would hide.
        look = {"markeredgewidth": 0.4, "zorder": 1.8}
        style.dots(axes, tuning[single], values[single], marker, colour, 1.8, **look)
        for rim, beyond, caret in ((low, values < low, "v"), (high, values > high, "^")):
            rims = np.full(beyond.sum(), rim)
            style.dots(axes, tuning[beyond], rims, caret, colour, 2.5, markeredgewidth=0)


def where_linked(good):
    """Return where a point has a good neighbour and is good itself: what a line can show."""
    padded = np.pad(good, 1)
    return good & (padded[:-2] | padded[2:])


def _add_scales(axes, resonance):
    """Add tunings towards C_max and C_min and speeds above, displacements in SI on the right."""
    axes.set_xlabel(style.TUNING)
    for index, position in (("max", 1.0), ("min", 1.11)):
        factor = float(resonance[f"tuning_factor_{index}"])
        scale = axes.secondary_xaxis(position, functions=_scaling(factor))
        scale.set_xlabel(f"tuning $\\nu_\\mathrm{{{index}}}$")
    rate = float(resonance.speed[-1] / resonance.tuning[-1])
    scale = axes.secondary_xaxis(1.22, functions=_scaling(rate))
    scale.set_xlabel("speed (rpm)")
    deflection = float(resonance.static_deflection)
    unit, name = style.length_unit(deflection)
    scale = axes.secondary_yaxis("right", functions=_scaling(deflection / unit))
    scale.set_ylabel(_Y_LABEL.replace("static deflections", name))


def _scaling(factor):
    """Return the functions that multiply and divide by `factor`."""
    return (lambda value: value * factor), (lambda value: value / factor)
