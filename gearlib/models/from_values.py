"""From the text of a dataset back to its model."""

import json
import math

from gearlib.data.provenance import canonical_json
from gearlib.models import profiles
from gearlib.models.harmonics import Harmonics
from gearlib.models.one_degree import OneDegreePair
from gearlib.models.pair import GearPair
from gearlib.models.six_degrees import SixDegreePair
from gearlib.models.trains.elements import Body, Mesh, Shaft
from gearlib.models.trains.train import GearTrain
from gearlib.parameters import declared

_PROFILES = {
    one.__name__.lower(): one
    for one in (profiles.Rectangular, profiles.Fourier, profiles.Tabulated)
}


def model_of(text):
    """Return the model of which a text is `canonical_json` of ``as_dict``; None where it is none.

    The model is that of the text to the last digit, or None; so it is of a `LoadSharingPair`.
    """
    try:
        values = _plain(json.loads(text))
        model = _made(values) if isinstance(values, dict) else None
    except (TypeError, ValueError, KeyError):
        return None
    return model if model is not None and canonical_json(model.as_dict()) == text else None


def _plain(value):
    """Return values of a text as models take them: tuples, infinity, harmonics."""
    if isinstance(value, dict):
        found = {name: _plain(one) for name, one in value.items()}
        return Harmonics(**found) if found.keys() == {"cosines", "sines"} else found
    if isinstance(value, list):
        return tuple(_plain(one) for one in value)
    return {"inf": math.inf, "-inf": -math.inf}.get(value, value) if value else value


def _made(values):
    if "bodies" in values:
        parts = {"bodies": Body, "meshes": Mesh, "shafts": Shaft}
        made = {name: tuple(part(**one) for one in values[name]) for name, part in parts.items()}
        return GearTrain(**(values | made))
    if "base_radii" in values:
        return SixDegreePair(**(values | {"pair": GearPair(**values["pair"])}))
    names = declared(GearPair).keys()
    own = {name: one for name, one in values.items() if name not in names}
    pair = GearPair(**{name: one for name, one in values.items() if name in names})
    if "profile" in own:
        kind = dict(own["profile"])
        return OneDegreePair(pair=pair, **(own | {"profile": _PROFILES[kind.pop("kind")](**kind)}))
    return None if own else pair
