"""Files: whole or none, tables as pages."""

import pytest

from gearlib.data.files import remove_leftovers, replacing, write_table_page


def test_a_file_appears_whole_or_stays_as_it_was(tmp_path):
    path = tmp_path / "new folder/result.txt"
    with replacing(path) as temporary:
        temporary.write_text("first")
        assert not path.exists() and temporary.suffix == path.suffix
    with pytest.raises(RuntimeError), replacing(path) as temporary:
        temporary.write_text("half")
        raise RuntimeError
    assert path.read_text() == "first" and list(path.parent.iterdir()) == [path]
    # What a killed process left is removed.
    for name in (".123.result.nc", ".hidden"):
        (path.parent / name).touch()
    remove_leftovers(path.parent)
    assert {entry.name for entry in path.parent.iterdir()} == {".hidden", path.name}


@pytest.mark.parametrize("cell", ["a, b", "x < 1 & y", "line\nbreak"])
def test_a_table_shows_what_the_csv_holds(tmp_path, cell):
    source, path = tmp_path / "some_table.csv", tmp_path / "some_table.html"
    source.write_text(f'first_column,second\n"{cell}",2\n', encoding="utf-8")
    write_table_page(source, path)
    text = path.read_text(encoding="utf-8")
    escaped = cell.replace("&", "&amp;").replace("<", "&lt;")
    assert f"<td>{escaped}</td><td>2</td>" in text and "<th>first column</th>" in text
