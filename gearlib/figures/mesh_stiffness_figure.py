"""Mesh stiffness by every method, with means, uncertainty and published values."""

import math

import xarray as xr

from gearlib.figures import panels, style

#: Methods that are drawn with their uncertainty; the others differ as much as the energy method.
_METHODS_WITH_UNCERTAINTY = ("iso", "energy")
#: Markers of the means by the four methods; room for the names of published values beside them.
_MEAN_MARKERS, _TEXT_ROOM = "so^D", 3.6


@style.styled()
def draw(stiffness: xr.Dataset):
    """Return a figure of mesh stiffness over the mesh period, and of its mean, for each gear pair.

    `stiffness` is a result of `gearlib.studies.gear_geometry.mesh_stiffness`. Bands are the stated
    uncertainty, crosses published means.
    """
    data = stiffness.copy()
    for name in ("mesh_stiffness", "mean_mesh_stiffness", "published_stiffness"):
        data[name] = panels.in_unit(stiffness[name], 1e8, "$10^8$ N/m")
    styles = panels.plot_options(data.stiffness_method)
    count = data.sizes["pair"]
    rows = -(-count // 2)
    figure = style.page_figure(2.6 * rows + 0.5)
    grid = figure.add_gridspec(rows, min(count, 2))
    for i, name in enumerate(data.pair.values):
        cell = grid[i // 2, i % 2].subgridspec(1, 2, width_ratios=(3.0, 1.0), wspace=0.0)
        left, right = cell.subplots(sharey=True)
        pair = data.sel(pair=name)
        handles = _draw_stiffness(left, pair, styles)
        _draw_means(right, pair, styles)
        left.set_title(name, loc="left")
        # The upper limit leaves room for markers and error bars.
        low, high = left.get_ylim()
        left.set_ylim(max(low, 0.0), high + 0.05 * (high - low))
    style.legend(figure, handles, columns=4, fontsize=6.5)
    return figure


def _draw_stiffness(axes, pair: xr.Dataset, styles: dict[str, dict]) -> list:
    """Draw stiffness over the mesh period, a curve per method in `styles`; return handles."""
    for method in _METHODS_WITH_UNCERTAINTY:
        curve = pair.sel(stiffness_method=method)
        low = curve.mesh_stiffness * (1 - curve.method_uncertainty)
        high = curve.mesh_stiffness * (1 + curve.method_uncertainty)
        options = {"color": styles[method]["color"], "alpha": 0.12, "linewidth": 0}
        axes.fill_between(curve.stiffness_phase, low, high, **options)
    curve_options = {"colour": "stiffness_method", "styles": styles}
    handles = panels.draw_curves(axes, pair, "stiffness_phase", "mesh_stiffness", **curve_options)
    axes.set_xlim(-math.pi, math.pi)
    axes.set_xticks([-math.pi, 0.0, math.pi], ["$-\\pi$", "0", "$\\pi$"])
    return handles


def _draw_means(axes, pair: xr.Dataset, styles: dict[str, dict]):
    """Draw the mean stiffness of a pair by the four methods in `styles`, and published means."""
    methods = zip(styles.items(), _MEAN_MARKERS, strict=True)
    for x, ((method, options), marker) in enumerate(methods):
        of_method = pair.sel(stiffness_method=method)
        mean, error = float(of_method.mean_mesh_stiffness), 0.0
        if method in _METHODS_WITH_UNCERTAINTY:
            error = mean * float(of_method.method_uncertainty)
        bar_options = {"color": options["color"], "markersize": 4, "capsize": 2, "lw": 0.8}
        axes.errorbar(x, mean, error, marker=marker, **bar_options)
    published = pair.isel(published=pair.published_pair.values == pair.pair.item())
    x = len(styles)
    for source in published.published.values:
        value = float(published.published_stiffness.sel(published=source))
        axes.plot(x, value, "x", color="black", markersize=4)
        style.annotate(axes, source, (x, value), (4, 0), fontsize=5.5)
    axes.set(xlim=(-0.8, x + (_TEXT_ROOM if published.published.size else 0.0)), xlabel="means")
    axes.set_xticks([])
    axes.tick_params(labelleft=False)
