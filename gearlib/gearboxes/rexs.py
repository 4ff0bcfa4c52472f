"""Reading of REXS files, the exchange format of gear units, versions 1.0 to 1.7 (rexs.info).

A file has components with attributes, relations between components, and load cases in which
components have other values. It is XML or JSON, alone or in a ZIP archive. Unknown components and
attributes are ignored.
"""

import io
import json
import math
import zipfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple
from xml.etree import ElementTree

from gearlib import checks, units
from gearlib.checks import InputError

#: Newest version that is read.
_NEWEST = (1, 7)
#: Unit in a file -> its spelling for `gearlib.units`.
_SPELLINGS = {"": "1", "none": "1", "-": "1", "mum": "um", "°": "deg"}
#: Endings of the attributes that state the fraction of the load duration of a load case.
_FRACTIONS = ("load_duration_fraction", "operating_time_fraction")
_SUFFIXES = (".rexs", ".rexsj", ".xml", ".json")


class Component(NamedTuple):
    """A part of a gearbox with its attributes."""

    id: str
    type: str  #: such as "cylindrical_gear"
    name: str  #: unique in the file
    attributes: dict  #: name -> (value, unit as in the file)

    def __str__(self):
        return f"{self.type} {self.name}"

    def value(self, name: str) -> Any:
        """Return the value of an attribute without its unit, or None if it is not given."""
        return self.attributes.get(name, (None, ""))[0]

    def number(self, name: str, unit: str, purpose: str = "") -> float | None:
        """Return an attribute as a number in a unit of `gearlib.units`, or None if it is not given.

        The file states the attribute with a unit of its own, which is converted. If a `purpose` is
        given, as in "for the contact ratios", a missing attribute raises a ValueError that names
        the purpose.
        """
        value, file_unit = self.attributes.get(name, (None, ""))
        text = str(value).strip().lower()
        if value is None or text in ("", "nan", "null"):
            if purpose:
                problem = f"is missing: it must be given {purpose}"
                raise InputError(name, problem=problem, owner=str(self))
            return None
        spelling = _SPELLINGS.get(str(file_unit).strip(), str(file_unit).strip())
        try:
            if unit == "1" and spelling == "%":
                number = float(text) / 100.0
            elif unit == spelling:
                number = float(text)
            else:
                number = units.parse_quantity(f"{text} {spelling}", unit)
        except ValueError:
            number = math.nan  # raises the error below
        if not math.isfinite(number):
            allowed = "a number"
            if unit != "1":
                allowed = f"a number in {unit} or another unit of its dimension"
            raise InputError(name, f"{value} {file_unit}".strip(), allowed, owner=str(self))
        return number

    def vector(self, name: str, unit: str) -> list[float] | None:
        """Return an attribute that is an array as a list of numbers, or None if it is not given.

        `unit` is the unit of the results, one of `gearlib.units`.
        """
        values, file_unit = self.attributes.get(name, (None, ""))
        if not isinstance(values, list):
            return None
        # Each entry is read as if it were the only value of the attribute.
        entries = [self._replace(attributes={name: (value, file_unit)}) for value in values]
        return [entry.number(name, unit, "as an array of numbers") for entry in entries]

    def is_true(self, name: str) -> bool | None:
        """Return whether an attribute is true, or None if it is not given."""
        value = self.value(name)
        return None if value is None else str(value).strip().lower() == "true"


