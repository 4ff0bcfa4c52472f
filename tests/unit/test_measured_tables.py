"""How rows of a measured table are brought into order."""

import numpy as np
import pytest

from gearlib.uncertainty.measured_tables import in_order


@pytest.mark.parametrize(
    ("time", "group", "order"),
    [
        ([0.0, 1.0, 2.0], [0, 0, 0], None),
        ([0.0, 2.0, 1.0], [0, 0, 0], [0, 2, 1]),
        ([0.0, 1.0, 0.0, 1.0], [5, 5, 2, 2], None),
        # Two conditions row by row, each of which rises: they become two blocks, in their order.
        ([0.0, 0.0, 1.0, 1.0, 2.0, 2.0], [5, 2, 5, 2, 5, 2], [0, 2, 4, 1, 3, 5]),
        # One condition in two parts.
        ([0.0, 0.0, 1.0], [5, 2, 5], [0, 2, 1]),
    ],
)
def test_conditions_become_blocks_in_which_time_rises(time, group, order):
    found = in_order("t", np.array(time), np.array(group))
    assert order == (None if found is None else found.tolist())
