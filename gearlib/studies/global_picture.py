"""Basins of attraction, bifurcation diagrams with exponents and shares, Poincare sections."""

import math

import numpy as np
import xarray as xr

from gearlib.analysis import lyapunov
from gearlib.analysis.global_dynamics.attractors import UNDECIDED
from gearlib.analysis.global_dynamics.basins import KIND_FLAGS, basin_stability, basins
from gearlib.analysis.global_dynamics.poincare import bifurcation_diagram, poincare_section
from gearlib.data import status
from gearlib.data.variables import describe
from gearlib.models.pair import GearPair
from gearlib.runs.sweeping import CARRIED

#: Values of the attractors that a case has fewer than another.
_FILL = {
    "basin": -1,
    "attractor_kind": UNDECIDED,
    "period": 0,
    "contact_pattern": "",
    "grazing": 0,
}


def _over_cases(parts, cases, **options):
    """Return datasets of cases as one, with the attributes that they share."""
    titles = xr.IndexVariable("case", [case["title"] for case in cases])
    data = xr.concat(parts, titles, data_vars="all", combine_attrs="drop", **options)
    return describe(data.assign_attrs(parts[0].attrs))


def basin_cases(cases, settings, threads=None):
    """Return the basins of several cases, over ``case``.

    A case has title, tuning and pair, arguments of `GearPair`; `settings` have displacement and
    velocity, (lowest, highest), the count in each direction, and periods.
    """
    grid = tuple((*settings[name], settings["count"]) for name in ("displacement", "velocity"))
    options = {"periods": settings["periods"], "threads": threads}
    parts = [basins(GearPair(**case["pair"]), case["tuning"], grid, **options) for case in cases]
    data = _over_cases(parts, cases, join="outer", fill_value=_FILL)
    data["attractor_kind"].attrs |= KIND_FLAGS
    return data


def bifurcation(pair, tunings, coarse, settings, threads=None):
    """Return a diagram with its exponents over tuning, and shares of the attractors over `coarse`.

    `settings` have settle, strobes, exponent_periods, starts, displacement, velocity, samples and
    periods. Directions are up, down, and "cold 1", "cold 2", ... from random initial states.
    ``settled`` says whether a motion is periodic and not on an orbit that rounding has chosen.
    """
    pair, region = GearPair(**pair), (settings["displacement"], settings["velocity"])
    names = [*CARRIED, *(f"cold {i + 1}" for i in range(settings["starts"]))]
    starts = [(0.0, 0.0)] * len(CARRIED) + _random_states(region, settings["starts"]).tolist()
    directions = [name.split()[0] for name in names]
    record = {name: settings[name] for name in ("settle", "strobes")}
    counted = {"settle": 0, "periods": settings["exponent_periods"], "threads": threads}
    diagrams, parts = [], []
    for direction, start in zip(directions, starts, strict=True):
        options = record | {"direction": direction, "initial_state": start}
        diagram = bifurcation_diagram(pair, tunings, **options)
        rates = lyapunov.lyapunov_exponents(
            pair, tunings, states=diagram.final_state.values, **counted
        )
        # Where the diagram could not go on, the exponents could not either.
        stopped = diagram.status.where(diagram.status != status.OK, rates.status)
        diagrams.append(diagram)
        parts.append(diagram.assign(rates.data_vars).assign(status=stopped))
    data = xr.concat(parts, xr.IndexVariable("direction", names), combine_attrs="drop")
    known = lyapunov.settled(pair, diagrams, directions, starts).astype(np.int8)
    data = data.assign(settled=(("direction", "tuning"), known, {}))
    data = describe(data.assign(speed=("tuning", pair.speed(data.tuning.values))))
    data["settled"].attrs |= lyapunov.SETTLED_FLAGS
    options = {name: settings[name] for name in ("samples", "periods")}
    shares = basin_stability(pair, coarse, region, threads=threads, **options)
    return data.assign_attrs(parts[0].attrs), shares


def _random_states(region, count):
    """Return random initial states in a region, shape (count, 2), always the same ones."""
    low, high = np.array(region).T
    return low + np.random.default_rng(0).random((count, 2)) * (high - low)


def sections(cases, settings):
    """Return Poincare sections of random initial states, over ``case``.

    A case has title, tuning, phase (degrees), settle and pair, arguments of `GearPair`; `settings`
    have displacement and velocity, (lowest, highest), orbits and periods. Motions that rounding
    leads elsewhere are chaotic; undecided are those of which deviations have grown by less, but by
    more than in regular ones, or before the record only.
    """
    region, periods = (settings["displacement"], settings["velocity"]), settings["periods"]
    states, parts = _random_states(region, settings["orbits"]), []
    for case in cases:
        pair, tuning, settle = GearPair(**case["pair"]), case["tuning"], case["settle"]
        span = {"periods": periods, "settle": settle}
        section = poincare_section(pair, tuning, states, phase=math.radians(case["phase"]), **span)
        rates = [lyapunov.largest(pair, tuning, state=tuple(state), **span) for state in states]
        lost = np.array(
            [lyapunov.rounding_decides(pair, [tuning], z, settle + periods)[0] for z in states]
        )
        grown = np.array([rate.exceeds_linear for rate in rates])
        chaotic = np.where(lost & grown, 1, 2 * (lost | grown)).astype(np.int8)
        exponents = [rate.value for rate in rates]
        section = section.assign(chaotic=("orbit", chaotic), exponent=("orbit", exponents))
        parts.append(section.drop_vars("strobe"))
    data = _over_cases(parts, cases)
    data["chaotic"].attrs |= status.flags_of(("regular", "chaotic", "undecided"))
    return data
