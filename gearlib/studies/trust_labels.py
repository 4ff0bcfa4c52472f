"""Labels of the motion from rest over the tuning, of one damping."""

from gearlib.analysis import trust
from gearlib.data.variables import describe
from gearlib.models.pair import GearPair


def compute(pair, tunings, settings, damping):
    """Return the labels as in `trust.scan`, with the name of the damping."""
    return describe(
        trust.scan(GearPair(**pair), tunings, **settings).assign_coords(damping=damping)
    )
