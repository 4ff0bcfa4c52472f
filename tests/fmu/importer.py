"""A small importer of FMUs by ctypes, for tests that run without FMPy."""

import ctypes
import tempfile
import zipfile
from ctypes import byref, c_bool, c_char_p, c_double, c_int32, c_size_t, c_uint8, c_uint32, c_void_p
from pathlib import Path
from xml.etree import ElementTree

import numpy as np

_LOGGER = ctypes.CFUNCTYPE(None, c_void_p, ctypes.c_int, c_char_p, c_char_p)


def coordinate_names(train) -> list[str]:
    """Return the names of the coordinates of a train in its FMU, such as "pinion.x"."""
    return [f"{body}.{axis}".rstrip(".") for body, axis in train.structure.coordinates]


class Instance:
    """An instance of an FMU, whose binary is loaded from the unpacked file."""

    def __init__(self, path: Path, event_mode: bool = False):
        """Unpack the FMU to a new folder and create an instance, with Event Mode or without."""
        self.folder = folder = Path(tempfile.mkdtemp(dir=path.parent))
        with zipfile.ZipFile(path) as archive:
            archive.extractall(folder)
        self.description = ElementTree.parse(folder / "modelDescription.xml").getroot()
        variables = self.description.find("ModelVariables")
        self.references = {x.get("name"): int(x.get("valueReference")) for x in variables}
        (self.binary,) = folder.glob("binaries/*/*")
        self.library, self.messages, self.time = ctypes.CDLL(str(self.binary)), [], 0.0
        self.log = _LOGGER(lambda _, status, category, text: self.messages.append(text.decode()))
        create = self.library.fmi3InstantiateCoSimulation
        create.restype = c_void_p
        token = self.description.get("instantiationToken").encode()
        flags = c_bool(False), c_bool(False), c_bool(event_mode), c_bool(event_mode)
        self.instance = c_void_p(
            create(b"test", token, None, *flags, None, c_size_t(0), None, self.log, None)
        )
        assert self.instance.value

    def call(self, name: str, *arguments) -> None:
        """Call a function of the FMU and raise RuntimeError with its message if it fails."""
        if getattr(self.library, f"fmi3{name}")(self.instance, *arguments):
            raise RuntimeError(self.messages[-1])

    def start(self, **values: float) -> "Instance":
        """Initialise with values of variables; names may have _ in place of dots."""
        times = c_bool(False), c_double(0.0), c_double(self.time), c_bool(False), c_double(0.0)
        self.call("EnterInitializationMode", *times)
        self.set(values)
        self.call("ExitInitializationMode")
        return self

    def start_at(self, train, q, v, **values: float) -> "Instance":
        """Initialise with coordinates in m and their rates in m/s."""
        names = coordinate_names(train)
        state = {f"q.{name}": x for name, x in zip(names, q, strict=True)}
        state |= {f"v.{name}": x for name, x in zip(names, v, strict=True)}
        return self.start(**(state | values))

    def set(self, values: dict) -> None:
        """Set variables by name."""
        references = (c_uint32 * len(values))(*(self.references[name] for name in values))
        numbers, count = (c_double * len(values))(*values.values()), c_size_t(len(values))
        self.call("SetFloat64", references, count, numbers, count)

    def get(self, *names: str) -> np.ndarray:
        """Return the values of variables of type Float64."""
        numbers, count = (c_double * len(names))(), c_size_t(len(names))
        references = (c_uint32 * len(names))(*(self.references[name] for name in names))
        self.call("GetFloat64", references, count, numbers, count)
        return np.array(numbers)

    def integer(self, name: str) -> int:
        """Return the value of a variable of type Int32."""
        number, count = c_int32(), c_size_t(1)
        self.call("GetInt32", byref(c_uint32(self.references[name])), count, byref(number), count)
        return number.value

    def state(self, train) -> np.ndarray:
        """Return the coordinates in m, followed by their rates in m/s."""
        names = coordinate_names(train)
        return self.get(*(f"{kind}.{name}" for kind in "qv" for name in names))

    def step(self, end: float) -> tuple[bool, bool]:
        """Advance to a time; return (whether there is an event, whether the step ended early)."""
        flags, last = [c_bool() for _ in range(3)], c_double()
        step = c_double(self.time), c_double(end - self.time), c_bool(True)
        self.call("DoStep", *step, *map(byref, flags), byref(last))
        early = flags[2].value
        self.time = last.value if early else end
        return flags[0].value, early

    def run(self, end: float, step: float) -> "Instance":
        """Advance to a time by equal communication steps; the last one may be shorter."""
        start, count = self.time, max(round((end - self.time) / step + 0.49), 1)
        for i in range(1, count + 1):
            self.step(end if i == count else start + i * step)
        return self

    def enter_event_mode(self) -> None:
        """Let the instance handle an event."""
        flags = [c_bool() for _ in range(5)]
        self.call("EnterEventMode")
        self.call("UpdateDiscreteStates", *map(byref, flags), byref(c_double()))
        self.call("EnterStepMode")

    def serialised(self) -> bytes:
        """Return the whole state as bytes."""
        state, size = c_void_p(), c_size_t()
        self.call("GetFMUState", byref(state))
        self.call("SerializedFMUStateSize", state, byref(size))
        text = (c_uint8 * size.value)()
        self.call("SerializeFMUState", state, text, size)
        self.call("FreeFMUState", byref(state))
        return bytes(text)

    def restore(self, state: bytes, time: float) -> "Instance":
        """Restore the whole state from the bytes of `serialised`."""
        copy = c_void_p()
        text = (c_uint8 * len(state))(*state)
        self.call("DeserializeFMUState", text, c_size_t(len(state)), byref(copy))
        self.call("SetFMUState", copy)
        self.call("FreeFMUState", byref(copy))
        self.time = time
        return self
