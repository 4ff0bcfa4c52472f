"""Order spectra: amplitudes over the orders of a shaft, with labels at tooth-passing harmonics."""

import numpy as np
import xarray as xr
from matplotlib.axes import Axes

from gearlib import checks
from gearlib.figures import plot_curves, style

#: Smallest amplitude drawn, relative to the largest one.
_MIN_RELATIVE_AMPLITUDE = 1e-6
#: Largest number of labels of tooth-passing harmonics.
_MAX_LABELS = 10


@style.styled()
def orders(*spectra: xr.Dataset, axes=None, labels=None, variable="force_amplitude") -> Axes:
    """Draw order spectra: amplitudes over the orders, with labels at tooth-passing harmonics.

    The mean (order 0) and amplitudes below a millionth of the largest one are left out.

    Parameters
    ----------
    *spectra : xarray.Dataset
        Order spectra returned by `gearlib.orders`; each mesh of a train has a colour.
    axes : matplotlib.axes.Axes, optional
        Axes to draw into; by default those of a new pyplot figure.
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
        If a dataset is not an order spectrum, or lacks the variable.
    """
    checks.one_of("variable", variable, ("force_amplitude", "error_amplitude"))
    sources = {"dim": "order", "caller": "orders", "source": "orders"}
    curves = plot_curves.curves(spectra, labels, (variable, "mesh_order"), **sources)
    axes = plot_curves.axes_or_new(axes)
    spectra = [curve.data.isel(order=slice(1, None)) for curve in curves]
    size, unit = style.readable_unit(spectra[0][variable].units, *(s[variable] for s in spectra))
    for curve, spectrum in zip(curves, spectra, strict=True):
        amplitudes = spectrum[variable].values / size
        bottom = _MIN_RELATIVE_AMPLITUDE * amplitudes.max()
        mask = amplitudes > bottom
        orders, amplitudes = spectrum.order.values[mask], amplitudes[mask]
        options = {"color": curve.style.colour, "label": curve.label}
        axes.vlines(orders, bottom, amplitudes, lw=1.4, **options)
        style.draw_markers(axes, orders, amplitudes, "o", curve.style.colour, 2.5)
    axes.set_yscale("log")
    _label_harmonics(axes, max(spectra, key=lambda spectrum: spectrum.order[-1]))
    axes.set_xlabel("order (waves per revolution)")
    kind = "mesh force" if variable == "force_amplitude" else "transmission error"
    axes.set_ylabel(f"{kind} ({unit}, peak)")
    return plot_curves.add_legend(axes)


def _label_harmonics(axes, data: xr.Dataset):
    """Mark the tooth-passing harmonics of an order spectrum, with labels above the axes."""
    is_harmonic = (data.mesh_order.values % 1 == 0) & (data.mesh_order.values > 0)
    orders = data.order.values[is_harmonic]
    for k, order in enumerate(orders, 1):
        axes.axvline(order, color="0.85", lw=0.8, zorder=0)
        if k % -(-len(orders) // _MAX_LABELS) == 0:
            label = "mesh" if k == 1 else f"{k} × mesh"
            options = {"coords": ("data", "axes fraction"), "anchor": "center baseline"}
            rotation = 90 if len(orders) > 4 else 0
            style.annotate(axes, label, (order, 1.0), (0, 2), rotation=rotation, **options)
    axes.set_xlim(0.0, 1.03 * float(np.max(data.order)))
