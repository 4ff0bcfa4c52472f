"""The command line: ``python -m gearlib`` and the command ``gearlib``."""

from gearlib.cli import main


def start():
    """Run the command line with the arguments of this process."""
    main(prog_name="gearlib")


if __name__ == "__main__":
    start()
