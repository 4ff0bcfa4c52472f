"""Orbits that are theorems: existence, contacts and stability in ball arithmetic.

=====================  =====================================================================
module                 responsibility
=====================  =====================================================================
``balls``              python-flint where it is installed; numbers in, decimals out
``certificate_files``  what a proof returns: a certificate or a refusal
``models_in_balls``    masses, springs, loads and meshes of a model
``arc_laws``           the law of motion between two events, of pairs as of trains
``path``               an orbit as a system of equations, with all derivatives
``krawczyk``           zeros of systems of equations, proven
``signs``              that a motion touches no flank line between its contacts; its extrema
``windows``            contacts of several meshes at once, whatever their order
``multipliers``        eigenvalues, and what they say of stability
``orbits``             `certify`: one orbit
``ranges``             `certify_range`: an orbit at every tuning of a range
=====================  =====================================================================
"""
