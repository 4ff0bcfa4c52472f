"""Figures of lines whose ends are sources by name, with a marker at what is set."""

from typing import NamedTuple

import numpy as np
import panel as pn
from bokeh.models import ColumnDataSource, Span
from bokeh.plotting import figure


class Curves:
    """Lines of several figures, and the marker of one."""

    def __init__(self, names):
        self.sources = {name: ColumnDataSource({"x": [], "y": []}) for name in names}
        self.marker = Span(dimension="height", line_color="#999999", line_dash="dashed")

    def show(self, name, x, y):
        """Give a line its points."""
        self.sources[name].data = {"x": x, "y": y}

    def stems(self, name, spectrum):
        """Give a line the force amplitudes of an order spectrum as stems, N over mesh orders."""
        amplitude = spectrum.force_amplitude.values
        seen = amplitude > FLOOR * amplitude[0]
        # Order 0 is the mean.
        seen[0] = False
        ground = np.full(seen.sum(), FLOOR * amplitude[0])
        ends = np.column_stack([ground, amplitude[seen], ground * np.nan])
        self.show(name, np.repeat(spectrum.mesh_order.values[seen], 3), ends.ravel())

    def line(self, plot, name, colour, **options):
        """Draw a line in a figure."""
        plot.line("x", "y", source=self.sources[name], color=colour, **options)

    def marked(self, plot):
        """Return a figure with the marker."""
        plot.add_layout(self.marker)
        return plot


class Room(NamedTuple):
    """What a figure takes of its row and of the window."""

    share: float  #: of the height that the window has for figures
    least: int  #: height, px
    basis: int  #: width from which its row is filled, px
    grow: int = 1  #: how it shares what is left of the width


#: Of the characteristic, and of figures of which several stand side by side.
LARGE, SMALL = Room(0.55, 300, 460, 2), Room(0.45, 250, 260)
#: Of the mean force: amplitudes below are not drawn.
FLOOR = 1e-6
#: Width of ticks and words of an ordinate, px.
_ORDINATE = 65
#: Of the window, px: choice, heading and note.
_HEAD = 240


def empty_orders():
    """Return an empty figure of order spectra."""
    return empty("Order spectrum", "mesh order", "mesh force, N, peak", y_axis_type="log")


def empty(title, x, y, tools=False, **options):
    """Return an empty figure, whose size is that of its `pane`."""
    more = {} if tools else {"toolbar_location": None}
    # Room for ticks and words of the ordinate, which are not known when the figure is laid out.
    look = {"sizing_mode": "stretch_both", "min_border_left": _ORDINATE}
    return figure(title=title, x_axis_label=x, y_axis_label=y, **look, **more, **options)


def pane(plot, room=SMALL):
    """Return the pane of a figure, which grows with the window."""
    styles = {
        "height": f"calc({room.share} * (100vh - {_HEAD}px))",
        "min-height": f"{room.least}px",
        "flex": f"{room.grow} 1 {room.basis}px",
        "min-width": "0",
    }
    return pn.Column(pn.pane.Bokeh(plot, sizing_mode="stretch_both"), styles=styles)


def beside(*panes, **options):
    """Return panes beside each other; those for which the window is too narrow come below."""
    return pn.FlexBox(*panes, sizing_mode="stretch_width", **options)
