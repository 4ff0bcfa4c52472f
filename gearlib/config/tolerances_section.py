"""The section `tolerances`: which parameters of the gears scatter, and how far."""

import math
from typing import Literal

from pydantic import model_validator

from gearlib import checks, units
from gearlib import parameters as p
from gearlib.config import types as t
from gearlib.config.types import MAX_JOBS, Section, check_unique, field, list_of
from gearlib.data.variables import QUANTITIES
from gearlib.models import tolerated

#: Quantities that do not refer to a duty point.
_QUANTITIES = tuple(name for name in QUANTITIES if "duty point" not in QUANTITIES[name][1])
#: Keys of absolute values, and of deviations, which may be percentages.
_VALUES, _DEVIATIONS = ("mean", "min", "max", "nominal"), ("std", "upper", "lower")


class ToleratedParameter(Section):
    """A parameter that scatters: mean and std; min and max; nominal, upper and lower; or a law."""

    parameter: t.Label = field(
        "Name of a parameter of gear_pair or of one of its ratios; of gears: torque, "
        "centre_distance, pinion.shift and the like."
    )
    mean: t.Amount = field("Mean value. Default: the value of the gears.", None)
    std: t.Amount = field('Standard deviation; a text such as "5 %" is a share of the mean.', None)
    min: t.Amount = field("Smallest value; all up to max are equally likely.", None)
    max: t.Amount = field("Largest value.", None)
    nominal: t.Amount = field("Nominal value. Default: the value of the gears.", None)
    upper: t.Amount = field("Upper deviation from the nominal value, or a share.", None)
    lower: t.Amount = field("Lower deviation from the nominal value, or a share.", None)
    distribution: t.Label = field("Name of a law of scipy.stats, in place of these.", None)
    shape: dict[t.Name, p.Finite] = field("Parameters of that law.", None)

    def distribution_dict(self, key, unit):
        """Return the probability distribution as a dict for `gearlib.scatter`, in SI units.

        `key` is the place of this section in the configuration, for error messages; `unit` is the
        `gearlib.parameters.Unit` of the parameter, None if it is not known. The section has either
        `distribution`, a name in scipy.stats, with the parameters `shape`, or numbers such as mean
        and std.
        """
        values = self.model_dump(include={*_VALUES, *_DEVIATIONS})
        if self.distribution is None:
            allowed = "left out without a distribution"
            checks.require(self.shape is None, f"{key}.shape", self.shape, allowed)
            return {name: _to_si(f"{key}.{name}", x, unit) for name, x in values.items()}
        if values:
            name, value = next(iter(values.items()))
            raise checks.InputError(f"{key}.{name}", value, "left out beside a distribution")
        return {"distribution": self.distribution, **(self.shape or {})}


def _to_si(key, value, unit):
    """Return a value such as "40 um" in SI units; return numbers and percentages unchanged.

    `key` is its place in the configuration, for error messages. `unit` is the
    `gearlib.parameters.Unit` of the parameter; with None nothing is converted.
    """
    if not isinstance(value, str) or value.strip().endswith("%") or unit is None:
        return value
    try:
        return units.parse_quantity(value, unit.unit)
    except ValueError:
        words = f" in {unit.unit} or a text with its unit such as {unit.example!r}"
        percentage = ", or a share such as '5 %'" if key.endswith(_DEVIATIONS) else ""
        allowed = f"a finite number{words if unit.unit != '1' else ''}{percentage}"
        raise checks.InputError(key, value, allowed) from None


class Correlation(Section):
    """Two parameters that scatter together."""

    parameters: list_of(t.Label, 2) = field("Names of both parameters.")
    rho: t.number(gt=-1, lt=1) = field("Correlation of their normal scores.")


