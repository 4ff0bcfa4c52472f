"""Files, whole or none; shards become one dataset, whatever the numbers in them."""

import numpy as np
import pytest

from gearlib import GearPair, simulate, sweep, tunings
from gearlib.data import status, storage
from gearlib.data.files import atomic_write, remove_temporary_files, write_html_table
from gearlib.data.gathering import gather_phase_planes, gather_resonance

TUNINGS = [0.6, 0.7, 0.8, 0.9]
RATIOS = {"contact_ratio": 1.569, "stiffness_ratio": 0.5879, "backlash_ratio": 4.0}
PAIRS = {name: GearPair.from_ratios(**RATIOS, damping=k) for name, k in (("a", 0.06), ("b", 0.0))}


def window(damping, direction, tunings, periods=20):
    """Return a sweep of a pair over some tunings, as a job of the workflow computes it."""
    run = {"periods": periods, "record_periods": 4, "threads": 1}
    shard = sweep(PAIRS[damping], tunings, direction=direction, **run)
    return shard.assign_coords(damping=damping, direction=direction)


def test_results_do_not_depend_on_the_windows_of_a_sweep(tmp_path):
    """Divide a sweep into one, three and many windows and compare the gathered files."""
    # The motion jumps and bounces in this range. The narrowest windows hold one tuning.
    start, stop, step = 0.5, 1.4, 0.05
    files = []
    for width in (0.9, 0.3, step):
        shards = []
        for number, window_ends in enumerate(tunings.windows(start, stop, step, width)):
            shard = window("a", "cold", tunings.grid(*window_ends, step), periods=120)
            storage.write(shard, tmp_path / f"{number}.nc")
            shards.append(storage.read(tmp_path / f"{number}.nc"))
        storage.write(gather_resonance(shards), tmp_path / "whole.nc")
        files.append((tmp_path / "whole.nc").read_bytes())
    assert files[0] == files[1] == files[2]


def test_shards_that_do_not_match_are_refused():
    """Leave out a shard and change a scale, for phase planes and for windows of sweeps."""
    run = {"periods": 6, "record_periods": 2, "samples_per_period": 8}
    planes = [
        simulate(pair, tuning, **run).assign_coords(damping=name)
        for name, pair in PAIRS.items()
        for tuning in TUNINGS
    ]
    gathered = gather_phase_planes(planes)
    np.testing.assert_array_equal(
        gathered.sel(damping="a", tuning=0.8).velocity, planes[2].velocity
    )
    with pytest.raises(ValueError):
        gather_phase_planes(planes[1:])
    with pytest.raises(ValueError, match="differ in their scales"):
        gather_phase_planes([*planes[:-1], planes[-1].assign(force_scale=2.0)])
    windows_by_direction = {"cold": [TUNINGS[2:], TUNINGS[:2]], "up": [TUNINGS]}
    windows = [
        window(name, direction, part)
        for name in PAIRS
        for direction in windows_by_direction
        for part in windows_by_direction[direction]
    ]
    with pytest.raises(ValueError):
        gather_resonance(windows[1:])


def test_upward_runs_are_nan_at_tunings_reached_only_downwards():
    """Gather a run from rest over a part of the tunings of a downward sweep."""
    shards = [window("a", "cold", TUNINGS[2:]), window("a", "down", TUNINGS)]
    gathered = gather_resonance(shards)
    cold = gathered.sel(damping="a", direction="cold")
    np.testing.assert_array_equal(cold.displacement_max[2:], shards[0].displacement_max)
    assert np.isnan(cold.displacement_max[:2]).all()
    assert (cold.status[:2] == status.NO_START).all() and (cold.period[:2] == 0).all()
    np.testing.assert_array_equal(gathered.mesh_frequency, shards[1].mesh_frequency)
    # Other tunings than those at the upper end do not fit.
    for other in (TUNINGS[:2], [0.8, 0.95]):
        with pytest.raises(ValueError):
            gather_resonance([window("a", "cold", other), shards[1]])


def test_a_failed_write_leaves_the_old_file_unchanged(tmp_path):
    path = tmp_path / "new folder/result.txt"
    with atomic_write(path) as temporary:
        temporary.write_text("first")
        assert not path.exists() and temporary.suffix == path.suffix
    with pytest.raises(RuntimeError), atomic_write(path) as temporary:
        temporary.write_text("half")
        raise RuntimeError
    assert path.read_text() == "first" and list(path.parent.iterdir()) == [path]
    # Temporary files that a killed process left behind are removed.
    for name in (".123.result.nc", ".hidden"):
        (path.parent / name).touch()
    remove_temporary_files(path.parent)
    assert {entry.name for entry in path.parent.iterdir()} == {".hidden", path.name}


@pytest.mark.parametrize("cell", ["a, b", "x < 1 & y", "line\nbreak"])
def test_a_printed_table_matches_its_csv_file(tmp_path, cell):
    source, path = tmp_path / "some_table.csv", tmp_path / "some_table.html"
    source.write_text(f'first_column,second\n"{cell}",2\n', encoding="utf-8")
    write_html_table(source, path)
    text = path.read_text(encoding="utf-8")
    escaped = cell.replace("&", "&amp;").replace("<", "&lt;")
    assert f"<td>{escaped}</td><td>2</td>" in text and "<th>first column</th>" in text
