"""By how much flanks lie back from the involute: tip relief, and a table over the path of contact.

A gap is measured along the line of action, in m: by so much later than its involutes a pair of
teeth touches. Positions are those of `gearlib.models.geometry.mesh`.
"""

from dataclasses import dataclass
from typing import Annotated

from gearlib import checks
from gearlib.parameters import RELIEF, RELIEF_LENGTH, OneOf, check, documented

#: Exponent of the relief over its length.
SHAPES = {"linear": 1, "parabolic": 2}


@documented
@dataclass(frozen=True, kw_only=True)
class TipRelief:
    """Tip relief of a gear, as on its drawing; immutable.

    Its length is the difference of the radii of curvature between the tip and its start.

    Raises
    ------
    ValueError
        If a value is impossible; the message names parameter, value and range.
    """

    amount: Annotated[float, RELIEF, "C_a, by how much the tip lies back, normal to the flank"]
    length: Annotated[float, RELIEF_LENGTH, "L_Ca, of the relieved part along the path of contact"]
    shape: Annotated[str, OneOf(tuple(SHAPES)), "Over that length"] = "linear"

    def __post_init__(self):
        check(self, " of a tip relief")

    def gap(self, from_tip):
        """Return the gap at distances from the tip along the path of contact, m."""
        # Here and below: a start of the workflow checks drawings without the numerical stack.
        import numpy as np

        inside = np.maximum(1.0 - np.asarray(from_tip) / self.length, 0.0)
        return self.amount * inside ** SHAPES[self.shape]


@dataclass(frozen=True)
class PathTable:
    """A table over the path of contact, linear between its points and constant beyond.

    Parameters
    ----------
    position : sequence of float
        Radii of curvature of the pinion's flank, m, strictly rising; ``mesh.path`` bounds them.
    value : sequence of float
        What is tabulated: a deviation of the flanks in m, or the stiffness of a pair of teeth in
        N/m; finite.

    Raises
    ------
    ValueError
        Naming the entry that is wrong.
    """

    position: tuple
    value: tuple

    def __post_init__(self):
        for name in ("position", "value"):
            object.__setattr__(self, name, checks.finite(name, getattr(self, name)))
        if len(self.position) != len(self.value) or not self.position:
            raise ValueError(
                f"a table of {len(self.position)} positions and {len(self.value)} values is not "
                "allowed: it must have equally many, at least 1"
            )
        if any(a >= b for a, b in zip(self.position, self.position[1:], strict=False)):
            raise ValueError(f"position = {self.position!r} is not allowed: it must rise strictly")

    def at(self, position):
        """Return the values at positions of the path."""
        import numpy as np

        return np.interp(position, self.position, self.value)
