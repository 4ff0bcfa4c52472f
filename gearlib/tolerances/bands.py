"""Runs of many designs over speed: bands, probability of losing contact and of each branch.

Of each run no more than its motion's height, force and contact are kept. Statistics never mix two
motions: those met on the way up, on the way down and from other starts stand side by side.
"""

from concurrent.futures import ThreadPoolExecutor
from typing import NamedTuple

import numpy as np

from gearlib.kernels import orbit
from gearlib.models.model import FAR
from gearlib.runs.run_arguments import MAX_EVENTS, Rows, Span
from gearlib.runs.sweeping import sweep
from gearlib.tolerances.designs import part_of

#: How each speed is come to: carried up or down from the one before, from rest, or seeded.
DIRECTIONS = ("up", "down", "cold", "seeded")
#: Quantiles of the bands.
QUANTILES = (0.05, 0.5, 0.95)
#: Where a seeded start ends: on the only motion that up and down have, on that of the two with the
#: lower or higher course, on neither.
MOTIONS = ("only", "lower", "higher", "another")
#: Motions whose heights differ by more, as a share of the larger, are two.
_OTHER = 0.02
#: Designs that a thread takes at a time.
_SOME = 8


class Asked(NamedTuple):
    """What is run of each design."""

    rates: np.ndarray  #: speeds, rpm, or tunings where nothing turns, shape (m,)
    directions: tuple  #: some of `DIRECTIONS`
    periods: int
    recorded: int
    box: tuple  #: of the seeded starts: ends of displacement and of dx/dtau


class Points(NamedTuple):
    """What is kept of runs, each of shape (n, d, m): designs, directions, speeds."""

    height: np.ndarray  #: peak to peak, m; static deflections where nothing turns
    factor: np.ndarray  #: largest force over the load
    lost: np.ndarray  #: whether contact is lost
    settled: np.ndarray  #: whether the motion has settled
    status: np.ndarray  #: of the run, -1: there is no such design


def empty(count, asked):
    """Return `Points` of so many designs, none of them run."""
    shape = count, len(asked.directions), asked.rates.size
    real = (np.full(shape, np.nan, np.float32) for _ in range(2))
    return Points(*real, *(np.full(shape, fill, np.int8) for fill in (0, 0, -1)))


def run(designs, points, values, asked, threads, done=lambda count: None):
    """Return (`Points`, refusals) of designs by their points of the cube and their values."""
    found = empty(len(values), asked)
    low, high = np.transpose(asked.box)
    starts = low + (high - low) * points[:, -2:]
    pairs, models, refusals = designs.pairs(values)
    # In compiled code only those that there are.
    there = np.array([not text for text in refusals])
    rows = found if pairs is None or there.all() else empty(int(there.sum()), asked)
    kind = designs.nominal.kind()

    def some(first):
        own = slice(first, first + _SOME)
        part = Points(*(one[own] for one in rows))
        if pairs is not None:
            _of_pairs(kind, pairs, own, starts[there][own], asked, part)
        else:
            for i, model in enumerate(models[own]):
                if model is not None:
                    _of_model(model, starts[first + i], asked, Points(*(one[i] for one in part)))
        done(len(part.status))

    with ThreadPoolExecutor(threads) as pool:
        list(pool.map(some, range(0, len(rows.status), _SOME)))
    if rows is not found:
        for one, own in zip(found, rows, strict=True):
            one[there] = own
    return found, refusals


def _of_pairs(kind, pairs, own, starts, asked, rows):
    """Run plain pairs, one with arrays for numbers, in compiled code."""
    part = part_of(pairs, own)
    count, speeds = len(starts), asked.rates.size
    tunings = np.ascontiguousarray(asked.rates / part.speed(np.ones(count))[:, None])
    span = Span(asked.periods, asked.recorded, MAX_EVENTS)
    gap = part.backlash_ratio
    extent = np.maximum(1.0, np.where(np.isfinite(gap), gap, 0.0))
    order = np.argsort(asked.rates)
    table = np.empty((count, speeds, orbit.SUMMARY_COLUMNS))
    ends, codes = np.empty((count, speeds, 2)), np.empty((count, speeds, 2), np.int64)
    for k, direction in enumerate(asked.directions):
        states = np.ascontiguousarray(starts) if direction == "seeded" else np.zeros((count, 2))
        reach = np.maximum(np.abs(states[:, 0]), tunings.max(axis=1) * np.abs(states[:, 1]))
        way = order[::-1].copy() if direction == "down" else order
        carry = direction in ("up", "down")
        bounds = FAR * np.maximum(extent, reach)
        kind.run_designs(part, tunings, way, states, carry, span, Rows(bounds, table, ends, codes))
        height = table[..., orbit.X_MAX] - table[..., orbit.X_MIN]
        rows.height[:, k] = height * part.static_deflection[:, None]
        rows.factor[:, k] = table[..., orbit.FORCE_MAX]
        free = table[..., orbit.TIME_BACKLASH] + table[..., orbit.TIME_INVERSE]
        rows.lost[:, k] = free > 0.0
        rows.settled[:, k] = codes[..., 0] > 0
        rows.status[:, k] = codes[..., 1]


