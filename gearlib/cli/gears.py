"""The gears of a command, from its options and a configuration."""

from pathlib import Path
from typing import Any, NamedTuple

import click

from gearlib import config, units
from gearlib.checks import InputError
from gearlib.cli import options
from gearlib.config import gear_names, overlay, validation
from gearlib.config.gear_pair_section import MISSING_BEARINGS
from gearlib.config.targets import NO_TRAIN, NOT_GIVEN, mesh_damping_error
from gearlib.config.train_section import PAIR_TRAINS
from gearlib.models.geometry.iso import METHOD_NAMES
from gearlib.models.pair_parameters import PAPER

DEFAULT_CONFIG = Path("config.yaml")
_BEARINGS = ("bearing_stiffness", "bearing_damping")
#: Sections of the configuration that commands need.
_NEEDED_SECTIONS = (
    *("gears", "gear_pair", "profile", "dampings", "six_degrees", "train", "tolerances"),
)
#: Damping of gears that do not move, and gear pair beside a train that does not use it.
NO_DAMPING = NOT_GIVEN
_UNDAMPED = {"dampings": {NO_DAMPING: {"material_damping": 0.0, "backlash_damping": 0.0}}}
_UNUSED_PAIR = {"gear_pair": PAPER | {"load": 1.0, "backlash": 1.0, "teeth": 1}}


class Gears(NamedTuple):
    """Gears that options and a configuration describe."""

    config_dict: dict  #: the configuration, updated by the options
    configuration: Any  #: the validated configuration of `config_dict`
    damping: str  #: name of the damping
    kind: str  #: kind of the model: teeth, rectangle, six_degrees or train
    geometry: Any  #: the section `gears` if the model is a single pair given by geometry, else None

    @property
    def name(self) -> str:
        """Name of the gears as a string for titles, which says what the model leaves out."""
        if self.kind == "train":
            return gear_names.name_of_train(self.configuration)
        return gear_names.name_of_pair(self.configuration, self.kind == "teeth")

    def model(self, pitch_errors: bool = True):
        """Return the model of the gears, such as a `GearTrain` for the kind "train".

        For the kind "teeth", in which each pair of teeth deforms by itself, `pitch_errors` says
        whether the model includes the pitch errors of the gears.
        """
        from gearlib.models.from_values import model

        if self.kind == "six_degrees" and self.configuration.six_degrees.bearing_stiffness is None:
            raise click.UsageError(f"{MISSING_BEARINGS}; --bearing-stiffness sets all four")
        return model(self.configuration.gears_model(self.damping, self.kind, pitch_errors))

    def rectangle(self) -> "Gears":
        """Return these gears with a rectangular stiffness in place of pairs of teeth."""
        return self._replace(kind="rectangle") if self.kind == "teeth" else self

    def stiffness(self, model: Any) -> str:
        """Return a text on the mesh stiffness of a model of these gears.

        If a geometry determines the stiffness, the text names the method of the computation.
        """
        if self.kind == "teeth":
            return model.stiffness_model + gear_names.unused_options(self.configuration.gears)
        if self.kind == "train" or not self.configuration.gears:
            return model.stiffness_model
        return (
            f"{model.stiffness_model}, {METHOD_NAMES[self.configuration.gears.stiffness or 'iso']}"
        )

    def description(self, model: Any) -> str:
        """Return a text with the name of the gears, the stiffness of `model`, and the backlash.

        The text states the backlash only if none was given, so that the recommended one is used.
        """
        parts = [self.name, self.stiffness(model)]
        if self.geometry and self.geometry.backlash is None:
            mesh = self.geometry.mesh()
            if mesh.has_recommended_backlash:
                parts.append(f"recommended backlash {1e6 * mesh.backlash:.4g} um, as none is given")
        return "; ".join(parts)


def speed_in_rpm(name, value):
    """Return the speed of an option as a number in rpm, or None if the option is not given.

    `name` is the name of the option for the error message; `value` is a number, a string such as
    "1500rpm", or None.
    """
    if not isinstance(value, str):
        return value
    speed = units.rpm(value)
    if speed is None:
        raise InputError(name, value, "a number, or a speed in rpm such as 1500rpm")
    return float(speed)


