"""`trust`: chaos or artefact? The motion at one tuning is computed by several methods.

The steady state of a damped mesh does not depend on the method and length of the run or on small
changes of the initial state. `trust` repeats a run for a longer time, from a disturbed state, by
another method, with another tolerance and, for a truncated stiffness, with more harmonics, and
computes the largest Lyapunov exponent of the motion. Its label follows from these rules:

=================  ===========================================================================
label              rule
=================  ===========================================================================
periodic           the longer run, and all others that have settled, repeat after the same number
                   of mesh periods; perturbations decay, and the extrema of all runs agree in
                   at least `MIN_DIGITS` digits
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
from gearlib.data.result import result, stacked
from gearlib.engines import orbit
from gearlib.models.profiles import Fourier
from gearlib.parameters import Count, Positive, checked
from gearlib.progress import TimeLimit, with_progress_bar
from gearlib.runs.run_arguments import MaxSeconds, Tuning
from gearlib.runs.simulation import run

LABELS = ("periodic", "quasi-periodic", "chaotic", "undecided", "unbounded")

#: Decimal digits in which the extrema of all runs must agree if the motion is periodic.
MIN_DIGITS = 4
#: Largest number of digits in a scan: more would depend on rounding errors.
_MAX_DIGITS = 10.0
#: Perturbations decay if the logarithm of their total growth is below this.
_DECAY_THRESHOLD = -3.0


@dataclass(frozen=True)
class Trust:
    """Classification of the motion at one tuning, with the runs and the exponent behind it."""

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
        Mesh periods of a run, and of the record at its end; the longer run has four times as many
        mesh periods. With run-out, at least one period of the run-out is recorded, and `periods`
        must exceed the transient and two periods of the run-out.
    initial_state : tuple of float
        Displacement in static deflections and dx/dtau at tau = 0.
    disturbance : float
        Change of the initial displacement in the disturbed run, in static deflections.
    exponent_periods : int
        Mesh periods over which the Lyapunov exponent is averaged, after a transient of `periods`.
    max_seconds : float, optional
        Seconds after which no other run begins: the motion is then undecided, and the attribute
        `missing` of the runs lists the runs that were left out, see `gearlib.progress`.

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
    cases = [  # (name, model, changed arguments) of each run
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
    table = result("Runs of one point in several ways", model, data, {"run": names}, **attributes)
    table = limit.record_missing(table, missing)
    if missing:
        message = f"the time of max_seconds ended before: {', '.join(missing)}"
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
    data = stacked({"tuning": tunings}, variables)
    dataset = result(title, model, data, coords, method="several", **options)
    dataset["label"].attrs |= status.flags_of(LABELS)
    return dataset


def _comparison_cases(model: Any) -> Iterator[tuple]:
    """Yield (name, model, changed arguments of `run`) of each run for comparison by another method.

    A run uses the second of the automatic integration methods, if two of them support the model; a
    finer tolerance of the Taylor method; or, if the mesh stiffness is a truncated Fourier series,
    twice as many harmonics.
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

    `runs` is a dataset along ``run`` with displacement_max, displacement_min, period (0 if the run
    does not repeat) and status of each run, and `repeats` is the period of the excitation in mesh
    periods.
    """
    label, message = _choose_label(runs, exponent, repeats)
    period, digits = 0, math.nan
    if label == "periodic":
        period, digits = int(runs.period.max()), _count_agreeing_digits(runs)
    value, uncertainty, *_ = exponent
    return Trust(label, message, period, digits, exponent=value, uncertainty=uncertainty, runs=runs)


def _choose_label(runs: xr.Dataset, exponent: lyapunov.Exponent, repeats: int) -> tuple:
    """Return (label, message) of a motion by the first rule that applies.

    `runs` is a dataset along ``run`` with displacement extrema, period and status code of each run,
    and `repeats` the period of the excitation in mesh periods. The rules, in this order: unbounded,
    undecided if runs disagree about this or have failed, chaotic if perturbations grow, periodic if
    they decay and the runs agree, quasi-periodic if no run repeats.
    """
    names, status_codes = runs.run.values, runs.status.values
    overflowed = status_codes == status.OVERFLOW
    diverges = exponent.status == status.OVERFLOW
    periods = set(runs.period.values.tolist())  # 0 for a run that does not repeat
    if (diverges or overflowed.all()) and periods == {0}:
        return "unbounded", status.MESSAGES[status.OVERFLOW]
    # The run that computes the exponent, for messages.
    variational = "the variational run"
    if diverges or overflowed.any():
        unbounded = ", ".join(names[overflowed]) or variational
        return "undecided", f"some runs grow without bound, others do not: {unbounded}"
    failed = status_codes != status.OK
    if failed.any() or math.isnan(exponent.value):
        return "undecided", f"failed runs: {', '.join(names[failed]) or variational}"
    if exponent.positive:
        length = f"{1.0 / exponent.value:.3g} mesh periods"
        return "chaotic", f"perturbations grow by a factor e every {length}"
    if exponent.log_growth < _DECAY_THRESHOLD:
        return _label_stable_motion(runs, periods, repeats)
    neither = "perturbations neither grow nor decay"
    if periods == {0}:
        return "quasi-periodic", f"no run repeats; {neither} exponentially"
    return "undecided", f"{neither}, yet some run repeats: run more periods"


def _label_stable_motion(runs: xr.Dataset, periods: set, repeats: int) -> tuple[str, str]:
    """Return (label, message) of a motion whose perturbations decay: "periodic" or "undecided".

    `runs` is a dataset along ``run`` with displacement extrema and period of each run. `periods`
    are the different periods of the runs in mesh periods, 0 for a run that does not repeat, and
    `repeats` is the period of the excitation in mesh periods.
    """
    if "longer" in runs.run and int(runs.period.sel(run="longer")):
        # The other runs need not have settled yet, if their extrema are those of the longer run.
        periods = periods - {0}
    if periods == {0} or len(periods) > 1:
        message = "perturbations decay, but not all runs repeat: run more periods to settle"
        if repeats > 1:
            message += f", and beyond that two repeats of the run-out, of {repeats} periods each"
        return "undecided", message
    digits = _count_agreeing_digits(runs)
    if digits < MIN_DIGITS:
        reason = "more than one orbit attracts, or its period is more than record_periods"
        agreement = f"their extrema agree in {max(digits, 0.0):.1f} digits only"
        return "undecided", f"every run repeats, but {agreement}: {reason}; see the runs"
    return "periodic", f"all runs agree in {digits:.1f} digits"


def _count_agreeing_digits(runs: xr.Dataset) -> float:
    """Return the number of decimal digits in which the displacement extrema of all runs agree.

    `runs` is a dataset along ``run`` with displacement_max and displacement_min. The number is
    minus the decimal logarithm of the largest difference over the displacement range of the first
    run, so it is negative if the difference is larger than the range.
    """
    maxima, minima = runs.displacement_max.values, runs.displacement_min.values
    displacement_range = np.maximum(maxima[0] - minima[0], np.finfo(float).tiny)
    spread = np.maximum(np.ptp(maxima, axis=0), np.ptp(minima, axis=0)) / displacement_range
    return -math.log10(max(np.max(spread), np.finfo(float).eps))
