"""Write the JSON schema: ``python -m gearlib.config --write-schema``."""

import sys

from gearlib.config import SCHEMA_PATH, schema_text

if __name__ == "__main__":
    if sys.argv[1:] != ["--write-schema"]:
        sys.exit("usage: python -m gearlib.config --write-schema")
    SCHEMA_PATH.write_text(schema_text(), encoding="utf-8")
