"""Periodic orbits: found, followed over a parameter, and their special points.

=======================  ====================================================================
module                   responsibility
=======================  ====================================================================
``shooting``             `periodic_orbit`: one orbit by Newton's method
``followed_parameters``  the parameters over which orbits are followed
``tracing``              steps along a curve of solutions, pseudo-arclength
``branch_points``        the points of a branch: orbit, tangent, multipliers
``special_points``       folds, period doublings, Neimark-Sacker points, grazings
``continuation``         `continue_orbit`, `switch_branch`: branches of orbits
``loci``                 `locus`: folds and grazings over two parameters
``period_map``           orbits and folds of a model by its period map; orbits in full contact
``jumps``                `main_resonance`: where contact is lost, both jumps, peaks
=======================  ====================================================================
"""
