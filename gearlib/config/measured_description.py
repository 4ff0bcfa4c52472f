"""The YAML file that describes a measured table: origin of the data, meaning of the columns.

Names are those of PEtab: observableId, simulationConditionId, measurement, time, noiseParameters.
"""

import re
from contextlib import suppress
from pathlib import Path
from typing import Annotated, Literal

from pydantic import BeforeValidator, Field, TypeAdapter, ValidationError, model_validator

from gearlib import parameters as p
from gearlib import units
from gearlib.checks import InputError, require
from gearlib.config import types as t
from gearlib.config import validation
from gearlib.config.types import Section, field, list_of, quantity
from gearlib.config.validation import error_messages
from gearlib.data import measured_names
from gearlib.models.pair_parameters import PairParameters
from gearlib.parameters import Finite, Load, describe_requirement, numeric_parameters

#: Unit of channels with raw counts of a converter; unit of channels with dates and times.
COUNTS, DATES = "counts", "ISO 8601"
#: Property of the test rig that should be known -> keys of the section `known` that specify it.
_EXPECTED_FACTS = {
    "contact_ratio": {"contact_ratio", "gears"},
    "stiffness": {"stiffness", "max_stiffness", "mean_stiffness", "stiffness_ratio", "gears"},
    "reduced_mass": {"reduced_mass", "inertias", "gears"},
    "load": {"load", "torque"},
    "backlash": {"backlash"},
    "damping": {"damping", "material_damping", "damping_ratio"},
    "transmission_error": {"transmission_error"},
    "ramp_rate": {"ramp_rate", "acceleration"},
}
#: Suffixes of file formats that include the times; suffixes of all file formats.
_TIMED_FORMATS = (".uff", ".unv")
_FORMATS = (".csv", *_TIMED_FORMATS)
#: Observables that are compared as time histories.
_TIME_HISTORIES = {"displacement", "velocity", "acceleration", "dynamic_force"}
#: Unit of a ratio -> conversion factor to the unit 1; pint would parse some of these as angles.
_RATIOS = {"1": 1.0, "percent": 0.01, "%": 0.01}


def _text(max_length):
    """Return the type of a string with 1 to `max_length` characters."""
    allowed = f"a text of 1 to {max_length} characters"
    return t.text(allowed, min_length=1, max_length=max_length)


def _read_facts(value):
    """Return the section `known` if it is a dict with strings as keys, else raise ValueError.

    The section contains facts about the test rig. pydantic generates the error message.
    """
    if not isinstance(value, dict) or not all(isinstance(key, str) for key in value):
        raise ValueError
    return value


_Key = Annotated[str, Field(pattern="(?s).")]
# YAML parses the unit 1 as a number.
_Unit = Annotated[_text(40), BeforeValidator(lambda unit: "1" if type(unit) is int else unit)]
_Facts = t.custom_type(_read_facts, ["object"], "a mapping of names to values")
_Known = Literal["known", "unknown"]
_Checksum = t.text("a checksum of 64 hexadecimal digits", pattern="^[0-9a-f]{64}$")


class FitSection(Section):
    """Model and free parameters that `gearlib fit` fits to a measured set."""

    model: Literal["pair", "six_degrees", "train"] = field("Kind of model.", None)
    free: dict[_Key, list_of(t.Option, 2)] = field(
        "Lowest and highest value of each free parameter.", {}
    )


def free_range(name, limits):
    """Return the limits [lowest, highest value] of a parameter to be fitted, in SI units.

    `name` is the name of the parameter, and `limits` are two numbers or strings with units. If it
    is not a parameter of a gear pair, any finite limits are allowed. Raise ValueError if a limit is
    not allowed.
    """
    parameter = numeric_parameters(PairParameters).get(name)
    annotation = list_of(parameter.annotation if parameter else Finite, 2)
    try:
        return TypeAdapter(annotation).validate_python([*limits], context={})
    except ValidationError:
        raise InputError(
            f"free.{name}", list(limits), describe_requirement(annotation, in_file=True)
        ) from None


