"""Compute basins of attraction, bifurcation diagrams with exponents, and Poincare sections."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import xarray as xr

from gearlib.analysis import lyapunov
from gearlib.analysis.global_dynamics.attractors import UNDECIDED
from gearlib.analysis.global_dynamics.basins import KIND_FLAGS, basin_stability, basins
from gearlib.analysis.global_dynamics.poincare import bifurcation_diagram, poincare_section
from gearlib.analysis.lyapunov import are_sensitive_to_rounding, largest_exponent
from gearlib.data import status
from gearlib.data.variables import add_metadata
from gearlib.models.pair import GearPair
from gearlib.runs.sweeping import WARM_STARTED

#: Fill values for cases with fewer attractors than others.
_FILL_VALUES = {
    "basin": -1,
    "attractor_kind": UNDECIDED,
    "period": 0,
    "contact_pattern": "",
    "grazing": 0,
}

#: Codes of the flag "chaotic"; regular motions have the code 0.
_CHAOTIC_FLAG, _UNDECIDED_FLAG = 1, 2


def _join_cases(datasets: Sequence, cases: Sequence[dict], **options: Any) -> xr.Dataset:
    """Concatenate one dataset per case along "case", labelled with the titles of the cases.

    A case is a dict with the key title. The result has the attributes of the first dataset.
    `options` are further arguments of `xarray.concat`.
    """
    titles = xr.IndexVariable("case", [case["title"] for case in cases])
    data = xr.concat(datasets, titles, data_vars="all", combine_attrs="drop", **options)
    return add_metadata(data.assign_attrs(datasets[0].attrs))


def compute_basins(cases: Sequence[dict], settings: dict, threads: int | None = None) -> xr.Dataset:
    """Compute basins of attraction for several cases; the dataset has the dimension ``case``.

    A case is a dict with title, tuning (mesh frequency over natural frequency) and pair (a
    `GearPair`). `settings` has the keys displacement and velocity, the ranges (lower limit, upper
    limit) of the initial states; count, the number of initial states along each axis; and periods,
    the number of mesh periods of each run.
    """
    grid = tuple((*settings[name], settings["count"]) for name in ("displacement", "velocity"))
    options = {"periods": settings["periods"], "threads": threads}
    datasets = [basins(case["pair"], case["tuning"], grid, **options) for case in cases]
    data = _join_cases(datasets, cases, join="outer", fill_value=_FILL_VALUES)
    data["attractor_kind"].attrs |= KIND_FLAGS
    return data


def compute_bifurcation(
    pair: GearPair, tunings: Sequence[float], coarse: Sequence[float], settings: dict, threads=None
) -> tuple[xr.Dataset, xr.Dataset]:
    """Compute a bifurcation diagram with Lyapunov exponents, and the basin stability.

    The diagram is computed at `tunings` (mesh frequency over natural frequency), and the basin
    stability at the coarser grid `coarse`. `settings` has the keys

    * settle, strobes: mesh periods before the record, and recorded states (one per mesh period),
    * exponent_periods: mesh periods of the runs that determine the exponents,
    * starts, displacement, velocity: number and ranges of random initial states,
    * samples, periods: initial states and mesh periods of the runs for the basin stability.

    In the directions "up" and "down" each run starts from the end of the previous one; in the
    direction "cold n" all runs start from the n-th random state. The variable settled is 1 for
    periodic motions whose orbit does not depend on rounding errors. Return (diagram, basin
    stability).
    """
    region = settings["displacement"], settings["velocity"]
    names = [*WARM_STARTED, *(f"cold {i + 1}" for i in range(settings["starts"]))]
    random_states = _random_states(region, settings["starts"]).tolist()
    initial_states = [(0.0, 0.0)] * len(WARM_STARTED) + random_states
    directions = [name.split()[0] for name in names]
    record = {name: settings[name] for name in ("settle", "strobes")}
    exponent = {"settle": 0, "periods": settings["exponent_periods"], "threads": threads}
    diagrams, datasets = [], []
    for direction, initial_state in zip(directions, initial_states, strict=True):
        options = record | {"direction": direction, "initial_state": initial_state}
        diagram = bifurcation_diagram(pair, tunings, **options)
        states = diagram.final_state.values
        exponents = lyapunov.lyapunov_exponents(pair, tunings, states=states, **exponent)
        # If a run of the diagram stopped early, its status is kept.
        codes = diagram.status.where(diagram.status != status.OK, exponents.status)
        diagrams.append(diagram)
        datasets.append(diagram.assign(exponents.data_vars).assign(status=codes))
    data = xr.concat(datasets, xr.IndexVariable("direction", names), combine_attrs="drop")
    settled = lyapunov.reproducible_orbits(pair, diagrams, directions, initial_states)
    data = data.assign(settled=(("direction", "tuning"), settled.astype(np.int8), {}))
    data = add_metadata(data.assign(speed=("tuning", pair.speed(data.tuning.values))))
    data["settled"].attrs |= lyapunov.SETTLED_FLAGS
    options = {name: settings[name] for name in ("samples", "periods")}
    stability = basin_stability(pair, coarse, region, threads=threads, **options)
    return data.assign_attrs(datasets[0].attrs), stability


def _random_states(region: Sequence[Sequence[float]], count: int) -> np.ndarray:
    """Draw `count` initial states (displacement, velocity) with a fixed seed, shape (count, 2).

    `region` has the ranges (lower limit, upper limit) of displacement and velocity.
    """
    lowest, highest = np.array(region).T
    return lowest + np.random.default_rng(0).random((count, 2)) * (highest - lowest)


def compute_poincare_sections(cases: Sequence[dict], settings: dict) -> xr.Dataset:
    """Compute Poincare sections of motions from random initial states for several cases.

    The dataset has the dimension "case". A case is a dict with title, tuning (mesh frequency over
    natural frequency), phase of the section (degrees), settle (mesh periods before the record) and
    pair (a `GearPair`). `settings` has the keys displacement and velocity (ranges of the initial
    states), orbits (number of initial states) and periods (mesh periods of the record). A motion is
    classified as chaotic if rounding errors change it completely and perturbations grow
    exponentially, and as undecided if only one of these is true.
    """
    periods = settings["periods"]
    region = settings["displacement"], settings["velocity"]
    states = _random_states(region, settings["orbits"])
    starts = [tuple(state) for state in states]
    datasets = []
    for case in cases:
        pair, tuning, settle = case["pair"], case["tuning"], case["settle"]
        run = {"periods": periods, "settle": settle}
        phase = math.radians(case["phase"])
        section = poincare_section(pair, tuning, states, phase=phase, **run)
        exponents = [largest_exponent(pair, tuning, state=start, **run) for start in starts]
        growths = [
            are_sensitive_to_rounding(pair, [tuning], start, settle + periods) for start in starts
        ]
        depends_on_rounding = np.concatenate(growths)
        grows = np.array([exponent.grows_faster_than_linearly for exponent in exponents])
        regular_or_undecided = _UNDECIDED_FLAG * (depends_on_rounding | grows)
        is_chaotic = depends_on_rounding & grows
        chaotic = np.where(is_chaotic, _CHAOTIC_FLAG, regular_or_undecided).astype(np.int8)
        values = [exponent.value for exponent in exponents]
        section = section.assign(chaotic=("orbit", chaotic), exponent=("orbit", values))
        datasets.append(section.drop_vars("strobe"))
    data = _join_cases(datasets, cases)
    data["chaotic"].attrs |= status.flag_attributes(("regular", "chaotic", "undecided"))
    return data
