"""The paper's analytic method at work, E. Schmidt's splitting, and harmonic balance.

Iterations, range of convergence, errors and the resonance curve of one gear pair, against its exact
orbits: see `gearlib.schmidt` and `gearlib.harmonic_balance`.
"""

import numpy as np
import xarray as xr

from gearlib.analysis.harmonics.equation import MeshEquation
from gearlib.analysis.harmonics.harmonic_balance import first_coefficients, harmonic_balance
from gearlib.analysis.harmonics.schmidt import (
    contraction,
    degenerate_harmonics,
    iterate,
    schmidt,
    search,
)
from gearlib.analysis.harmonics.solution import errors, exact_course
from gearlib.analysis.orbits.shooting import NoOrbit, periodic_orbit
from gearlib.analysis.tongues.meissner import linear_pair
from gearlib.data.result import result, stacked
from gearlib.models.pair import GearPair
from gearlib.runs.sweeping import CARRIED, sweep

#: Phases per mesh period of the courses that are shown, and of those of guesses.
_PHASES, _GUESS_PHASES = 128, 1024
#: Correction at which a search from a nearby orbit ends, and most applications of the kernel.
_TOLERANCE, _MAX_ITERATIONS = 1e-8, 200
#: Harmonics of the exact orbit from which a search starts nearby.
_NEARBY_HARMONICS = 3


def compute(pair, tunings, settings, run):
    """Return what the two figures of the analytic method show.

    `settings` are those of the section ``analytic_method`` of the configuration; `tunings` are
    those of the range of convergence and of the resonance curve, `run` has periods and
    record_periods of the exact curves.
    """
    pair = GearPair(**pair)
    data = stacked(
        {"direction": CARRIED}, lambda way: _curve(pair, way, tunings, settings, run), "tuning"
    )
    data |= _convergence(pair, tunings, settings) | _errors(pair, settings)
    coords = {
        "shown": settings["shown"],
        "phase": np.arange(_PHASES) * (2.0 * np.pi / _PHASES),
        "iteration": np.arange(settings["iterations"] + 1, dtype=np.int32),
        "contact_loss": ["never lost", "lost"],
        "degenerate_count": np.arange(settings["most_degenerate"] + 1, dtype=np.int32),
        "tuning": np.asarray(tunings, float),
        "balance_harmonics": np.array(settings["balance_harmonics"], np.int32),
        "schmidt_harmonics": np.array(settings["schmidt_harmonics"], np.int32),
        "direction": list(CARRIED),
    }
    iterations = [_iterations(pair, tuning, settings) for tuning in settings["shown"]]
    dataset = xr.Dataset(data, coords).merge(xr.concat(iterations, "shown"))
    dataset["backlash_ratio"] = pair.backlash_ratio
    title = "The analytic method and harmonic balance against exact orbits"
    ways, harmonics = "schmidt, harmonic balance", settings["harmonics"]
    return result(title, pair, dataset, method=ways, harmonics=harmonics)


