"""Combine a configuration with command-line options into the gears of a command."""

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
#: Sections of the configuration that commands use.
_NEEDED_SECTIONS = (
    *("gears", "gear_pair", "profile", "dampings", "six_degrees", "train", "tolerances"),
)
#: Defaults for a damping or a gear pair that a configuration must have but a command does not use.
NO_DAMPING = NOT_GIVEN
_UNDAMPED = {"dampings": {NO_DAMPING: {"material_damping": 0.0, "backlash_damping": 0.0}}}
_UNUSED_PAIR = {"gear_pair": PAPER | {"load": 1.0, "backlash": 1.0, "teeth": 1}}


class Gears(NamedTuple):
    """The gears described by a configuration and command-line options."""

    config_dict: dict  #: the configuration, updated with the options
    configuration: Any  #: `config_dict` as a validated object
    damping: str  #: name of a damping in the configuration
    kind: str  #: kind of model: teeth, rectangle, six_degrees or train
    geometry: Any  #: the section `gears` if a gear pair is given by its geometry, else None

    @property
    def name(self) -> str:
        """Name of the gears for titles, including what the model neglects."""
        if self.kind == "train":
            return gear_names.train_name(self.configuration)
        return gear_names.gear_pair_name(self.configuration, self.kind == "teeth")

    def model(self, pitch_errors: bool = True):
        """Return the model of the gears, such as a `GearTrain` for the kind "train".

        For the kind "teeth", in which each pair of teeth deforms by itself, `pitch_errors` says
        whether the model includes the pitch errors of the gears.
        """
        from gearlib.models.from_values import build_model

        if self.kind == "six_degrees" and self.configuration.six_degrees.bearing_stiffness is None:
            raise click.UsageError(f"{MISSING_BEARINGS}; --bearing-stiffness sets all four")
        return build_model(
            self.configuration.model_description(self.damping, self.kind, pitch_errors)
        )

    def with_rectangular_stiffness(self) -> "Gears":
        """Return these gears with the kind "rectangle" if their kind is "teeth"."""
        return self._replace(kind="rectangle") if self.kind == "teeth" else self

    def stiffness(self, model: Any) -> str:
        """Describe the mesh stiffness of `model`, which is a model of these gears.

        If the stiffness is computed from the geometry, the text includes the method.
        """
        if self.kind == "teeth":
            return model.stiffness_model + gear_names.describe_unused_options(
                self.configuration.gears
            )
        if self.kind == "train" or not self.configuration.gears:
            return model.stiffness_model
        return (
            f"{model.stiffness_model}, {METHOD_NAMES[self.configuration.gears.stiffness or 'iso']}"
        )

    def description(self, model: Any) -> str:
        """Describe the gears and the mesh stiffness of `model`.

        The text includes the backlash if the recommended value is used because none is given.
        """
        parts = [self.name, self.stiffness(model)]
        if self.geometry and self.geometry.backlash is None:
            mesh = self.geometry.gear_stage()
            if mesh.has_recommended_backlash:
                parts.append(f"recommended backlash {1e6 * mesh.backlash:.4g} um (none is given)")
        return "; ".join(parts)


def speed_in_rpm(name, value):
    """Convert the value of a speed option to rpm; None stays None.

    `value` is a number in rpm, a string such as "1500rpm", or None. `name` is the name of the
    option, used in the error message.
    """
    if not isinstance(value, str):
        return value
    speed = units.parse_rpm(value)
    if speed is None:
        raise InputError(name, value, "a number, or a speed in rpm such as 1500rpm")
    return float(speed)


