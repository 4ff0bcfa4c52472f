"""Derivatives of every model against differences of the code of `tests.references`."""

import math
from dataclasses import replace

import numpy as np
import pytest

import gearlib
from gearlib import Fourier, Harmonics, OneDegreePair, orbit_sensitivities, periodic_orbit, simulate
from tests.properties.known_models import (
    CHAIN,
    DAMPED,
    GEARS,
    KNOWN,
    OSCILLATOR,
    OTHER,
    SETTLING,
    STRIKING,
    TABLE,
    Known,
)
from tests.properties.test_conformance import EXTREMA, TIMES
from tests.references import Stored, reference_slopes
from tests.references.described_models import describe, size_of

REFERENCES = Stored("sensitivities")
#: What is asked for: 1e-10 of each derivative, or of 1e-3 of the largest by the same parameter.
SHARE, LEAST = 1e-10, 1e-3
#: An offset moves what errors of the meshes of a body move, see `test_fits_of_trains`.
LEFT = ("torque of", "offset of")


def random_pair(seed):
    """Return a pair by random ratios; most lose contact, many strike both flanks."""
    rng = np.random.default_rng(seed)
    ratios = {
        "contact_ratio": rng.uniform(1.05, 1.95),
        "stiffness_ratio": rng.uniform(0.1, 0.95),
        "damping": 10 ** rng.uniform(-3, -0.3),
        "backlash_damping": 10 ** rng.uniform(-3, -0.3),
        "backlash": 10 ** rng.uniform(-1, 0.7),
    }
    state = tuple(map(float, rng.uniform(-3.0, 3.0, 2)))
    pair = gearlib.GearPair.from_ratios(**{key: float(x) for key, x in ratios.items()})
    return Known(pair, float(10 ** rng.uniform(-0.5, 0.4)), state, 3)


def _ratios(*values):
    names = ("contact_ratio", "stiffness_ratio", "damping", "backlash_damping", "backlash")
    return gearlib.GearPair.from_ratios(**dict(zip(names, values, strict=True)))


SLOPES = {f"pair {seed}": random_pair(seed) for seed in range(24)} | {
    # One side of a segment of no length.
    "contact ratio 1": Known(_ratios(1.0, 0.6, 0.05, 0.02, 1.0), 0.8, (0.3, -2.0), 3),
    "contact ratio 2": Known(_ratios(2.0, 0.6, 0.05, 0.02, 1.0), 0.8, (0.3, -2.0), 3),
    "no backlash": Known(_ratios(1.5, 0.6, 0.05, 0.3, 0.0), 0.8, (0.3, -2.0), 3),
    "no far flank": Known(_ratios(1.5, 0.6, 0.05, 0.02, math.inf), 0.9, (0.3, -2.0), 3),
    "critical": Known(_ratios(1.5, 1.0, 1.0, 0.0, 1.0), 0.7, (0.3, -6.0), 3),
    "over-damped": Known(_ratios(1.5, 0.6, 2.0, 0.5, 1.0), 0.3, (-3.0, 1.0), 3),
    "undamped": Known(_ratios(1.5, 0.6, 0.0, 0.0, 1.0), 0.9, (0.3, -2.0), 3),
    "pair in SI units": Known(DAMPED, 0.9, (0.5, -3.0), 12),
    "one degree": Known(KNOWN["deviating"].model, 0.7, (1.0, -3.0), 3),
    "oscillator": Known(OSCILLATOR, 0.8, (0.3, -1.0), 3),
    "steps": Known(KNOWN["unequal sides"].model, 1.3, (0.2, 0.9), 2),
    "unequal gears": Known(GEARS, 0.9, (0.3, -5.0), 2),
    "far flank at rest": Known(
        GEARS.replace(moving_backlash=False, preload=False), 0.6, (0.3, -5.0), 1
    ),
    "chain that settles": Known(CHAIN, 0.8, SETTLING, 2),
    "chain that strikes": Known(CHAIN, 0.7, STRIKING, 1),
    "chain from rest": Known(CHAIN, 0.45, "static", 1),
}


