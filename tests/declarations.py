"""Make values just outside and just inside the range of a declaration of `gearlib.parameters`.

The limits are read from the requirement in words, such as "a finite number > 0".
"""

import math
import re
from typing import Annotated, Literal, get_args, get_origin

import gearlib
from gearlib import geometry
from gearlib import parameters as p
from gearlib.config import validation
from gearlib.config.configuration import Config
from gearlib.config.gear_pair_section import Damping
from gearlib.config.train_section import GearboxSection
from tests.geometry.stages import fzg_c
from tests.paper import CONFIG, PAPER_PAIR

#: A key that a user may choose in a mapping; config.yaml has a damping of this name.
MAPPING_KEY = "k1"
EXAMPLE_BODY = gearlib.Body(name="a", inertia=0.01, base_radius=0.1, teeth=20, torque=100.0)
EXAMPLE_MESH = gearlib.Mesh(
    pinion="a", wheel="b", max_stiffness=4e8, stiffness_ratio=0.6, contact_ratio=1.5
)
#: Valid instances by class, for classes whose declarations do not state all requirements.
EXAMPLES = {
    type(x): x
    for x in (EXAMPLE_BODY, EXAMPLE_MESH, PAPER_PAIR, fzg_c(), fzg_c().pinion, gearlib.Harmonics())
}
EXAMPLES[Damping] = CONFIG["dampings"][MAPPING_KEY]
EXAMPLES[GearboxSection] = {"file": "box.rexs"}
EXAMPLES[Config] = {key: CONFIG[key] for key in ("gear_pair", "dampings")}
PUBLIC_OBJECTS = {
    name: getattr(module, name) for module in (gearlib, geometry) for name in module.__all__
}
#: Public classes, functions and methods with declared parameters, without classes of results.
DECLARED_CALLABLES = {call for call in PUBLIC_OBJECTS.values() if callable(call)}
DECLARED_CALLABLES -= {geometry.DynamicFactor, geometry.IsoStiffness, geometry.MeshStiffness}
DECLARED_CALLABLES |= {
    gearlib.GearPair.from_ratios,
    gearlib.Harmonics.from_table,
    geometry.SpurGear.thickness_at,
}
DECLARED_CALLABLES |= {gearlib.LoadSharingPair.from_geometry, geometry.GearStage.transmission_error}
_BOUND = re.compile(r"(>=|>|<=|<|from|to) (-?)(pi / [234]|2 pi|\d[\d.e+-]*)")
_PI = {"2 pi": math.tau} | {f"pi / {n}": math.pi / n for n in (2, 3, 4)}


def boundary_numbers(requirement):
    """Return the numbers just outside and just inside a range given in words.

    The first list also has numbers that no such range allows: NaN, infinities that the words do
    not mention, and a fraction for integers.
    """
    is_integer = "integer" in requirement
    convert = int if is_integer else float
    forbidden = [math.nan]
    if is_integer:
        forbidden.append(1.5)
    if "-inf" not in requirement:
        forbidden.append(-math.inf)
    if "infin" not in requirement and ".inf" not in requirement:
        forbidden.append(math.inf)
    allowed = []
    for comparison, minus, digits in _BOUND.findall(requirement):
        bound = (_PI.get(digits) or convert(digits)) * (-1 if minus else 1)
        # The step must be so large that its square is not 0.
        outward_step = 1 if is_integer else max(1e-12, abs(bound) * 1e-12)
        if comparison in (">", ">=", "from"):
            outward_step = -outward_step
        if comparison in "<>":  # an exclusive bound
            forbidden.append(bound)
            allowed.append(bound - outward_step)
        else:
            forbidden.append(bound + outward_step)
            allowed.append(bound)
    return forbidden, allowed or [0]


def child_annotations(annotation):
    """Return the annotations of the keys of a section by name.

    A mapping with keys that users choose has the single key `MAPPING_KEY`.
    """
    base, _ = p.split_annotation(annotation)
    if get_origin(base) is dict:
        return {MAPPING_KEY: get_args(base)[1]}
    fields = getattr(base, "__pydantic_fields__", {}).items()
    return {key: Annotated[(x.annotation, *x.metadata, x)] for key, x in fields}


