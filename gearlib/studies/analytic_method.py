"""The paper's analytic method at work: iterations, range of convergence, errors, resonance curve.

E. Schmidt's splitting (`gearlib.schmidt`) and harmonic balance (`gearlib.harmonic_balance`) on
one gear pair, against its exact orbits.
"""

import numpy as np

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
from gearlib.data.result import result, stacked
from gearlib.models.pair import GearPair
from gearlib.runs.sweeping import CARRIED, sweep

#: Phases per mesh period of the courses that are shown.
_PHASES = 128
#: Corrections of the search from a nearby orbit, and kernels after which it has failed.
_TOLERANCE, _MOST = 1e-8, 200
#: Harmonics of the exact orbit from which a search starts nearby.
_NEARBY = 3
_CONTACT = ("never lost", "lost")


def compute(pair, tunings, settings, run):
    """Return all that the two figures of the analytic method show.

    pair: keyword arguments of `GearPair`; tunings: shape (n,), of the range of convergence and of
    the resonance curve; settings (shown: tunings of the iterations and errors; iterations: how many
    are shown; iteration_harmonics: their harmonics; harmonics: of the range and the curve;
    most_degenerate: degenerate harmonics at most; balance_harmonics, schmidt_harmonics: of the
    errors); run: periods, record_periods of the exact curves.
    """
    pair = GearPair(**pair)
    data = (
        _iterations(pair, settings)
        | _range(pair, tunings, settings)
        | _errors(pair, settings)
        | _curves(pair, tunings, settings, run)
    )
    coords = {
        "shown": settings["shown"],
        "phase": np.arange(_PHASES) * (2.0 * np.pi / _PHASES),
        "iteration": np.arange(settings["iterations"] + 1, dtype=np.int32),
        "contact_loss": np.array(_CONTACT, object),
        "degenerate_count": np.arange(settings["most_degenerate"] + 1, dtype=np.int32),
        "tuning": np.asarray(tunings, float),
        "balance_harmonics": np.array(settings["balance_harmonics"], np.int32),
        "schmidt_harmonics": np.array(settings["schmidt_harmonics"], np.int32),
        "direction": np.array(CARRIED, object),
    }
    title = "The analytic method and harmonic balance against exact orbits"
    ways, harmonics = "schmidt, harmonic balance", settings["harmonics"]
    return result(title, pair, data, coords, method=ways, harmonics=harmonics)


def without_loss(pair):
    """Return the pair as a mesh that never loses contact: no backlash, one damping."""
    return pair.replace(backlash=0.0, backlash_damping=pair.material_damping)


