"""Statistics of run-ups by other means, and the balance of their energy.

Energy by the matrices and flanks of `tests.independent`, on the time courses of the library.
"""

import numpy as np

import gearlib
from tests.physics.test_run_up import DAMPED


def test_statistics_of_arcs_and_of_matrices_are_the_same():
    # Through the resonance, with flights and strokes on both flanks.
    pair = DAMPED.replace(backlash_damping=0.0, backlash=6e-6)
    speed = [(0.0, 2000.0), (0.4, 4000.0), (0.8, 2000.0)]
    course = {"speed": speed, "load": [(0.0, 1.0), (0.1, 1.0), (0.1, 0.7)]}
    course |= {"driven_mass": 1.5, "base_radius": 0.05, "samples_per_period": 4}
    one, other = (gearlib.run_up(m, **course) for m in (pair, gearlib.OneDegreePair(pair=pair)))
    assert (one.fraction_inverse > 0.0).any() and one.bounces.max() > 0.5
    for name in one.data_vars:
        if one[name].dtype.kind == "f":
            wrong, size = np.abs(one[name].values - other[name].values), np.abs(one[name]).max()
            assert wrong.max() < 1e-11 * size, name
