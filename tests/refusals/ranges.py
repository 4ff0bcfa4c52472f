"""The ranges of `ranges.yaml` as numbers: what lies just outside of each, and just inside."""

import math
import re
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import yaml

TABLE = yaml.safe_load(Path(__file__).with_name("ranges.yaml").read_text(encoding="utf-8"))
_LIST = re.compile(r"a list of (\d+|at least one) entr\w+, each (.*)")
_NUMBER = r"(pi / [234]|2 pi|-?\d+\.?\d*)"
_LOWEST = re.compile(rf"(from|>=|>) {_NUMBER}")
_HIGHEST = re.compile(rf"(to less than|to below|to|<=|<) {_NUMBER}")
_MULTIPLES_OF_PI = {f"pi / {part}": math.pi / part for part in (2, 3, 4)} | {"2 pi": 2.0 * math.pi}


@dataclass(frozen=True)
class Range:
    """A range in words: a number or a list of numbers, its bounds, whether it may be infinite."""

    words: str

    @cached_property
    def count(self):
        """The number of entries of a list, None for any number; 0 if the value is no list."""
        match = _LIST.fullmatch(self.words)
        return 0 if match is None else int(match[1]) if match[1].isdigit() else None

    @cached_property
    def entry(self):
        """The range of the entries of a list; of a single value the range itself."""
        return self if self.count == 0 else Range(_LIST.fullmatch(self.words)[2])

    @property
    def numeric(self):
        """Whether the value is a number."""
        return bool(self.integer or re.search("number|finite|from|>|<", self.words))

    @property
    def integer(self):
        """Whether the value is an integer."""
        return "integer" in self.words

    @property
    def infinite(self):
        """Whether infinity is allowed."""
        return "inf" in self.words.replace("finite", "")

    @cached_property
    def bounds(self):
        """List of (bound, whether it is itself allowed, sign of the direction out of the range)."""
        bounds = []
        for pattern, outward in ((_LOWEST, -1), (_HIGHEST, 1)):
            if match := pattern.search(self.words):
                relation, text = match.groups()
                bound = _MULTIPLES_OF_PI.get(text) or float(text)
                allowed = relation in ("from", ">=", "to", "<=")
                bounds.append((int(bound) if self.integer else bound, allowed, outward))
        return bounds

    def outside(self):
        """Return numbers just outside, and those that no range allows."""
        wrong = [math.nan, -math.inf]
        wrong += [] if self.infinite else [math.inf]
        wrong += [1.5, 20.0] if self.integer else []
        for bound, allowed, outward in self.bounds:
            wrong.append(_next_number(bound, outward) if allowed else bound)
        return wrong

    def inside(self):
        """Return the allowed number next to each bound, 1 without bounds, infinity if allowed."""
        values = [
            bound if allowed else _next_number(bound, -outward)
            for bound, allowed, outward in self.bounds
        ]
        # Multiples of pi are rounded in the sentences.
        values = [0.999 * v if "pi" in self.words and v > 0.5 else v for v in values]
        return (values or [1.0]) + [math.inf] * self.infinite


def _next_number(bound, sign):
    """Return the number above (sign 1) or below (-1); beside 0 one whose square is not 0."""
    if isinstance(bound, int):
        return bound + sign
    return sign * 1e-12 if bound == 0.0 else math.nextafter(bound, sign * math.inf)


class Ranges:
    """The rows of some parts of `ranges.yaml`, such as "library" or "units"."""

    def __init__(self, *parts):
        #: End of the path of a parameter -> words of its range.
        self.rows = {
            name: words for part in parts for words, row in TABLE[part].items()
            for name in row.split()
        }  # fmt: skip

    def of(self, path):
        """Return the `Range` in the row of the longest end of a path, None without a row."""
        ends = [f"/{'.'.join(path)}", *(".".join(path[i:]) for i in range(len(path)))]
        return next((Range(self.rows[end]) for end in ends if end in self.rows), None)
