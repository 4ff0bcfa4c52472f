"""Rules for the statements on scales, characteristics and phase planes, Fig. 3 and 5.

A rule gets the `Data` of a configuration and returns whether the statement holds, and a
description of the computed numbers. Statements are judged with the accuracy of the paper's plots.
If the strict criterion gives another answer, that an orbit must repeat after whole mesh periods to
within 1e-6 of its height, a rule returns a third item that describes it.
"""

from collections.abc import Sequence

import numpy as np
import xarray as xr

from gearlib.data.motions import LINE_WIDTH, describe_settling, period_spread, true_intervals
from gearlib.studies.claims.data import CONTACT_TOLERANCE, PLOT_RESOLUTION, Data

#: Centre and half width of the paper's "small region" of tunings; it states only "near 0.66".
_SMALL_REGION_CENTRE, _SMALL_REGION_HALF_WIDTH = 0.66, 0.02


def interval_text(tuning: np.ndarray, condition: np.ndarray) -> str:
    """Return the intervals of tuning in which a condition holds, as text."""
    texts = []
    for first, last in true_intervals(condition):
        lower, upper = tuning[first], tuning[last]
        texts.append(f"{lower:.4g}" if lower == upper else f"{lower:.4g} ... {upper:.4g}")
    return ", ".join(texts) or "none"


def loses_contact(curve: xr.Dataset) -> np.ndarray:
    """Return whether contact is lost at each tuning of a sweep or of phase portraits."""
    return curve.displacement_min.values < -CONTACT_TOLERANCE


def printed_tunings(data: Data) -> tuple[bool, str]:
    """Judge statement P1: the printed tunings referred to the largest and smallest stiffness."""
    # Tuning nu -> nu_max, nu_min: the natural frequency is that at the extreme stiffness.
    printed = {0.815: (0.7391, 0.9639), 0.8151: (0.7392, 0.9640)}
    computed = {nu: (data.pair.tuning_max(nu), data.pair.tuning_min(nu)) for nu in printed}
    # Half a unit of the four printed decimals, with a margin for rounding errors.
    tolerance = 0.5001e-4
    differences = np.subtract([*printed.values()], [*computed.values()])
    holds = bool((np.abs(differences) <= tolerance).all())
    texts = [f"{nu:g}: {nu_max:.5f}, {nu_min:.5f}" for nu, (nu_max, nu_min) in computed.items()]
    return holds, "; ".join(texts)


def printed_damping_ratios(data: Data) -> tuple[bool, str]:
    """Judge statement P2: the printed damping ratios of three material dampings."""
    # Damping in N s/m -> printed ratio, and half a unit of its last digit.
    printed = {3950.0: (0.062, 0.5e-3), 4000.0: (0.0624, 0.5e-4), 40.0: (0.000624, 0.5e-6)}
    computed = {k: data.pair.replace(material_damping=k).damping_ratio for k in printed}
    holds = all(abs(computed[k] - ratio) <= tolerance for k, (ratio, tolerance) in printed.items())
    return holds, "; ".join(f"{k:g} N s/m: {ratio:.6g}" for k, ratio in computed.items())


def undamped_contact_below_resonance(data: Data) -> tuple[bool, str]:
    """Judge statement P4: undamped contact is lost below a tuning of 0.8 only near 0.66."""
    undamped = data.damping_names(material=False, backlash=False)[0]
    curve = data.curve(undamped, lowest=0.6, highest=0.8 - PLOT_RESOLUTION)
    is_lost = loses_contact(curve)
    tuning = curve.tuning.values
    in_region = abs(tuning - _SMALL_REGION_CENTRE) <= _SMALL_REGION_HALF_WIDTH
    holds = bool(is_lost[in_region].any() and not is_lost[~in_region].any())
    # The range ends before 0.8, because the next statement judges where bounces begin.
    intervals = interval_text(tuning, is_lost)
    return holds, f"below {0.8 - PLOT_RESOLUTION:g}: contact lost at {intervals}"


