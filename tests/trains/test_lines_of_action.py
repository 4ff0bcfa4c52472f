"""A mesh given by its line of action is the mesh given by the position of its gears."""

import math
from dataclasses import replace

import numpy as np
import pytest

from gearlib.models.trains.elements import Mesh


@pytest.mark.parametrize("internal", [False, True])
@pytest.mark.parametrize("direction", [1, -1])
def test_a_line_of_action_tells_where_the_gears_lie(internal, direction):
    rng = np.random.default_rng(17)
    stiffness = {"max_stiffness": 1e8, "stiffness_ratio": 0.7, "contact_ratio": 1.6}
    for position, alpha in zip(rng.uniform(-3.0, 3.0, 5), rng.uniform(0.1, 0.6, 5), strict=True):
        flanks = {"internal": internal, "direction": direction, "pressure_angle": alpha}
        mesh = Mesh(pinion="a", wheel="b", position=position, **stiffness, **flanks)
        again = replace(mesh, position=None, line_of_action=mesh.line)
        assert again.line == mesh.line
        assert again.centres == pytest.approx(position, abs=1e-14)
        # Of a pair outside of each other the pressure parts the axes; a ring gear is pulled along.
        # Across the line of centres it turns the gear with the drive side.
        turned = mesh.line - position
        apart = -math.sin(alpha) if internal else math.sin(alpha)
        assert math.cos(turned) == pytest.approx(apart, abs=1e-14)
        assert math.sin(turned) == pytest.approx(direction * math.cos(alpha), abs=1e-14)
