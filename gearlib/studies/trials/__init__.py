"""Trials of the methods: which is right, at what cost, and where each fails.

========================  ==========================================================================
module                    responsibility
========================  ==========================================================================
``problems``              test problems of work and precision, and runs of any method
``high_precision``        the same problems in as many decimal digits as are asked for
``references``            what methods are measured by: runs and settled orbits in 50 digits
``work_precision``        errors of a method on a problem, against evaluations and wall time
``fastest``               the fastest method of this library and of the others, as a table
``stability_of_methods``  spectral radii of one period, of fixed-step methods and of the truth
``difficult_problems``    difficult problems: model, tuning, start, what is compared, tolerance
``failures``              the verdict of one method on one problem by stated rules; the matrix
========================  ==========================================================================
"""
