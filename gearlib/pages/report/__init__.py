"""The report: tables as pages, and a page on which tunings are chosen.

==================  ==============================================================
module              responsibility
==================  ==============================================================
``ends_from_rest``  the end of the motion from rest over a grid of tunings
``page``            resonance characteristics, phase plane, time course with Bokeh
``tables``          tables and texts as pages that need nothing else
==================  ==============================================================
"""
