"""Small REXS files: two helical stages with a load spectrum, and a planetary set with a stage.

A file is a dict in the form of JSON, which `write` also writes as XML and into archives.
"""

import json
import zipfile
from xml.etree import ElementTree

#: Type of a value -> key of JSON.
_JSON_KEYS = {str: "string", bool: "boolean", int: "integer", float: "floating_point"}


class RexsFile:
    """A model to which components and relations are added."""

    def __init__(self, version="1.4"):
        self.version = version
        self.components, self.relations, self.cases = [], [], []
        self.add("gear_unit", "unit", gear_shift_index=1)
        self.add("gear_casing", "Gehäuse")

    def add(self, kind, name, on=None, **values):
        """Add a component, as a part of the one named `on`, and return its id.

        A value is a number with its unit, (40.0, "mm"), or a value without one.
        """
        key = len(self.components) + 1
        attributes = [
            {"id": attribute, **_unit_and_value(value)} for attribute, value in values.items()
        ]
        entry = {"id": key, "type": kind, "name": name, "attributes": attributes}
        self.components.append(entry)
        if on:
            self.relate("assembly", assembly=on, part=name)
        return key

    def id_of(self, name):
        """Return the id of the component with a name."""
        return next(part["id"] for part in self.components if part["name"] == name)

    def relate(self, kind, **roles):
        """Add a relation of components by their names."""
        refs = [{"role": role, "id": self.id_of(name)} for role, name in roles.items()]
        self.relations.append({"id": len(self.relations) + 1, "type": kind, "refs": refs})

    def change(self, name, **values):
        """Change attributes of a component; None removes one."""
        part = self.components[self.id_of(name) - 1]
        unchanged = [x for x in part["attributes"] if x["id"] not in values]
        changed = [
            {"id": x, **_unit_and_value(value)} for x, value in values.items() if value is not None
        ]
        part["attributes"] = unchanged + changed

    def add_load_case(self, **components):
        """Add a load case: values by the name of a component, in which "_" stands for a space."""
        entries = [
            {
                **{
                    x: self.components[self.id_of(name.replace("_", " ")) - 1][x]
                    for x in ("id", "type")
                },
                "attributes": [{"id": x, **_unit_and_value(value)} for x, value in values.items()],
            }
            for name, values in components.items()
        ]
        self.cases.append({"id": len(self.cases) + 1, "components": entries})

    def model(self):
        """Return the model in the form of JSON."""
        tree = {
            "version": self.version,
            "applicationId": "tests",
            "relations": self.relations,
            "components": self.components,
        }
        if self.cases:
            tree["load_spectrum"] = {"id": 1, "load_cases": self.cases}
        return tree

    def write(self, path):
        """Write the model in the format of the file name extension and return the path."""
        text = json.dumps({"model": self.model()}, ensure_ascii=False)
        if path.suffix != ".rexsj":
            root = _xml_element("model", self.model())
            text = ElementTree.tostring(root, encoding="unicode")
        content = b"\xef\xbb\xbf" + text.encode("utf-8")
        if path.suffix in (".rexsz", ".zip"):
            with zipfile.ZipFile(path, "w") as archive:
                archive.writestr("attachment/notes.txt", "none")
                archive.writestr("model.rexs", content)
        else:
            path.write_bytes(content)
        return path


def _unit_and_value(value):
    """Return the unit and value of an attribute as entries of a JSON object."""
    unit = "none"
    if isinstance(value, tuple):
        value, unit = value
    key = (
        f"{_JSON_KEYS[type(value[0])]}_array"
        if isinstance(value, list)
        else _JSON_KEYS[type(value)]
    )
    return {"unit": unit, key: value}


def _xml_element(tag, tree):
    """Convert an object in the form of JSON to an element of XML."""
    element = ElementTree.Element(tag)
    for name, value in tree.items():
        if name in ("relations", "components", "attributes", "refs", "load_cases"):
            parent = element
            if name in ("relations", "components") and tag == "model":
                parent = ElementTree.SubElement(element, name)
            for entry in value:
                parent.append(_xml_element(name[:-1], entry))
        elif isinstance(value, dict):
            element.append(_xml_element(name, value))
        elif name.endswith("_array"):
            array = ElementTree.SubElement(element, "array")
            for cell in value:
                ElementTree.SubElement(array, "c").text = str(cell)
        elif tag == "attribute" and name not in ("id", "unit"):
            element.text = str(value).lower() if isinstance(value, bool) else str(value)
        else:
            element.set(name, str(value))
    return element


def _position_attributes(u, v, w):
    """Return the attributes of a position along the axes of the unit, in mm."""
    return {
        "support_vector": ([u, v, w], "mm"),
        "u_axis_vector": ([1.0, 0.0, 0.0], "mm"),
        "w_axis_vector": ([0.0, 0.0, 1.0], "mm"),
    }


