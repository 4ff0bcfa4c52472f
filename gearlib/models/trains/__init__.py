"""Gear trains: any number of bodies, shafts and meshes as one piecewise-linear model.

=======================  ===========================================================================
module                   responsibility
=======================  ===========================================================================
``train``                `GearTrain`: checks, scales, start states, what runs ask of a model
``elements``             `Body`, `Shaft`, `Mesh`: the parameters in SI units
``assembly``             what a train has to be: names, gears that fit, torques in balance
``structure``            matrices of supports, shafts and pins; lines of action
``elastic``              free motions and natural modes, to all digits
``turning``              speeds from tooth numbers, phases from positions, what cannot be assembled
``waves``                stiffness levels, deviations and run-out over the reference mesh's phase
``system``               the dimensionless `TrainSystem` of the kernels
``train_values``         numbers of a train that can be read and changed by name
``statics``              load sharing with gaps and errors
``natural_modes``        natural frequencies and shapes, and which harmonics excite them
``layout``               where axes and pitch points lie, how all turn
``ready_made``           `planetary`, `idler`, `two_stage`
``parts``                gears by module and teeth, meshes by a `GearPair`, for these
``two_gears``            `TwoGears`: the train that a `SixDegreePair` is
``reducer_train``        `split_power_reducer`, the paper's Fig. 1 a
``train_from_drawings``  `planetary_set`, sun, planets and ring by their drawing
``described_train``      any of these from the values of a configuration
=======================  ===========================================================================
"""
