"""Order maps: level in dB over speed and order or frequency, the overall level beneath."""

import numpy as np

from gearlib import checks
from gearlib.figures import style

#: Units of the variables -> (their value in SI, their name): levels are in dB re 1 of them.
_REFERENCES = {"m": (1e-6, "µm"), "N": (1.0, "N"), "m s-1": (1.0, "m/s"), "m s-2": (1.0, "m/s²")}
#: Of variables of a run-up whose dataset has lost its units.
_UNITS = {"displacement": "m", "dynamic_force": "N", "velocity": "m s-1", "acceleration": "m s-2"}
#: Levels this far below the highest are one colour, dB.
_RANGE = 80.0
_MESH_ORDERS = 3
#: Circles of a measured map on each of them.
_CIRCLES = 30


@style.styled()
def order_map(found, *, figure=None, vertical="order", levels=None, measured=None):
    """Draw an order map as it is read at the rig: runs up and down side by side.

    Mesh orders z, 2z, ... are lines with their names, thinner ones their sidebands z - 1, z + 1 and
    the subharmonic z/2. Beneath stands the overall level.

    Parameters
    ----------
    found : xarray.Dataset
        Of `gearlib.order_map`; of a train one mesh of it.
    figure : matplotlib.figure.Figure, optional
    vertical : {"order", "frequency"}
    levels : tuple of float, optional
        Lowest and highest level, dB; by default 80 dB from the highest down.
    measured : xarray.Dataset, optional
        Order map of the same variable of a rig: circles on the mesh orders, in the colours of their
        levels, which vanish where both agree, and dots for the overall level.

    Returns
    -------
    matplotlib.figure.Figure
        With two axes for each direction of the speed: map and overall level.

    Raises
    ------
    ValueError
        If a dataset is no order map of one mesh, or the measured one of another variable.
    """
    checks.one_of("vertical", vertical, ("order", "frequency"))
    for name, one in (("found", found), ("measured", found if measured is None else measured)):
        if getattr(getattr(one, "amplitude", None), "dims", ()) != ("time", "order"):
            raise ValueError(
                f"{name} is not allowed: it must be a dataset of gearlib.order_map, one mesh"
            )
        for key in ("variable", "amplitude"):
            if one.attrs[key] != found.attrs[key]:
                raise checks.refusal(f"measured.{key}", one.attrs[key], repr(found.attrs[key]))
    unit = found.overall.attrs.get("units") or _UNITS[found.attrs["variable"]]
    reference, name = _REFERENCES.get(unit, (1.0, unit))
    power = found.attrs["amplitude"] == "power"

    def read(one):
        """Return (levels, overall levels, rpm, where the speed falls)."""
        height, rpm = one.amplitude.values / (reference**2 if power else reference), one.rpm.values
        with np.errstate(divide="ignore"):
            level = (10.0 if power else 20.0) * np.log10(height)
            overall = 20.0 * np.log10(one.overall.values / reference)
        return level, overall, rpm, np.gradient(rpm) < 0.0 if rpm.size > 1 else np.zeros(1, bool)

    level, overall, rpm, falls = read(found)
    order = found.order.values
    ways = [(mask, words) for mask, words in ((~falls, "up"), (falls, "down")) if mask.any()]
    high = level[:, 1:].max() if levels is None else levels[1]
    low = high - _RANGE if levels is None else levels[0]
    if figure is None:
        from matplotlib import pyplot

        figure = pyplot.figure(figsize=(2.7 * len(ways) + 1.0, 3.8), layout="constrained")
    grid = figure.subplots(2, len(ways), squeeze=False, sharex=True, height_ratios=(3, 1))
    for column, (mask, words) in zip(grid.T, ways, strict=True):
        at = np.argsort(rpm[mask])
        speed, part = rpm[mask][at], np.clip(level[mask][at, 1:], low, high)
        scale = speed[:, None] / 60.0 if vertical == "frequency" else np.ones((speed.size, 1))
        shown = column[0].pcolormesh(
            np.broadcast_to(speed[:, None], part.shape),
            scale * order[1:],
            part,
            cmap="magma",
            vmin=low,
            vmax=high,
            shading="nearest",
            rasterized=True,
        )
        _lines(column[0], float(found.teeth), speed, order[-1], vertical)
        column[0].set_title(f"speed goes {words}")
        column[1].plot(speed, overall[mask][at], color="C0")
        if measured is not None:
            _lay_over(column, measured, read(measured), words == "down", vertical, (low, high))
        column[1].set_xlabel("speed (rpm)")
    grid[0, 0].set_ylabel("order" if vertical == "order" else "frequency (Hz)")
    grid[1, 0].set_ylabel(f"overall\n(dB re 1 {name})")
    for right in grid[1, 1:]:
        right.sharey(grid[1, 0])
    kind = found.attrs["amplitude"]
    words = found.attrs["variable"].replace("_", " ")
    figure.colorbar(shown, ax=grid[0], label=f"{words}, {kind}\n(dB re 1 {name})")
    return figure


def _lay_over(column, measured, levels, falls, vertical, ends):
    """Lay a measured map over one direction of another."""
    level, overall, rpm, down = levels
    at = np.flatnonzero(down == falls)
    at = at[np.argsort(rpm[at])]
    few = at[:: -(-at.size // _CIRCLES)] if at.size else at
    scale = rpm[few] / 60.0 if vertical == "frequency" else np.ones(few.size)
    for k in range(1, _MESH_ORDERS + 1):
        number = k * float(measured.teeth)
        i = int(np.abs(measured.order.values - number).argmin())
        if abs(measured.order.values[i] - number) < 1e-6:
            shown = np.clip(level[few, i], *ends)
            look = {"cmap": "magma", "vmin": ends[0], "vmax": ends[1], "edgecolors": "white"}
            column[0].scatter(rpm[few], scale * number, 12.0, shown, lw=0.4, zorder=3, **look)
    style.dots(column[1], rpm[at], overall[at], ".", "#8C8C8C", 2.0, zorder=1, label="measured")


def _lines(axes, teeth, speed, highest, vertical):
    """Draw and name the mesh orders, their sidebands, the subharmonic."""
    ends = speed[[0, -1]]
    scale = ends / 60.0 if vertical == "frequency" else np.ones(2)
    named = {"z/2": 0.5 * teeth}
    for k in range(1, _MESH_ORDERS + 1):
        named["z" if k == 1 else f"{k}z"] = k * teeth
    for name, order in named.items():
        if order > highest:
            continue
        axes.plot(ends, scale * order, color="white", lw=0.5, alpha=0.6, label=name)
        end = scale[-1] * order
        axes.annotate(name, (ends[-1], end), (2, 0), textcoords="offset points", fontsize=6)
        for side in (-1.0, 1.0) if name != "z/2" else ():
            if order + side <= highest:
                look = {"color": "white", "lw": 0.4, "ls": ":", "alpha": 0.6}
                axes.plot(ends, scale * (order + side), label=f"{name} {side:+.0f}", **look)
