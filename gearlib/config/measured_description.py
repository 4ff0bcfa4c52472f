"""The YAML file beside a measured table: where it comes from, and what its columns are.

Names are those of PEtab: observableId, simulationConditionId, measurement, time, noiseParameters.
"""

import re
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import (
    BeforeValidator,
    Field,
    PlainValidator,
    ValidationError,
    WithJsonSchema,
    create_model,
    model_validator,
)

from gearlib.checks import refusal
from gearlib.config import names_that_are_no_texts, units, yaml_keys
from gearlib.config.types import (
    Given,
    Load,
    Option,
    Truth,
    entry,
    quantity,
    whole,
)
from gearlib.config.validation import sentences
from gearlib.data import measured_names
from gearlib.models.pair_parameters import PairParameters
from gearlib.parameters import declared

_Range = Annotated[list[Option], Field(min_length=2, max_length=2)]


class FitSection(Given):
    """Model and parameters that `gearlib fit` fits to a measured set."""

    model: Literal["one_degree", "six_degrees", "train"] = entry("Kind of the model.", None)
    free: dict[Annotated[str, Field(pattern="(?s).")], _Range] = entry(
        "Parameter -> its lowest and highest value.", {}
    )


def range_of(name, ends):
    """Return the lowest and highest value of a parameter in SI; texts may have units.

    ValueError for what is no number in a unit of its dimension.
    """
    known = {key: one.unit for key, one in declared(PairParameters).items()}
    unit = known.get(name, "")
    allowed = "two numbers" + (f" in {unit}, or texts with a unit of it" if unit else "")
    if name not in known:
        allowed += f" in SI; texts have {', '.join(key for key in known if known[key])}"
    found = []
    for end in ends:
        try:
            found.append(float(end))
        except ValueError:
            if not unit:
                raise refusal(f"free.{name}", list(ends), allowed) from None
            try:
                found.append(units.read(end, unit))
            except ValueError:
                raise refusal(f"free.{name}", list(ends), allowed) from None
    if len(found) != 2 or any(isinstance(end, bool) for end in ends):
        raise refusal(f"free.{name}", list(ends), allowed)
    return found[0], found[1]


#: Unit of what a converter gives; of dates and times of day.
COUNTS, DATES = "counts", "ISO 8601"
#: What a source should say of the rig. What it does not is listed with the data.
ASKED = (
    "contact_ratio",
    "stiffness",
    "reduced_mass",
    "load",
    "backlash",
    "damping",
    "transmission_error",
    "ramp_rate",
)
#: Keys that say the same of a rig.
_SAME = {
    "stiffness": ("max_stiffness", "mean_stiffness", "stiffness_ratio", "gears"),
    "contact_ratio": ("gears",),
    "load": ("torque",),
    "reduced_mass": ("inertias", "gears"),
    "damping": ("material_damping", "damping_ratio"),
    "ramp_rate": ("acceleration",),
}
#: Formats that know the times.
_TIMED = (".uff", ".unv")
FORMATS = (".csv", *_TIMED)


def _text(most=2000):
    words = f"a text of 1 to {most} characters"
    return Annotated[
        str, Field(min_length=1, max_length=most, json_schema_extra={"$comment": words})
    ]


def _mapping(value):
    if not isinstance(value, dict) or not all(isinstance(key, str) for key in value):
        raise refusal("known", value, "a mapping of names to what is known")
    return value


#: Units of ratios; pint would take angles for some as well.
_RATIOS = {"1": 1.0, "percent": 0.01, "%": 0.01}
#: 1 is read as a number by YAML.
_Unit = Annotated[
    _text(40), BeforeValidator(lambda given: "1" if type(given) is int and given == 1 else given)
]
Facts = Annotated[
    dict[str, Any],
    PlainValidator(_mapping),
    WithJsonSchema({"type": ["object"], "$comment": "a mapping of names to what is known"}),
]
Direction = Literal["up", "down", "rest"]
Speed = quantity("rpm", "1500 rpm", ge=0)
Known = Literal["known", "unknown"]


#: Of a set in the configuration.
MeasuredPath = Annotated[
    str, Field(pattern=r"\.ya?ml$", json_schema_extra={"$comment": "a path of a YAML file"})
]
#: Observables whose time courses at constant speeds are compared.
COURSES = ("displacement", "velocity", "acceleration", "dynamic_force")


