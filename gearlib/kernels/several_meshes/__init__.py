"""Many coordinates and several meshes, linear between events: matrix exponentials.

================  ====================================================================
module            responsibility
================  ====================================================================
``system``        what a train of gears is to the kernels
``combinations``  tables of the contacts and stiffness levels that are visited
``grid``          substeps of the mesh period, and room to compute
``substeps``      a substep: where the state goes, whether a flank line is reached
``periods``       through mesh periods, with all events of all meshes
``record``        extrema, fractions and samples of what is recorded
``run``           a whole run: its start, its periods, its record
================  ====================================================================
"""
