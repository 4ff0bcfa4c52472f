"""The YAML file beside a measured table: origin of the data, and meaning of the columns.

Names come from PEtab: observableId, simulationConditionId, measurement, time, noiseParameters.
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

#: Unit of channels with raw counts of a converter; unit of channels with dates and times of day.
COUNTS, DATES = "counts", "ISO 8601"
#: Property of the test rig that should be known -> keys that state it.
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
#: Suffixes of files that include the times; suffixes of all files.
_TIMED_FORMATS = (".uff", ".unv")
_FORMATS = (".csv", *_TIMED_FORMATS)
#: Observables that are compared as time histories.
_TIME_HISTORIES = {"displacement", "velocity", "acceleration", "dynamic_force"}
#: Unit of a ratio -> factor to the unit 1; pint would read some of these units as angles.
_RATIOS = {"1": 1.0, "percent": 0.01, "%": 0.01}


def _text(max_length):
    """Return the type of a string of 1 to `max_length` characters, for a configuration key."""
    comment = f"a text of 1 to {max_length} characters"
    return t.text(comment, min_length=1, max_length=max_length)


def _read_facts(value):
    """Return `value` if it is a dict whose keys are strings, else raise ValueError.

    It is the section `known`: facts about the test rig by name. The error needs no message, because
    pydantic makes one from the type of the section.
    """
    if not isinstance(value, dict) or not all(isinstance(key, str) for key in value):
        raise ValueError
    return value


_Key = Annotated[str, Field(pattern="(?s).")]
# YAML reads the unit 1 as a number.
_Unit = Annotated[_text(40), BeforeValidator(lambda unit: "1" if type(unit) is int else unit)]
_Facts = t.custom_type(_read_facts, ["object"], "a mapping of names to what is known")
_Known = Literal["known", "unknown"]
_Checksum = t.text("a checksum of 64 hexadecimal digits", pattern="^[0-9a-f]{64}$")


class FitSection(Section):
    """Model and parameters that `gearlib fit` fits to a measured set."""

    model: Literal["pair", "six_degrees", "train"] = field("Kind of the model.", None)
    free: dict[_Key, list_of(t.Option, 2)] = field("Lowest and highest value by parameter.", {})


def free_range(name, limits):
    """Return [lowest, highest value] of a parameter that `gearlib fit` varies, in SI units.

    `name` is the name of the parameter, and `limits` has two numbers or strings with units. A
    parameter that does not belong to a gear pair may have any finite limits. Raise ValueError if a
    limit is not allowed.
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
    """One column of a table, or one observable of a long one."""

    observableId: _text(80) = field("Observable. Default: the key of the channel.", None)
    unit: _Unit = field("Unit of the values: um, N, rpm, deg, counts, ISO 8601 ...", None)
    sensor: _text(200) = field("Sensor that measured it.", None)
    noise: t.Option = field("Standard deviation, in the unit of the channel or its own.", None)
    gain: _Known = field("unknown: the sensor is not calibrated.", None)
    offset: _Known = field("unknown: the zero means nothing.", None)
    counts_per_turn: t.integer(2, 2**32) = field("Counts of one turn of an encoder.", None)
    count: _text(40) = field("Value of one count of another converter: 0.1 um.", None)
    gaps: p.Boolean = field("Whether empty cells are points that were not measured.", None)

    def check(self, key):
        """Raise ValueError if the keys of this channel are not compatible.

        A channel is a column of the measured table, and `key` is its name in the section
        `channels`. Values may be raw counts of a converter; then the value of one count must be
        known, unless the gain is unknown or the observable is a bare number.
        """
        name, channel_key = self.observableId or key, f"channels.{key}"
        known_unit = measured_names.units_and_description(name)
        names = ", ".join(measured_names.KNOWN_QUANTITIES)
        allowed = f"one of {names}, which may be followed by _ and a name"
        require(known_unit, f"{channel_key}.observableId", name, allowed)
        cf_unit, _ = known_unit
        if self.unit is None:
            (_, example), *_ = measured_names.allowed_units(cf_unit)
            raise ValueError(f"{channel_key}.unit is missing: it must be one such as {example}")
        count_keys = self.model_dump(include={"counts_per_turn", "count"})
        if self.unit == COUNTS and not count_keys and self.gain != "unknown" and cf_unit != "1":
            raise ValueError(
                f"{channel_key}.counts_per_turn is missing: the value of a count must be given by "
                "counts_per_turn or count, or the gain must be unknown"
            )
        for other_key, value in count_keys.items():
            allowed = f"left out: the unit is {self.unit!r}, not 'counts'"
            require(self.unit == COUNTS, f"{channel_key}.{other_key}", value, allowed)
            allowed = f"one of {' and '.join(count_keys)}"
            require(len(count_keys) == 1, f"{channel_key}.{other_key}", value, allowed)
        # Conditions and directions are labels, which have no unit.
        if name not in ("condition", "direction"):
            self.noise_std(key)  # This raises the errors of noise and unit.

    def scale(self, key):
        """Return the factor that converts values of this channel to a CF unit, and this unit.

        CF units are those of the climate and forecast conventions, such as "m s-1". `key` is the
        name of the channel in the section `channels`. Raise ValueError if the unit does not fit the
        observable.
        """
        name = self.observableId or key
        unit_key, text = "unit", f"1 {self.unit}"
        # Pairs (CF unit, usual notation), one for each dimension that the observable may have.
        unit_pairs = measured_names.allowed_units(measured_names.units_and_description(name)[0])
        if self.unit == DATES and name == "time":
            return 1.0, "s"  # Reading the table converts dates to seconds.
        if self.unit == COUNTS and self.counts_per_turn is not None:
            unit_key, text = "counts_per_turn", "1 turn"
        elif self.unit == COUNTS and self.count is not None:
            unit_key, text = "count", self.count
        elif self.unit == COUNTS:
            # The value of a count is not known, so that values stay relative numbers or counts.
            return 1.0, "1" if unit_pairs[0] == ("1", "1") else "count"
        for cf_unit, written_unit in unit_pairs:
            if cf_unit == "1" and self.unit in _RATIOS:
                return _RATIOS[self.unit], cf_unit
            with suppress(ValueError):
                if cf_unit != "1":
                    # If `text` is one turn, it is divided into counts; else nothing is divided.
                    return units.parse_quantity(text, written_unit) / (
                        self.counts_per_turn or 1
                    ), cf_unit
        unit_names = " or ".join(written_unit for _, written_unit in unit_pairs)
        zero = ", from absolute zero" if unit_names == "K" else ""
        allowed = f"a value in, or a unit of the dimension of {unit_names}{zero}, for {name}"
        raise InputError(f"channels.{key}.{unit_key}", getattr(self, unit_key), allowed)

    def noise_std(self, key):
        """Return the standard deviation of this channel in CF units, 0 if it is not given.

        CF units are those of the climate and forecast conventions. `key` is the name of the channel
        in the section `channels`. The key `noise` is a number in the unit of the channel, or a
        string with a unit of its own.
        """
        factor, cf_unit = self.scale(key)
        noise = None
        if isinstance(self.noise, str):
            (_, written_unit), *_ = measured_names.allowed_units(cf_unit)
            with suppress(ValueError):
                noise = units.parse_quantity(self.noise, written_unit)
        elif not isinstance(self.noise, bool):
            # A factor may be negative, a standard deviation may not.
            noise = (self.noise or 0.0) * abs(factor)
        allowed = f"a number >= 0 in {self.unit}, or a text with a unit of its dimension"
        require(noise is not None and noise >= 0, f"channels.{key}.noise", self.noise, allowed)
        return noise