class RexsModel(NamedTuple):
    """The content of a REXS file."""

    version: str
    application: str  #: program that wrote the file
    components: dict[str, Component]  #: by id
    relations: list[tuple[str, list]]  #: (type, [(role, id of the component), ...])
    load_cases: dict[str, dict]  #: name -> id of a component -> its attributes in this load case

    def of_type(self, *types: str) -> list[Component]:
        """Return the components of the given types, in the order of the file."""
        return [part for part in self.components.values() if part.type in types]

    def related(self, relation: str, **roles: Component) -> Iterator[dict]:
        """Yield the relations of a type, each as a dict: role -> component.

        A relation of the type "assembly", for example, has the roles "assembly" and "part". `roles`
        restricts the result to relations in which the given components have these roles, as in
        related("assembly", assembly=shaft). Relations with unknown components are ignored.
        """
        for relation_type, references in self.relations:
            parts = {role: self.components.get(key) for role, key in references}
            if relation_type.removeprefix("ordered_") != relation or None in parts.values():
                continue
            if all(role in parts and parts[role].id == part.id for role, part in roles.items()):
                yield parts

    def parts_of(self, assembly: Component) -> list[Component]:
        """Return the parts of an assembly, such as the gears and sections of a shaft."""
        return [parts["part"] for parts in self.related("assembly", assembly=assembly)]

    def linked(self, part: Component, component_type: str) -> list[Component]:
        """Return the components of a type that are in any relation with a component.

        `part` is the component, and `component_type` is a type such as "tip_relief".
        """
        linked_parts = []
        for _, references in self.relations:
            keys = [key for _, key in references]
            if part.id in keys:
                linked_parts += [self.components[key] for key in keys if key in self.components]
        return [other for other in linked_parts if other.type == component_type]

    def referenced(self, origin: Component, *types: str) -> Component | None:
        """Return the first component of the given types to which `origin` refers, or None.

        A gear, for example, refers to its material by a relation of the type "reference".
        """
        for parts in self.related("reference", origin=origin):
            if parts["referenced"].type in types:
                return parts["referenced"]
        return None

    def load_fractions(self) -> dict[str, float]:
        """Return a dict: load case -> its fraction of the load duration, NaN if not stated.

        The attribute with the fraction may belong to any component that the load case changes.
        """
        fractions = {}
        for name, changes in self.load_cases.items():
            fractions[name] = math.nan
            for key, attributes in changes.items():
                for attribute in attributes:
                    if attribute.endswith(_FRACTIONS):
                        # The component only serves to read the number.
                        part = Component(key, "load case", name, attributes)
                        fractions[name] = part.number(attribute, "1") or 0.0
        return fractions

    def in_case(self, name: str | None) -> "RexsModel":
        """Return a copy of the model with the values of a load case.

        `name` is the load case; None means no load case. Attributes that the load case does not
        state keep their values.
        """
        changes = self.load_cases[name] if name else {}
        components = {
            key: part._replace(attributes=part.attributes | changes.get(key, {}))
            for key, part in self.components.items()
        }
        return self._replace(components=components)


def read(path: Any) -> RexsModel:
    """Return the content of a REXS file: .rexs, .rexsj, .rexsz or .rexs.zip.

    The format follows from the content: a ZIP archive, JSON or XML. Raises FileNotFoundError, or
    ValueError if the file is damaged or of another version.
    """
    content = Path(path).read_bytes()
    try:
        if content[:2] == b"PK":  # a ZIP archive
            content = _model_in_archive(content)
        # JSON begins with a brace behind an optional byte order mark and white space.
        if content.lstrip(b"\xef\xbb\xbf \r\n\t")[:1] == b"{":
            tree = json.loads(content.decode("utf-8-sig"))
            return _model(tree.get("model", tree))
        return _model(_from_xml(ElementTree.fromstring(content)))
    except InputError as error:
        raise ValueError(f"{path}: {error}") from None
    except Exception as error:  # Damaged files raise errors of zipfile, ElementTree and json.
        raise ValueError(f"{path} is damaged or no REXS file: {error}") from error


def _model_in_archive(content: bytes) -> bytes:
    """Return the content of the model file in a ZIP archive.

    If there are several, it is one in the outermost folder, with the shortest path. `content` is
    the archive itself.
    """
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        names = [name for name in archive.namelist() if name.lower().endswith(_SUFFIXES)]
        if not names:
            raise ValueError("the archive has no model, a file with the suffix .rexs or .rexsj")
        return archive.read(min(names, key=lambda name: (name.count("/"), len(name))))


