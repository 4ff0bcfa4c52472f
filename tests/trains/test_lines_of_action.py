"""A mesh given by its line of action is the mesh given by the position of its gears."""

import math
from dataclasses import replace

import numpy as np
import pytest

from gearlib.models.trains.elements import Mesh
from tests.references.described_models import describe
from tests.references.reference_equations import machine_of
from tests.trains.random_trains import chain_train, planetary_train


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


@pytest.mark.parametrize("drawn", [chain_train, planetary_train])
def test_a_train_of_lines_of_action_is_the_train_of_positions(drawn):
    for seed in range(4):
        train = drawn(np.random.default_rng(seed))
        lines = [replace(mesh, position=None, line_of_action=mesh.line) for mesh in train.meshes]
        other = train.replace(meshes=lines)
        # Rounding of angles, on gears of up to some hundred teeth.
        apart = [other.phases[name] - train.phases[name] for name in train.phases]
        np.testing.assert_allclose(np.exp(2j * np.pi * np.array(apart)), 1.0, rtol=0, atol=1e-9)
        found, wanted = (machine_of(describe(one), 1.0).modes()[2] for one in (other, train))
        np.testing.assert_allclose(found, wanted, rtol=0, atol=1e-12 * np.abs(wanted).max())
