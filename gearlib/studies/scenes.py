"""Simulate scenes, i.e. sets of similar cases, with the smallest model that is accurate enough.

The cases of a scene are run with every model. The change of a model is the largest difference of an
observable from any larger model. Differences of extrema of displacement or force are relative to
their range in the larger model; fractions of time and bounces per mesh period are compared
absolutely. The smallest model whose change is within the tolerance of the scene is chosen. The
model with truncated stiffness is compared with the rectangular stiffness but never chosen. If
rounding errors decide a run, it is replaced by runs from random initial states, whose changes must
all be within the tolerance.
"""

import math
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
import xarray as xr

from gearlib.data.status import flag_attributes
from gearlib.data.variables import add_metadata
from gearlib.models.one_degree_pair import OneDegreePair
from gearlib.models.pair import GearPair
from gearlib.models.profiles import Fourier
from gearlib.models.six_degrees import SixDegreePair
from gearlib.runs.simulation import simulate
from gearlib.studies import many_starts

#: Names of the models from the smallest to the largest, and of the model with truncated stiffness.
MODELS = ("pair", "six_degrees_plain", "six_degrees")
TRUNCATED_MODEL = "pair_harmonics"

#: Table entry in place of a number that depends on the initial state.
DIFFERS = "differs"
#: Relative changes below this value are rounding errors.
_MIN_CHANGE = 1e-9
#: Rounding errors decide a motion if a tiny perturbation changes its extrema by more than this.
_MAX_ROUNDING_CHANGE = 1e-3
_DISPLACEMENTS = ("displacement_max", "displacement_min")
_FORCES = ("dynamic_force_max", "dynamic_force_min")
#: Segments of constant stiffness in a mesh period, which starts in the middle of double contact.
_STIFFNESS_SEGMENTS = 3
_FLAGS = flag_attributes(("unsettled", "free_of_rounding"))


def build_model(name: str, pair: GearPair, six_degrees: dict, harmonics: int | None = None) -> Any:
    """Build the model called `name`, one of `MODELS` or `TRUNCATED_MODEL`.

    `pair` is the `GearPair` of the case, and `six_degrees` has further arguments of
    `SixDegreePair`. The model "six_degrees_plain" has neither friction nor run-out. `harmonics` is
    the number of harmonics of the truncated stiffness.
    """
    if name == "pair":
        return pair
    if name == TRUNCATED_MODEL:
        return OneDegreePair(pair=pair, profile=Fourier(harmonics))
    if name == "six_degrees_plain":
        six_degrees = six_degrees | {"friction": (0.0, 0.0), "eccentricities": (0.0, 0.0)}
    return SixDegreePair(pair=pair, **six_degrees)


def simulate_representative_runs(
    model: Any, tuning: float, run: dict, settings: dict
) -> tuple[xr.Dataset, list[xr.Dataset]]:
    """Run a model from its initial state and, if rounding errors decide it, from random states.

    A run with a perturbed initial state shows whether rounding errors decide the motion. Return the
    nominal run, and a list with either only this run or the runs from random states. `tuning` is
    mesh frequency over natural frequency, `run` has arguments of `gearlib.simulate`, and `settings`
    has starts (number), seed and spread of the random states.
    """
    initial_state = np.asarray(run.get("initial_state", (0.0, 0.0)), float)

    def run_from(state: np.ndarray, **options: Any) -> xr.Dataset:
        """Run the model from an initial state; `options` override arguments in `run`."""
        start = tuple(map(float, state))
        return simulate(model, tuning, **run | options | {"initial_state": start})

    nominal_run = run_from(initial_state, until_settled=True)
    perturbed_run = run_from(many_starts.perturb_state(initial_state), samples_per_period=1)
    names = (*_DISPLACEMENTS, *_FORCES)
    change = max(abs(float(nominal_run[name] - perturbed_run[name])) for name in names)
    if change < _MAX_ROUNDING_CHANGE:
        return nominal_run, [nominal_run]
    states = many_starts.random_initial_states(model, initial_state, settings)
    return nominal_run, [run_from(state, samples_per_period=1) for state in states]


def simulate_scene_with_chosen_model(
    comparison, cases, six_degrees: dict, run: dict, starts: dict
) -> xr.Dataset:
    """Simulate a set of cases (a scene) with the model that a comparison of models has chosen.

    `comparison` is a result of `compare_models`. The other arguments and the dataset are described
    in `simulate_scene`: `cases` are dicts with title, tuning and pair, `six_degrees` has arguments
    of `SixDegreePair`, `run` of `gearlib.simulate`, and `starts` describes random initial states.
    """
    return simulate_scene(cases, comparison.chosen.item(), six_degrees, run, starts)


