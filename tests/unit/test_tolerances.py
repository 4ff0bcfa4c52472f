"""Check distributions of tolerances, designs sampled from them, and quality classes of gears."""

import itertools
import math

import numpy as np
import pytest
import yaml
from scipy import stats

import gearlib
from gearlib.parameters import declared_parameters
from gearlib.uncertainty import distributions
from gearlib.uncertainty.designs import Designs, StageDesign
from gearlib.uncertainty.quality_classes import by_class, distance_limits, thickness_limits
from tests.geometry.stages import fzg_c
from tests.paper import PAPER_PAIR

#: Parameters that may have tolerances. The parameter "free" has neither a unit nor limits.
PARAMETERS = declared_parameters(gearlib.GearPair) | {"free": None}
DAMPED_PAIR = PAPER_PAIR.replace(material_damping=3953.7)


def sample_tolerances(tolerances, count=4096):
    """Return the joint distribution of tolerances and a sample of it, (count, parameters)."""
    joint = distributions.read_tolerances(tolerances, PARAMETERS)
    # Half a step of 30 bits avoids the Sobol' point 0, whose normal quantile is infinite.
    points = stats.qmc.Sobol(len(joint.names), rng=1).random(count) + 2.0**-31
    return joint, joint.values(points)


@pytest.mark.parametrize(
    "tolerance, reference_distribution",
    [
        ({"mean": 3.0, "std": 0.5}, stats.norm(3.0, 0.5)),
        ({"min": 2.0, "max": 5.0}, stats.uniform(2.0, 3.0)),
        ({"nominal": 3.0, "upper": 0.5, "lower": -1.0}, stats.uniform(2.0, 1.5)),
        ({"distribution": "lognorm", "s": 0.2, "scale": 3.0}, stats.lognorm(0.2, scale=3.0)),
    ],
)
def test_tolerance_distributions_match_scipy(tolerance, reference_distribution):
    """Quantiles and samples of a tolerance must match the corresponding scipy distribution."""
    joint, values = sample_tolerances({"free": tolerance})
    (marginal,) = joint.marginals.values()
    probabilities = np.linspace(0.01, 0.99, 99)
    assert np.allclose(
        marginal.distribution.ppf(probabilities),
        reference_distribution.ppf(probabilities),
        rtol=1e-12,
    )
    # For uniform Sobol' points the Kolmogorov-Smirnov distance is about 1 / 4096.
    assert stats.kstest(values[:, 0], reference_distribution.cdf).statistic < 1e-3
    # The centre is the nominal value, even if the limits are not symmetric about it.
    assert joint.centres == [tolerance.get("nominal", marginal.centre)]


@pytest.mark.parametrize(
    ("tolerance", "expected"),
    # For uniform values Pearson's correlation is 6 / pi asin(rho / 2), for normal ones rho.
    [
        ({"min": 1e-9, "max": 1.0}, 6.0 / math.pi * math.asin(0.6 / 2.0)),
        ({"mean": 9.0, "std": 2.0}, 0.6),
    ],
)
def test_correlations_of_a_gaussian_copula_match_closed_forms(tolerance, expected):
    """Correlations must follow from the correlation of the underlying normal variables, 0.6."""
    correlations = [["free", "load", 0.6]]
    _, values = sample_tolerances(
        {"free": tolerance, "load": tolerance, "correlations": correlations}
    )
    # The tolerance allows for the sampling error of 4096 points.
    assert abs(np.corrcoef(values.T)[0, 1] - expected) < 2e-3


