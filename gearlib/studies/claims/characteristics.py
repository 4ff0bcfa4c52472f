"""Rules for the statements on scales, characteristics and phase planes, Fig. 3 and 5.

A rule gets the `Data` and returns (whether the statement holds, the computed numbers in words).
All are judged with the accuracy of the paper's plots. Where a stricter reading, that an orbit
repeats after whole mesh periods within 1e-6 of its height, gives another answer, a rule returns
what it finds as a third item.
"""

import numpy as np

from gearlib.data.motions import LINE, ending, spread, true_intervals
from gearlib.studies.claims.data import READING, TOUCH

#: How far the band around nu = 0.66 may reach to be "a small region": the paper gives one figure.
SMALL_REGION = 0.02


def intervals(tuning, where):
    """Return the ranges of tuning in which `where` is true, in words."""
    pairs = [(tuning[i], tuning[j]) for i, j in true_intervals(where)]
    return ", ".join(f"{a:.4g}" if a == b else f"{a:.4g} ... {b:.4g}" for a, b in pairs) or "none"


def scales(data):
    printed = {0.815: (0.7391, 0.9639), 0.8151: (0.7392, 0.9640)}
    got = {nu: (data.pair.tuning_max(nu), data.pair.tuning_min(nu)) for nu in printed}
    # Printed with four decimals.
    holds = all(
        abs(a - b) <= 0.5001e-4 for nu in printed for a, b in zip(printed[nu], got[nu], strict=True)
    )
    return holds, "; ".join(f"{nu:g}: {a:.5f}, {b:.5f}" for nu, (a, b) in got.items())


def damping_ratios(data):
    # N s/m, as printed, and half a unit of the last printed digit.
    printed = {3950.0: (0.062, 0.5e-3), 4000.0: (0.0624, 0.5e-4), 40.0: (0.000624, 0.5e-6)}
    got = {k: data.pair.replace(material_damping=k).damping_ratio for k in printed}
    holds = all(abs(got[k] - beta) <= digit for k, (beta, digit) in printed.items())
    return holds, "; ".join(f"{k:g} N s/m: {beta:.6g}" for k, beta in got.items())


def conservative_smooth(data):
    curve = data.curve(data.names(False, False)[0], 0.6, 0.8 - READING)
    lost = curve.displacement_min.values < -TOUCH
    tuning = curve.tuning.values
    inside = abs(tuning - 0.66) <= SMALL_REGION
    holds = bool(lost[inside].any() and not lost[~inside].any())
    # The upper end is the paper's 0.8 less the reading of its plot; where exactly bounces begin
    # is the next statement.
    return holds, f"below {0.8 - READING:g}: contact lost at {intervals(tuning, lost)}"


def conservative_chaotic(data):
    curve = data.curve(data.names(False, False)[0], 0.7, 1.12)
    tuning = curve.tuning.values
    lost = curve.displacement_min.values < -TOUCH
    first = tuning[lost][0] if lost.any() else np.nan
    above = tuning >= first
    share = {
        "contact lost": lost[above].mean(),
        "inverse mesh": (curve.fraction_inverse.values[above] > 0).mean(),
        "unsteady": (curve.period.values[above] == 0).mean(),
    }
    # "Bounces and inverse mesh, chaotic": no tuning without bounces, and each found in most.
    holds = abs(first - 0.8) <= READING and share["contact lost"] == 1.0
    holds &= share["inverse mesh"] > 0.5 and share["unsteady"] > 0.5
    # At which of them, rounding decides: the motion is chaotic.
    words = ", ".join(f"{name}: {in_words(value)}" for name, value in share.items())
    return bool(holds), f"bounces begin at {first:.4g}; of the tunings from there to 1.12: {words}"


def in_words(share):
    """Return a share of chaotic motions: exactly how many, rounding decides."""
    some = "most" if share > 0.5 else "some"
    return {1.0: "all", 0.0: "none"}.get(float(share), some)


def damped_bounces(data):
    low, high = 0.6, data.resonance.tuning.values[-1]
    holds, words = True, []
    for name in data.names(material=True):
        curve = data.curve(name, low, max(high, 1.12 + 2 * READING))
        tuning = curve.tuning.values
        lost = curve.displacement_min.values < -TOUCH
        inverse = bool((curve.fraction_inverse.values > 0).any())
        first, last = (tuning[lost][0], tuning[lost][-1]) if lost.any() else (np.nan, np.nan)
        holds &= abs(first - 0.8) <= 2 * READING and abs(last - 1.12) <= 2 * READING
        holds &= not inverse
        words.append(
            f"{name}: {intervals(tuning, lost)}, inverse mesh {'yes' if inverse else 'no'}"
        )
    return bool(holds), "contact lost at " + "; ".join(words)