_DAMPINGS = {"cubic_damping": 4e5, "backlash_cubic_damping": 2e5, "quadratic_damping": 3e4}
_DAMPINGS["backlash_quadratic_damping"] = 2e4
_POWERS = {"quadratic_stiffness": 5e3, "cubic_stiffness": 2e9}
_WAVES = {"excitation": Harmonics((300.0,), (0.0, 200.0)), "deviation": Harmonics((), (1e-6,))}
_PAIR = DAMPED.replace(material_damping=1000.0, backlash_damping=300.0)
_CLOSE = _PAIR.replace(backlash=15e-6)
#: In Taylor steps: powers, series and tables, on both flanks.
TAYLOR = {
    "everything": Known(
        OneDegreePair(pair=_CLOSE, **_DAMPINGS, **_POWERS, **_WAVES), 0.85, (1.0, -5.0), 2
    ),
    "quadratic damping that begins": Known(
        OneDegreePair(pair=_PAIR, **_POWERS), 0.85, (1.0, -3.0), 2
    ),
    "series": Known(
        OneDegreePair(
            pair=_CLOSE, **{**_DAMPINGS, "quadratic_damping": 0.0}, profile=Fourier(5), **_WAVES
        ),
        0.8,
        (1.0, -5.0),
        2,
    ),
    "table": Known(OneDegreePair(pair=_CLOSE, **_POWERS, profile=TABLE), 0.9, (1.0, -5.0), 2),
    "oscillator with a series": Known(KNOWN["series"].model, 0.8, (0.3, -1.0), 2),
}
SLOPES |= TAYLOR


def named(case):
    """Return the parameters by which a case is differentiated."""
    names = [name for name in case.model.derivatives if not name.startswith(LEFT)]
    if not isinstance(case.model, gearlib.GearPair):
        edges = ()
    else:
        edges = ("backlash", "backlash_ratio") if math.isinf(case.model.backlash) else ()
    if isinstance(case.state, str):
        # Where nothing holds the train a little stiffness decides where it rests.
        names = [name for name in names if not name.startswith(("initial", "torsional"))]
    return [name for name in names if name not in edges]


@pytest.mark.parametrize("name", SLOPES)
def test_derivatives_have_ten_digits(name):
    case = SLOPES[name]
    names = named(case)
    run = simulate(
        case.model,
        case.tuning,
        periods=case.periods,
        initial_state=case.state,
        sensitivities=names,
    )
    assert int(run.sensitivity_status) == (5 if name.startswith("contact ratio") else 0)
    description = describe(case.model)
    arguments = description, case.tuning, case.periods, case.state
    variables = ("event_phase", "event_velocity", "final_state", *EXTREMA, *TIMES)
    rows = REFERENCES.rows(reference_slopes.of_run, *arguments, names)
    for parameter, reference in zip(names, rows, strict=True):
        found = [np.ravel(run[f"d_{one}_d_{parameter}"].values) for one in sorted(variables)]
        found = np.concatenate(found)
        reference = np.array(reference, float)
        # Where all stiffness is C_min and C_max: the last but one of the variables by name.
        left = (-2,) if description.get("stiffness_ratio") == 1.0 else ()
        close(found, reference, (name, parameter), description, case.tuning, left)


def close(found, reference, about, description, tuning, left=()):
    """Assert that derivatives by one parameter have ten digits, those that are NaN left out."""
    value = abs(float(size_of(description, tuning, about[1]))) or 1.0
    # The force jumps at a segment that appears: these are no numbers.
    there = np.isfinite(found)
    assert there.all() or "contact" in about[1]
    # Nor has the reference those of events that part.
    there &= np.isfinite(reference)
    there[list(left)] = False
    found, reference = found[there], reference[there]
    # By a relative change at least a part in 1e13 of a value of order one.
    size = np.maximum(np.abs(reference), LEAST * np.abs(reference).max())
    size = np.maximum(size, 1e-4 / value)
    off = np.abs(found - reference) / size
    assert off.max() <= SHARE, (*about, off.max())