class Channel(Section):
    """One column of a table, or one observable of a table in long format."""

    observableId: _text(80) = field("Observable. Default: the key of the channel.", None)
    unit: _Unit = field("Unit of the values: um, N, rpm, deg, counts, ISO 8601 ...", None)
    sensor: _text(200) = field("Sensor that measured the values.", None)
    noise: t.Option = field(
        "Standard deviation: a number in the unit of the channel, or a string with a unit.", None
    )
    gain: _Known = field("unknown: the sensor is not calibrated.", None)
    offset: _Known = field("unknown: the zero of the sensor is arbitrary.", None)
    counts_per_turn: t.integer(2, 2**32) = field("Counts per turn of an encoder.", None)
    count: _text(40) = field("Value of one count of any other converter, e.g. 0.1 um.", None)
    gaps: p.Boolean = field("Whether empty cells are points that were not measured.", None)

    def check(self, key):
        """Raise ValueError if the keys of this channel are not compatible.

        `key` is the name of the channel in the section `channels`. If the values are raw counts of
        a converter, the value of one count must be given, unless the gain is unknown or the
        observable is dimensionless.
        """
        name, channel_key = self.observableId or key, f"channels.{key}"
        known_unit = measured_names.units_and_description(name)
        names = ", ".join(measured_names.KNOWN_QUANTITIES)
        allowed = f"one of {names}, optionally followed by _ and a name"
        require(known_unit, f"{channel_key}.observableId", name, allowed)
        cf_unit, _ = known_unit
        if self.unit is None:
            (_, example), *_ = measured_names.allowed_units(cf_unit)
            raise ValueError(f"{channel_key}.unit is missing: it must be a unit such as {example}")
        count_keys = self.model_dump(include={"counts_per_turn", "count"})
        if self.unit == COUNTS and not count_keys and self.gain != "unknown" and cf_unit != "1":
            raise ValueError(
                f"{channel_key}.counts_per_turn is missing: give the value of a count by "
                "counts_per_turn or count, unless the gain is unknown"
            )
        for count_key, value in count_keys.items():
            allowed = f"omitted, because the unit is {self.unit!r}, not 'counts'"
            require(self.unit == COUNTS, f"{channel_key}.{count_key}", value, allowed)
            allowed = f"the only one of {' and '.join(count_keys)}"
            require(len(count_keys) == 1, f"{channel_key}.{count_key}", value, allowed)
        # Conditions and directions are labels without a unit.
        if name not in ("condition", "direction"):
            self.noise_std(key)  # called only to raise errors about the noise and the unit

    def scale(self, key):
        """Return the conversion factor of this channel to a CF unit, and the CF unit.

        CF units follow the climate and forecast conventions, e.g. "m s-1". `key` is the name of the
        channel in the section `channels`. Raise ValueError if the unit of the channel does not have
        the dimension of the observable.
        """
        name = self.observableId or key
        unit_key, text = "unit", f"1 {self.unit}"
        # Pairs (CF unit, common notation), one for each dimension that the observable may have.
        unit_pairs = measured_names.allowed_units(measured_names.units_and_description(name)[0])
        if self.unit == DATES and name == "time":
            return 1.0, "s"  # Dates are converted to seconds when the table is read.
        if self.unit == COUNTS and self.counts_per_turn is not None:
            unit_key, text = "counts_per_turn", "1 turn"
        elif self.unit == COUNTS and self.count is not None:
            unit_key, text = "count", self.count
        elif self.unit == COUNTS:
            # The value of a count is unknown, so the values remain ratios or counts.
            return 1.0, "1" if unit_pairs[0] == ("1", "1") else "count"
        for cf_unit, written_unit in unit_pairs:
            if cf_unit == "1" and self.unit in _RATIOS:
                return _RATIOS[self.unit], cf_unit
            with suppress(ValueError):
                if cf_unit != "1":
                    # With `counts_per_turn`, `text` is one turn; otherwise it is one unit.
                    return units.parse_quantity(text, written_unit) / (
                        self.counts_per_turn or 1
                    ), cf_unit
        unit_names = " or ".join(written_unit for _, written_unit in unit_pairs)
        zero = ", from absolute zero" if unit_names == "K" else ""
        allowed = f"a unit of the dimension of {unit_names}{zero}, or a value in it, for {name}"
        raise InputError(f"channels.{key}.{unit_key}", getattr(self, unit_key), allowed)

    def noise_std(self, key):
        """Return the standard deviation of this channel in CF units, or 0 if none is given.

        CF units follow the climate and forecast conventions. `key` is the name of the channel in
        the section `channels`. In the file, `noise` is a number in the unit of the channel or a
        string with a unit.
        """
        factor, cf_unit = self.scale(key)
        noise = None
        if isinstance(self.noise, str):
            (_, written_unit), *_ = measured_names.allowed_units(cf_unit)
            with suppress(ValueError):
                noise = units.parse_quantity(self.noise, written_unit)
        elif not isinstance(self.noise, bool):
            # The factor may be negative, but a standard deviation must not be.
            noise = (self.noise or 0.0) * abs(factor)
        allowed = f"a number >= 0 in {self.unit}, or a string with a unit of the same dimension"
        require(noise is not None and noise >= 0, f"channels.{key}.noise", self.noise, allowed)
        return noise


