"""Shards become one dataset, whatever the numbers in them."""

import numpy as np
import pytest

from gearlib import GearPair, simulate, sweep, tunings
from gearlib.data import storage
from gearlib.data.gathering import gather_phase_planes, gather_resonance

TUNINGS = [0.6, 0.7, 0.8, 0.9]
DAMPINGS = {"k1": (0.06, 0.0), "conservative": (0.0, 0.0)}


def pair(damping):
    material, oil = DAMPINGS[damping]
    return GearPair.from_ratios(
        contact_ratio=1.569,
        stiffness_ratio=0.5879,
        damping=material,
        backlash_damping=oil,
        backlash=4.0,
    )


def window(damping, direction, tunings):
    run = {"periods": 20, "record_periods": 4, "threads": 1}
    shard = sweep(pair(damping), tunings, direction=direction, **run)
    return shard.assign_coords(damping=damping, direction=direction)


def plane(damping, tuning):
    run = {"periods": 6, "record_periods": 2, "samples_per_period": 8}
    return simulate(pair(damping), tuning, **run).assign_coords(damping=damping)


@pytest.fixture(scope="module")
def windows():
    return [
        window(damping, direction, part)
        for damping in DAMPINGS
        for direction in ("cold", "up")
        for part in ([TUNINGS[:2], TUNINGS[2:]] if direction == "cold" else [TUNINGS])
    ]


@pytest.fixture(scope="module")
def planes():
    return [plane(damping, tuning) for damping in DAMPINGS for tuning in TUNINGS]


def test_bytes_do_not_depend_on_how_a_sweep_is_cut(tmp_path):
    # With a jump; several runs side by side where it bounces. The narrowest windows hold one
    # tuning.
    grid, whole = (0.5, 1.4, 0.025), []
    for width in (0.9, 0.3, 0.025):
        shards = []
        for first, last in tunings.windows(*grid, width):
            part = tunings.grid(first, last, grid[2])
            run = {"periods": 120, "record_periods": 24, "threads": 1}
            shard = sweep(pair("k1"), part, **run)
            path = tmp_path / f"{first}-{last}.nc"
            storage.write(shard.assign_coords(damping="k1", direction="cold"), path)
            shards.append(storage.read(path))
        storage.write(gather_resonance(shards), tmp_path / "whole.nc")
        whole.append((tmp_path / "whole.nc").read_bytes())
    assert whole[0] == whole[1] == whole[2]


def test_every_window_finds_its_place(windows):
    whole = gather_resonance(windows)
    assert whole.displacement_max.dims == ("damping", "direction", "tuning")
    assert whole.damping.values.tolist() == list(DAMPINGS)
    assert whole.direction.values.tolist() == ["cold", "up"]
    assert whole.tuning.values.tolist() == TUNINGS
    cold = sweep(pair("conservative"), TUNINGS, periods=20, record_periods=4)
    found = whole.sel(damping="conservative", direction="cold")
    for name in ("displacement_max", "final_state", "period", "mesh_frequency"):
        np.testing.assert_array_equal(found[name], cold[name])


def test_a_downward_sweep_may_go_on_below_the_others(windows):
    found = gather_resonance([*windows[:3], window("k1", "down", [0.3, *TUNINGS])])
    assert found.tuning.size == len(TUNINGS) + 1 and found.speed.notnull().all()
    assert np.isnan(found.displacement_max.sel(direction="up")[0, 0])
    assert found.status.sel(direction="up").values[0].tolist() == [7, *[0] * len(TUNINGS)]


def test_shards_that_do_not_match_are_refused(windows, planes):
    with pytest.raises(ValueError):
        gather_resonance(windows[1:])
    with pytest.raises(ValueError):
        gather_phase_planes(planes[1:])
    heavier = [*planes[:-1], planes[-1].assign(force_scale=2.0)]
    with pytest.raises(ValueError, match="differ in their scales"):
        gather_phase_planes(heavier)
    with pytest.raises(ValueError, match="differ in their scales"):
        gather_phase_planes([planes[0], planes[1].assign(force_scale=2.0)])
