"""What the methods with steps share: the models they take, and the law of one."""

from gearlib.models.one_degree import OneDegreePair
from gearlib.models.pair import GearPair

MODELS = "one degree of freedom, any damping, stiffness and excitation"


def takes(pair):
    """Return whether the model has one degree of freedom."""
    return isinstance(pair, (GearPair, OneDegreePair))


def law_of(pair, tuning):
    """Return the `Law` of a model for Taylor series; its tolerance, of Taylor steps, is 0."""
    if isinstance(pair, GearPair):
        pair = OneDegreePair(pair=pair)
    return pair.law(tuning, 0.0)
