"""Values with units: texts such as ``10 um`` or ``4e5 N/mm``, read as SI numbers.

pint is imported only if a text has another unit than the parameter. Numbers are converted as
decimal fractions, so that ``10 um`` is exactly 1e-5, and results computed with 1e-5 stay valid.
"""

import re
from decimal import Decimal
from functools import cache

_NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d{1,3})?"
#: A number without a unit.
NUMBER = re.compile(r"[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?")
_FACTOR = r"[A-Za-zµμ°]+(?:(?:\^|\*\*)-?\d)?"
#: The unit of a speed, revolutions per minute, in its spellings.
_RPM = (
    r"(?:\s*(?:rpm|(?:(?:U|rev|r)\s*)?/\s*min|min(?:(?:\^|\*\*)?-1|⁻¹))|\s+1\s*/\s*min)(?![A-Za-z])"
)
#: A number and a product or quotient of units, with powers of one digit.
TEXT = re.compile(rf"({_NUMBER})((?:{_RPM}|\s*{_FACTOR})(?:\s*[ */·⋅]\s*{_FACTOR})*)")
#: A speed in rpm. In Hz it would be ambiguous.
RPM = re.compile(rf"({_NUMBER}){_RPM}")


@cache
def _registry():
    """Return the unit registry of the package pint, which computes with Decimal, not float."""
    import pint

    return pint.UnitRegistry(non_int_type=Decimal)


def rpm(value):
    """Return the number in a string such as "1500 rpm" or "1500 1/min", as a Decimal.

    Return None for other strings and for values of other types.
    """
    match = RPM.fullmatch(value.strip()) if isinstance(value, str) else None
    return Decimal(match[1]) if match else None


def read(text, unit):
    """Return the value of a string such as "3 kN", converted to `unit` as a float.

    Raise ValueError if the string has no unit, or a unit of another dimension.
    """
    match = TEXT.fullmatch(text.strip())
    if match is None:
        raise ValueError(f"{text!r} is not a number with a unit")
    # Units are written as pint reads them: "Nm" and "N·m" as "N m", "µm" as "um".
    source_unit = re.sub(f"^{_RPM}", "rpm", re.sub("[µμ]", "u", match[2])).strip()
    source_unit = re.sub(r"\b([umkMG]?N)([mc]?m)\b", r"\1 \2", source_unit)
    source_unit = re.sub(r"\s*(?:[ ·⋅]|(?<!\*)\*(?!\*))\s*", " ", source_unit)
    factor = 1 if source_unit == unit else _conversion_factor(text, source_unit, unit)
    return float(Decimal(match[1]) * factor)


@cache
def _conversion_factor(text, source_unit, unit):
    """Return the factor, computed by pint, that converts values in `source_unit` to `unit`.

    Raise ValueError, which quotes the whole string `text` of the user, if the units have different
    dimensions or different zeros, as degrees Celsius and kelvin have.
    """
    registry = _registry()
    if unit == "m/s^2":  # Accelerations are often measured in g, which pint reads as grams.
        source_unit = re.sub(r"\bg\b", "g_n", source_unit)
    try:
        # pint is given the unit without the number, so that it evaluates no arithmetic of the user.
        quantity = registry.Quantity(Decimal(1), source_unit)
        if registry.Quantity(Decimal(0), source_unit).to_root_units().magnitude:
            raise ValueError("the unit has another zero, as degC has")
        if "rpm" in unit and "radian" not in str(quantity.to_root_units().units):
            # 1/min and Hz count revolutions of a shaft, for which pint needs the unit "turn".
            quantity *= registry.Quantity(Decimal(1), "turn")
        return quantity.to(unit).magnitude
    except Exception as error:  # pint raises its own, tokenize's and Python's errors
        raise ValueError(f"{text!r} is not in a unit of the dimension of {unit}") from error


#: CF units -> the same units as engineers write them.
WRITTEN_UNITS = {"1": "", "min-1": "rpm"}


def cf_units(unit):
    """Convert a unit to the CF convention: "N s^2/m^2" becomes "N s2 m-2", "" becomes "1"."""
    numerator, _, denominator = unit.partition("/")
    factors = [factor.replace("^", "") for factor in numerator.split() if factor != "1"]
    for factor in denominator.split():
        base, _, power = factor.partition("^")
        factors.append(f"{base}-{power or 1}")
    return " ".join(factors) or "1"
