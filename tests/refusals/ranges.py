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
_NAMED = {f"pi / {part}": math.pi / part for part in (2, 3, 4)} | {"2 pi": 2.0 * math.pi}


@dataclass(frozen=True)
class Range:
    """What a row says in words: a number or list of such, bounds, a unit, infinity."""

    words: str

    @cached_property
    def count(self):
        """Entries of a list, None of any number of them; 0 of what is no list."""
        found = _LIST.fullmatch(self.words)
        return 0 if found is None else int(found[1]) if found[1].isdigit() else None

    @cached_property
    def entry(self):
        """The range of the entries of a list."""
        return Range(_LIST.fullmatch(self.words)[2])

    @property
    def numeric(self):
        """Whether it is that of a number."""
        return bool(self.integer or re.search("number|finite|from|>|<", self.words))

    @property
    def integer(self):
        return "integer" in self.words

    @property
    def infinite(self):
        return "inf" in self.words.replace("finite", "")

    @cached_property
    def bounds(self):
        """(bound, whether it is allowed itself, sign of the way out), for those that there are."""
        found = []
        for pattern, way in ((_LOWEST, -1), (_HIGHEST, 1)):
            match = pattern.search(self.words)
            if match:
                bound = _NAMED.get(match[2]) or float(match[2])
                found.append((int(bound) if self.integer else bound, match[1], way))
        return [(b, word in ("from", ">=", "to", "<="), way) for b, word, way in found]

    def outside(self):
        """Return numbers just outside, and those that no range allows."""
        wrong = [math.nan, -math.inf]
        if not self.infinite:
            wrong.append(math.inf)
        if self.integer:
            wrong += [1.5, 20.0]
        for bound, allowed, way in self.bounds:
            wrong.append(_beside(bound, way) if allowed else bound)
        return wrong

    def inside(self):
        """Return numbers just inside, of each bound one, or one where there is none."""
        found = [bound if allowed else _beside(bound, -way) for bound, allowed, way in self.bounds]
        found = [0.999 * one if "pi" in self.words and one > 0.5 else one for one in found]
        return (found or [1.0]) + [math.inf] * self.infinite


def _beside(bound, way):
    """Return the next number that way; beside zero one that has a square."""
    if isinstance(bound, int):
        return bound + way
    return way * 1e-12 if bound == 0.0 else math.nextafter(bound, way * math.inf)


class Ranges:
    """The rows of one part of the table: what a key may be, by the longest end of its path."""

    def __init__(self, *parts):
        self.rows = {
            name: words for part in parts for words, row in TABLE[part].items()
            for name in row.split()
        }  # fmt: skip

    def of(self, path):
        """Return the `Range` of a key, None where no row has it."""
        ends = [f"/{'.'.join(path)}", *(".".join(path[i:]) for i in range(len(path)))]
        return next((Range(self.rows[end]) for end in ends if end in self.rows), None)
