"""The section `tolerances`: what of the gears scatters, and how far."""

from typing import Literal

from pydantic import model_validator

from gearlib import parameters
from gearlib.config import units
from gearlib.config.types import (
    MAX_JOBS,
    Amount,
    DampingName,
    Finite,
    Given,
    Grid,
    Label,
    Name,
    Section,
    Seed,
    Start,
    Step,
    Stop,
    check_different,
    check_grid,
    check_most,
    entry,
    listing,
    number_within,
    numbers,
    whole,
)
from gearlib.data.scatter_variables import QUANTITIES
from gearlib.models import tolerated

#: Those that ask no duty point.
_QUANTITIES = tuple(name for name in QUANTITIES if "duty point" not in QUANTITIES[name][1])
_KEYS = ("mean", "std", "min", "max", "nominal", "upper", "lower")
_SHARE = "%"
#: Keys of values; the others are of deviations, which may be shares.
_VALUES = (".mean", ".min", ".max", ".nominal")


class ToleratedParameter(Given):
    """A parameter that scatters: mean and std; min and max; nominal, upper and lower; or a law."""

    parameter: Label = entry(
        "Name of a parameter of gear_pair or of one of its ratios; of gears: torque, "
        "centre_distance, pinion.shift and the like."
    )
    mean: Amount = entry("Mean value; that of the gears where left out.", None)
    std: Amount = entry('Standard deviation; a text such as "5 %" is a share of the mean.', None)
    min: Amount = entry("Least value; up to max all are as likely.", None)
    max: Amount = entry("Largest value.", None)
    nominal: Amount = entry("Nominal value; that of the gears where left out.", None)
    upper: Amount = entry("Upper deviation from it, or a share; all between are as likely.", None)
    lower: Amount = entry("Lower deviation.", None)
    distribution: Label = entry("In place of these: a name of scipy.stats.", None)
    shape: dict[Name, Finite] = entry("Its parameters.", None)

    def law(self, key, kind):
        """Return what is given of it as `gearlib.scatter` takes it, in SI; texts are read."""
        own = {name: getattr(self, name) for name in _KEYS if getattr(self, name) is not None}
        if self.distribution is not None:
            if own:
                raise ValueError(
                    f"{key}.{next(iter(own))} is not allowed: it must be left out beside a "
                    "distribution"
                )
            return {"distribution": self.distribution, **(self.shape or {})}
        if self.shape is not None:
            raise ValueError(f"{key}.shape is not allowed: it must stand beside a distribution")
        return {name: _read(f"{key}.{name}", value, kind) for name, value in own.items()}


def _read(key, value, kind):
    """Return a text with a unit as a number of the kind."""
    if not isinstance(value, str) or value.strip().endswith(_SHARE) or not hasattr(kind, "unit"):
        return value
    try:
        return units.read(value, kind.unit)
    except ValueError:
        words = "a finite number"
        if kind.unit != "1":
            words += f" in {kind.unit} or a text with its unit such as {kind.example!r}"
        if not key.endswith(_VALUES):
            words += ", or a share such as '5 %'"
        raise ValueError(f"{key} = {value!r} is not allowed: it must be {words}") from None


class Correlation(Section):
    """Two parameters that scatter together."""

    parameters: listing(Label, "Names of both.")
    rho: number_within(gt=-1, lt=1) = entry("Correlation of their normal scores.")


