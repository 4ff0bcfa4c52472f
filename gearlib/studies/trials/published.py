"""Published problems of oscillators with a dead zone, as validation cases.

Each is one set of parameters of `gearlib.DeadZoneOscillator`. `survey` finds the motions that
coexist, labels them, compares each with an independent integration and scans one parameter.

===============  ===================================================================================
problem          what was checked of its source
===============  ===================================================================================
gear_rattle      title, journal and DOI; equation and parameters as A. Wagemakers' collection of
                 basins of attraction (github.com/awage/BasinsCollection) has them. The article
                 itself could not be opened.
gear_pair        the form of the equation is Kahraman's and Singh's; neither the article nor the
                 origin of this set of parameters could be opened.
soft_impact      DOI, equation and parameters as in the same collection, for chaos beside a motion
                 without impact. The article itself could not be opened.
===============  ===================================================================================

No number is quoted from the articles, so none is compared: what is compared is an integration by
scipy that ends at every contact, and, for the soft impact, the closed form of the motion without.
"""

import math
from collections.abc import Callable
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import xarray as xr

from gearlib.analysis.orbits.shooting import periodic_orbit
from gearlib.analysis.trust import LABELS, trust
from gearlib.data import provenance
from gearlib.data.variables import describe
from gearlib.kernels import orbit
from gearlib.models.dead_zone import DeadZoneOscillator
from gearlib.models.harmonics import Harmonics
from gearlib.models.profiles import Series
from gearlib.runs.simulation import run, simulate

if TYPE_CHECKING:  # loaded by name, for `workflow.sources`
    from gearlib.integrators import scipy_ivp  # noqa: F401

#: Runs whose extrema differ by less, in heights of the orbit, are on the same one.
_SAME = 1e-4
#: The independent integration: tolerances near the rounding of its steps.
_JUDGE = {"solver": "DOP853", "rtol": 1e-13, "atol": 1e-14, "events": True}
#: Of the sequence of starts that fills a box evenly: 1 / r and 1 / r^2, r^3 = r + 1.
_FILL = np.array([0.7548776662466927, 0.5698402909980532])


class Problem(NamedTuple):
    """A published problem; one of its parameters can be varied."""

    source: str
    make: Callable  #: parameter -> (model, frequency of the forcing)
    parameter: str  #: its name in words
    value: float  #: that of the source
    scan: tuple  #: lowest and highest value of the scan
    box: tuple  #: largest displacement and velocity x' of the starts


def gear_rattle(eccentricity, backlash=0.6, drag=0.6, stiffness=100.0):
    """Return the model of rattling gears and the frequency of its forcing, whose period is 1.

    theta'' + d theta' + 2 k B(theta) = 4 pi d - 4 pi^2 e cos 2 pi t - 2 pi e d sin 2 pi t, with the
    backlash function B, 0 in |theta| < `backlash`.
    """
    forcing = Harmonics(
        (-4.0 * math.pi**2 * eccentricity,), (-2.0 * math.pi * eccentricity * drag,)
    )
    model = DeadZoneOscillator(
        upper_edge=backlash,
        lower_edge=-backlash,
        upper_stiffness=2.0 * stiffness,
        damping=drag,
        load=4.0 * math.pi * drag,
        forcing=forcing,
    )
    return model, 2.0 * math.pi


def gear_pair(frequency):
    """Return x'' + 2 zeta x' + k(t) B(x) = F_m + sum F_r (r W)^2 cos r W t, three harmonics."""
    model = DeadZoneOscillator(
        upper_edge=1.0,
        lower_edge=-1.0,
        upper_stiffness=Series(1.0, Harmonics((-0.2, -0.1, -0.05))),
        damping=2.0 * 0.05,
        load=0.1,
        # The support moves by minus the error of the transmission.
        deviation=Harmonics((-0.01, -0.004, -0.002)),
    )
    return model, frequency


