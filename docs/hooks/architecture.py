"""The picture of the house, `images/architecture.svg`: folders, duties, direction of imports.

Nothing is drawn by hand: the layers are those of the import contract in pyproject.toml, the duties
of the modules those of the table in `gearlib/__init__.py`, the folders beside the package those of
the table in docs/architecture.md.
"""

import html
import re
import textwrap
import tomllib
from pathlib import Path

from mkdocs.structure.files import File

import gearlib
from tables import rows

ROOT = Path(__file__).resolve().parents[2]
PICTURE = "images/architecture.svg"

_WIDTH, _LEFT, _GAP, _PAD = 1180, 46, 8, 8
_NAME, _SMALL = 14, 11.5  # font sizes
_LINE = 14  # height of a line of small print
_CHARACTER = 5.75  # mean width of a character of small print
_MOST = 370  # widest box
_FILL = {"folder": "#dce8f2", "module": "#f6f6f4", "beside": "#f3e9d8"}


def on_files(files, config):
    """Add the picture."""
    files.append(File.generated(config, PICTURE, content=picture()))
    return files


def layers():
    """Return the layers of the import contract, from the top; each a list of modules."""
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    contract = settings["tool"]["importlinter"]["contracts"][0]
    return [re.split(r"\s*[|:]\s*", layer) for layer in contract["layers"]]


def duties():
    """Return module -> its responsibility, from the table of the package."""
    table = {name.strip("`"): words for name, words in rows(gearlib.__doc__)[1:]}
    table["__main__"] = "`python -m gearlib`"
    return table


def beside():
    """Return folder -> its responsibility for the folders beside the package."""
    text = (ROOT / "docs/architecture.md").read_text(encoding="utf-8")
    return dict(re.findall(r"^\| (`.*?) \| (.*?) \|$", text, re.M))


def picture():
    """Return the picture as SVG."""
    parts, y = [], 30
    parts.append(_text(_LEFT, y, "Beside the package", 15, bold=True))
    y = _row(parts, y + 12, [(n.replace("`", ""), d, "beside") for n, d in beside().items()])
    y += 26
    note = "The package gearlib: a module imports from lower rows only"
    parts.append(_text(_LEFT, y, note, 15, bold=True))
    top = y + 12
    y, words = top, duties()
    for layer in layers():
        boxes = [(_path(name), words[name], _kind(name)) for name in layer]
        y = _row(parts, y, boxes) + _GAP
    parts.append(_arrow(top, y - _GAP))
    size = f'width="{_WIDTH}" height="{y + 10}" viewBox="0 0 {_WIDTH} {y + 10}"'
    head = f'<svg xmlns="http://www.w3.org/2000/svg" {size} font-family="sans-serif">'
    title = "<title>Folders of gearlib, their duties and the direction of imports</title>"
    ground = f'<rect width="{_WIDTH}" height="{y + 10}" fill="white"/>'
    return "\n".join([head, title, ground, *parts, "</svg>", ""])


def _kind(name):
    return "folder" if (ROOT / "gearlib" / name).is_dir() else "module"


def _path(name):
    return f"{name}/" if _kind(name) == "folder" else f"{name}.py"


def _row(parts, y, boxes):
    """Draw boxes (name, duty, kind) side by side, at most five in a row; return where they end."""
    if len(boxes) > 5:
        half = (len(boxes) + 1) // 2
        return _row(parts, _row(parts, y, boxes[:half]) + _GAP, boxes[half:])
    width = min((_WIDTH - _LEFT - 10 - _GAP * (len(boxes) - 1)) / len(boxes), _MOST)
    characters = int((width - 2 * _PAD) / _CHARACTER)
    prints = [textwrap.wrap(duty.replace("`", ""), characters) for _, duty, _ in boxes]
    heads = [textwrap.wrap(name, int(characters * _SMALL / _NAME * 0.9)) for name, _, _ in boxes]
    head = (_NAME + 4) * max(map(len, heads))
    height = 2 * _PAD + head + _LINE * max(map(len, prints))
    for i, (names, (_, _, kind), lines) in enumerate(zip(heads, boxes, prints, strict=True)):
        x = _LEFT + i * (width + _GAP)
        parts.append(
            f'<rect class="{kind}" x="{x:.1f}" y="{y}" width="{width:.1f}" height="{height}" '
            f'rx="4" fill="{_FILL[kind]}" stroke="#8a8f94"/>'
        )
        for j, name in enumerate(names):
            at = y + _PAD + (_NAME + 4) * (j + 1) - 6
            parts.append(_text(x + _PAD, at, name, _NAME, bold=True, mark="name"))
        for j, line in enumerate(lines):
            at = y + _PAD + (_NAME + 4) * len(names) + _LINE * (j + 1) - 4
            parts.append(_text(x + _PAD, at, line, _SMALL))
    return y + height


def _arrow(top, bottom):
    return (
        f'<path d="M 22 {top} V {bottom - 8} M 14 {bottom - 16} L 22 {bottom} L 30 {bottom - 16}" '
        'fill="none" stroke="#33566e" stroke-width="3"/>'
    )


def _text(x, y, words, size, bold=False, mark=None):
    weight = ' font-weight="bold"' if bold else ""
    kind = f' class="{mark}"' if mark else ""
    return f'<text{kind} x="{x:.1f}" y="{y}" font-size="{size}"{weight}>{html.escape(words)}</text>'
