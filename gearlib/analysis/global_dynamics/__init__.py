"""The global picture: where motions from all initial states end, and what else there is.

===================  =============================================================
module               responsibility
===================  =============================================================
``grids``            grids of initial states and sets of values, checked
``varied_ratio``     one ratio of a pair varied, all others held
``stroboscope``      the stroboscopic map of any model, for many states at once
``attractors``       attractors: found, refined, and what surely comes to them
``classification``   to which attractor each of many states comes
``basins``           `basins`: a grid of initial states; shares of the attractors
``basin_stability``  `basin_stability`: shares over the tuning, from random states
``poincare``         `poincare_section`: states at one mesh phase, of many orbits
``bifurcation``      `bifurcation_diagram`: stroboscopic states over a parameter
``settled_motions``  which motions of a diagram rounding has no part in
``exponents``        `lyapunov_exponents`: largest exponent over a parameter
===================  =============================================================
"""