def simulate_scene(
    cases: Sequence[dict], model: str, six_degrees: dict, run: dict, starts: dict
) -> xr.Dataset:
    """Simulate a set of cases (a scene); return time histories and summaries of all cases.

    A case is a dict with title, tuning (mesh frequency over natural frequency) and pair (a
    `GearPair`). `model` is one of `MODELS`, `six_degrees` has further arguments of `SixDegreePair`,
    and `run` has arguments of `gearlib.simulate`. The dataset has the dimensions case and phase (of
    the mesh). free_of_rounding is 1 if a run does not depend on rounding errors. Other runs are
    repeated from random initial states; `starts` has their number (key starts), seed and spread.
    losing_share is the fraction of initial states from which contact is lost.
    """
    histories = []
    for case in cases:
        case_model = build_model(model, case["pair"], six_degrees)
        nominal_run, runs = simulate_representative_runs(case_model, case["tuning"], run, starts)
        history = nominal_run.drop_dims("event")
        history["free_of_rounding"] = (), np.int8(runs[0] is nominal_run), _FLAGS
        history["losing_share"] = (), np.mean([float(record.bounces) > 0.0 for record in runs])
        phase = (history.phase - history.phase[0]).assign_attrs(history.phase.attrs)
        histories.append(add_metadata(history.assign_coords(phase=phase), case_model))
    titles = xr.IndexVariable("case", [case["title"] for case in cases])
    options = {"data_vars": "all", "coords": "minimal", "compat": "equals", "join": "exact"}
    dataset = xr.concat(histories, titles, combine_attrs="drop_conflicts", **options)
    return add_metadata(dataset.assign(model=model))


def compare_models(
    cases: Sequence[dict], criteria: dict, six_degrees: dict, harmonics: int, run: dict, starts
) -> xr.Dataset:
    """Run a set of cases (a scene) with every model, and choose the smallest accurate model.

    A model is accurate if its change, the largest difference of an observable from any larger
    model, is within a tolerance. `criteria` has the keys observables (names), tolerance, and
    candidates (the models that may be chosen, from the smallest to the largest). `harmonics` is the
    number of harmonics of the truncated stiffness. The other arguments are described in
    `simulate_scene`. The dataset has the observables and, for each model, the change (NaN for the
    largest model) and the cost, as medians and ranges over initial states; and the name of the
    chosen model. free_of_rounding and change_free_of_rounding are 1 for runs and changes that do
    not depend on rounding errors.
    """
    names = [*MODELS, TRUNCATED_MODEL]
    observables = criteria["observables"]
    values = np.empty((starts["starts"], len(names), len(cases), len(observables)))
    scales = np.ones_like(values)
    costs = np.empty(values.shape[:-1])
    is_reliable = np.empty(costs.shape[1:], bool)
    for i, j in np.ndindex(is_reliable.shape):
        tuning = cases[j]["tuning"]
        model = build_model(names[i], cases[j]["pair"], six_degrees, harmonics)
        first_run, runs = simulate_representative_runs(model, tuning, run, starts)
        is_reliable[i, j] = runs[0] is first_run
        # A single representative run is broadcast over all starts.
        values[:, i, j] = [[float(record[name]) for name in observables] for record in runs]
        scales[:, i, j] = [[_change_scale(record, name) for name in observables] for record in runs]
        costs[:, i, j] = [_estimate_cost(model, tuning, record, run) for record in runs]
    change, is_change_reliable = _compute_relative_changes(values, scales, is_reliable)
    lowest, highest = change.min(axis=0), change.max(axis=0)
    # The maximum is increased by the range over the starts, as a margin for other initial states.
    with np.errstate(invalid="ignore"):
        highest = np.where(is_change_reliable, highest, 2.0 * highest - lowest)
    candidates, tolerance = criteria["candidates"], criteria["tolerance"]
    accurate = [name for name in candidates[:-1] if highest[names.index(name)] <= tolerance]
    by_start = xr.Dataset(
        {
            "value": (("start", "model", "case", "observable"), values),
            "change": (("start", "model"), change),
            "cost": (("start", "model"), costs.mean(axis=2)),
        }
    )
    data = many_starts.median_and_range(by_start, [*by_start]) | {
        "free_of_rounding": (("model", "case"), is_reliable.astype(np.int8), _FLAGS),
        "change_free_of_rounding": ("model", is_change_reliable.astype(np.int8), _FLAGS),
        "chosen": accurate[0] if accurate else candidates[-1],
        "tolerance": float(tolerance),
        "harmonics": harmonics,
    }
    titles = [case["title"] for case in cases]
    coords = {"model": names, "case": titles, "observable": list(observables)}
    # The attributes of all runs are equal, except for those that describe the model.
    model_attrs = ("gear_pair", "parameters")
    attrs = {name: text for name, text in first_run.attrs.items() if name not in model_attrs}
    attrs["title"] = "Comparison of models for one scene"
    return add_metadata(xr.Dataset(data, coords, attrs))


