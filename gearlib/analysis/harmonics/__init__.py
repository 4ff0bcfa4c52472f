"""Periodic motions over harmonics: the paper's analytic method, and harmonic balance beside it.

====================  ===================================================================
module                responsibility
====================  ===================================================================
``equation``          the mesh equation over harmonics, forces on a grid with derivatives
``green``             periodic Green's function; bound of the norm of its remainders
``schmidt``           `schmidt`: kernel split into a degenerate part and a remainder
``harmonic_balance``  `harmonic_balance`: all harmonics at once by Newton's method
``hill_method``       Floquet multipliers by Hill's method
``solution``          a periodic motion as harmonics: course, crossings, dataset
``accuracy``          its errors against the exact orbit
====================  ===================================================================
"""
