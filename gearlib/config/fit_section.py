"""The section `fit` of a measured set: free parameters and their ranges."""

from typing import Annotated, Literal

from pydantic import Field

from gearlib.checks import refusal
from gearlib.config import units
from gearlib.config.types import Given, Option, entry
from gearlib.models.pair_parameters import PairParameters
from gearlib.parameters import declared

_Range = Annotated[list[Option], Field(min_length=2, max_length=2)]


class FitSection(Given):
    """Model and parameters that `gearlib fit` fits to a measured set."""

    model: Literal["one_degree", "six_degrees", "train"] = entry("Kind of the model.", None)
    free: dict[Annotated[str, Field(pattern="(?s).")], _Range] = entry(
        "Parameter -> its lowest and highest value.", {}
    )


def range_of(name, ends):
    """Return the lowest and highest value of a parameter in SI; texts may have units.

    ValueError for what is no number in a unit of its dimension.
    """
    known = {key: one.unit for key, one in declared(PairParameters).items()}
    unit = known.get(name, "")
    allowed = "two numbers" + (f" in {unit}, or texts with a unit of it" if unit else "")
    if name not in known:
        allowed += f" in SI; texts have {', '.join(key for key in known if known[key])}"
    found = []
    for end in ends:
        try:
            found.append(float(end))
        except ValueError:
            if not unit:
                raise refusal(f"free.{name}", list(ends), allowed) from None
            try:
                found.append(units.read(end, unit))
            except ValueError:
                raise refusal(f"free.{name}", list(ends), allowed) from None
    if len(found) != 2 or any(isinstance(end, bool) for end in ends):
        raise refusal(f"free.{name}", list(ends), allowed)
    return found[0], found[1]
