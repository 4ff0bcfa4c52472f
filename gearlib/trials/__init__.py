"""Trials of the methods: which is right, at what cost, and where each fails.

=============  ==========================================================================
module         responsibility
=============  ==========================================================================
``stability``  spectral radii of one period, of fixed-step methods and of the truth
``no_loss``    conservative motion without loss of contact: orbit, tongues
``hostile``    the problems: model, tuning, start, what is compared, tolerance
``failures``   the verdict of one method on one problem by stated rules; the matrix
=============  ==========================================================================
"""
