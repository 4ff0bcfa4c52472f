"""Defaults of parameters in the Python reference: each its own.

Where a docstring describes several parameters at once ("periods, max_events"), griffe gives all of
them the default of the first. The signature knows better.
"""

import griffe


class Defaults(griffe.Extension):
    """Take the defaults in the tables of parameters from the signature."""

    def on_function(self, *, func, **_):
        """Correct the parsed docstring of a function."""
        if func.docstring is None:
            return
        for section in func.docstring.parsed:
            if section.kind is griffe.DocstringSectionKind.parameters:
                for parameter in section.value:
                    if parameter.name in func.parameters:
                        parameter.default = func.parameters[parameter.name].default
