"""The explorer: sliders in the browser, and what the gears make of them.

===============  ============================================================
module           responsibility
===============  ============================================================
``view``         from slider values to the arrays that are drawn of one pair
``page``         its sliders
``drawn``        from slider values to the arrays that are drawn of drawn gears
``drawn_page``   their sliders, numbers and figures
``trains``       from slider values to the arrays that are drawn of a train
``train_page``   its sliders and figures
``motion``       figures of the motion of one pair
``slider_page``  what the pages share: sliders, a note, the button
``serving``      the choice between them, and the server
===============  ============================================================
"""
