"""The analytic method: iterations and range of convergence; errors and resonance curve."""

import numpy as np
from matplotlib.colors import TwoSlopeNorm
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

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
    figure = Figure((style.PAGE_WIDTH, 7.6), layout="constrained")
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
    handles = [Line2D([], [], color="black", linewidth=2.2, label="exact orbit")]
    handles += [
        Line2D([], [], color=c, label=f"iteration {n}")
        for n, c in zip(_DRAWN, _GREYS, strict=True)
        if n < data.iteration.size
    ]
    above.legend(handles=handles, loc="outside lower center", ncols=6)
    row = middle.subplots(1, shown.size, squeeze=False, sharey=True)[0]
    for i, axes in enumerate(row):
        error = data.iterate_error.values[i]
        axes.plot(data.iteration.values, error, color="#4D4D4D", linewidth=0.9)
        jumps = data.algebraic_step.values[i].astype(bool)
        axes.plot(data.iteration.values[jumps], error[jumps], "o", color="#D55E00", markersize=3.5)
        axes.set_yscale("log")
        axes.set_xlabel("application of the kernel")
    row[0].set_ylabel("error of $x$")
    dot = Line2D([], [], color="#D55E00", marker="o", linestyle="", markersize=3.5)
    dot.set_label("a step of the degenerate part follows")
    middle.legend(handles=[dot], loc="outside lower center")
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
        axes.plot(
            tuning[columns], counts[rows], "x", color="black", markersize=3, markeredgewidth=0.7
        )
        axes.plot(tuning, data.automatic.values[k], color="black", drawstyle="steps-mid")
        axes.set_yticks(counts)
        axes.set_ylim(-0.5, counts[-1] + 0.5)
        axes.set_ylabel("degenerate harmonics")
        axes.set_title("mesh that never loses contact" if k == 0 else "gear pair with backlash")
    panels[-1].set_xlabel("tuning $\\nu_s$")
    bar = figure.colorbar(mesh, ax=list(panels), ticks=[-2, -1, 0, 1], extend="both")
    bar.ax.set_yticklabels(["0.01", "0.1", "1", "10"])
    bar.set_label("contraction factor of an iteration")
    handles = [
        Line2D([], [], color="black", marker="x", linestyle="", markersize=4, label="diverged"),
        Line2D([], [], color="black", label="automatic choice"),
    ]
    figure.legend(handles=handles, loc="outside lower center", ncols=2)


@style.styled()
def draw_harmonics(data):
    """Draw errors over the number of harmonics, and the curve of harmonic balance.

    `data` is that of `gearlib.studies.analytic_method.compute`.
    """
    shown = data.shown.values
    figure = Figure((style.PAGE_WIDTH, 5.4), layout="constrained")
    above, below = figure.subfigures(2, 1, height_ratios=[2.4, 3.0])
    row = above.subplots(1, shown.size, squeeze=False, sharey=True)[0]
    for i, axes in enumerate(row):
        for key, (_, colour, marker) in _METHODS.items():
            harmonics = data[f"{key}_harmonics"].values
            for kind, line in (("displacement", "-"), ("velocity", (0, (5, 1.5)))):
                error = data[f"{key}_{kind}_error"].values[i]
                axes.plot(
                    harmonics,
                    error,
                    color=colour,
                    linestyle=line,
                    marker=marker,
                    markersize=3.5,
                    markerfacecolor=colour if key == "balance" else "white",
                )
        slope = np.array([10.0, 1000.0])
        axes.plot(slope, 0.4 * slope**-2.0, color="#4D4D4D", linewidth=0.7, linestyle=":")
        axes.annotate("$h^{-2}$", (300.0, 0.6 * 300.0**-2.0), fontsize=7)
        axes.plot(slope, 1.5 * slope**-1.0, color="#4D4D4D", linewidth=0.7, linestyle=":")
        axes.annotate("$h^{-1}$", (300.0, 2.0 / 300.0), fontsize=7)
        axes.set_xscale("log")
        axes.set_yscale("log")
        axes.set_title(f"$\\nu_s$ = {shown[i]:g}")
        axes.set_xlabel("harmonics $h$")
    row[0].set_ylabel("largest error over the period")
    handles = [
        Line2D([], [], color=c, marker=m, markersize=3.5, label=name, markerfacecolor=f)
        for (name, c, m), f in zip(_METHODS.values(), ("#0072B2", "white"), strict=True)
    ]
    handles += [
        Line2D([], [], color="#4D4D4D", label="displacement $x$"),
        Line2D([], [], color="#4D4D4D", linestyle=(0, (5, 1.5)), label="$dx/d\\tau$"),
    ]
    above.legend(handles=handles, loc="outside lower center", ncols=4)
    _draw_curve(below, data)
    return figure


def _draw_curve(figure, data):
    """Draw extrema of harmonic balance over exact sweeps."""
    axes = figure.subplots()
    tuning = data.tuning.values
    for i, (colour, marker) in enumerate((("#0072B2", "^"), ("#D55E00", "v"))):
        for exact, balance in (
            ("displacement_max", "balance_max"),
            ("displacement_min", "balance_min"),
        ):
            axes.plot(tuning, data[exact].values[i], color=colour, linewidth=0.9)
            found, stable = data[balance].values[i], data.stable.values[i].astype(bool)
            for chosen, fill in ((stable, colour), (~stable, "white")):
                axes.plot(
                    tuning[chosen],
                    found[chosen],
                    marker,
                    color=colour,
                    markersize=3,
                    markerfacecolor=fill,
                    markeredgewidth=0.6,
                )
    style.shade_areas(axes, float(data.backlash_ratio), "y")
    axes.set_xlabel("tuning $\\nu_s$")
    axes.set_ylabel("extrema of $x$ (static deflections)")
    handles = [
        Line2D([], [], color=c, marker=m, markersize=3.5, label=f"tuning {name}")
        for name, c, m in (("up", "#0072B2", "^"), ("down", "#D55E00", "v"))
    ]
    handles.append(Line2D([], [], color="#4D4D4D", label="line: exact sweep"))
    handles.append(
        Line2D([], [], color="#4D4D4D", marker="^", linestyle="", label="mark: harmonic balance")
    )
    handles.append(
        Line2D(
            [],
            [],
            color="#4D4D4D",
            marker="^",
            markerfacecolor="white",
            linestyle="",
            label="unstable",
        )
    )
    figure.legend(handles=handles, loc="outside lower center", ncols=5)