class Condition(Section):
    """Speed and load of all measurements with the same simulationConditionId."""

    speed: quantity("rpm", "1500 rpm", ge=0) = field("Speed of the reference gear, rpm.", None)
    direction: Literal["up", "down", "rest"] = field("How the speed was reached.", None)
    load: Load = field("Static mesh force, N.", None)
    torque: quantity("N m", "120 N m", gt=0) = field("Torque of the reference gear, N m.", None)
    acceleration: quantity("rpm/s", "50 rpm/s") = field("Acceleration of a run-up, rpm/s.", None)


class MeasuredSpeed(Section):
    """A speed at which the motion changes."""

    value: quantity("rpm", "1500 rpm", gt=0) = field("The speed, rpm.")
    noise: quantity("rpm", "5 rpm", ge=0) = field("Standard deviation, rpm.", None)


class Speeds(Section):
    """Measured speeds of jumps and of the onset of contact loss."""

    jump_up: MeasuredSpeed = field("Speed of the jump while the speed increases.", None)
    jump_down: MeasuredSpeed = field("Speed of the jump while the speed decreases.", None)
    onset_of_contact_loss: MeasuredSpeed = field("Speed at which contact loss begins.", None)


class Description(Section):
    """Description of a measured set: its table, its origin and the test rig."""

    data: _text(400) = field("Data file (.csv or .uff) in the folder of this file.", None)
    title: _text(200) = field("Title of the set, in one line.", None)
    source: _text(2000) = field("Who measured the data and where they were published.")
    licence: _text(200) = field("Licence of the data, such as CC BY 4.0; or 'own data'.")
    synthetic: p.Boolean = field("Whether the data were computed, not measured.", None)
    sha256: _Checksum = field("Checksum of the data file.", None)
    separator: Literal[",", ";", "\t", "|"] = field("Column separator of a CSV file.", ",")
    decimal: Literal[".", ","] = field("Decimal separator of a CSV file.", ".")
    comment: Literal["#", "%", "!"] = field("Comment character of a CSV file.", None)
    encoding: Literal["utf-8", "latin-1", "utf-16"] = field("Encoding of a CSV file.", "utf-8")
    skip: t.integer(0, 10_000) = field("Number of lines above the header of a CSV file.", 0)
    channels: dict[_Key, Channel] = field("Meaning of each column, by its name.", {})
    conditions: dict[_Key, Condition] = field("Conditions by their simulationConditionId.", {})
    speeds: Speeds = field("Measured speeds of jumps and of the onset of contact loss.", None)
    known: _Facts = field("Facts about the test rig: contact_ratio, load, backlash ...", {})
    fit: FitSection = field("Model and free parameters for `gearlib fit`.", None)

    @model_validator(mode="after")
    def _check(self):
        """Raise ValueError if the channels, the data file or the limits of a fit are invalid.

        Each observable (a measured quantity) must belong to only one channel.
        """
        key_by_observable = {}
        for key, channel in self.channels.items():
            channel.check(key)
            name = channel.observableId or key
            other_key = key_by_observable.setdefault(name, key)
            allowed = f"unique, but channels.{other_key} has it, too"
            require(other_key == key, f"channels.{key}.observableId", name, allowed)
        allowed = "a file in the same folder with the suffix .csv, .uff or .unv"
        if self.data is None and not self.speeds:
            raise ValueError(f"data is missing: it must be {allowed}")
        if self.data is not None:
            require(Path(self.data).suffix.lower() in _FORMATS, "data", self.data, allowed)
            if not self.channels:
                raise ValueError("channels is missing: it must describe each column by its name")
        for name, limits in (self.fit.free if self.fit else {}).items():
            free_range(name, limits)  # called only to raise errors
        return self

    def table_paths(self, path):
        """Return a list with the path of the data file, if any, for the `path` of the YAML file."""
        return [] if self.data is None else [str(Path(path).parent / self.data)]

    def _observables(self):
        """Return the set of the names of all observables."""
        return {channel.observableId or key for key, channel in self.channels.items()}

    def has_time_histories(self):
        """Return whether the set has time histories measured at constant speed.

        Their speed is given in a condition, not by a channel.
        """
        names = self._observables()
        has_speed = any(condition.speed for condition in self.conditions.values())
        return has_speed and "speed" not in names and bool(names & _TIME_HISTORIES)

    def has_run_ups(self):
        """Return whether the set has time histories measured at varying speed.

        The speed is given by a channel, and the times by another channel or by the file format.
        """
        names = self._observables()
        suffix = Path(self.data or "").suffix.lower()
        has_times = "time" in names or suffix in _TIMED_FORMATS
        return has_times and "speed" in names and bool(names & _TIME_HISTORIES)

    def unknown_properties(self):
        """Return the names of the expected properties of the test rig that are unknown.

        A property, such as the stiffness, is known if the section `known` contains one of its keys
        in `_EXPECTED_FACTS` with a value other than "unknown".
        """
        facts = dict(self.known).items()
        known_keys = {key for key, value in facts if value not in (None, "unknown")}
        return [name for name, keys in _EXPECTED_FACTS.items() if not known_keys & keys]


