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
        """Unpack the FMU into a new folder and create an instance, optionally with Event Mode."""
        self.folder = folder = Path(tempfile.mkdtemp(dir=path.parent))
        with zipfile.ZipFile(path) as archive:
            archive.extractall(folder)
        self.description = ElementTree.parse(folder / "modelDescription.xml").getroot()
        variables = self.description.find("ModelVariables")
        self.references = {
            variable.get("name"): int(variable.get("valueReference")) for variable in variables
        }
        (self.binary,) = folder.glob("binaries/*/*")
        self.library, self.messages, self.time = ctypes.CDLL(str(self.binary)), [], 0.0
        # The callback is an attribute so that it is not deleted while the library may call it.
        self.log_message = _LOGGER(
            lambda _, status, category, message: self.messages.append(message.decode())
        )
        instantiate = self.library.fmi3InstantiateCoSimulation
        instantiate.restype = c_void_p
        token = self.description.get("instantiationToken").encode()
        # The flags are visible, loggingOn, eventModeUsed and earlyReturnAllowed.
        flags = c_bool(False), c_bool(False), c_bool(event_mode), c_bool(event_mode)
        self.instance = c_void_p(
            instantiate(
                b"test", token, None, *flags, None, c_size_t(0), None, self.log_message, None
            )
        )
        assert self.instance.value

    def call(self, name: str, *arguments) -> None:
        """Call a function of the FMU and raise RuntimeError with its message if it fails."""
        if getattr(self.library, f"fmi3{name}")(self.instance, *arguments):
            raise RuntimeError(self.messages[-1])

    def start(self, **values: float) -> "Instance":
        """Initialise the instance with given values of variables."""
        has_tolerance, tolerance = c_bool(False), c_double(0.0)
        has_stop_time, stop_time = c_bool(False), c_double(0.0)
        start_time = c_double(self.time)
        self.call(
            "EnterInitializationMode",
            has_tolerance,
            tolerance,
            start_time,
            has_stop_time,
            stop_time,
        )
        self.set(values)
        self.call("ExitInitializationMode")
        return self

    def start_at(self, train, coordinates, rates) -> "Instance":
        """Initialise the instance with coordinates in m and their rates in m/s."""
        names = coordinate_names(train)
        values = {f"q.{name}": value for name, value in zip(names, coordinates, strict=True)}
        values |= {f"v.{name}": value for name, value in zip(names, rates, strict=True)}
        return self.start(**values)

    def set(self, values: dict) -> None:
        """Set variables of type Float64, given as a dict by name."""
        references = (c_uint32 * len(values))(*(self.references[name] for name in values))
        numbers, count = (c_double * len(values))(*values.values()), c_size_t(len(values))
        self.call("SetFloat64", references, count, numbers, count)

    def get(self, *names: str) -> np.ndarray:
        """Return the values of variables of type Float64."""
        numbers, count = (c_double * len(names))(), c_size_t(len(names))
        references = (c_uint32 * len(names))(*(self.references[name] for name in names))
        self.call("GetFloat64", references, count, numbers, count)
        return np.array(numbers)

    def get_integer(self, name: str) -> int:
        """Return the value of a variable of type Int32."""
        number, count = c_int32(), c_size_t(1)
        self.call("GetInt32", byref(c_uint32(self.references[name])), count, byref(number), count)
        return number.value

    def get_state(self, train) -> np.ndarray:
        """Return the coordinates in m, followed by their rates in m/s."""
        names = coordinate_names(train)
        return self.get(*(f"{kind}.{name}" for kind in "qv" for name in names))

    def step(self, end: float) -> tuple[bool, bool]:
        """Advance to a time; return whether an event occurred and whether the step ended early."""
        needs_event_handling, terminate, returned_early = c_bool(), c_bool(), c_bool()
        last_time, can_discard_earlier_states = c_double(), c_bool(True)
        self.call(
            "DoStep",
            c_double(self.time),
            c_double(end - self.time),
            can_discard_earlier_states,
            byref(needs_event_handling),
            byref(terminate),
            byref(returned_early),
            byref(last_time),
        )
        self.time = last_time.value if returned_early.value else end
        return needs_event_handling.value, returned_early.value

    def run(self, end: float, step: float) -> "Instance":
        """Advance to the time `end` by equal communication steps; the last one may be shorter."""
        start = self.time
        # A remainder below 0.01 steps, which is due to rounding, does not count as a step.
        step_count = max(round((end - start) / step + 0.49), 1)
        for number in range(1, step_count):
            self.step(start + number * step)
        self.step(end)
        return self

    def enter_event_mode(self) -> None:
        """Let the instance handle an event and return to Step Mode."""
        flags = [c_bool() for _ in range(5)]
        self.call("EnterEventMode")
        self.call("UpdateDiscreteStates", *map(byref, flags), byref(c_double()))
        self.call("EnterStepMode")

    def serialise(self) -> bytes:
        """Return the FMU state of the instance as bytes."""
        state, size = c_void_p(), c_size_t()
        self.call("GetFMUState", byref(state))
        self.call("SerializedFMUStateSize", state, byref(size))
        buffer = (c_uint8 * size.value)()
        self.call("SerializeFMUState", state, buffer, size)
        self.call("FreeFMUState", byref(state))
        return bytes(buffer)

    def restore(self, serialised_state: bytes, time: float) -> "Instance":
        """Restore the FMU state from the bytes of `serialise`, and set the time of the instance."""
        state, size = c_void_p(), len(serialised_state)
        buffer = (c_uint8 * size)(*serialised_state)
        self.call("DeserializeFMUState", buffer, c_size_t(size), byref(state))
        self.call("SetFMUState", state)
        self.call("FreeFMUState", byref(state))
        self.time = time
        return self
