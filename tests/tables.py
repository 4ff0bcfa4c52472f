"""Write a table of a study to a CSV file and read it back."""

import csv

from gearlib.data.files import write_csv


def read_back(rows, folder):
    """Write the rows of a table to a CSV file in a folder and read them back.

    Return one dict per row, which maps each column name to the string in the cell.
    """
    write_csv(rows, folder / "table.csv")
    with (folder / "table.csv").open(newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))
