"""Tables as HTML pages that need nothing else: browsers do not show CSV."""

import csv
from html import escape
from pathlib import Path

from gearlib.data.files import replacing

_PAGE = """<!doctype html>
<html lang="en">
<head>
<meta charset="utf-8">
<title>{title}</title>
<style>
body {{ font: 15px/1.4 system-ui, sans-serif; color: #222; background: #fff; margin: 1.5em; }}
table {{ border-collapse: collapse; font-variant-numeric: tabular-nums; }}
th, td {{ padding: 0.35em 0.8em; text-align: left; vertical-align: top; max-width: 30em; }}
th {{ position: sticky; top: 0; background: #444; color: #fff; }}
td {{ border-bottom: 1px solid #ddd; overflow-wrap: break-word; }}
</style>
</head>
<body>
<p>{gears}</p>
<table>
<thead>{head}</thead>
<tbody>
{body}
</tbody>
</table>
</body>
</html>
"""


def write_table_page(csv_path, path, gears=""):
    """Write the table of a CSV file as a page, replacing the file in one step.

    Its first row names the columns; ``_`` in names is shown as a space. Above stands the name of
    the gears that it is about.
    """
    with open(csv_path, newline="", encoding="utf-8") as file:
        header, *rows = csv.reader(file)
    lines = [_row("th", [name.replace("_", " ") for name in header])]
    lines += [_row("td", row) for row in rows]
    head, *body = lines
    title = escape(Path(csv_path).stem.replace("_", " "))
    parts = {"title": title, "gears": escape(gears), "head": head, "body": "\n".join(body)}
    with replacing(path) as temporary:
        temporary.write_text(_PAGE.format(**parts), "utf-8")


def _row(tag, cells):
    return f"<tr>{''.join(f'<{tag}>{escape(cell)}</{tag}>' for cell in cells)}</tr>"
