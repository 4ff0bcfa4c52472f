"""`write_fmu`: the FMU of a gear train, with its sources and a binary for this machine."""

import hashlib
import os
import platform
import re
import shutil
import subprocess
import tempfile
import warnings
import zipfile
from pathlib import Path
from typing import Annotated, Any
from xml.sax.saxutils import quoteattr

import numpy as np
from annotated_types import Ge

from gearlib import checks
from gearlib.data import files
from gearlib.fmu import matrices
from gearlib.parameters import Boolean, Unit, checked
from gearlib.units import cf_units
from gearlib.version import __version__

_TEMPLATE = Path(__file__).with_name("template.c")
#: Unit of a variable -> exponents of metre, kilogram, second and radian.
_UNITS = {
    "s": {"s": 1},
    "m": {"m": 1},
    "m/s": {"m": 1, "s": -1},
    "rad": {"rad": 1},
    "rad/s": {"rad": 1, "s": -1},
    "N": {"kg": 1, "m": 1, "s": -2},
    "N m": {"kg": 1, "m": 2, "s": -2},
}
#: Name of the operating system in Python -> (name in FMI, suffix of a shared library).
_SYSTEMS = {
    "Linux": ("linux", ".so"),
    "Darwin": ("darwin", ".dylib"),
    "Windows": ("windows", ".dll"),
}
_FLAGS = ("-std=c99", "-O2", "-ffp-contract=off", "-fPIC", "-shared", "-fvisibility=hidden")
#: Fixed timestamp of all entries of the archive, which makes the FMU file reproducible.
_ENTRY_TIME = (1980, 1, 1, 0, 0, 0)
_StartSpeed = Annotated[float, Ge(0), Unit("rpm", "2000 rpm")]


@checked
def write_fmu(
    model: Any, path: Any, *, prescribed_speed: Boolean = False, speed: _StartSpeed = 0.0
) -> None:
    """Write a gear train as an FMU: FMI 3.0, Co-Simulation, no Python at run time.

    The FMU contains C99 sources with the matrices of the train and, if there is a C compiler, a
    binary for this machine; without a compiler a warning is issued. The motion is the same as with
    `simulate` and `run_up`: in closed form from event to event, for any communication step. A step
    returns early at contact events if the importer uses Event Mode.

    Inputs are the torques on the bodies in N m, positive counterclockwise. Unbalanced torques
    accelerate the rigid-body rotation of the train, which determines the phases of the meshes;
    dampers act on the deviations from this rotation. With `prescribed_speed` the speed of the
    reference pinion is an input instead, and the torque that maintains it acts on the body with the
    largest input power. A change of this input takes effect immediately, without inertia forces.

    Backlashes are tunable parameters. Outputs are angle and speed of each body, displacement,
    elastic force and contact (1 drive side, 0 none, -1 coast side) of each mesh, and the forces on
    bearings; forces on the pins of a carrier are radial and tangential. The coordinates and their
    rates are local variables that can be set. The initial state is the static equilibrium at mesh
    phase 0.

    Parameters
    ----------
    model : GearTrain or SixDegreePair
        The gears. Friction is not supported, nor are models without bodies such as a GearPair.
    path : str or path-like
        File to write, with a name that ends with .fmu. An existing file is replaced.
    prescribed_speed : bool, default False
        Whether the speed is an input. This is required for trains with forces of a rotating frame
        (`gyroscopic`), and for trains that cannot rotate freely as a whole.
    speed : float, default 0
        Initial speed of the reference pinion in rpm, finite, >= 0, in its sense of rotation.

    Raises
    ------
    ValueError
        If the model cannot be written as an FMU, or if the file name does not end with .fmu; the
        message states the parameter and its value.
    """
    path = Path(path)
    checks.require(path.suffix == ".fmu", "path", str(path), "a name that ends with .fmu")
    train = checks.require_train(model)
    matrices.check_fmu_train(train, prescribed_speed)
    bearing_names, bearing_rows = matrices.bearing_force_rows(train)
    data = matrices.train_constants(train, prescribed_speed, speed)
    padding = np.zeros((0 if bearing_names else 1, bearing_rows.shape[1]))  # C has no empty arrays
    data |= {"R": len(bearing_rows), "BEARING": np.concatenate([bearing_rows, padding])}
    identifier = re.sub(r"\W", "_", path.stem, flags=re.ASCII)
    identifier = identifier if identifier[:1].isalpha() else f"train_{identifier}"
    token = hashlib.sha256(repr([__version__, identifier, _c_header(data)]).encode()).hexdigest()[
        :32
    ]
    sources = {
        "model_data.h": f'{_c_header(data)}#define TOKEN "{{{token}}}"\n',
        "gear_train.c": _TEMPLATE.read_text(encoding="utf-8"),
    }
    entries: dict[str, str | bytes] = {
        "modelDescription.xml": _model_description(train, data, bearing_names, identifier, token),
        "sources/buildDescription.xml": _build_description(identifier),
    }
    entries |= {f"sources/{name}": text for name, text in sources.items()}
    entries |= _compile_binary(sources, identifier)
    with files.atomic_write(path) as temporary, zipfile.ZipFile(temporary, "w") as archive:
        for name, content in entries.items():
            info = zipfile.ZipInfo(name, _ENTRY_TIME)
            info.compress_type, info.external_attr = zipfile.ZIP_DEFLATED, 0o644 << 16
            archive.writestr(info, content)


