"""Check the paper's statements against computed data.

Each statement has a rule that decides from computed data, with the accuracy of the paper's plots,
whether the statement holds. If a strict criterion gives a different answer, the verdict states
both. A statement without data in the configuration is "not evaluated". Statements P1 to P13 are
quoted from Hortel & Skuderova (2007).

A rule is a function of the `Data` of a configuration. It returns whether the statement holds and a
description of the computed numbers. The strict criterion requires that an orbit repeats after whole
mesh periods to within 1e-6 of its height. If its answer differs, the rule returns a description of
the difference as a third item.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import astuple, dataclass, fields
from pathlib import Path

import numpy as np
import xarray as xr

from gearlib.data.files import atomic_write
from gearlib.data.motions import LINE_WIDTH, describe_settling, period_spread, true_intervals
from gearlib.studies.certificates import FIG6_TUNINGS

#: Displacements above minus this value count as contact, because undamped motions touch y = 0 in
#: every period. The value is far above rounding errors (1e-14) and far below a line width.
CONTACT_TOLERANCE = 1e-6
#: Resolution in tuning of the plot from which the paper reads nu = 0.8 and 1.12.
PLOT_RESOLUTION = 0.01


class NoData(Exception):
    """The configuration has no data for a statement; the message states which data are missing."""


class Data:
    """The computed data of a configuration; methods select the data that a statement needs."""

    def __init__(self, pair, dampings, resonance, phase_planes, phase_lag, jump, scenes) -> None:
        """Store a `GearPair`, its damping combinations, and datasets of computed motions.

        `dampings` maps names to dicts with material_damping and backlash_damping (N s/m).
        `resonance` has sweeps, `phase_planes` time histories, `phase_lag` the lag of the
        displacement behind the stiffness, and `jump` the tuning (mesh frequency over natural
        frequency) at which the motion from rest jumps. `scenes` maps names that begin with a figure
        of the paper to datasets of simulated cases.
        """
        self.phase_lag, self.jump, self.scenes = phase_lag, jump, scenes
        self.pair, self.resonance, self.phase_planes = pair, resonance, phase_planes
        #: Name of a combination -> (has material damping, has backlash damping).
        self.dampings = {
            name: (values["material_damping"] > 0.0, values["backlash_damping"] > 0.0)
            for name, values in dampings.items()
        }

    def damping_names(self, material=None, backlash=None) -> list[str]:
        """Return the names of the damping combinations with or without certain kinds of damping.

        `material` and `backlash` state whether there is damping in contact and in free flight; None
        means either. Raise NoData if there is no such combination.
        """
        damping_names = [
            name
            for name, (has_material, has_backlash) in self.dampings.items()
            if material in (None, has_material) and backlash in (None, has_backlash)
        ]
        if not damping_names:
            raise NoData("no such damping combination is configured")
        return damping_names

    def curve(self, damping: str, lowest: float, highest: float) -> xr.Dataset:
        """Return the sweep with one damping combination from the tuning `lowest` to `highest`.

        The tuning is mesh frequency over natural frequency. All runs start from the same state
        (direction "cold"). Raise NoData if the sweep does not cover the range or if a run stopped
        early (status other than 0).
        """
        if "cold" not in self.resonance.direction.values:
            raise NoData("no resonance curve in the direction cold is configured")
        tuning = self.resonance.tuning.values
        # Tunings are decimals and may differ from the limits by rounding errors.
        tolerance = 1e-9
        selected = (tuning >= lowest - tolerance) & (tuning <= highest + tolerance)
        starts_late = tuning[0] > lowest + PLOT_RESOLUTION
        ends_early = tuning[-1] < highest - PLOT_RESOLUTION
        if not selected.any() or starts_late or ends_early:
            raise NoData(f"the configured tunings do not cover {lowest:g} ... {highest:g}")
        curve = self.resonance.sel(damping=damping, direction="cold").isel(tuning=selected)
        if (curve.status != 0).any():
            raise NoData(f"some runs of {damping} stopped early")
        return curve

    def scene(self, figure: str, cases: int | None = None) -> xr.Dataset:
        """Return the dataset of simulated cases of a figure of the paper, such as "fig4".

        The dataset has time histories and summaries along "case". It is the first one whose name
        begins with `figure`. Raise NoData if there is none, if the number of cases differs from
        `cases` (None means any number), or if a run stopped early (status other than 0).
        """
        scenes = [scene for name, scene in sorted(self.scenes.items()) if name.startswith(figure)]
        if not scenes or cases not in (None, scenes[0].sizes["case"]):
            raise NoData(f"no scene {figure}{f' of {cases} cases' if cases else ''} is configured")
        if (scenes[0].status != 0).any():
            raise NoData("some of the runs stopped early")
        return scenes[0]

    def planes(self, damping: str, tunings: Sequence[float]) -> xr.Dataset:
        """Return the phase portraits with one damping combination at several tunings.

        The tuning is mesh frequency over natural frequency. Raise NoData if the portrait at one of
        the tunings is missing or if a run stopped early (status other than 0).
        """
        configured = self.phase_planes.tuning.values
        for tuning in tunings:
            if not np.isclose(configured, tuning, rtol=0.0, atol=1e-9).any():
                raise NoData(f"no phase plane at nu = {tuning:g} is configured")
        planes = self.phase_planes.sel(damping=damping)
        planes = planes.sel(tuning=list(tunings), method="nearest")
        if (planes.status != 0).any():
            raise NoData("some of the runs stopped early")
        return planes


#: The statements as (id, text, place in the paper, figure of the workflow, rule).
CHECKS: list[tuple] = []


def _statement(identifier: str, text: str, place: str, figure: str = "") -> Callable:
    """Return a decorator that registers the rule for a statement in `CHECKS`.

    `identifier` is the number of the statement, such as "P1", `text` the statement, and `place`
    where the paper makes it. `figure` is the figure of the workflow that shows the data; if it is
    empty, `place` is used.
    """

    def add(rule: Callable) -> Callable:
        """Append the statement and its rule to `CHECKS`; return the rule unchanged."""
        CHECKS.append((identifier, text, place, figure or place, rule))
        return rule

    return add


@_statement(
    "P1",
    "nu = 0.815: nu_max 0.7391, nu_min 0.9639; nu = 0.8151: 0.7392, 0.9640",
    "text to Fig. 6",
    figure="Fig. 3",
)
def check_printed_tunings(data: Data) -> tuple[bool, str]:
    """Check claim P1 of the paper: the published tunings for the extreme mesh stiffnesses.

    nu is the mesh frequency over the natural frequency at mean stiffness; nu_max and nu_min refer
    to the natural frequency at the maximum and the minimum stiffness. Return whether the claim
    holds and a description of the computed numbers.
    """
    # Tuning nu -> published values of nu_max and nu_min.
    printed = {0.815: (0.7391, 0.9639), 0.8151: (0.7392, 0.9640)}
    computed = {nu: (data.pair.tuning_max(nu), data.pair.tuning_min(nu)) for nu in printed}
    # Half a unit of the fourth decimal, with a margin for rounding errors.
    tolerance = 0.5001e-4
    differences = np.subtract([*printed.values()], [*computed.values()])
    holds = bool((np.abs(differences) <= tolerance).all())
    texts = [
        f"nu = {nu:g}: nu_max {nu_max:.5f}, nu_min {nu_min:.5f}"
        for nu, (nu_max, nu_min) in computed.items()
    ]
    return holds, "; ".join(texts)


@_statement(
    "P2", "k1 = 3.95, 4, 0.04 N s/mm: beta 0.062, 0.0624, 0.000624", "text, Fig. 2", figure="Fig. 3"
)
def check_printed_damping_ratios(data: Data) -> tuple[bool, str]:
    """Check claim P2 of the paper: the published damping ratios of three damping coefficients.

    k1 is the coefficient of the material damping, which acts in contact. Return whether the claim
    holds and a description of the computed ratios.
    """
    # Damping in N s/m -> published ratio, and half a unit of its last digit.
    printed = {3950.0: (0.062, 0.5e-3), 4000.0: (0.0624, 0.5e-4), 40.0: (0.000624, 0.5e-6)}
    computed = {k: data.pair.replace(material_damping=k).damping_ratio for k in printed}
    holds = all(abs(computed[k] - ratio) <= tolerance for k, (ratio, tolerance) in printed.items())
    return holds, "; ".join(f"k1 = {k:g} N s/m: beta {ratio:.6g}" for k, ratio in computed.items())


#: Phase shifts (degrees) below this value are within the line width of a printed time history.
VISIBLE_SHIFT = 1.0


@_statement("P3", "the size of k1 shifts the phase of y(t) against C(t)", "Fig. 2")
def check_phase_shift(data: Data) -> tuple[bool, str]:
    """Check claim P3 of the paper: material damping visibly shifts the phase of the motion.

    The phase is the lag of the displacement y behind the stiffness C in the first mesh harmonic. A
    shift is visible if it exceeds `VISIBLE_SHIFT` (degrees). Return whether the claim holds and a
    description of the computed phases. Raise NoData if there are fewer than two damping values or
    if one has no orbit of one mesh period.
    """
    lag = data.phase_lag.lag.isel(harmonic=0)
    if lag.size < 2 or lag.isnull().any():
        raise NoData("fewer than two dampings have an orbit of one mesh period")
    pairs = zip(lag.damping.values, lag.values, strict=True)
    text = " and ".join(
        f"{degrees:.3f} degrees at k1 = {damping:g} N s/m" for damping, degrees in pairs
    )
    tuning, shift = float(data.phase_lag.shown_tuning), float(lag.max() - lag.min())
    return shift > VISIBLE_SHIFT, f"at nu = {tuning:g} the first harmonic of y lags C by {text}"


#: Centre and half width of the paper's "small region near 0.66". The paper gives no width.
_SMALL_REGION_CENTRE, _SMALL_REGION_HALF_WIDTH = 0.66, 0.02


def format_intervals(tuning: np.ndarray, condition: np.ndarray) -> str:
    """Format the intervals of `tuning` in which `condition` is true, e.g. "0.8 ... 1.12, 1.3".

    `tuning` is increasing; `condition` is a mask of the same shape (n,).
    """
    texts = []
    for first, last in true_intervals(condition):
        lower, upper = tuning[first], tuning[last]
        texts.append(f"{lower:.4g}" if lower == upper else f"{lower:.4g} ... {upper:.4g}")
    return ", ".join(texts) or "none"


def loses_contact(curve: xr.Dataset) -> np.ndarray:
    """Return a mask of the tunings of a sweep, or of phase portraits, at which contact is lost.

    Contact is lost at displacements below zero. `CONTACT_TOLERANCE` allows for rounding errors of
    motions that only touch zero.
    """
    return curve.displacement_min.values < -CONTACT_TOLERANCE


@_statement(
    "P4", "conservative: normal mesh for 0.6 <= nu < 0.8 except a small region near 0.66", "Fig. 3"
)
def check_undamped_contact_below_resonance(data: Data) -> tuple[bool, str]:
    """Check claim P4 of the paper: below a tuning of 0.8, undamped contact is lost only near 0.66.

    The tuning is mesh frequency over natural frequency. Return whether the claim holds and a
    description of the tunings at which contact is lost.
    """
    undamped = data.damping_names(material=False, backlash=False)[0]
    curve = data.curve(undamped, lowest=0.6, highest=0.8 - PLOT_RESOLUTION)
    is_lost = loses_contact(curve)
    tuning = curve.tuning.values
    in_region = abs(tuning - _SMALL_REGION_CENTRE) <= _SMALL_REGION_HALF_WIDTH
    holds = bool(is_lost[in_region].any() and not is_lost[~in_region].any())
    # The range ends just below 0.8, because claim P5 is about where bounces begin.
    intervals = format_intervals(tuning, is_lost)
    return holds, f"below nu = {0.8 - PLOT_RESOLUTION:g} contact is lost at {intervals}"


def describe_fraction(fraction: float) -> str:
    """Describe a fraction of chaotic motions by the word "all", "most", "some" or "none".

    The exact value depends on rounding errors.
    """
    if fraction in (0.0, 1.0):
        return "all" if fraction else "none"
    return "most" if fraction > 0.5 else "some"


@_statement(
    "P5",
    "conservative: contact bounces begin at nu = 0.8; above, bounces and inverse mesh, chaotic",
    "Fig. 3",
)
def check_undamped_chaos_in_resonance(data: Data) -> tuple[bool, str]:
    """Check claim P5 of the paper: undamped motions bounce chaotically at tunings above 0.8.

    The tuning is mesh frequency over natural frequency. Unsteady motions do not repeat and have a
    stored period of 0. Return whether the claim holds and a description of the fractions of tunings
    with contact loss, coast-side contact and unsteady motion.
    """
    curve = data.curve(data.damping_names(material=False, backlash=False)[0], 0.7, 1.12)
    tuning = curve.tuning.values
    is_lost = loses_contact(curve)
    begin = tuning[is_lost][0] if is_lost.any() else np.nan
    is_above = tuning >= begin
    fractions = {
        "contact is lost": is_lost[is_above].mean(),
        "coast-side contact occurs": (curve.fraction_coast.values[is_above] > 0).mean(),
        "the motion is unsteady": (curve.period.values[is_above] == 0).mean(),
    }
    # The motion must lose contact at all tunings, and be chaotic with coast-side contact at most.
    holds = abs(begin - 0.8) <= PLOT_RESOLUTION and fractions["contact is lost"] == 1.0
    holds &= fractions["coast-side contact occurs"] > 0.5
    holds &= fractions["the motion is unsteady"] > 0.5
    texts = [f"{event} at {describe_fraction(value)}" for event, value in fractions.items()]
    text = f"contact loss begins at nu = {begin:.4g}; of the tunings from there to 1.12, "
    return bool(holds), text + ", ".join(texts)


@_statement(
    "P6",
    "k1 > 0: normal mesh on 0.6 ... 0.8, bounces on 0.8 ... 1.12 without inverse mesh, normal "
    "mesh again above",
    "Fig. 3",
)
def check_damped_contact_loss_range(data: Data) -> tuple[bool, str]:
    """Check claim P6 of the paper: with material damping, contact is lost only from 0.8 to 1.12.

    These numbers are tunings, mesh frequency over natural frequency. Coast-side contact must not
    occur. Return whether the claim holds for all combinations with material damping, and a
    description of the tunings at which contact is lost.
    """
    highest = data.resonance.tuning.values[-1]
    holds, texts = True, []
    for name in data.damping_names(material=True):
        curve = data.curve(name, 0.6, max(highest, 1.12 + 2 * PLOT_RESOLUTION))
        tuning = curve.tuning.values
        is_lost = loses_contact(curve)
        has_coast_contact = bool((curve.fraction_coast.values > 0).any())
        ends = tuning[is_lost][[0, -1]] if is_lost.any() else np.full(2, np.nan)
        # If contact is never lost, `ends` is NaN and the comparison fails.
        holds &= (np.abs(ends - (0.8, 1.12)) <= 2 * PLOT_RESOLUTION).all()
        holds &= not has_coast_contact
        side = "with" if has_coast_contact else "without"
        intervals = format_intervals(tuning, is_lost)
        texts.append(f"with {name} at {intervals}, {side} coast-side contact")
    return bool(holds), "contact is lost " + "; ".join(texts)


@_statement(
    "P7",
    "k1 = 0, k1m > 0 is the only damped variant not in purely normal mesh above 1.12",
    "Fig. 3",
)
def check_contact_loss_above_resonance(data: Data) -> tuple[bool, str]:
    """Check claim P7 of the paper: only pure backlash damping allows contact loss above 1.12.

    1.12 is a tuning, mesh frequency over natural frequency. Backlash damping is viscous damping by
    the oil in free flight. Return whether the claim holds, and a description of the percentage of
    tunings with contact loss for each damping combination.
    """
    # The lower limit exceeds the paper's 1.12 by more than the resolution of its plot.
    lowest = 1.12 + 2 * PLOT_RESOLUTION
    highest = data.resonance.tuning.values[-1]
    # The flags are (has material damping, has backlash damping).
    damped = [name for name, flags in data.dampings.items() if any(flags)]
    backlash_damped = data.damping_names(material=False, backlash=True)
    curves = {name: data.curve(name, lowest, highest) for name in damped}
    lost_fractions = {name: float(loses_contact(curves[name]).mean()) for name in damped}
    holds = all(
        (fraction > 0) == (name in backlash_damped) for name, fraction in lost_fractions.items()
    )
    text = ", ".join(
        f"at {100 * value:.0f} % of them with {name}" for name, value in lost_fractions.items()
    )
    return holds, f"of the tunings above {lowest:g}, contact is lost {text}"


@_statement("P8", "contact ratio 1.1: mesh mostly at C_min; 1.9: mostly at C_max", "Fig. 4")
def check_contact_ratios(data: Data) -> tuple[bool, str]:
    """Check claim P8 of the paper: the stiffness is mostly low at a small contact ratio.

    At a large contact ratio it must be mostly high. "Mostly" means in contact for more than half of
    the time at the minimum stiffness C_min or the maximum stiffness C_max. Return whether the claim
    holds and a description of the fractions of time.
    """
    scene = data.scene("fig4", cases=2)  # cases: small and large contact ratio
    low_fractions = scene.fraction_min_stiffness.values  # fractions of time in contact at C_min
    high_fractions = (scene.fraction_drive + scene.fraction_coast).values - low_fractions
    text = "; ".join(
        f"{title}: in contact {100 * low:.0f} % of the time at C_min, {100 * high:.0f} % at C_max"
        for title, low, high in zip(scene.case.values, low_fractions, high_fractions, strict=True)
    )
    return bool(low_fractions[0] > 0.5 and high_fractions[1] > 0.5), text


#: Tunings of the phase portraits in the paper's Fig. 5.
_PLANE_TUNINGS = (0.60, 0.66, 0.78, 0.80, 0.81, 0.82)


@_statement(
    "P9",
    "conservative phase planes: all unsteady, bounces at 0.66, 0.80, 0.81, 0.82, inverse mesh "
    "at 0.81, 0.82 only",
    "Fig. 5",
)
def check_undamped_phase_planes(data: Data) -> tuple:
    """Check claim P9 of the paper: which undamped phase portraits are unsteady or lose contact.

    A motion is unsteady if its mesh periods differ by more than the width of a plotted line. Return
    whether the claim holds; a description of the tunings (mesh frequency over natural frequency)
    with unsteady motion, contact loss and coast-side contact; and a description of orbits for which
    the strict criterion, repetition to 1e-6 of the height, contradicts the plot.
    """
    name = data.damping_names(material=False, backlash=False)[0]
    planes = data.planes(name, _PLANE_TUNINGS)
    is_unsteady = _compute_period_spreads(planes) > LINE_WIDTH
    is_lost = loses_contact(planes)
    has_coast_contact = planes.fraction_coast.values > 0
    tunings = np.array(_PLANE_TUNINGS)
    holds = bool(is_unsteady.all())
    holds &= tunings[is_lost].tolist() == [0.66, 0.80, 0.81, 0.82]
    holds &= tunings[has_coast_contact].tolist() == [0.81, 0.82]
    conditions = {
        "unsteady": is_unsteady,
        "contact lost": is_lost,
        "coast-side contact": has_coast_contact,
    }
    texts = [f"{motion} at {format_tunings(tunings[mask])}" for motion, mask in conditions.items()]
    return holds, "; ".join(texts), _describe_strict_differences({name: (planes, is_unsteady)})


@_statement(
    "P10", "k1 = 0, k1m > 0: unsteady at 0.60, 0.66, 0.78; every other damped cell steady", "Fig. 5"
)
def check_damped_phase_planes(data: Data) -> tuple:
    """Check claim P10 of the paper: which phase portraits with damping are unsteady.

    Motions may be unsteady only with pure backlash damping (free flight) at three tunings (mesh
    frequency over natural frequency). A motion is unsteady if its mesh periods differ by more than
    the width of a plotted line. Return whether the claim holds; a description of the unsteady
    motions; and a description of orbits for which the strict criterion, repetition to 1e-6 of the
    height, contradicts the plot.
    """
    # Damping combination -> tunings at which the motion must be unsteady.
    expected = {name: [] for name, flags in data.dampings.items() if any(flags)}
    for name in data.damping_names(material=False, backlash=True):
        expected[name] = [0.60, 0.66, 0.78]
    tunings = np.array(_PLANE_TUNINGS)
    holds, texts, planes_by_damping = True, [], {}
    for name in expected:
        planes = data.planes(name, _PLANE_TUNINGS)
        spreads = _compute_period_spreads(planes)
        is_unsteady = spreads > LINE_WIDTH
        planes_by_damping[name] = planes, is_unsteady
        holds &= tunings[is_unsteady].tolist() == expected[name]
        cases = ", ".join(
            f"{tunings[i]:.2f} (periods differ by {spreads[i]:.1g} of the height, "
            f"{describe_settling(planes.isel(tuning=i))})"
            for i in np.flatnonzero(is_unsteady)
        )
        texts.append(f"{name}: unsteady at {cases}" if cases else f"{name}: steady at all tunings")
    return holds, "; ".join(texts), _describe_strict_differences(planes_by_damping)


def _compute_period_spreads(planes: xr.Dataset) -> np.ndarray:
    """Compute the largest distance between mesh periods at each tuning, relative to orbit height.

    `planes` are phase portraits along the dimension "tuning" (mesh frequency over natural
    frequency). The distance is measured between the curves of the recorded mesh periods.
    """
    return np.array([period_spread(planes.isel(tuning=i)) for i in range(planes.sizes["tuning"])])


def _describe_strict_differences(
    planes_by_damping: dict[str, tuple[xr.Dataset, np.ndarray]],
) -> str:
    """Describe orbits that look steady in a plot but do not repeat to within 1e-6, or vice versa.

    `planes_by_damping` maps damping combinations to tuples of phase portraits over tuning and a
    mask of those that look unsteady. Return an empty string if there are no such orbits.
    """
    differences = []
    for name, (planes, is_unsteady) in planes_by_damping.items():
        for i in range(is_unsteady.size):
            plane = planes.isel(tuning=i)
            period = find_repetition_period(plane)
            # A period of 0 means that the orbit does not repeat.
            if is_unsteady[i] == (period == 0):
                continue
            text = f"repeats after {period} periods"
            if not period:
                change = min(_changes_by_period(plane), default=np.nan)
                text = f"changes by {change:.1g} of its height from orbit to orbit"
            differences.append(f"the motion with {name} at nu = {float(plane.tuning):.2f} {text}")
    return ", ".join(differences)


def find_repetition_period(run: xr.Dataset) -> int:
    """Find the number of mesh periods after which an orbit repeats, or 0 if it does not repeat.

    `run` is a result of `gearlib.simulate`. The orbit repeats if no displacement changes by more
    than 1e-6 of the orbit height.
    """
    for period, change in enumerate(_changes_by_period(run), 1):
        if change <= 1e-6:
            return period
    return 0


def _changes_by_period(run: xr.Dataset) -> list[float]:
    """Return the maximum changes of the displacement after 1, 2, ... mesh periods.

    Changes are relative to the orbit height and are computed up to half the record length. `run` is
    a result of `gearlib.simulate`, sampled at equidistant mesh phases.
    """
    displacement = run.displacement.values
    samples_per_period = round(2.0 * np.pi / float(run.phase[1] - run.phase[0]))
    shifts = range(samples_per_period, displacement.size // 2 + 1, samples_per_period)
    height = np.ptp(displacement)
    return [np.abs(displacement[n:] - displacement[:-n]).max() / height for n in shifts]


def format_tunings(tunings: Sequence[float]) -> str:
    """Format tunings with two decimals, separated by commas."""
    return ", ".join(f"{tuning:.2f}" for tuning in tunings) or "none"


@_statement(
    "P11",
    "nu = 0.815 and 0.8151 give drastically different orbits: small and large bounces",
    "Fig. 6",
)
def check_two_tunings(data: Data) -> tuple[bool, str]:
    """Check claim P11 of the paper: two neighbouring tunings give small and large bounces.

    The tuning is mesh frequency over natural frequency. The depth of a bounce is the displacement
    below zero. Return whether the claim holds, and a description of the minimum displacements and
    of the tuning at which the motion jumps between both orbits.
    """
    scene = data.scene("fig6").sortby("tuning")
    tuning, depth = scene.tuning.values, -scene.displacement_min.values
    if not all(np.isclose(tuning, nu, rtol=0.0, atol=1e-9).any() for nu in FIG6_TUNINGS):
        first, second = FIG6_TUNINGS
        raise NoData(f"no scene fig6 with tunings {first:g} and {second:g} is configured")
    depths = ", ".join(f"{-d:.4g} at nu = {nu:g}" for nu, d in zip(tuning, depth, strict=True))
    text = f"the minimum displacement is {depths}"
    # Large bounces are at least three times as deep as small ones.
    small, large = sorted(depth[abs(tuning - nu).argmin()] for nu in FIG6_TUNINGS)
    return bool(small > 0.0 and large > 3.0 * small), text + describe_jump(data)


def describe_jump(data: Data) -> str:
    """Describe where the motion from rest jumps to another orbit, and what shifts this jump.

    The text lists the variations of model and initial state that shift the jump to between the two
    tunings (mesh frequency over natural frequency) of the paper's Fig. 6. It is the end of a
    sentence.
    """
    jumps = data.jump
    reference_tuning = float(jumps.jump[0])  # the first entry is the run without variations
    if not np.isfinite(reference_tuning):
        return "; the motion from rest does not jump in the scan"
    lower, upper = FIG6_TUNINGS
    # A variation shifts the jump by shift_low to shift_high, depending on the initial state.
    lowest = reference_tuning + jumps.shift_low.values
    highest = reference_tuning + jumps.shift_high.values
    between = (lowest >= lower) & (highest <= upper)
    variations = zip(jumps.kind.values[between], jumps.value.values[between], strict=True)
    texts = ", ".join(f"{kind} {value:g}" for kind, value in variations)
    text = f"; the motion from rest jumps to the larger orbit at nu = {reference_tuning:.7f}; "
    if not texts:
        return text + f"no variation shifts this jump to between {lower:g} and {upper:g}"
    return text + f"these variations shift it to between {lower:g} and {upper:g}: {texts}"


@_statement("P12", "time in mesh at C_min at nu = 0.82: t(k1,k1m) > t(k1,0) > t(0,k1m)", "Fig. 7")
def check_time_at_min_stiffness(data: Data) -> tuple[bool, str]:
    """Check claim P12 of the paper: the time at the lower stiffness depends on the damping.

    It must be longest with both kinds of damping, followed by material damping (k1, in contact) and
    backlash damping (k1m, in free flight). Return whether the claim holds and a description of the
    fractions of time.
    """
    # The cases of the scene have the damping k1, k1m, and both.
    material, backlash, both = data.scene("fig7", cases=3).fraction_min_stiffness.values
    text = f"fractions of time: k1,k1m {both:.4f}, k1 {material:.4f}, k1m {backlash:.4f}"
    return bool(both > material > backlash), text


@_statement(
    "P13", "conservative, nu = 0.66, six degrees of freedom: unsteady, contact bounces", "Fig. 8"
)
def check_six_degrees(data: Data) -> tuple:
    """Check claim P13 of the paper: with six degrees of freedom, undamped motion bounces.

    The motion must also be unsteady, i.e. mesh periods must differ by more than a line width.
    Contact must be lost from most initial states (losing_share), which are random if rounding
    errors decide the run (free_of_rounding is 0). Return whether the claim holds; a description of
    the result; and a note, which is empty unless the motion repeats to within 1e-6 of its height
    although it looks unsteady.
    """
    run = data.scene("fig8", cases=1).isel(case=0)
    distance, bounces, period = period_spread(run), float(run.bounces), find_repetition_period(run)
    is_unsteady, loss_fraction = distance > LINE_WIDTH, float(run.losing_share)
    text = (
        f"mesh periods differ by {distance:.1g} of the orbit height; "
        f"{bounces:.3g} bounces per mesh period, minimum displacement "
        f"{float(run.displacement_min):.3g}"
    )
    if not run.free_of_rounding:
        text = (
            f"from rest the motion is {'unsteady' if is_unsteady else 'steady'} and "
            f"{'loses' if bounces > 0.0 else 'keeps'} contact; {describe_fraction(loss_fraction)} "
            "of the random initial states lose contact; rounding errors decide how often"
        )
    # A motion with a period of several mesh periods has several lines in a plot.
    strict_difference = f"it repeats after {period} periods" if is_unsteady and period else ""
    return is_unsteady and bounces > 0.0 and loss_fraction > 0.5, text, strict_difference


HOLDS, DIFFERS, NOT_EVALUATED = "holds", "differs", "not evaluated"


@dataclass(frozen=True)
class Claim:
    """One statement of the paper, the computed result, and the verdict."""

    id: str
    statement: str
    where: str  #: place in the paper
    computed: str
    verdict: str
    figure: str  #: figure of the workflow


def evaluate_claims(
    pair, dampings, resonance, phase_planes, phase_lag, jump, scenes
) -> list[Claim]:
    """Check the statements P1 to P13 of the paper against the data of a configuration.

    `pair` is a `GearPair`, whose damping is not used. `dampings` maps names of damping combinations
    to dicts with material_damping and backlash_damping (N s/m). The other arguments are datasets:
    `resonance` has sweeps and `phase_planes` time histories for each combination, `phase_lag` has
    the lag of the displacement behind the stiffness, and `jump` the tuning (mesh frequency over
    natural frequency) at which the motion from rest jumps. `scenes` maps names that begin with a
    figure of the paper, such as "fig4_contact_ratio", to datasets of simulated cases.
    """
    resonance = resonance.sortby("tuning")
    data = Data(pair, dampings, resonance, phase_planes, phase_lag, jump, scenes)
    return [evaluate_claim(check, data) for check in CHECKS]


def evaluate_claim(check: tuple, data: Data) -> Claim:
    """Apply the rule of a statement to the data of a configuration; return a `Claim`.

    `check` is an entry of `CHECKS`: (id, statement, place in the paper, figure of the workflow,
    rule). The rule returns whether the statement holds at the resolution of the paper's plots, a
    description of the computed result, and optionally of the result by a strict criterion. If the
    rule raises NoData, the verdict is "not evaluated".
    """
    identifier, statement, place, figure, rule = check
    try:
        holds, computed, *strict_results = rule(data)
        verdict = HOLDS if holds else DIFFERS
        if any(strict_results):
            verdict += f" at the resolution of the plots; strictly, {strict_results[0]}"
    except NoData as reason:
        verdict, computed = NOT_EVALUATED, str(reason)
    return Claim(identifier, statement, place, computed, verdict, figure)


def table_rows(claims: Sequence[Claim]) -> Iterator[tuple | list]:
    """Yield the rows of the table of claims, beginning with the column names."""
    yield [field.name for field in fields(Claim)]
    yield from map(astuple, claims)


def write_markdown(claims: Sequence[Claim], path: Path) -> None:
    """Write the claims as a table to a Markdown file.

    The file is replaced atomically, so that readers never see an incomplete file.
    """
    lines = ["# Statements of the paper against computed data", ""]
    lines += ["| id | the paper | computed | verdict | figure |", "|---|---|---|---|---|"]
    for claim in claims:
        cells = [claim.id, f"{claim.statement} ({claim.where})", claim.computed]
        lines.append(f"| {' | '.join(cells)} | **{claim.verdict}** | {claim.figure} |")
    with atomic_write(path) as temporary:
        temporary.write_text("\n".join(lines) + "\n", encoding="utf-8")
