"""Labels of the motion from rest over the tuning, of one damping."""

from gearlib.analysis import trust
from gearlib.data.variables import describe
from gearlib.models.described_pair import described


def compute(pair, tunings, settings, damping):
    """Return the labels as of `trust.scan`, with the name of the damping."""
    return describe(trust.scan(described(pair), tunings, **settings).assign_coords(damping=damping))
