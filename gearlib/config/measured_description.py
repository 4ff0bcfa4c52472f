"""The YAML file beside a measured table: where it comes from, and what its columns are.

Names are those of PEtab: observableId, simulationConditionId, measurement, time, noiseParameters.
"""

import re
from contextlib import suppress
from pathlib import Path
from typing import Annotated, Literal

from pydantic import (
    BeforeValidator,
    Field,
    TypeAdapter,
    ValidationError,
    create_model,
    model_validator,
)

from gearlib.checks import refusal, require
from gearlib.config import types as t
from gearlib.config import units, yaml_keys
from gearlib.config.types import Section, entry, quantity, several
from gearlib.config.validation import sentences
from gearlib.data import measured_names
from gearlib.models.pair_parameters import PairParameters
from gearlib.parameters import FINITE, LOAD, numbers

#: Unit of what a converter gives; of dates and times of day.
COUNTS, DATES = "counts", "ISO 8601"
#: What a source should say of the rig -> keys that say it.
_ASKED = {
    "contact_ratio": {"contact_ratio", "gears"},
    "stiffness": {"stiffness", "max_stiffness", "mean_stiffness", "stiffness_ratio", "gears"},
    "reduced_mass": {"reduced_mass", "inertias", "gears"},
    "load": {"load", "torque"},
    "backlash": {"backlash"},
    "damping": {"damping", "material_damping", "damping_ratio"},
    "transmission_error": {"transmission_error"},
    "ramp_rate": {"ramp_rate", "acceleration"},
}
#: Formats that know the times.
_TIMED = (".uff", ".unv")
_FORMATS = (".csv", *_TIMED)
#: Observables whose time courses at constant speeds are compared.
_COURSES = {"displacement", "velocity", "acceleration", "dynamic_force"}
#: Units of ratios; pint would take angles for some as well.
_RATIOS = {"1": 1.0, "percent": 0.01, "%": 0.01}


def _text(longest):
    comment = f"a text of 1 to {longest} characters"
    return t.text(comment, min_length=1, max_length=longest)


def _read_facts(value):
    if not isinstance(value, dict) or not all(isinstance(key, str) for key in value):
        raise refusal("known", value, "a mapping of names to what is known")
    return value


_Key = Annotated[str, Field(pattern="(?s).")]
#: 1 is read as a number by YAML.
_Unit = Annotated[_text(40), BeforeValidator(lambda unit: "1" if type(unit) is int else unit)]
_Facts = t.anything(_read_facts, ["object"], "a mapping of names to what is known")
_Known = Literal["known", "unknown"]
_Checksum = t.text("a checksum of 64 hexadecimal digits", pattern="^[0-9a-f]{64}$")


class FitSection(Section):
    """Model and parameters that `gearlib fit` fits to a measured set."""

    model: Literal["one_degree", "six_degrees", "train"] = entry("Kind of the model.", None)
    free: dict[_Key, several(t.Option, 2)] = entry("Lowest and highest value by parameter.", {})


def range_of(name, ends):
    """Return the lowest and highest value of a parameter in SI; texts may have units."""
    parameter = numbers(PairParameters).get(name)
    kind = parameter.kind if parameter else FINITE
    try:
        return TypeAdapter(several(t.type_of(kind), 2)).validate_python([*ends])
    except ValidationError:
        unit = " in SI" if kind.unit == "1" else f" in {kind.unit} or a text with a unit of it"
        allowed = f"two values, each {kind.words}{unit}"
        raise refusal(f"free.{name}", list(ends), allowed) from None