def soft_impact(gap):
    """Return y'' + 2 xi y' + y + alpha H(y - g) (y - g) = beta cos omega t."""
    model = DeadZoneOscillator(
        upper_edge=gap,
        upper_stiffness=20.0,
        damping=2.0 * 0.02,
        ground_stiffness=1.0,
        forcing=Harmonics((0.5,)),
    )
    return model, 0.417893


PROBLEMS = {
    "gear_rattle": Problem(
        "Mason, Piiroinen, Wilson, Homer: Basins of attraction in nonsmooth models of gear "
        "rattle, International Journal of Bifurcation and Chaos 19 (2009) 203-224, "
        "doi:10.1142/S021812740902283X",
        gear_rattle,
        "eccentricity",
        0.1,
        (0.0, 0.3),
        (0.6, 4.0),
    ),
    "gear_pair": Problem(
        "Kahraman, Singh: Interactions between time-varying mesh stiffness and clearance "
        "non-linearities in a geared system, Journal of Sound and Vibration 146 (1991) 135-156",
        gear_pair,
        "frequency of the forcing",
        0.5,
        (0.2, 1.8),
        (2.0, 2.0),
    ),
    "soft_impact": Problem(
        "de Souza, Wiercigroch, Caldas, Balthazar: Suppressing grazing chaos in impacting system "
        "by structural nonlinearity, Chaos, Solitons & Fractals 38 (2008) 864-869, "
        "doi:10.1016/j.chaos.2007.01.022",
        soft_impact,
        "gap",
        0.63,
        (0.55, 0.65),
        (1.0, 1.0),
    ),
}


def survey(name, *, starts, settle, exponent_periods, points, values, check_periods):
    """Find and label the motions of a published problem, and scan its parameter.

    Parameters
    ----------
    name : str
        A key of `PROBLEMS`.
    starts : int
        Initial states, spread evenly over the problem's box, whose motions are told apart.
    settle : int
        Periods of the forcing of each run before it is looked at.
    exponent_periods : int
        Periods over which Lyapunov exponents are averaged.
    points : int
        Points of every Poincare section.
    values : int
        Values of the scanned parameter, three starts each.
    check_periods : int
        Periods over which each motion is compared with the independent integration.

    Returns
    -------
    xarray.Dataset
        Over ``attractor``: label (index in `gearlib.analysis.trust.LABELS`), period, share of the
        starts, displacement_max and _min, exponent, uncertainty, largest_multiplier (NaN where not
        periodic), disagreement; over (attractor, phase) displacement and velocity; over
        (attractor, strobe) strobe_displacement and strobe_velocity at phase 0; over (value,
        start, scan_strobe) scan_displacement. Velocities are by phase.
    """
    problem = PROBLEMS[name]
    model, frequency = problem.make(problem.value)
    groups = _attractors(model, frequency, _box(problem, starts, frequency), settle)
    rows, data = [], []
    for state, share in groups:
        row, series = _motion(model, frequency, state, settle, exponent_periods, check_periods)
        rows.append(row | {"share": share / starts})
        data.append(series | _section(model, frequency, state, points))
    scanned, seen = _scan(problem, values, settle)
    variables = {key: ("attractor", np.array([row[key] for row in rows])) for key in rows[0]}
    for key in ("displacement", "velocity"):
        variables[key] = (("attractor", "phase"), np.array([one[key] for one in data]))
        strobes = np.array([one[f"strobe_{key}"] for one in data])
        variables[f"strobe_{key}"] = (("attractor", "strobe"), strobes)
    variables["scan_displacement"] = (("value", "start", "scan_strobe"), seen)
    variables |= {"tuning": frequency, "chosen_value": problem.value}
    variables |= {"upper_edge": model.upper_edge, "lower_edge": model.lower_edge}
    coords = {"phase": data[0]["phase"], "value": scanned}
    dataset = describe(xr.Dataset(variables, coords), model)
    dataset["value"].attrs["long_name"] = problem.parameter
    dataset["label"].attrs |= {
        "flag_values": np.arange(len(LABELS), dtype=np.int8),
        "flag_meanings": " ".join(label.replace("-", "_") for label in LABELS),
    }
    dataset.attrs = provenance.attributes(
        "Motions of a dead-zone oscillator",
        model,
        method="several",
        problem=name,
        starts=starts,
        settle=settle,
        exponent_periods=exponent_periods,
        check_periods=check_periods,
    ) | {"references": problem.source}
    return dataset