class Condition(Section):
    """Speed and load of all measurements with one simulationConditionId."""

    speed: quantity("rpm", "1500 rpm", ge=0) = field("Speed of the gear that counts, rpm.", None)
    direction: Literal["up", "down", "rest"] = field("How the speed was reached.", None)
    load: Load = field("Static mesh force, N.", None)
    torque: quantity("N m", "120 N m", gt=0) = field("Torque of the same gear, N m.", None)
    acceleration: quantity("rpm/s", "50 rpm/s") = field("Rate of the ramp, rpm/s.", None)


class MeasuredSpeed(Section):
    """A speed at which the motion changes."""

    value: quantity("rpm", "1500 rpm", gt=0) = field("The speed, rpm.")
    noise: quantity("rpm", "5 rpm", ge=0) = field("Standard deviation, rpm.", None)


class Speeds(Section):
    """Measured speeds of jumps and of the onset of contact loss."""

    jump_up: MeasuredSpeed = field("Speed at which the motion jumps while the speed goes up.", None)
    jump_down: MeasuredSpeed = field("Speed of the jump while the speed goes down.", None)
    onset_of_contact_loss: MeasuredSpeed = field("Speed from which contact is lost.", None)


class Description(Section):
    """A measured set: a table and what is said of it."""

    data: _text(400) = field("The file beside this one: .csv or .uff.", None)
    title: _text(200) = field("Title of the set, in a line.", None)
    source: _text(2000) = field("Who measured it, where it was published.")
    licence: _text(200) = field("Licence of the data, such as CC BY 4.0; or 'own data'.")
    synthetic: p.Boolean = field("Whether it was computed, not measured.", None)
    sha256: _Checksum = field("Checksum of the file.", None)
    separator: Literal[",", ";", "\t", "|"] = field("Separator of the cells of a CSV.", ",")
    decimal: Literal[".", ","] = field("Decimal sign of a CSV.", ".")
    comment: Literal["#", "%", "!"] = field("Sign that begins a comment in a CSV.", None)
    encoding: Literal["utf-8", "latin-1", "utf-16"] = field("Encoding of a CSV.", "utf-8")
    skip: t.integer(0, 10_000) = field("Lines of a CSV above its names of columns.", 0)
    channels: dict[_Key, Channel] = field("Meaning of each column, by its name.", {})
    conditions: dict[_Key, Condition] = field("Conditions by their simulationConditionId.", {})
    speeds: Speeds = field("Measured speeds of jumps and of the onset of contact loss.", None)
    known: _Facts = field("What is known of the rig: contact_ratio, load, backlash ...", {})
    fit: FitSection = field("Model and parameters for `gearlib fit`.", None)

    @model_validator(mode="after")
    def _check(self):
        """Raise ValueError if channels, table or limits of a fit are not compatible.

        Each observable (a measured quantity) may belong to one channel only.
        """
        key_by_observable = {}
        for key, channel in self.channels.items():
            channel.check(key)
            name = channel.observableId or key
            other_key = key_by_observable.setdefault(name, key)
            allowed = f"another one: channels.{other_key} has it"
            require(other_key == key, f"channels.{key}.observableId", name, allowed)
        allowed = "a file beside this one in a format of csv, uff, unv"
        if self.data is None and not self.speeds:
            raise ValueError(f"data is missing: it must be {allowed}")
        if self.data is not None:
            require(Path(self.data).suffix.lower() in _FORMATS, "data", self.data, allowed)
            if not self.channels:
                raise ValueError("channels is missing: it must describe each column by its name")
        for name, limits in (self.fit.free if self.fit else {}).items():
            free_range(name, limits)  # This raises the error of wrong limits.
        return self

    def table_paths(self, path):
        """Return a list with the path of the table, if any; `path` is the path of the YAML file."""
        return [] if self.data is None else [str(Path(path).parent / self.data)]

    def _observables(self):
        """Return the names of the observables of all channels as a set."""
        return {channel.observableId or key for key, channel in self.channels.items()}

    def has_time_histories(self):
        """Return whether the set has time histories that were measured at constant speeds.

        The speed of such a history is stated in its condition and is not a channel of the table.
        """
        names = self._observables()
        has_speed = any(condition.speed for condition in self.conditions.values())
        return has_speed and "speed" not in names and bool(names & _TIME_HISTORIES)

    def has_run_ups(self):
        """Return whether the set has time histories in which the speed is a channel.

        The times are another channel, or belong to the file format.
        """
        names = self._observables()
        suffix = Path(self.data or "").suffix.lower()
        has_times = "time" in names or suffix in _TIMED_FORMATS
        return has_times and "speed" in names and bool(names & _TIME_HISTORIES)

    def unknown_properties(self):
        """Return the names of those properties of the test rig that are not known.

        `known` is a section of the file with facts about the rig. A property, such as the
        stiffness, is known if one of the keys in `_EXPECTED_FACTS` that state it has a value other
        than "unknown".
        """
        facts = dict(self.known).items()
        known_keys = {key for key, value in facts if value not in (None, "unknown")}
        return [name for name, keys in _EXPECTED_FACTS.items() if not known_keys & keys]


