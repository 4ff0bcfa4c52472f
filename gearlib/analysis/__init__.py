"""What is asked of a model: its motions, their stability, where they come from.

===================  ==============================================================
name                 responsibility
===================  ==============================================================
``orbits``           periodic orbits, their branches, folds, doublings, grazings
``proofs``           `certify`, `certify_range`: orbits that are theorems, in ball arithmetic
``tongues``          `tongues`: where contact without loss is unstable
``harmonics``        periodic motions over harmonics: `schmidt`, `harmonic_balance`
``global_dynamics``  attractors and their basins, sections, bifurcation diagrams
``lyapunov``         `lyapunov_exponents`; where rounding decides on a motion
``duty_point``       `duty_point`: what gears do at one torque and speed, in N, m, Hz, rpm
``order_maps``       `order_map`, `orders`: orders of run-ups, of runs at one speed, of signals
``sensitivities``    `sensitivities`: derivatives of what any call returns
``trust``            `trust`: chaos or artefact: one point run in several ways
===================  ==============================================================
"""
