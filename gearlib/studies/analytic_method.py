"""Compare the paper's analytic method and harmonic balance with exact orbits.

Iterations, range of convergence, errors and the resonance curve of one gear pair; see
`gearlib.schmidt` and `gearlib.harmonic_balance`.
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

#: Samples per mesh period of the displayed time histories, and of initial guesses.
_SAMPLES, _GUESS_SAMPLES = 128, 1024
#: Size of a correction below which an iteration has converged, and largest number of applications
#: of the integral kernel.
_TOLERANCE, _MAX_APPLICATIONS = 1e-8, 200
#: Number of harmonics of the exact orbit in the first iterate near it.
_START_HARMONICS = 3


def analytic_method_study(
    pair: GearPair, tunings: Sequence[float], settings: dict, run
) -> xr.Dataset:
    """Compare the paper's analytic method and harmonic balance with exact orbits of a gear pair.

    The paper's method is E. Schmidt's: successive approximations, with Newton steps for a few
    degenerate (near-resonant) harmonics. The range of convergence and the resonance curve are
    computed at `tunings`; `run` has periods and record_periods of the exact sweeps. `settings` have
    shown (the tunings of single solutions), harmonics (number of harmonics of a solution),
    iterations (number of iterates), iteration_harmonics (number of their harmonics),
    balance_harmonics and schmidt_harmonics (the numbers of harmonics at which the errors of each
    method are computed), and most_degenerate (largest number of degenerate harmonics).
    """
    data = stacked(
        {"direction": WARM_STARTED},
        lambda direction: _resonance_curve(pair, direction, tunings, settings["harmonics"], run),
        "tuning",
    )
    data |= _convergence(pair, tunings, settings["harmonics"], settings["most_degenerate"])
    harmonic_counts = {name: settings[f"{name}_harmonics"] for name in ("balance", "schmidt")}
    data |= _method_errors(pair, settings["shown"], harmonic_counts)
    coords = {
        "shown": settings["shown"],
        "phase": np.arange(_SAMPLES) * (2.0 * np.pi / _SAMPLES),
        "iteration": np.arange(settings["iterations"] + 1, dtype=np.int32),
        "contact_loss": ["never lost", "lost"],
        "degenerate_count": np.arange(settings["most_degenerate"] + 1, dtype=np.int32),
        "tuning": np.asarray(tunings, float),
        **{f"{key}_harmonics": np.array(harmonic_counts[key], np.int32) for key in harmonic_counts},
        "direction": list(WARM_STARTED),
    }
    histories = [_iteration_history(pair, tuning, settings) for tuning in settings["shown"]]
    dataset = xr.Dataset(data, coords).merge(xr.concat(histories, "shown"))
    dataset["backlash_ratio"] = pair.backlash_ratio
    title = "The analytic method and harmonic balance against exact orbits"
    methods = "schmidt, harmonic balance"
    return result(title, pair, dataset, method=methods, harmonics=settings["harmonics"])


def _iteration_history(pair: GearPair, tuning: float, settings: dict) -> xr.Dataset:
    """Return the iterates of E. Schmidt's method from the static deflection, and their errors.

    `settings` have iterations (number of iterates), iteration_harmonics (number of harmonics of the
    iterates) and harmonics (number of harmonics of the solution). In the dataset,
    degenerate_chosen is the number of degenerate (near-resonant) harmonics, and algebraic_step is 1
    for iterates before a Newton step for these harmonics.
    """
    count = settings["iterations"] + 1
    iterates = np.full((count, _SAMPLES), np.nan)
    takes_newton_step = np.zeros(count, np.int8)
    exact = exact_motion(periodic_orbit(pair, tuning), _SAMPLES)[0]
    equation = MeshEquation(pair, tuning, settings["iteration_harmonics"])
    # Only the degenerate harmonics of the solution are used, so it may start at the exact orbit.
    solution = schmidt(pair, tuning, harmonics=settings["harmonics"], guess=exact)
    degenerate = np.array(solution.degenerate, int)
    coefficients = first_coefficients(equation, guess=None)
    steps = iterate(equation, coefficients, degenerate, _TOLERANCE)
    # The norm of the last Newton step, inf before the first one, changes if a step is taken.
    last_step_norm = np.inf if degenerate.size else 0.0
    for j in range(count):
        iterates[j] = equation.to_grid(coefficients)[:: equation.samples // _SAMPLES]
        step = next(steps)
        takes_newton_step[j] = step.newton_step != last_step_norm
        last_step_norm = step.newton_step
        coefficients = step.coefficients
        if max(step.correction, last_step_norm) < _TOLERANCE:
            break  # the other iterates stay NaN
    return xr.Dataset(
        {
            "iterate_displacement": (("iteration", "phase"), iterates),
            "iterate_error": ("iteration", np.abs(iterates - exact).max(axis=1)),
            "algebraic_step": ("iteration", takes_newton_step),
            "exact_displacement": ("phase", exact),
            "degenerate_chosen": np.int32(degenerate.size),
        }
    )


def _convergence(pair: GearPair, tunings, harmonics: int, most_degenerate: int) -> dict:
    """Compute contraction factors at exact orbits, and whether E. Schmidt's iterations converge.

    The result maps names to variables over contact_loss (without, with), degenerate_count (number
    of harmonics solved by Newton steps, 0 to `most_degenerate`) and tuning; `harmonics` is the
    number of all harmonics.
    """
    counts = range(most_degenerate + 1)

    def convergence_at(model: GearPair, tuning: float) -> dict:
        """Return contraction factors and convergence for each number of degenerate harmonics.

        "automatic" is the number of degenerate harmonics that the iteration selects by itself.
        Iterations start at the lowest harmonics of the exact orbit: near it, but not on it.
        """
        factors = np.full(len(counts), np.nan)
        converged = np.zeros(len(counts), np.int8)
        try:
            orbit = periodic_orbit(model, tuning)
        except NoOrbit:
            return {"contraction": factors, "converged": converged, "automatic": np.int32(0)}
        equation = MeshEquation(model, tuning, harmonics)
        exact = first_coefficients(equation, exact_motion(orbit, _GUESS_SAMPLES)[0])
        start = np.where(np.arange(exact.size) <= _START_HARMONICS, exact, 0.0)
        limits = {"tolerance": _TOLERANCE, "max_applications": _MAX_APPLICATIONS}
        for i in counts:
            degenerate = degenerate_harmonics(equation, i)
            factors[i] = contraction_factor(equation, exact, degenerate)
            _, _, converged[i], _ = iterate_until_converged(
                equation, start, degenerate, adapt_degenerate=False, **limits
            )
        _, selected, _, _ = iterate_until_converged(
            equation, start, np.empty(0, int), adapt_degenerate=True, **limits
        )
        count = np.int32(selected.size)
        return {"contraction": factors, "converged": converged, "automatic": count}

    axes = {"contact_loss": [linear_pair(pair), pair], "tuning": tunings}
    data = xr.Dataset(stacked(axes, convergence_at, "degenerate_count"))
    return dict(data.transpose("contact_loss", "degenerate_count", "tuning").data_vars)


def _method_errors(pair: GearPair, tunings: Sequence[float], harmonic_counts: dict) -> dict:
    """Compute the errors of both methods against exact orbits by tuning and number of harmonics.

    `harmonic_counts` maps "balance" (harmonic balance) and "schmidt" to the numbers of harmonics.
    """
    orbits = {tuning: periodic_orbit(pair, tuning) for tuning in tunings}
    guesses = {tuning: exact_motion(orbits[tuning], _GUESS_SAMPLES)[0] for tuning in orbits}
    data = {}
    for name, solve in (("balance", harmonic_balance), ("schmidt", schmidt)):

        def errors_at(tuning: float, harmonics: int, name: str = name, solve: Any = solve) -> dict:
            """Return the errors of the solution with this number of harmonics at a tuning."""
            solution = solve(pair, tuning, harmonics=harmonics, guess=guesses[tuning])
            error = errors(solution, orbits[tuning])
            values = {"displacement": error.displacement, "velocity": error.velocity}
            return {f"{name}_{quantity}_error": value for quantity, value in values.items()}

        axes = {"shown": tunings, f"{name}_harmonics": harmonic_counts[name]}
        data |= stacked(axes, errors_at)
    return data


def _resonance_curve(pair, direction, tunings, harmonics, run) -> dict[str, np.ndarray]:
    """Return extrema and stability of harmonic balance solutions, and extrema of an exact sweep.

    Both follow the tunings in the `direction` "up" or "down". `harmonics` is the number of
    harmonics of harmonic balance, and `run` has arguments of `gearlib.sweep`. Values are NaN where
    no solution is found.
    """
    curve = sweep(pair, tunings, direction=direction, **run)
    exact = {name: curve[name].values for name in ("displacement_max", "displacement_min")}
    maxima = np.full(len(tunings), np.nan)
    minima = np.full(len(tunings), np.nan)
    stable = np.zeros(len(tunings), np.int8)
    indices = list(range(len(tunings)))
    if direction == "down":
        indices.reverse()
    solution = None
    for j in indices:
        solution = _next_solution(pair, tunings[j], harmonics, solution)
        if solution is not None:
            displacement, _ = solution.time_history(_SAMPLES)
            maxima[j] = displacement.max()
            minima[j] = displacement.min()
            stable[j] = solution.stable
    return {"balance_max": maxima, "balance_min": minima, "stable": stable} | exact


def _next_solution(pair: GearPair, tuning: float, harmonics: int, neighbour: Any) -> Any:
    """Return a solution of harmonic balance at a tuning, None if none is found.

    `neighbour` is the solution at the neighbouring tuning, or None. It is the first guess; the
    default guess is the second.
    """
    guesses = [None] if neighbour is None else [neighbour, None]
    for guess in guesses:
        try:
            return harmonic_balance(pair, tuning, harmonics=harmonics, guess=guess)
        except NoOrbit:
            continue
    return None