def example_value(annotation):
    """Return a value that an annotation allows; a section gets its required keys only."""
    base, requirement = p.split_annotation(annotation)[0], p.describe_requirement(annotation)
    if p.is_union(base):
        return example_value(get_args(base)[0])
    if base in (int, float):
        _, allowed = boundary_numbers(requirement)
        return 1 if min(allowed) <= 1 <= max(allowed) else base(sum(allowed) / len(allowed))
    if get_origin(base) in (list, tuple):
        count = re.match(r"(one value or )?a list of (\d+)", requirement)
        return [example_value(get_args(base)[0])] * (int(count[2]) if count else 1)
    if base in EXAMPLES:
        return EXAMPLES[base]
    if keys := child_annotations(base):
        fields = getattr(base, "__pydantic_fields__", {})
        required = {key for key in keys if key not in fields or fields[key].is_required()}
        return {key: example_value(child) for key, child in keys.items() if key in required}
    if get_origin(base) is Literal:
        return get_args(base)[0]
    return True if base is bool else MAPPING_KEY


def invalid_values(annotation, format_value):
    """Yield values that an annotation forbids, as (value, index, beginning of the problem).

    `index` is the position of the forbidden entry in a list, such as "[1]", else empty.
    `format_value` formats a value as in error messages, which differ between files and calls.
    """
    in_file = format_value is validation.format_value
    (base, metadata), requirement = (
        p.split_annotation(annotation),
        p.describe_requirement(annotation, in_file),
    )
    if get_origin(base) in (list, tuple):
        yield from invalid_lists(annotation, format_value)
        entries, values = example_value(annotation), []
        if "least one" in requirement:
            values.append([])
        if "one value or" not in requirement:
            values += [7, "text", {}]
        if re.match(r"(one value or )?a list of \d", requirement):
            values.append([*entries, entries[0]])
    elif base in (int, float):
        values = ["fast", True, [1.0], {}, *boundary_numbers(requirement)[0]]
        values += ["3 mol"] if in_file else ["1.0"]
        if in_file and ".inf" not in requirement:
            values += ["1e400", ".inf"]
    elif base is str:
        values = [3.5, ["a"], {}, *["~ text" for x in metadata if getattr(x, "pattern", None)]]
        max_lengths = re.findall(r"to (\d+) characters", requirement)
        values += ["x" * (int(max_length) + 1) for max_length in max_lengths]
    elif base is bool or get_origin(base) is Literal:
        values = [3.5, ["a"], {}, "no such text"]
    elif requirement.startswith("a mapping"):
        values = [7, "text", [], *[{}] * ("at least" in requirement)]
    else:  # options, which are checked by their method, and parts of models
        values = [[1.0], {}, math.nan] if in_file else ["wrong"]
    for value in values:
        yield value, "", f"= {format_value(value)} is not allowed: it must be {requirement}"


def invalid_lists(annotation, format_value):
    """Yield lists with one forbidden entry or repeated entries, in the form of `invalid_values`."""
    base, metadata = p.split_annotation(annotation)
    entries = example_value(annotation)
    if "a list" in p.describe_requirement(annotation, format_value is validation.format_value):
        for value, index, problem in invalid_values(get_args(base)[0], format_value):
            yield [*entries[1:], value], f"[{len(entries) - 1}]{index}", problem
    if any("uniqueItems" in (getattr(x, "json_schema_extra", 0) or ()) for x in metadata):
        yield 2 * entries, "", "contains "


def values_within_range(annotation, in_file):
    """Yield numbers just inside the range of an annotation, or lists of such numbers.

    If `in_file`, a number with a unit, such as "2 mm", is added where the unit has an example.
    """
    base, metadata = p.split_annotation(annotation)
    if base in (int, float):
        yield from boundary_numbers(p.describe_requirement(annotation))[1]
        yield from (x.example for x in metadata if isinstance(x, p.Unit) and x.example and in_file)
    elif get_origin(base) in (list, tuple):
        entry_count = len(example_value(annotation))
        for value in values_within_range(get_args(base)[0], in_file):
            yield [value] * entry_count


def iterate_sections(annotation, insert, path=()):
    """Yield (path, annotation, function) for each section of a file below an annotation.

    `path` has the keys that lead to the section. The function inserts the content of the section
    into a file that is otherwise valid; `insert` does this for the section of the annotation.
    """
    base, _ = p.split_annotation(annotation)
    if p.is_union(base):
        for option in get_args(base):
            yield from iterate_sections(option, insert, path)
    elif get_origin(base) is list:
        yield from iterate_sections(get_args(base)[0], lambda entry: insert([entry]), (*path, 0))
    elif keys := child_annotations(annotation):
        yield path, annotation, insert
        content = example_value(annotation)
        for key, child in keys.items():

            def insert_child(value, key=key):
                return insert(content | {key: value})

            yield from iterate_sections(child, insert_child, (*path, key))
