"""Dynamic factor over speed: exact sweeps up and down beside the curve of ISO 6336-1, method B."""

import numpy as np

from gearlib.data.lost_contact import lost_share
from gearlib.figures import style

_TITLES = {
    "iso": "mesh stiffness after ISO 6336-1",
    "energy": "mesh stiffness by the energy method",
}
#: Of perfect teeth, of teeth that deviate to either side.
_COLOURS = ("#000000", "#0072B2", "#D55E00")
_LINES = {"up": "-", "down": (0, (3, 1))}
_MARKS = {"up": "^", "down": "v"}
_STANDARD = "#009E73"
#: Heights of the strips of lost contact, shares of a panel, and where the lowest lies.
_STRIP, _LOWEST = 0.025, 0.02


@style.styled()
def draw(factors):
    """Draw a panel for each method of the mesh stiffness, of `gearlib.studies.dynamic_factor`.

    Triangles: jumps; strips above the lower edge: speeds at which contact is lost.
    """
    data = factors
    figure = style.page(3.6)
    grid = figure.subplots(1, data.sizes["stiffness_method"], sharex=True, squeeze=False)[0]
    ratio = data.resonance_ratio.values
    for axes, method in zip(grid, data.stiffness_method.values, strict=True):
        shown = data.sel(stiffness_method=method)
        for j, colour in enumerate(_COLOURS):
            _draw_sweeps(axes, shown.isel(tooth_deviation=j), colour, _LOWEST + j * _STRIP)
        for j, dashes in ((0, (0, (1, 1))), (1, "-")):
            standard = data.standard_factor.values[j]
            axes.plot(ratio, standard, color=_STANDARD, linestyle=dashes, linewidth=1.6)
        axes.set_title(_TITLES[method])
        axes.set_xlabel("$N$, speed over resonance speed of the standard")
        axes.grid(linewidth=0.3, color="0.85")
        # Room for the strips.
        axes.set_ylim(0.2, None)
        style.add_scale(axes, ratio, data.speed.values, "speed of the pinion (rpm)")
    grid[0].set_ylabel("dynamic factor $K_v$")
    grid[0].set_xlim(ratio[0], ratio[-1])
    style.legend(figure, _legend(data), 4, fontsize=6.5)
    return figure


def _draw_sweeps(axes, data, colour, height):
    """Draw the sweeps of one kind of teeth, their jumps, and where contact is lost."""
    ratio = data.resonance_ratio.values
    lost = np.zeros(ratio.size, bool)
    for direction, dashes in _LINES.items():
        one = data.sel(direction=direction)
        factor, jumps = one.dynamic_factor.values, one.jumps.values.astype(bool)
        axes.plot(ratio, factor, color=colour, linestyle=dashes, linewidth=0.9)
        style.dots(axes, ratio[jumps], factor[jumps], _MARKS[direction], colour, 4, zorder=3)
        lost |= lost_share(one.fraction_normal.values) > 0.0
    strip, across = np.where(lost, height, np.nan), axes.get_xaxis_transform()
    axes.plot(ratio, strip, color=colour, linewidth=1.5, transform=across)


def _legend(data):
    micrometres = 1e6 * abs(float(data.tooth_deviation[1]))
    deviations = (f"deviation {sign}{micrometres:.1f} µm" for sign in "+−")
    return [
        *map(style.entry, ("perfect teeth", *deviations), _COLOURS),
        style.entry("ISO 6336-1, method B", _STANDARD, linewidth=1.6),
        style.entry("the same, perfect teeth", _STANDARD, (0, (1, 1)), linewidth=1.6),
        *(style.entry(f"speed {way}, jump", "0.4", _LINES[way], _MARKS[way]) for way in _LINES),
        style.entry("contact lost", "0.4", linewidth=1.5),
    ]
