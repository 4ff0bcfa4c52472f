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


@style.styled()
def order_map(found, *, figure=None, vertical="order", levels=None):
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

    Returns
    -------
    matplotlib.figure.Figure
        With two axes for each direction of the speed: map and overall level.

    Raises
    ------
    ValueError
        If the dataset is no order map of one mesh.
    """
    checks.one_of("vertical", vertical, ("order", "frequency"))
    if getattr(getattr(found, "amplitude", None), "dims", ()) != ("time", "order"):
        raise ValueError(
            "found is not allowed: it must be a dataset of gearlib.order_map, one mesh"
        )
    unit = found.overall.attrs.get("units") or _UNITS[found.attrs["variable"]]
    reference, name = _REFERENCES.get(unit, (1.0, unit))
    power = found.attrs["amplitude"] == "power"
    height = found.amplitude.values / (reference**2 if power else reference)
    with np.errstate(divide="ignore"):
        level = (10.0 if power else 20.0) * np.log10(height)
        overall = 20.0 * np.log10(found.overall.values / reference)
    rpm, order = found.rpm.values, found.order.values
    falls = np.gradient(rpm) < 0.0 if rpm.size > 1 else np.zeros(1, bool)
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
        column[1].set_xlabel("speed (rpm)")
    grid[0, 0].set_ylabel("order" if vertical == "order" else "frequency (Hz)")
    grid[1, 0].set_ylabel(f"overall\n(dB re 1 {name})")
    for right in grid[1, 1:]:
        right.sharey(grid[1, 0])
    kind = found.attrs["amplitude"]
    words = found.attrs["variable"].replace("_", " ")
    figure.colorbar(shown, ax=grid[0], label=f"{words}, {kind}\n(dB re 1 {name})")
    return figure


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
