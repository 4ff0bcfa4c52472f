"""The analytic method: iterations and range of convergence; errors and resonance curve."""

import numpy as np
import xarray as xr
from matplotlib.colors import TwoSlopeNorm

from gearlib.figures import panels, style

_GREY = "#4D4D4D"
#: Iterations whose courses are drawn, and their colours; -1 is the exact orbit.
_COURSES = {-1: "black", 0: "#C8C8C8", 3: "#56B4E9", 10: "#009E73", 20: "#E69F00", 30: "#D55E00"}
#: Method -> (words, colour, marker, face of the marker).
_METHODS = {
    "balance": ("harmonic balance", "#0072B2", "o", "#0072B2"),
    "schmidt": ("E. Schmidt", "#D55E00", "s", "white"),
}
_DASHES = {"displacement": "-", "velocity": style.LONG_DASHES}
_DIRECTIONS = {"up": ("#0072B2", "^"), "down": ("#D55E00", "v")}
#: Contraction factors are coloured within these.
_LIMITS = (0.01, 10.0)


def draw(data):
    """Draw both figures of `gearlib.studies.analytic_method`; return them by their names."""
    return {"analytic_method": draw_convergence(data), "harmonic_balance": draw_harmonics(data)}


@style.styled()
def draw_convergence(data):
    """Draw iterates, errors, range of convergence of `gearlib.studies.analytic_method.compute`."""
    figure = style.page(7.6)
    above, middle, below = figure.subfigures(3, 1, height_ratios=[2.3, 2.0, 3.3])
    _draw_courses(above, data)
    grid = panels.draw_panels(data, "iteration", "iterate_error", panel="shown", figure=middle)
    marks = {"marker": "o", "color": "#D55E00", "markersize": 3.5}
    for i, axes in enumerate(grid[0]):
        steps = data.isel(shown=i, iteration=data.algebraic_step.values[i].astype(bool))
        axes.plot(steps.iteration, steps.iterate_error, linestyle="none", **marks)
        axes.set(yscale="log", title="")
    words = "a step of the degenerate part follows"
    style.legend(middle, [style.entry(words, marks.pop("color"), "none", **marks)], 1)
    _draw_range(below, data)
    return figure


def _draw_courses(figure, data):
    """Draw iterates over the exact orbit, a panel for each tuning."""
    exact = data.exact_displacement.expand_dims(iteration=[-1])
    courses = xr.concat([exact, data.iterate_displacement], "iteration")
    courses = panels.in_mesh_periods(data.drop_dims("iteration").assign(courses=courses))
    styles = {
        n: {"color": colour, "linewidth": 0.9, "label": f"iteration {n}"}
        for n, colour in _COURSES.items()
        if n in courses.iteration
    }
    styles[-1] |= {"linewidth": 2.2, "label": "exact orbit"}
    told = {"panel": "shown", "colour": "iteration", "styles": styles}
    grid = panels.draw_panels(courses, "phase", "courses", figure=figure, **told)
    for axes, count in zip(grid[0], data.degenerate_chosen.values, strict=True):
        axes.set_title(f"{axes.get_title()}, degenerate harmonics: {count:.0f}")


def _draw_range(figure, data):
    """Draw contraction factors over tuning and degenerate harmonics."""
    grid = figure.subplots(2, 1, sharex=True)
    norm = TwoSlopeNorm(0.0, *np.log10(_LIMITS))
    tuning, counts = data.tuning.values, data.degenerate_count.values
    for k, axes in enumerate(grid):
        factor = np.log10(np.clip(data.contraction.values[k], *_LIMITS))
        shades = axes.pcolormesh(tuning, counts, factor, cmap="RdBu_r", norm=norm, rasterized=True)
        diverged = ~data.converged.values[k].astype(bool) & np.isfinite(factor)
        rows, columns = np.nonzero(diverged)
        style.dots(axes, tuning[columns], counts[rows], "x", "black", 3, markeredgewidth=0.7)
        axes.plot(tuning, data.automatic.values[k], color="black", drawstyle="steps-mid")
        axes.set_yticks(counts)
        axes.set(ylim=(-0.5, counts[-1] + 0.5), ylabel=panels.axis_label(data.degenerate_count))
        axes.set_title("mesh that never loses contact" if k == 0 else "gear pair with backlash")
    grid[-1].set_xlabel(panels.axis_label(data.tuning))
    bar = figure.colorbar(shades, ax=list(grid), ticks=[-2, -1, 0, 1], extend="both")
    bar.ax.set_yticklabels(["0.01", "0.1", "1", "10"])
    bar.set_label("contraction factor of an iteration")
    diverged = style.entry("diverged", line="", marker="x", markersize=4)
    style.legend(figure, [diverged, style.entry("automatic choice")], 2)


