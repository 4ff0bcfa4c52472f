"""Instability tongues of a gear train to first order in the stiffness jump.

With mass-normalised modes phi of the mean stiffness, jumps J_j, contact ratios c_j and phases g_j
of the middle of the upper level, harmonic l of the mesh frequency W couples the modes p and q by

    A = |sum_j 2 J_j sin(pi l (c_j - 1)) / (pi l) exp(-2 pi i l g_j) (b_j . phi_p) (b_j . phi_q)|

and the motion without loss of contact is unstable, if there is no damping, where
|l W - (w_p + w_q)| < A / (2 sqrt(w_p w_q)). Of modes of one frequency all combinations take part: A
is then the largest singular value of the block of all pairs. The widths vanish where the sines do,
by the contact ratio, or where the phases cancel, by the tooth numbers. Lin, Parker: J. Vib. Acoust.
124 (2002) 68-76.
"""

from itertools import pairwise
from typing import NamedTuple

import numpy as np

from gearlib.models.trains.waves import stiffness_harmonic

#: Squared frequencies of equal modes differ by rounding only.
_EQUAL = 1e-9


class FirstOrder(NamedTuple):
    """One tongue to first order."""

    order: int  #: harmonic of the reference mesh frequency
    modes: tuple  #: numbers of the two elastic modes, from 0; of equal modes the first
    tuning: float  #: of its middle
    width: float  #: of the interval of tunings


def first_order(train, start, stop, orders=8):
    """Return the `FirstOrder` tongues of a train whose middles lie from tuning `start` to `stop`.

    Of so many `orders`, harmonics of the reference mesh frequency, those that are wider than
    rounding, by order and tuning.
    """
    squares, _ = train.linear_modes
    angular = np.sqrt(squares)
    unit = train.reference_angular_frequency
    along = train.linear_stretches
    ends = [0, *(np.nonzero(np.diff(squares) > _EQUAL * squares[1:])[0] + 1), squares.size]
    groups = [slice(int(a), int(b)) for a, b in pairwise(ends)]
    found = []
    for order in range(1, orders + 1):
        coupling = np.zeros((angular.size, angular.size), complex)
        for j, mesh in enumerate(train.meshes):
            # Meshes of another frequency take part with another harmonic, or not at all.
            harmonic = order / train.rates[j]
            if harmonic.denominator != 1 or not mesh.varies:
                continue
            wave = stiffness_harmonic(mesh, int(harmonic), train.phases[mesh.name])
            coupling += wave * np.outer(along[j], along[j])
        for i, one in enumerate(groups):
            for other in groups[i:]:
                p, q = one.start, other.start
                middle = (angular[p] + angular[q]) / order / unit
                if not start <= middle <= stop:
                    continue
                size = np.linalg.norm(coupling[one, other], 2)
                width = size / np.sqrt(angular[p] * angular[q]) / order / unit
                if width > 1e-9 * middle:
                    found.append(FirstOrder(order, (p, q), float(middle), float(width)))
    return sorted(found, key=lambda one: (one.order, one.tuning))
