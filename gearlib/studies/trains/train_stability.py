"""Stability chart of a planetary train: exact multipliers beside first-order tongues."""

import math

import numpy as np

from gearlib.analysis.tongues import undamped
from gearlib.analysis.tongues.first_order import first_order
from gearlib.data.result import result, stacked
from gearlib.models.trains.ready_made import planetary

PLANES = ("stiffness_jump", "contact_ratio")


def compute(train, tunings, settings):
    """Return where the undamped motion without loss of contact is unstable.

    train (keyword arguments of `gearlib.planetary`; its damping is not used); tunings: shape (t,),
    mesh frequencies over the reference frequency; settings (reference_frequency, Hz; teeth: pairs
    (z_s, z_r), one for each phasing; largest_jump: of the plane of stiffness jumps; jump: that of
    the plane of contact ratios; values: how many of each).
    """
    tunings = np.asarray(tunings, float)
    count = settings["values"]
    # Without a jump, and with a contact ratio of 1 or 2, nothing varies.
    rows = {
        "stiffness_jump": settings["largest_jump"] * np.arange(1, count + 1) / count,
        "contact_ratio": 1.0 + np.arange(1, count + 1) / (count + 1),
    }

    def at(teeth, plane, row):
        value = rows[plane][row]
        jump = value if plane == "stiffness_jump" else settings["jump"]
        ratios = train["contact_ratio"] if plane == "stiffness_jump" else (value, value)
        return with_jump(train | {"teeth": teeth, "contact_ratio": ratios}, jump, settings)

    def chart(*place):
        one = at(*place)
        growth, named = undamped.growth(one, tunings), _named(one, tunings)
        unstable = growth > undamped.NEUTRAL
        return {
            "growth": growth,
            "first_order_unstable": named.astype(np.int8),
            "unstable_share": unstable.mean(),
            "missed_share": _share(unstable & ~named, unstable),
            "false_share": _share(named & ~unstable, named),
        }

    teeth = settings["teeth"]
    data = stacked({"phasing": teeth, "plane": PLANES, "row": range(count)}, chart, "tuning") | {
        "teeth_sun": ("phasing", [sun for sun, _ in teeth]),
        "teeth_ring": ("phasing", [ring for _, ring in teeth]),
        "value": (("plane", "row"), [rows[plane] for plane in PLANES]),
        "reference_frequency": settings["reference_frequency"],
    }
    last, title = at(teeth[-1], PLANES[-1], -1), "Stability chart of a planetary train"
    coords = {"plane": list(PLANES), "tuning": tunings}
    return result(title, last, data, coords, method="exact multipliers", **settings)


def with_jump(train, jump, settings):
    """Return the planetary train whose meshes jump by so many times their mean stiffness."""
    ratios = [undamped.stiffness_ratio(jump, epsilon) for epsilon in train["contact_ratio"]]
    options = train | {"stiffness_ratio": ratios}
    return planetary(**options, reference_frequency=settings["reference_frequency"])


def _named(train, tunings):
    """Return which tunings lie in a first-order tongue, bool, shape (t,)."""
    # Every harmonic that reaches into the range, and tongues with their middle beside it.
    squares, _ = train.linear_modes
    highest = 2.0 * math.sqrt(squares[-1]) / train.reference_angular_frequency
    low, high = 0.5 * tunings[0], 2.0 * tunings[-1]
    inside = np.zeros(tunings.size, bool)
    for one in first_order(train, low, high, math.ceil(highest / low)):
        inside |= np.abs(tunings - one.tuning) < 0.5 * one.width
    return inside


def _share(part, whole):
    """Return the share of points, NaN where there are none."""
    return part.sum() / whole.sum() if whole.any() else math.nan
