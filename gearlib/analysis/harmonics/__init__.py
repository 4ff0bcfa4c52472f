"""Periodic motions over harmonics: the paper's analytic method, and harmonic balance beside it.

====================  ===================================================================
module                responsibility
====================  ===================================================================
``equation``          the mesh equation over harmonics, forces on a grid, Green's function
``schmidt``           `schmidt`: kernel split into a degenerate part and a remainder
``harmonic_balance``  `harmonic_balance`: all harmonics at once by Newton's method
``solution``          a motion as harmonics: course, errors, multipliers, dataset
====================  ===================================================================
"""
