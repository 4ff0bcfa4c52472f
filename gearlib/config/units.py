"""Values with units: texts such as ``10 um`` or ``4e5 N/mm``, read as SI numbers.

Only a text with another unit than those of drawings costs the import of pint. Numbers are converted
as decimal fractions, so that ``10 um`` is the very number 1e-5 and reruns nothing that was computed
with it.
"""

import re
from decimal import Decimal
from functools import cache

_NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d{1,3})?"
_FACTOR = r"[A-Za-zµμ°]+(?:(?:\^|\*\*)-?\d)?"
#: A number and a product or quotient of units, with powers of one digit.
TEXT = re.compile(rf"({_NUMBER})\s*({_FACTOR}(?:\s*[ */·⋅]\s*{_FACTOR})*)")
#: A speed of revolution. No other unit: Hz and 1/min leave open whether they count revolutions.
RPM = re.compile(rf"({_NUMBER})\s*rpm")
#: (unit, unit wanted) -> factor, of what drawings are full of: pint takes half a second to load.
PLAIN = {
    ("mm", "m"): "1e-3",
    ("cm", "m"): "1e-2",
    ("um", "m"): "1e-6",
    ("kN", "N"): "1e3",
    ("kN m", "N m"): "1e3",
    ("kW", "W"): "1e3",
    ("GPa", "Pa"): "1e9",
    ("MPa", "Pa"): "1e6",
    ("deg", "rad"): "0.01745329251994329576923690768",
}


@cache
def _registry():
    import pint

    return pint.UnitRegistry(non_int_type=Decimal)


def rpm(value):
    """Return the number of a text in rpm as a Decimal, None for anything else."""
    match = RPM.fullmatch(value.strip()) if isinstance(value, str) else None
    return Decimal(match[1]) if match else None


def read(text, unit):
    """Return a text such as "3 kN" as a number in a `unit` of its dimension, else ValueError."""
    match = TEXT.fullmatch(text.strip())
    if match is None:
        raise ValueError(f"{text!r} is not a number with a unit")
    # Units as pint and `PLAIN` have them: "Nm" and "N·m" are "N m", "µm" is "um".
    name = re.sub(r"\b([umkMG]?N)([mc]?m)\b", r"\1 \2", re.sub("[µμ]", "u", match[2]))
    name = re.sub(r"\s*(?:[ ·⋅]|(?<!\*)\*(?!\*))\s*", " ", name)
    factor = "1" if name == unit else PLAIN.get((name, unit)) or _factor(text, name, unit)
    return float(Decimal(match[1]) * Decimal(factor))


def _factor(text, name, unit):
    """Return a unit over another one of its dimension, by pint."""
    registry = _registry()
    try:
        # pint sees the unit alone, so that no arithmetic of the user's is evaluated.
        quantity = registry.Quantity(Decimal(1), name)
        if unit == "rpm" and "radian" not in str(quantity.to_root_units().units):
            # 1/min and Hz of a shaft are its turns.
            quantity *= registry.Quantity(Decimal(1), "turn")
        return quantity.to(unit).magnitude
    except Exception as error:  # pint raises its own, tokenize's and Python's errors
        raise ValueError(f"{text!r} is not in a unit of the dimension of {unit}") from error