def add_shaft(file, name, position, sections, **values):
    """Add a shaft with sections (length, outer diameters, inner diameters), in mm.

    Diameters are pairs for the start and the end of a section. `position` is the shaft start.
    """
    file.add("shaft", name, "unit", **_position_attributes(*position), **values)
    file.relate("reference", origin=name, referenced="steel")
    start = 0.0
    for i, (length, outer, inner) in enumerate(sections):
        file.add(
            "shaft_section",
            f"{name} section {i}",
            name,
            u_coordinate_on_shaft=(start, "mm"),
            length=(length, "mm"),
            outer_diameter_begin=(outer[0], "mm"),
            outer_diameter_end=(outer[1], "mm"),
            inner_diameter_begin=(inner[0], "mm"),
            inner_diameter_end=(inner[1], "mm"),
        )
        start += length


def add_gear(
    file, name, shaft, position, teeth, module, helix, width, shift, kind="cylindrical_gear"
):
    """Add a gear with both flanks.

    `position` is its middle along the axes of the unit, in mm, and `helix` is the helix angle in
    degrees.
    """
    u = position[0] - _shaft_position(file, shaft)[0]
    file.add(
        kind,
        name,
        shaft,
        number_of_teeth=teeth,
        normal_module=(module, "mm"),
        helix_angle_reference_diameter=(helix, "°"),
        face_width=(width, "mm"),
        u_coordinate_on_shaft=(u, "mm"),
        **_position_attributes(*position),
    )
    file.relate("reference", origin=name, referenced="steel")
    flank = "flank_geometry" if file.version < "1.3" else "cylindrical_gear_flank"
    for side in ("left", "right"):
        values = {"normal_pressure_angle": (20.0, "deg")}
        if shift is not None:
            values["addendum_modification_coefficient"] = shift
        file.add(flank, f"{name} {side}", **values)
    file.relate("flank", gear=name, left=f"{name} left", right=f"{name} right")


def _shaft_position(file, shaft):
    """Return the position of a shaft along the axes of the unit, in mm."""
    attributes = file.components[file.id_of(shaft) - 1]["attributes"]
    return next(x["floating_point_array"] for x in attributes if x["id"] == "support_vector")


def add_stage(file, name, pinion, wheel, centre_distance, **values):
    """Add a stage of two gears with a centre distance in mm."""
    file.add("cylindrical_stage", name, "unit", center_distance=(centre_distance, "mm"), **values)
    file.relate("stage", stage=name, gear_1=pinion, gear_2=wheel)


def two_stage_file(version="1.4"):
    """Return a file of two helical stages with conical shafts, a coupling and two load cases."""
    file = RexsFile(version)
    file.add(
        "material",
        "steel",
        elastic_modulus=(210000.0, "N / mm^2"),
        poisson_ratio=0.3,
        density=(7.85, "kg / dm^3"),
    )
    solid = (0.0, 0.0)
    add_shaft(
        file, "Antrieb", (0.0, 0.0, 0.0), [(40.0, (30.0, 30.0), solid), (60.0, (30.0, 40.0), solid)]
    )
    add_shaft(file, "Zwischenwelle", (50.0, 0.0, 90.0), [(110.0, (35.0, 35.0), (10.0, 10.0))])
    add_shaft(file, "Abtrieb", (100.0, 120.0, 90.0), [(120.0, (50.0, 50.0), (20.0, 30.0))])
    add_shaft(file, "Flansch", (220.0, 120.0, 90.0), [(30.0, (80.0, 80.0), solid)])
    add_gear(file, "z1", "Antrieb", (80.0, 0.0, 0.0), 21, 2.5, 15.0, 26.0, 0.2)
    add_gear(file, "z2", "Zwischenwelle", (80.0, 0.0, 90.0), 48, 2.5, -15.0, 24.0, None)
    add_gear(file, "z3", "Zwischenwelle", (125.0, 0.0, 90.0), 19, 4.0, 12.0, 40.0, 0.3)
    add_gear(file, "z4", "Abtrieb", (125.0, 120.0, 90.0), 39, 4.0, -12.0, 38.0, None)
    add_stage(file, "Stufe 1", "z1", "z2", 90.0, rotating_angle_around_neg_u_axis=(0.0, "deg"))
    add_stage(file, "Stufe 2", "z3", "z4", 120.0)
    for name, shaft, u, torque in (
        ("Motor", "Antrieb", 5.0, True),
        ("Last", "Flansch", 25.0, False),
    ):
        file.add(
            "external_load",
            name,
            shaft,
            u_coordinate_on_shaft=(u, "mm"),
            transmits_torque=True,
            defines_torque=torque,
        )
    file.add(
        "coupling",
        "Kupplung",
        rotational_stiffness=(2e7, "N mm / rad"),
        u_coordinate_on_shaft_inner_side=(115.0, "mm"),
        u_coordinate_on_shaft_outer_side=(5.0, "mm"),
    )
    file.relate("side", assembly="Kupplung", inner_part="Abtrieb", outer_part="Flansch")
    for share, torque, speed in ((75.0, 40.0, 1500.0), (25.0, -25.0, 900.0)):
        name = "load_duration_fraction" if version < "1.3" else "operating_time_fraction"
        file.add_load_case(
            unit={name: (share, "%")},
            Antrieb={"rotational_speed": (speed, "1 / min")},
            Motor={"torque_around_u_axis": (torque, "N m")},
        )
    return file