class Tolerances(t.grid_with_defaults(0.5, 1.4, 0.01), t.RecordedPeriods):
    """Scatter of jumps, contact loss and peaks with the tolerances of the gears."""

    damping: t.DampingName = None
    parameters: list[ToleratedParameter] = field(
        "The parameters that scatter.",
        [
            {"parameter": "backlash", "upper": "25 %", "lower": "-25 %"},
            {"parameter": "material_damping", "upper": "50 %", "lower": "-50 %"},
            {"parameter": "load", "std": "5 %"},
            {"parameter": "max_stiffness", "std": "2 %"},
        ],
        min_length=1,
    )
    correlations: list[Correlation] = field("Correlations of them, by a Gaussian copula.", [])
    quantities: t.Distinct[Literal[_QUANTITIES]] = field(
        "Quantities of each design.", ["jump_up", "jump_down", "onset_of_contact_loss", "peak"]
    )
    samples: t.integer(2, 2**24) = field("Designs, points of a Sobol' sequence.", 512)
    shard: t.integer(1) = field("Designs of one job; the results do not depend on it.", 256)
    index_samples: Literal[16, 32, 64, 128, 256, 512, 1024, 2048, 4096, 8192] = field(
        "Samples n of the Sobol' indices, n (k + 2) designs of k parameters.", 128
    )
    seed: t.Seed = 1
    directions: t.Distinct[Literal["up", "down", "cold", "seeded"]] = field(
        "How each speed is reached: swept up or down, from rest, from seeded starts.",
        ["up", "down", "seeded"],
    )
    box: list_of(t.NumericTuning, 2) = field(
        "Largest displacement and velocity at starts.", [6.0, 6.0]
    )
    periods: t.Periods = 120
    record_periods: t.RecordPeriods = 20

    @model_validator(mode="after")
    def _check(self):
        """Raise ValueError if jobs, parameters or correlations of the section are not valid.

        A job is a process of the workflow, which computes `shard` designs, sampled sets of
        parameters.
        """
        min_shard = math.ceil(self.samples / MAX_JOBS)
        allowed = f"an integer >= {min_shard} to stay within {MAX_JOBS:,} jobs"
        checks.require(self.shard >= min_shard, "shard", self.shard, allowed)
        check_unique("parameters", self.parameters, "parameter")
        names = [tolerance.parameter for tolerance in self.parameters]
        known_names = ", ".join(known_parameters())
        allowed = f"one of {known_names}, all of the gear pair or all of the geometry"
        for i, name in enumerate(names):
            is_known = name in self._known_parameters()
            checks.require(is_known, f"parameters[{i}].parameter", name, allowed)
        # A ratio, such as the damping ratio, determines a parameter of the pair.
        for ratio, quantity in tolerated.RATIOS.items():
            if {ratio, quantity} <= {*names}:
                problem = (
                    f"of {ratio} and {quantity} are not allowed together: one follows from the "
                    "other; give one of them"
                )
                raise checks.InputError("parameters", problem=problem)
        for i, correlation in enumerate(self.correlations):
            pair, allowed = correlation.parameters, f"two of {', '.join(sorted(names))}"
            is_pair = {*pair} <= {*names} and len({*pair}) == 2
            checks.require(is_pair, f"correlations[{i}].parameters", pair, allowed)
        # This call only raises errors of the tolerances. The values of the gears are not known yet,
        # and 1.0 stands for each of them.
        self._complete_tolerances("", dict.fromkeys(names, 1.0))
        return self

    def apply_to_geometry(self):
        """Return whether the tolerances are tolerances of the gear geometry.

        Then all parameters are parameters of the geometry, and at least one of them, such as a
        profile shift, is not also a parameter of the gear pair.
        """
        names = {tolerance.parameter for tolerance in self.parameters}
        are_of_pair = names <= tolerated.pair_parameters().keys()
        return names <= tolerated.geometry_parameters().keys() and not are_of_pair

    def _known_parameters(self):
        """Return the parameters that may have tolerances, name -> `Parameter`.

        They are parameters of the geometry if one of the tolerances is, else those of the gear
        pair.
        """
        is_geometry = self.apply_to_geometry()
        return tolerated.geometry_parameters() if is_geometry else tolerated.pair_parameters()

    def distributions(self, nominal_values):
        """Return the distributions for `gearlib.scatter`, as a dict: parameter name -> dict.

        `nominal_values` maps parameter names to SI values. If parameters are correlated, there is
        also the key "correlations" with a list of [name, name, correlation]. Raise ValueError if
        the limits of a distribution are not allowed for its parameter; those of scipy.stats are not
        checked.
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

        `nominal_values` maps parameter names to SI values, which replace a mean or nominal value
        that is not stated. Each key in an error message starts with `section_key`. A distribution
        of scipy.stats stays as it is.
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
        """Return whether scipy is needed to check the probability distributions."""
        return bool(self.correlations) or any(x.distribution for x in self.parameters)

    def config_keys(self):
        """Return a dict: parameter name -> config key of its tolerance, for error messages."""
        return {x.parameter: f"tolerances.parameters[{i}]" for i, x in enumerate(self.parameters)}

    def shard_names(self):
        """Return the names of the shards, ranges of samples such as "0-256" without its end."""
        starts = range(0, self.samples, self.shard)
        return [f"{start}-{min(start + self.shard, self.samples)}" for start in starts]


def known_parameters():
    """Return a dict: name -> `Parameter` of all parameters that can have a tolerance."""
    return tolerated.geometry_parameters() | tolerated.pair_parameters()
