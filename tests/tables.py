"""Tables of studies as who opens the file reads them."""

import csv

from gearlib.data.files import write_table


def read_back(rows, folder):
    """Return the rows of a table, written and read again: dicts of texts by column."""
    write_table(rows, folder / "table.csv")
    with (folder / "table.csv").open(newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))
