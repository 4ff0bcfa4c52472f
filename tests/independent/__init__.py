"""One independent program for every model; nothing of it imports the library.

==================  ==========================================================================
module              responsibility
==================  ==========================================================================
``equations``       a system as plain JSON, and its equations in units
``series``          the Taylor series of a motion, and the zeros of polynomials
``program``         motions, events, courses of speed and load, orbits, multipliers
``assembly``        a system in parts
``systems``         the systems of described models of one and six degrees of freedom
``trains``          those of gear trains
``differences``     derivatives of motions, orbits and folds in 34 to 50 digits
``certificates``    certificates against orbits in 50 digits
==================  ==========================================================================
"""
