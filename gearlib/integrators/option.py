"""An option of a method: its default, its check, its meaning."""

from collections.abc import Callable
from typing import Any, NamedTuple


class Option(NamedTuple):
    """One entry of a method's ``OPTIONS``."""

    default: Any
    check: Callable  #: ``check(name, value)`` returns the value or raises ValueError
    meaning: str
