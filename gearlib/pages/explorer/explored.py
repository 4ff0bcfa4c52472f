"""What can be explored: parameters with their sliders, and what the gears do at a setting."""

from abc import ABC, abstractmethod
from dataclasses import make_dataclass
from typing import ClassVar, NamedTuple

import yaml

from gearlib import config


class Slider(NamedTuple):
    """The slider of one parameter."""

    label: str  #: with its unit
    start: float  #: in SI
    range: tuple  #: lowest, highest and step, in the unit of the slider
    unit: float = 1.0  #: in SI


def setting_of(values):
    """Return what sliders and choices say, name -> value in SI, as a dataclass."""
    return make_dataclass("Setting", values, frozen=True)(**values)


def saved(head, whole):
    """Return the text of a config.yaml, checked, under a line of words."""
    config.load(whole)
    text = yaml.safe_dump(whole, sort_keys=False, allow_unicode=True)
    return f"# What gearlib explore showed {head}\n{text}"


class Explored(ABC):
    """Gears of a configuration, and what sliders change of them."""

    #: Name of a parameter -> its `Slider`.
    sliders: dict
    #: Name of a choice -> its label, and its options as of Panel, the first of them the start.
    choices: ClassVar[dict] = {}
    #: What is followed: "value_throttled" is a slider that is let go.
    event: ClassVar[str] = "value"

    @property
    def start(self):
        """The setting at the start."""
        first = {}
        for name, (_, options) in self.choices.items():
            first[name] = next(iter(options.values() if isinstance(options, dict) else options))
        return setting_of({name: one.start for name, one in self.sliders.items()} | first)

    @abstractmethod
    def look(self, setting):
        """Return the `gearlib.pages.explorer.view.View` of a setting.

        ValueError if there cannot be such gears; it names parameter, value and range.
        """

    @abstractmethod
    def configuration(self, setting):
        """Return the text of a config.yaml that computes what is seen."""
