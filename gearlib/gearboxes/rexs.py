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

from gearlib import units
from gearlib.checks import InputError

#: Newest version that is read.
_NEWEST = (1, 7)
#: Unit in a file -> its spelling for `gearlib.units`.
_SPELLINGS = {"": "1", "none": "1", "-": "1", "mum": "um", "°": "deg", "mm mum": "mm um"}
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
        spelling = spelling.replace("mum", "um").replace("°", "deg")
        kind = "a number" if unit == "1" else f"a number in {unit} or another unit of its dimension"
        try:
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
        value = value[0] if isinstance(value, list) and value else value
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
            parts = [Component(key, "load case", name, x) for key, x in changes.items()]
            numbers = (part.number("load_duration_fraction", "1") for part in parts)
            fractions[name] = next((x for x in numbers if x is not None), math.nan)
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
        if zipfile.is_zipfile(io.BytesIO(content)) or content[:2] == b"PK":
            content = _model_in_archive(content)
        if content.lstrip(b"\xef\xbb\xbf \r\n\t")[:1] == b"{":
            tree = _JsonTree(json.loads(content.decode("utf-8-sig")))
        else:
            tree = _XmlTree(ElementTree.fromstring(content))
        return tree.model()
    except InputError as error:
        raise ValueError(f"{path}: {error}") from None
    except (ElementTree.ParseError, zipfile.BadZipFile, NotImplementedError, RuntimeError) as error:
        raise ValueError(f"{path} is damaged or no REXS file: {error}") from None
    except (KeyError, TypeError, AttributeError, UnicodeError, json.JSONDecodeError) as error:
        raise ValueError(f"{path} is damaged or no REXS file: {error!r}") from None


def _model_in_archive(content: bytes) -> bytes:
    """Return the content of the model file in a ZIP archive."""
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        names = [name for name in archive.namelist() if name.lower().endswith(_SUFFIXES)]
        names.sort(key=lambda name: (_SUFFIXES.index(Path(name).suffix.lower()), name.count("/")))
        if not names:
            raise zipfile.BadZipFile("the archive has no model, a file with the suffix .rexs")
        return archive.read(names[0])


class _Tree:
    """A file as a tree, whose nodes have attributes, children by tag and values."""

    def model(self) -> RexsModel:
        """Return the content of the file."""
        version = str(self.get(self.root, "version") or "")
        numbers = [int(text) if text.isdigit() else -1 for text in version.split(".")[:2]]
        if not (1, 0) <= tuple(numbers) <= _NEWEST:
            allowed = f"a version of REXS from 1.0 to {'.'.join(map(str, _NEWEST))}"
            raise InputError("version", version or None, allowed)
        components = self.components(self.root)
        names = [part.name for part in components.values()]
        components = {
            key: part._replace(name=part.name if names.count(part.name) == 1 else _numbered(part))
            for key, part in components.items()
        }
        relations = [
            (
                str(self.get(relation, "type")),
                [
                    (str(self.get(ref, "role")), str(self.get(ref, "id")))
                    for ref in self.children(relation, "ref")
                ],
            )
            for relation in self.children(self.child(self.root, "relations"), "relation")
        ]
        spectrum = self.child(self.root, "load_spectrum")
        cases = {}
        for i, case in enumerate(self.children(spectrum, "load_case"), 1):
            changed = self.components(case)
            name = str(self.get(case, "name") or self.get(case, "id") or i)
            cases[name if name not in cases else f"{name} [{i}]"] = {
                key: part.attributes for key, part in changed.items()
            }
        application = str(self.get(self.root, "applicationId") or "")
        return RexsModel(version, application, components, relations, cases)

    def components(self, node: Any) -> dict[str, Component]:
        """Return the components below a node, by id."""
        parent = self.child(node, "components")
        found = {}
        for part in self.children(node if parent is None else parent, "component"):
            kind, key = str(self.get(part, "type")), str(self.get(part, "id"))
            name = " ".join(str(self.get(part, "name") or kind).split())
            attributes = {
                str(self.get(entry, "id")): (self.value(entry), self.get(entry, "unit") or "")
                for entry in self.children(part, "attribute")
            }
            found[key] = Component(key, kind, name, attributes)
        return found


def _numbered(part: Component) -> str:
    """Return the name of a component with its id, which makes it unique."""
    suffix = f"[{part.id}]"
    return part.name if part.name.endswith(suffix) else f"{part.name} {suffix}"


class _XmlTree(_Tree):
    """An XML file."""

    def __init__(self, root: ElementTree.Element):
        for element in root.iter():
            element.tag = str(element.tag).rpartition("}")[2]  # without a namespace
        self.root = root if root.tag == "model" else root.find(".//model")
        if self.root is None:
            raise InputError("model", problem="is missing: it must be the element of the gear unit")

    def get(self, node, name):
        """Return an attribute of an element, None if it has none of that name."""
        return node.get(name)

    def child(self, node, tag):
        """Return the first child with a tag, or None."""
        return node.find(tag)

    def children(self, node, tag):
        """Return the children of an element, or of None, with a tag."""
        return [] if node is None else node.findall(tag)

    def value(self, node):
        """Return the text of an attribute, or the list of texts of an array."""
        array = node.find("array")
        return node.text if array is None else [cell.text for cell in array.iter("c")]


class _JsonTree(_Tree):
    """A JSON file, in which lists have the plural of the tags of XML."""

    def __init__(self, root: Any):
        self.root = root["model"] if "model" in root else root

    def get(self, node, name):
        """Return an entry of an object, None if it has none of that name."""
        return node.get(name)

    def child(self, node, tag):
        """Return the list or object with a key, or None."""
        return node.get(tag)

    def children(self, node, tag):
        """Return the entries of a list, or of the list of an object with the plural of a tag."""
        if isinstance(node, dict):
            node = node.get(f"{tag}s")
        return node or []

    def value(self, node):
        """Return the value of an attribute, whose key names its type, or None."""
        return next((x for key, x in node.items() if key not in ("id", "unit", "name")), None)
