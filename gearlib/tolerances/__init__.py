"""Tolerances of a drawing: how sure is the resonance?

===================  ================================================================
module               responsibility
===================  ================================================================
``distributions``    how parameters scatter: limits, deviations, named distributions
``quality_classes``  tolerances by the classes that a drawing names
``designs``          from points of the unit cube to parameters and models
``bands``            runs of many designs over speed: bands, loss of contact, branches
``quantities``       jumps, onset, peak and duty point of each design
``by_mesh``          quantities of each mesh, and which mesh counts
``scatter``          `gearlib.scatter`, and its shards
``indices``          `sobol_indices`, with bootstrapped intervals
``tolerance_study``  what the workflow asks of them,
``tolerance_table``  and its table
===================  ================================================================
"""
