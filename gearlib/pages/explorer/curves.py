"""Figures of lines whose ends are sources by name, with a marker at what is set."""

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

    def line(self, plot, name, colour, **options):
        """Draw a line in a figure."""
        plot.line("x", "y", source=self.sources[name], color=colour, **options)

    def marked(self, plot):
        """Return a figure with the marker."""
        plot.add_layout(self.marker)
        return plot


def small(title, x, y, width=330):
    """Return an empty figure of which several stand side by side."""
    return figure(
        width=width, height=320, title=title, x_axis_label=x, y_axis_label=y, toolbar_location=None
    )


def wide(title, x, y):
    """Return an empty figure that takes the whole width."""
    return figure(
        height=330, title=title, x_axis_label=x, y_axis_label=y, sizing_mode="stretch_width"
    )
