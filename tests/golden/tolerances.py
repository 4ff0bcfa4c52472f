"""How far each number behind the figures may move, and why: the one table of tolerances."""

from dataclasses import dataclass
from fnmatch import fnmatch


@dataclass(frozen=True)
class Tolerance:
    """Largest relative and absolute difference, with the reason."""

    relative: float
    absolute: float
    reason: str
    #: Share of the numbers that may lie anywhere.
    stray: float = 0.0


ROUNDING = Tolerance(
    1e-9, 1e-9, "motions that settle carry rounding only; exp and sin differ between processors"
)
EXACT = Tolerance(0.0, 0.0, "counts, labels and flags")

#: (pattern of the dataset, patterns of its variables) -> tolerance; the first that fits counts.
#: What fits none: `EXACT` for integers, `ROUNDING` for all else.
#: Found by moving the parameters of the gear pair by one unit in the last place.
TABLE = {
    ("*", "evaluations *_evaluations cost"): Tolerance(
        0.1, 0.0, "steps chosen from errors of the size of rounding: up to 4 % more or fewer"
    ),
    ("branches/conservative.nc", "*"): Tolerance(
        1e-6,
        1e-6,
        "without damping multipliers lie on the unit circle, and where two meet they part with the "
        "square root of rounding; beyond, the branch may go on to another orbit",
        stray=0.15,
    ),
    ("loci.nc", "multiplier_*"): Tolerance(
        1e-6, 1e-6, "where two multipliers meet they part with the square root of rounding"
    ),
    ("models/fig8_*", "value"): Tolerance(
        1e-4,
        1e-9,
        "soft bearings of six degrees let rounding grow for long, and without end in one of the "
        "four models",
        stray=0.25,
    ),
    ("models/fig8_*", "change"): Tolerance(
        1e-4, 1e-9, "change against that model, of two of the four", stray=0.5
    ),
    ("nonlinear_damping/oil_*", "period jump jump_size peak peak_tuning lost_from lost_to"): (
        Tolerance(
            0.05, 0.0, "oil damps in the backlash alone: motions settle slowly or never", stray=0.1
        )
    ),
    ("labels/*", "digits exponent uncertainty"): Tolerance(
        0.1, 2.0, "digits left of chaos, and averages over it; the label itself is exact"
    ),
}


def tolerance(dataset, name, kind):
    """Return the `Tolerance` of one variable.

    Parameters
    ----------
    dataset : str
        Path of the dataset below results/.
    name : str
        Variable.
    kind : str
        Kind of its numbers, as in ``numpy.dtype.kind``.
    """
    for (datasets, names), row in TABLE.items():
        if fnmatch(dataset, datasets) and any(fnmatch(name, each) for each in names.split()):
            return row
    return ROUNDING if kind == "f" else EXACT
