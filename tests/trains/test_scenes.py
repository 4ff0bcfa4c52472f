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
#: Tunings at which both stages bounce, the first alone, and none.
BOUNCING = [0.96, 1.4, 1.2]


@pytest.fixture(scope="module")
def scene():
    """The characteristics of the reducer over tunings, for three cases of its branches."""
    return trains.reducer(PAIR.as_dict(), [0.84, *BOUNCING], SETTINGS)


def test_branches_without_errors_carry_equal_loads(scene):
    alike = scene.sel(case="alike", direction="cold", tuning=BOUNCING)
    assert (alike.fraction_normal_high < 1.0).any("tuning").all() and (alike.settled == 1).all()
    # All starts end on one stable orbit, in which no branch loses contact or strikes alone.
    assert abs(alike.load_sharing - 1.0).max() < 1e-9
    assert not alike.lost_alone_share.any() and not alike.struck_alone_share.any()
    by_stage = alike.dynamic_factor.groupby(alike.mesh_stage)
    assert (by_stage.max() - by_stage.min()).max() < 1e-9
    for name in ("dynamic_factor", "load_sharing", "fraction_normal"):
        assert (alike[f"{name}_low"] == alike[f"{name}_high"]).all()


def test_the_table_holds_a_row_for_each_mesh(scene, tmp_path):
    rows = read_back(trains.reducer_rows(scene), tmp_path)
    cases, directions, meshes = 3, 3, 6
    assert len(rows) == cases * directions * meshes
    # At tuning 0.84 the branch 1, which has an error in one case, loses contact alone.
    tunings = [row["contact_lost_in_its_branch_only_at"].split() for row in rows]
    lost = {row["mesh"] for row, lost_at in zip(rows, tunings, strict=True) if "0.84" in lost_at}
    assert lost == {"first 1", "second 1"}
