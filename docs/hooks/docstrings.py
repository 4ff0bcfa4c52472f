"""Docstrings on the page `reference/api.md`, which griffe reads from the imported modules."""

import inspect

import griffe


class Docstrings(griffe.Extension):
    """Take docstrings from objects as users see them, and defaults from signatures."""

    def on_instance(self, *, node, obj, **_):
        """Remove docstrings of modules, base classes and types of values; griffe adds these.

        It also leaves out the parameters that a decorator has written into a docstring.
        """
        text = None
        if not obj.is_module and (not obj.is_attribute or "property" in obj.labels):
            text = getattr(node.parent.obj, node.name).__doc__
        if text and obj.docstring:
            obj.docstring.value = inspect.cleandoc(text)
        else:
            obj.docstring = None

    def on_function(self, *, func, **_):
        """Correct defaults: where a docstring names several parameters, griffe takes the first."""
        for section in func.docstring.parsed if func.docstring else []:
            if section.kind is griffe.DocstringSectionKind.parameters:
                for parameter in section.value:
                    if parameter.name in func.parameters:
                        parameter.default = func.parameters[parameter.name].default
