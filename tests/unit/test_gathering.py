"""Check atomic writes, and that shards (datasets of parts of a study) are gathered correctly."""

import numpy as np
import pytest

from gearlib import GearPair, simulate, sweep, tunings
from gearlib.data import status, storage
from gearlib.data.files import atomic_write, remove_temporary_files, write_html_table
from gearlib.data.gathering import gather_phase_planes, gather_resonance

TUNINGS = [0.6, 0.7, 0.8, 0.9]
RATIOS = {"contact_ratio": 1.569, "stiffness_ratio": 0.5879, "backlash_ratio": 4.0}
GEAR_PAIRS = {
    name: GearPair.from_ratios(**RATIOS, damping=k) for name, k in (("a", 0.06), ("b", 0.0))
}


def sweep_window(damping, direction, tunings, periods=20):
    """Return a sweep of the pair with a given damping, as computed by a job of the workflow."""
    run_options = {"periods": periods, "record_periods": 4, "threads": 1}
    shard = sweep(GEAR_PAIRS[damping], tunings, direction=direction, **run_options)
    return shard.assign_coords(damping=damping, direction=direction)


def test_results_do_not_depend_on_the_windows_of_a_sweep(tmp_path):
    """The gathered file must be the same for one, three and many windows, because runs from rest
    ("cold") do not depend on each other.
    """
    # In this range the motion jumps and loses contact. The narrowest windows have one tuning each.
    start, stop, step = 0.5, 1.4, 0.05
    contents = []
    for width in (0.9, 0.3, step):
        shards = []
        for number, window_ends in enumerate(tunings.windows(start, stop, step, width)):
            shard = sweep_window("a", "cold", tunings.grid(*window_ends, step), periods=120)
            storage.write(shard, tmp_path / f"{number}.nc")
            shards.append(storage.read(tmp_path / f"{number}.nc"))
        storage.write(gather_resonance(shards), tmp_path / "whole.nc")
        contents.append((tmp_path / "whole.nc").read_bytes())
    assert contents[0] == contents[1] == contents[2]


def test_shards_that_do_not_match_are_refused():
    """A missing shard or a different scale must be refused for phase planes and for sweeps."""
    run_options = {"periods": 6, "record_periods": 2, "samples_per_period": 8}
    planes = [
        simulate(pair, tuning, **run_options).assign_coords(damping=name)
        for name, pair in GEAR_PAIRS.items()
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
        sweep_window(name, direction, tunings_of_window)
        for name in GEAR_PAIRS
        for direction in windows_by_direction
        for tunings_of_window in windows_by_direction[direction]
    ]
    with pytest.raises(ValueError):
        gather_resonance(windows[1:])


def test_upward_runs_are_nan_at_tunings_reached_only_downwards():
    """Where only the downward sweep has results, the runs from rest ("cold") must be NaN."""
    cold_shard, down_shard = (
        sweep_window("a", "cold", TUNINGS[2:]),
        sweep_window("a", "down", TUNINGS),
    )
    gathered = gather_resonance([cold_shard, down_shard])
    cold = gathered.sel(damping="a", direction="cold")
    np.testing.assert_array_equal(cold.displacement_max[2:], cold_shard.displacement_max)
    assert np.isnan(cold.displacement_max[:2]).all()
    assert (cold.status[:2] == status.NO_START).all() and (cold.period[:2] == 0).all()
    np.testing.assert_array_equal(gathered.mesh_frequency, down_shard.mesh_frequency)
    # Only the upper end of the tunings of the downward sweep is allowed for runs from rest.
    for wrong_tunings in (TUNINGS[:2], [0.8, 0.95]):
        with pytest.raises(ValueError):
            gather_resonance([sweep_window("a", "cold", wrong_tunings), down_shard])


def test_a_failed_write_leaves_the_old_file_unchanged(tmp_path):
    """An error during an atomic write must leave neither a partial nor a temporary file."""
    path = tmp_path / "new folder/result.txt"
    with atomic_write(path) as temporary:
        temporary.write_text("first")
        assert not path.exists() and temporary.suffix == path.suffix
    with pytest.raises(RuntimeError), atomic_write(path) as temporary:
        temporary.write_text("half")
        raise RuntimeError
    assert path.read_text() == "first" and list(path.parent.iterdir()) == [path]
    # Temporary files of a killed process are removed, but other hidden files remain.
    for name in (".123.result.nc", ".hidden"):
        (path.parent / name).touch()
    remove_temporary_files(path.parent)
    assert {entry.name for entry in path.parent.iterdir()} == {".hidden", path.name}


@pytest.mark.parametrize("cell", ["a, b", "x < 1 & y", "line\nbreak"])
def test_an_html_table_matches_its_csv_file(tmp_path, cell):
    """The HTML table must hold the cells of the CSV file, with special characters escaped."""
    source, path = tmp_path / "some_table.csv", tmp_path / "some_table.html"
    source.write_text(f'first_column,second\n"{cell}",2\n', encoding="utf-8")
    write_html_table(source, path)
    text = path.read_text(encoding="utf-8")
    escaped = cell.replace("&", "&amp;").replace("<", "&lt;")
    assert f"<td>{escaped}</td><td>2</td>" in text and "<th>first column</th>" in text
