"""``python -m gearlib``, and the command ``gearlib``: the command line."""

import sys

from gearlib.cli import main


def start():
    """Run the command of this process."""
    # xarray loads it wherever it is installed, to no use here: a fifth of a short command's time.
    if "xarray" not in sys.modules:
        sys.modules["dask"] = None
    main(prog_name="gearlib")


if __name__ == "__main__":
    start()
