"""Computations behind one figure or table each; nothing else imports them.

======================  ==============================================================
name                    responsibility
======================  ==============================================================
``resonance_windows``   windows of the resonance characteristic
``recorded_planes``     single runs behind the phase planes
``trust_labels``        labels of the motion from rest
``scenes``              the time courses of a few runs, side by side
``many_starts``         seeded starts, and whether rounding decides where a motion goes
``runs_beside``         a run, or seeded ones beside where rounding decides it
``model_comparison``    what larger models would change in a scene, and what they cost
``phase_lag``           lag of the motion behind the mesh stiffness
``jump``                where the motion from rest jumps, and what moves the jump
``resonance_branches``  the branches behind Fig. 3, and loci of their special points
``run_ups``             run-ups at several rates, and the orders of the slowest
``tongue_chart``        growth and tongues over the tuning and one other parameter
``global_picture``      basins, bifurcation diagram with exponents and shares, sections
``contact_loss``        what begins at a tuning: parametric or forced motion
``certificates``        what is proven of the paper's orbits; ``certificates_of_trains``
``certificate_table``   the same as a table
``nonlinear_damping``   equivalent linear, quadratic and cubic damping side by side
``analytic_method``     the paper's analytic method at work, against exact orbits
``gear_table``          all that a drawing of two gears comes to
``mesh_stiffness``      stiffness of drawn gears by every method
``tip_relief``          Harris maps
``trains``              what only a whole gear train shows
``claims``              the paper's statements, checked against computed data
``trials``              which method is right, at what cost, and where each fails
======================  ==============================================================
"""
