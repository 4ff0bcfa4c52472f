"""Tables in docstrings (reStructuredText, ruled by ``====``) as tables of Markdown."""

import re


def rows(text):
    """Return the rows of the first table in a text, its head included, each a list of cells.

    A line whose first column is empty continues the row above it.
    """
    lines = text.splitlines()
    rules = [i for i, line in enumerate(lines) if re.fullmatch(r"=+( +=+)+", line.strip())]
    if not rules:
        return []
    rule = lines[rules[0]]
    starts = [found.start() for found in re.finditer(r"=+", rule)]
    ends = [*starts[1:], None]
    found = []
    for i in range(rules[0] + 1, rules[-1]):
        if i in rules:
            continue
        cells = [lines[i][a:b].strip() for a, b in zip(starts, ends, strict=True)]
        if not cells[0] and found:
            found[-1] = [f"{old} {new}".strip() for old, new in zip(found[-1], cells, strict=True)]
        else:
            found.append(cells)
    return found


def markdown(text):
    """Return a docstring with its first table as one of Markdown, the rest as it is."""
    table = rows(text)
    if not table:
        return text
    lines = text.splitlines()
    rules = [i for i, line in enumerate(lines) if re.fullmatch(r"=+( +=+)+", line.strip())]
    head, *body = [[_plain(cell) for cell in row] for row in table]
    middle = [f"| {' | '.join(row)} |" for row in [head, ["---"] * len(head), *body]]
    return "\n".join([*lines[: rules[0]], *middle, *lines[rules[-1] + 1 :]])


def _plain(cell):
    """Return a cell without what Markdown would take for markup: code in one pair of backticks."""
    return (
        cell.replace("``", "`").replace("|", "\\|").replace("_", "\\_" if "`" not in cell else "_")
    )
