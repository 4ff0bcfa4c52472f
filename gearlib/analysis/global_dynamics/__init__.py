"""The global picture: where motions from all initial states end, and what else there is.

===================  =============================================================
module               responsibility
===================  =============================================================
``grids``            grids of initial states and sets of values, checked
``stroboscope``      the stroboscopic map of any model, for many states at once
``attractors``       attractors: found, refined, and what surely comes to them
``classification``   to which attractor each of many states comes
``basins``           `basins`, `basin_stability`: shares of the attractors
``poincare``         `poincare_section`, `bifurcation_diagram`: states at one phase
===================  =============================================================
"""
