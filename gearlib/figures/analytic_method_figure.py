"""The analytic method: iterations and range of convergence; errors and resonance curve."""

import numpy as np
from matplotlib.colors import TwoSlopeNorm

from gearlib.figures import style

#: Iterations whose courses are drawn, from light to dark.
_DRAWN = (0, 3, 10, 20, 30)
_GREYS = ("#C8C8C8", "#56B4E9", "#009E73", "#E69F00", "#D55E00")
_METHODS = {
    "balance": ("harmonic balance", "#0072B2", "o"),
    "schmidt": ("E. Schmidt", "#D55E00", "s"),
}
#: Contraction factors are coloured within these.
_LIMITS = (0.01, 10.0)


def draw(data):
    """Draw both figures of `gearlib.studies.analytic_method`; return them by their names."""
    return {"analytic_method": draw_convergence(data), "harmonic_balance": draw_harmonics(data)}


@style.styled()
def draw_convergence(data):
    """Draw iterates, errors, range of convergence of `gearlib.studies.analytic_method.compute`."""
    shown = data.shown.values
    figure = style.page(7.6)
    above, middle, below = figure.subfigures(3, 1, height_ratios=[2.3, 2.0, 3.3])
    top = above.subplots(1, shown.size, squeeze=False)[0]
    turns = data.phase.values / (2.0 * np.pi)
    for i, axes in enumerate(top):
        axes.plot(turns, data.exact_displacement.values[i], color="black", linewidth=2.2)
        for n, colour in zip(_DRAWN, _GREYS, strict=True):
            if n < data.iteration.size:
                course = data.iterate_displacement.values[i, n]
                axes.plot(turns, course, color=colour, linewidth=0.9)
        count = int(data.degenerate_chosen.values[i])
        noun = "harmonic" if count == 1 else "harmonics"
        axes.set_title(f"$\\nu_s$ = {shown[i]:g}, {count} degenerate {noun}")
        axes.set_xlabel("mesh period")
    top[0].set_ylabel("displacement $x$")
    handles = [style.entry("exact orbit", linewidth=2.2)]
    handles += [
        style.entry(f"iteration {n}", colour)
        for n, colour in zip(_DRAWN, _GREYS, strict=True)
        if n < data.iteration.size
    ]
    style.legend(above, handles, 6)
    row = middle.subplots(1, shown.size, squeeze=False, sharey=True)[0]
    for i, axes in enumerate(row):
        error = data.iterate_error.values[i]
        axes.plot(data.iteration.values, error, color="#4D4D4D", linewidth=0.9)
        jumps = data.algebraic_step.values[i].astype(bool)
        axes.plot(data.iteration.values[jumps], error[jumps], "o", color="#D55E00", markersize=3.5)
        axes.set_yscale("log")
        axes.set_xlabel("application of the kernel")
    row[0].set_ylabel("error of $x$")
    words = "a step of the degenerate part follows"
    style.legend(middle, [style.entry(words, "#D55E00", "", "o", markersize=3.5)], 1)
    _draw_range(below, data)
    return figure


def _draw_range(figure, data):
    """Draw contraction factors over tuning and degenerate harmonics."""
    panels = figure.subplots(2, 1, sharex=True)
    norm = TwoSlopeNorm(0.0, *np.log10(_LIMITS))
    tuning, counts = data.tuning.values, data.degenerate_count.values
    for k, axes in enumerate(panels):
        factor = np.log10(np.clip(data.contraction.values[k], *_LIMITS))
        mesh = axes.pcolormesh(tuning, counts, factor, cmap="RdBu_r", norm=norm, rasterized=True)
        done = data.converged.values[k].astype(bool) | np.isnan(factor)
        rows, columns = np.nonzero(~done)
        style.dots(axes, tuning[columns], counts[rows], "x", "black", 3, markeredgewidth=0.7)
        axes.plot(tuning, data.automatic.values[k], color="black", drawstyle="steps-mid")
        axes.set_yticks(counts)
        axes.set_ylim(-0.5, counts[-1] + 0.5)
        axes.set_ylabel("degenerate harmonics")
        axes.set_title("mesh that never loses contact" if k == 0 else "gear pair with backlash")
    panels[-1].set_xlabel(style.TUNING)
    bar = figure.colorbar(mesh, ax=list(panels), ticks=[-2, -1, 0, 1], extend="both")
    bar.ax.set_yticklabels(["0.01", "0.1", "1", "10"])
    bar.set_label("contraction factor of an iteration")
    diverged = style.entry("diverged", line="", marker="x", markersize=4)
    style.legend(figure, [diverged, style.entry("automatic choice")], 2)


