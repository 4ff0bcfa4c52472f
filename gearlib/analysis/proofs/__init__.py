"""Orbits that are theorems: existence, contacts, stability and special points in ball arithmetic.

================  =====================================================================
module            responsibility
================  =====================================================================
``balls``         python-flint where it is installed; numbers in, decimals out
``laws``          the laws of motion in balls, closed forms
``path``          an orbit as a system of equations, with all derivatives
``krawczyk``      zeros of systems of equations, proven
``signs``         that a motion touches no flank line between its contacts
``extrema``       the smallest and the largest displacement of a motion
``certificates``  what a proof returns: a certificate or a refusal
``orbits``        `certify`: one orbit
``points``        `certify_fold`, `certify_grazing`, `certify_tongues`
``ranges``        `certify_range`: an orbit at every tuning of a range
``motions``       `certify_motion`: where a motion tends to
================  =====================================================================
"""
