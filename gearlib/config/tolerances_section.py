"""The section `tolerances`: distributions of the parameters of the gears."""

import math
from typing import Literal

from pydantic import model_validator

from gearlib import checks, units
from gearlib import parameters as p
from gearlib.config import types as t
from gearlib.config.types import MAX_JOBS, Section, check_unique, field, list_of
from gearlib.data.variables import QUANTITIES
from gearlib.models import tolerated

#: Quantities that do not require a duty point.
_QUANTITIES = tuple(name for name in QUANTITIES if "duty point" not in QUANTITIES[name][1])
#: Keys of absolute values; keys of deviations, which may also be percentages.
_VALUES, _DEVIATIONS = ("mean", "min", "max", "nominal"), ("std", "upper", "lower")


class ToleratedParameter(Section):
    """The distribution of a parameter: normal, uniform, by tolerance limits, or of scipy.stats.

    Give mean and std; min and max; nominal, upper and lower; or distribution and shape.
    """

    parameter: t.Label = field(
        "Name of a parameter or ratio of gear_pair, or of a parameter of gears, such as torque, "
        "centre_distance or pinion.shift."
    )
    mean: t.Amount = field("Mean value. Default: the value of the gears.", None)
    std: t.Amount = field('Standard deviation; "5 %" is a percentage of the mean.', None)
    min: t.Amount = field("Smallest value; all values up to max are equally likely.", None)
    max: t.Amount = field("Largest value.", None)
    nominal: t.Amount = field("Nominal value. Default: the value of the gears.", None)
    upper: t.Amount = field("Upper deviation from the nominal value, or a percentage.", None)
    lower: t.Amount = field("Lower deviation from the nominal value, or a percentage.", None)
    distribution: t.Label = field(
        "Name of a distribution in scipy.stats, instead of the other keys.", None
    )
    shape: dict[t.Name, p.Finite] = field("Parameters of this distribution.", None)

    def distribution_dict(self, key, unit):
        """Return the distribution as a dict for `gearlib.scatter`, in SI units.

        `key` is the configuration key of this section, for error messages; `unit` is the
        `gearlib.parameters.Unit` of the parameter, or None if unknown. The section has either
        `distribution`, a name in scipy.stats, with its parameters `shape`, or values such as `mean`
        and `std`.
        """
        values = self.model_dump(include={*_VALUES, *_DEVIATIONS})
        if self.distribution is None:
            allowed = "omitted unless a distribution is given"
            checks.require(self.shape is None, f"{key}.shape", self.shape, allowed)
            return {name: _to_si(f"{key}.{name}", x, unit) for name, x in values.items()}
        if values:
            name, value = next(iter(values.items()))
            raise checks.InputError(f"{key}.{name}", value, "omitted if a distribution is given")
        return {"distribution": self.distribution, **(self.shape or {})}


def _to_si(key, value, unit):
    """Convert a value such as "40 um" to SI units; return numbers and percentages unchanged.

    `key` is the configuration key of the value, for error messages. `unit` is the
    `gearlib.parameters.Unit` of the parameter; if it is None, nothing is converted.
    """
    if not isinstance(value, str) or value.strip().endswith("%") or unit is None:
        return value
    try:
        return units.parse_quantity(value, unit.unit)
    except ValueError:
        allowed = "a finite number"
        if unit.unit != "1":
            allowed += f" in {unit.unit}, or a string with a unit such as {unit.example!r}"
        if key.endswith(_DEVIATIONS):
            allowed += ", or a percentage such as '5 %'"
        raise checks.InputError(key, value, allowed) from None


class Correlation(Section):
    """Correlation of two parameters."""

    parameters: list_of(t.Label, 2) = field("Names of the two parameters.")
    rho: t.number(gt=-1, lt=1) = field("Correlation coefficient of their normal scores.")