def pop_gears(values: dict, needs_damping: bool = True, needs_geometry: bool = False) -> Gears:
    """Remove the options that describe the gears from `values`, and return the gears.

    Options take precedence over the configuration. If `needs_damping` is true, raise an error if
    the gears have no damping; if `needs_geometry` is true, raise one if they have no geometry.
    """
    damping, kind, profile = (values.pop(name, None) for name in ("damping", "model", "profile"))
    config_dict = _read_configuration(values.pop("config"), damping)
    sections = _pop_sections(values, needs_geometry)
    stage, pair, coefficients = (sections[key] for key in ("gears", "gear_pair", "dampings"))
    # A damping has two coefficients; by default there is no damping without contact.
    if "damping_ratio" in coefficients and "backlash_damping" not in coefficients:
        coefficients["backlash_damping_ratio"] = 0.0
    bearings = {name: values.pop(name, None) for name in _BEARINGS}
    # The option sets the same value for all four bearings.
    bearings = {name: [value] * 4 for name, value in bearings.items() if value is not None}
    if bearings and kind != "six_degrees":
        raise click.UsageError("--bearing-stiffness and --bearing-damping need --model six_degrees")
    if kind == "train" and "train" not in config_dict:
        raise click.UsageError(NO_TRAIN)
    # If the geometry is given, --backlash is the backlash of the geometry.
    if "backlash" in pair and ("gears" in config_dict or stage):
        stage["backlash"] = pair.pop("backlash")
    if stage and "gears" not in config_dict:
        # The options describe other gears, so the configured pair, bearings etc. do not apply.
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
            # Options override the pair parameters that are computed from the geometry.
            derived = config.load(_UNDAMPED | {"gears": config_dict["gears"]}).gear_pair
            pair = derived.model_dump() | pair
    elif needs_geometry:
        raise click.UsageError(
            "the gears are missing: give --teeth, --module, etc., or a configuration"
        )
    elif "gear_pair" not in config_dict and not pair and not needs_pair:
        if kind != "train":
            raise click.UsageError("gears is missing: the configuration describes only a train")
        config_dict = _UNDAMPED | _UNUSED_PAIR | config_dict
    # A damping given by options alone has the name "options".
    configured = config_dict.get("dampings")
    damping = damping or next(iter(configured if isinstance(configured, dict) else ()), "options")
    dampings = {damping: coefficients} if coefficients or not config_dict else {}
    changes = {"gear_pair": pair, "dampings": dampings, "six_degrees": bearings}
    if profile is not None:
        changes["profile"] = profile
    # Without a configuration, keep empty sections so that their missing keys are reported.
    changes = {key: section for key, section in changes.items() if section or not config_dict}
    config_dict = overlay(config_dict, changes)
    # After changes, unused sections are dropped, because they may be invalid for the new gears.
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
    """Read the configuration as a dict from a YAML file; return {} if there is no file.

    `path` is the value of --config; if it is None, config.yaml in the current folder is read.
    `damping` is the value of --damping or None. Raise `click.UsageError` if the file is invalid, or
    if a damping is given without a configuration.
    """
    if path is None and not DEFAULT_CONFIG.exists():
        if damping:
            raise click.UsageError("--damping needs a configuration: give --config")
        return {}
    config_dict, messages = validation.read_yaml(path or DEFAULT_CONFIG)
    messages = messages or config.unknown_section_messages(config_dict)
    if messages:
        raise click.UsageError("\n".join(messages))
    return config_dict


def _pop_sections(values: dict, needs_geometry: bool) -> dict:
    """Remove the options that set configuration keys from `values`, and return their sections.

    The result is a nested dict {section: {key: value}} as in a YAML file. `needs_geometry` says
    whether the command has `options.STAGE_OPTIONS` (geometry only) instead of
    `options.PAIR_OPTIONS` (geometry or stiffness, load etc.). The option `teeth` is a number, or a
    string with the numbers of teeth of pinion and wheel.
    """
    sections: dict = {"gears": {}, "gear_pair": {}, "dampings": {}}
    teeth = values.pop("teeth")
    if isinstance(teeth, str):
        if len(teeth.split()) != 2:
            raise InputError("--teeth", teeth, "an integer, or two values, PINION WHEEL")
        for gear, count in zip(("pinion", "wheel"), teeth.split(), strict=True):
            sections["gears"][gear] = {"teeth": options.number_or_text(count)}
    elif needs_geometry and teeth is not None:
        raise InputError("--teeth", teeth, "two values, PINION WHEEL")
    elif teeth is not None:
        sections["gear_pair"]["teeth"] = teeth
    key_groups = options.GEOMETRY + (options.MESH if needs_geometry else options.PAIR_KEYS)
    for _section_class, names, section_keys in key_groups:
        for name in names:
            value = values.pop(name)
            # Options that are not given are None; flags that are not given are False.
            if value is None or value is False:
                continue
            # An option such as --shift 0.1 0.2 has one value for each gear.
            section_values = value if len(section_keys) > 1 else [value]
            for section_key, section_value in zip(section_keys, section_values, strict=True):
                section = sections
                # A key such as "gears.pinion" is the path to a nested section.
                for key in section_key.split("."):
                    section = section.setdefault(key, {})
                section[name] = section_value
    return sections


def _select_keys(config_dict: dict, *keys: str) -> dict:
    """Return a dict of those entries of `config_dict` whose key is in `keys`."""
    return {key: config_dict[key] for key in keys if key in config_dict}
