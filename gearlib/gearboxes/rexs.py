"""Reading of REXS files, the exchange format of gear units, versions 1.0 to 1.7 (rexs.info).

A file has components with attributes, relations between components, and load cases in which
components have other values. It is XML or JSON, alone or in a ZIP archive. Components and
attributes that are unknown here are passed over.
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
#: Attributes of a load case, of the gear unit or with a prefix, that state its part of the time.
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
        """Return the value of an attribute without its unit, None if it is not given."""
        return self.attributes.get(name, (None, ""))[0]

    def number(self, name: str, unit: str, purpose: str = "") -> float | None:
        """Return the number of an attribute in a unit of `gearlib.units`, None if it is not given.

        With a `purpose`, as in "for the contact ratio", the attribute must be given.
        """
        value, file_unit = self.attributes.get(name, (None, ""))
        text = str(value).strip().lower()
        if value is None or text in ("", "nan", "null"):
            if purpose:
                problem = f"is missing: it must be given {purpose}"
                raise InputError(name, problem=problem, owner=str(self))
            return None
        spelling = _SPELLINGS.get(str(file_unit).strip(), str(file_unit).strip())
        kind = "a number" if unit == "1" else f"a number in {unit} or another unit of its dimension"
        try:
            if (unit, spelling) == ("1", "%"):
                number = float(text) / 100.0
            else:
                number = float(text) if unit == spelling else units.read(f"{text} {spelling}", unit)
        except ValueError:
            number = math.nan
        if not math.isfinite(number):
            raise InputError(name, f"{value} {file_unit}".strip(), kind, owner=str(self))
        return number

    def vector(self, name: str, unit: str) -> list[float] | None:
        """Return the numbers of an array in a unit of `gearlib.units`, None if it is not given."""
        values, file_unit = self.attributes.get(name, (None, ""))
        if not isinstance(values, list):
            return None
        cells = [self._replace(attributes={name: (value, file_unit)}) for value in values]
        return [cell.number(name, unit, "as an array of numbers") for cell in cells]

    def is_true(self, name: str) -> bool | None:
        """Return whether an attribute is true, None if it is not given."""
        value = self.value(name)
        return None if value is None else str(value).strip().lower() == "true"


class RexsModel(NamedTuple):
    """The content of a REXS file."""

    version: str
    application: str  #: program that wrote the file
    components: dict[str, Component]  #: by id
    relations: list[tuple[str, list]]  #: (type, [(role, id of the component), ...])
    load_cases: dict[str, dict]  #: name -> attributes of components: id -> name -> (value, unit)

    def of_type(self, *types: str) -> list[Component]:
        """Return the components of some types, in the order of the file."""
        return [part for part in self.components.values() if part.type in types]

    def related(self, relation: str, **roles: Component) -> Iterator[dict]:
        """Yield role -> component of the relations of a type in which components have given roles.

        Relations with components that the file lacks are passed over.
        """
        for kind, references in self.relations:
            parts = {role: self.components.get(key) for role, key in references}
            if kind.removeprefix("ordered_") != relation or None in parts.values():
                continue
            if all(role in parts and parts[role].id == x.id for role, x in roles.items()):
                yield parts

    def parts_of(self, assembly: Component) -> list[Component]:
        """Return the parts of an assembly, such as the gears and sections of a shaft."""
        return [parts["part"] for parts in self.related("assembly", assembly=assembly)]

    def linked(self, part: Component, kind: str) -> list[Component]:
        """Return the components of a type that have a relation of any type with a component."""
        found = []
        for _, references in self.relations:
            keys = [key for _, key in references]
            if part.id in keys:
                found += [self.components[key] for key in keys if key in self.components]
        return [other for other in found if other.type == kind]

    def referenced(self, origin: Component, *types: str) -> Component | None:
        """Return the first component of some types to which a component refers, or None."""
        references = (parts["referenced"] for parts in self.related("reference", origin=origin))
        return next((part for part in references if part.type in types), None)

    def load_fractions(self) -> dict[str, float]:
        """Return the fraction of the load duration of each load case, NaN if it is not stated."""
        fractions = {}
        for name, changes in self.load_cases.items():
            fractions[name] = math.nan
            for key, attributes in changes.items():
                for attribute in filter(lambda x: x.endswith(_FRACTIONS), attributes):
                    part = Component(key, "load case", name, attributes)
                    fractions[name] = part.number(attribute, "1") or 0.0
        return fractions

    def in_case(self, name: str | None) -> "RexsModel":
        """Return the model with the values of a load case, or itself without a name."""
        changes = self.load_cases[name] if name else {}
        changed = {
            key: part._replace(attributes=part.attributes | changes.get(key, {}))
            for key, part in self.components.items()
        }
        return self._replace(components=changed)


def read(path: Any) -> RexsModel:
    """Return the content of a REXS file: .rexs, .rexsj, .rexsz or .rexs.zip.

    Raises FileNotFoundError, or ValueError if the file is damaged or of another version.
    """
    content = Path(path).read_bytes()
    try:
        if content[:2] == b"PK":
            content = _model_in_archive(content)
        if content.lstrip(b"\xef\xbb\xbf \r\n\t")[:1] == b"{":
            tree = json.loads(content.decode("utf-8-sig"))
            return _model(tree.get("model", tree))
        return _model(_from_xml(ElementTree.fromstring(content)))
    except InputError as error:
        raise ValueError(f"{path}: {error}") from None
    except Exception as error:  # those of zipfile, ElementTree, json and Python
        raise ValueError(f"{path} is damaged or no REXS file: {error}") from error


def _model_in_archive(content: bytes) -> bytes:
    """Return the content of the model file in a ZIP archive."""
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        names = [name for name in archive.namelist() if name.lower().endswith(_SUFFIXES)]
        if not names:
            raise ValueError("the archive has no model, a file with the suffix .rexs or .rexsj")
        return archive.read(min(names, key=lambda name: (name.count("/"), len(name))))


def _from_xml(root: ElementTree.Element) -> dict:
    """Return an XML model as the objects and lists of a JSON model."""

    def entries(node, tag: str, **children: str) -> list[dict]:
        """Return the elements with a tag below a node as dicts with lists of their children."""
        found = [] if node is None else node.findall(tag)
        return [
            dict(x.attrib) | {f"{y}s": entries(x, y) for y in children.values()} | _xml_value(x)
            for x in found
        ]

    for element in root.iter():
        element.tag = str(element.tag).rpartition("}")[2]  # without a namespace
    root = root if root.tag == "model" else root.find(".//model")
    spectrum = root.find("load_spectrum")
    cases = [] if spectrum is None else spectrum.findall("load_case")
    return dict(root.attrib) | {
        "relations": entries(root.find("relations"), "relation", part="ref"),
        "components": entries(root.find("components"), "component", part="attribute"),
        "load_spectrum": {
            "load_cases": [
                dict(case.attrib)
                | {"components": entries(_components_of(case), "component", part="attribute")}
                for case in cases
            ]
        },
    }


def _components_of(case: ElementTree.Element) -> ElementTree.Element:
    """Return the element of a load case that has its components."""
    components = case.find("components")
    return case if components is None else components


def _xml_value(element: ElementTree.Element) -> dict:
    """Return the value of an attribute: its text, or the texts of an array."""
    if element.tag != "attribute":
        return {}
    array = element.find("array")
    return {"value": element.text if array is None else [cell.text for cell in array.iter("c")]}


def _model(tree: dict) -> RexsModel:
    """Return the content of a JSON model."""
    version = str(tree.get("version") or "")
    numbers = tuple(int(text) if text.isdigit() else -1 for text in version.split(".")[:2])
    allowed = f"a version of REXS from 1.0 to {'.'.join(map(str, _NEWEST))}"
    checks.require((1, 0) <= numbers <= _NEWEST, "version", version or None, allowed)
    components = _components(tree)
    names = [part.name for part in components.values()]
    for key, part in components.items():
        suffix = f"[{part.id}]"
        if names.count(part.name) > 1 and not part.name.endswith(suffix):
            components[key] = part._replace(name=f"{part.name} {suffix}")
    relations = [
        (relation["type"], [(ref["role"], str(ref["id"])) for ref in relation["refs"]])
        for relation in tree.get("relations") or []
    ]
    cases: dict = {}
    for i, case in enumerate((tree.get("load_spectrum") or {}).get("load_cases") or [], 1):
        name = str(case.get("name") or case.get("id") or i)
        changes = {key: part.attributes for key, part in _components(case).items()}
        cases[name if name not in cases else f"{name} [{i}]"] = changes
    return RexsModel(version, str(tree.get("applicationId") or ""), components, relations, cases)


def _components(node: dict) -> dict[str, Component]:
    """Return the components of a model or load case by id."""
    found = {}
    for part in node.get("components") or []:
        attributes = {}
        for entry in part.get("attributes") or []:
            # In JSON the key of the value is its type.
            values = [x for key, x in entry.items() if key not in ("id", "unit")]
            attributes[entry["id"]] = (values[0] if values else None, entry.get("unit") or "")
        name = " ".join(str(part.get("name") or part["type"]).split())
        found[str(part["id"])] = Component(str(part["id"]), part["type"], name, attributes)
    return found