class Tolerances(t.grid_with_defaults(0.5, 1.4, 0.01), t.RecordedPeriods):
    """Scatter of jumps, contact loss and peaks due to the tolerances of the gears."""

    damping: t.DampingName = None
    parameters: list[ToleratedParameter] = field(
        "The parameters with their distributions.",
        [
            {"parameter": "backlash", "upper": "25 %", "lower": "-25 %"},
            {"parameter": "material_damping", "upper": "50 %", "lower": "-50 %"},
            {"parameter": "load", "std": "5 %"},
            {"parameter": "max_stiffness", "std": "2 %"},
        ],
        min_length=1,
    )
    correlations: list[Correlation] = field(
        "Correlations of the parameters, by a Gaussian copula.", []
    )
    quantities: t.Distinct[Literal[_QUANTITIES]] = field(
        "Quantities to compute for each design.",
        ["jump_up", "jump_down", "onset_of_contact_loss", "peak"],
    )
    samples: t.integer(2, 2**24) = field("Number of designs, points of a Sobol' sequence.", 256)
    shard: t.integer(1) = field(
        "Number of designs of one job; the results do not depend on it.", 256
    )
    index_samples: Literal[16, 32, 64, 128, 256, 512, 1024, 2048, 4096, 8192] = field(
        "Base sample size n of the Sobol' indices: n (k + 2) designs for k parameters.", 64
    )
    seed: t.Seed = 1
    directions: t.Distinct[Literal["up", "down", "cold", "seeded"]] = field(
        "up, down: sweeps over the speed; cold: from rest; seeded: from random initial states.",
        ["up", "down", "seeded"],
    )
    box: list_of(t.NumericTuning, 2) = field(
        "Largest displacement and velocity of random initial states.", [6.0, 6.0]
    )
    periods: t.Periods = 120
    record_periods: t.RecordPeriods = 20

    @model_validator(mode="after")
    def _check(self):
        """Raise ValueError if the parameters, the correlations or the number of jobs are invalid.

        A job is one process of the workflow, which computes `shard` designs, i.e. sampled sets of
        parameters.
        """
        min_shard = math.ceil(self.samples / MAX_JOBS)
        allowed = f"an integer >= {min_shard} to stay within {MAX_JOBS:,} jobs"
        checks.require(self.shard >= min_shard, "shard", self.shard, allowed)
        check_unique("parameters", self.parameters, "parameter")
        names = [tolerance.parameter for tolerance in self.parameters]
        known_names = ", ".join(known_parameters())
        allowed = f"one of {known_names}; all must belong to the gear pair or all to the geometry"
        for i, name in enumerate(names):
            is_known = name in self._known_parameters()
            checks.require(is_known, f"parameters[{i}].parameter", name, allowed)
        # A ratio, such as the damping ratio, determines a parameter of the pair.
        for ratio, quantity in tolerated.RATIOS.items():
            if {ratio, quantity} <= {*names}:
                problem = (
                    f"of {ratio} and {quantity} are not allowed together: one determines the "
                    "other; give only one of them"
                )
                raise checks.InputError("parameters", problem=problem)
        for i, correlation in enumerate(self.correlations):
            pair, allowed = correlation.parameters, f"two of {', '.join(sorted(names))}"
            is_pair = {*pair} <= {*names} and len({*pair}) == 2
            checks.require(is_pair, f"correlations[{i}].parameters", pair, allowed)
        # Called only to raise errors. The values of the gears are not yet known and set to 1.
        self._complete_tolerances("", dict.fromkeys(names, 1.0))
        return self

    def has_geometry_parameters(self):
        """Return whether the tolerances apply to the gear geometry instead of the gear pair.

        They do if all parameters are parameters of the geometry and at least one, such as a profile
        shift, is not also a parameter of the gear pair.
        """
        names = {tolerance.parameter for tolerance in self.parameters}
        are_pair_parameters = names <= tolerated.pair_parameters().keys()
        return names <= tolerated.geometry_parameters().keys() and not are_pair_parameters

    def _known_parameters(self):
        """Return the parameters of the geometry or the gear pair as a dict: name -> `Parameter`.

        They are the parameters to which the tolerances apply.
        """
        is_geometry = self.has_geometry_parameters()
        return tolerated.geometry_parameters() if is_geometry else tolerated.pair_parameters()

    def distributions(self, nominal_values):
        """Return the distributions for `gearlib.scatter` as a dict: parameter name -> dict.

        `nominal_values` maps parameter names to SI values. If parameters are correlated, the dict
        also has the key "correlations" with a list of [name, name, correlation]. Raise ValueError
        if the limits of a distribution are not allowed for its parameter. Distributions of
        scipy.stats are not checked.
        """
        tolerances = self._complete_tolerances("tolerances.", nominal_values)
        for name, key in self.config_keys().items():
            if "distribution" not in tolerances[name]:
                limits = tolerated.centre_and_limits(tolerances[name])
                parameter = self._known_parameters()[name]
                tolerated.check_range(key, tolerances[name], parameter, limits)
        if self.correlations:
            tolerances["correlations"] = [[*x.parameters, x.rho] for x in self.correlations]
        return tolerances

    def _complete_tolerances(self, section_key, nominal_values):
        """Return a dict: parameter name -> distribution with all its keys, as a dict.

        `nominal_values` maps parameter names to SI values, with which an omitted mean or nominal
        value is replaced. `section_key` is a prefix of the keys in error messages. Distributions of
        scipy.stats remain unchanged.
        """
        tolerances = {}
        for i, section in enumerate(self.parameters):
            key, name = f"{section_key}parameters[{i}]", section.parameter
            tolerance = section.distribution_dict(key, self._known_parameters()[name].numeric_unit)
            nominal_value = nominal_values.get(name)
            if "distribution" not in tolerance:
                tolerance = tolerated.complete_scatter(key, tolerance, model_value=nominal_value)
            tolerances[name] = tolerance
        return tolerances

    def needs_scipy(self):
        """Return whether scipy is required to check the distributions."""
        return bool(self.correlations) or any(x.distribution for x in self.parameters)

    def config_keys(self):
        """Return a dict for error messages: parameter name -> key of its tolerance."""
        return {x.parameter: f"tolerances.parameters[{i}]" for i, x in enumerate(self.parameters)}

    def shard_names(self):
        """Return the names of the shards, e.g. "0-256" for the samples from 0 to 255."""
        starts = range(0, self.samples, self.shard)
        return [f"{start}-{min(start + self.shard, self.samples)}" for start in starts]


def known_parameters():
    """Return all parameters that can have a tolerance, as a dict: name -> `Parameter`."""
    return tolerated.geometry_parameters() | tolerated.pair_parameters()
