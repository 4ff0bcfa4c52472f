"""What takes states of a model through mesh periods: one module for each kind.

====================  =============================================================
module                responsibility
====================  =============================================================
``base``              what all propagators offer
``closed_form``       a `GearPair`: scalar closed forms between events
``piecewise_linear``  one mesh, any number of coordinates: modes of its contacts
``several_meshes``    trains of gears: many coordinates, events of all meshes, by
``modal_frame``       the modes of every combination of contacts
``courses``           runs while speed and load change
``course_chirps``     the harmonics of systems there
``course_steps``      harmonics of one degree of freedom there, by Taylor steps
``stable_repeats``    the period of a motion, by proof
``taylor``            Taylor steps that end at events: any one degree of freedom
``tooth_pairs``       the same where the pairs of teeth touch one by one
====================  =============================================================

Each is a thin layer over the folder of `gearlib.kernels` with its name.
`Model.propagator` makes the choice between them, and nobody else does.
"""
