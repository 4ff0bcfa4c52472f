"""The independent program shares nothing with the library; stored references, some anew."""

import subprocess
import sys

import numpy as np

from tests.independent import differences
from tests.independent.systems import describe
from tests.physics import test_random_meshes
from tests.physics import test_sensitivities as derivatives
from tests.references import FOLDER, number_strings, propagate, reference_key


def test_the_independent_program_shares_nothing_with_the_library():
    """Importing the independent program must not load gearlib, nor may its source mention it."""
    files = list((FOLDER.parent / "independent").glob("*.py"))
    modules = ["tests.references", *(f"tests.independent.{path.stem}" for path in files)]
    assert len(modules) > 4
    # The package `tests` itself imports gearlib to choose the instruction set, and is not counted.
    code = (
        "import sys, tests\nbefore = set(sys.modules)\n"
        f"for name in {modules}:\n    __import__(name)\n"
        "new = set(sys.modules) - before\n"
        "print([name for name in new if name.split('.')[0] in ('gearlib', 'benchmarks')])"
    )
    output = subprocess.check_output([sys.executable, "-c", code], text=True)
    assert output.strip() == "[]"
    sources = [path.read_text("utf-8") for path in [*FOLDER.glob("*.py"), *files]]
    assert not [text for text in sources if "import gearlib" in text or "from gearlib" in text]


def test_stored_references_of_random_meshes_match_50_digits():
    """Stored reference motions must equal motions computed anew in 50 digits."""
    rng, stored = np.random.default_rng(0), test_random_meshes.REFERENCES.entries
    count, compared = 8, 0
    for _ in range(count):
        ratios, tuning, state = test_random_meshes.random_mesh(rng)
        arguments = (*ratios.values(), tuning, test_random_meshes.PERIODS, state)
        key = reference_key(propagate, *arguments)
        if key in stored:
            compared += 1
            assert stored[key] == number_strings(propagate(*arguments)), arguments
    # On another machine the rounding of powers may change some of the random meshes.
    assert compared > count // 2


def test_stored_derivatives_match_the_independent_program():
    (model, tuning, state, periods), names = derivatives.CASES["no backlash"]
    arguments = describe(model), tuning, periods, state
    stored = derivatives.REFERENCES.entries[
        reference_key(differences.of_run, *arguments, list(names))
    ]
    # Derivatives in 34 digits are compared for the first parameter only, to save time.
    assert number_strings(differences.of_run(*arguments, names[:1])) == stored[:1]