def _of_model(model, start, asked, rows):
    """Run any model by `gearlib.sweep`."""
    key = {"tunings": asked.rates} if model.speed is None else {"speeds": asked.rates}
    for k, direction in enumerate(asked.directions):
        state = tuple(start.tolist()) if direction == "seeded" else (0.0, 0.0)
        curve = sweep(
            model,
            **key,
            periods=asked.periods,
            record_periods=asked.recorded,
            direction="cold" if direction == "seeded" else direction,
            initial_state=state,
            threads=1,
        )
        height = curve.displacement_max - curve.displacement_min
        factor = curve.dynamic_factor if "dynamic_factor" in curve else curve.dynamic_force_max
        lost = curve.fraction_backlash + curve.fraction_inverse > 0.0
        if model.mesh_names:
            height, factor, lost = (one.max("mesh") for one in (height, factor, lost))
        rows.height[k] = height * (model.static_deflection or 1.0)
        rows.factor[k] = factor
        rows.lost[k] = lost
        rows.settled[k] = curve.period > 0
        rows.status[k] = curve.status


def statistics(points, directions, over):
    """Return name -> (dims, values) of `Points` of all designs over "speed" or "tuning"."""
    ran = points.status == 0
    count = ran.sum(axis=0)
    # Where no run could go on there is nothing to tell.
    per = np.where(count > 0, count, np.nan)
    both = ("direction", over)
    found = {
        "run_count": (both, count.astype(np.int32)),
        "failed_runs": (both, (points.status > 0).sum(axis=0).astype(np.int32)),
        "contact_loss_probability": (both, (ran & (points.lost > 0)).sum(axis=0) / per),
        "unsettled_share": (both, (ran & (points.settled == 0)).sum(axis=0) / per),
    }
    for name, values in (("height_band", points.height), ("factor_band", points.factor)):
        found[name] = ("quantile", *both), _quantiles(values, ran)
    if {"up", "down"} <= set(directions):
        found |= _of_branches(points, ran, [*directions], over)
    return found


def _quantiles(values, ran):
    """Return quantiles over the designs that ran, shape (3, d, m)."""
    found = np.full((len(QUANTILES), *values.shape[1:]), np.nan)
    for place in np.ndindex(values.shape[1:]):
        own = values[(slice(None), *place)][ran[(slice(None), *place)]]
        if own.size:
            found[(slice(None), *place)] = np.quantile(own.astype(float), QUANTILES)
    return found


def _of_branches(points, ran, directions, over):
    """Return how often up and down are two motions, and where seeded starts end."""
    up, down = (directions.index(name) for name in ("up", "down"))
    first, second = points.height[:, up], points.height[:, down]
    both = ran[:, up] & ran[:, down]
    two = both & ~_same(first, second)
    known = both.sum(axis=0)
    per = np.where(known > 0, known, np.nan)
    found = {"two_motions_probability": ((over,), two.sum(axis=0) / per)}
    if "seeded" not in directions:
        return found
    k = directions.index("seeded")
    own, there = points.height[:, k], both & ran[:, k]
    low, high = np.minimum(first, second), np.maximum(first, second)
    on_low, on_high = _same(own, low), _same(own, high)
    # Of both the nearer one: within its tolerance the other may lie as well.
    nearer = np.abs(own - low) <= np.abs(own - high)
    apart = (
        ~two & (on_low | on_high),
        two & on_low & (nearer | ~on_high),
        two & on_high & (~nearer | ~on_low),
        ~(on_low | on_high),
    )
    count = there.sum(axis=0)
    per = np.where(count > 0, count, np.nan)
    shares = np.array([(there & one).sum(axis=0) / per for one in apart])
    return found | {"motion_probability": (("motion", over), shares)}


def _same(a, b):
    """Return where two heights are those of one motion."""
    with np.errstate(invalid="ignore"):
        return np.abs(a - b) <= _OTHER * np.maximum(a, b)