def undamped_chaos_in_resonance(data: Data) -> tuple[bool, str]:
    """Judge statement P5: without damping, motions above a tuning of 0.8 bounce chaotically."""
    curve = data.curve(data.damping_names(material=False, backlash=False)[0], 0.7, 1.12)
    tuning = curve.tuning.values
    is_lost = loses_contact(curve)
    first = tuning[is_lost][0] if is_lost.any() else np.nan
    above = tuning >= first
    fractions = {
        "contact lost": is_lost[above].mean(),
        "inverse mesh": (curve.fraction_coast.values[above] > 0).mean(),
        "unsteady": (curve.period.values[above] == 0).mean(),
    }
    # Every tuning must have bounces, most of them coast-side contact and chaotic motion.
    holds = abs(first - 0.8) <= PLOT_RESOLUTION and fractions["contact lost"] == 1.0
    holds &= fractions["inverse mesh"] > 0.5 and fractions["unsteady"] > 0.5
    text = ", ".join(f"{name}: {fraction_text(value)}" for name, value in fractions.items())
    return bool(holds), f"bounces begin at {first:.4g}; of the tunings from there to 1.12: {text}"


def fraction_text(fraction: float) -> str:
    """Return a fraction of chaotic motions as "all", "most", "some" or "none".

    Its exact value depends on rounding errors.
    """
    if fraction in (0.0, 1.0):
        return "all" if fraction else "none"
    return "most" if fraction > 0.5 else "some"


def damped_contact_loss_range(data: Data) -> tuple[bool, str]:
    """Judge statement P6: material damping limits contact loss to tunings from 0.8 to 1.12."""
    highest = data.resonance.tuning.values[-1]
    holds, texts = True, []
    for name in data.damping_names(material=True):
        curve = data.curve(name, 0.6, max(highest, 1.12 + 2 * PLOT_RESOLUTION))
        tuning = curve.tuning.values
        is_lost = loses_contact(curve)
        inverse = bool((curve.fraction_coast.values > 0).any())
        limits = tuning[is_lost][[0, -1]] if is_lost.any() else np.full(2, np.nan)
        holds &= (np.abs(limits - (0.8, 1.12)) <= 2 * PLOT_RESOLUTION).all()
        holds &= not inverse
        text = f"{name}: {interval_text(tuning, is_lost)}, inverse mesh "
        texts.append(text + ("yes" if inverse else "no"))
    return bool(holds), "contact lost at " + "; ".join(texts)


def contact_loss_above_resonance(data: Data) -> tuple[bool, str]:
    """Judge statement P7: only motions with backlash damping (oil) lose contact above 1.12."""
    # The lower limit exceeds the paper's 1.12 by more than the resolution of its plot.
    lowest = 1.12 + 2 * PLOT_RESOLUTION
    highest = data.resonance.tuning.values[-1]
    damped = [name for name, flags in data.dampings.items() if any(flags)]
    with_oil = data.damping_names(material=False, backlash=True)
    curves = {name: data.curve(name, lowest, highest) for name in damped}
    lost_fractions = {name: float(loses_contact(curves[name]).mean()) for name in damped}
    holds = all((fraction > 0) == (name in with_oil) for name, fraction in lost_fractions.items())
    text = ", ".join(f"{name} {100 * value:.0f} %" for name, value in lost_fractions.items())
    return holds, f"tunings above {lowest:g} with contact lost: {text}"


#: Tunings of the phase portraits in the paper's Fig. 5.
_PLANE_TUNINGS = (0.60, 0.66, 0.78, 0.80, 0.81, 0.82)


def undamped_phase_planes(data: Data) -> tuple:
    """Judge statement P9: which undamped phase portraits are unsteady or lose drive-side contact.

    Return whether it holds, the result as text, and the text of `_strict_difference`, which names
    orbits whose repetition to 1e-6 of their height contradicts the look of the plot.
    """
    name = data.damping_names(material=False, backlash=False)[0]
    planes = data.planes(name, _PLANE_TUNINGS)
    unsteady = _spreads(planes) > LINE_WIDTH
    is_lost = loses_contact(planes)
    inverse = planes.fraction_coast.values > 0
    tunings = np.array(_PLANE_TUNINGS)
    holds = bool(unsteady.all())
    holds &= tunings[is_lost].tolist() == [0.66, 0.80, 0.81, 0.82]
    holds &= tunings[inverse].tolist() == [0.81, 0.82]
    conditions = {"unsteady": unsteady, "bounces": is_lost, "inverse mesh": inverse}
    texts = [f"{motion} at {tunings_text(tunings[mask])}" for motion, mask in conditions.items()]
    return holds, "; ".join(texts), _strict_difference({name: (planes, unsteady)})


