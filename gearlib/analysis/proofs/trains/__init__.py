"""Orbits of trains that are theorems: many coordinates, several meshes.

===============  ====================================================================
module           responsibility
===============  ====================================================================
``parts``        matrices and meshes of a model in balls, from its SI numbers
``laws``         the laws of motion without the free rotation: a matrix between events
``path``         an orbit as a system of equations, with its derivatives
``signs``        that no mesh touches a flank line between the contacts
``windows``      contacts of several meshes at once, whatever their order
``multipliers``  eigenvalues in discs, and what they say of stability
``orbits``       the steps of the proof
===============  ====================================================================
"""
