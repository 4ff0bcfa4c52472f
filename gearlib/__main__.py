"""``python -m gearlib``: the command line."""

from gearlib.cli import main

main(prog_name="gearlib")
