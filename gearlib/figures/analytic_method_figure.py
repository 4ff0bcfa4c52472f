"""The analytic method: iterations and convergence, errors and resonance curve."""

import numpy as np
import xarray as xr
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure

from gearlib.figures import panels, style

_GREY = "#4D4D4D"
#: Number of an iteration that is drawn -> its colour.
_ITERATION_COLOURS = {0: "#C8C8C8", 3: "#56B4E9", 10: "#009E73", 20: "#E69F00", 30: "#D55E00"}
#: Method -> (name, colour, marker, face colour of the marker).
_METHODS = {
    "balance": ("harmonic balance", "#0072B2", "o", "#0072B2"),
    "schmidt": ("E. Schmidt", "#D55E00", "s", "white"),
}
_DASHES = {"displacement": "-", "velocity": style.LONG_DASHES}
_CONTACT_LOSS_TITLES = ("mesh that never loses contact", "gear pair with backlash")
_DIRECTIONS = {"up": ("#0072B2", "^"), "down": ("#D55E00", "v")}


def draw(data: xr.Dataset) -> dict[str, Figure]:
    """Return the figures of convergence and of harmonics of the analytic method, by name.

    The method computes periodic orbits by iterating on their Fourier coefficients. `data` is a
    result of `gearlib.studies.analytic_method.analytic_method_study`.
    """
    return {"analytic_method": draw_convergence(data), "harmonic_balance": draw_harmonics(data)}


@style.rc_context()
def draw_convergence(data: xr.Dataset):
    """Return a figure of iterates of the analytic method, their errors, and contraction factors.

    The method iterates on the Fourier coefficients of an orbit. Each tuning (mesh frequency over
    natural frequency) in the dimension "shown" has its own panel. Circles mark iterates followed by
    a Newton step (`algebraic_step` = 1), which solves for the degenerate (near-resonant) harmonics.
    `data` is a result of `gearlib.studies.analytic_method.analytic_method_study`.
    """
    figure = style.page_figure(height=7.6)
    areas = figure.subfigures(3, 1, height_ratios=[2.3, 2.0, 3.3])
    _draw_iterates(areas[0], data)
    options = {"panel_dim": "shown", "figure": areas[1]}
    error_axes = panels.draw_panels(data, "iteration", "iterate_error", **options)
    for i, axes in enumerate(error_axes[0]):
        error = data.iterate_error[i].where(data.algebraic_step[i] == 1)
        label = "a Newton step of the degenerate part follows"
        style.draw_markers(axes, data.iteration, error, "o", "#D55E00", 3.5, label=label)
        axes.set(yscale="log", title="")
    style.add_legend(areas[1], error_axes[0, 0], columns=1)
    _draw_contraction(areas[2], data)
    return figure


def _draw_iterates(figure, data: xr.Dataset):
    """Draw iterates of the analytic method and the exact orbit, with one panel for each tuning.

    The tunings (mesh frequency over natural frequency) are those of the dimension "shown" of
    `data`; the iterations are the keys of `_ITERATION_COLOURS`. Titles state the number of
    degenerate (near-resonant) harmonics.
    """
    iterations = [number for number in _ITERATION_COLOURS if number in data.iteration]
    styles = {n: {"color": _ITERATION_COLOURS[n], "label": f"iteration {n}"} for n in iterations}
    options = {"panel_dim": "shown", "colour_dim": "iteration", "styles": styles, "figure": figure}
    data = panels.phase_to_mesh_periods(data)
    grid = panels.draw_panels(data, "phase", "iterate_displacement", **options)
    for i, axes in enumerate(grid[0]):
        line_options = {"color": "black", "linewidth": 2.2, "zorder": 1, "label": "exact orbit"}
        axes.plot(data.phase, data.exact_displacement[i], **line_options)
        count = int(data.degenerate_chosen[i])
        axes.set_title(f"{axes.get_title()}\ndegenerate harmonics: {count}")
        axes.set_ylabel(panels.axis_label(data.exact_displacement, width=24) if i == 0 else "")


def _draw_contraction(figure, data: xr.Dataset):
    """Draw maps of the contraction factor over the tuning and the number of degenerate harmonics.

    The contraction factor is the factor by which one iteration changes a small error; the tuning is
    the mesh frequency over the natural frequency. Harmonics are degenerate if they are near
    resonance. The stepped line is the number of degenerate harmonics that gearlib chooses
    automatically. The upper map is for gears that never lose contact, the lower for gears with
    backlash.
    """
    grid = figure.subplots(2, 1, sharex=True)
    counts = data.degenerate_count.values
    for k, (axes, title) in enumerate(zip(grid, _CONTACT_LOSS_TITLES, strict=True)):
        case = data.isel(contact_loss=k)
        options = {"cmap": "RdBu_r", "norm": LogNorm(0.01, 100.0), "rasterized": True}
        image = axes.pcolormesh(data.tuning, counts, case.contraction, **options)
        # Crosses mark iterations that diverged although their contraction factor is known.
        rows, columns = np.nonzero((case.converged == 0) & case.contraction.notnull())
        options = {"markeredgewidth": 0.7, "label": "diverged"}
        tunings = data.tuning.values[columns]
        style.draw_markers(axes, tunings, counts[rows], "x", "black", 3, **options)
        steps = {"color": "black", "drawstyle": "steps-mid", "label": "automatic choice"}
        panels.draw_curves(axes, case, "tuning", "automatic", **steps)
        axes.set(yticks=counts, ylim=(-0.5, counts[-1] + 0.5), title=title)
        axes.set_ylabel(panels.axis_label(data.degenerate_count))
        axes.label_outer()
    label = "contraction factor of an iteration"
    figure.colorbar(image, ax=list(grid), extend="both", label=label)
    style.add_legend(figure, grid[0], columns=2)


