"""The phase planes, run by run: one damping, one tuning."""

from gearlib.data.variables import describe
from gearlib.models.pair import GearPair
from gearlib.runs.simulation import simulate


def compute(pair, tuning, run, damping):
    """Return the recorded run, labelled with the name of its damping."""
    found = simulate(GearPair(**pair), tuning, until_settled=True, **run)
    return describe(found.assign_coords(damping=damping))
