"""Compare the paper's analytic method and harmonic balance with exact orbits.

The study computes the iterates, the range of convergence, the errors and the resonance curve of one
gear pair. See `gearlib.schmidt` and `gearlib.harmonic_balance`.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
import xarray as xr

from gearlib.analysis.harmonics.equation import MeshEquation
from gearlib.analysis.harmonics.harmonic_balance import harmonic_balance, initial_coefficients
from gearlib.analysis.harmonics.schmidt import (
    contraction_factor,
    degenerate_harmonics,
    iterate,
    iterate_until_converged,
    schmidt,
)
from gearlib.analysis.harmonics.solution import compare_with_orbit, simulate_orbit
from gearlib.analysis.orbits.shooting import NoOrbit, periodic_orbit
from gearlib.analysis.tongues.meissner import without_backlash
from gearlib.data.result import evaluate_on_grid, make_result
from gearlib.models.pair import GearPair
from gearlib.runs.sweeping import WARM_STARTED, sweep

#: Samples per mesh period of plotted time histories and of initial guesses.
_SAMPLES, _GUESS_SAMPLES = 128, 1024
#: Convergence tolerance of a correction, and maximum number of applications of the integral kernel.
_TOLERANCE, _MAX_APPLICATIONS = 1e-8, 200
#: Number of harmonics of the exact orbit that the first iterate contains.
_START_HARMONICS = 3


def analytic_method_study(
    pair: GearPair, tunings: Sequence[float], settings: dict, run
) -> xr.Dataset:
    """Compare the paper's analytic method and harmonic balance with exact orbits of a gear pair.

    The analytic method by E. Schmidt uses successive approximations, with Newton steps for the few
    harmonics near resonance ("degenerate" harmonics). The resonance curve and the convergence are
    computed at `tunings` (mesh frequency over natural frequency). `run` has the arguments periods
    and record_periods of `gearlib.sweep`. `settings` has the keys

    * shown: tunings at which single solutions are computed,
    * harmonics: number of harmonics of a solution,
    * iterations, iteration_harmonics: number of iterates, and of harmonics of an iterate,
    * balance_harmonics, schmidt_harmonics: numbers of harmonics for which errors are computed,
    * most_degenerate: maximum number of degenerate harmonics.
    """
    data = evaluate_on_grid(
        {"direction": WARM_STARTED},
        lambda direction: _compute_resonance_curves(
            pair, direction, tunings, settings["harmonics"], run
        ),
        "tuning",
    )
    data |= _compute_convergence(pair, tunings, settings["harmonics"], settings["most_degenerate"])
    harmonic_counts = {name: settings[f"{name}_harmonics"] for name in ("balance", "schmidt")}
    data |= _compute_method_errors(pair, settings["shown"], harmonic_counts)
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
    histories = [_record_iterations(pair, tuning, settings) for tuning in settings["shown"]]
    dataset = xr.Dataset(data, coords).merge(xr.concat(histories, "shown"))
    dataset["backlash_ratio"] = pair.backlash_ratio
    title = "The analytic method and harmonic balance against exact orbits"
    methods = "schmidt, harmonic balance"
    return make_result(title, pair, dataset, method=methods, harmonics=settings["harmonics"])


def _record_iterations(pair: GearPair, tuning: float, settings: dict) -> xr.Dataset:
    """Compute the iterates of E. Schmidt's method from the static deflection, and their errors.

    The method improves a periodic motion by successive approximations, and its harmonics near
    resonance ("degenerate" harmonics) by Newton steps. `tuning` is mesh frequency over natural
    frequency. `settings` has the keys iterations (number of iterates), iteration_harmonics (number
    of harmonics of an iterate) and harmonics (of the converged solution). In the dataset,
    degenerate_chosen is the number of degenerate harmonics, and algebraic_step is 1 for iterates
    that are followed by a Newton step.
    """
    count = settings["iterations"] + 1
    iterates = np.full((count, _SAMPLES), np.nan)
    takes_newton_step = np.zeros(count, np.int8)
    # `simulate_orbit` returns displacement and velocity at equidistant mesh phases.
    exact = simulate_orbit(periodic_orbit(pair, tuning), _SAMPLES)[0]
    equation = MeshEquation(pair, tuning, settings["iteration_harmonics"])
    # This solution only selects the degenerate harmonics, so it may start from the exact orbit.
    solution = schmidt(pair, tuning, harmonics=settings["harmonics"], guess=exact)
    degenerate = np.array(solution.degenerate, int)
    coefficients = initial_coefficients(equation, guess=None)
    steps = iterate(equation, coefficients, degenerate, _TOLERANCE)
    # A change of the norm, which is inf before the first Newton step, shows that one was taken.
    last_step_norm = np.inf if degenerate.size else 0.0
    for j in range(count):
        iterates[j] = equation.to_grid(coefficients)[:: equation.samples // _SAMPLES]
        step = next(steps)
        takes_newton_step[j] = step.newton_step != last_step_norm
        last_step_norm = step.newton_step
        coefficients = step.coefficients
        if max(step.correction, last_step_norm) < _TOLERANCE:
            break  # the remaining iterates stay NaN
    return xr.Dataset(
        {
            "iterate_displacement": (("iteration", "phase"), iterates),
            "iterate_error": ("iteration", np.abs(iterates - exact).max(axis=1)),
            "algebraic_step": ("iteration", takes_newton_step),
            "exact_displacement": ("phase", exact),
            "degenerate_chosen": np.int32(degenerate.size),
        }
    )


def _compute_convergence(pair: GearPair, tunings, harmonics: int, most_degenerate: int) -> dict:
    """Compute contraction factors and convergence of E. Schmidt's iteration.

    The contraction factor is the ratio of successive small errors. Return a dict of variables over
    contact_loss (a linear pair that never loses contact, then `pair`), degenerate_count (number of
    harmonics solved by Newton steps, 0 to `most_degenerate`) and tuning (mesh frequency over
    natural frequency). `harmonics` is the total number of harmonics.
    """
    counts = range(most_degenerate + 1)

    def convergence_at(model: GearPair, tuning: float) -> dict:
        """Compute contraction factors and convergence for each number of degenerate harmonics.

        Degenerate harmonics are near resonance and solved by Newton steps; "automatic" is the
        number that the iteration selects itself. The iteration starts near the exact orbit, from
        its lowest `_START_HARMONICS` harmonics. Factors are NaN if there is no exact orbit.
        """
        factors = np.full(len(counts), np.nan)
        converged = np.zeros(len(counts), np.int8)
        try:
            orbit = periodic_orbit(model, tuning)
        except NoOrbit:
            return {"contraction": factors, "converged": converged, "automatic": np.int32(0)}
        equation = MeshEquation(model, tuning, harmonics)
        exact = initial_coefficients(equation, simulate_orbit(orbit, _GUESS_SAMPLES)[0])
        start = np.where(np.arange(exact.size) <= _START_HARMONICS, exact, 0.0)
        limits = {"tolerance": _TOLERANCE, "max_applications": _MAX_APPLICATIONS}
        for i in counts:
            degenerate = degenerate_harmonics(equation, i)  # the i harmonics closest to resonance
            factors[i] = contraction_factor(equation, exact, degenerate)
            _, _, converged[i], _ = iterate_until_converged(
                equation, start, degenerate, adapt_degenerate=False, **limits
            )
        _, selected, _, _ = iterate_until_converged(
            equation, start, np.empty(0, int), adapt_degenerate=True, **limits
        )
        count = np.int32(selected.size)
        return {"contraction": factors, "converged": converged, "automatic": count}

    axes = {"contact_loss": [without_backlash(pair), pair], "tuning": tunings}
    data = xr.Dataset(evaluate_on_grid(axes, convergence_at, "degenerate_count"))
    return dict(data.transpose("contact_loss", "degenerate_count", "tuning").data_vars)


def _compute_method_errors(pair: GearPair, tunings: Sequence[float], harmonic_counts: dict) -> dict:
    """Compute the errors of both approximate methods for each tuning and number of harmonics.

    Errors are differences from exact periodic orbits computed by shooting. `tunings` are mesh
    frequencies over the natural frequency. `harmonic_counts` maps "balance" (harmonic balance) and
    "schmidt" (E. Schmidt's method) to lists of numbers of harmonics. Return a dict of variables.
    """
    orbits = {tuning: periodic_orbit(pair, tuning) for tuning in tunings}
    guesses = {tuning: simulate_orbit(orbits[tuning], _GUESS_SAMPLES)[0] for tuning in orbits}
    data = {}
    for name, solve in (("balance", harmonic_balance), ("schmidt", schmidt)):

        def errors_at(tuning: float, harmonics: int, name: str = name, solve: Any = solve) -> dict:
            """Return the displacement and velocity errors of one solution, as variable -> error.

            The function `solve` computes the solution with this number of `harmonics`. The default
            arguments bind the current values of the loop variables.
            """
            solution = solve(pair, tuning, harmonics=harmonics, guess=guesses[tuning])
            error = compare_with_orbit(solution, orbits[tuning])
            values = {"displacement": error.displacement, "velocity": error.velocity}
            return {f"{name}_{quantity}_error": value for quantity, value in values.items()}

        axes = {"shown": tunings, f"{name}_harmonics": harmonic_counts[name]}
        data |= evaluate_on_grid(axes, errors_at)
    return data


def _compute_resonance_curves(pair, direction, tunings, harmonics, run) -> dict[str, np.ndarray]:
    """Compute the resonance curve of a gear pair by harmonic balance and by an exact sweep.

    Return the extrema of the displacement by both methods, and the stability of the solutions of
    harmonic balance. Both methods follow `tunings` (mesh frequency over natural frequency) in the
    `direction` "up" or "down" and start from their result at the previous tuning. `run` has further
    arguments of `gearlib.sweep`. Values are NaN where harmonic balance finds no solution.
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
        solution = _find_balance_solution(pair, tunings[j], harmonics, solution)
        if solution is not None:
            displacement, _ = solution.time_history(_SAMPLES)
            maxima[j] = displacement.max()
            minima[j] = displacement.min()
            stable[j] = solution.stable
    return {"balance_max": maxima, "balance_min": minima, "stable": stable} | exact


def _find_balance_solution(pair: GearPair, tuning: float, harmonics: int, neighbour: Any) -> Any:
    """Find a periodic solution by harmonic balance at a tuning; return None if there is none.

    The initial guess is `neighbour`, the solution at the previous tuning or None. If that fails,
    the default guess of `harmonic_balance` is used. `harmonics` is the number of harmonics.
    """
    guesses = [None] if neighbour is None else [neighbour, None]
    for guess in guesses:
        try:
            return harmonic_balance(pair, tuning, harmonics=harmonics, guess=guess)
        except NoOrbit:
            continue
    return None
