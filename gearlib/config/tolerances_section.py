"""The section `tolerances`: what of the gears scatters, and how far."""

from typing import Literal

from pydantic import model_validator

from gearlib import checks
from gearlib.config import types as t
from gearlib.config import units
from gearlib.config.types import Recorded, Section, entry, grid, several
from gearlib.data.variables import QUANTITIES
from gearlib.models import tolerated

#: Quantities that need no duty point.
_QUANTITIES = tuple(name for name in QUANTITIES if "duty point" not in QUANTITIES[name][1])
#: Keys of values, and of deviations, which may be shares.
_VALUES, _DEVIATIONS = ("mean", "min", "max", "nominal"), ("std", "upper", "lower")


class ToleratedParameter(Section):
    """A parameter that scatters: mean and std; min and max; nominal, upper and lower; or a law."""

    parameter: t.Label = entry(
        "Name of a parameter of gear_pair or of one of its ratios; of gears: torque, "
        "centre_distance, pinion.shift and the like."
    )
    mean: t.Amount = entry("Mean value; that of the gears where left out.", None)
    std: t.Amount = entry('Standard deviation; a text such as "5 %" is a share of the mean.', None)
    min: t.Amount = entry("Smallest value; all up to max are equally likely.", None)
    max: t.Amount = entry("Largest value.", None)
    nominal: t.Amount = entry("Nominal value; that of the gears where left out.", None)
    upper: t.Amount = entry("Upper deviation from the nominal value, or a share.", None)
    lower: t.Amount = entry("Lower deviation from the nominal value, or a share.", None)
    distribution: t.Label = entry("Name of a law of scipy.stats, in place of these.", None)
    shape: dict[t.Name, t.Finite] = entry("Parameters of that law.", None)

    def law(self, key, kind):
        """Return the law as `gearlib.scatter` takes it, in SI; `key` is its own in refusals."""
        numbers = self.model_dump(include={*_VALUES, *_DEVIATIONS})
        if self.distribution is None:
            fits = self.shape is None
            checks.require(fits, f"{key}.shape", self.shape, "left out without a distribution")
            return {name: _in_si(f"{key}.{name}", x, kind) for name, x in numbers.items()}
        for name, value in numbers.items():
            raise checks.refusal(f"{key}.{name}", value, "left out beside a distribution")
        return {"distribution": self.distribution, **(self.shape or {})}


def _in_si(key, value, kind):
    """Return a text with a unit as a number of the kind; shares stay texts."""
    if not isinstance(value, str) or value.strip().endswith("%") or not hasattr(kind, "unit"):
        return value
    try:
        return units.read(value, kind.unit)
    except ValueError:
        unit = f" in {kind.unit} or a text with its unit such as {kind.example!r}"
        share = ", or a share such as '5 %'" if key.endswith(_DEVIATIONS) else ""
        allowed = f"a finite number{unit if kind.unit != '1' else ''}{share}"
        raise checks.refusal(key, value, allowed) from None


class Correlation(Section):
    """Two parameters that scatter together."""

    parameters: several(t.Label, 2) = entry("Names of both parameters.")
    rho: t.number(gt=-1, lt=1) = entry("Correlation of their normal scores.")