def _c_literal(value: Any) -> str:
    """Convert a number or an array to C source; floats are hexadecimal, hence exact."""
    if isinstance(value, np.ndarray):
        return f"{{{', '.join(map(_c_literal, value))}}}"
    return float(value).hex() if isinstance(value, float) else str(int(value))


def _c_header(data: dict[str, Any]) -> str:
    """Return the C header with the constants of a train.

    `data` maps names in C to arrays, floats or integers. Arrays become static constants. Numbers
    become macros, because some of them are array sizes.
    """
    lines = ["/* Matrices of a gear train in SI units, written by gearlib. */\n"]
    for name, value in data.items():
        if isinstance(value, np.ndarray):
            kind = "double" if value.dtype.kind == "f" else "int"
            shape = "".join(f"[{size}]" for size in value.shape)
            lines.append(f"static const {kind} {name}{shape} = {_c_literal(value)};\n")
        else:
            lines.append(f"#define {name} ({_c_literal(value)})\n")
    return "".join(lines)


def _compile_binary(sources: dict[str, str], identifier: str) -> dict[str, bytes]:
    """Compile the C sources; return the shared library as {path in the FMU: content}.

    `sources` maps file names to source code, and `identifier` is the model identifier. If there is
    no compiler or it fails, warn with the reason and return an empty dict.
    """
    # FMI requires a folder named after processor and operating system, e.g. x86_64-linux.
    machine = {"AMD64": "x86_64", "arm64": "aarch64"}.get(platform.machine(), platform.machine())
    system, suffix = _SYSTEMS.get(platform.system(), ("linux", ".so"))
    names = [name for name in (os.environ.get("CC"), "cc", "gcc", "clang") if name]
    compilers = [path for path in map(shutil.which, names) if path]
    reason = "there is no C compiler (CC, cc, gcc or clang)"
    with tempfile.TemporaryDirectory() as folder:
        for name, text in sources.items():
            Path(folder, name).write_text(text, encoding="utf-8")
        if compilers:
            library = Path(folder, f"{identifier}{suffix}")
            command = [compilers[0], *_FLAGS, "-o", library.name, "gear_train.c", "-lm"]
            result = subprocess.run(command, cwd=folder, capture_output=True, text=True)
            if result.returncode == 0:
                return {f"binaries/{machine}-{system}/{library.name}": library.read_bytes()}
            reason = f"{compilers[0]} failed: {result.stderr.strip()[:500]}"
    warnings.warn(f"the FMU has sources but no binary, because {reason}", stacklevel=4)
    return {}


def _xml_element(tag: str, content: str = "", /, **attributes: Any) -> str:
    """Return an XML element as a string, with the given tag, content and attributes.

    Attributes that are None are omitted.
    """
    text = "".join(
        f" {name}={quoteattr(str(value))}"
        for name, value in attributes.items()
        if value is not None
    )
    return f"<{tag}{text}>{content}</{tag}>\n" if content else f"<{tag}{text}/>\n"


