"""From options and a file to a configuration and a model of the gears."""

import functools
from pathlib import Path

import click
from pydantic import ValidationError

from gearlib import config
from gearlib.cli import drawing_options, output, refusals, speed_options
from gearlib.config import gear_names, laid_over, yaml_keys
from gearlib.config.gear_pair_section import BEARINGS, DAMPINGS, GearPairSection
from gearlib.config.targets import NO_TRAIN, undamped
from gearlib.config.train_section import OF_PAIRS
from gearlib.config.types import like
from gearlib.config.validation import as_typed, sentences
from gearlib.models.pair import GearPair

MODELS = ("one_degree", "six_degrees", "train")
DEFAULT_CONFIG = "config.yaml"
#: Name of the damping that options alone describe.
_ONLY_DAMPING = "damping"


#: Commands that move pairs of teeth with relief or errors; the others take the rectangle.
_OF_ONE_SPEED = ("simulate", "orbit", "trust")
#: For a train that is not made of a gear pair.
_STAND_IN = {
    "gear_pair": gear_names.PAPER | {"load": 1.0, "backlash": 1.0, "teeth": 1},
    "dampings": {_ONLY_DAMPING: {"material_damping": 0.0, "backlash_damping": 0.0}},
}

#: Options of a drawing whose names mean something else here, or the same.
_OTHERWISE = ("teeth", "backlash", "power", "speed")
_BEARINGS = "Of --model six_degrees: of each bearing, along and across the line of action"
_WORDS = "A gear pair with its damping, SI."
_Gears = like("Gears", _WORDS, GearPair, *DAMPINGS, base=GearPairSection, required=DAMPINGS)


def options(command):
    """Give a command the options that describe the gears; it is called with the `model`."""

    @options_and_mapping
    @functools.wraps(command)
    def wrapped(mapping, drawn, **others):
        return command(**others)

    return wrapped


def options_and_mapping(command):
    """Give a command the same options.

    It is called with the `model`, with `mapping`, the configuration that is read or drawn by
    options, and with whether gears are `drawn` of which no option changes more than the damping.
    """

    @_gear_options
    @click.option("--model", type=click.Choice(MODELS), default=MODELS[0], show_default=True)
    @click.option("--bearing-stiffness", help=f"{_BEARINGS}, N/m.")
    @click.option("--bearing-damping", help=f"{_BEARINGS}, N s/m.")
    @functools.wraps(command)
    def wrapped(mapping, gears, damping, pair, changes, model, **others):
        drawing_options.check_damped(mapping)
        given = {key: others.pop(key) for key in ("bearing_stiffness", "bearing_damping")}
        bearings = {key: [drawing_options.number(text)] * 4 for key, text in given.items() if text}
        if bearings and model != "six_degrees":
            option = min(bearings).replace("_", "-")
            raise click.UsageError(f"--{option} is not allowed without --model six_degrees")
        if bearings:
            mapping = laid_over(mapping, {"six_degrees": bearings})
        found = _model(mapping, gears, pair, model, moves=True)
        if "gears" in mapping and found.force_note:
            output.words(found.force_note)
        drawn = "gears" in mapping and model == MODELS[0] and not changes.keys() - {*DAMPINGS}
        return command(model=found, mapping=mapping, drawn=drawn, **others)

    return wrapped


def train_options(command):
    """Give a command the options that describe a gear train; it is called with it as `train`."""

    @functools.partial(_gear_options, train=True)
    @functools.wraps(command)
    def wrapped(mapping, gears, damping, pair, changes, **others):
        return command(train=_model(mapping, gears, pair, "train"), **others)

    return wrapped


def configuration_options(command):
    """Give a command the options that describe the gears.

    It is called with a configuration, not yet read by `gearlib.config.load` but accepted by it, as
    `mapping`, and with the name of the damping as `damping`. What no option changes stays as it
    is, a drawing above all.
    """

    @_gear_options
    @functools.wraps(command)
    def wrapped(mapping, gears, damping, pair, changes, **others):
        if not pair:
            raise click.UsageError(
                "gears is missing: the explorer shows gear pairs, and the file describes a train "
                "only"
            )
        sections = _sections(gears, damping)
        if mapping and not changes:
            sections = {}
        elif mapping.get("gears") is not None:
            if undrawn := changes.keys() - set(DAMPINGS):
                option = min(undrawn).replace("_", "-")
                raise click.UsageError(
                    f"--{option} is not allowed where the configuration draws its gears: it must "
                    "be left out, or the section gears be changed"
                )
            del sections["gear_pair"]
        whole = laid_over(mapping, sections)
        load(whole, "What the options make of the configuration")
        return command(mapping=whole, damping=damping, **others)

    return wrapped