def pop_gears(values: dict, needs_damping: bool = True, needs_geometry: bool = False) -> Gears:
    """Remove the options that describe gears from the dict `values`, and return the gears.

    Options take precedence over the configuration. With `needs_damping` the gears must have a damping, with
    `needs_geometry` they must be given by geometry. Sections that a command does not need and the
    configuration lacks are `_UNDAMPED` and `_UNUSED_PAIR`.
    """
    damping, kind, profile = (values.pop(name, None) for name in ("damping", "model", "profile"))
    config_dict = _read_configuration(values.pop("config"), damping)
    sections = _pop_sections(values, needs_geometry)
    stage, pair, coefficients = (sections[key] for key in ("gears", "gear_pair", "dampings"))
    # A damping needs two coefficients; --damping-ratio alone means no damping without contact.
    if "damping_ratio" in coefficients and "backlash_damping" not in coefficients:
        coefficients["backlash_damping_ratio"] = 0.0
    bearings = {name: values.pop(name, None) for name in _BEARINGS}
    # An option has one value for all four bearings.
    bearings = {name: [value] * 4 for name, value in bearings.items() if value is not None}
    if bearings and kind != "six_degrees":
        raise click.UsageError("--bearing-stiffness and --bearing-damping need --model six_degrees")
    if kind == "train" and "train" not in config_dict:
        raise click.UsageError(NO_TRAIN)
    # The option --backlash belongs to the geometry if there is one.
    if "backlash" in pair and ("gears" in config_dict or stage):
        stage["backlash"] = pair.pop("backlash")
    if stage and "gears" not in config_dict:
        # Dampings and bearings of the configuration belong to its own gears and are left out.
        config_dict = _select_keys(config_dict, "train", *(["dampings"] if damping else []))
    config_dict = overlay(config_dict, {"gears": stage} if stage else {})
    train = config_dict.get("train")
    needs_pair = not isinstance(train, dict) or train.get("kind", PAIR_TRAINS[0]) in PAIR_TRAINS
    if "gears" in config_dict:
        if "dampings" not in config_dict and not coefficients:
            if needs_damping:
                raise click.UsageError("damping_ratio is missing: give --damping-ratio, >= 0, < 1")
            config_dict |= _UNDAMPED
        if pair:
            # Options of the gear pair replace parameters that follow from the geometry.
            derived = config.load(_UNDAMPED | {"gears": config_dict["gears"]}).gear_pair
            pair = derived.model_dump() | pair
    elif needs_geometry:
        raise click.UsageError("gears is missing: give --teeth, --module ..., or a configuration")
    elif "gear_pair" not in config_dict and not pair and not needs_pair:
        if kind != "train":
            raise click.UsageError("gears is missing: the configuration describes a train only")
        config_dict = _UNDAMPED | _UNUSED_PAIR | config_dict
    # A damping that only options describe is named "options".
    configured = config_dict.get("dampings")
    damping = damping or next(iter(configured if isinstance(configured, dict) else ()), "options")
    dampings = {damping: coefficients} if coefficients or not config_dict else {}
    changes = {"gear_pair": pair, "dampings": dampings, "six_degrees": bearings}
    if profile is not None:
        changes["profile"] = profile
    # Without a configuration empty sections are kept, so that their missing keys are reported.
    changes = {key: section for key, section in changes.items() if section or not config_dict}
    config_dict = overlay(config_dict, changes)
    # Other sections may not be valid for gears that options have changed.
    configuration = config.load(
        _select_keys(config_dict, *_NEEDED_SECTIONS) if stage or changes else config_dict
    )
    if damping not in configuration.dampings:
        raise InputError("damping", damping, f"one of {', '.join(configuration.dampings)}")
    if needs_damping and kind == "train" and mesh_damping_error(configuration):
        raise click.UsageError(mesh_damping_error(configuration))
    kind = kind or ("teeth" if configuration.gears else "rectangle")
    if kind == "teeth" and not configuration.gears:
        raise InputError("--model", kind, "rectangle: the gears are not given by their geometry")
    geometry = configuration.gears if kind in ("teeth", "rectangle") else None
    return Gears(config_dict, configuration, damping=damping, kind=kind, geometry=geometry)


def _read_configuration(path: Path | None, damping: str | None) -> dict:
    """Return the configuration as a dict, read from a YAML file; {} if there is no file.

    `path` is the option --config; with None the file is config.yaml in this folder. `damping` is
    the option --damping, the name of a damping in the configuration, or None. Raise a usage error
    if it is given without a configuration, or if the file has errors.
    """
    if path is None and not DEFAULT_CONFIG.exists():
        if damping:
            raise click.UsageError("--damping needs a configuration: give --config")
        return {}
    config_dict, messages = validation.read_yaml(path or DEFAULT_CONFIG)
    messages = messages or config.unknown_sections(config_dict)
    if messages:
        raise click.UsageError("\n".join(messages))
    return config_dict


def _pop_sections(values: dict, needs_geometry: bool) -> dict:
    """Remove the options that are configuration keys from `values`, and return their sections.

    The result is a nested dict {section: {key: value}} as in a YAML file. With `needs_geometry` the
    command has the options `options.STAGE`, which describe two gears by their geometry; otherwise
    it has `options.PAIR`, which may also describe a pair by stiffness, load and so on. The option
    `teeth` is a number, or a string with the numbers of pinion and wheel.
    """
    sections: dict = {"gears": {}, "gear_pair": {}, "dampings": {}}
    teeth = values.pop("teeth")
    if isinstance(teeth, str):
        if len(teeth.split()) != 2:
            raise InputError("--teeth", teeth, "an integer, or two values, PINION WHEEL")
        for gear, count in zip(("pinion", "wheel"), teeth.split(), strict=True):
            sections["gears"][gear] = {"teeth": options.parse_number(count)}
    elif needs_geometry and teeth is not None:
        raise InputError("--teeth", teeth, "two values, PINION WHEEL")
    elif teeth is not None:
        sections["gear_pair"]["teeth"] = teeth
    key_groups = options.GEOMETRY + (options.MESH if needs_geometry else options.PAIR_KEYS)
    for _section_class, names, section_keys in key_groups:
        for name in names:
            value = values.pop(name)
            # Options that are not given are None, flags that are not given are False.
            if value is None or value is False:
                continue
            # An option of both gears, as --shift 0.1 0.2, has a value for each of their sections.
            section_values = value if len(section_keys) > 1 else [value]
            for section_key, section_value in zip(section_keys, section_values, strict=True):
                section = sections
                # A key such as "gears.pinion" is the path of a nested section.
                for key in section_key.split("."):
                    section = section.setdefault(key, {})
                section[name] = section_value
    return sections


def _select_keys(config_dict: dict, *keys: str) -> dict:
    """Return a dict of the entries of a config_dict that have one of these keys."""
    return {key: config_dict[key] for key in keys if key in config_dict}