def _fmi_variables(train: Any, data: dict[str, Any], bearing_names: list) -> list[tuple[dict, str]]:
    """Return (attributes, FMI type) of all variables in the order of their value references.

    `data` contains the constants of the C template, and `bearing_names` are pairs (body, axis). The
    order must be the same as in the C source.
    """
    coordinates = [f"{body}.{axis}".rstrip(".") for body, axis in train.structure.coordinates]
    reference, local, output = 0, {"causality": "local"}, {"causality": "output"}
    variables: list[tuple[dict, str]] = []

    def add(name, unit, description, kind="Float64", shown=True, start=None, **attributes):
        """Append a variable of the FMI type `kind` with the next value reference to `variables`.

        `start` is its initial value, or None if it is computed; `attributes` are further attributes
        of its XML element. A variable that is not `shown` still has a value reference, because the
        C source numbers all variables.
        """
        nonlocal reference
        if start is not None:
            attributes["start"] = repr(float(start))
            if attributes["causality"] != "input":
                attributes["initial"] = "exact"
        if unit:
            attributes["unit"] = cf_units(unit)
        identity = {"name": name, "valueReference": reference, "description": description}
        if shown:
            variables.append((identity | attributes, kind))
        reference += 1

    add("time", "s", "Time", causality="independent")
    add("phase", "rad", f"Phase of mesh {train.reference}", start=0.0, **local)
    rate, prescribed = data["START_RATE"], bool(data["PRESCRIBED"])
    text = "Rate of the phase"
    add("phase_rate", "rad/s", text, start=None if prescribed else rate, **local)
    text = f"Speed of {train.reference_pinion.name}, positive counterclockwise"
    start = rate * data["PINION_RATE"]
    add("speed", "rad/s", text, shown=prescribed, start=start, causality="input")
    add("events", "", "Number of contact events", "Int32", variability="discrete", **local)
    for name, start in zip(coordinates, data["START_Q"], strict=True):
        add(f"q.{name}", "m", "Coordinate relative to the rigid rotation", start=start, **local)
    for name in coordinates:
        add(f"v.{name}", "m/s", "Rate of the coordinate", start=0.0, **local)
    for b, body in enumerate(train.bodies):
        name, shown = f"torque.{body.name}", bool(data["ROTATION"][b].any())
        if b == data["DRIVER"]:
            add(name, "N m", "Torque that maintains the speed", shown=shown, **output)
        else:
            add(name, "N m", "Torque", shown=shown, start=body.torque, causality="input")
    tunable = {"causality": "parameter", "variability": "tunable"}
    for j, mesh in enumerate(train.meshes):
        shown, start = bool(data["HAS_COAST"][j]), data["START_BACKLASH"][j]
        add(f"backlash.{mesh.name}", "m", "Backlash", shown=shown, start=start, min="0", **tunable)
    for body in train.bodies:
        add(f"angle.{body.name}", "rad", "Angle of rotation", **output)
    for body in train.bodies:
        add(f"speed.{body.name}", "rad/s", "Speed of rotation", **output)
    for mesh in train.meshes:
        add(f"displacement.{mesh.name}", "m", "Relative displacement of the flanks", **output)
    for mesh in train.meshes:
        add(f"mesh_force.{mesh.name}", "N", "Elastic force, negative on the coast side", **output)
    for mesh in train.meshes:
        text = "1 drive-side contact, 0 contact loss, -1 coast-side contact"
        add(f"contact.{mesh.name}", "", text, "Int32", variability="discrete", **output)
    for body_name, axis in bearing_names:
        text = "Force of the body on its bearing"
        add(f"bearing_force.{body_name}.{axis}", "N", text, **output)
    return variables


def _model_description(train, data, bearing_names, identifier: str, token: str) -> str:
    """Return the content of modelDescription.xml, with variables and capabilities of the FMU.

    `data` maps names in C to the constants of the train, and `bearing_names` are pairs (body,
    axis). `identifier` is the model identifier, and `token` is the instantiation token, a hash
    without braces.
    """
    variables = _fmi_variables(train, data, bearing_names)
    units = "".join(
        _xml_element("Unit", _xml_element("BaseUnit", **powers), name=cf_units(unit))
        for unit, powers in _UNITS.items()
    )
    outputs, unknowns = "", ""
    for attributes, _kind in variables:
        reference = attributes["valueReference"]
        if attributes["causality"] == "output":
            outputs += _xml_element("Output", valueReference=reference)
            unknowns += _xml_element("InitialUnknown", valueReference=reference)
    capabilities = "canHandleVariableCommunicationStepSize", "canGetAndSetFMUState"
    capabilities += "canSerializeFMUState", "hasEventMode", "mightReturnEarlyFromDoStep"
    variable_tags = "".join(_xml_element(kind, **attributes) for attributes, kind in variables)
    content = (
        _xml_element(
            "CoSimulation", modelIdentifier=identifier, **dict.fromkeys(capabilities, "true")
        )
        + _xml_element("UnitDefinitions", units)
        + _xml_element("LogCategories", _xml_element("Category", name="logStatus"))
        + _xml_element("ModelVariables", variable_tags)
        + _xml_element("ModelStructure", outputs + unknowns)
    )
    return '<?xml version="1.0" encoding="UTF-8"?>\n' + _xml_element(
        "fmiModelDescription",
        content,
        fmiVersion="3.0",
        modelName=identifier,
        instantiationToken=f"{{{token}}}",
        description="A gear train: contact events in closed form",
        generationTool=f"gearlib {__version__}",
        variableNamingConvention="flat",
    )


def _build_description(identifier: str) -> str:
    """Return the content of buildDescription.xml, from which importers compile the sources.

    `identifier` is the model identifier.
    """
    source = _xml_element(
        "SourceFileSet", _xml_element("SourceFile", name="gear_train.c"), language="C99"
    )
    configuration = _xml_element("BuildConfiguration", source, modelIdentifier=identifier)
    return '<?xml version="1.0" encoding="UTF-8"?>\n' + _xml_element(
        "fmiBuildDescription", configuration, fmiVersion="3.0"
    )
