"""Figures of lines whose ends are sources by name, with a marker at what is set."""

import panel as pn
from bokeh.models import ColumnDataSource, Span
from bokeh.plotting import figure

from gearlib.figures.style import limits


class Curves:
    """Lines of several figures, and the marker of one."""

    def __init__(self, names):
        self.sources = {name: ColumnDataSource({"x": [], "y": []}) for name in names}
        self.marker = Span(dimension="height", line_color="#999999", line_dash="dashed")

    def show(self, name, x, y):
        """Give a line its points."""
        self.sources[name].data = {"x": x, "y": y}

    def limit(self, plot, names):
        """Give a figure the limits of the ordinates of these lines."""
        values = [self.sources[name].data["y"] for name in names]
        plot.y_range.start, plot.y_range.end = limits(*values)

    def line(self, plot, name, colour, **options):
        """Draw a line in a figure."""
        plot.line("x", "y", source=self.sources[name], color=colour, **options)

    def marked(self, plot):
        """Return a figure with the marker."""
        plot.add_layout(self.marker)
        return plot


def small(title, x, y, width=330):
    """Return an empty figure of which several stand side by side, as wide as there is room."""
    return figure(
        width=width, height=320, title=title, x_axis_label=x, y_axis_label=y, toolbar_location=None,
        max_width=width, min_width=200, sizing_mode="stretch_width",
    )  # fmt: skip


def beside(*panes, **options):
    """Return panes beside each other; those for which the window is too narrow come below."""
    return pn.FlexBox(*panes, sizing_mode="stretch_width", **options)


def wide(title, x, y):
    """Return an empty figure that takes the whole width."""
    return figure(
        height=330, title=title, x_axis_label=x, y_axis_label=y, sizing_mode="stretch_width"
    )
