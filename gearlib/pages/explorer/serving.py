"""The explorer as a whole: one pair, drawn gears or a gear train, served on this machine."""

import panel as pn

from gearlib.pages.explorer.drawn_page import DrawnPage
from gearlib.pages.explorer.page import Page
from gearlib.pages.explorer.train_page import TrainPage
from gearlib.pages.explorer.trains import offered

PAIR, DRAWN = "one pair", "drawn gears"


class Explorer:
    """The choice of what is explored, and the page of it."""

    def __init__(self, mapping, damping):
        self.mapping, self.damping = mapping, damping
        self._kinds = {name: kind for kind, name in offered(mapping).items()}
        self.choice = pn.widgets.RadioButtonGroup(options=[PAIR, DRAWN, *self._kinds], value=PAIR)
        self.shown = pn.Column(sizing_mode="stretch_width")
        self._pages = {}
        self.choice.param.watch(self.update, "value")
        self.update()

    def update(self, *_):
        """Show the page of what is chosen; it is made when it is first seen."""
        chosen = self.choice.value
        if chosen not in self._pages:
            try:
                self._pages[chosen] = self._page(chosen).layout()
            except ValueError as error:
                self._pages[chosen] = pn.pane.Markdown(str(error))
        self.shown[:] = [self._pages[chosen]]

    def _page(self, chosen):
        if chosen in self._kinds:
            return TrainPage(self.mapping, self.damping, self._kinds[chosen])
        page = Page if chosen == PAIR else DrawnPage
        return page(self.mapping, self.damping)

    def layout(self):
        """Return the page."""
        return pn.Column(self.choice, self.shown, sizing_mode="stretch_width")


def serve(mapping, damping, port=0, show=True):
    """Serve the page of a configuration and one of its dampings until interrupted.

    On this machine; port 0 takes any free one, `show` opens a browser.
    """
    pn.extension()
    # The first view loads the compiled kernels, which is nothing to wait for while dragging.
    Page(mapping, damping)
    # Every visitor has sliders of his own.
    pn.serve(
        lambda: Explorer(mapping, damping).layout(),
        port=port,
        show=show,
        title="gearlib explorer",
        address="127.0.0.1",
    )
