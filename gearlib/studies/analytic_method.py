"""Compare the paper's analytic method and harmonic balance with exact orbits.

Iterations, range of convergence, errors and the resonance curve of one gear pair; see
`gearlib.schmidt` and `gearlib.harmonic_balance`. `settings` are those of the section
``analytic_method`` of the configuration.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
import xarray as xr

from gearlib.analysis.harmonics.equation import MeshEquation
from gearlib.analysis.harmonics.harmonic_balance import first_coefficients, harmonic_balance
from gearlib.analysis.harmonics.schmidt import (
    contraction_factor,
    degenerate_harmonics,
    iterate,
    iterate_until_converged,
    schmidt,
)
from gearlib.analysis.harmonics.solution import errors, exact_motion
from gearlib.analysis.orbits.shooting import NoOrbit, periodic_orbit
from gearlib.analysis.tongues.meissner import linear_pair
from gearlib.data.result import result, stacked
from gearlib.models.pair import GearPair
from gearlib.runs.sweeping import WARM_STARTED, sweep

#: Samples per mesh period of the displayed time histories, and of those that start a search.
_SAMPLES, _GUESS_SAMPLES = 128, 1024
#: Correction at which an iteration has converged, and limit on applications of the integral kernel.
_TOLERANCE, _MAX_APPLICATIONS = 1e-8, 200
#: Number of harmonics of the exact orbit that start a search near it.
_START_HARMONICS = 3


def compute(pair: dict, tunings: Sequence[float], settings: dict, run: dict) -> xr.Dataset:
    """Return the data of both figures of the analytic method.

    `pair` has arguments of `GearPair`; `tunings` are those of the range of convergence and of the
    resonance curve; `run` has periods and record_periods of the exact sweeps.
    """
    model = GearPair(**pair)
    data = stacked(
        {"direction": WARM_STARTED},
        lambda direction: _resonance_curve(model, direction, tunings, settings, run),
        "tuning",
    )
    data |= _convergence(model, tunings, settings) | _method_errors(model, settings)
    coords = {
        "shown": settings["shown"],
        "phase": np.arange(_SAMPLES) * (2.0 * np.pi / _SAMPLES),
        "iteration": np.arange(settings["iterations"] + 1, dtype=np.int32),
        "contact_loss": ["never lost", "lost"],
        "degenerate_count": np.arange(settings["most_degenerate"] + 1, dtype=np.int32),
        "tuning": np.asarray(tunings, float),
        "balance_harmonics": np.array(settings["balance_harmonics"], np.int32),
        "schmidt_harmonics": np.array(settings["schmidt_harmonics"], np.int32),
        "direction": list(WARM_STARTED),
    }
    histories = [_iteration_history(model, tuning, settings) for tuning in settings["shown"]]
    dataset = xr.Dataset(data, coords).merge(xr.concat(histories, "shown"))
    dataset["backlash_ratio"] = model.backlash_ratio
    title = "The analytic method and harmonic balance against exact orbits"
    methods, harmonics = "schmidt, harmonic balance", settings["harmonics"]
    return result(title, model, dataset, method=methods, harmonics=harmonics)


def _iteration_history(pair: GearPair, tuning: float, settings: dict) -> xr.Dataset:
    """Return the iterates of E. Schmidt's method from the static deflection, and their errors.

    algebraic_step marks the iterates after a Newton step of the degenerate harmonics. The exact
    displacement over one mesh period is included.
    """
    count = settings["iterations"] + 1
    iterates, algebraic_steps = np.full((count, _SAMPLES), np.nan), np.zeros(count, np.int8)
    exact = exact_motion(periodic_orbit(pair, tuning), _SAMPLES)[0]
    equation = MeshEquation(pair, tuning, settings["iteration_harmonics"])
    solution = schmidt(pair, tuning, harmonics=settings["harmonics"], guess=exact)
    degenerate = np.array(solution.degenerate, int)
    coefficients = first_coefficients(equation, None)
    steps = iterate(equation, coefficients, degenerate, _TOLERANCE)
    last_newton_step = np.inf if degenerate.size else 0.0
    for j in range(count):
        iterates[j] = equation.to_grid(coefficients)[:: equation.samples // _SAMPLES]
        step = next(steps)
        algebraic_steps[j] = step.newton_step != last_newton_step
        last_newton_step, coefficients = step.newton_step, step.coefficients
        if max(step.correction, last_newton_step) < _TOLERANCE:
            break
    return xr.Dataset(
        {
            "iterate_displacement": (("iteration", "phase"), iterates),
            "iterate_error": ("iteration", np.abs(iterates - exact).max(axis=1)),
            "algebraic_step": ("iteration", algebraic_steps),
            "exact_displacement": ("phase", exact),
            "degenerate_chosen": np.int32(degenerate.size),
        }
    )


def _convergence(pair: GearPair, tunings: Sequence[float], settings: dict) -> dict:
    """Return the contraction factors at exact orbits, and whether iterations near them converge.

    Both are arrays over contact loss (without, with), number of degenerate harmonics, and tuning.
    """
    counts = range(settings["most_degenerate"] + 1)

    def convergence_at(model: GearPair, tuning: float) -> dict:
        """Return contraction, convergence and the number of automatic degenerate harmonics."""
        factors, converged = np.full(len(counts), np.nan), np.zeros(len(counts), np.int8)
        try:
            orbit = periodic_orbit(model, tuning)
        except NoOrbit:
            return {"contraction": factors, "converged": converged, "automatic": np.int32(0)}
        equation = MeshEquation(model, tuning, settings["harmonics"])
        exact = first_coefficients(equation, exact_motion(orbit, _GUESS_SAMPLES)[0])
        start = np.where(np.arange(exact.size) <= _START_HARMONICS, exact, 0.0)
        limits = _TOLERANCE, _MAX_APPLICATIONS  # of the iteration
        for i in counts:
            degenerate = degenerate_harmonics(equation, i)
            factors[i] = contraction_factor(equation, exact, degenerate)
            _, _, converged[i], _ = iterate_until_converged(
                equation, start, degenerate, *limits, adapt_degenerate=False
            )
        _, automatic, _, _ = iterate_until_converged(
            equation, start, np.empty(0, int), *limits, adapt_degenerate=True
        )
        count = np.int32(automatic.size)
        return {"contraction": factors, "converged": converged, "automatic": count}

    axes = {"contact_loss": [linear_pair(pair), pair], "tuning": tunings}
    data = xr.Dataset(stacked(axes, convergence_at, "degenerate_count"))
    return dict(data.transpose("contact_loss", "degenerate_count", "tuning").data_vars)


def _method_errors(pair: GearPair, settings: dict) -> dict:
    """Return the errors of both methods against exact orbits, over their numbers of harmonics."""
    orbits = {tuning: periodic_orbit(pair, tuning) for tuning in settings["shown"]}
    guesses = {tuning: exact_motion(orbits[tuning], _GUESS_SAMPLES)[0] for tuning in orbits}
    data = {}
    for name, solve in (("balance", harmonic_balance), ("schmidt", schmidt)):

        def errors_at(tuning: float, harmonics: int, name: str = name, solve: Any = solve) -> dict:
            """Return the errors of a solution with a number of harmonics at a tuning."""
            solution = solve(pair, tuning, harmonics=harmonics, guess=guesses[tuning])
            error = errors(solution, orbits[tuning])
            return {
                f"{name}_displacement_error": error.displacement,
                f"{name}_velocity_error": error.velocity,
            }

        dimension = f"{name}_harmonics"
        axes = {"shown": settings["shown"], dimension: settings[dimension]}
        data |= stacked(axes, errors_at)
    return data


def _resonance_curve(pair, direction, tunings, settings, run) -> dict[str, np.ndarray]:
    """Return extrema of harmonic balance, whether it is stable, and extrema of an exact sweep.

    Both are computed in the `direction` "up" or "down"; `run` has arguments of `gearlib.sweep`.
    """
    curve = sweep(pair, tunings, direction=direction, **run)
    exact = {name: curve[name].values for name in ("displacement_max", "displacement_min")}
    largest, smallest = np.full(len(tunings), np.nan), np.full(len(tunings), np.nan)
    stable, solution = np.zeros(len(tunings), np.int8), None
    for j in range(len(tunings)) if direction == "up" else reversed(range(len(tunings))):
        solution = _next_solution(pair, tunings[j], settings["harmonics"], solution)
        if solution is not None:
            displacement, _ = solution.time_history(_SAMPLES)
            largest[j], smallest[j] = displacement.max(), displacement.min()
            stable[j] = solution.stable
    return {"balance_max": largest, "balance_min": smallest, "stable": stable} | exact


def _next_solution(pair: GearPair, tuning: float, harmonics: int, neighbour: Any) -> Any:
    """Return a solution of harmonic balance, None if none is found.

    The first guess is `neighbour`, the solution at the neighbouring tuning, unless it is None.
    """
    for guess in (neighbour, None) if neighbour is not None else (None,):
        try:
            return harmonic_balance(pair, tuning, harmonics=harmonics, guess=guess)
        except NoOrbit:
            continue
    return None
