"""Pages for the browser.

============  =============================================
name          responsibility
============  =============================================
``report``    tables as pages, a page to choose tunings on
``explorer``  sliders, and what the gear mesh makes of them
============  =============================================
"""
