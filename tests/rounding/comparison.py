"""Two computations of one dataset or table: whether what is drawn and printed is the same.

What a dataset itself labels as unsettled, by a variable with such a flag or as motion without a
period, is left out; there is no other list of what may differ.
"""

import csv
import json
import re
from decimal import Decimal, InvalidOperation

import numpy as np
import xarray as xr

#: Largest difference, over the largest number of a variable.
AGREEMENT = 1e-6
#: Numbers without a unit, in static deflections, that differ by less differ by rounding: residuals.
_NOTHING = 1e-9

#: Flags of motions of which one run says nothing to rounding.
_UNSETTLED = {"unsettled", "chaotic", "quasi_periodic", "undecided"}


def labels(dataset):
    """Return name -> where the variable of this name calls a motion unsettled, bool arrays."""
    found = {}
    for name, variable in dataset.variables.items():
        words = str(variable.attrs.get("flag_meanings", "")).split()
        codes = [
            code
            for code, word in zip(variable.attrs.get("flag_values", ()), words, strict=False)
            if word in _UNSETTLED
        ]
        if codes:
            found[name] = dataset[name].isin(codes)
    if "period" in dataset:
        # So all datasets have it; see `gearlib.sweep`.
        found["period"] = dataset.period == 0
    return found


def _counts(variable):
    """Return whether a variable counts what a computation took: steps follow errors of rounding."""
    return "evaluations" in variable.attrs.get("long_name", "")


def differences(name, one, other):
    """Return a sentence for each variable of the dataset `name` that is not the same in both."""
    unsettled, others = labels(one), labels(other)
    alone = [label for label in unsettled if not unsettled[label].dims and label in others]
    if any(bool(unsettled[label]) and bool(others[label]) for label in alone):
        # The dataset is one such motion.
        return []
    if set(one.variables) != set(other.variables) or one.sizes != other.sizes:
        return [f"{name}: sizes {dict(one.sizes)} and {dict(other.sizes)}"]
    sentences = []
    for each in one.variables:
        if _counts(one[each]):
            continue
        loose = np.zeros(one[each].shape, bool)
        for label, there in unsettled.items():
            if label != each and set(there.dims) <= set(one[each].dims):
                loose |= there.broadcast_like(one[each]).transpose(*one[each].dims).values
        least = _NOTHING if one[each].attrs.get("units") == "1" else 0.0
        values = one[each].values, other[each].values
        sentences += _difference(f"{name}: {each}", *values, loose, least)
    return sentences


def _difference(name, one, other, loose, least):
    if one.dtype.kind != "f":
        far = (one != other) & ~loose
        size = ""
    else:
        held = one[np.isfinite(one) & ~loose]
        scale = np.abs(held).max(initial=0.0)
        with np.errstate(invalid="ignore"):
            away = np.abs(one - other)
            far = ~((away <= max(AGREEMENT * scale, least)) | (one == other)) & ~loose
        far &= ~(np.isnan(one) & np.isnan(other))
        size = f", by up to {np.nanmax(away[far] / (scale or 1.0), initial=0.0):.1e} of the largest"
    if not far.any():
        return []
    place = tuple(map(int, np.argwhere(far)[0]))
    return [
        f"{name}: {far.sum()} of {far.size} numbers differ{size}; at {place} "
        f"{one[place]!r} and {other[place]!r}"
    ]


def files_differ(name, one, other):
    """Return the same of two files: netCDF, CSV or JSON."""
    if name.endswith(".nc"):
        with xr.open_dataset(one) as first, xr.open_dataset(other) as second:
            return differences(name, first.load(), second.load())
    if name.endswith(".json"):
        rows = [json.loads(path.read_text(encoding="utf-8")) for path in (one, other)]
        far = [*_claims_apart(*rows)]
        return [f"{name}: {far[0]}, {len(far)} in all"] if far else []
    tables = [list(csv.reader(path.open(encoding="utf-8"))) for path in (one, other)]
    if [len(row) for row in tables[0]] != [len(row) for row in tables[1]]:
        return [f"{name}: other rows"]
    cells = [
        f"{name}: {a!r} and {b!r}"
        for rows in zip(*tables, strict=True)
        for a, b in zip(*rows, strict=True)
        if not same_words(a, b)
    ]
    return cells[:3] + ([f"{name}: {len(cells)} cells in all"] if len(cells) > 3 else [])


def _claims_apart(one, other, where=""):
    """Yield where two certificates do not say the same.

    Enclosures, pairs of decimal texts, have to overlap; other numbers agree as in datasets.
    """
    if isinstance(one, dict) and isinstance(other, dict) and one.keys() == other.keys():
        for key in one:
            yield from _claims_apart(one[key], other[key], f"{where} {key}")
    elif isinstance(one, list) and isinstance(other, list) and len(one) == len(other):
        ends = [*map(_exact, one), *map(_exact, other)]
        if len(one) == 2 and None not in ends:
            if ends[0] > ends[3] or ends[2] > ends[1]:
                yield f"{where} {one} and {other}"
            return
        for i, pair in enumerate(zip(one, other, strict=True)):
            yield from _claims_apart(*pair, f"{where} {i}")
    else:
        a, b = _float(one), _float(other)
        if one != other and (
            a is None or b is None or abs(a - b) > max(AGREEMENT * abs(a), _NOTHING)
        ):
            yield f"{where} {one!r} and {other!r}"


def _exact(text):
    """Return a decimal text as a number; None for anything else."""
    try:
        return Decimal(text) if isinstance(text, str) else None
    except InvalidOperation:
        return None


def _float(value):
    """Return a number, or one that is written in hexadecimal digits; None for anything else."""
    if isinstance(value, str):
        try:
            return float.fromhex(value) if "0x" in value else None
        except ValueError:
            return None
    return float(value) if isinstance(value, (int, float)) else None


_NUMBER = re.compile(r"[-+]?\d+(?:\.\d*)?(?:[eE][-+]?\d+)?")


def same_words(one, other):
    """Return whether two texts are the same up to a unit in the last digit of a number."""
    if _NUMBER.sub("#", one) != _NUMBER.sub("#", other):
        return False
    pairs = zip(_NUMBER.findall(one), _NUMBER.findall(other), strict=True)
    return all(abs(float(a) - float(b)) <= 1.01 * _last_digit(a) for a, b in pairs if a != b)


def _last_digit(text):
    """Return a unit in the last digit; of an integer nothing."""
    digits, _, power = text.lower().partition("e")
    places = len(digits.partition(".")[2])
    return 10.0 ** (int(power or 0) - places) if places else 0.0
