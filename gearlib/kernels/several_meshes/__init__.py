"""Many coordinates and several meshes, linear between events: modes of every combination.

================  ===========================================================================
module            responsibility
================  ===========================================================================
``train_system``  what a train of gears is to the kernels
``modal_arcs``    tables of the contacts and stiffness levels that are visited; turning modes
``grid``          segments of the mesh period, and storage
``distances``     whether a flank line is reached, and the first events on a piece
``periods``       through mesh periods, with all events of all meshes
``record``        extrema, fractions and samples of what is recorded
``train_run``     a whole run: its start, its periods, its record
================  ===========================================================================
"""
