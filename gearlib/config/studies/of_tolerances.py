"""The study of tolerances: how sure jumps, contact loss and peaks are."""

from gearlib.config.studies.study import (
    TOLERANCES,
    Drawing,
    Job,
    Study,
    Table,
    about_forces,
    each,
    grid_of,
    listed,
)
from gearlib.config.tolerances_section import Tolerances
from gearlib.models.pair_parameters import RATIOS, PairParameters


def _values(c):
    """Return name -> value of the gears, of what may scatter."""
    found = c.pair_parameters(c.tolerances.damping)
    pair = PairParameters(**found)
    found |= {name: getattr(pair, name) for name in RATIOS}
    if c.tolerances.of_drawing():
        gears = c.gears
        found |= {"centre_distance": gears.centre_distance, "backlash": gears.backlash}
        found["torque"] = gears.driving_torque()
        for part in ("pinion", "wheel"):
            own = getattr(gears, part).model_dump()
            found |= {f"{part}.{name}": value for name, value in own.items()}
    return found


def _refusal(c):
    """Return why the gears cannot scatter as the section says, or ""."""
    if c.tolerances.of_drawing() and c.gears is None:
        name = c.tolerances.parameters[0].parameter
        return (
            f"tolerances.parameters[0].parameter = {name!r} is not allowed: it must be a parameter "
            "of gear_pair where no gears are drawn"
        )
    try:
        c.tolerances.laws(_values(c))
    except ValueError as error:
        return str(error)
    return ""


def question(c):
    """Return what the study asks, arguments of `gearlib.studies.tolerance_study`."""
    section = c.tolerances
    found = {
        "pair": c.pair_parameters(section.damping),
        "tolerances": {} if _refusal(c) else section.laws(_values(c)),
        "seed": section.seed,
    }
    if section.of_drawing() and c.gears:
        found["drawing"] = c.gears.described()
    return found


def _of_designs(c):
    return question(c) | {"quantities": c.tolerances.quantities}


def _runs(c):
    section = c.tolerances
    return {
        **section.model_dump(include={"samples", "directions", "periods", "record_periods"}),
        "tunings": grid_of(section),
        "box": [[-end, end] for end in section.box],
    }


def _shards(c):
    return each("tolerances/{samples}.nc", c.tolerances.shards())


def _indices(c):
    """Return the file of the indices; correlated parameters have none."""
    return None if c.tolerances.correlations else "tolerance_indices.nc"


def _scattering(c):
    return listed(one.parameter for one in c.tolerances.parameters)


def _parts_caption(c):
    return f"""Left: how often each value is met among {c.tolerances.samples} designs, and the
        value of the nominal design. Right: Sobol'
        indices, the share of the variance by a parameter alone (filled) and with others (outline),
        with bootstrapped intervals. What scatters: {_scattering(c)}."""


TOLERANCES_STUDY = Study(
    "tolerances",
    Tolerances,
    TOLERANCES,
    Job(
        "tolerance_shard",
        "gearlib.studies.tolerance_study:compute",
        lambda c: _of_designs(c) | _runs(c) | {"shard": "{samples}"},
        files=("tolerances/{samples}.nc",),
    ),
    Job(
        "gather_tolerances",
        "gearlib.uncertainty.scatter:gather",
        data={"shards": _shards},
        files=("tolerances.nc",),
        kernels=(),
    ),
    Job(
        "tolerance_indices",
        "gearlib.studies.tolerance_study:indices",
        lambda c: _of_designs(c) | {"samples": c.tolerances.index_samples},
        files=("tolerance_indices.nc",),
    ),
    Table(
        "tolerances",
        "gearlib.studies.tolerance_study:rows",
        {"scattered": "tolerances.nc"},
        "Tolerances: table",
        """What of each quantity the tolerances leave open: of the nominal design, mean, standard
        deviation and quantiles of {c.tolerances.samples} designs, and in how many designs it is
        found.""",
        rule="tolerance_table",
    ),
    Drawing(
        "scatter_figure.draw",
        {"scattered": "tolerances.nc", "indices": _indices},
        "tolerance_bands",
        "Bands over speed, and the probability of contact loss",
        lambda c: (
            f"""Above: half of {c.tolerances.samples} designs lies above the line, and all but
        a twentieth at either end within the band; a band for each way in which the speed was
        reached, never a mean of two motions. Below: the share of the designs that lose contact,
        and of those with two motions. What scatters: {_scattering(c)}. {about_forces(c)}"""
        ),
        second=(
            "tolerance_quantities",
            "Jumps and peaks: how they scatter, and by what",
            _parts_caption,
        ),
    ),
    refusal=_refusal,
)
