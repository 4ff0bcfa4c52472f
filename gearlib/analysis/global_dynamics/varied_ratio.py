"""One dimensionless ratio of a pair varied, all others held."""

from gearlib import checks
from gearlib.analysis.orbits.followed_parameters import RATIOS, with_parameter
from gearlib.runs.run_arguments import check_tuning

#: What may be varied.
PARAMETERS = tuple(RATIOS)


def models(model, tuning, parameter, values):
    """Return (model, tuning) for each value, shape (n,), of a parameter, one of `PARAMETERS`.

    The given tuning is taken where another parameter is varied; ratios other than the tuning
    are varied of a `GearPair` only. A ValueError names argument, value and allowed range.
    """
    checks.one_of("parameter", parameter, PARAMETERS)
    if parameter == "tuning":
        checks.require(tuning is None, "tuning", tuning, "left out where it is varied")
        return [(model, check_tuning(f"values[{i}]", nu)) for i, nu in enumerate(values.tolist())]
    if tuning is None:
        raise ValueError(f"tuning = None is not allowed: {parameter} is varied at one tuning")
    if model.mesh is not model:
        raise ValueError(
            f"parameter = {parameter!r} is not allowed for this {type(model).__name__}: it must be "
            "'tuning', or the pair a GearPair"
        )
    tuning = check_tuning("tuning", tuning)
    return [with_parameter(model, tuning, parameter, value) for value in values.tolist()]


def name_parameter(dataset, parameter):
    """Give a varied backlash its name: as a course, the word means the line of Eq. (4)."""
    if parameter == "backlash":
        dataset[parameter].attrs["long_name"] = "backlash in static deflections"
    return dataset
