"""Reading of REXS files, the exchange format of gear units, versions 1.0 to 1.7 (rexs.info).

A file contains components with attributes, relations between components, and load cases that
override attributes. It is XML or JSON, possibly in a ZIP archive. Unknown components and attributes
are ignored.
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

#: Newest supported version.
_NEWEST_VERSION = (1, 7)
#: Spelling of units in REXS files -> spelling in `gearlib.units`.
_UNIT_SPELLINGS = {"": "1", "none": "1", "-": "1", "mum": "um", "°": "deg"}
#: Suffixes of attributes that give the fraction of the load duration for a load case.
_FRACTION_SUFFIXES = ("load_duration_fraction", "operating_time_fraction")
_FILE_SUFFIXES = (".rexs", ".rexsj", ".xml", ".json")


class Component(NamedTuple):
    """A component of a gearbox with its attributes."""

    id: str
    type: str  #: such as "cylindrical_gear"
    name: str  #: unique in the file
    attributes: dict  #: name -> (value, unit as in the file)

    def __str__(self):
        return f"{self.type} {self.name}"

    def get_value(self, name: str) -> Any:
        """Return the value of an attribute without its unit, or None if it is missing."""
        return self.attributes.get(name, (None, ""))[0]

    def get_number(self, name: str, unit: str, purpose: str = "") -> float | None:
        """Return a numeric attribute converted to `unit`, or None if it is missing.

        `unit` is a unit of `gearlib.units`. If `purpose` is given, e.g. "for the contact ratios", a
        missing attribute raises an `InputError` that states the purpose.
        """
        value, file_unit = self.attributes.get(name, (None, ""))
        text = str(value).strip().lower()
        if value is None or text in ("", "nan", "null"):
            if purpose:
                problem = f"is missing: it must be given {purpose}"
                raise InputError(name, problem=problem, owner=str(self))
            return None
        spelling = _UNIT_SPELLINGS.get(str(file_unit).strip(), str(file_unit).strip())
        try:
            if unit == "1" and spelling == "%":
                number = float(text) / 100.0
            elif unit == spelling:
                number = float(text)
            else:
                number = units.parse_quantity(f"{text} {spelling}", unit)
        except ValueError:
            number = math.nan  # The check below raises the error.
        if not math.isfinite(number):
            allowed = "a number"
            if unit != "1":
                allowed = f"a number in {unit} or another unit of its dimension"
            raise InputError(name, f"{value} {file_unit}".strip(), allowed, owner=str(self))
        return number

    def get_vector(self, name: str, unit: str) -> list[float] | None:
        """Return an array attribute as a list of numbers in `unit`, or None if it is missing.

        `unit` is a unit of `gearlib.units`.
        """
        values, file_unit = self.attributes.get(name, (None, ""))
        if not isinstance(values, list):
            return None
        # Copies of the component, each with one entry as the value of the attribute.
        copies = [self._replace(attributes={name: (value, file_unit)}) for value in values]
        return [copy.get_number(name, unit, "as an array of numbers") for copy in copies]

    def is_true(self, name: str) -> bool | None:
        """Return whether an attribute is true, or None if it is missing."""
        value = self.get_value(name)
        return None if value is None else str(value).strip().lower() == "true"


class RexsModel(NamedTuple):
    """The content of a REXS file."""

    version: str
    application: str  #: program that wrote the file
    components: dict[str, Component]  #: by id
    relations: list[tuple[str, list]]  #: (type, [(role, id of the component), ...])
    load_cases: dict[str, dict]  #: name -> id of a component -> its attributes in this load case

    def components_of_type(self, *types: str) -> list[Component]:
        """Return the components of the given types in the order of the file."""
        return [part for part in self.components.values() if part.type in types]

    def find_relations(self, relation: str, **roles: Component) -> Iterator[dict]:
        """Yield all relations of a type, each as a dict: role -> component.

        A relation of the type "assembly", for example, has the roles "assembly" and "part". With
        `roles`, only relations are yielded in which the given components have these roles, e.g.
        find_relations("assembly", assembly=shaft). Relations to unknown components are skipped.
        """
        for relation_type, references in self.relations:
            parts = {role: self.components.get(key) for role, key in references}
            if relation_type.removeprefix("ordered_") != relation or None in parts.values():
                continue
            if all(role in parts and parts[role].id == part.id for role, part in roles.items()):
                yield parts

    def parts_of(self, assembly: Component) -> list[Component]:
        """Return the parts of an assembly, such as the gears and sections of a shaft."""
        return [parts["part"] for parts in self.find_relations("assembly", assembly=assembly)]

    def find_linked(self, part: Component, component_type: str) -> list[Component]:
        """Return the components of a type, such as "tip_relief", that are related to `part`."""
        linked_parts = []
        for _, references in self.relations:
            keys = [key for _, key in references]
            if part.id in keys:
                linked_parts += [self.components[key] for key in keys if key in self.components]
        return [x for x in linked_parts if x.type == component_type]

    def find_referenced(self, origin: Component, *types: str) -> Component | None:
        """Return the first component of the given types to which `origin` refers, or None.

        A gear, for example, refers to its material through a relation of the type "reference".
        """
        for parts in self.find_relations("reference", origin=origin):
            if parts["referenced"].type in types:
                return parts["referenced"]
        return None

    def load_case_fractions(self) -> dict[str, float]:
        """Return a dict: load case -> fraction of the load duration, NaN if it is not stated.

        The fraction may be an attribute of any component of the load case.
        """
        fractions = {}
        for name, changes in self.load_cases.items():
            fractions[name] = math.nan
            for key, attributes in changes.items():
                for attribute in attributes:
                    if attribute.endswith(_FRACTION_SUFFIXES):
                        # This component is only used to convert the attribute to a number.
                        part = Component(key, "load case", name, attributes)
                        fractions[name] = part.get_number(attribute, "1") or 0.0
        return fractions

    def with_load_case(self, name: str | None) -> "RexsModel":
        """Return a copy of the model in which the attributes of a load case override others.

        If `name` is None, no load case is applied.
        """
        changes = self.load_cases[name] if name else {}
        components = {
            key: part._replace(attributes=part.attributes | changes.get(key, {}))
            for key, part in self.components.items()
        }
        return self._replace(components=components)


def read(path: Any) -> RexsModel:
    """Read a REXS file: .rexs, .rexsj, .rexsz or .rexs.zip.

    The format (ZIP archive, JSON or XML) is detected from the content. Raise FileNotFoundError if
    there is no such file, and ValueError if it is damaged or its version is not supported.
    """
    content = Path(path).read_bytes()
    try:
        if content[:2] == b"PK":  # a ZIP archive
            content = _read_archived_model(content)
        # JSON begins with a brace after an optional byte order mark and white space.
        if content.lstrip(b"\xef\xbb\xbf \r\n\t")[:1] == b"{":
            tree = json.loads(content.decode("utf-8-sig"))
            return _build_model(tree.get("model", tree))
        return _build_model(_convert_xml_model(ElementTree.fromstring(content)))
    except InputError as error:
        raise ValueError(f"{path}: {error}") from None
    except Exception as error:  # Damaged files raise errors of zipfile, ElementTree and json.
        raise ValueError(f"{path} is damaged or not a REXS file: {error}") from error


def _read_archived_model(content: bytes) -> bytes:
    """Return the content of the model file in a ZIP archive, given as bytes.

    Of several model files, one in the outermost folder is read; if there are several in that
    folder, the one with the shortest path.
    """
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        names = [name for name in archive.namelist() if name.lower().endswith(_FILE_SUFFIXES)]
        if not names:
            raise ValueError(
                "the archive has no model: it must contain a file with the suffix .rexs or .rexsj"
            )
        return archive.read(min(names, key=lambda name: (name.count("/"), len(name))))


def _convert_xml_model(root: ElementTree.Element) -> dict:
    """Convert the root of an XML tree to the dicts and lists of a JSON model."""
    for element in root.iter():
        element.tag = str(element.tag).rpartition("}")[2]  # Remove the namespace.
    model = root if root.tag == "model" else root.find(".//model")
    load_cases = []
    spectrum = model.find("load_spectrum")
    for case in [] if spectrum is None else spectrum.findall("load_case"):
        # In some files, the components of a load case are in a separate element.
        parent = case.find("components")
        components = _convert_xml_elements(
            case if parent is None else parent, "component", "attribute"
        )
        load_cases.append(dict(case.attrib) | {"components": components})
    return dict(model.attrib) | {
        "relations": _convert_xml_elements(model.find("relations"), "relation", "ref"),
        "components": _convert_xml_elements(model.find("components"), "component", "attribute"),
        "load_spectrum": {"load_cases": load_cases},
    }


def _convert_xml_elements(
    parent: ElementTree.Element | None, tag: str, child_tag: str
) -> list[dict]:
    """Convert the children of an XML element with the tag `tag` to a list of dicts, as in JSON.

    Each dict has the XML attributes of its element and, under the plural of `child_tag`, the list
    of its converted children. If `parent` is None, the list is empty.
    """
    entries = []
    for element in [] if parent is None else parent.findall(tag):
        children = [
            dict(child.attrib) | _convert_xml_value(child) for child in element.findall(child_tag)
        ]
        entries.append(dict(element.attrib) | {f"{child_tag}s": children})
    return entries


def _convert_xml_value(element: ElementTree.Element) -> dict:
    """Return {"value": string} for an <attribute> element, or {} for other elements.

    The value of an array is the list of the strings in its cells, the elements <c>.
    """
    if element.tag != "attribute":
        return {}
    array = element.find("array")
    if array is None:
        return {"value": element.text}
    return {"value": [cell.text for cell in array.iter("c")]}


def _build_model(tree: dict) -> RexsModel:
    """Build a `RexsModel` from a JSON model; make the names of components unique.

    Raise an `InputError` if the version of the format is not supported.
    """
    version = str(tree.get("version") or "")
    # A part of the version that is not a number becomes -1, so that the check fails.
    version_numbers = tuple(int(text) if text.isdigit() else -1 for text in version.split(".")[:2])
    allowed = f"a version of REXS from 1.0 to {'.'.join(map(str, _NEWEST_VERSION))}"
    checks.require(
        (1, 0) <= version_numbers <= _NEWEST_VERSION, "version", version or None, allowed
    )
    components = _build_components(tree)
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
        load_cases[name] = {key: part.attributes for key, part in _build_components(case).items()}
    application = str(tree.get("applicationId") or "")
    return RexsModel(version, application, components, relations, load_cases)


def _build_components(node: dict) -> dict[str, Component]:
    """Return the components of a JSON model or load case as a dict: id -> component."""
    components = {}
    for part in node.get("components") or []:
        attributes = {}
        for entry in part.get("attributes") or []:
            # In JSON, the key of the value is its type, such as "floating_point".
            values = [value for key, value in entry.items() if key not in ("id", "unit")]
            attributes[entry["id"]] = (values[0] if values else None, entry.get("unit") or "")
        name = " ".join(str(part.get("name") or part["type"]).split())
        key = str(part["id"])
        components[key] = Component(key, part["type"], name, attributes)
    return components
