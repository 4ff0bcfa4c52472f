"""Quantities with units: strings such as ``10 um`` or ``4e5 N/mm``, converted to SI numbers.

pint is imported only if the unit of a string differs from the unit of the parameter. Numbers are
converted as Decimal, so that ``10 um`` is exactly 1e-5, and results computed with 1e-5 stay valid.
"""

import re
from decimal import Decimal
from functools import cache

_NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d{1,3})?"
#: A number without a unit.
NUMBER_PATTERN = re.compile(r"[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?")
_FACTOR = r"[A-Za-zµμ°]+(?:(?:\^|\*\*)-?\d)?"
#: Spellings of the unit revolutions per minute.
_RPM = (
    r"(?:\s*(?:rpm|(?:(?:U|rev|r)\s*)?/\s*min|min(?:(?:\^|\*\*)?-1|⁻¹))|\s+1\s*/\s*min)(?![A-Za-z])"
)
#: A number with a product or quotient of units, whose exponents have one digit.
QUANTITY_PATTERN = re.compile(rf"({_NUMBER})((?:{_RPM}|\s*{_FACTOR})(?:\s*[ */·⋅]\s*{_FACTOR})*)")
#: A speed in rpm; speeds in Hz are not accepted, because they would be ambiguous.
RPM_PATTERN = re.compile(rf"({_NUMBER}){_RPM}")


@cache
def _unit_registry():
    """Return a unit registry of pint that computes with Decimal instead of float."""
    import pint

    return pint.UnitRegistry(non_int_type=Decimal)


def parse_rpm(value):
    """Return the number in a string such as "1500 rpm" or "1500 1/min" as a Decimal.

    Return None for all other strings and for values of other types.
    """
    match = RPM_PATTERN.fullmatch(value.strip()) if isinstance(value, str) else None
    return Decimal(match[1]) if match else None


def parse_quantity(text, unit):
    """Parse a string such as "3 kN" and return its value in `unit` as a float.

    Raise ValueError if the string has no unit or a unit of another dimension.
    """
    match = QUANTITY_PATTERN.fullmatch(text.strip())
    if match is None:
        raise ValueError(f"{text!r} is not a number with a unit")
    # Rewrite the unit for pint: "Nm" and "N·m" become "N m", "µm" becomes "um".
    source_unit = re.sub(f"^{_RPM}", "rpm", re.sub("[µμ]", "u", match[2])).strip()
    source_unit = re.sub(r"\b([umkMG]?N)([mc]?m)\b", r"\1 \2", source_unit)
    source_unit = re.sub(r"\s*(?:[ ·⋅]|(?<!\*)\*(?!\*))\s*", " ", source_unit)
    factor = 1 if source_unit == unit else _conversion_factor(text, source_unit, unit)
    return float(Decimal(match[1]) * factor)


@cache
def _conversion_factor(text, source_unit, unit):
    """Return the factor that converts values in `source_unit` to `unit`.

    Raise ValueError if the units have different dimensions or different zero points, such as
    degrees Celsius and kelvin. The message quotes `text`, the complete input.
    """
    registry = _unit_registry()
    if unit == "m/s^2":  # Accelerations are often measured in g, which pint reads as grams.
        source_unit = re.sub(r"\bg\b", "g_n", source_unit)
    try:
        # Only the unit is passed to pint, so that it evaluates no arithmetic in the input.
        quantity = registry.Quantity(Decimal(1), source_unit)
        if registry.Quantity(Decimal(0), source_unit).to_root_units().magnitude:
            raise ValueError("the unit has an offset, such as degC")
        if "rpm" in unit and "radian" not in str(quantity.to_root_units().units):
            # 1/min and Hz count shaft revolutions, for which pint needs the unit "turn".
            quantity *= registry.Quantity(Decimal(1), "turn")
        return quantity.to(unit).magnitude
    except Exception as error:  # pint raises errors of its own, of tokenize and of Python.
        raise ValueError(f"{text!r} is not in a unit of the dimension of {unit}") from error


#: Customary spelling of CF units, where it differs.
WRITTEN_UNITS = {"1": "", "min-1": "rpm"}


def cf_units(unit):
    """Convert a unit to the CF convention: "N s^2/m^2" becomes "N s2 m-2", "" becomes "1"."""
    numerator, _, denominator = unit.partition("/")
    factors = [factor.replace("^", "") for factor in numerator.split() if factor != "1"]
    for factor in denominator.split():
        base, _, power = factor.partition("^")
        factors.append(f"{base}-{power or 1}")
    return " ".join(factors) or "1"
