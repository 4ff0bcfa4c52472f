"""The study of measured curves: laid over the computed ones, and scored."""

from gearlib.config import measured_description
from gearlib.config.studies.study import (
    MEASURED,
    Drawing,
    Job,
    Study,
    Table,
    pairs_of,
    sampled_run,
)


def curves(c):
    """Return the files of all measured sets in the scales of the gears, None without any."""
    return [f"measured/{name}.nc" for name in measured_description.paths(c.measured)] or None


def courses(c):
    """Return the files of those that have time courses at constant speeds."""
    sets = measured_description.sets(c.measured)
    return [f"measured/courses/{name}.nc" for name, (_, s) in sets.items() if s.has_courses()]


def orders(c):
    """Return the files of those that have run-ups."""
    sets = measured_description.sets(c.measured)
    return [f"measured/orders/{name}.nc" for name, (_, s) in sets.items() if s.has_run_ups()]


def _without_sets(c):
    """Return what is wrong where measured curves are asked for and there are none."""
    return "" if c.measured else "measured = [] is not allowed: it must be a list of YAML files"


def _path(c):
    """Return the function of wildcards that gives the path of a set."""
    return lambda wildcards: measured_description.paths(c.measured)[wildcards.measured]


def _files(c):
    """Return name -> function of wildcards that gives the files of a set."""
    sets = measured_description.sets(c.measured)

    def files(wildcards):
        path, said = sets[wildcards.measured]
        return [path, *said.files(path)]

    return {"measured": files}


MEASURED_STUDY = Study(
    "measured",
    None,
    MEASURED,
    Job(
        "measured_curve",
        "gearlib.studies.measured_comparison:curve",
        lambda c: {"path": _path(c)},
        {"resonance": "resonance.nc"},
        files=("measured/{measured}.nc",),
        kernels=(),
        given=_files,
    ),
    Job(
        "measured_course",
        "gearlib.studies.measured_comparison:courses",
        lambda c: {"path": _path(c), "pairs": pairs_of(c), "run": sampled_run(c)},
        files=("measured/courses/{measured}.nc",),
        given=_files,
    ),
    Job(
        "measured_orders",
        "gearlib.studies.measured_comparison:orders",
        lambda c: {"path": _path(c), "pairs": pairs_of(c)},
        files=("measured/orders/{measured}.nc",),
        given=_files,
    ),
    Table(
        "measured",
        "gearlib.studies.measured_scores:rows",
        {
            "curves": curves,
            "courses": lambda c: courses(c) or None,
            "orders": lambda c: orders(c) or None,
            "resonance": "resonance.nc",
        },
        "Measured and computed, in numbers",
        """What was measured beside what is computed, for each set and damping: first what needs no
        calibration of sensors, such as the ratio of both jump speeds or of the peaks, and the
        phases of harmonics; then what needs a speed, then what needs the sensors. *Deviations*: the
        difference in standard deviations, where the noise is known.""",
    ),
    Drawing(
        "measured_courses_figure.draw",
        {"courses": courses},
        "measured_courses",
        "Measured time courses",
        """Measured time courses (dots) over a mesh period, from the peak of the first harmonic,
        beside those of the model on which the motion from rest settles.""",
        lambda c: {"colours": c.figures.colours},
        name="measured_courses",
        wanted=lambda c: bool(courses(c)),
    ),
    Drawing(
        "measured_orders_figure.draw",
        {"orders": orders},
        "measured_orders",
        "Mesh orders of measured run-ups",
        """Mesh order and its multiples of measured run-ups (dots) over the speed, beside those of
        the model from rest on the same course of speed; root mean squares in dB of the largest
        measured, and of the largest computed one.""",
        lambda c: {"colours": c.figures.colours},
        name="measured_orders",
        wanted=lambda c: bool(orders(c)),
    ),
    needs=lambda c: bool(c.measured),
    unasked=False,
    refusal=_without_sets,
)
