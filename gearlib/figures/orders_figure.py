"""Order spectra: amplitudes over the orders of a shaft, tooth-passing harmonics named."""

import numpy as np

from gearlib import checks
from gearlib.figures import plot_curves, style

#: Of the largest amplitude: what is smaller is not drawn.
_FLOOR = 1e-6
#: Tooth-passing harmonics that are named, as many as stand side by side.
_NAMED = 10


@style.styled()
def orders(*spectra, axes=None, labels=None, variable="force_amplitude"):
    """Draw order spectra: amplitudes over the orders, tooth-passing harmonics named.

    The mean, order 0, is left out, and what is below a millionth of the largest amplitude.

    Parameters
    ----------
    *spectra : xarray.Dataset
        Of `gearlib.orders`; each mesh of a train is a colour.
    axes : matplotlib.axes.Axes, optional
    labels : sequence of str, optional
        Of the datasets.
    variable : {"force_amplitude", "error_amplitude"}

    Returns
    -------
    matplotlib.axes.Axes

    Raises
    ------
    ValueError
        If a dataset is no order spectrum, or has no such amplitude.
    """
    checks.one_of("variable", variable, ("force_amplitude", "error_amplitude"))
    parts = plot_curves.parts("orders", spectra, labels, (variable, "mesh_order"), "orders")
    axes, own = plot_curves.axes(axes)
    most = max(float(one[variable][1:].max()) for _, _, one in parts)
    force = variable == "force_amplitude"
    unit, name = (1.0, "N") if force else style.length_unit(most)
    for (label, look), (_, _, one) in zip(plot_curves.looks(parts), parts, strict=True):
        _draw_lines(axes, one, variable, 1.0 / unit, look, label)
    axes.set_yscale("log")
    _name_harmonics(axes, max((one for _, _, one in parts), key=lambda d: d.order[-1]))
    axes.set_xlabel("order (waves per revolution)")
    axes.set_ylabel(f"{'mesh force' if force else 'transmission error'} ({name}, peak)")
    return plot_curves.finish(axes, own)


def _draw_lines(axes, data, variable, scale, look, label):
    """Draw the amplitudes of a spectrum as lines from `_FLOOR`; return the largest one.

    Order 0, the mean, is left out: it is no vibration.
    """
    order, height = data.order.values[1:], scale * data[variable].values[1:]
    top = float(height.max())
    seen = height > _FLOOR * top
    axes.vlines(order[seen], _FLOOR * top, height[seen], color=look.colour, lw=1.4, label=label)
    style.dots(axes, order[seen], height[seen], "o", look.colour, 2.5)
    return top


def _name_harmonics(axes, data):
    """Name the tooth-passing harmonics above their orders."""
    at = (data.mesh_order.values % 1 == 0) & (data.mesh_order.values > 0)
    orders = data.order.values[at]
    for k, order in enumerate(orders, 1):
        axes.axvline(order, color="0.85", lw=0.8, zorder=0)
        if k % -(-len(orders) // _NAMED) == 0:
            name = "mesh" if k == 1 else f"{k} × mesh"
            axes.annotate(
                name,
                (order, 1.0),
                (0, 2),
                xycoords=("data", "axes fraction"),
                textcoords="offset points",
                fontsize=6,
                rotation=90 if len(orders) > 4 else 0,
                ha="center",
            )
    axes.set_xlim(0.0, 1.03 * float(np.max(data.order)))
