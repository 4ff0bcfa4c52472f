"""Stability over the tuning and one other parameter, after Ince and Strutt: growth and tongues."""

import numpy as np

from gearlib.analysis.tongues import meissner
from gearlib.analysis.tongues.search import closing_damping, find, varied
from gearlib.data.result import result
from gearlib.models.pair import GearPair

PLANES = ("stiffness_ratio", "contact_ratio", "damping")
#: Height of the plane of damping, over the damping that closes the last tongue.
_HEADROOM = 1.15


def compute(pair, tunings, settings):
    """Return the chart of a gear pair.

    pair (keyword arguments of `GearPair`; its damping is not used); tunings (shape (t,), of the
    growth; tongues are found between the first and the last); settings (damping_ratios: those of
    the tongues, the first one also that of the growth; least_stiffness_ratio; values: how many of
    the other parameter).

    NaN: closed. In the plane of damping the tongues have the damping of their row, and lie under
    the first damping.
    """
    pair = GearPair(**pair).replace(material_damping=0.0)
    dampings = settings["damping_ratios"]
    start, stop = float(tunings[0]), float(tunings[-1])
    open_tongues = find(pair, start, stop)
    closings = [closing_damping(pair, one) for one in open_tongues]
    values = {
        "stiffness_ratio": (settings["least_stiffness_ratio"], 1.0),
        "contact_ratio": (1.0, 2.0),
        "damping": (0.0, _HEADROOM * max(closings, default=0.0) or 0.1),
    }
    places = {name: np.linspace(*values[name], settings["values"]) for name in PLANES}
    tongues = {
        (plane, damping): [
            find(varied(varied(pair, "damping", damping), plane, value), start, stop)
            for value in places[plane]
        ]
        for plane in PLANES
        for damping in (dampings if plane != "damping" else dampings[:1])
    }
    orders = sorted({one.order for row in tongues.values() for found in row for one in found})
    shape = len(PLANES), len(dampings), settings["values"], len(orders)
    edges = np.full((2, *shape), np.nan)
    for (plane, damping), row in tongues.items():
        for j, found in enumerate(row):
            for one in found:
                place = PLANES.index(plane), dampings.index(damping), j, orders.index(one.order)
                edges[:, *place] = one.start, one.stop
    points = _points(pair, orders, values["stiffness_ratio"][0])
    closing = dict(zip((one.order for one in open_tongues), closings, strict=True))
    data = {
        "value": (("plane", "row"), [places[name] for name in PLANES]),
        "own_value": ("plane", [getattr(pair, name) for name in PLANES[:2]] + [0.0]),
        "growth": (("plane", "row", "tuning"), _growths(pair, places, dampings, tunings)),
        "tuning_from": (("plane", "damping", "row", "order"), edges[0]),
        "tuning_to": (("plane", "damping", "row", "order"), edges[1]),
        "closing_damping": ("order", [closing.get(n, np.nan) for n in orders]),
        "point_plane": ("point", points[0]),
        "point_value": ("point", points[1]),
        "point_tuning": ("point", points[2]),
    }
    coords = {
        "plane": list(PLANES),
        "damping": np.array(dampings, float),
        "tuning": np.asarray(tunings, float),
        "order": np.array(orders, np.int32),
    }
    title = "Tongues of parametric resonance"
    return result(title, pair, data, coords, method="closed form", **settings)


def _growths(pair, places, dampings, tunings):
    """Return the growth over (plane, row, tuning)."""
    given = {name: getattr(pair, name) for name in PLANES[:2]} | {"damping": dampings[0]}
    nu = np.asarray(tunings, float)[None, :]
    return [meissner.growth(**given | {name: places[name][:, None]}, tuning=nu) for name in PLANES]


def _points(pair, orders, least):
    """Return (plane, value, tuning) of the tongues of width zero, three lists."""
    points = []
    for order in orders:
        for value, tuning in meissner.coexistence(order, contact_ratio=pair.contact_ratio):
            if value >= least:
                points.append(("stiffness_ratio", value, tuning))
        for value, tuning in meissner.coexistence(order, stiffness_ratio=pair.stiffness_ratio):
            points.append(("contact_ratio", value, tuning))
    planes, values, tunings = zip(*points, strict=True) if points else ((), (), ())
    return np.array(planes, object), np.array(values, float), np.array(tunings, float)