class Channel(Section):
    """One column of a table, or one observable of a long one."""

    observableId: _text(80) = entry("Observable. Default: the key of the channel.", None)
    unit: _Unit = entry("Unit of the values: um, N, rpm, deg, counts, ISO 8601 ...", None)
    sensor: _text(200) = entry("Sensor that measured it.", None)
    noise: t.Option = entry("Standard deviation, in the unit of the channel or its own.", None)
    gain: _Known = entry("unknown: the sensor is not calibrated.", None)
    offset: _Known = entry("unknown: the zero means nothing.", None)
    counts_per_turn: t.whole(2, 2**32) = entry("Counts of one turn of an encoder.", None)
    count: _text(40) = entry("Value of one count of another converter: 0.1 um.", None)
    gaps: t.Truth = entry("Whether empty cells are points that were not measured.", None)

    def check(self, key):
        """Raise ValueError where keys do not go together."""
        name, place = self.observableId or key, f"channels.{key}"
        known = measured_names.of(name)
        allowed = f"one of {', '.join(measured_names.KNOWN)}, maybe with _ and which one it is"
        require(known, f"{place}.observableId", name, allowed)
        if self.unit is None:
            written = measured_names.dimensions(known[0])[0][1]
            raise ValueError(f"{place}.unit is missing: it must be one such as {written}")
        counts = self.model_dump(include={"counts_per_turn", "count"})
        if self.unit == COUNTS and not counts and self.gain != "unknown" and known[0] != "1":
            raise ValueError(
                f"{place}.counts_per_turn is missing: of counts it must be said what one is, by "
                "counts_per_turn or count, or that the gain is unknown"
            )
        for other, value in counts.items():
            allowed = f"left out: the unit is {self.unit!r}, not 'counts'"
            require(self.unit == COUNTS, f"{place}.{other}", value, allowed)
            require(len(counts) == 1, f"{place}.{other}", value, f"one of {' and '.join(counts)}")
        if name not in ("condition", "direction"):
            self.noise_std(key)

    def scale(self, key):
        """Return (factor from the unit of the file, CF units); ValueError for a wrong unit."""
        name, field, text = self.observableId or key, "unit", f"1 {self.unit}"
        dimensions = measured_names.dimensions(measured_names.of(name)[0])
        if self.unit == DATES and name == "time":
            return 1.0, "s"
        if self.unit == COUNTS and self.counts_per_turn is not None:
            field, text = "counts_per_turn", "1 turn"
        elif self.unit == COUNTS and self.count is not None:
            field, text = "count", self.count
        elif self.unit == COUNTS:
            return 1.0, "1" if dimensions[0][0] == "1" else "count"
        for cf, written in dimensions:
            if cf == "1" and self.unit in _RATIOS:
                return _RATIOS[self.unit], cf
            with suppress(ValueError):
                if cf != "1":
                    return units.read(text, written) / (self.counts_per_turn or 1), cf
        texts = " or ".join(written for _, written in dimensions)
        allowed = f"a value in, or a unit of the dimension of {texts}, for {name}"
        raise refusal(f"channels.{key}.{field}", getattr(self, field), allowed)

    def noise_std(self, key):
        """Return the standard deviation in CF units, 0 where it is not said."""
        factor, cf = self.scale(key)
        noise = -1.0
        if isinstance(self.noise, str):
            with suppress(ValueError):
                noise = units.read(self.noise, dict(measured_names.dimensions(cf)).get(cf, cf))
        elif not isinstance(self.noise, bool):
            noise = (self.noise or 0.0) * abs(factor)
        allowed = f"a number >= 0 in {self.unit}, or a text with a unit of its dimension"
        require(noise >= 0.0, f"channels.{key}.noise", self.noise, allowed)
        return noise


class Condition(Section):
    """Speed and load of all measurements with one simulationConditionId."""

    speed: quantity("rpm", "1500 rpm", ge=0) = entry("Speed of the gear that counts, rpm.", None)
    direction: Literal["up", "down", "rest"] = entry("How the speed was reached.", None)
    load: t.type_of(LOAD) = entry("Static mesh force, N.", None)
    torque: quantity("N m", "120 N m", gt=0) = entry("Torque of the same gear, N m.", None)
    acceleration: quantity("rpm/s", "50 rpm/s") = entry("Rate of the ramp, rpm/s.", None)


class MeasuredSpeed(Section):
    """A speed at which the motion changes."""

    value: quantity("rpm", "1500 rpm", gt=0) = entry("The speed, rpm.")
    noise: quantity("rpm", "5 rpm", ge=0) = entry("Standard deviation, rpm.", None)


Speeds = create_model(
    "Speeds",
    __base__=Section,
    __doc__="Measured speeds of jumps and of the onset of contact loss.",
    **{
        name: (MeasuredSpeed, entry(f"{words[0].upper()}{words[1:]}.", None))
        for name, (_, words) in measured_names.SPEEDS.items()
    },
)


