"""A configuration to begin with: an example of drawn gears, each key explained as the schema does.

What may be left out stands there too, as a comment.
"""

import math
import re
import textwrap

import yaml

from gearlib import config
from gearlib.config.validation import allowed, node_at

#: What the file says, section by section.
_SAID = {
    "targets": ["resonance", "phase_planes"],
    "gears": {
        "pinion": {"teeth": 23, "module": "2.5 mm", "width": "18 mm"},
        "wheel": {"teeth": 61},
        "torque": "85 N m",
        "backlash": "80 um",
    },
    "dampings": {"usual": {"damping_ratio": 0.05, "backlash_damping_ratio": 0.0}},
    "resonance": {"step": 0.001},
    "phase_planes": {"tunings": [0.6, 0.8, 1.0]},
}
_HEAD = """\
A project of gearlib: put your gears here. Then
    gearlib gears --config {name}            says what their drawing comes to,
    gearlib sweep --config {name}            how they run,
    gearlib workflow --configfile {name}     computes the targets, into results/.
Keys that are comments may be left out. Numbers may have units, as 2.5 mm; bare ones are in SI.
The reference of the configuration has all keys; `gearlib schema` prints it for editors.
"""
_WIDTH = 96
_EXAMPLE = r" or a (text with its unit|speed) such as '[^']*'"


def text(name):
    """Return the text of the file `name`."""
    lines = [f"# {line}".rstrip() for line in _HEAD.format(name=name).splitlines()]
    seen: set = set()
    for key, value in _SAID.items():
        lines += ["", *_entry([key], value, "", seen)]
    return "\n".join(lines) + "\n"


def _entry(path, value, indent, seen):
    """Yield the lines of a key: what it means and may be, then its value, or those in it.

    Of what may be left out each is explained once.
    """
    key, schema = path[-1], config.schema()
    yield from _comment(_meaning(path, schema), indent)
    if not isinstance(value, dict):
        # A flow style in one line, whatever its width.
        line = yaml.safe_dump([value], default_flow_style=True, width=math.inf).strip()[1:-1]
        yield f"{indent}{key}: {line}"
        return
    yield f"{indent}{key}:"
    for inner, own in value.items():
        yield from _entry([*path, inner], own, f"{indent}  ", seen)
    for inner in node_at(path, schema).get("properties", {}):
        if inner not in value and inner not in seen:
            seen.add(inner)
            yield from _comment(f"{inner}: {_meaning([*path, inner], schema)}", f"{indent}  ", "  ")


def _meaning(path, schema):
    """Return in words what a key means, and what it may be unless that is a section."""
    node = node_at(path, schema)
    of_key = node_at(path[:-1], schema).get("properties", {}).get(path[-1], {})
    said = of_key.get("description", node.get("description", ""))
    if "properties" in node or "patternProperties" in node:
        return said
    # The values of this file show how units are written.
    return f"{said.rstrip('.')} ({re.sub(_EXAMPLE, '', allowed(node, schema))})"


def _comment(words, indent, more=""):
    own = textwrap.wrap(" ".join(words.split()), _WIDTH - len(indent), subsequent_indent=more)
    return [f"{indent}# {line}" for line in own]
