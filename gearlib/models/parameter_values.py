"""The numbers of a model that can be read and changed one by one, by their names."""

import dataclasses
import math
import re

from gearlib import parameters

#: Ratios of a pair -> the field that each sets.
RATIOS = {
    "damping_ratio": "material_damping",
    "backlash_damping_ratio": "backlash_damping",
    "backlash_ratio": "backlash",
}
_RATIO_WORDS = {
    "damping_ratio": "damping ratio beta",
    "backlash_damping_ratio": "damping ratio beta_m of the backlash",
    "backlash_ratio": "backlash in static deflections",
}


def settable(model):
    """Return name -> (CF units, words) of the finite numbers among a model's parameters.

    Names are those of fields of the model and its `GearPair`, entries of fields with several values
    as ``masses[0]``, and of a pair the keys of `RATIOS`.
    """
    described: dict = {}
    for owner in filter(None, (model, model.mesh)):
        declared = parameters.declared(type(owner))
        for name in (field.name for field in dataclasses.fields(owner)):
            value, parameter = getattr(owner, name), declared.get(name)
            units = parameters.cf_units(parameter.unit) if parameter else "1"
            words = re.split(r"[;,=]", parameter.words if parameter else name)[0].strip()
            words = words[:1].lower() + words[1:]
            if type(value) is float and math.isfinite(value):
                described.setdefault(name, (units, words))
            elif isinstance(value, tuple) and all(type(entry) is float for entry in value):
                for i, entry in enumerate(value):
                    if math.isfinite(entry):
                        described[f"{name}[{i}]"] = units, f"{words} [{i}]"
    if model.mesh:
        described |= {name: ("1", words) for name, words in _RATIO_WORDS.items()}
    return described


def value(model, name):
    """Return the value of one of `settable`."""
    field, _, index = name.rstrip("]").partition("[")
    whole = getattr(model, field)
    return whole[int(index)] if index else whole


def with_values(model, changes):
    """Return the model with some of `settable` changed and checked.

    Fields keep the values of all other fields; a ratio is set last, with the fields as they are
    then.
    """
    fields: dict = {}
    for name, new in changes.items():
        field, _, index = name.rstrip("]").partition("[")
        if index:
            entries = list(fields.get(field, getattr(model, field)))
            entries[int(index)] = new
            fields[field] = tuple(entries)
        elif name not in RATIOS:
            fields[name] = new
    model = model.replace(**fields)
    for name in RATIOS:
        if name in changes:
            model = model.replace(**ratio_fields(model.mesh, name, changes[name]))
    return model


def ratio_fields(pair, name, value):
    """Return field -> value by which a `GearPair` has a value of one of `RATIOS`; arrays too."""
    if name == "backlash_ratio":
        return {"backlash": value * pair.static_deflection}
    return {RATIOS[name]: value * (2.0 * pair.reduced_mass * pair.mean_eigenfrequency)}


def natural_scale(model, units):
    """Return the magnitude of a parameter in the model's own scales, for one that is 0."""
    force, length, rate = float(model.load), model.static_deflection, model.mesh_frequency(1.0)
    scales = {"N": force, "m": length, "s": 1.0 / rate, "kg": force / length / rate**2}
    powers = re.findall(r"([A-Za-z]+)(-?\d+)?", units)
    return math.prod(scales.get(unit, 1.0) ** int(power or 1) for unit, power in powers)


def unchecked(kind, **values):
    """Return a frozen dataclass of numbers that its checks do not know."""
    made = object.__new__(kind)
    for field in dataclasses.fields(kind):
        object.__setattr__(made, field.name, values.get(field.name, field.default))
    return made
