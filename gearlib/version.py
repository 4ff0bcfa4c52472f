"""The version of the library, apart from all else: datasets name it."""

__version__ = "0.3.0"
