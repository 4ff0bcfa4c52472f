"""``python -m gearlib``, and the command ``gearlib``: the command line."""

from gearlib.cli import main


def start():
    """Run the command of this process."""
    main(prog_name="gearlib")


if __name__ == "__main__":
    start()
