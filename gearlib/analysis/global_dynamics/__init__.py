"""Global dynamics: attractors, their basins, Poincare sections and bifurcation diagrams."""