def _compute_relative_changes(
    values: np.ndarray, scales: np.ndarray, is_reliable: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Compute the changes of the models, (starts, models), and a mask of reliable ones, (models,).

    The change of a model is the largest difference of an observable from any larger model, relative
    to the scale of the observable. It is NaN for the largest model, and reliable if no run depends
    on rounding errors. `values` and `scales` of the observables have the shape (starts, models,
    cases, observables). The mask `is_reliable`, (models, cases), is true for runs that do not
    depend on rounding errors.
    """
    change = np.full(values.shape[:2], np.nan)
    is_change_reliable = np.asarray(is_reliable.all(axis=1))
    truncated = len(MODELS)  # index of the model with truncated stiffness, the last one
    # Model index -> indices of the models with which the model is compared.
    compared_models = {i: [*range(i + 1, truncated)] for i in range(truncated - 1)}
    compared_models[truncated] = [0]  # an approximation of the smallest model
    for i, references in compared_models.items():
        difference = np.abs(values[:, [i]] - values[:, references]) / scales[:, references]
        # Runs that stopped early exceed any tolerance.
        difference[np.isnan(difference)] = math.inf
        change[:, i] = difference.max(axis=(1, 2, 3))
        is_change_reliable[i] &= is_reliable[references].all()
    change[change < _MIN_CHANGE] = 0.0  # such changes are rounding errors
    return change, is_change_reliable


def _change_scale(run: xr.Dataset, observable: str) -> float:
    """Return the scale of differences of an observable between two models.

    It is the range of the displacement or the force for their extrema, and 1 for other observables.
    `run` is a result of `gearlib.simulate`.
    """
    if observable in _DISPLACEMENTS:
        return float(run.displacement_max - run.displacement_min)
    if observable in _FORCES:
        return float(run.dynamic_force_max - run.dynamic_force_min)
    return 1.0


def _estimate_cost(model: Any, tuning: float, record: xr.Dataset, run: dict) -> float:
    """Estimate the cost of a run: the number of state components computed per mesh period.

    `record` is a result of `gearlib.simulate` with the arguments `run` at a tuning (mesh frequency
    over natural frequency). Closed forms compute the state once per piece (a fixed part of the mesh
    period) and once per arc (between contact events or changes of stiffness). The cost of Taylor
    steps depends on rounding errors, so it is rounded to 1, 2 or 5 times a power of ten.
    """
    propagator = model.propagator(tuning)
    evaluations = int(record.evaluations)  # 0 if the solution has a closed form
    if not evaluations:
        # Contact events divide the segments of constant stiffness.
        arcs = record.event.size / run["record_periods"] + _STIFFNESS_SEGMENTS
        return propagator.components * (propagator.segment_count + arcs)
    cost = propagator.components * evaluations / run["periods"]
    power = 10.0 ** math.floor(math.log10(cost))
    rounded_costs = (digit * power for digit in (1, 2, 5, 10))
    return min(rounded_costs, key=lambda rounded: abs(math.log(rounded / cost)))


def table_rows(comparisons: Sequence[xr.Dataset], scenes: Sequence[str]) -> Iterator[list]:
    """Yield the rows of the table of model comparisons, beginning with the column names.

    `comparisons` are datasets from `compare_models`, one for each of the `scenes` (names of sets of
    cases). Each model has one row per scene. Numbers that depend on rounding errors are replaced by
    the word `DIFFERS`.
    """
    yield ["scene", "model", "change", "tolerance", "cost", "chosen"]
    for scene_name, comparison in zip(scenes, comparisons, strict=True):
        for i, name in enumerate(comparison.model.values):
            is_reliable = bool(comparison.change_free_of_rounding[i])
            numbers = []
            for value in (float(comparison.change[i]), float(comparison.cost[i])):
                is_printed = is_reliable or math.isnan(value)
                numbers.append(f"{value:.4g}" if is_printed else DIFFERS)
            change, cost = numbers
            chosen = "yes" if name == comparison.chosen.item() else "no"
            yield [scene_name, name, change, f"{float(comparison.tolerance):g}", cost, chosen]
