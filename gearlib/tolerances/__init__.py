"""Tolerances of a drawing: how sure is the resonance?

=================  ==================================================================
module             responsibility
=================  ==================================================================
``distributions``  how parameters scatter: limits, deviations, named distributions
``designs``        from points of the unit cube to parameters and models
``bands``          runs of many designs over speed: bands, loss of contact, branches
``scatter``        `gearlib.scatter`, and its shards
=================  ==================================================================
"""
