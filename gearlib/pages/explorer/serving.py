"""The explorer as a whole: one pair or drawn gears, served on this machine."""

import panel as pn

from gearlib.pages.explorer.drawn_figures import DrawnFigures
from gearlib.pages.explorer.drawn_pair import Drawing
from gearlib.pages.explorer.motion import Motion
from gearlib.pages.explorer.one_pair import Pair
from gearlib.pages.explorer.slider_page import SliderPage

PAIR, DRAWN = "one pair", "drawn gears"


def page_of(mapping, damping, chosen=PAIR):
    """Return the `SliderPage` of a pair, or of drawn gears."""
    if chosen == PAIR:
        return SliderPage(Pair(mapping, damping), Motion())
    drawing = Drawing(mapping, damping)
    return SliderPage(drawing, DrawnFigures(drawing))


def opened(mapping):
    """Return what is seen first: drawn gears if the configuration draws some, else the pair."""
    return DRAWN if mapping.get("gears") else PAIR


class Explorer:
    """The choice of what is explored, and the page of it."""

    def __init__(self, mapping, damping):
        self.mapping, self.damping = mapping, damping
        self.choice = pn.widgets.RadioButtonGroup(
            options=[PAIR, DRAWN],
            value=opened(mapping),
            sizing_mode="stretch_width",
        )
        self.shown = pn.Column(sizing_mode="stretch_width")
        #: The `SliderPage` that was made last.
        self.page, self._pages = None, {}
        self.choice.param.watch(self.update, "value")
        self.update()

    def update(self, *_):
        """Show the page of what is chosen; it is made when it is first seen."""
        chosen = self.choice.value
        if chosen not in self._pages:
            try:
                self.page = page_of(self.mapping, self.damping, chosen)
                self._pages[chosen] = self.page.layout()
            except ValueError as error:
                self._pages[chosen] = pn.pane.Markdown(str(error))
        self.shown[:] = [self._pages[chosen]]

    def layout(self):
        """Return the page."""
        return pn.Column(self.choice, self.shown, sizing_mode="stretch_width")


def serve(mapping, damping, port=0, show=True):
    """Serve the page of a configuration and one of its dampings until interrupted.

    On this machine; port 0 takes any free one, `show` opens a browser.
    """
    pn.extension()
    # The first view loads the compiled kernels, which is nothing to wait for while dragging.
    page_of(mapping, damping, opened(mapping))
    # Every visitor has sliders of his own.
    pn.serve(
        lambda: Explorer(mapping, damping).layout(),
        port=port,
        show=show,
        title="gearlib explorer",
        address="127.0.0.1",
    )
