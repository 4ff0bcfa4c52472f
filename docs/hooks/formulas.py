"""Turn the TeX of the pages into MathML, which browsers draw without a script.

`pymdownx.arithmatex` finds the formulas. Roots, braces and sums need a font made for formulas:
the site includes STIX Two Math from the package ziamath.
"""

import html
import re
from pathlib import Path

import ziamath
from latex2mathml.converter import convert
from mkdocs.exceptions import PluginError
from mkdocs.structure.files import File

_INLINE = re.compile(r'<span class="arithmatex">\\\((.*?)\\\)</span>([.,;:)]*)', re.S)
_BLOCK = re.compile(r'<div class="arithmatex">\s*\\\[(.*?)(?:\\tag{(.*?)}\s*)?\\\]\s*</div>', re.S)
#: latex2mathml does not mark dots as accents, nor primes as operators.
_DOTS = re.compile(r"<mover>((?:(?!</?mover>).)*)<mo>(&#x002D9;|&#x000A8;)</mo></mover>")
_PRIME = re.compile(r"<msup>(<mi>[^<]*</mi>)<mi>(&#x0203[23];)</mi></msup>")
_UNKNOWN_COMMAND = re.compile(r"<mi>(&|&amp;|\\[^<]*)</mi>")


def on_files(files, config):
    """Add the font."""
    font = "STIXTwoMath-Regular.ttf"
    path = Path(ziamath.__file__).parent / "fonts" / font
    files.append(File.generated(config, f"styles/{font}", abs_src_path=str(path)))
    return files


def on_page_content(content, **_):
    """Replace the formulas of a page."""
    return _BLOCK.sub(_block, _INLINE.sub(_inline, content))


def _mathml(tex, display):
    """Return a formula as MathML."""
    formula = convert(html.unescape(tex).strip(), display=display)
    formula = _DOTS.sub(r'<mover accent="true">\1<mo class="dots">\2</mo></mover>', formula)
    if _UNKNOWN_COMMAND.search(formula):
        raise PluginError(f"latex2mathml does not know all commands of the formula {tex!r}")
    prime = r'<mrow>\1<mo form="postfix" lspace="0" rspace="0.1em">\2</mo></mrow>'
    return _PRIME.sub(prime, formula)


def _inline(match):
    """Keep a formula and the punctuation behind it on one line."""
    formula = _mathml(match[1], "inline")
    return f'<span class="together">{formula}{match[2]}</span>' if match[2] else formula


def _block(match):
    """Put the number of a formula on its right."""
    number = f'<span class="number">({match[2]})</span>' if match[2] else ""
    return f'<div class="formula">{_mathml(match[1], "block")}{number}</div>'
