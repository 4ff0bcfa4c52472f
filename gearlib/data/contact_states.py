"""Phases of contact and the mesh force they carry.

In static deflections the relative mesh displacement x meets two flank lines: x = 0 (normal
flank) and x = -s (far flank), s the backlash. With H1 = [x >= 0], H2 = [x <= -s] (the paper's
Heaviside functions) the elastic deflection is

    g(x) = x        x >= 0,       NORMAL   mesh
         = 0        -s < x < 0,   BACKLASH
         = x + s    x <= -s,      INVERSE  mesh

the dynamic mesh force C(tau) g(x) and the modified stiffness function C(tau) (H1 + H2).
"""

import numpy as np

from gearlib.engines.codes import BACKLASH, INVERSE, NORMAL

#: CF flag attributes of every variable that holds one of the codes above.
FLAGS = {
    "flag_values": np.array([INVERSE, BACKLASH, NORMAL], dtype=np.int8),
    "flag_meanings": "inverse_mesh backlash normal_mesh",
}