def damped_phase_planes(data: Data) -> tuple:
    """Judge statement P10: which phase portraits with damping are unsteady.

    According to the paper, only those with backlash damping alone are unsteady, at three tunings.
    Return whether it holds, the result as text, and the text of `_strict_difference`, which names
    orbits whose repetition to 1e-6 of their height contradicts the look of the plot.
    """
    expected = {name: [] for name, flags in data.dampings.items() if any(flags)}
    for name in data.damping_names(material=False, backlash=True):
        expected[name] = [0.60, 0.66, 0.78]
    tunings = np.array(_PLANE_TUNINGS)
    holds, texts, planes_by_damping = True, [], {}
    for name in expected:
        planes = data.planes(name, _PLANE_TUNINGS)
        spreads = _spreads(planes)
        unsteady = spreads > LINE_WIDTH
        planes_by_damping[name] = planes, unsteady
        holds &= tunings[unsteady].tolist() == expected[name]
        cases = ", ".join(
            f"{tunings[i]:.2f} ({spreads[i]:.1g}, {describe_settling(planes.isel(tuning=i))})"
            for i in np.flatnonzero(unsteady)
        )
        texts.append(f"{name} unsteady at {cases or 'none'}")
    text = "; ".join(texts) + " (in brackets: how far mesh periods lie apart, over the height)"
    return holds, text, _strict_difference(planes_by_damping)


def _spreads(planes: xr.Dataset) -> np.ndarray:
    """Return the largest distance between mesh periods relative to the orbit height, by tuning."""
    return np.array([period_spread(planes.isel(tuning=i)) for i in range(planes.sizes["tuning"])])


def _strict_difference(planes_by_damping: dict[str, tuple[xr.Dataset, np.ndarray]]) -> str:
    """Describe orbits that look steady in a plot but do not repeat to 1e-6, or the reverse.

    `planes_by_damping` maps dampings to their phase portraits, and to a mask of those that look
    unsteady. The text is empty if there are no such orbits.
    """
    differences = []
    for name, (planes, unsteady) in planes_by_damping.items():
        for i in range(unsteady.size):
            plane = planes.isel(tuning=i)
            period = repetition_period(plane)
            if unsteady[i] == (period == 0):
                continue
            text = f"changes by {min_period_change(plane):.1g} of its height per orbit"
            if period:
                text = f"repeats after {period} periods"
            differences.append(f"{name} at {float(plane.tuning):.2f} {text}")
    return ", ".join(differences)


def min_period_change(run: xr.Dataset) -> float:
    """Return the smallest deviation of a motion from its repetition after n mesh periods.

    The deviation for each n is the largest change of displacement, relative to the orbit height. It
    is small for a motion that still settles, and large for a chaotic motion.
    """
    return min(_changes_by_period(run), default=np.nan)


def repetition_period(run: xr.Dataset) -> int:
    """Return the mesh periods after which an orbit repeats to 1e-6 of its height, 0 if never."""
    for period, change in enumerate(_changes_by_period(run), 1):
        if change <= 1e-6:
            return period
    return 0


def _changes_by_period(run: xr.Dataset) -> list[float]:
    """Return the largest relative change of displacement after 1, 2, ... mesh periods.

    Changes are relative to the height of the orbit; the last one is after half of the record.
    """
    displacement = run.displacement.values
    samples_per_period = round(2.0 * np.pi / float(run.phase[1] - run.phase[0]))
    shifts = range(samples_per_period, displacement.size // 2 + 1, samples_per_period)
    height = np.ptp(displacement)
    return [np.abs(displacement[n:] - displacement[:-n]).max() / height for n in shifts]


def tunings_text(tunings: Sequence[float]) -> str:
    """Return tunings as text with two decimals."""
    return ", ".join(f"{tuning:.2f}" for tuning in tunings) or "none"
