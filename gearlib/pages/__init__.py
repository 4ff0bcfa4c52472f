"""Pages for the browser.

============  =============================================
name          responsibility
============  =============================================
``tables``    tables as pages that need nothing else
``explorer``  sliders, and what the gear mesh makes of them
============  =============================================
"""
