"""The explorer: one page with sliders for the keys of a configuration, and figures of its gears.

============  ==========================================================
module        responsibility
============  ==========================================================
``sliders``   sliders of the gears; the configuration that they make
``view``      the arrays that are drawn of a configuration
``figures``   figures of a view
``page``      the page, and its server
============  ==========================================================
"""
