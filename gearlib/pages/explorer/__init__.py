"""The explorer: sliders in the browser, and what the gear mesh makes of them.

========  ==================================================================
module    responsibility
========  ==================================================================
``view``  from slider values to the arrays that are drawn
``page``  sliders, figures and the button, with Panel and Bokeh
========  ==================================================================
"""