#: Invalid tolerances | pattern of the error message.
INVALID_TOLERANCES = """
{} | tolerances = {} is not allowed: it must be a mapping of parameters
{mass: {min: 1, max: 2}} | tolerances = 'mass' is not allowed: it must be one of
{load: {min: 2.0, max: 1.0}} | tolerances.load.max = 1.0 .* must be > min = 2.0
{load: {mean: 2.0, std: 0.0}} | tolerances.load.std = 0.0 .* > 0, of mean = 2.0
{load: {min: -2.0, max: 1.0}} | tolerances.load.min = -2.0 .* > 0
{load: {mean: -2.0, std: 1.0}} | tolerances.load.mean = -2.0 .* must be .* > 0
{load: {mean: 2.0, std: 5 kN}} | load.std = '5 kN' .* or a percentage such as '5 %'
{load: {std: 1.0}} | tolerances.load.mean is missing
{load: {nominal: 2.0, upper: -1 %, lower: 1 %}} | upper = '-1 %' .* > lower = '1 %', of nominal = 2
{load: {mean: 2.0}} | tolerances.load = {'mean': 2.0} .* must be one of {mean, std}
{load: 3.0} | tolerances.load = 3.0 .* must be one of {mean, std}
{load: {mean: 2 kN, std: 1.0}} | tolerances.load.mean = '2 kN' .* a finite number
{load: {distribution: binom}} | load.distribution = 'binom' .* continuous
{load: {distribution: lognorm}} | tolerances.load.s is missing
{load: {distribution: norm, mu: 1.0}} | load.mu is not allowed: the param
{load: {distribution: cauchy, loc: 9.0}} | {'distribution': 'cauchy', 'loc': 9.0} .* finite mean
{load: {distribution: uniform, loc: -9.0}} | centre of tolerances.load = -8.5 .* must be .* > 0
{load: {min: 1, max: 2}, correlations: [[load, load, 0.5]]} | two different parameters
{load: {min: 1, max: 2}, correlations: [[load, free, 0.5]]} | correlations\\[0\\] = 'free'
"""


@pytest.mark.parametrize("row", INVALID_TOLERANCES.strip().splitlines())
def test_invalid_tolerances_are_refused_in_one_sentence(row):
    tolerances, message = row.split(" | ")
    with pytest.raises(ValueError, match=message):
        distributions.read_tolerances(yaml.safe_load(tolerances), PARAMETERS)


TWO_DAMPING_TOLERANCES = {
    "damping_ratio": {"min": 0.03, "max": 0.05},
    "material_damping": {"min": 1e3, "max": 2e3},
}
LOAD_TOLERANCE = {"load": {"min": 3000.0, "max": 3100.0}}


@pytest.mark.parametrize(
    "model, tolerances, message",
    [
        (
            DAMPED_PAIR,
            TWO_DAMPING_TOLERANCES,
            "tolerances.material_damping is not allowed together with tolerances.damping_ratio",
        ),
        (lambda load, mass: DAMPED_PAIR, LOAD_TOLERANCE, "tolerances.mass is missing"),
        (lambda load, /: DAMPED_PAIR, LOAD_TOLERANCE, "with arguments that have names"),
        (lambda **changes: DAMPED_PAIR, LOAD_TOLERANCE, "with arguments that have names"),
        (
            lambda load: None,
            LOAD_TOLERANCE,
            "value of the function = None .* a model such as GearPair",
        ),
        (7, LOAD_TOLERANCE, "model = 7 is not allowed"),
    ],
)
def test_tolerances_that_do_not_suit_the_model_are_refused(model, tolerances, message):
    with pytest.raises(ValueError, match=message):
        Designs(model, tolerances)


def test_each_invalid_sample_reports_its_reason():
    """Samples for which the function raises an error or returns no model must state which.

    Loads are between 3000 and 3100 N.
    """

    def build_pair(load):
        """Raise an error for small loads, return None for large ones and a pair otherwise."""
        if load <= 3030.0:
            raise ZeroDivisionError
        return DAMPED_PAIR.replace(load=load) if load <= 3070.0 else None

    options = {"n": 4, "speeds": [2000.0], "directions": ["up"]}
    scatter = gearlib.scatter(build_pair, LOAD_TOLERANCE, ("jump_up",), **options)
    refusals = scatter.refusal.values
    assert ((scatter.jump_up_status == -1) == (refusals != "")).all() and (refusals == "").any()
    assert any("ZeroDivisionError in the function" in refusal for refusal in refusals)
    assert any("value of the function = None" in refusal for refusal in refusals)


@pytest.mark.parametrize(
    ("diameter", "designation", "limits"),
    [
        # The first row is the example of the standard and of textbooks.
        (0.1, "27cd", (-170, -70)),
        (0.1, "cd25", (-110, -70)),
        (0.05, "26 cd", (-104, -54)),
        (0.0501, "30a", (-580, -180)),
        (0.3, "26bc", (-290, -190)),
    ],
)
def test_thickness_allowances_match_din_3967(diameter, designation, limits):
    assert np.allclose(thickness_limits(diameter, designation), np.array(limits) * 1e-6, rtol=1e-12)


