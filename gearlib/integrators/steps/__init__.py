"""Methods with steps over switches and contact, for comparison, and the equation that they solve.

======================  ===================================================
module                  responsibility
======================  ===================================================
``equation_of_motion``  one mesh at a phase and state, of any contact
``fixed``               fixed steps of one mesh
``embedded``            steps of one mesh by an embedded pair, step control
``train_steps``         gear trains at a phase and state, their fixed steps
======================  ===================================================
"""