def _iterations(pair, settings):
    """Return courses and errors of the iterates from the static deflection, and exact courses."""
    shape = len(settings["shown"]), settings["iterations"] + 1
    courses = np.full((*shape, _PHASES), np.nan)
    distance = np.full(shape, np.nan)
    changed = np.zeros(shape, np.int8)
    exact = np.empty((shape[0], _PHASES))
    counts = np.empty(shape[0], np.int32)
    for i, nu in enumerate(settings["shown"]):
        orbit = periodic_orbit(pair, nu)
        exact[i] = exact_course(orbit, _PHASES)[0]
        equation = MeshEquation(pair, nu, settings["iteration_harmonics"])
        solution = schmidt(pair, nu, harmonics=settings["harmonics"], guess=exact[i])
        kept = np.array(solution.degenerate, int)
        counts[i] = kept.size
        coefficients = first_coefficients(equation, None)
        steps = iterate(equation, coefficients, kept, _TOLERANCE)
        before = np.inf if kept.size else 0.0
        for j in range(shape[1]):
            x = equation.on_grid(coefficients)[:: equation.samples // _PHASES]
            courses[i, j], distance[i, j] = x, np.abs(x - exact[i]).max()
            step = next(steps)
            changed[i, j] = step.algebraic != before
            before, coefficients = step.algebraic, step.coefficients
            if max(step.correction, before) < _TOLERANCE:
                break
    return {
        "iterate_displacement": (("shown", "iteration", "phase"), courses),
        "iterate_error": (("shown", "iteration"), distance),
        "algebraic_step": (("shown", "iteration"), changed),
        "exact_displacement": (("shown", "phase"), exact),
        "degenerate_chosen": ("shown", counts),
    }


def _range(pair, tunings, settings):
    """Return contraction factors on the orbits, and whether a search from nearby converges."""
    counts = range(settings["most_degenerate"] + 1)
    shape = len(_CONTACT), len(counts), len(tunings)
    factor, converged = np.full(shape, np.nan), np.zeros(shape, np.int8)
    chosen = np.zeros((shape[0], shape[2]), np.int32)
    for k, model in enumerate((without_loss(pair), pair)):
        for j, nu in enumerate(tunings):
            try:
                orbit = periodic_orbit(model, nu)
            except NoOrbit:
                continue
            x = exact_course(orbit, 8 * _PHASES)[0]
            equation = MeshEquation(model, nu, settings["harmonics"])
            # Nearby: its first few harmonics.
            nearby = first_coefficients(equation, x)
            start = np.where(np.arange(nearby.size) <= _NEARBY, nearby, 0.0)
            for i in counts:
                kept = degenerate_harmonics(equation, i)
                factor[k, i, j] = contraction(equation, nearby, kept)
                _, _, done, _ = search(equation, start, kept, False, _TOLERANCE, _MOST)
                converged[k, i, j] = done
            nothing = np.empty(0, int)
            _, kept, _, _ = search(equation, start, nothing, True, _TOLERANCE, _MOST)
            chosen[k, j] = kept.size
    axes = "contact_loss", "degenerate_count", "tuning"
    return {
        "contraction": (axes, factor),
        "converged": (axes, converged),
        "automatic": (("contact_loss", "tuning"), chosen),
    }


def _errors(pair, settings):
    """Return the errors of both methods over their numbers of harmonics, and what a search costs.

    Errors are those of the motion next to the exact orbit, evaluations those of a search without
    a guess.
    """
    orbits = {nu: periodic_orbit(pair, nu) for nu in settings["shown"]}
    guesses = {nu: exact_course(orbit, 8 * _PHASES)[0] for nu, orbit in orbits.items()}

    def of(name, solve):
        def one(nu, harmonics):
            solution = solve(pair, nu, harmonics=harmonics, guess=guesses[nu])
            error = errors(solution, orbits[nu])
            kinds = ("displacement", "velocity", "event", "multiplier")
            evaluations = _searched(solve, pair, nu, harmonics)
            return {f"{name}_{kind}_error": getattr(error, kind) for kind in kinds} | {
                f"{name}_evaluations": float(evaluations)
            }

        ladder = f"{name}_harmonics"
        return stacked({"shown": settings["shown"], ladder: settings[ladder]}, one)

    return of("balance", harmonic_balance) | of("schmidt", schmidt)


def _searched(solve, pair, tuning, harmonics):
    """Return the evaluations of the force law of a search without a guess; NaN if it fails."""
    try:
        solution = solve(pair, tuning, harmonics=harmonics)
    except NoOrbit:
        return np.nan
    return solution.evaluations if getattr(solution, "converged", True) else np.nan


def _curves(pair, tunings, settings, run):
    """Return extrema of harmonic balance along the tunings, and those of exact sweeps."""
    shape = len(CARRIED), len(tunings)
    high, low = np.full(shape, np.nan), np.full(shape, np.nan)
    stable = np.zeros(shape, np.int8)
    exact = {"displacement_max": np.empty(shape), "displacement_min": np.empty(shape)}
    for i, direction in enumerate(CARRIED):
        curve = sweep(pair, tunings, direction=direction, **run)
        for name, values in exact.items():
            values[i] = curve[name].values
        order = range(shape[1]) if direction == "up" else range(shape[1])[::-1]
        last = None
        for j in order:
            last = _followed(pair, tunings[j], settings["harmonics"], last)
            if last is not None:
                x, _ = last.courses(_PHASES)
                high[i, j], low[i, j], stable[i, j] = x.max(), x.min(), last.stable
    axes = "direction", "tuning"
    return {
        "balance_max": (axes, high),
        "balance_min": (axes, low),
        "stable": (axes, stable),
        **{name: (axes, values) for name, values in exact.items()},
        "backlash_ratio": pair.backlash_ratio,
    }


def _followed(pair, tuning, harmonics, last):
    """Return the solution next to the last one, or any, or None."""
    for guess in (last, None) if last is not None else (None,):
        try:
            return harmonic_balance(pair, tuning, harmonics=harmonics, guess=guess)
        except NoOrbit:
            continue
    return None
