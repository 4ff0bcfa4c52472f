"""The folder of machine code: which one is taken."""

import os
import tempfile

from gearlib.engines.cache import cache_folder


def test_where_nothing_can_be_written_a_temporary_folder_is_taken(tmp_path, monkeypatch):
    (tmp_path / "file").touch()
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "file"))
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    folder = cache_folder()
    assert os.path.dirname(folder) == str(tmp_path / f"gearlib-{os.getuid()}")
    assert os.path.isdir(folder)
