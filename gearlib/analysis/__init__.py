"""Analyses of a model: its steady motions, their stability and their bifurcations.

===================  ==============================================================
name                 responsibility
===================  ==============================================================
``orbits``           periodic orbits, their branches, folds, doublings, grazings
``proofs``           `certify`, `certify_range`: orbits that are theorems, in ball arithmetic
``tongues``          `tongues`: tunings at which steady contact is unstable
``harmonics``        periodic motions over harmonics: `schmidt`, `harmonic_balance`
``global_dynamics``  attractors and their basins, sections, bifurcation diagrams
``lyapunov``         `lyapunov_exponents`; growth of rounding errors in a motion
``duty_point``       `duty_point`: forces and vibration at one torque and speed, in N, m, Hz, rpm
``order_maps``       `order_map`, `orders`: orders of run-ups, of runs at one speed, of signals
``rig_signals``      measured signals over the angle of the shaft: gaps, directions, tacho pulses
``sensitivities``    `sensitivities`: derivatives of the results of any call
``trust``            `trust`: chaos or artefact: the same motion by several methods
===================  ==============================================================
"""