def _drawn(others, changes):
    """Return the section `gears` and the damping ratio of the options; None for what none gives.

    Of gears that options draw, `changes` holds what stands in the drawing, too.
    """
    ratio = others.pop("damping_ratio")
    section = drawing_options.section(others, _OTHERWISE)
    both = isinstance(changes.get("teeth"), str) and changes["teeth"].split()
    if both and len(both) == 2:
        del changes["teeth"]
        for gear, text in zip(("pinion", "wheel"), both, strict=True):
            section[gear]["teeth"] = drawing_options.number(text)
    if not any(section.values()):
        return None, ratio
    if "backlash" in changes:
        section["backlash"] = changes.pop("backlash")
    return section, ratio


def _gear_options(command, train=False):
    """Give a command the options; if it is about a `train`, the configuration must have one.

    It is called with `mapping`, `gears`, `damping`, the name `pair` of the gears ("" where a train
    needs none) and the `changes` that options make.
    """

    @functools.wraps(command)
    def wrapped(config_path, case, damping, **others):
        given = {name: others.pop(name) for name in _Gears.model_fields}
        changes = {
            name: drawing_options.number(text) for name, text in given.items() if text is not None
        }
        drawn = _drawn(others, changes)
        mapping, path = read(config_path, case, damping)
        if (train or others.get("model") == "train") and "train" not in mapping:
            raise click.UsageError(NO_TRAIN)
        mapping, gears, damping, pair = _gears(mapping, path, drawn, damping, changes)
        known = {"mapping": mapping, "gears": gears, "damping": damping, "pair": pair}
        return command(**known, changes=changes, **others)

    decorators = [
        *config_options(),
        *drawing_options.decorators(without=_OTHERWISE),
        *(
            click.option(
                f"--{name.replace('_', '-')}",
                name,
                help=field.description,
                metavar=refusals.EITHER if name == "teeth" else None,
            )
            for name, field in _Gears.model_fields.items()
        ),
    ]
    for decorate in reversed(decorators):
        wrapped = decorate(wrapped)
    return wrapped


def config_options():
    """Return the options that name a configuration, one of its cases and of its dampings."""
    return [
        click.option(
            "--config",
            "config_path",
            type=click.Path(exists=True, dir_okay=False, path_type=Path),
            help=f"Configuration of the workflow; {DEFAULT_CONFIG} here, if there is one.",
        ),
        click.option("--case", help="One of its cases, by name."),
        click.option("--damping", help="One of its dampings, by name; else the first."),
    ]


def _gears(mapping, path, drawn, damping, changes):
    """Return what a file says, the gears with what options change, damping, name of the gears."""
    section, ratio = drawn
    if section is not None:
        whole = drawing_options.laid(mapping, section, damping, ratio)
        # The bearings of other gears would not fit these.
        kept = MODELS if "gears" in mapping else ("train",)
        mapping = {name: mapping[name] for name in kept if name in mapping} | whole
        path = path or "What the options say"
    elif ratio is not None:
        kept = (name for name in ("gears", "gear_pair", *MODELS) if name in mapping)
        mapping = {name: mapping[name] for name in kept}
        mapping |= {"dampings": drawing_options.ratios(ratio)}
    values, drawn, alone = {}, None, _needs_none(mapping) and not changes
    if alone:
        mapping = _STAND_IN | mapping
    if path is not None:
        settings = load(mapping, path)
        damping = choose_damping(settings, damping)
        values, drawn = settings.pair_parameters(damping), settings.gears
        if drawn is not None:
            click.get_current_context().meta[speed_options.DRAWN] = drawn.speed
    try:
        gears = _Gears.model_validate(values | changes)
    except ValidationError as error:
        found = sentences(error.errors(), _Gears.model_json_schema())
        raise click.UsageError("\n".join(as_typed(one, changes) for one in found)) from None
    other = drawn is None or gear_names.PAPER.keys() & changes.keys()
    pair = gear_names.of_numbers(gears) if other else gear_names.of_drawing(drawn)
    return mapping, gears, damping or _ONLY_DAMPING, "" if alone else pair


def _needs_none(mapping):
    """Return whether a configuration has no gear pair, and a train that is not made of one."""
    train = mapping.get("train")
    kind = train.get("kind", OF_PAIRS[0]) if isinstance(train, dict) else OF_PAIRS[0]
    return kind not in OF_PAIRS and not {"gears", "gear_pair"} & mapping.keys()