def _box(problem, count, frequency):
    """Return initial states that fill the box evenly, shape (count, 2), velocities by phase."""
    places = 2.0 * np.mod(0.5 + np.arange(count)[:, None] * _FILL, 1.0) - 1.0
    return places * (problem.box[0], problem.box[1] / frequency)


def _run(model, frequency, state, periods, record_periods):
    """Return a `Run` whose samples are its stroboscopic states."""
    return run(
        model,
        frequency,
        periods=periods,
        record_periods=record_periods,
        samples_per_period=1,
        initial_state=tuple(state),
    )


def _attractors(model, frequency, states, settle):
    """Return pairs (a state on a motion, number of starts that end there), largest first."""
    found = []
    for state in states:
        run = _run(model, frequency, state, settle, min(16, settle))
        high, low = run.table[orbit.X_MAX], run.table[orbit.X_MIN]
        for entry in found:
            same = entry["period"] == run.period
            # Motions that do not repeat have no extrema to tell them apart.
            close = max(abs(high - entry["high"]), abs(low - entry["low"])) < _SAME * (high - low)
            if same and (close or entry["period"] == 0):
                entry["count"] += 1
                break
        else:
            entry = {"period": run.period, "high": high, "low": low, "count": 1}
            found.append(entry | {"state": run.end})
    found.sort(key=lambda entry: -entry["count"])
    return [(entry["state"], entry["count"]) for entry in found]


def _motion(model, frequency, state, settle, exponent_periods, check_periods):
    """Return (scalars of a motion, its time course over `check_periods`)."""
    state = tuple(map(float, state))
    found = trust(
        model,
        frequency,
        periods=settle,
        initial_state=state,
        record_periods=min(16, settle),
        disturbance=1e-6,
        exponent_periods=exponent_periods,
    )
    multiplier = math.nan
    if found.label == "periodic":
        orbit = periodic_orbit(model, frequency, guess=state, period=found.period)
        state, multiplier = tuple(map(float, orbit.state)), float(np.abs(orbit.multipliers).max())
    course = {"periods": check_periods, "record_periods": check_periods, "initial_state": state}
    run = simulate(model, frequency, **course)
    judge = simulate(model, frequency, method="scipy", options=_JUDGE, **course)
    row = {
        "label": np.int8(LABELS.index(found.label)),
        "period": np.int32(found.period),
        "exponent": found.exponent,
        "uncertainty": found.uncertainty,
        "largest_multiplier": multiplier,
        "displacement_max": float(found.runs.displacement_max[0]),
        "displacement_min": float(found.runs.displacement_min[0]),
        "disagreement": float(np.abs(run.displacement - judge.displacement).max()),
    }
    return row, {name: run[name].values for name in ("phase", "displacement", "velocity")}


def _section(model, frequency, state, points):
    run = _run(model, frequency, state, points, points)
    return {
        "strobe_displacement": run.samples[:, orbit.SAMPLE_X],
        "strobe_velocity": run.samples[:, orbit.SAMPLE_V],
    }


def _scan(problem, count, settle):
    """Return (values of the parameter, stroboscopic displacements), shapes (v,), (v, 3, k)."""
    values = np.linspace(*problem.scan, count)
    kept = min(24, settle)
    seen = np.empty((count, 3, kept))
    for i, value in enumerate(values):
        model, frequency = problem.make(float(value))
        # Other starts for every value, so that no motion is missed throughout.
        for j, state in enumerate(_box(problem, 3 * (i + 1), frequency)[-3:]):
            run = _run(model, frequency, state, settle, kept)
            seen[i, j] = run.samples[:, orbit.SAMPLE_X]
    return values, seen