@style.styled()
def draw_harmonics(data):
    """Draw errors over the number of harmonics, and the curve of harmonic balance.

    `data` is that of `gearlib.studies.analytic_method.compute`.
    """
    figure = style.page(5.4)
    above, below = figure.subfigures(2, 1, height_ratios=[2.4, 3.0])
    row = above.subplots(1, data.sizes["shown"], squeeze=False, sharey=True)[0]
    for i, axes in enumerate(row):
        _draw_errors(axes, data.isel(shown=i))
        axes.label_outer()
    handles = [
        style.entry(name, colour, "-", marker, markersize=3.5, markerfacecolor=face)
        for name, colour, marker, face in _METHODS.values()
    ]
    handles += [style.entry(kind, _GREY, dashes) for kind, dashes in _DASHES.items()]
    style.legend(above, handles, 4)
    _draw_resonance(below, data)
    return figure


def _draw_errors(axes, data):
    """Draw the errors of both methods at one tuning over their harmonics, with slopes."""
    for method, (_, colour, marker, face) in _METHODS.items():
        look = {"color": colour, "marker": marker, "markerfacecolor": face, "markersize": 3.5}
        for kind, dashes in _DASHES.items():
            names = f"{method}_harmonics", f"{method}_{kind}_error"
            panels.draw_curves(axes, data, *names, linestyle=dashes, **look)
    harmonics = np.array([10.0, 1000.0])
    for power, low, high in ((-2.0, 0.4, 0.6), (-1.0, 1.5, 2.0)):
        axes.plot(harmonics, low * harmonics**power, color=_GREY, linewidth=0.7, linestyle=":")
        axes.annotate(f"$h^{{{power:.0f}}}$", (300.0, high * 300.0**power), fontsize=7)
    axes.set(xscale="log", yscale="log", title=panels.value_label(data.shown))
    axes.set(xlabel="harmonics $h$", ylabel="largest error over the period")


def _draw_resonance(figure, data):
    """Draw extrema of harmonic balance over exact sweeps."""
    axes = figure.subplots()
    stable = data.stable.astype(bool)
    for i, (colour, marker) in enumerate(_DIRECTIONS.values()):
        for end in ("max", "min"):
            axes.plot(data.tuning, data[f"displacement_{end}"][i], color=colour, linewidth=0.9)
            for chosen, face in ((stable, colour), (~stable, "white")):
                extrema = data[f"balance_{end}"].where(chosen)[i]
                look = {"markerfacecolor": face, "markeredgewidth": 0.6}
                style.dots(axes, data.tuning, extrema, marker, colour, 3, **look)
    style.shade_areas(axes, float(data.backlash_ratio), "y")
    axes.set_xlabel(panels.axis_label(data.tuning))
    axes.set_ylabel("extrema of the displacement\n(static deflections)")
    handles = [
        style.entry(f"tuning {name}", colour, "-", marker, markersize=3.5)
        for name, (colour, marker) in _DIRECTIONS.items()
    ]
    handles += [
        style.entry("line: exact sweep", _GREY),
        style.entry("mark: harmonic balance", _GREY, "", "^"),
        style.entry("unstable", _GREY, "", "^", markerfacecolor="white"),
    ]
    style.legend(figure, handles, 5)
