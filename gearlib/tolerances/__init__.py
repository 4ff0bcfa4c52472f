"""Tolerances of a drawing: how sure is the resonance?

===================  ================================================================
module               responsibility
===================  ================================================================
``distributions``    how parameters scatter: limits, deviations, named distributions
``quality_classes``  tolerances by the classes that a drawing names
``designs``          from points of the unit cube to parameters and models
``bands``            runs of many designs over speed: bands, loss of contact, branches
``quantities``       jumps, onset, peak and duty point, followed from design to design
``scatter``          `gearlib.scatter`, and its shards
``indices``          `sobol_indices`, with bootstrapped intervals
``linear_scatter``   `first_order_scatter`: by derivatives alone, beside samples
``tightening``       `tighten`: which tolerance must shrink, and by how much
``boxes``            `certify_box`: a box of parameters, proven
``kept_contact``     the orbit of a pair that keeps contact, over a box
``expansions``       where polynomial chaos fails, beside samples
``tolerance_study``  what the workflow asks of them,
``tolerance_table``  and its table
===================  ================================================================
"""
