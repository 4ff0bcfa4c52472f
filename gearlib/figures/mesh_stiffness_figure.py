"""Mesh stiffness of drawn gears by every method: courses, means, uncertainty, published values."""

import math

import numpy as np

from gearlib.figures import style

#: Method of the stiffness -> (words, colour, dashes, marker).
LOOKS = {
    "iso": ("ISO 6336-1", style.PALETTE[1], (0, (5, 1.5)), "s"),
    "energy": ("energy method, one body", style.PALETTE[0], "-", "o"),
    "energy_twice": ("a body for each pair", style.PALETTE[2], (0, (6, 1.5, 1.5, 1.5)), "^"),
    "energy_logarithmic": ("logarithmic contact", style.PALETTE[4], (0, (1.5, 1.2)), "D"),
}
#: Methods with an uncertainty of their own; the others are what makes that of the energy method.
_BANDS = ("iso", "energy")
_UNIT = 1e8


@style.styled()
def draw(stiffness):
    """Draw for each pair the courses over the mesh period, and the means beside them.

    `stiffness` is that of `gearlib.studies.mesh_stiffness.compute`. Bands: the stated
    uncertainty; crosses: published means.
    """
    data = stiffness
    count = data.sizes["pair"]
    rows = -(-count // 2)
    figure = style.page(2.6 * rows + 0.5)
    grid = figure.add_gridspec(rows, min(count, 2))
    for i, pair in enumerate(data.pair.values):
        inner = grid[i // 2, i % 2].subgridspec(1, 2, width_ratios=(3.0, 1.0), wspace=0.0)
        axes = figure.add_subplot(inner[0])
        means = figure.add_subplot(inner[1], sharey=axes)
        _draw_courses(axes, data.sel(pair=pair))
        _draw_means(means, data, pair)
        axes.set_title(pair, loc="left")
        if i % 2 == 0:
            axes.set_ylabel("mesh stiffness, $10^8$ N/m")
        # Room for what lies above and below, whatever the pair.
        low, high = axes.get_ylim()
        axes.set_ylim(max(low, 0.0), high + 0.05 * (high - low))
    style.legend(figure, axes, 4, fontsize=6.5)
    return figure


def _draw_courses(axes, own):
    phase = own.stiffness_phase.values
    for name in own.stiffness_method.values:
        words, colour, dashes, _ = LOOKS[name]
        one = own.sel(stiffness_method=name)
        values = one.mesh_stiffness.values / _UNIT
        if name in _BANDS:
            band = float(one.method_uncertainty)
            axes.fill_between(
                phase, values * (1.0 - band), values * (1.0 + band), color=colour, alpha=0.12, lw=0
            )
        axes.plot(phase, values, color=colour, linestyle=dashes, label=words)
    axes.set_xlim(-math.pi, math.pi)
    axes.set_xticks([-math.pi, 0.0, math.pi], ["$-\\pi$", "0", "$\\pi$"])
    axes.set_xlabel("mesh phase $\\tau$")


def _draw_means(axes, data, pair):
    own = data.sel(pair=pair)
    names = list(own.stiffness_method.values)
    for j, name in enumerate(names):
        _, colour, _, marker = LOOKS[name]
        one = own.sel(stiffness_method=name)
        mean = float(one.mean_mesh_stiffness) / _UNIT
        error = mean * float(one.method_uncertainty) if name in _BANDS else 0.0
        axes.errorbar(j, mean, error, color=colour, marker=marker, markersize=4, capsize=2, lw=0.8)
    there = np.nonzero(data.published_pair.values == pair)[0]
    for k in there:
        value = float(data.published_stiffness[k]) / _UNIT
        axes.plot(len(names), value, "x", color="black", markersize=4)
        words = str(data.published.values[k])
        style.note(axes, words, (len(names), value), (4, 0), fontsize=5.5)
    axes.set_xlim(-0.8, len(names) + (3.6 if there.size else 0.0))
    axes.set_xticks([])
    axes.set_xlabel("means")
    axes.tick_params(labelleft=False)
