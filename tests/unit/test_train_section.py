"""The section `train` of a configuration: it says all that the library takes, and builds that."""

import dataclasses
from pathlib import Path

import numpy as np
import pint
import pytest
import yaml

import gearlib
from gearlib.config import load, train_section
from gearlib.config import train_section as trains
from gearlib.models.from_values import train_from_description
from tests.paper import CONFIG
from tests.trains.random_trains import random_train

EVERY = yaml.safe_load(Path("tests/every_train.yaml").read_text(encoding="utf-8"))
#: Keys of drawn gears, tested in test_drawn_trains.py.
DRAWN = {"gear", *train_section.DRAWN_MESH_KEYS} - {"material_damping"}
READY_MADE = ("split_power_reducer", "planetary", "idler", "two_stage")


def read(train):
    return load(CONFIG | {"train": train})


def test_all_keys_are_tried():
    def left_out(section, given):
        missing = set(section.model_fields) - set(given)
        return missing - {"line_of_action", "planetary_set"} - DRAWN  # in place of others

    for key in READY_MADE:
        assert not left_out(trains.Train.model_fields[key].annotation, EVERY[key])
    own = EVERY["own"]
    assert not left_out(trains.Own, own) and not left_out(trains.Train, EVERY)
    for key, section in (
        ("bodies", trains.BodyPart),
        ("shafts", trains.ShaftPart),
        ("meshes", trains.MeshPart),
    ):
        assert not left_out(section, own[key][0])


@pytest.mark.parametrize("kind", READY_MADE)
def test_a_ready_made_train_is_that_of_the_library(kind):
    settings = read({"kind": kind, kind: EVERY[kind]})
    values = getattr(settings.train, kind).model_dump()
    assert values.keys() == EVERY[kind].keys()
    make = getattr(gearlib, kind)
    pair = gearlib.GearPair(**settings.pair_parameters("k1m"))
    expected = make(**values) if kind == "planetary" else make(pair, **values)
    assert train_from_description(**settings.train_parameters("k1m")) == expected


def test_texts_are_read_in_si_units():
    registry = pint.UnitRegistry()

    def compare(text, value):
        if isinstance(text, dict):
            assert text.keys() == value.keys()
        entries = text.items() if isinstance(text, dict) else enumerate(text)
        for key, one in entries:
            if isinstance(one, (dict, list)):
                compare(one, value[key])
            elif isinstance(value[key], float) and isinstance(one, str):
                # SI is the base of pint's units; rounding of its factors.
                expected = registry.Quantity(one).to_base_units().magnitude
                assert value[key] == pytest.approx(expected, rel=1e-14), (key, one)

    compare(EVERY, read(EVERY).train.model_dump())


@pytest.mark.parametrize("seed", range(10))
def test_every_train_can_be_written_as_one_of_its_own(seed):
    train = random_train(np.random.default_rng(seed))
    train = dataclasses.replace(train, reference=train.mesh_names[-1], reference_frequency=1234.5)
    fields = dataclasses.asdict(train)
    section = {key: fields.pop(key) for key in ("bodies", "shafts", "meshes")}
    section |= {key: fields.pop(key) for key in ("carrier_ratio", "gyroscopic")}
    text = yaml.safe_dump(_plain({"kind": "own", "own": section, **fields}))
    settings = read(yaml.safe_load(text))
    assert train_from_description(**settings.train_parameters("k1")) == train
    assert load(settings.model_dump()) == settings


def _plain(value):
    """Return dicts and lists without None, which says that a key is left out."""
    if isinstance(value, dict):
        return {key: _plain(one) for key, one in value.items() if one is not None}
    if isinstance(value, (list, tuple)):
        return [_plain(one) for one in value]
    return value.item() if isinstance(value, np.generic) else value
