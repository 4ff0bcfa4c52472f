"""What can be explored: parameters with their sliders, and what the gears do at a setting."""

from abc import ABC, abstractmethod
from dataclasses import make_dataclass
from typing import ClassVar, NamedTuple

import yaml

from gearlib import config, parameters

_GREEK = {"kappa": "κ", "epsilon": "ε"}
#: Unit of a slider in SI -> what stands before that of the parameter.
_PREFIXES = {1.0: "", 1e-6: "µ"}


class Slider(NamedTuple):
    """The slider of one parameter."""

    label: str  #: with its unit
    start: float  #: in SI
    range: tuple  #: lowest, highest and step, in the unit of the slider
    unit: float = 1.0  #: in SI


def slider_of(thing, name, start, step, low=None, high=None, unit=1.0):
    """Return the slider of a parameter that a class declares, see `gearlib.parameters`.

    Its ends, in the unit of the slider, are the bounds that are declared, where they are left out.
    """
    one, (_, words) = parameters.declared(thing)[name], parameters.named(thing)[name]
    for letter, greek in _GREEK.items():
        words = words.replace(letter, greek)
    label = f"{words}, {_PREFIXES[unit]}{one.unit}" if one.unit else words
    low = one.kind.least if low is None else low
    high = one.kind.most if high is None else high
    return Slider(label, start, (float(low), float(high), step), unit)


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

    #: Which gears these are.
    heading: str
    #: Name of a parameter -> its `Slider`.
    sliders: dict
    #: Name of a choice -> its label, and its options as of Panel, the first of them the start.
    choices: dict = {}
    #: Name of the slider over which the resonance characteristic goes.
    abscissa: ClassVar[str] = "speed"

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
