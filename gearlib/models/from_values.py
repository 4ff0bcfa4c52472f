"""From the text of a dataset back to its model."""

import json
import math

from gearlib.data.files import canonical_json
from gearlib.models import profiles
from gearlib.models.harmonics import Harmonics
from gearlib.models.one_degree import OneDegreePair
from gearlib.models.pair import GearPair
from gearlib.models.six_degrees import SixDegreePair
from gearlib.models.trains.elements import Body, Mesh, Shaft
from gearlib.models.trains.train import GearTrain
from gearlib.parameters import declared

_PROFILES = {
    kind.__name__.lower(): kind
    for kind in (profiles.Rectangular, profiles.Fourier, profiles.Tabulated)
}


def model_of(text):
    """Return the model of which a text is `canonical_json` of ``as_dict``; None where it is none.

    The model is that of the text to the last digit, or None; so it is of a `LoadSharingPair`.
    """
    try:
        values = _plain(json.loads(text))
        model = _model(values) if isinstance(values, dict) else None
    except (TypeError, ValueError, KeyError):
        return None
    return model if model is not None and canonical_json(model.as_dict()) == text else None


def _plain(value):
    """Return values of a text as models take them: tuples, infinity, harmonics."""
    if isinstance(value, dict):
        entries = {name: _plain(entry) for name, entry in value.items()}
        return Harmonics(**entries) if entries.keys() == {"cosines", "sines"} else entries
    if isinstance(value, list):
        return tuple(map(_plain, value))
    return {"inf": math.inf, "-inf": -math.inf}.get(value, value)


def _model(values):
    """Return the model of plain values, None where no model is made of them."""
    if "bodies" in values:
        for name, part in {"bodies": Body, "meshes": Mesh, "shafts": Shaft}.items():
            values[name] = tuple(part(**entry) for entry in values[name])
        return GearTrain(**values)
    if "base_radii" in values:
        return SixDegreePair(**(values | {"pair": GearPair(**values["pair"])}))
    names = declared(GearPair).keys()
    pair = GearPair(**{name: values.pop(name) for name in names if name in values})
    if "profile" in values:
        entries = values.pop("profile")
        profile = _PROFILES[entries.pop("kind")](**entries)
        return OneDegreePair(pair=pair, profile=profile, **values)
    return None if values else pair
