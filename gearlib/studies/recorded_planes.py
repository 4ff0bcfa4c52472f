"""The phase planes, run by run: one damping, one tuning."""

from gearlib.data.variables import describe
from gearlib.models.described_pair import described
from gearlib.runs.simulation import simulate


def compute(pair, tuning, run, damping):
    """Return the recorded run, labelled with the name of its damping."""
    return describe(simulate(described(pair), tuning, **run).assign_coords(damping=damping))
