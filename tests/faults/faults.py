"""The list of faults that the tests have to see: what is planted where, and which tests look.

Faults that `make mutants` can make, an operator, a constant, a branch, are not listed.
"""

from dataclasses import dataclass
from pathlib import Path

import yaml

ROOT = Path(__file__).resolve().parents[2]
FOLDER = Path(__file__).with_name("rooms")


@dataclass(frozen=True)
class Fault:
    """A replacement in one file, and the tests that have to fail on it."""

    room: str
    name: str
    file: str  #: below the root; `old` occurs in it exactly once
    old: str
    new: str
    tests: tuple  #: pytest node ids, as few as see it

    def planted(self, root=ROOT):
        """Return the text of the file with the fault in it.

        Raises
        ------
        ValueError
            If there is no single place for it.
        """
        path = root / self.file
        text = path.read_text(encoding="utf-8") if path.is_file() else ""
        count = text.count(self.old)
        if count != 1 or self.old == self.new:
            raise ValueError(f"{self.name}: its text occurs {count} times in {self.file}")
        return text.replace(self.old, self.new)


def faults():
    """Return all faults, room by room: a file of YAML each."""
    return [
        Fault(path.stem, **row | {"tests": tuple(row["tests"].split())})
        for path in sorted(FOLDER.glob("*.yaml"))
        for row in yaml.safe_load(path.read_text(encoding="utf-8"))
    ]