class Channel(Given):
    """One column of a table, or one observable of a long one."""

    observableId: _text(80) = entry(
        "What it is by gearlib's names. Of a long table: its key.", None
    )
    unit: _Unit = entry("Of the values in the file: um, N, rpm, deg, counts, ISO 8601 ...", None)
    sensor: _text(200) = entry("What measured it.", None)
    noise: Option = entry("Standard deviation, in the unit of the channel or with its own.", None)
    gain: Known = entry("unknown: the sensor is not calibrated.", None)
    offset: Known = entry("unknown: the zero means nothing.", None)
    counts_per_turn: whole(2, 2**32) = entry("Counts of one turn, of an encoder.", None)
    count: _text(40) = entry("What one count is, of other converters: 0.1 um.", None)
    gaps: Truth = entry("Whether empty cells are points that were not measured.", None)

    def check(self, key):
        """Raise ValueError where keys do not go together."""
        name = self.observableId or key
        found = measured_names.of(name)
        if found is None:
            names = ", ".join(measured_names.KNOWN)
            where = f"channels.{key}.observableId"
            raise refusal(where, name, f"one of {names}, maybe with _ and which one it is")
        if self.unit is None:
            allowed = measured_names.dimensions(found[0])[0][1]
            raise ValueError(f"channels.{key}.unit is missing: it must be one such as {allowed}")
        if self.unit == COUNTS:
            ways = [self.counts_per_turn, self.count, self.gain == "unknown" or None]
            if ways.count(None) == 3 and found[0] != "1":
                raise ValueError(
                    f"channels.{key}.counts_per_turn is missing: of counts it must be said what "
                    "one is, by counts_per_turn or count, or that the gain is unknown"
                )
            if None not in ways[:2]:
                raise ValueError(
                    f"channels.{key}.counts_per_turn and channels.{key}.count are not allowed "
                    "together: it must be one of them"
                )
        for other in ("counts_per_turn", "count"):
            if getattr(self, other) is not None and self.unit != COUNTS:
                raise refusal(
                    f"channels.{key}.{other}", getattr(self, other), "left out: the unit is "
                    f"{self.unit!r}, not 'counts'",
                )  # fmt: skip
        if name not in ("condition", "direction"):
            self.scale(key)
            self.noise_std(key)

    def scale(self, key):
        """Return (factor from the unit of the file, CF units); ValueError for a wrong unit."""
        name = self.observableId or key
        allowed = measured_names.dimensions(measured_names.of(name)[0])
        unit, number, where = self.unit, "1", f"channels.{key}.unit"
        if unit == COUNTS:
            if self.counts_per_turn is not None:
                unit, where = "turn", f"channels.{key}.counts_per_turn"
            elif self.count is not None:
                unit, number, where = self.count, "", f"channels.{key}.count"
            else:
                return 1.0, "count" if allowed[0][0] != "1" else "1"
        if unit == DATES and name == "time":
            return 1.0, "s"
        for cf, written in allowed:
            if cf == "1":
                if unit in _RATIOS:
                    return _RATIOS[unit], cf
                continue
            try:
                return units.read(f"{number} {unit}", written) / (self.counts_per_turn or 1), cf
            except ValueError:
                pass
        words = " or ".join(one for _, one in allowed)
        shown = getattr(self, where.rsplit(".", 1)[1])
        of = "a value in" if where.endswith("count") else "a unit of the dimension of"
        raise refusal(where, shown, f"{of} {words}, for {name}")

    def noise_std(self, key):
        """Return the standard deviation in CF units, 0 where it is not said."""
        factor, cf = self.scale(key)
        if self.noise is None:
            return 0.0
        if isinstance(self.noise, bool):
            found = -1.0
        elif isinstance(self.noise, str):
            written = dict(measured_names.dimensions(cf)).get(cf, cf)
            try:
                found = units.read(self.noise, written)
            except ValueError:
                found = -1.0
        else:
            found = self.noise * abs(factor)
        if found < 0:
            allowed = f"a number >= 0 in {self.unit}, or a text with a unit of its dimension"
            raise refusal(f"channels.{key}.noise", self.noise, allowed)
        return found


class Condition(Given):
    """Speed and load of all measurements with one simulationConditionId."""

    speed: Speed = entry("Of the gear whose revolutions count, rpm.", None)
    direction: Direction = entry("How the speed was reached.", None)
    load: Load = entry("Static mesh force, N.", None)
    torque: quantity("N m", "120 N m", gt=0) = entry("Of the gear whose speed is given, N m.", None)
    acceleration: quantity("rpm/s", "50 rpm/s") = entry("Rate of the ramp, rpm/s.", None)


class MeasuredSpeed(Given):
    """A speed at which the motion changes."""

    value: quantity("rpm", "1500 rpm", gt=0) = entry("The speed, rpm.")
    noise: quantity("rpm", "5 rpm", ge=0) = entry("Standard deviation, rpm.", None)


Speeds = create_model(
    "Speeds",
    __base__=Given,
    __doc__="Measured speeds of jumps and of the onset of contact loss.",
    **{
        name: (MeasuredSpeed, entry(words[0].upper() + words[1:] + ".", None))
        for name, (_, words) in measured_names.SPEEDS.items()
    },
)


