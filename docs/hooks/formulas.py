"""Formulas: TeX in the pages becomes MathML, which browsers draw without a script.

`pymdownx.arithmatex` finds the formulas; a display formula with ``\\tag{n}`` gets its number on the
right. Roots, braces and sums of the right size take a font made for formulas, STIX Two Math: the
package ziamath carries it, the site takes it along.
"""

import html
import importlib.util
import re
from pathlib import Path

from latex2mathml.converter import convert
from mkdocs.exceptions import PluginError
from mkdocs.structure.files import File

#: Where the style sheet looks for the font.
FONT = "styles/STIXTwoMath-Regular.ttf"

_INLINE = re.compile(r'<span class="arithmatex">\\\((.*?)\\\)</span>([.,;:)]*)', re.S)
_DISPLAY = re.compile(r'<div class="arithmatex">\s*\\\[(.*?)\\\]\s*</div>', re.S)
#: Dots are accents, primes are operators; latex2mathml says neither.
_DOTS = re.compile(r"<mover>((?:(?!</?mover>).)*)<mo>(&#x002D9;|&#x000A8;)</mo></mover>")
_PRIME = re.compile(r"<msup>(<mi>[^<]*</mi>)<mi>(&#x0203[23];)</mi></msup>")
_POSTFIX = r'<mrow>\1<mo form="postfix" lspace="0" rspace="0.1em">\2</mo></mrow>'
#: What the converter leaves of commands that it does not know.
_UNKNOWN = re.compile(r"<mi>(&|&amp;|\\[^<]*)</mi>")
_TAG = re.compile(r"\\tag\{([^}]*)\}")


def on_files(files, config):
    """Add the font."""
    package = Path(importlib.util.find_spec("ziamath").origin).parent
    path = package / "fonts" / Path(FONT).name
    files.append(File.generated(config, FONT, abs_src_path=str(path)))
    return files


def on_page_content(content, **_):
    """Replace the formulas of a page."""
    content = _INLINE.sub(_inline, content)
    return _DISPLAY.sub(_numbered, content)


def _mathml(tex, display):
    formula = convert(html.unescape(tex).strip(), display=display)
    formula = _DOTS.sub(r'<mover accent="true">\1<mo class="dots">\2</mo></mover>', formula)
    if _UNKNOWN.search(formula):
        raise PluginError(f"latex2mathml does not know all of the formula {tex!r}")
    return _PRIME.sub(_POSTFIX, formula)


def _inline(found):
    """Keep a formula and the comma behind it on one line."""
    formula = _mathml(found[1], "inline")
    return f'<span class="together">{formula}{found[2]}</span>' if found[2] else formula


def _numbered(found):
    tex = found[1]
    tag = _TAG.search(tex)
    formula = _mathml(_TAG.sub("", tex), "block")
    if not tag:
        return f'<div class="formula">{formula}</div>'
    return f'<div class="formula">{formula}<span class="number">({tag[1]})</span></div>'
