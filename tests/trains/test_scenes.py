"""The reducer over speed: symmetry, closed forms, other routes."""

import pytest

from gearlib import GearPair
from gearlib.config import load
from gearlib.studies import trains
from tests.paper import CONFIG as PROJECT
from tests.tables import read_back

CONFIG = load(PROJECT)
PAIR = GearPair(**CONFIG.pair_parameters(CONFIG.reducer.damping))
FEW = {"starts": 4, "first_starts": 2}
SETTINGS = CONFIG.reducer.model_dump() | {"periods": 84, "record_periods": 42} | FEW
TRAIN = trains.reducer_train(PAIR, SETTINGS)
#: Both stages bounce, the first alone, none.
BOUNCING = [0.96, 1.4, 1.2]


@pytest.fixture(scope="module")
def scene():
    return trains.reducer(PAIR.as_dict(), [0.84, *BOUNCING], SETTINGS)


def test_alike_branches_carry_a_third_each(scene):
    alike = scene.sel(case="alike", direction="cold", tuning=BOUNCING)
    assert (alike.fraction_normal_high < 1.0).any("tuning").all() and (alike.settled == 1).all()
    # On one stable orbit, although they start apart.
    assert abs(alike.load_sharing - 1.0).max() < 1e-9
    assert not alike.lost_alone_share.any() and not alike.struck_alone_share.any()
    by_stage = alike.dynamic_factor.groupby(alike.mesh_stage)
    assert (by_stage.max() - by_stage.min()).max() < 1e-9
    for name in ("dynamic_factor", "load_sharing", "fraction_normal"):
        assert (alike[f"{name}_low"] == alike[f"{name}_high"]).all()


def test_the_table_holds_a_row_for_each_mesh(scene, tmp_path):
    branches = read_back(trains.reducer_rows(scene), tmp_path)
    assert len(branches) == 3 * 3 * 6
    alone = [row["mesh"] for row in branches if "0.84" in row[_LOST].split()]
    assert set(alone) == {"first 1", "second 1"}


_LOST = "contact_lost_in_its_branch_only_at"
