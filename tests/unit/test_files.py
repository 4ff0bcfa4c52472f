"""Whole files or none."""

import numpy as np
import pytest
import xarray as xr

from gearlib.data import storage
from gearlib.data.files import remove_leftovers, replacing


def test_a_file_appears_whole_or_stays_as_it_was(tmp_path):
    path = tmp_path / "new folder/result.txt"
    with replacing(path) as temporary:
        temporary.write_text("first")
        assert not path.exists() and temporary.suffix == path.suffix
    with pytest.raises(RuntimeError), replacing(path) as temporary:
        temporary.write_text("half")
        raise RuntimeError
    assert path.read_text() == "first"
    assert list(path.parent.iterdir()) == [path]


def test_what_a_killed_process_left_is_removed(tmp_path):
    for name in (".123.result.nc", ".hidden", "result.nc"):
        (tmp_path / name).touch()
    remove_leftovers(tmp_path)
    assert sorted(path.name for path in tmp_path.iterdir()) == [".hidden", "result.nc"]


def test_numbers_are_compressed(tmp_path):
    numbers = {"floats": ("time", np.full(20_000, 0.1)), "counts": ("time", np.arange(20_000))}
    for name, (dimension, values) in numbers.items():
        storage.write(xr.Dataset({name: (dimension, values)}), tmp_path / name)
        assert (tmp_path / name).stat().st_size < 0.3 * values.nbytes
        assert storage.read(tmp_path / name)[name].values.tobytes() == values.tobytes()