class Tolerances(Grid):
    """How jumps, contact loss and peaks scatter with the tolerances of the gears."""

    damping: DampingName
    parameters: list[ToleratedParameter] = entry(
        "What scatters.",
        [
            ToleratedParameter.unchecked(parameter="backlash", upper="25 %", lower="-25 %"),
            ToleratedParameter.unchecked(parameter="material_damping", upper="50 %", lower="-50 %"),
            ToleratedParameter.unchecked(parameter="load", std="5 %"),
            ToleratedParameter.unchecked(parameter="max_stiffness", std="2 %"),
        ],
        min_length=1,
    )
    correlations: list[Correlation] = entry("Of them, by a Gaussian copula.", [])
    quantities: listing(Literal[_QUANTITIES], "Quantities of each design.") = [
        "jump_up",
        "jump_down",
        "onset_of_contact_loss",
        "peak",
    ]
    samples: whole(2, 2**24) = entry(
        "Designs, points of a Sobol' sequence: of powers of two they are balanced.", 512
    )
    shard: whole(1) = entry("Designs of one job; the results do not depend on it.", 256)
    index_samples: Literal[16, 32, 64, 128, 256, 512, 1024, 2048, 4096, 8192] = entry(
        "Of the Sobol' indices: of k parameters so many times k + 2 designs.", 128
    )
    seed: Seed = 1
    start: Start = 0.5
    stop: Stop = 1.4
    step: Step = 0.01
    directions: listing(
        Literal["up", "down", "cold", "seeded"],
        "How each speed is come to: carried up or down, from rest, from seeded starts.",
    ) = ["up", "down", "seeded"]
    box: numbers(number_within(gt=0, le=100), 2, "Largest displacement and rate of starts.") = [
        6.0,
        6.0,
    ]
    periods: whole(1, 1_000_000) = entry("Mesh periods of each run.", 120)
    record_periods: whole(1) = entry("The last ones, which are evaluated; at most `periods`.", 20)

    @model_validator(mode="after")
    def _check(self):
        check_grid("tolerances", self)
        check_most(
            "tolerances.record_periods",
            self.record_periods,
            self.periods,
            "tolerances.periods = {}",
        )
        if self.samples > MAX_JOBS * self.shard:
            raise ValueError(
                f"tolerances.shard = {self.shard} is not allowed: it must be >= "
                f"{-(-self.samples // MAX_JOBS)} to stay within {MAX_JOBS:,} jobs"
            )
        check_different("tolerances.parameters", self.parameters, "parameter")
        names = {one.parameter for one in self.parameters}
        known = known_parameters()
        for i, one in enumerate(self.parameters):
            key = f"tolerances.parameters[{i}]"
            if one.parameter not in known:
                raise ValueError(
                    f"{key}.parameter = {one.parameter!r} is not allowed: it must be one of "
                    f"{', '.join(known)}"
                )
            law = one.law(key, known[one.parameter].kind)
            if "distribution" not in law:
                # What is left out is a matter of the gears.
                tolerated.complete(key, law, own=1.0)
        for name, field in tolerated.RATIOS.items():
            if {name, field} <= names:
                raise ValueError(
                    f"tolerances.parameters of {name} and {field} are not allowed together: both "
                    "set the same; give one of them"
                )
        for i, pair in enumerate(self.correlations):
            for name in pair.parameters:
                if name not in names or len(pair.parameters) != 2:
                    raise ValueError(
                        f"tolerances.correlations[{i}].parameters = {pair.parameters!r} is not "
                        f"allowed: it must be two of {', '.join(sorted(names))}"
                    )
        return self

    def of_drawing(self):
        """Return whether what scatters is the drawing, not the pair derived from it."""
        own = [one.parameter for one in self.parameters]
        drawn = tolerated.of_drawing()
        return all(name in drawn for name in own) and any(
            name not in tolerated.of_pair() for name in own
        )

    def laws(self, values):
        """Return what `gearlib.scatter` takes, refused where the gears cannot have it.

        values: name -> value of the gears, where they have one.
        """
        known = tolerated.of_drawing() if self.of_drawing() else tolerated.of_pair()
        found: dict = {}
        for one in self.parameters:
            key, name = self.keys()[one.parameter], one.parameter
            if name not in known:
                raise ValueError(
                    f"{key}.parameter = {name!r} is not allowed beside the others: all must be of "
                    "the gear pair, or all of the drawing"
                )
            law = one.law(key, known[name].kind)
            if "distribution" not in law:
                law = tolerated.complete(key, law, own=values.get(name))
                tolerated.check_range(key, law, known[name], tolerated.extent(law))
            found[name] = law
        if self.correlations:
            found["correlations"] = [[*one.parameters, one.rho] for one in self.correlations]
        return found

    def needs_scipy(self):
        """Return whether laws can be checked by scipy alone."""
        return bool(self.correlations) or any(one.distribution for one in self.parameters)

    def keys(self):
        """Return name of a parameter -> its key here, for refusals."""
        names = [one.parameter for one in self.parameters]
        return {name: f"tolerances.parameters[{i}]" for i, name in enumerate(names)}

    def shards(self):
        """Return the names of the shards, ranges of samples."""
        firsts = range(0, self.samples, self.shard)
        return [f"{first}-{min(first + self.shard, self.samples)}" for first in firsts]


def known_parameters():
    """Return name -> `Parameter` of all that may scatter."""
    known: dict[str, parameters.Parameter] = tolerated.of_drawing() | tolerated.of_pair()
    return known
