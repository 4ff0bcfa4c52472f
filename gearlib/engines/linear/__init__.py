"""Many coordinates and several meshes, linear between events: modes of every combination.

==================  =============================================================
module              responsibility
==================  =============================================================
``train_system``    the matrices: rank-one forces of meshes on a linear system
``grid``            segments of a run and its storage
``modal_arcs``      tables of modes, and how these turn
``sparse_series``   combinations that come too seldom for modes: the power series
``distances``       proofs that no flank line is reached, and first events
``periods``         from event to event through mesh periods
``record``          what is recorded of them
``train_run``       whole runs
==================  =============================================================
"""
