"""Renew the stored reference values: `make references` takes some minutes.

It runs the tests that use them, computes all values with 50 digits, and stores them unless a test
fails. If tests are selected by pytest arguments, other values are kept.
"""

import sys

import pytest

from tests.references import StoredReferences

MODULES = ["tests/physics/test_random_meshes.py", "tests/physics/test_sensitivities.py"]


def main():
    """Run tests, record the reference values that they need, and return the exit code of pytest."""
    StoredReferences.recording = True
    selected_tests = sys.argv[1:]
    exit_code = pytest.main(["-p", "no:xdist", "-q", *(selected_tests or MODULES)])
    if exit_code != 0:
        return exit_code
    for stored in StoredReferences.instances:
        if selected_tests:
            stored.recorded = stored.entries | stored.recorded
        stored.write()
        print(f"{stored.path.name}: {len(stored.recorded)}")
    return exit_code


if __name__ == "__main__":
    sys.exit(main())