_Key = Annotated[str, Field(pattern="(?s).")]


class Description(Given):
    """A measured set: a table and what is said of it."""

    data: _text(400) = entry("The file beside this one: .csv or .uff.", None)
    title: _text(200) = entry("What it is, in a line.", None)
    source: _text() = entry("Who measured it, where it was published.")
    licence: _text(200) = entry("Under which it may be used, such as CC BY 4.0; or 'own data'.")
    synthetic: Truth = entry("Whether it was computed, not measured.", None)
    sha256: Annotated[
        str,
        Field(
            pattern="^[0-9a-f]{64}$",
            json_schema_extra={"$comment": "a checksum of 64 hexadecimal digits"},
        ),
    ] = entry("Checksum of the file.", None)
    separator: Literal[",", ";", "\t", "|"] = entry("Of the cells of a CSV.", ",")
    decimal: Literal[".", ","] = entry("Decimal sign of a CSV.", ".")
    comment: Literal["#", "%", "!"] = entry("Begins a comment in a CSV.", None)
    encoding: Literal["utf-8", "latin-1", "utf-16"] = entry("Of a CSV.", "utf-8")
    skip: whole(0, 10_000) = entry("Lines of a CSV above its names of columns.", 0)
    channels: dict[_Key, Channel] = entry("Column -> what it is.", {})
    conditions: dict[_Key, Condition] = entry("simulationConditionId -> what was the same.", {})
    speeds: Speeds = entry("Measured speeds of jumps and of the onset of contact loss.", None)
    known: Facts = entry("What is known of the rig: contact_ratio, load, backlash ...", {})
    fit: FitSection = entry("What `gearlib fit` looks for.", None)

    @model_validator(mode="after")
    def _check(self):
        for key, channel in self.channels.items():
            channel.check(key)
        taken = {}
        for key, channel in self.channels.items():
            name = channel.observableId or key
            if name in taken:
                raise refusal(
                    f"channels.{key}.observableId",
                    name,
                    f"another one: channels.{taken[name]} has it",
                )
            taken[name] = key
        if self.data is None and not self.speeds:
            raise ValueError(
                f"data is missing: it must be a file beside this one, {', '.join(FORMATS)}"
            )
        if self.data is not None and Path(self.data).suffix.lower() not in FORMATS:
            raise refusal("data", self.data, f"a file {', '.join(FORMATS)}")
        if self.data is not None and not self.channels:
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
        constant = any(one.speed for one in self.conditions.values())
        return constant and "speed" not in self._names() and bool(self._names() & {*COURSES})

    def has_run_ups(self):
        """Return whether there are time courses with a speed of their own."""
        timed = "time" in self._names() or Path(self.data or "").suffix.lower() in _TIMED
        return timed and "speed" in self._names() and bool(self._names() & {*COURSES})

    def not_said(self):
        """Return what the source does not say of the rig."""
        said = {key for key, value in self.known.items() if value not in (None, "unknown")}
        return [one for one in ASKED if not said.intersection((one, *_SAME.get(one, ())))]


def paths(given):
    """Return name -> path of measured sets; ValueError where two have one name."""
    found = {}
    for i, path in enumerate(given):
        name = Path(path).stem
        if not re.fullmatch("[A-Za-z0-9+_-]{1,60}", name):
            words = "a path whose name has letters, digits, +, _ and - only, at most 60"
            raise refusal(f"measured[{i}]", path, words)
        if name in found:
            raise refusal(f"measured[{i}]", path, f"another name than that of {found[name]}")
        found[name] = path
    return found


def sets(given):
    """Return name -> (path, `Description`) of measured sets; ValueError for what is wrong."""
    found = {}
    for i, (name, path) in enumerate(paths(given).items()):
        if not Path(path).is_file():
            raise refusal(f"measured[{i}]", path, "a path of a YAML file")
        said = read(path)
        for table in said.files(path):
            if not Path(table).is_file():
                raise ValueError(f"{path}: {refusal('data', said.data, 'a file beside it')}")
        found[name] = path, said
    return found


def read(path):
    """Return the `Description` in a YAML file; ValueError has a sentence for each problem."""
    said, repeated = yaml_keys.read(path)
    if repeated:
        raise ValueError("\n".join(repeated))
    if not isinstance(said, dict):
        raise ValueError(
            f"{path} is not allowed: it must be a mapping with source, licence, channels"
        )
    if names := list(names_that_are_no_texts(said)):
        raise ValueError("\n".join(f"{path}: {one}" for one in names))
    try:
        return Description.model_validate(said)
    except ValidationError as error:
        words = sentences(error.errors(), Description.model_json_schema())
        raise ValueError("\n".join(f"{path}: {one}" for one in words)) from None
