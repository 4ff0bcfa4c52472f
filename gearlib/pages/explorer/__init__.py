"""The explorer: sliders in the browser, and what the gears make of them.

=================  ===================================================
module             responsibility
=================  ===================================================
``explored``       parameters, their sliders, and what is seen of them
``one_pair``       a gear pair, as sliders change it
``drawn_pair``     drawn gears
``view``           from a model to the arrays that are drawn
``curves``         lines of figures, and empty figures
``motion``         figures of the motion of a pair
``drawn_figures``  numbers and figures of drawn gears
``slider_page``    the page: sliders, a note, the button
``serving``        the choice of what is explored, and the server
=================  ===================================================
"""