def _iterations(pair, tuning, settings):
    """Return courses and errors of the iterates from the static deflection at one tuning."""
    count = settings["iterations"] + 1
    courses, changed = np.full((count, _PHASES), np.nan), np.zeros(count, np.int8)
    exact = exact_course(periodic_orbit(pair, tuning), _PHASES)[0]
    equation = MeshEquation(pair, tuning, settings["iteration_harmonics"])
    solution = schmidt(pair, tuning, harmonics=settings["harmonics"], guess=exact)
    kept = np.array(solution.degenerate, int)
    coefficients = first_coefficients(equation, None)
    steps = iterate(equation, coefficients, kept, _TOLERANCE)
    before = np.inf if kept.size else 0.0
    for j in range(count):
        courses[j] = equation.on_grid(coefficients)[:: equation.samples // _PHASES]
        step = next(steps)
        changed[j] = step.algebraic != before
        before, coefficients = step.algebraic, step.coefficients
        if max(step.correction, before) < _TOLERANCE:
            break
    return xr.Dataset(
        {
            "iterate_displacement": (("iteration", "phase"), courses),
            "iterate_error": ("iteration", np.abs(courses - exact).max(axis=1)),
            "algebraic_step": ("iteration", changed),
            "exact_displacement": ("phase", exact),
            "degenerate_chosen": np.int32(kept.size),
        }
    )


def _convergence(pair, tunings, settings):
    """Return contraction factors on the orbits, and whether a search from nearby converges."""
    counts = range(settings["most_degenerate"] + 1)

    def facts(model, tuning):
        factor, converged = np.full(len(counts), np.nan), np.zeros(len(counts), np.int8)
        try:
            orbit = periodic_orbit(model, tuning)
        except NoOrbit:
            return {"contraction": factor, "converged": converged, "automatic": np.int32(0)}
        equation = MeshEquation(model, tuning, settings["harmonics"])
        nearby = first_coefficients(equation, exact_course(orbit, _GUESS_PHASES)[0])
        start = np.where(np.arange(nearby.size) <= _NEARBY_HARMONICS, nearby, 0.0)
        limits = _TOLERANCE, _MAX_ITERATIONS
        for i in counts:
            kept = degenerate_harmonics(equation, i)
            factor[i] = contraction(equation, nearby, kept)
            converged[i] = search(equation, start, kept, False, *limits)[2]
        kept = search(equation, start, np.empty(0, int), True, *limits)[1]
        values = {"contraction": factor, "converged": converged}
        return values | {"automatic": np.int32(kept.size)}

    models = {"contact_loss": [linear_pair(pair), pair], "tuning": tunings}
    data = xr.Dataset(stacked(models, facts, "degenerate_count"))
    return dict(data.transpose("contact_loss", "degenerate_count", "tuning").data_vars)


def _errors(pair, settings):
    """Return the errors of both methods next to exact orbits over their numbers of harmonics."""
    orbits = {tuning: periodic_orbit(pair, tuning) for tuning in settings["shown"]}
    guesses = {nu: exact_course(orbit, _GUESS_PHASES)[0] for nu, orbit in orbits.items()}
    data = {}
    for name, solve in (("balance", harmonic_balance), ("schmidt", schmidt)):

        def facts(tuning, harmonics, name=name, solve=solve):
            solution = solve(pair, tuning, harmonics=harmonics, guess=guesses[tuning])
            error = errors(solution, orbits[tuning])
            return {
                f"{name}_{kind}_error": getattr(error, kind)
                for kind in ("displacement", "velocity")
            }

        ladder = f"{name}_harmonics"
        data |= stacked({"shown": settings["shown"], ladder: settings[ladder]}, facts)
    return data


def _curve(pair, direction, tunings, settings, run):
    """Return extrema of harmonic balance, followed up or down, and those of an exact sweep."""
    curve = sweep(pair, tunings, direction=direction, **run)
    exact = {name: curve[name].values for name in ("displacement_max", "displacement_min")}
    high, low = np.full(len(tunings), np.nan), np.full(len(tunings), np.nan)
    stable, last = np.zeros(len(tunings), np.int8), None
    for j in range(len(tunings)) if direction == "up" else reversed(range(len(tunings))):
        last = _followed(pair, tunings[j], settings["harmonics"], last)
        if last is not None:
            course, _ = last.courses(_PHASES)
            high[j], low[j], stable[j] = course.max(), course.min(), last.stable
    return {"balance_max": high, "balance_min": low, "stable": stable} | exact


def _followed(pair, tuning, harmonics, last):
    """Return the solution of harmonic balance next to the last one, or any, or None."""
    for guess in (last, None) if last is not None else (None,):
        try:
            return harmonic_balance(pair, tuning, harmonics=harmonics, guess=guess)
        except NoOrbit:
            continue
    return None