class Description(Section):
    """A measured set: a table and what is said of it."""

    data: _text(400) = entry("The file beside this one: .csv or .uff.", None)
    title: _text(200) = entry("Title of the set, in a line.", None)
    source: _text(2000) = entry("Who measured it, where it was published.")
    licence: _text(200) = entry("Licence of the data, such as CC BY 4.0; or 'own data'.")
    synthetic: t.Truth = entry("Whether it was computed, not measured.", None)
    sha256: _Checksum = entry("Checksum of the file.", None)
    separator: Literal[",", ";", "\t", "|"] = entry("Separator of the cells of a CSV.", ",")
    decimal: Literal[".", ","] = entry("Decimal sign of a CSV.", ".")
    comment: Literal["#", "%", "!"] = entry("Sign that begins a comment in a CSV.", None)
    encoding: Literal["utf-8", "latin-1", "utf-16"] = entry("Encoding of a CSV.", "utf-8")
    skip: t.whole(0, 10_000) = entry("Lines of a CSV above its names of columns.", 0)
    channels: dict[_Key, Channel] = entry("Meaning of each column, by its name.", {})
    conditions: dict[_Key, Condition] = entry("Conditions by their simulationConditionId.", {})
    speeds: Speeds = entry("Measured speeds of jumps and of the onset of contact loss.", None)
    known: _Facts = entry("What is known of the rig: contact_ratio, load, backlash ...", {})
    fit: FitSection = entry("Model and parameters for `gearlib fit`.", None)

    @model_validator(mode="after")
    def _check(self):
        keys = {}
        for key, channel in self.channels.items():
            channel.check(key)
            name, place = channel.observableId or key, f"channels.{key}.observableId"
            other = keys.setdefault(name, key)
            require(other == key, place, name, f"another one: channels.{other} has it")
        files = "a file beside this one in a format of csv, uff, unv"
        if self.data is None and not self.speeds:
            raise ValueError(f"data is missing: it must be {files}")
        if self.data is not None:
            require(Path(self.data).suffix.lower() in _FORMATS, "data", self.data, files)
            if not self.channels:
                raise ValueError(
                    "channels is missing: it must be a mapping of columns to what they are"
                )
        for name, ends in (self.fit.free if self.fit else {}).items():
            range_of(name, ends)
        return self

    def files(self, path):
        """Return the path of the table beside the file at `path`, in a list; empty without."""
        return [] if self.data is None else [str(Path(path).parent / self.data)]

    def _names(self):
        return {channel.observableId or key for key, channel in self.channels.items()}

    def has_courses(self):
        """Return whether there are time courses at constant speeds."""
        constant = any(condition.speed for condition in self.conditions.values())
        return constant and "speed" not in self._names() and bool(self._names() & _COURSES)

    def has_run_ups(self):
        """Return whether there are time courses with a speed of their own."""
        timed = "time" in self._names() or Path(self.data or "").suffix.lower() in _TIMED
        return timed and "speed" in self._names() and bool(self._names() & _COURSES)

    def not_said(self):
        """Return what the source does not say of the rig."""
        facts = dict(self.known).items()
        said = {key for key, value in facts if value not in (None, "unknown")}
        return [name for name, keys in _ASKED.items() if not said & keys]


def sets(paths):
    """Return name -> (path, `Description`) of measured sets; ValueError for what is wrong."""
    descriptions = {}
    for i, path in enumerate(paths):
        name, key = Path(path).stem, f"measured[{i}]"
        allowed = "a path whose name has letters, digits, +, _ and - only, at most 60"
        require(re.fullmatch("[A-Za-z0-9+_-]{1,60}", name), key, path, allowed)
        allowed = f"another name than that of {descriptions.get(name, ('',))[0]}"
        require(name not in descriptions, key, path, allowed)
        require(Path(path).is_file(), key, path, "a path of a YAML file")
        description = read(path)
        for table in description.files(path):
            if not Path(table).is_file():
                raise ValueError(f"{path}: {refusal('data', description.data, 'a file beside it')}")
        descriptions[name] = path, description
    return descriptions


def read(path):
    """Return the `Description` in a YAML file; ValueError has a sentence for each problem."""
    content, problems = yaml_keys.read(path)
    if not problems and not isinstance(content, dict):
        problems = [f"{path} is not allowed: it must be a mapping with source, licence, channels"]
    if problems:
        raise ValueError("\n".join(problems))
    try:
        return Description.model_validate(content)
    except ValidationError as error:
        problems = sentences(error.errors(), Description.model_json_schema())
        raise ValueError("\n".join(f"{path}: {text}" for text in problems)) from None