def only_oil_bounces_above(data):
    high = data.resonance.tuning.values[-1]
    damped = [name for name, flags in data.dampings.items() if any(flags)]
    oil = data.names(False, True)
    lost = {}
    for name in damped:
        # Above the paper's 1.12 by more than the reading of its plot.
        curve = data.curve(name, 1.12 + 2 * READING, high)
        lost[name] = float((curve.displacement_min.values < -TOUCH).mean())
    holds = all((share > 0) == (name in oil) for name, share in lost.items())
    words = ", ".join(f"{name} {100 * share:.0f} %" for name, share in lost.items())
    return holds, f"tunings above 1.14 with contact lost: {words}"


_PLANES = (0.60, 0.66, 0.78, 0.80, 0.81, 0.82)


def conservative_planes(data):
    name = data.names(False, False)[0]
    planes = data.planes(name, list(_PLANES))
    unsteady = np.array([spread(planes.isel(tuning=i)) > LINE for i in range(len(_PLANES))])
    lost = planes.displacement_min.values < -TOUCH
    inverse = planes.fraction_inverse.values > 0
    at = np.array(_PLANES)
    holds = bool(unsteady.all())
    holds &= at[lost].tolist() == [0.66, 0.80, 0.81, 0.82]
    holds &= at[inverse].tolist() == [0.81, 0.82]
    words = {"unsteady": unsteady, "bounces": lost, "inverse mesh": inverse}
    words = "; ".join(f"{key} at {listed(at[where])}" for key, where in words.items())
    return holds, words, *_strictly({name: (planes, unsteady)})


def damped_planes(data):
    expected = {name: [] for name, flags in data.dampings.items() if any(flags)}
    for name in data.names(False, True):
        expected[name] = [0.60, 0.66, 0.78]
    at = np.array(_PLANES)
    holds, words, seen = True, [], {}
    for name in expected:
        planes = data.planes(name, list(_PLANES))
        spreads = np.array([spread(planes.isel(tuning=i)) for i in range(at.size)])
        seen[name] = planes, spreads > LINE
        holds &= at[spreads > LINE].tolist() == expected[name]
        at_these = ", ".join(
            f"{at[i]:.2f} ({spreads[i]:.1g}, {ending(planes.isel(tuning=i))})"
            for i in np.flatnonzero(spreads > LINE)
        )
        words.append(f"{name} unsteady at {at_these or 'none'}")
    words = "; ".join(words) + " (in brackets: how far mesh periods lie apart, over the height)"
    return holds, words, *_strictly(seen)


def _strictly(seen):
    """Return what does not repeat strictly but looks steady, or the reverse; empty: nothing.

    `seen`: phase planes and whether they look unsteady, by the name of the damping.
    """
    others = []
    for name, (planes, unsteady) in seen.items():
        for i in range(unsteady.size):
            plane = planes.isel(tuning=i)
            period = repeats(plane)
            if unsteady[i] == (period == 0):
                continue
            change = f"changes by {drift(plane):.1g} of its height per orbit"
            change = f"repeats after {period} periods" if period else change
            others.append(f"{name} at {float(plane.tuning):.2f} {change}")
    return [", ".join(others)] if others else []


def drift(run):
    """Return by how much an unsteady orbit misses repeating, over its height.

    The smallest over whole numbers of mesh periods up to half the record; tells a motion that
    still settles from one that never does.
    """
    return min(_misses(run), default=np.nan)


def repeats(run):
    """Return after how many mesh periods a record repeats to 1e-6 of its height; 0: it does not."""
    return next((n for n, miss in enumerate(_misses(run), 1) if miss <= 1e-6), 0)


def _misses(run):
    x, n = run.displacement.values, _per_period(run)
    return [np.abs(x[k:] - x[:-k]).max() / np.ptp(x) for k in range(n, x.size // 2 + 1, n)]


def _per_period(run):
    # The phase starts at zero, so that its size over its span counts the samples of a period.
    return round(2.0 * np.pi / float(run.phase[1] - run.phase[0]))


def listed(values):
    return ", ".join(f"{value:.2f}" for value in values) or "none"
