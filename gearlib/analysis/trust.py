"""`trust`: chaos or artefact? The motion at one tuning is computed by several methods.

The steady state of a damped mesh does not depend on the method and length of the simulation or on
small changes of the initial state. `trust` repeats a simulation over a longer time, from a
disturbed state, by another method, with another tolerance and, if the stiffness is a truncated
Fourier series, with more harmonics. It also computes the largest Lyapunov exponent of the motion.
The label of the motion follows from these rules:

=================  ===========================================================================
label              rule
=================  ===========================================================================
periodic           the longer run and all other settled runs repeat after the same number of mesh
                   periods, perturbations decay, and the extrema of all runs agree to at least
                   `MIN_DIGITS` digits
unbounded          the motion exceeds `Model.bound`, or it is large and still grows, and no run
                   repeats
chaotic            perturbations grow: the exponent exceeds three times its uncertainty, and the
                   growth exceeds linear growth
quasi-periodic     no run repeats, and perturbations neither grow nor decay exponentially
undecided          everything else; the message says why and what to do
=================  ===========================================================================
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import xarray as xr

from gearlib import checks, integrators
from gearlib.analysis import lyapunov
from gearlib.data import status
from gearlib.data.result import evaluate_on_grid, make_result
from gearlib.engines import orbit
from gearlib.models.profiles import Fourier
from gearlib.parameters import Count, Positive, checked
from gearlib.progress import TimeLimit, with_progress_bar
from gearlib.runs.run_arguments import MaxSeconds, Tuning
from gearlib.runs.simulation import run

LABELS = ("periodic", "quasi-periodic", "chaotic", "undecided", "unbounded")

#: Number of decimal digits to which the extrema of all runs must agree if the motion is periodic.
MIN_DIGITS = 4
#: Largest number of digits in a dataset; more digits would depend on rounding errors.
_MAX_DIGITS = 10.0
#: Perturbations decay if the logarithm of their total growth is below this.
_DECAY_THRESHOLD = -3.0


@dataclass(frozen=True)
class Trust:
    """Classification of the motion at one tuning, with the runs and the exponent it is based on."""

    label: str  #: one of `LABELS`
    message: str  #: the reason in one sentence
    period: int  #: in mesh periods; 0 unless periodic
    digits: float  #: decimal digits to which the extrema of all runs agree; NaN unless periodic
    exponent: float  #: largest Lyapunov exponent per mesh period; NaN if unbounded
    uncertainty: float  #: standard error of the exponent
    runs: xr.Dataset  #: displacement_max, displacement_min, period and status of each run


@checked
def trust(
    model,
    tuning: Tuning,
    *,
    periods: Count = 2000,
    record_periods: Count = 32,
    initial_state=(0.0, 0.0),
    disturbance: Positive = 1e-3,
    exponent_periods: lyapunov.ExponentPeriods = 4000,
    max_seconds: MaxSeconds = None,
):
    """Classify the motion at one tuning by runs with several methods and settings.

    Parameters
    ----------
    model : GearPair, OneDegreePair, SixDegreePair or DeadZoneOscillator
        The model whose motion is classified.
    tuning : float
        Ratio of mesh frequency to mean eigenfrequency, nu.
    periods, record_periods : int
        Number of mesh periods of a run, and of the record at its end; the longer run has four times
        as many mesh periods. With run-out, at least one period of the run-out is recorded, and
        `periods` must exceed the transient plus two periods of the run-out.
    initial_state : tuple of float
        Displacement in units of the static deflection and dx/dtau at tau = 0.
    disturbance : float
        Change of the initial displacement in the disturbed run, in units of the static deflection.
    exponent_periods : int
        Number of mesh periods over which the Lyapunov exponent is averaged, after a transient of
        `periods` mesh periods.
    max_seconds : float, optional
        Time limit in seconds, after which no further run begins. The motion is then undecided, and
        the attribute `missing` of the runs lists the omitted runs; see `gearlib.progress`.

    Returns
    -------
    Trust
        The label with its reason, the period, the exponent, and the runs that were compared.

    Raises
    ------
    ValueError
        If an argument is invalid; the message states its name, its value and what is allowed.
    """
    integrators.choose_method(model, None, None)
    allowed = f"an integer from 1 to {periods}"
    checks.require(record_periods <= periods, "record_periods", record_periods, allowed)
    record_periods = max(record_periods, min(model.repeats, periods))
    arguments = {"periods": periods, "record_periods": record_periods}
    arguments |= {"initial_state": initial_state, "samples_per_period": 1}
    initial_state = model.check_state(initial_state)
    limit = TimeLimit(max_seconds)
    names, methods, runs = [], [], []
    # Name, model and changed arguments of each run.
    cases = [
        ("as asked", model, {}),
        ("longer", model, {"periods": 4 * periods}),
        ("disturbed", model, {"initial_state": model.disturbed_state(initial_state, disturbance)}),
        *_comparison_cases(model),
    ]
    for name, case_model, changed_arguments in limit.iterate(
        with_progress_bar("runs", cases, len(cases))
    ):
        names.append(name)
        method, *_ = integrators.choose_method(case_model, changed_arguments.get("method"), None)
        methods.append(method)
        runs.append(run(case_model, tuning, **arguments | changed_arguments))
    missing = [name for name, *_ in cases[len(names) :]]
    if limit.is_over():
        missing.append("exponent")
    else:
        exponent = lyapunov.largest_exponent(
            model, tuning, state=initial_state, settle=periods, periods=exponent_periods
        )
    summaries = np.array([run.summary for run in runs])
    dims = ("run", "mesh")[: summaries.ndim - 1]
    data = {
        "displacement_max": (dims, summaries[..., orbit.X_MAX]),
        "displacement_min": (dims, summaries[..., orbit.X_MIN]),
        "period": ("run", [run.period for run in runs]),
        "status": ("run", [run.status for run in runs]),
    }
    attributes = {"tuning": tuning, "periods": periods, "disturbance": disturbance}
    attributes |= {
        "method": ", ".join(dict.fromkeys(methods)),
        "exponent_periods": exponent_periods,
    }
    table = make_result(
        "Runs of one point in several ways", model, data, {"run": names}, **attributes
    )
    table = limit.record_missing(table, missing)
    if missing:
        message = f"the time limit max_seconds left no time for: {', '.join(missing)}"
        return Trust("undecided", message, 0, math.nan, math.nan, math.nan, table)
    return classify_motion(table, exponent, model.repeats)


def classify_at_tunings(model: Any, tunings: Any, **options: Any) -> xr.Dataset:
    """Classify the motion of a model by `trust` at each tuning; return a dataset along ``tuning``.

    Tunings are ratios of mesh frequency to natural frequency. `options` are keyword arguments of
    `trust`, such as `periods`. The variable label is the index of the label in `LABELS` ("periodic"
    = 0, "quasi-periodic", "chaotic", "undecided", "unbounded"), with CF flags. The others are
    period, digits, exponent and uncertainty, as in the result of `trust`.
    """

    def variables(tuning: float) -> dict:
        """Classify the motion at one tuning; return {variable name: value} of the dataset."""
        motion = trust(model, tuning, **options)
        return {
            "label": np.int8(LABELS.index(motion.label)),
            "period": np.int32(motion.period),
            "digits": min(motion.digits, _MAX_DIGITS),
            "exponent": motion.exponent,
            "uncertainty": motion.uncertainty,
        }

    title = "Labels of the motion of a gear mesh"
    coords = {"tuning": np.asarray(tunings, float)}
    data = evaluate_on_grid({"tuning": tunings}, variables)
    dataset = make_result(title, model, data, coords, method="several", **options)
    dataset["label"].attrs |= status.flag_attributes(LABELS)
    return dataset


def _comparison_cases(model: Any) -> Iterator[tuple]:
    """Yield (name, model, changed arguments of `run`) of the runs that use different methods.

    The runs use the second of the automatic integration methods if two of them support the model,
    a tighter tolerance of the Taylor method, and twice as many harmonics if the mesh stiffness is a
    truncated Fourier series.
    """
    methods = [name for name in integrators.AUTOMATIC if integrators.METHODS[name].supports(model)]
    if len(methods) > 1:
        yield f"method {methods[1]}", model, {"method": methods[1]}
    if "taylor" in methods:
        yield "tolerance 1e-12", model, {"method": "taylor", "options": {"tolerance": 1e-12}}
    profile = model.profile
    if isinstance(profile, Fourier):
        finer = replace(model, profile=Fourier(2 * profile.harmonics))
        yield f"{2 * profile.harmonics} harmonics", finer, {}


def classify_motion(runs: xr.Dataset, exponent: lyapunov.Exponent, repeats: int = 1) -> Trust:
    """Classify a motion from several runs and its largest Lyapunov exponent.

    `runs` is a dataset over ``run`` with displacement_max, displacement_min, period (0 if the run
    does not repeat) and status. `repeats` is the period of the excitation in mesh periods.
    """
    label, message = _choose_label(runs, exponent, repeats)
    period, digits = 0, math.nan
    if label == "periodic":
        period, digits = int(runs.period.max()), _count_agreeing_digits(runs)
    value, uncertainty, *_ = exponent
    return Trust(label, message, period, digits, exponent=value, uncertainty=uncertainty, runs=runs)


def _choose_label(runs: xr.Dataset, exponent: lyapunov.Exponent, repeats: int) -> tuple:
    """Return the label of a motion and a message with the reason, by the first rule that applies.

    `runs` is a dataset over ``run`` with displacement extrema, period and status code, and
    `repeats` is the period of the excitation in mesh periods. The rules are, in this order:
    unbounded; undecided if some runs are unbounded or have failed; chaotic if perturbations grow;
    periodic if they decay and the runs agree; quasi-periodic if no run repeats.
    """
    names, status_codes = runs.run.values, runs.status.values
    overflowed = status_codes == status.OVERFLOW
    diverges = exponent.status == status.OVERFLOW
    periods = set(runs.period.values.tolist())  # 0 for a run that does not repeat
    if (diverges or overflowed.all()) and periods == {0}:
        return "unbounded", status.MESSAGES[status.OVERFLOW]
    variational = "the variational run"  # computes the exponent
    if diverges or overflowed.any():
        unbounded = ", ".join(names[overflowed]) or variational
        return "undecided", f"only some runs grow without bound: {unbounded}"
    failed = status_codes != status.OK
    if failed.any() or math.isnan(exponent.value):
        return "undecided", f"some runs failed: {', '.join(names[failed]) or variational}"
    if exponent.positive:
        growth_time = f"{1.0 / exponent.value:.3g} mesh periods"
        return "chaotic", f"perturbations grow by a factor of e every {growth_time}"
    if exponent.log_growth < _DECAY_THRESHOLD:
        return _label_stable_motion(runs, periods, repeats)
    reason = "perturbations neither grow nor decay exponentially"
    if periods == {0}:
        return "quasi-periodic", f"no run repeats, and {reason}"
    return "undecided", f"{reason}, but some run repeats: increase periods"


def _label_stable_motion(runs: xr.Dataset, periods: set, repeats: int) -> tuple[str, str]:
    """Return the label, "periodic" or "undecided", and its reason if perturbations decay.

    `runs` is a dataset over ``run`` with displacement extrema and period. `periods` is the set of
    the periods of all runs in mesh periods, 0 for a run that does not repeat. `repeats` is the
    period of the excitation in mesh periods.
    """
    if "longer" in runs.run and int(runs.period.sel(run="longer")):
        # The other runs need not have settled if their extrema agree with those of the longer run.
        periods = periods - {0}
    if periods == {0} or len(periods) > 1:
        message = "perturbations decay, but the runs do not repeat alike: increase periods"
        if repeats > 1:
            message += f" to more than the transient plus two run-out periods of {repeats} each"
        return "undecided", message
    digits = _count_agreeing_digits(runs)
    if digits < MIN_DIGITS:
        reason = "there are several attractors, or the period exceeds record_periods"
        agreement = f"their extrema agree to only {max(digits, 0.0):.1f} digits"
        return "undecided", f"the runs repeat, but {agreement}: {reason}; compare the runs"
    return "periodic", f"all runs agree to {digits:.1f} digits"


def _count_agreeing_digits(runs: xr.Dataset) -> float:
    """Return the number of decimal digits to which the displacement extrema of all runs agree.

    `runs` is a dataset over ``run`` with displacement_max and displacement_min. The number is
    -log10(largest difference / displacement range of the first run). It is negative if the
    difference exceeds the range.
    """
    maxima, minima = runs.displacement_max.values, runs.displacement_min.values
    displacement_range = np.maximum(maxima[0] - minima[0], np.finfo(float).tiny)
    spread = np.maximum(np.ptp(maxima, axis=0), np.ptp(minima, axis=0)) / displacement_range
    return -math.log10(max(np.max(spread), np.finfo(float).eps))
