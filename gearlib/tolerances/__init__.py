"""Tolerances of a drawing: how sure is the resonance?

===================  ================================================================
module               responsibility
===================  ================================================================
``distributions``    how parameters scatter: limits, deviations, named distributions
``designs``          from points of the unit cube to parameters and models
``bands``            runs of many designs over speed: bands, loss of contact, branches
``quantities``       jumps, onset, peak and duty point, followed from design to design
``scatter``          `gearlib.scatter`, and its shards
``indices``          Sobol' indices with bootstrapped intervals
``tolerance_study``  what the workflow asks of them,
``tolerance_table``  and its table
===================  ================================================================
"""
