"""Trials: hostile problems, the methods that are put to them, and what becomes of it.

=============  ====================================================================
module         responsibility
=============  ====================================================================
``no_loss``    conservative motion without loss of contact: orbit, tongues
``hostile``    the problems: model, tuning, start, what is compared, tolerance
``failures``   the verdict of one method on one problem by stated rules; the matrix
=============  ====================================================================
"""