class Tolerances(grid(0.5, 1.4, 0.01), Recorded):
    """Scatter of jumps, contact loss and peaks with the tolerances of the gears."""

    damping: t.DampingName = None
    parameters: list[ToleratedParameter] = entry(
        "The parameters that scatter.",
        [
            {"parameter": "backlash", "upper": "25 %", "lower": "-25 %"},
            {"parameter": "material_damping", "upper": "50 %", "lower": "-50 %"},
            {"parameter": "load", "std": "5 %"},
            {"parameter": "max_stiffness", "std": "2 %"},
        ],
        min_length=1,
    )
    correlations: list[Correlation] = entry("Correlations of them, by a Gaussian copula.", [])
    quantities: t.Distinct[Literal[_QUANTITIES]] = entry(
        "Quantities of each design.", ["jump_up", "jump_down", "onset_of_contact_loss", "peak"]
    )
    samples: t.whole(2, 2**24) = entry("Designs, points of a Sobol' sequence.", 512)
    shard: t.whole(1) = entry("Designs of one job; the results do not depend on it.", 256)
    index_samples: Literal[16, 32, 64, 128, 256, 512, 1024, 2048, 4096, 8192] = entry(
        "Samples n of the Sobol' indices, n (k + 2) designs of k parameters.", 128
    )
    seed: t.Seed = 1
    directions: t.Distinct[Literal["up", "down", "cold", "seeded"]] = entry(
        "How each speed is reached: swept up or down, from rest, from seeded starts.",
        ["up", "down", "seeded"],
    )
    box: several(t.OwnTuning, 2) = entry("Largest displacement and velocity at starts.", [6.0, 6.0])
    periods: t.Periods = 120
    record_periods: t.RecordPeriods = 20

    @model_validator(mode="after")
    def _check(self):
        shard = -(-self.samples // t.MAX_JOBS)
        allowed = f"an integer >= {shard} to stay within {t.MAX_JOBS:,} jobs"
        checks.require(self.shard >= shard, ".shard", self.shard, allowed)
        t.check_different(".parameters", self.parameters, "parameter")
        names = [tolerance.parameter for tolerance in self.parameters]
        both = f"{', '.join(known_parameters())}, all of the gear pair or all of the drawing"
        for i, name in enumerate(names):
            fits = name in self._known()
            checks.require(fits, f".parameters[{i}].parameter", name, f"one of {both}")
        for name, field in tolerated.RATIOS.items():
            if {name, field} <= {*names}:
                raise ValueError(
                    f".parameters of {name} and {field} are not allowed together: both set the "
                    "same; give one of them"
                )
        for i, pair in enumerate(self.correlations):
            key, allowed = f".correlations[{i}].parameters", f"two of {', '.join(sorted(names))}"
            fits = {*pair.parameters} <= {*names} and len({*pair.parameters}) == 2
            checks.require(fits, key, pair.parameters, allowed)
        # Values that are left out are a matter of the gears.
        self._laws("", dict.fromkeys(names, 1.0))
        return self

    def of_drawing(self):
        """Return whether parameters of the drawing scatter, not those of the pair."""
        names = {tolerance.parameter for tolerance in self.parameters}
        of_pair = names <= tolerated.pair_parameters().keys()
        return names <= tolerated.drawing_parameters().keys() and not of_pair

    def _known(self):
        return tolerated.drawing_parameters() if self.of_drawing() else tolerated.pair_parameters()

    def laws(self, values):
        """Return the laws for `gearlib.scatter`, refused where the gears cannot have them.

        values: name -> value of the gears, where they have one.
        """
        laws = self._laws("tolerances", values)
        for key, (name, law) in zip(self.keys().values(), laws.items(), strict=True):
            if "distribution" not in law:
                limits = tolerated.centre_and_limits(law)
                tolerated.check_range(key, law, self._known()[name], limits)
        if self.correlations:
            laws["correlations"] = [[*x.parameters, x.rho] for x in self.correlations]
        return laws

    def _laws(self, section, values):
        """Return name -> law in numbers; values that are left out are those of the gears."""
        laws = {}
        for i, tolerance in enumerate(self.parameters):
            key, name = f"{section}.parameters[{i}]", tolerance.parameter
            law = tolerance.law(key, self._known()[name].kind)
            if "distribution" not in law:
                law = tolerated.complete_scatter(key, law, model_value=values.get(name))
            laws[name] = law
        return laws

    def needs_scipy(self):
        """Return whether laws can be checked by scipy alone."""
        return bool(self.correlations) or any(x.distribution for x in self.parameters)

    def keys(self):
        """Return name of a parameter -> its key here, for refusals."""
        return {x.parameter: f"tolerances.parameters[{i}]" for i, x in enumerate(self.parameters)}

    def shards(self):
        """Return the names of the shards, ranges of samples."""
        firsts = range(0, self.samples, self.shard)
        return [f"{first}-{min(first + self.shard, self.samples)}" for first in firsts]


def known_parameters():
    """Return name -> `Parameter` of all that may scatter."""
    return tolerated.drawing_parameters() | tolerated.pair_parameters()
