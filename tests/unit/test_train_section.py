"""The section `train` of a configuration: it says all that the library takes, and builds that."""

from pathlib import Path

import pint
import pytest
import yaml

import gearlib
from gearlib.config import load, train_section
from gearlib.models.from_values import train_from_description
from tests.paper import CONFIG

EVERY = yaml.safe_load(Path("tests/every_train.yaml").read_text(encoding="utf-8"))
READY_MADE = ("split_power_reducer", "planetary", "idler", "two_stage")


def read(train):
    return load(CONFIG | {"train": train})


def test_the_examples_have_all_keys():
    # test_drawn_trains.py has the keys of drawn gears; alternatives stand in place of other keys.
    drawn = {"gear", *train_section.DRAWN_MESH_KEYS} - {"material_damping"}
    alternatives = {"line_of_action", "planetary_set"}
    train, parts = train_section.Train, EVERY["own"]
    sections = [(train.model_fields[key].annotation, EVERY[key]) for key in READY_MADE]
    sections += [(train_section.Own, parts), (train, EVERY)]
    sections += [(train_section.BodyPart, parts["bodies"][0])]
    sections += [(train_section.ShaftPart, parts["shafts"][0])]
    sections += [(train_section.MeshPart, parts["meshes"][0])]
    for section, keys in sections:
        assert set(section.model_fields) - set(keys) <= alternatives | drawn


@pytest.mark.parametrize("kind", READY_MADE)
def test_a_ready_made_train_is_that_of_the_library(kind):
    settings = read({"kind": kind, kind: EVERY[kind]})
    values = getattr(settings.train, kind).model_dump()
    assert values.keys() == EVERY[kind].keys()
    pair = () if kind == "planetary" else (gearlib.GearPair(**settings.pair_parameters("k1m")),)
    expected = getattr(gearlib, kind)(*pair, **values)
    assert train_from_description(**settings.train_parameters("k1m")) == expected


def test_texts_are_read_in_si_units():
    registry = pint.UnitRegistry()

    def compare(text, value):
        if isinstance(text, (dict, list)):
            assert len(text) == len(value)
            for key in text if isinstance(text, dict) else range(len(text)):
                compare(text[key], value[key])
        elif isinstance(value, float) and isinstance(text, str):
            # SI is the base of pint's units; rounding of its factors.
            expected = registry.Quantity(text).to_base_units().magnitude
            assert value == pytest.approx(expected, rel=1e-14), text

    compare(EVERY, read(EVERY).train.model_dump())
