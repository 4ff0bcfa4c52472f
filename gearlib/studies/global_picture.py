"""The studies of the workflow: basins, bifurcation diagram with exponents and shares, sections."""

import math

import numpy as np
import xarray as xr

from gearlib.analysis import lyapunov
from gearlib.analysis.global_dynamics.attractors import UNDECIDED
from gearlib.analysis.global_dynamics.basins import KIND_FLAGS, basin_stability, basins
from gearlib.analysis.global_dynamics.poincare import bifurcation_diagram, poincare_section
from gearlib.analysis.lyapunov import lyapunov_exponents
from gearlib.data import status
from gearlib.data.variables import describe
from gearlib.models.pair import GearPair
from gearlib.runs.sweeping import CARRIED

#: What fills the table of a case with fewer attractors than another.
_FILL = {
    "basin": -1,
    "attractor_kind": UNDECIDED,
    "period": 0,
    "contact_pattern": "",
    "grazing": 0,
}


def basin_cases(cases, settings, threads=None):
    """Return the basins of several cases, over ``case``.

    A case is a dict of title, tuning and pair, keyword arguments of `GearPair`; settings are
    displacement and velocity: (lowest, highest); count in each direction; periods.
    """
    grid = tuple((*settings[name], settings["count"]) for name in ("displacement", "velocity"))
    found = [
        basins(
            GearPair(**case["pair"]),
            case["tuning"],
            grid,
            periods=settings["periods"],
            threads=threads,
        )
        for case in cases
    ]
    titles = xr.DataArray([case["title"] for case in cases], dims="case", name="case")
    dataset = xr.concat(
        found, titles, join="outer", fill_value=_FILL, data_vars="all", combine_attrs="drop"
    )
    dataset = describe(dataset)
    dataset["attractor_kind"].attrs |= KIND_FLAGS
    # What was asked is the same in all cases; the pair and the tuning are not.
    dataset.attrs = found[0].attrs
    return dataset


def bifurcation(pair, tunings, coarse, settings, threads=None):
    """Return a diagram up and down with its exponents, and the shares of the attractors.

    pair: keyword arguments of `GearPair`; tunings, coarse: of the diagram, and of the shares;
    settings: settle, strobes, exponent_periods, starts, displacement, velocity, samples, periods.

    diagram: displacement, velocity (direction, tuning, strobe); exponent, uncertainty, period,
    settled (direction, tuning), whether the motion is periodic and rounding does not decide on
    which orbit; speed (rpm) over tuning. Directions: up, down, and "cold 1", "cold 2", ... from as
    many random initial states as `starts`; shares: as in `gearlib.basin_stability`.
    """
    pair = GearPair(**pair)
    region = settings["displacement"], settings["velocity"]
    names = [*CARRIED, *(f"cold {i + 1}" for i in range(settings["starts"]))]
    starts = [(0.0, 0.0)] * len(CARRIED) + _random_states(region, settings["starts"]).tolist()
    diagrams, found = [], []
    directions = [name.split()[0] for name in names]
    for direction, start in zip(directions, starts, strict=True):
        diagram = bifurcation_diagram(
            pair,
            tunings,
            direction=direction,
            settle=settings["settle"],
            strobes=settings["strobes"],
            initial_state=start,
        )
        rates = lyapunov_exponents(
            pair,
            tunings,
            states=diagram.final_state.values,
            settle=0,
            periods=settings["exponent_periods"],
            threads=threads,
        )
        # What stopped the diagram stops the exponents too.
        stopped = diagram.status.where(diagram.status != status.OK, rates.status)
        diagrams.append(diagram)
        found.append(diagram.assign(rates.data_vars).assign(status=stopped))
    names = xr.DataArray(names, dims="direction", name="direction")
    both = xr.concat(found, names, combine_attrs="drop")
    known = lyapunov.settled(pair, diagrams, directions, starts).astype(np.int8)
    both = both.assign(settled=(("direction", "tuning"), known))
    both = describe(both.assign(speed=("tuning", pair.speed(both.tuning.values))))
    both["settled"].attrs |= lyapunov.SETTLED_FLAGS
    both.attrs = found[0].attrs
    shares = basin_stability(
        pair,
        coarse,
        region,
        samples=settings["samples"],
        periods=settings["periods"],
        threads=threads,
    )
    return both, shares


def _random_states(region, count):
    """Return random initial states in a region, shape (count, 2), always the same ones."""
    low, high = np.array(region).T
    return low + np.random.default_rng(0).random((count, 2)) * (high - low)


def sections(cases, settings):
    """Return Poincare sections of random initial states, over ``case``.

    cases (title, tuning, phase (degrees), settle, and pair: keyword arguments of `GearPair`);
    settings (displacement and velocity: (lowest, highest); orbits; periods).

    displacement, velocity (case, orbit, strobe); chaotic, exponent (case, orbit): chaotic are
    motions that rounding leads elsewhere, undecided those of which deviations have grown by less,
    but by more than in regular ones, or before the record only.
    """
    # The same initial states in all cases.
    states = _random_states((settings["displacement"], settings["velocity"]), settings["orbits"])
    found = []
    for case in cases:
        pair, tuning = GearPair(**case["pair"]), case["tuning"]
        settle, periods = case["settle"], settings["periods"]
        section = poincare_section(
            pair, tuning, states, periods=periods, settle=settle, phase=math.radians(case["phase"])
        )
        rates = [
            lyapunov.largest(pair, tuning, state=tuple(state), settle=settle, periods=periods)
            for state in states
        ]
        lost = [
            lyapunov.rounding_decides(pair, [tuning], state, settle + periods)[0]
            for state in states
        ]
        grown = np.array([rate.exceeds_linear for rate in rates])
        chaotic = np.where(lost & grown, 1, 2 * (lost | grown)).astype(np.int8)
        section = section.assign(
            chaotic=("orbit", chaotic), exponent=("orbit", np.array([rate.value for rate in rates]))
        )
        found.append(section.drop_vars("strobe"))
    titles = xr.DataArray([case["title"] for case in cases], dims="case", name="case")
    dataset = describe(xr.concat(found, titles, data_vars="all", combine_attrs="drop"))
    dataset["chaotic"].attrs |= status.flags_of(("regular", "chaotic", "undecided"))
    dataset.attrs = found[0].attrs
    return dataset