def planetary_file(version="1.1"):
    """Return a file of a planetary set with fixed ring and a stage driven by its carrier."""
    import math

    file = RexsFile(version)
    file.add("material", "steel", elastic_modulus=(206.0, "GPa"), density=(7850.0, "kg / m^3"))
    solid = (0.0, 0.0)
    add_shaft(
        file,
        "Sonnenwelle",
        (0.0, 0.0, 0.0),
        [(90.0, (30.0, 30.0), solid)],
        rotational_speed=(1200.0, "1 / min"),
        defines_speed=True,
    )
    add_shaft(file, "Hohlradwelle", (50.0, 0.0, 0.0), [(40.0, (220.0, 220.0), (206.0, 206.0))])
    add_shaft(file, "Steg", (100.0, 0.0, 0.0), [(100.0, (60.0, 60.0), (20.0, 20.0))])
    add_shaft(file, "Abtrieb", (120.0, 108.0, 0.0), [(60.0, (50.0, 50.0), solid)])
    file.add("planet_carrier", "Planetenträger")
    file.add("planetary_stage", "Planetenstufe", "unit")
    file.relate("assembly", assembly="Planetenstufe", part="Planetenträger")
    file.relate("assembly", assembly="Planetenträger", part="Steg")
    for name, u in (("Wange 1", 40.0), ("Wange 2", 92.0)):
        plate = {"outer_diameter": (170.0, "mm"), "inner_diameter": (70.0, "mm")}
        file.add(
            "side_plate",
            name,
            "Planetenträger",
            length=(8.0, "mm"),
            **plate,
            **_position_attributes(u, 0.0, 0.0),
        )
        file.relate("reference", origin=name, referenced="steel")
    file.add(
        "coupling",
        "Steg an Wange",
        rotational_stiffness=(1e20, "N mm / rad"),
        **_position_attributes(105.0, 0.0, 0.0),
    )
    file.relate("side", assembly="Steg an Wange", inner_part="Steg", outer_part="Wange 2")
    add_gear(file, "Sonne", "Sonnenwelle", (70.0, 0.0, 0.0), 18, 3.0, 0.0, 36.0, 0.0)
    add_gear(
        file, "Hohlrad", "Hohlradwelle", (70.0, 0.0, 0.0), 60, 3.0, 0.0, 34.0, 0.0, "ring_gear"
    )
    for i in range(3):
        angle = 2.0 * math.pi * i / 3
        position = 58.5 * math.sin(angle), 58.5 * math.cos(angle)
        add_shaft(
            file, f"Planetenwelle {i}", (52.0, *position), [(36.0, (20.0, 20.0), (12.0, 12.0))]
        )
        add_shaft(file, f"Bolzen {i}", (44.0, *position), [(52.0, (12.0, 12.0), solid)])
        file.relate("planet_shaft", planetary_stage="Planetenstufe", shaft=f"Planetenwelle {i}")
        file.relate("planet_pin", planetary_stage="Planetenstufe", shaft=f"Bolzen {i}")
        add_gear(
            file, f"Planet {i}", f"Planetenwelle {i}", (70.0, *position), 21, 3.0, 0.0, 35.0, 0.0
        )
        add_stage(file, f"Sonne-Planet {i}", "Sonne", f"Planet {i}", 58.5)
        add_stage(file, f"Planet-Hohlrad {i}", f"Planet {i}", "Hohlrad", 58.5)
    file.add(
        "switchable_coupling",
        "Bremse",
        is_engaged=[True],
        rotational_stiffness=(1e20, "N mm / rad"),
    )
    file.relate("side", assembly="Bremse", inner_part="Hohlradwelle", outer_part="Gehäuse")
    add_gear(file, "Ritzel", "Steg", (160.0, 0.0, 0.0), 24, 4.0, 0.0, 40.0, 0.0)
    add_gear(file, "Rad", "Abtrieb", (160.0, 108.0, 0.0), 30, 4.0, 0.0, 38.0, 0.0)
    add_stage(file, "Stirnradstufe", "Ritzel", "Rad", 108.0)
    for name, shaft, u, values in (
        (
            "Motor",
            "Sonnenwelle",
            10.0,
            {"torque_around_u_axis": (60.0, "N m"), "defines_torque": True},
        ),
        ("Last", "Abtrieb", 55.0, {}),
    ):
        file.add("external_load", name, shaft, u_coordinate_on_shaft=(u, "mm"), **values)
    return file
