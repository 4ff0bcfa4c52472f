"""Periodic orbits: found, followed over a parameter, and their special points.

=======================  ==========================================================
module                   responsibility
=======================  ==========================================================
``shooting``             `periodic_orbit`: one orbit by Newton's method
``followed_parameters``  the parameters over which orbits are followed
``tracing``              steps along a curve of solutions, pseudo-arclength
``branch_points``        the points of a branch: orbit, tangent, multipliers
``special_points``       folds, period doublings, Neimark-Sacker points, grazings
``continuation``         `continue_orbit`, `switch_branch`: branches of orbits
``loci``                 `locus`: folds and grazings over two parameters
``linear_orbits``        the orbit of flanks that never part, over the tuning
``period_map``           orbits, folds and sweeps of a model by its period map
``jumps``                `main_resonance`: where contact is lost, both jumps, peaks
``peaks``                the largest extremum of a branch, next to its fold
=======================  ==========================================================
"""
