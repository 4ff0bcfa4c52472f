"""Order spectra: amplitudes over the orders of a shaft, tooth-passing harmonics named."""

import numpy as np
import xarray as xr
from matplotlib.axes import Axes

from gearlib import checks
from gearlib.figures import plot_curves, style

#: Smallest amplitude drawn, a share of the largest one.
_MIN_AMPLITUDE = 1e-6
#: Number of tooth-passing harmonics that can be named side by side.
_MAX_NAMED = 10


@style.styled()
def orders(*spectra: xr.Dataset, axes=None, labels=None, variable="force_amplitude") -> Axes:
    """Draw order spectra: amplitudes over the orders, tooth-passing harmonics named.

    The mean, order 0, and amplitudes below a millionth of the largest one are left out.

    Parameters
    ----------
    *spectra : xarray.Dataset
        Order spectra of `gearlib.orders`; each mesh of a train has a colour.
    axes : matplotlib.axes.Axes, optional
        Axes to draw in; those of a new pyplot figure by default.
    labels : sequence of str, optional
        Legend labels of the datasets.
    variable : {"force_amplitude", "error_amplitude"}
        Amplitudes to draw: of the mesh force or of the transmission error.

    Returns
    -------
    matplotlib.axes.Axes

    Raises
    ------
    ValueError
        If a dataset is no order spectrum, or lacks the variable.
    """
    checks.one_of("variable", variable, ("force_amplitude", "error_amplitude"))
    names = (variable, "mesh_order")
    curves = plot_curves.curves("orders", spectra, labels, names, "orders", "order")
    axes = plot_curves.axes_or_new(axes)
    spectra = [curve.data.isel(order=slice(1, None)) for curve in curves]
    size, unit = style.readable_unit(spectra[0][variable].units, *(s[variable] for s in spectra))
    for curve, spectrum in zip(curves, spectra, strict=True):
        heights = spectrum[variable].values / size
        drawn = heights > _MIN_AMPLITUDE * heights.max()
        orders, heights = spectrum.order.values[drawn], heights[drawn]
        options = {"color": curve.look.colour, "label": curve.label}
        axes.vlines(orders, _MIN_AMPLITUDE * heights.max(), heights, lw=1.4, **options)
        style.dots(axes, orders, heights, "o", curve.look.colour, 2.5)
    axes.set_yscale("log")
    _name_harmonics(axes, max(spectra, key=lambda spectrum: spectrum.order[-1]))
    axes.set_xlabel("order (waves per revolution)")
    kind = "mesh force" if variable == "force_amplitude" else "transmission error"
    axes.set_ylabel(f"{kind} ({unit}, peak)")
    return plot_curves.add_legend(axes)


def _name_harmonics(axes, data: xr.Dataset):
    """Write the names of the tooth-passing harmonics of an order spectrum above the axes."""
    is_harmonic = (data.mesh_order.values % 1 == 0) & (data.mesh_order.values > 0)
    orders = data.order.values[is_harmonic]
    for k, order in enumerate(orders, 1):
        axes.axvline(order, color="0.85", lw=0.8, zorder=0)
        if k % -(-len(orders) // _MAX_NAMED) == 0:
            name = "mesh" if k == 1 else f"{k} × mesh"
            options = {"of": ("data", "axes fraction"), "side": "center baseline"}
            rotation = 90 if len(orders) > 4 else 0
            style.note(axes, name, (order, 1.0), (0, 2), rotation=rotation, **options)
    axes.set_xlim(0.0, 1.03 * float(np.max(data.order)))
