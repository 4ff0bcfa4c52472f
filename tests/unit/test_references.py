"""The independent program shares nothing with the library; stored references, some anew."""

import subprocess
import sys

import numpy as np
import pytest

from tests.independent import differences
from tests.independent.systems import describe
from tests.physics import test_random_meshes
from tests.physics import test_sensitivities as derivatives
from tests.references import (
    FOLDER,
    Stored,
    key_of,
    numbers,
    propagate,
    row_texts,
    texts,
)

ACCURACY, RANDOM = Stored("accuracy"), test_random_meshes.REFERENCES


def test_the_independent_program_shares_nothing_with_the_library():
    files = list((FOLDER.parent / "independent").glob("*.py"))
    modules = ["tests.references", *(f"tests.independent.{path.stem}" for path in files)]
    assert len(modules) > 4
    # The package of the tests chooses the instruction set before anything else.
    code = (
        "import sys, tests\nbefore = set(sys.modules)\n"
        f"for name in {modules}:\n    __import__(name)\n"
        "new = set(sys.modules) - before\n"
        "print([name for name in new if name.split('.')[0] in ('gearlib', 'benchmarks')])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
    texts_of = [path.read_text("utf-8") for path in [*FOLDER.glob("*.py"), *files]]
    assert not [text for text in texts_of if "import gearlib" in text or "from gearlib" in text]


def test_stored_references_of_random_meshes_are_those_of_50_digits():
    found = 0
    for seed in range(test_random_meshes.SEEDS):
        ratios, tuning, state = test_random_meshes.random_mesh(np.random.default_rng(seed))
        arguments = (*ratios.values(), tuning, test_random_meshes.PERIODS, state)
        stored = RANDOM.entries.get(key_of(arguments))
        if stored is not None:
            found += 1
            assert stored == texts(propagate(*arguments)), arguments
    # Powers may round otherwise on another machine, here and there.
    assert found > test_random_meshes.SEEDS // 2


@pytest.mark.parametrize("name", ["no backlash", "chain"])
def test_stored_derivatives_are_those_of_many_digits(name):
    (model, tuning, state, periods), names = derivatives.CASES[name]
    arguments = describe(model), tuning, periods, state
    stored = derivatives.REFERENCES.entries[key_of(("of_run", *arguments, list(names)))]
    assert row_texts(differences.of_run(*arguments, names[:1])) == stored[:1]


def test_every_case_of_the_random_meshes_is_stored_once():
    assert len(RANDOM.entries) == test_random_meshes.SEEDS * test_random_meshes.CASES_PER_SEED


def test_a_case_that_is_not_stored_is_computed_with_a_warning():
    arguments = (1.5, 0.6, 0.05, 0.05, 3.0, 0.87, 1, (0.1, 0.2))
    with pytest.warns(UserWarning, match="accuracy.json lacks .*: make references"):
        found = ACCURACY.propagate(*arguments)
    expected = propagate(*arguments)
    assert found == expected
    # What is kept is right to 20 digits.
    kept = numbers(texts(expected))
    assert abs(kept[0] - expected[0]) < 1e-19 * abs(expected[0])
