"""Check that references come from an independent program, and compute some of them anew."""

import subprocess
import sys

import numpy as np

from tests.independent import differences
from tests.independent.systems import describe
from tests.physics import test_random_meshes, test_sensitivities
from tests.references import FOLDER, number_strings, propagate, reference_key


def test_the_independent_program_shares_nothing_with_the_library():
    """The independent program must neither load nor import gearlib or its benchmarks."""
    program_files = list((FOLDER.parent / "independent").glob("*.py"))
    modules = ["tests.references", *(f"tests.independent.{path.stem}" for path in program_files)]
    assert len(modules) > 4
    # Modules that the package `tests` itself imports to choose the instruction set do not count.
    code = (
        "import sys, tests\nloaded_before = set(sys.modules)\n"
        f"for name in {modules}:\n    __import__(name)\n"
        "newly_loaded = set(sys.modules) - loaded_before\n"
        "print([name for name in newly_loaded if name.split('.')[0] in ('gearlib', 'benchmarks')])"
    )
    output = subprocess.check_output([sys.executable, "-c", code], text=True)
    assert output.strip() == "[]"
    for path in [*FOLDER.glob("*.py"), *program_files]:
        source = path.read_text("utf-8")
        assert "import gearlib" not in source and "from gearlib" not in source, path


def test_stored_references_of_random_meshes_match_50_digits():
    """Stored reference motions must equal motions computed anew in 50 digits."""
    rng, stored_rows = np.random.default_rng(0), test_random_meshes.REFERENCES.entries
    mesh_count, compared_count = 8, 0
    for _ in range(mesh_count):
        ratios, tuning, state = test_random_meshes.random_mesh(rng)
        arguments = (*ratios.values(), tuning, test_random_meshes.PERIODS, state)
        key = reference_key(propagate, *arguments)
        if key in stored_rows:
            compared_count += 1
            assert stored_rows[key] == number_strings(propagate(*arguments)), arguments
    # On another machine, rounding of powers may change some of the random meshes, which then have
    # no stored reference.
    assert compared_count > mesh_count // 2


def test_stored_derivatives_match_the_independent_program():
    """Stored derivatives of a run must equal those computed anew in 34 digits."""
    (model, tuning, state, periods), parameters = test_sensitivities.CASES["no backlash"]
    arguments = describe(model), tuning, periods, state
    key = reference_key(differences.of_run, *arguments, list(parameters))
    stored_rows = test_sensitivities.REFERENCES.entries[key]
    # To save time, only the derivative with respect to the first parameter is computed.
    first_row = differences.of_run(*arguments, parameters[:1])
    assert number_strings(first_row) == stored_rows[:1]
