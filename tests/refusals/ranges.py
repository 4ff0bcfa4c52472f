"""The ranges of `ranges.yaml` as numbers: what lies just outside of each, and just inside."""

import math
import re
from pathlib import Path

import yaml

TABLE = yaml.safe_load(Path(__file__).with_name("ranges.yaml").read_text(encoding="utf-8"))
_LIST = re.compile(r"a list of (\d+|at least one) entr\w+, each (.*)")
_NUMBER = r"(-?pi / [234]|2 pi|-?\d+\.?\d*)"
_LOWEST = re.compile(rf"(from|>=|>) {_NUMBER}")
_HIGHEST = re.compile(rf"(to less than|to below|to|<=|<) {_NUMBER}")
_MULTIPLES_OF_PI = {f"pi / {part}": math.pi / part for part in (2, 3, 4)} | {"2 pi": 2.0 * math.pi}
_MULTIPLES_OF_PI |= {f"-{text}": -value for text, value in _MULTIPLES_OF_PI.items()}


class Range:
    """A range in words: a number or a list of numbers, its bounds, whether it may be infinite."""

    def __init__(self, words):
        self.words, match = words, _LIST.fullmatch(words)
        #: The number of entries of a list, None for any number; 0 if the value is no list.
        self.count = 0 if match is None else int(match[1]) if match[1].isdigit() else None
        #: The range of the entries of a list; of a single value the range itself.
        self.entry = Range(match[2]) if match else self
        self.integer = "integer" in words
        #: Whether the value is a number.
        self.numeric = self.integer or re.search("number|finite|from|>|<", words) is not None
        #: Whether infinity is allowed.
        self.infinite = "inf" in words.replace("finite", "")
        #: (bound, whether it is itself allowed, sign of the direction out of the range).
        self.bounds = []
        for pattern, outward in ((_LOWEST, -1), (_HIGHEST, 1)):
            if match := pattern.search(words):
                relation, text = match.groups()
                bound = _MULTIPLES_OF_PI.get(text) or float(text)
                allowed = relation in ("from", ">=", "to", "<=")
                self.bounds.append((int(bound) if self.integer else bound, allowed, outward))

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
        values = [0.999 * v if "pi" in self.words and abs(v) > 0.5 else v for v in values]
        return (values or [1.0]) + [math.inf] * self.infinite


def _next_number(bound, sign):
    """Return the number above (sign 1) or below (-1); beside 0 one whose square is not 0."""
    if isinstance(bound, int):
        return bound + sign
    return sign * 1e-12 if bound == 0.0 else math.nextafter(bound, sign * math.inf)


#: Part of the table -> end of the path of a parameter -> words of its range.
_ROWS = {
    part: {name: words for words, row in rows.items() for name in row.split()}
    for part, rows in TABLE.items()
}


def range_of(part, path):
    """Return the `Range` in the row of the longest end of a path, None without a row."""
    ends = (".".join(path[i:]) for i in range(len(path)))
    return next((Range(_ROWS[part][end]) for end in ends if end in _ROWS[part]), None)
