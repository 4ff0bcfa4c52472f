"""Docstrings on the page `reference/api.md`, which griffe reads from the imported modules."""

import griffe


class Docstrings(griffe.Extension):
    """Keep the docstrings for users, and take the defaults of parameters from signatures."""

    def on_instance(self, *, node, obj, **_):
        """Remove docstrings of modules, of base classes and of the types of values."""
        is_value = obj.is_attribute and "property" not in obj.labels
        if obj.is_module or is_value or not getattr(node.obj, "__doc__", None):
            obj.docstring = None

    def on_function(self, *, func, **_):
        """Correct defaults: where a docstring names several parameters, griffe takes the first."""
        for section in func.docstring.parsed if func.docstring else []:
            if section.kind is griffe.DocstringSectionKind.parameters:
                for parameter in section.value:
                    if parameter.name in func.parameters:
                        parameter.default = func.parameters[parameter.name].default
