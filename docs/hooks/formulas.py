"""Turn the TeX of the pages into MathML, which browsers draw without a script.

`pymdownx.arithmatex` finds the formulas; a display formula with ``\\tag{n}`` gets its number on the
right. The site includes STIX Two Math, from the package ziamath, because roots, braces and sums
need a font made for formulas.
"""

import html
import importlib.util
import re
from pathlib import Path

from latex2mathml.converter import convert
from mkdocs.exceptions import PluginError
from mkdocs.structure.files import File

_FONT = "styles/STIXTwoMath-Regular.ttf"
_INLINE = re.compile(r'<span class="arithmatex">\\\((.*?)\\\)</span>([.,;:)]*)', re.S)
_DISPLAY = re.compile(
    r'<div class="arithmatex">\s*\\\[(.*?)(?:\\tag\{([^}]*)\}(.*?))?\\\]\s*</div>', re.S
)
#: latex2mathml does not mark dots as accents, nor primes as operators.
_DOTS = re.compile(r"<mover>((?:(?!</?mover>).)*)<mo>(&#x002D9;|&#x000A8;)</mo></mover>")
_PRIME = re.compile(r"<msup>(<mi>[^<]*</mi>)<mi>(&#x0203[23];)</mi></msup>")
_POSTFIX = r'<mrow>\1<mo form="postfix" lspace="0" rspace="0.1em">\2</mo></mrow>'
_UNKNOWN_COMMAND = re.compile(r"<mi>(&|&amp;|\\[^<]*)</mi>")


def on_files(files, config):
    """Add the font."""
    package = Path(importlib.util.find_spec("ziamath").origin).parent
    path = package / "fonts" / Path(_FONT).name
    files.append(File.generated(config, _FONT, abs_src_path=str(path)))
    return files


def on_page_content(content, **_):
    """Replace the formulas of a page."""
    return _DISPLAY.sub(_display, _INLINE.sub(_inline, content))


def _mathml(tex, display):
    formula = convert(html.unescape(tex).strip(), display=display)
    formula = _DOTS.sub(r'<mover accent="true">\1<mo class="dots">\2</mo></mover>', formula)
    if _UNKNOWN_COMMAND.search(formula):
        raise PluginError(f"latex2mathml does not know all commands of the formula {tex!r}")
    return _PRIME.sub(_POSTFIX, formula)


def _inline(match):
    """Keep a formula and the punctuation behind it on one line."""
    formula = _mathml(match[1], "inline")
    return f'<span class="together">{formula}{match[2]}</span>' if match[2] else formula


def _display(match):
    before, tag, after = match.groups(default="")
    number = f'<span class="number">({tag})</span>' if tag else ""
    return f'<div class="formula">{_mathml(before + after, "block")}{number}</div>'