def _sections(gears, damping):
    """Return the sections of a configuration that describe the gears."""
    pair = gears.model_dump(include=set(GearPairSection.model_fields))
    return {"gear_pair": pair, "dampings": {damping: gears.model_dump(exclude=set(pair))}}


def _model(mapping, gears, name, model, moves=False):
    """Return the model of the gears, of this name, after a line that says whose they are.

    A train, bodies and bearings are those of a configuration; a train that `moves` is damped.
    """
    pair = GearPair(**gears.model_dump())
    if not name and model != "train":
        raise click.UsageError("gears is missing: the file describes a train only (--model train)")
    if model == "one_degree":
        output.name_gears(name)
        return "gears" in mapping and _relieved(mapping, pair) or pair
    # Only here: a pair does not pay for trains.
    from gearlib import SixDegreePair
    from gearlib.models.trains.described_train import described

    sections = _sections(gears, _ONLY_DAMPING)
    if model == "six_degrees" and "gears" in mapping:
        sections = {"gears": mapping["gears"], "dampings": mapping["dampings"]}
    # Both names are those of a section.
    if model in mapping:
        sections[model] = mapping[model]
    settings = load(sections, model)
    if model == "train" and moves and (words := undamped(settings)):
        raise click.UsageError(words)
    if model == "six_degrees" and settings.six_degrees.bearing_stiffness is None:
        raise click.UsageError(f"{BEARINGS}; --bearing-stiffness is that of all four")
    output.name_gears(gear_names.of_train(settings, name) if model == "train" else name)
    if model == "train":
        return described(**settings.train_parameters(_ONLY_DAMPING))
    return SixDegreePair(pair=pair, **settings.six_degree_parameters())


def _relieved(mapping, pair):
    """Return the pairs of teeth of drawn gears with relief or errors, at one speed; else None."""
    drawing = load(mapping, "the configuration").gears
    if not drawing.relief() or click.get_current_context().info_name not in _OF_ONE_SPEED:
        return None
    for name, value in drawing.pair().items():
        if getattr(pair, name) != value:
            raise click.UsageError(
                f"{name} = {getattr(pair, name)!r} is not allowed: it must be {value!r}, that of "
                "the drawing, whose gears have tip relief or errors"
            )
    from gearlib.models.load_sharing_pair import tooth_pairs_of

    model = tooth_pairs_of(
        drawing.mesh(),
        torque=drawing.driving_torque(),
        stiffness=drawing.stiffness or "iso",
        options=drawing.stiffness_options,
    )
    return model.replace(**{name: getattr(pair, name) for name in DAMPINGS})


def choose_damping(settings, name):
    """Return the name of a damping of a configuration: the given one, or the first."""
    if name is None:
        return next(iter(settings.dampings))
    if name not in settings.dampings:
        raise click.UsageError(
            f"damping = {name!r} is not allowed: it must be one of {', '.join(settings.dampings)}"
        )
    return name


def read(path, case, damping):
    """Return a configuration, not yet checked, and its path, by default that of `config.yaml`.

    Without a file both are empty, and no case or damping can be named. Of several cases it is the
    one of the given name.
    """
    if path is None:
        path = Path(DEFAULT_CONFIG)
        if not path.exists():
            for name, value in (("case", case), ("damping", damping)):
                if value is not None:
                    raise click.UsageError(
                        f"{name} = {value!r} needs a configuration: give --config"
                    )
            return {}, None
    try:
        mapping, repeated = yaml_keys.read(path)
    except OSError as error:
        raise click.UsageError(f"{path} cannot be read: {error.strerror}") from None
    if repeated:
        raise click.UsageError("\n".join(repeated))
    if not isinstance(mapping, dict):
        load(mapping, path)
    if unknown := config.unknown_sections(mapping):
        raise click.UsageError("\n".join([f"{path} is refused.", *unknown]))
    if "cases" in mapping:
        mapping = _case(mapping, path, case)
    elif case is not None:
        raise click.UsageError(f"case = {case!r} is not allowed: {path} has no cases")
    return mapping, path


def _case(mapping, path, name):
    try:
        found = config.cases(mapping)
    except config.ConfigError as error:
        raise click.UsageError(f"{path} is refused.\n{error}") from None
    if name is None:
        raise click.UsageError(f"{path} has several cases: give --case, one of {', '.join(found)}")
    if name not in found:
        raise click.UsageError(
            f"case = {name!r} is not allowed: it must be one of {', '.join(found)}"
        )
    return found[name]


def load(mapping, name):
    """Return the checked configuration."""
    try:
        return config.load(mapping)
    except config.ConfigError as error:
        raise click.UsageError(f"{name} is refused.\n{error}") from None
