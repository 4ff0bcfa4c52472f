"""Values with units: texts such as ``10 um`` or ``4e5 N/mm``, read as SI numbers.

Only a text costs the import of pint. Numbers are converted as decimal fractions, so that
``10 um`` is the very number 1e-5 and reruns nothing that was computed with it.
"""

import re
from decimal import Decimal
from functools import cache

_NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d{1,3})?"
_FACTOR = r"[A-Za-zµμ°]+(?:(?:\^|\*\*)-?\d)?"
#: A number and a product or quotient of units, with powers of one digit.
TEXT = re.compile(rf"({_NUMBER})\s*({_FACTOR}(?:\s*[ */·]\s*{_FACTOR})*)")


#: A speed of revolution. No other unit: Hz and 1/min leave open whether they count revolutions.
RPM = re.compile(rf"({_NUMBER})\s*rpm")


@cache
def _registry():
    import pint

    return pint.UnitRegistry(non_int_type=Decimal)


def read(text, unit):
    """Return a text with a unit as a number in `unit`.

    Parameters
    ----------
    text : str
        A number and a unit of the same dimension.
    unit : str
        What the number is wanted in, such as "N s/m".

    Raises
    ------
    ValueError
        If the text is no such thing.
    """
    match = TEXT.fullmatch(text.strip())
    if match is None:
        raise ValueError(f"{text!r} is not a number with a unit")
    registry = _registry()
    number, name = match.groups()
    try:
        # pint sees the unit alone, so that no arithmetic of the user's is evaluated.
        factor = registry.Quantity(Decimal(1), name.replace("·", "*")).to(unit).magnitude
    except Exception as error:  # pint raises its own, tokenize's and Python's errors
        raise ValueError(f"{text!r} is not in a unit of the dimension of {unit}") from error
    return float(Decimal(number) * factor)
