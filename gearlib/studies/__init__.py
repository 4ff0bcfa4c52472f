"""Computations behind figures and tables of the workflow, where no public function does them.

=====================  ===============================================================
name                   responsibility
=====================  ===============================================================
``paper``              phase planes, labels of motions, the phase lag of Fig. 2
``resonance``          windows of Fig. 3, the branches behind it, loci
``scenes``             time courses of a few runs, by the smallest model that suffices
``jump``               where the motion from rest jumps, and what moves the jump
``nonlinear_damping``  equivalent linear, quadratic and cubic damping side by side
``run_ups``            run-ups at several rates, and the orders of the slowest
``stability``          growth and tongues over parameters, causes of contact loss
``global_picture``     basins, bifurcation diagrams, Poincare sections
``analytic_method``    the paper's analytic method and harmonic balance at work
``certificates``       what is proven of the paper's orbits
``many_starts``        where motions from many seeded starts end
``trains``             all meshes of gear trains over speed, Campbell diagrams
``gear_geometry``      mesh stiffness by every method, Harris maps
``gear_table``         all numbers of two gears
``measured``           measured sets beside a model
``tolerance_study``    shards, indices and the table of tolerances
``claims``             the paper's statements, checked against computed data
``trials``             which method is right, at what cost, and where each fails
=====================  ===============================================================
"""