def read_sets(paths):
    """Read measured sets and return them as a dict: name of the set -> (path, `Description`).

    `paths` are the paths of the YAML files; the name of a set is its file name without the suffix.
    Raise ValueError if a description is invalid, if a data file is missing, or if two files have
    the same name.
    """
    descriptions = {}
    for i, path in enumerate(paths):
        name, key = Path(path).stem, f"measured[{i}]"
        allowed = "a path whose name has at most 60 characters: letters, digits, +, _ and -"
        require(re.fullmatch("[A-Za-z0-9+_-]{1,60}", name), key, path, allowed)
        other_path, _ = descriptions.get(name, ("", None))
        require(name not in descriptions, key, path, f"a file with a name other than {other_path}")
        require(Path(path).is_file(), key, path, "a path of a YAML file")
        description = read_description(path)
        for table_path in description.table_paths(path):
            if not Path(table_path).is_file():
                raise ValueError(
                    f"{path}: {InputError('data', description.data, 'a file in the same folder')}"
                )
        descriptions[name] = path, description
    return descriptions


def read_description(path):
    """Read the YAML file that describes a measured set.

    Raise ValueError if it is invalid; the message lists all problems, one per line.
    """
    content, problems = validation.read_yaml(path)
    if problems:
        raise ValueError("\n".join(problems))
    try:
        return Description.model_validate(content)
    except ValidationError as error:
        problems = error_messages(error, Description, content)
        raise ValueError("\n".join(f"{path}: {text}" for text in problems)) from None
