"""The command ``gearlib``: exit code 1 if a computation failed, 2 for wrong input."""

from gearlib.cli.commands import main

__all__ = ["main"]
