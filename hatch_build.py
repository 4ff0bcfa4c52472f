"""The wheel's build: it holds the JSON schema of the configuration, which is written here."""

import sys
from pathlib import Path

from hatchling.builders.hooks.plugin.interface import BuildHookInterface


class SchemaHook(BuildHookInterface):
    """Puts the schema beside the typed model from which it is made."""

    def initialize(self, version, build_data):
        """Write the schema, unless the package stays where it is and can be asked itself."""
        if version == "editable":
            return
        sys.path.insert(0, self.root)
        from gearlib.config import schema_text

        path = Path(self.root, "build/config.schema.json")
        path.parent.mkdir(exist_ok=True)
        path.write_text(schema_text(), encoding="utf-8")
        build_data["force_include"][str(path)] = "gearlib/config/config.schema.json"