@pytest.mark.parametrize(
    ("model", "tuning", "guess"),
    [
        (DAMPED, 0.9, None),
        (DAMPED, 0.7, None),
        (OTHER, 0.5, None),
        (OTHER, 0.88, (0.096, -2.833)),
        (OTHER, 0.851, (-0.1022, -1.4451)),
        (OSCILLATOR, 0.8, None),
    ],
)
def test_derivatives_of_orbits_and_multipliers(model, tuning, guess):
    orbit = periodic_orbit(model, tuning, guess=guess)
    names = [name for name in model.derivatives if not name.startswith("initial")]
    found = orbit_sensitivities(orbit, names)
    assert int(found.sensitivity_status) == 0
    start, description = tuple(round(float(x), 6) for x in orbit.state), describe(model)
    rows = REFERENCES.rows(reference_slopes.of_orbit, description, tuning, 1, start, names)
    parts = ("state", "multiplier_real", "multiplier_imaginary")
    for name, reference in zip(names, rows, strict=True):
        row = np.concatenate([np.ravel(found[f"d_{part}_d_{name}"].values) for part in parts])
        close(row, np.array(reference, float), (type(model).__name__, name), description, tuning)


@pytest.mark.parametrize(
    ("name", "direction"),
    [
        ("everything", "cubic_damping"),
        ("everything", "backlash"),
        ("quadratic damping that begins", "contact_ratio"),
        ("series", "stiffness_ratio"),
        ("table", "cubic_stiffness"),
        ("oscillator with a series", "tuning"),
    ],
)
def test_maps_in_taylor_steps_change_as_their_differences_say(name, direction):
    # Differences of maps, exact themselves, extrapolated: nine digits less one for rounding.
    model, tuning, state, periods = TAYLOR[name]
    propagator = model.propagator(tuning)
    z, along = propagator.start(state), propagator.directions(model, [direction])
    _, rates, code = propagator.map_rates(z, along, np.zeros((2, 1)), periods, 1000)
    assert code == 0

    def whole(share):
        if direction == "tuning":
            other = model.propagator(tuning + share * tuning)
        else:
            value = getattr(model, direction)
            other = model.replace(**{direction: value * (1.0 + share)}).propagator(tuning)
        first, second = other.maps(z, periods, 1000)[1]
        return second @ first

    size = tuning if direction == "tuning" else getattr(model, direction)
    one, two = ((whole(h) - whole(-h)) / (2.0 * h * size) for h in (1e-5, 2e-5))
    found, expected = rates[0], (4.0 * one - two) / 3.0
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-8 * np.abs(expected).max())


@pytest.mark.parametrize(
    ("pair", "start", "to", "contacts"),
    [
        (OTHER, 0.8, 0.93, ["NB", "NBIB"]),
        (replace(DAMPED, backlash_damping=0.0), 0.79, 0.83, ["NB"]),
    ],
)
def test_derivatives_of_folds(pair, start, to, contacts):
    branch = gearlib.continue_orbit(periodic_orbit(pair, start), to=to)
    folds = np.flatnonzero(branch.label == 1)[: len(contacts)]
    assert branch.contacts.values[folds].tolist() == contacts
    names, description = (
        [n for n in pair.derivatives if n[:3] not in ("ini", "tun")],
        describe(pair),
    )
    for point in folds:
        found = gearlib.fold_sensitivities(pair, branch, int(point), names)
        guess = (*branch.state.values[point], float(branch.tuning[point]))
        guess = tuple(round(float(value), 6) for value in guess)
        rows = REFERENCES.rows(reference_slopes.of_fold, description, 1, guess, names)
        for name, reference in zip(names, rows, strict=True):
            row = np.array([float(found[f"d_tuning_d_{name}"])])
            close(row, np.array(reference, float), ("fold", name), description, 1.0)
