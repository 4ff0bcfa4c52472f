"""What the sources may not do, ask a model for its class or choose its kernels; their page."""

import ast
import re
from pathlib import Path

import pytest

import gearlib
import gearlib.geometry
from gearlib.models.model import Model

PACKAGE = Path(gearlib.__file__).parent
SOURCES = [
    path
    for path in PACKAGE.rglob("*.py")
    if path.parts[len(PACKAGE.parts)] not in ("models", "engines")
]
#: Kernels that take a state through mesh periods.
GOING = {
    "gearlib.engines.pair.pair_run": {"run"},
    "gearlib.engines.pair.many_runs": {"run_many", "skip_many", "section"},
    "gearlib.engines.pair.maps": {"fill_period_maps"},
    "gearlib.engines.linear.train_run": {"run_train"},
    "gearlib.engines.taylor.taylor_run": {"run_nonlinear"},
}
#: Functions that still take more than eight parameters: none may join them.
TOO_MANY = {
    "propagator.py: run_system",
}


def models():
    """Return the classes of the public models and all their bases."""
    public = [getattr(gearlib, name) for name in gearlib.__all__]
    return {
        base
        for one in public
        if isinstance(one, type) and issubclass(one, Model)
        for base in one.__mro__[:-1]
    }


NAMES = {model.__name__ for model in models()}
MEMBERS = {name for model in models() for name in dir(model) if not name.startswith("__")}


def names_in(node):
    return {
        n.id if isinstance(n, ast.Name) else n.attr
        for n in ast.walk(node)
        if hasattr(n, "ctx") and isinstance(n, (ast.Name, ast.Attribute))
    }


def faults(tree):
    """Yield the line of every place that asks for the class of a model, or doubts a member."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name):
            arguments, called = node.args, node.func.id
            asks = called in ("isinstance", "issubclass") and names_in(arguments[1]) & NAMES
            doubts = (called == "hasattr" or called == "getattr" and len(arguments) == 3) and (
                isinstance(arguments[1], ast.Constant) and arguments[1].value in MEMBERS
            )
            if asks or doubts:
                yield node.lineno
        elif isinstance(node, ast.MatchClass) and names_in(node.cls) & NAMES:
            yield node.pattern.lineno
        elif isinstance(node, ast.Compare) and "type" in names_in(node) and names_in(node) & NAMES:
            yield node.lineno


@pytest.mark.parametrize(
    "text",
    [
        "isinstance(pair, (GearPair, pair.OneDegreePair))",
        "isinstance(pair, Model)",
        "getattr(pair, 'extra_samples', ())",
        "hasattr(pair, 'title_noun')",
        "type(pair) is SixDegreePair",
    ],
)
def test_a_fault_is_seen(text):
    assert list(faults(ast.parse(text)))


def test_nobody_asks_a_model_for_its_class():
    assert len(NAMES) >= 6 and len(SOURCES) > 100
    found = [
        f"{path.relative_to(PACKAGE)}:{line}"
        for path in SOURCES
        for line in faults(ast.parse(path.read_text(encoding="utf-8")))
    ]
    assert found == []


def test_models_alone_choose_their_kernels():
    found = set()
    for path in SOURCES:
        if PACKAGE / "engines" in path.parents or path.parent.name == "steps":
            continue
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.ImportFrom):
                wanted = {alias.name for alias in node.names}
                # A module of them, or one of their functions.
                modules = {f"{node.module}.{name}" for name in wanted} & set(GOING)
                if wanted & GOING.get(node.module, set()) or modules:
                    found.add(str(path.relative_to(PACKAGE)))
    assert found == set()


def test_every_file_on_the_page_of_the_architecture_is_there():
    root = PACKAGE.parent
    page = (root / "docs/architecture.md").read_text(encoding="utf-8")
    named = {name for name in re.findall(r"`([\w./-]+/[\w./-]+)`", page) if "results/" not in name}
    assert len(named) > 15
    assert [name for name in sorted(named) if not (root / name).exists()] == []


def test_no_function_takes_more_than_eight_parameters():
    # Public calls, whose keywords are documented one by one, are named where they are used.
    public = {*gearlib.__all__, *gearlib.geometry.__all__}
    found = set()
    for path in PACKAGE.rglob("*.py"):
        if PACKAGE / "engines" in path.parents or path.parent.name == "steps":
            continue
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.FunctionDef):
                named = 0 if node.name in public else len(node.args.kwonlyargs)
                given = [one.arg for one in (*node.args.posonlyargs, *node.args.args)]
                if named + len(given) - (given[:1] in (["self"], ["cls"])) > 8:
                    found.add(f"{path.name}: {node.name}")
    assert found <= TOO_MANY
