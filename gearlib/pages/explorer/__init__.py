"""The explorer: sliders in the browser, and what the gears make of them.

==============  ============================================================
module          responsibility
==============  ============================================================
``view``        from slider values to the arrays that are drawn of one pair
``page``        its sliders, figures and button, with Panel and Bokeh
``trains``      from slider values to the arrays that are drawn of a train
``train_page``  its sliders, figures and button
``serving``     the choice between them, and the server
==============  ============================================================
"""
