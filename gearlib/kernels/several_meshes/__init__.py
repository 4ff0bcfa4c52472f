"""Many coordinates and several meshes, linear between events: matrix exponentials.

================  ============================================================
module            responsibility
================  ============================================================
``system``        what a train of gears is to the kernels
``combinations``  tables of the contacts and stiffness levels that are visited
``periods``       through mesh periods, with all events of all meshes
``run``           a whole run: its start, its periods, its record
================  ============================================================
"""