@style.rc_context()
def draw_harmonics(data: xr.Dataset):
    """Return a figure of errors over the number of harmonics, above a harmonic-balance curve.

    Each tuning (mesh frequency over natural frequency) in the dimension "shown" has its own panel
    of errors. The resonance curve shows the displacement extrema of harmonic balance and of exact
    sweeps. `data` is a result of `gearlib.studies.analytic_method.analytic_method_study`.
    """
    figure = style.page_figure(height=5.4)
    error_area, resonance_area = figure.subfigures(2, 1, height_ratios=[2.4, 3.0])
    error_axes = error_area.subplots(1, data.sizes["shown"], squeeze=False, sharey=True)[0]
    for i, axes in enumerate(error_axes):
        _draw_errors(axes, data.isel(shown=i))
        axes.label_outer()
    handles = [
        style.legend_handle(name, colour, "-", marker, markersize=3.5, markerfacecolor=face)
        for name, colour, marker, face in _METHODS.values()
    ]
    handles += [
        style.legend_handle(quantity, _GREY, dashes) for quantity, dashes in _DASHES.items()
    ]
    style.add_legend(error_area, handles, columns=4)
    _draw_resonance(resonance_area, data)
    return figure


def _draw_errors(axes, data: xr.Dataset):
    """Draw the errors of harmonic balance and E. Schmidt's method over the number h of harmonics.

    `data` belongs to one tuning (mesh frequency over natural frequency) and contains errors of
    displacement and velocity. Dotted lines show the slopes of 1/h^2 and 1/h.
    """
    for method, (_, colour, marker, face) in _METHODS.items():
        options = {"color": colour, "marker": marker, "markerfacecolor": face, "markersize": 3.5}
        for quantity, dashes in _DASHES.items():
            names = f"{method}_harmonics", f"{method}_{quantity}_error"
            panels.draw_curves(axes, data, *names, linestyle=dashes, **options)
    line_ends = np.array([10.0, 1000.0])
    for exponent, line_factor, text_factor in ((-2.0, 0.4, 0.6), (-1.0, 1.5, 2.0)):
        errors = line_factor * line_ends**exponent
        axes.plot(line_ends, errors, color=_GREY, linewidth=0.7, linestyle=":")
        axes.annotate(f"$h^{{{exponent:.0f}}}$", (300.0, text_factor * 300.0**exponent), fontsize=7)
    axes.set(xscale="log", yscale="log", title=panels.value_label(data.shown))
    axes.set(xlabel="harmonics $h$", ylabel="largest error over the period")


def _draw_resonance(figure, data: xr.Dataset):
    """Draw the displacement extrema of harmonic balance (markers) and of exact sweeps (lines).

    They are drawn over the tuning (mesh frequency over natural frequency), for increasing and
    decreasing tuning. Open markers are unstable orbits.
    """
    axes = figure.subplots()
    for direction, (colour, marker) in _DIRECTIONS.items():
        sweep = data.sel(direction=direction)
        for extremum in ("max", "min"):
            axes.plot(data.tuning, sweep[f"displacement_{extremum}"], color=colour, linewidth=0.9)
            for stable, face in ((1, colour), (0, "white")):
                extrema = sweep[f"balance_{extremum}"].where(sweep.stable == stable)
                options = {"markerfacecolor": face, "markeredgewidth": 0.6}
                style.draw_markers(axes, data.tuning, extrema, marker, colour, 3, **options)
    style.shade_lost_contact(axes, float(data.backlash_ratio), "y")
    axes.set_xlabel(panels.axis_label(data.tuning))
    axes.set_ylabel("extrema of the displacement\n(static deflections)")
    handles = [
        style.legend_handle(f"tuning {name}", colour, "-", marker, markersize=3.5)
        for name, (colour, marker) in _DIRECTIONS.items()
    ]
    handles += [
        style.legend_handle("line: exact sweep", _GREY),
        style.legend_handle("marker: harmonic balance", _GREY, "", "^"),
        style.legend_handle("unstable", _GREY, "", "^", markerfacecolor="white"),
    ]
    style.add_legend(figure, handles, columns=5)
