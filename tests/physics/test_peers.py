"""Solvers of other packages, those that are installed, and what is said without them."""

import importlib.util

import pytest

import gearlib
from gearlib import integrators, simulate
from tests.paper import PAPER

PEERS = ("heyoka",)
INSTALLED = [
    method.name
    for method in gearlib.methods()
    if method.available and method.name in ("scipy", *PEERS)
]
PAIR = PAPER.replace(material_damping=3953.7, backlash_damping=3953.7)


@pytest.mark.parametrize("name", INSTALLED)
def test_limits_are_a_status(name):
    assert int(simulate(PAIR, 0.9, periods=5, method=name, max_events=2).status) == 1


@pytest.mark.parametrize("name", PEERS)
def test_missing_package_is_told(name, monkeypatch):
    package = integrators.METHODS[name].PACKAGE
    found = importlib.util.find_spec
    monkeypatch.setattr(
        "gearlib.integrators.method.find_spec",
        lambda module: None if module == package.module else found(module),
    )
    listed = {method.name: method for method in gearlib.methods()}[name]
    assert not listed.available and package.distribution in listed.note
    for kind in (ValueError, ImportError):
        with pytest.raises(kind) as refusal:
            simulate(PAIR, 0.9, periods=1, method=name)
        text = str(refusal.value)
        assert name in text and package.distribution in text and "\n" not in text
