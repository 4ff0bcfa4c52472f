"""The train of the explorer seen along its axes, turned by a slider, with its marks of contact."""

import math
from typing import Any

import numpy as np
import panel as pn
from bokeh.models import ColumnDataSource, DataRange1d, Span

from gearlib.figures import schematic, style
from gearlib.pages.explorer.curves import FIRST, empty, flex, pane
from gearlib.pages.explorer.view import SHOWN, TRAIN

#: Marks of `schematic.CONTACTS` and lines of `schematic.CIRCLES`, as bokeh calls them.
_MARKERS = {"o": "circle", "D": "diamond"}
_DASHES = {"gear": "solid", "ring": "solid", "rotor": "dashed"}
#: Room of one letter of a name, a share of the width of the picture.
_LETTER = 0.022
#: Height of slider and words, px.
_BELOW = 90


class TurningTrain:
    """The schematic of the train that is seen, at an instant of the time course."""

    def __init__(self):
        parts = "circles", "marks", "arms", "shafts", "meshes", "leaders", "names", "frame"
        self.sources = {name: ColumnDataSource({}) for name in parts}
        #: Where the time course is at this instant, in mesh periods.
        self.marker = Span(dimension="height", line_color="#999999", line_dash="dashed")
        self.slider: Any = pn.widgets.FloatSlider(
            label="instant of the time course, mesh periods",
            start=0.0,
            end=SHOWN - 1.0 / TRAIN.samples,
            step=1.0 / TRAIN.samples,
            format="0[.]000",
            sizing_mode="stretch_width",
        )
        self.words = pn.pane.Markdown("", sizing_mode="stretch_width", css_classes=["contacts"])
        self.slider.param.watch(self.turn, "value")
        self._layout: Any = None
        self._contact: Any = None
        self._known = False

    def draw(self, train, course):
        """Show a train and its contacts; course: the samples of its run that are drawn."""
        self._layout, self._contact = train.layout(), course.contact.values
        # Of a motion that could not go on nothing is known.
        self._known = not int(course.status)
        self.turn()

    def turn(self, *_):
        """Show what the slider says."""
        layout, periods = self._layout, self.slider.value
        code = self._contact[min(round(periods * TRAIN.samples), len(self._contact) - 1)]
        code = code if self._known else np.full_like(code, schematic.NORMAL)
        now = schematic.instant(layout, math.tau * periods)
        names = list(map(str, layout.mesh.values))
        colours = [*style.mesh_colours(names).values()]
        x, y, radius, kinds = zip(*now.circles, strict=True)
        width, dashes = [2 * schematic.CIRCLES[k][0] for k in kinds], [_DASHES[k] for k in kinds]
        shown = {"x": x, "y": y, "radius": radius, "width": width, "dash": dashes}
        self.sources["circles"].data = shown
        self.sources["marks"].data = _lines(now.marks)
        self.sources["arms"].data = _lines(now.arms)
        self.sources["shafts"].data = dict(zip("xy", now.shafts.T, strict=True))
        marks = [schematic.CONTACTS[int(one)] for one in code]
        self.sources["meshes"].data = {
            "x": now.meshes[:, 0],
            "y": now.meshes[:, 1],
            "colour": colours,
            "face": ["white" if not m[1] else c for m, c in zip(marks, colours, strict=True)],
            "marker": [_MARKERS[mark[0]] for mark in marks],
            "mesh": names,
        }
        labels = schematic.labels(layout, now.meshes)
        at = np.array([label[:2] for label in labels])
        self.sources["names"].data = {
            "x": at[:, 0],
            "y": at[:, 1],
            "align": ["right" if side == "left" else "left" for _, _, side in labels],
            "colour": colours,
            "mesh": names,
        }
        ways = np.stack([now.meshes, at], axis=1)
        self.sources["leaders"].data = _lines(ways) | {"colour": colours}
        left, right, low, high = schematic.extent(layout)
        room = (right - left) * (0.1 + _LETTER * max(map(len, names)))
        ends = {"x": [left - room, right + room], "y": [low, high]}
        self.sources["frame"].data = ends
        self.marker.location = periods
        apart = [n for n, one in zip(names, code, strict=True) if one == schematic.BACKLASH]
        said = (
            f"Out of contact (open): {', '.join(apart)}" if apart else "All meshes are in contact"
        )
        said = said if self._known else "There is no motion at this speed"
        others = schematic.words(layout, code[code != schematic.BACKLASH])
        self.words.object = "; ".join([said, *others]) + "."

    def pane(self):
        """Return the schematic above its slider and its words."""
        plot = empty("Meshes of the train", "", "")
        sources = self.sources
        frame = plot.scatter("x", "y", source=sources["frame"], size=0.0, alpha=0.0)
        plot.x_range, plot.y_range = (DataRange1d(renderers=[frame]) for _ in "xy")
        plot.match_aspect, plot.min_border_left = True, None
        plot.axis.visible = plot.grid.visible = False
        plot.multi_line(
            "xs", "ys", source=sources["arms"], line_width=6, color=schematic.CARRIER,
            line_cap="round",
        )  # fmt: skip
        plot.circle(
            "x", "y", radius="radius", source=sources["circles"], fill_color=None,
            line_color=schematic.GREY, line_width="width", line_dash="dash",
        )  # fmt: skip
        plot.multi_line("xs", "ys", source=sources["marks"], color=schematic.GREY)
        plot.scatter("x", "y", source=sources["shafts"], size=9, color=schematic.GREY)
        plot.multi_line("xs", "ys", source=sources["leaders"], color="colour", line_width=0.6)
        plot.scatter(
            "x", "y", source=sources["meshes"], size=10, marker="marker", line_width=2,
            line_color="colour", fill_color="face",
        )  # fmt: skip
        plot.text(
            "x", "y", text="mesh", source=sources["names"], text_align="align",
            text_baseline="middle", text_color="colour", text_font_size="9pt",
        )  # fmt: skip
        below = pn.Column(pane(plot, FIRST, _BELOW), self.slider, self.words)
        below.styles = flex(FIRST)
        return below


def _lines(ways):
    """Return lines, shape (k, 2, 2), as columns of a source."""
    return {"xs": list(ways[:, :, 0]), "ys": list(ways[:, :, 1])}
