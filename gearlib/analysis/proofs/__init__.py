"""Orbits that are theorems: existence, contacts and stability in ball arithmetic.

=====================  =====================================================================
module                 responsibility
=====================  =====================================================================
``balls``              python-flint where it is installed; numbers in, decimals out
``certificate_files``  what a proof returns: a certificate or a refusal
``closed_laws``        the laws of motion of one degree of freedom, closed forms
``train_numbers``      matrices and meshes of a train in balls
``train_laws``         its laws of motion without the free rotation: matrices between events
``candidate``          laws of a model, contacts of a motion in floats
``arcs``               motion between two nodes, in frames that turn along or not
``path``               an orbit as a system of equations, with all derivatives
``krawczyk``           zeros of systems of equations, proven
``signs``              that a motion touches no flank line between its contacts
``windows``            contacts of several meshes at once, whatever their order
``multipliers``        eigenvalues, and what they say of stability
``extrema``            the smallest and the largest displacement of a motion
``orbits``             `certify`: one orbit
``ranges``             `certify_range`: an orbit at every tuning of a range
=====================  =====================================================================
"""
