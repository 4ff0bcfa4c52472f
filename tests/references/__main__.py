"""Renew the stored references: `make references`, some minutes.

Runs the tests that use them with everything computed in 50 digits, and writes what they asked for,
unless one of them fails. Of tests that are named, as to pytest, the references are renewed, and
others kept.
"""

import sys

import pytest

from tests.references import StoredReferences

MODULES = ["tests/physics/test_random_meshes.py", "tests/physics/test_sensitivities.py"]


def main():
    """Run tests with recording on, and write the references that they ask for."""
    StoredReferences.recording = True
    chosen = sys.argv[1:]
    code = pytest.main(["-p", "no:xdist", "-q", *(chosen or MODULES)])
    for stored in StoredReferences.known if code == 0 else ():
        if chosen:
            stored.recorded = stored.entries | stored.recorded
        stored.write()
        print(f"{stored.path.name}: {len(stored.recorded)}")
    return code


if __name__ == "__main__":
    sys.exit(main())
