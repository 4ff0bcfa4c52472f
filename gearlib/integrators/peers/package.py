"""Whether a package that a method needs is there, and what to install."""

from importlib.util import find_spec
from typing import NamedTuple


class MissingPackage(ImportError, ValueError):
    """A method was asked for whose package is not installed."""


class Package(NamedTuple):
    """The package that a method needs."""

    module: str  #: under which name it is imported
    distribution: str  #: under which name it is installed

    def available(self):
        """Return whether the package can be found; it is not imported."""
        return find_spec(self.module) is not None

    def note(self):
        """Return what to install, one clause."""
        return f"pip install {self.distribution}"
