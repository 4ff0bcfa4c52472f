"""What the figures of an explorer's page hold."""

import numpy as np
import panel as pn


def plots_of(shown):
    """Return the plots of a page by their titles' first words."""
    panes = shown.layout().select(pn.pane.Bokeh)
    return {pane.object.title.text.split(":")[0].split(",")[0]: pane.object for pane in panes}


def points_of(renderer):
    """Return the points that a glyph draws."""
    data, glyph = renderer.data_source.data, renderer.glyph
    return np.array([data[glyph.x], data[glyph.y]])