def test_grades_of_centre_distances_follow_the_formula_of_iso_286():
    """Tolerances must be rounded multiples of the factor i = 0.45 D^(1/3) + 0.001 D, in um.

    D is the geometric mean, mm, of both ends of the range to which a distance belongs.
    """
    assert np.allclose(distance_limits(0.0915, "js7"), (-17.5e-6, 17.5e-6))
    range_ends = 10, 18, 30, 50, 80, 120, 180, 250, 315, 400, 500
    multiples_by_grade = {5: 7, 6: 10, 7: 16, 8: 25, 9: 40, 10: 64, 11: 100}
    for low, high in itertools.pairwise(range_ends):
        mean_diameter = math.sqrt(low * high)
        factor = 0.45 * mean_diameter ** (1 / 3) + 0.001 * mean_diameter
        for grade, multiple in multiples_by_grade.items():
            # A distance slightly below the upper end belongs to this range.
            _, upper_limit = distance_limits(1e-3 * high - 1e-9, f"js{grade}")
            tolerance = round(2e6 * upper_limit, 6)
            # The standard rounds to 1, 5 or 10 um, sometimes not to the nearest step.
            step = 1 if tolerance < 100 else 5 if tolerance < 200 else 10
            assert tolerance == pytest.approx(round(tolerance / step) * step)
            rounding = (0.75 if tolerance < 40 else 1.2) * step
            assert abs(tolerance - multiple * factor) <= rounding, (high, grade)


def test_tooth_thicknesses_follow_the_series_of_din_3967():
    """Allowances and tolerances of the tables must follow geometric series, up to rounding.

    A misprint would violate them. A designation such as "21cd" has the number of a tolerance and
    the letters of an allowance.
    """
    letters = "a ab b bc c cd d e f g".split()
    diameters = (0.01, 0.05, 0.125, 0.28, 0.56, 1.0, 1.6, 2.5)  # upper ends of the ranges, m
    table = [[thickness_limits(d, f"21{letter}")[1] for letter in letters] for d in diameters]
    log_allowances = np.log(-1e6 * np.array(table))  # of allowances in um
    # An allowance is the product of a factor for the diameter and a factor for the letters. It is
    # rounded by at most 5 %, and above 65 um to multiples of 5 um.
    series = log_allowances.mean(0) + log_allowances.mean(1)[:, None] - log_allowances.mean()
    assert np.abs(log_allowances - series).max() < 0.05
    allowances = np.exp(log_allowances)
    assert (np.round(allowances[allowances > 65]) % 5 == 0).all()
    limits = [[thickness_limits(d, f"{number}h") for number in range(21, 31)] for d in diameters]
    # The letter h stands for an allowance of 0.
    assert not np.array(limits)[..., 1].any()
    tolerances = np.round(1e6 * np.ptp(limits, axis=2), 6)
    # Tolerances are rounded preferred numbers R 10 of ISO 3, ten per decade, and above 25 um
    # multiples of 10 um. Tolerances of successive numbers are two steps apart.
    preferred_numbers = 10.0 ** (np.round(10.0 * np.log10(tolerances)) / 10.0)
    assert (np.abs(tolerances - preferred_numbers) < 0.06 * preferred_numbers).all()
    assert (tolerances[tolerances > 25] % 10 == 0).all()
    assert np.diff(np.log10(tolerances)) == pytest.approx(0.2, abs=0.05)


def test_backlash_and_deviation_scatter_by_the_classes_of_gears():
    """Sampled backlashes and deviations must lie within the limits of their tolerance classes."""
    stage = fzg_c(quality=7)
    tolerances = by_class(stage, thickness=("26cd", "26c"), centre_distance="js8", form=True)
    gears = StageDesign(stage, torque=302.0, damping_ratio=0.06, keep_backlash=False)
    designs = Designs(gears, tolerances | {"torque": {"mean": 302.0, "std": 10.0}})
    assert designs.units("pinion.thickness_allowance")[0] == "m"
    models = [designs.model(row) for row in designs.values(designs.points(0, 16))]
    backlashes = [model.backlash for model in models]
    # Allowances make the teeth thinner by 139 to 199 um in sum, and the tolerance of the centre
    # distance changes the backlash further.
    assert 100e-6 < min(backlashes) < max(backlashes) < 280e-6
    max_amplitude = stage.pinion.form_deviation / 2.0
    amplitudes = [abs(model.deviation.cosines[0]) for model in models]
    assert 0.5 * max_amplitude < max(amplitudes) <= max_amplitude
