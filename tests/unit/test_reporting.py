"""Tables as pages of the report."""

import pytest

from gearlib.data import tables


@pytest.mark.parametrize("cell", ["a, b", "x < 1 & y", "line\nbreak"])
def test_a_table_shows_what_the_csv_holds(tmp_path, cell):
    source, path = tmp_path / "some_table.csv", tmp_path / "some_table.html"
    source.write_text(f'first_column,second\n"{cell}",2\n', encoding="utf-8")
    tables.write_table_page(source, path)
    text = path.read_text(encoding="utf-8")
    escaped = cell.replace("&", "&amp;").replace("<", "&lt;")
    assert f"<td>{escaped}</td><td>2</td>" in text
    assert "<th>first column</th>" in text
