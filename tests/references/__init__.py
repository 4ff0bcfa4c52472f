"""References in 50 digits that tests take from files: computed once, 20 of the digits kept.

`Stored.propagate` is `tests.physics.high_precision.propagate`, looked up by its arguments. What is
not in the file, as where another machine draws other random numbers, is computed, with a warning.
`make references` renews the files; `test_references.py` computes some entries anew in every test.
"""

import hashlib
import json
import warnings
from pathlib import Path

import mpmath

from tests.physics import high_precision

FOLDER = Path(__file__).parent
_DIGITS = 20


class Stored:
    """The references of one test module, a file of their own."""

    #: All of them, by name.
    known: dict = {}
    #: Whether everything is computed and kept, for `python -m tests.references`.
    recording = False

    def __init__(self, name):
        self.path = FOLDER / f"{name}.json"
        self.entries = json.loads(self.path.read_text("utf-8")) if self.path.exists() else {}
        self.recorded: dict = {}
        Stored.known[name] = self

    def propagate(self, *arguments):
        """Return (x, v, events), see `tests.physics.high_precision.propagate`."""
        key = key_of(arguments)
        if Stored.recording:
            self.recorded[key] = texts(high_precision.propagate(*arguments))
            return numbers(self.recorded[key])
        if key not in self.entries:
            warnings.warn(f"{self.path.name} lacks {arguments}: make references", stacklevel=2)
            return high_precision.propagate(*arguments)
        return numbers(self.entries[key])

    def rows(self, function, *arguments):
        """Return the rows of numbers, tuples, that a function of 50 digits returns."""
        key = key_of((function.__name__, *arguments))
        if Stored.recording:
            self.recorded[key] = row_texts(function(*arguments))
        known = self.recorded if Stored.recording else self.entries
        if key not in known:
            warnings.warn(f"{self.path.name} lacks {arguments}: make references", stacklevel=2)
            return function(*arguments)
        return [tuple(map(mpmath.mpf, row.split())) for row in known[key]]

    def write(self):
        """Write what was recorded, one line for each reference."""
        lines = [f"{json.dumps(key)}: {json.dumps(self.recorded[key])}" for key in self.recorded]
        text = ",\n".join(sorted(lines))
        self.path.write_text(f"{{\n{text}\n}}\n", encoding="utf-8")


def key_of(arguments):
    """Return the key of a reference: a digest of the very floats."""
    return hashlib.sha256(repr(arguments).encode()).hexdigest()[:16]


def texts(motion):
    """Return (x, v, events) as texts."""
    x, v, events = motion
    rows = [f"{_text(at)} {before} {after} {_text(speed)}" for at, before, after, speed in events]
    return [f"{_text(x)} {_text(v)}", *rows]


def row_texts(rows):
    """Return rows of numbers as texts."""
    return [" ".join(map(_text, row)) for row in rows]


def _text(value):
    return mpmath.nstr(value, _DIGITS)


def numbers(rows):
    """Return (x, v, events) of texts."""
    (x, v), *events = (row.split() for row in rows)
    return (
        mpmath.mpf(x),
        mpmath.mpf(v),
        [(mpmath.mpf(a), int(b), int(c), mpmath.mpf(d)) for a, b, c, d in events],
    )