def read_sets(paths):
    """Return the measured sets as a dict: name of the set -> (path, `Description`).

    `paths` are paths of the YAML files that describe the sets; the name is that of the file without
    its suffix. Raise ValueError if a description is not valid, if the table beside it is missing,
    or if two files have the same name.
    """
    descriptions = {}
    for i, path in enumerate(paths):
        name, key = Path(path).stem, f"measured[{i}]"
        allowed = "a path whose name has letters, digits, +, _ and - only, at most 60"
        require(re.fullmatch("[A-Za-z0-9+_-]{1,60}", name), key, path, allowed)
        other_path, _ = descriptions.get(name, ("", None))
        require(name not in descriptions, key, path, f"a file with another name than {other_path}")
        require(Path(path).is_file(), key, path, "a path of a YAML file")
        description = read_description(path)
        for table_path in description.table_paths(path):
            if not Path(table_path).is_file():
                raise ValueError(
                    f"{path}: {InputError('data', description.data, 'a file beside it')}"
                )
        descriptions[name] = path, description
    return descriptions


def read_description(path):
    """Return the `Description` of a measured set in a YAML file.

    Raise ValueError, whose message has all problems in the file, one per line.
    """
    content, problems = validation.read_yaml(path)
    if problems:
        raise ValueError("\n".join(problems))
    try:
        return Description.model_validate(content)
    except ValidationError as error:
        problems = error_messages(error, Description, content)
        raise ValueError("\n".join(f"{path}: {text}" for text in problems)) from None
