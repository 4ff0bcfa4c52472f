"""The tool of `make mutants`: what it changes, and that it tells who survives."""

import ast

import pytest

from tests.mutants.__main__ import verdicts
from tests.mutants.mutations import LEFT_OUT, ROOMS, ROOT, files, mutations, room_of, sample
from tests.mutants.reach import Reach

CODE = '''
"""A sum."""


def total(values, start=0):
    return start + sum(v * v for v in values if v > 1)


def told(value):
    return f(value, 2) if value is None or not value else -value
'''


@pytest.fixture
def tree(tmp_path):
    (tmp_path / "gearlib/cli").mkdir(parents=True)
    (tmp_path / "gearlib/cli/sums.py").write_text(CODE)
    (tmp_path / "workflow").mkdir()
    return tmp_path


def test_each_kind_of_mutation_is_made(tree):
    found = {(one.kind, one.mutated) for one in mutations("gearlib/cli/sums.py", tree)}
    total = "return start + sum(v * v for v in values if v > 1)"
    told = "return f(value, 2) if value is None or not value else -value"
    for kind, old, new, line in [
        ("operator", "start +", "start -", total),
        ("operator", "v * v", "v / v", total),
        ("dropped term", "start + sum(v * v for v in values if v > 1)", "(start)", total),
        ("comparison", "v > 1", "v >= 1", total),
        ("comparison", "v > 1", "v < 1", total),
        ("constant", "> 1", "> 2", total),
        ("branch", "if v > 1", "if (not (v > 1))", total),
        ("swapped", "value, 2", "2, value", told),
        ("branch", "or", "and", told),
        ("branch", "not value", " value", told),
        ("comparison", "is None", "is not None", told),
        ("operator", "-value", " value", told),
    ]:
        assert (kind, " ".join(line.replace(old, new).split())) in found, (kind, new)
    assert ("constant", "def total(values, start=1):") in found
    assert not any("sum." in mutated for _, mutated in found)


def test_every_mutation_of_a_sample_parses_and_changes_the_code(tree):
    chosen = sample("cli", 100, 1, tree)
    assert len({one.key for one in chosen}) == len(chosen) > 20
    for one in chosen:
        assert ast.dump(ast.parse(one.planted(tree))) != ast.dump(ast.parse(CODE)), one


def test_a_sample_hangs_on_its_seed_and_not_on_edits_elsewhere(tree):
    before = [one.key for one in sample("cli", 8, 1, tree)]
    assert before != [one.key for one in sample("cli", 8, 2, tree)]
    path = tree / "gearlib/cli/sums.py"
    path.write_text('"""Longer."""\n\n\n' + path.read_text())
    assert before == [one.key for one in sample("cli", 8, 1, tree)]


def test_every_file_of_the_package_has_a_room():
    assert {room_of(file) for file in files()} == set(ROOMS.values())
    paths = (path.relative_to(ROOT).as_posix() for path in ROOT.glob("gearlib/**/*.py"))
    assert [file for file in paths if not (room_of(file) or file.startswith(LEFT_OUT))] == []


def test_rules_are_changed_by_their_tokens(tree):
    (tree / "workflow/a.smk").write_text(
        "rule one:\n    threads: 2\n\nif x == 1 and y:\n    z = 3\n"
    )
    found = {one.mutated for one in mutations("workflow/a.smk", tree)}
    assert found == {
        "threads: 3",
        "if x != 1 and y:",
        "if x == 2 and y:",
        "if x == 1 or y:",
        "z = 4",
    }


def test_tests_that_reach_a_line_come_before_those_that_may():
    one = next(one for one in mutations("workflow/provenance.py") if one.line > 30)
    seconds = {"tests/workflow/a": 9.0, "tests/unit/b": 1.0, "tests/unit/c": 1.0}
    lines = {one.file: {str(one.line): [1]}, "gearlib/pair.py": {"1": [2]}}
    reached = Reach({"compiled": {"tests": [*seconds], "seconds": seconds, "lines": lines}})
    assert list(reached.tests(one)) == ["tests/unit/b", "tests/workflow/a"]


def test_what_runs_at_import_is_reached_by_all_that_reach_the_module():
    seconds = {"tests/unit/a": 1.0, "tests/unit/b": 1.0}
    found = mutations("gearlib/tunings.py")
    constant = next(one for one in found if one.source == "NAME_DECIMALS = 4")
    inside = next(one for one in found if one.where == "grid")
    # The first one has imported it.
    lines = {"gearlib/tunings.py": {str(constant.line): [0], str(inside.line): [1]}}
    reached = Reach({"compiled": {"tests": [*seconds], "seconds": seconds, "lines": lines}})
    assert set(reached.tests(constant)) == set(seconds)
    assert set(reached.tests(inside)) == {"tests/unit/b"}


def test_every_verdict_has_a_reason():
    whys = {"equal", "tolerance", "speed", "message", "looks", "unreachable", "beyond"}
    for key, row in verdicts().items():
        assert row["why"] in whys and len(row["reason"]) > 10, key
