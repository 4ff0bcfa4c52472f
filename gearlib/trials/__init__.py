"""Trials of the methods: which is right, at what cost, and where each fails.

====================  ===================================================================
module                responsibility
====================  ===================================================================
``stability``         spectral radii of one period, of fixed-step methods and of the truth
====================  ===================================================================
"""
