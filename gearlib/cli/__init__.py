"""The command ``gearlib``: what the library does, from the shell.

=================  ===============================================================
module             responsibility
=================  ===============================================================
``commands``       one function per command: its options, one library call, output
``drawn_gears``    two gears by their drawing, and the table of what they come to
``model_options``  from options and a configuration to a model
``fitting``        fits: a measured set, and what it says of the gears
``speed_options``  speeds in rpm where a command counts in tunings
``scatter_command``  how much scatters with tolerances
``workflow_commands``  the workflow, of an installed package too
``output``         what a command prints and writes, and how it ends
``refusals``       wrong input: a sentence, exit code 2
``progress``       a bar or a clock on a terminal, nothing elsewhere
=================  ===============================================================

Exit codes: 0 all is well; 1 the computation could not do what was asked, the message says what to
try; 2 the input is wrong.
"""

from gearlib.cli.commands import main

__all__ = ["main"]
