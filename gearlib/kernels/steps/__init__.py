"""For comparison: methods with steps, over switches and contact.

======================  ================================================
module                  responsibility
======================  ================================================
``equation_of_motion``  the nonlinear mesh at one phase and state
``fixed``               fixed steps, a whole run
``embedded``            an embedded pair under step control, a whole run
``recording``           what is recorded of a run in steps
======================  ================================================
"""
