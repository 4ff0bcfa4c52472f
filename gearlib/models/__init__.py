"""What can be simulated: parameters in SI, their ratios, their equations of motion.

====================  =======================================================================
module                responsibility
====================  =======================================================================
``model``             `Model`, the protocol: all that runs and analyses ask of a model
``pair``              `GearPair`: one pair of gears; the border between SI and ratios
``one_degree``        `OneDegreePair`: nonlinear damping, other stiffness, excitation
``load_sharing_pair`` `LoadSharingPair`: pairs of teeth that touch one by one
``six_degrees``       `SixDegreePair`: bearings, run-out, friction, moving backlash
``trains``            `GearTrain`: any number of meshes; planetary trains, the reducer
``geometry``          drawn gears and what a mesh takes of them; public as `gearlib.geometry`
``dead_zone``         `DeadZoneOscillator`: any oscillator between two elastic contacts
``acceleration``      what a changing speed asks of the meshes: inertia
``parameter_values``  the numbers of a model that can be read and changed by name
``pair_parameters``   what a `GearPair` is given
``tolerated``         what of a pair and of drawn gears may scatter
``from_values``       from the text of a dataset back to its model
``with_pair``         what models that contain a `GearPair` offer of it
``oscillator``        the equation that all models of one degree share
``one_mesh_system``   what the piecewise-linear models share
``stiffness``         mesh stiffness over one mesh period, Eq. (1) and (2)
``profiles``          rectangular, Fourier and tabulated mesh stiffness
``harmonics``         periodic functions of the mesh phase
====================  =======================================================================
"""