@style.styled()
def draw_harmonics(data):
    """Draw errors over the number of harmonics, and the curve of harmonic balance.

    `data` is that of `gearlib.studies.analytic_method.compute`.
    """
    shown = data.shown.values
    figure = style.page(5.4)
    above, below = figure.subfigures(2, 1, height_ratios=[2.4, 3.0])
    row = above.subplots(1, shown.size, squeeze=False, sharey=True)[0]
    for i, axes in enumerate(row):
        for key, (_, colour, marker) in _METHODS.items():
            harmonics = data[f"{key}_harmonics"].values
            face = {"markerfacecolor": colour if key == "balance" else "white", "markersize": 3.5}
            for kind, line in (("displacement", "-"), ("velocity", style.LONG_DASHES)):
                error = data[f"{key}_{kind}_error"].values[i]
                axes.plot(harmonics, error, color=colour, linestyle=line, marker=marker, **face)
        slope = np.array([10.0, 1000.0])
        for power, low, high in ((-2.0, 0.4, 0.6), (-1.0, 1.5, 2.0)):
            axes.plot(slope, low * slope**power, color="#4D4D4D", linewidth=0.7, linestyle=":")
            axes.annotate(f"$h^{{{power:.0f}}}$", (300.0, high * 300.0**power), fontsize=7)
        axes.set_xscale("log")
        axes.set_yscale("log")
        axes.set_title(f"$\\nu_s$ = {shown[i]:g}")
        axes.set_xlabel("harmonics $h$")
    row[0].set_ylabel("largest error over the period")
    handles = [
        style.entry(name, colour, "-", marker, markersize=3.5, markerfacecolor=face)
        for (name, colour, marker), face in zip(
            _METHODS.values(), ("#0072B2", "white"), strict=True
        )
    ]
    handles.append(style.entry("displacement $x$", "#4D4D4D"))
    handles.append(style.entry("$dx/d\\tau$", "#4D4D4D", style.LONG_DASHES))
    style.legend(above, handles, 4)
    _draw_curve(below, data)
    return figure


def _draw_curve(figure, data):
    """Draw extrema of harmonic balance over exact sweeps."""
    axes = figure.subplots()
    tuning = data.tuning.values
    looks = {"up": ("#0072B2", "^"), "down": ("#D55E00", "v")}
    for i, (colour, marker) in enumerate(looks.values()):
        for end in ("max", "min"):
            axes.plot(tuning, data[f"displacement_{end}"].values[i], color=colour, linewidth=0.9)
            found, stable = data[f"balance_{end}"].values[i], data.stable.values[i].astype(bool)
            for chosen, fill in ((stable, colour), (~stable, "white")):
                look = {"markerfacecolor": fill, "markeredgewidth": 0.6}
                style.dots(axes, tuning[chosen], found[chosen], marker, colour, 3, **look)
    style.shade_areas(axes, float(data.backlash_ratio), "y")
    axes.set_xlabel(style.TUNING)
    axes.set_ylabel("extrema of $x$ (static deflections)")
    grey = "#4D4D4D"
    handles = [
        *(style.entry(f"tuning {n}", c, "-", m, markersize=3.5) for n, (c, m) in looks.items()),
        style.entry("line: exact sweep", grey),
        style.entry("mark: harmonic balance", grey, "", "^"),
        style.entry("unstable", grey, "", "^", markerfacecolor="white"),
    ]
    style.legend(figure, handles, 5)
