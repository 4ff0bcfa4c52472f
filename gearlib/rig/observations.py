"""What of measured sets a fit can compare: run-ups, time courses, sweeps and speeds of jumps."""

from gearlib import checks
from gearlib.rig import fitted_data
from gearlib.rig.branch_observations import BranchStatistics, channels
from gearlib.rig.orbit_at_speed import STATISTICS
from gearlib.rig.speed_observations import SPEEDS, Speeds
from gearlib.rig.steady_observations import courses_of


def observations_of(model, data):
    """Return what of one measured set, or of several, can be compared."""
    sets = data if isinstance(data, list | tuple) else [data]
    return [one for each in sets for one in _of_set(model, each)]


def _of_set(model, data):
    if not hasattr(data, "data_vars"):
        given = data if isinstance(data, int | float | str) else type(data).__name__
        raise checks.refusal("data", given, "datasets with a displacement over time or jump speeds")
    timed, found, jumps = "time" in data.coords, [], {}
    over = channels(model, data, *[("displacement",)] * timed)
    over = over if timed or "speed" in data.coords else {}
    named = {name: data[name] for name in SPEEDS if name in data}
    fitted_data.check(data, {name: what for name, (what, _) in over.items()}, named)
    if timed:
        for name, (what, mesh) in over.items():
            measured = data[name].notnull().values
            courses = courses_of(model, data.isel(sample=measured).rename({name: what}))
            for one in courses:
                one.mesh = mesh
            found += courses
    elif over:
        found.append(BranchStatistics(data, model))
        jumps = found[-1].jumps
    speeds = jumps | named
    if speeds:
        found.append(Speeds(speeds))
    if not found:
        raise ValueError(
            f"data = {list(data.variables)!r} is not allowed: it must have a displacement over "
            f"time, one of {', '.join(STATISTICS)} over speed, jump_up, jump_down or "
            "onset_of_contact_loss"
        )
    return found