def _from_xml(root: ElementTree.Element) -> dict:
    """Convert an XML model to the dicts and lists of a JSON model.

    `root` is the root of the XML tree.
    """
    for element in root.iter():
        element.tag = str(element.tag).rpartition("}")[2]  # without a namespace
    model = root if root.tag == "model" else root.find(".//model")
    load_cases = []
    spectrum = model.find("load_spectrum")
    for case in [] if spectrum is None else spectrum.findall("load_case"):
        # Some files have the components of a load case in an element of their own.
        parent = case.find("components")
        components = _xml_entries(case if parent is None else parent, "component", "attribute")
        load_cases.append(dict(case.attrib) | {"components": components})
    return dict(model.attrib) | {
        "relations": _xml_entries(model.find("relations"), "relation", "ref"),
        "components": _xml_entries(model.find("components"), "component", "attribute"),
        "load_spectrum": {"load_cases": load_cases},
    }


def _xml_entries(parent: ElementTree.Element | None, tag: str, child_tag: str) -> list[dict]:
    """Convert XML elements to the dicts of a JSON model, and return these as a list.

    The elements are those with the tag `tag` directly below `parent`; without a parent, None, there
    are none. A dict has the XML attributes of its element and, under the plural of `child_tag`, the
    list of its converted children.
    """
    entries = []
    for element in [] if parent is None else parent.findall(tag):
        children = [dict(child.attrib) | _xml_value(child) for child in element.findall(child_tag)]
        entries.append(dict(element.attrib) | {f"{child_tag}s": children})
    return entries


def _xml_value(element: ElementTree.Element) -> dict:
    """Return {"value": string} for an attribute of a component, or {} for other elements.

    The value of an array is a list with the strings of its cells, the elements <c>.
    """
    if element.tag != "attribute":
        return {}
    array = element.find("array")
    if array is None:
        return {"value": element.text}
    return {"value": [cell.text for cell in array.iter("c")]}


def _model(tree: dict) -> RexsModel:
    """Return the content of a JSON model, in which names of components are made unique.

    Raises ValueError if the version of the format is not supported.
    """
    version = str(tree.get("version") or "")
    # -1 stands for a part of the version that is no number, and is refused.
    numbers = tuple(int(text) if text.isdigit() else -1 for text in version.split(".")[:2])
    allowed = f"a version of REXS from 1.0 to {'.'.join(map(str, _NEWEST))}"
    checks.require((1, 0) <= numbers <= _NEWEST, "version", version or None, allowed)
    components = _components(tree)
    names = [part.name for part in components.values()]
    for key, part in components.items():
        suffix = f"[{part.id}]"
        if names.count(part.name) > 1 and not part.name.endswith(suffix):
            components[key] = part._replace(name=f"{part.name} {suffix}")
    relations = []
    for relation in tree.get("relations") or []:
        references = [(reference["role"], str(reference["id"])) for reference in relation["refs"]]
        relations.append((relation["type"], references))
    load_cases: dict = {}
    spectrum = tree.get("load_spectrum") or {}
    for number, case in enumerate(spectrum.get("load_cases") or [], 1):
        name = str(case.get("name") or case.get("id") or number)
        if name in load_cases:
            name = f"{name} [{number}]"
        load_cases[name] = {key: part.attributes for key, part in _components(case).items()}
    application = str(tree.get("applicationId") or "")
    return RexsModel(version, application, components, relations, load_cases)


def _components(node: dict) -> dict[str, Component]:
    """Return the components of a JSON model or load case as a dict: id -> component.

    `node` is the dict of the model or load case.
    """
    components = {}
    for part in node.get("components") or []:
        attributes = {}
        for entry in part.get("attributes") or []:
            # In JSON the key of the value is the name of its type, such as "floating_point".
            values = [value for key, value in entry.items() if key not in ("id", "unit")]
            attributes[entry["id"]] = (values[0] if values else None, entry.get("unit") or "")
        name = " ".join(str(part.get("name") or part["type"]).split())
        key = str(part["id"])
        components[key] = Component(key, part["type"], name, attributes)
    return components
