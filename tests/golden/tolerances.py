"""How far each number behind the figures may move, and why: the one table of tolerances."""

from dataclasses import dataclass
from fnmatch import fnmatch


@dataclass(frozen=True)
class Tolerance:
    """Largest relative and absolute difference, with the reason."""

    relative: float
    absolute: float
    reason: str


ROUNDING = Tolerance(
    1e-9, 1e-9, "motions that settle carry rounding only; exp and sin differ between processors"
)
EXACT = Tolerance(0.0, 0.0, "counts, labels and flags")

#: (pattern of the dataset, patterns of its variables) -> tolerance; the first that fits counts.
#: What fits none: `EXACT` for integers, `ROUNDING` for all else.
TABLE = {}


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
