"""Rules for the statements on single runs, Fig. 2, 4, 6, 7 and 8; see `characteristics`."""

import numpy as np

from gearlib.data.motions import LINE_WIDTH, period_spread
from gearlib.studies.certificates import FIG6_TUNINGS
from gearlib.studies.claims.characteristics import fraction_text, repetition_period
from gearlib.studies.claims.data import Data, NoData

#: Smaller phase shifts, degrees, are within the line width of a printed time history.
VISIBLE_SHIFT = 1.0


def phase_shift(data: Data) -> tuple[bool, str]:
    """Judge statement P3: the material damping visibly shifts the phase of the motion."""
    lag = data.phase_lag.lag.isel(harmonic=0)
    if lag.size < 2 or lag.isnull().any():
        raise NoData("fewer than two dampings have an orbit of one mesh period")
    pairs = zip(lag.damping.values, lag.values, strict=True)
    text = ", ".join(f"k1 = {damping:g} N s/m: {degrees:.3f}" for damping, degrees in pairs)
    tuning, shift = float(data.phase_lag.shown_tuning), float(lag.max() - lag.min())
    return shift > VISIBLE_SHIFT, f"lag of the first harmonic at nu = {tuning:g}, degrees: {text}"


def contact_ratios(data: Data) -> tuple[bool, str]:
    """Judge statement P8: stiffness is mostly low at a small contact ratio, high at a large one."""
    scene = data.scene("fig4", cases=2)  # the small contact ratio, then the large one
    low_fractions = scene.fraction_min_stiffness.values  # of time in mesh at C_min, by case
    high_fractions = (scene.fraction_drive + scene.fraction_coast).values - low_fractions
    text = "; ".join(
        f"{title}: {100 * low:.0f} % in mesh at C_min, {100 * high:.0f} % at C_max"
        for title, low, high in zip(scene.case.values, low_fractions, high_fractions, strict=True)
    )
    return bool(low_fractions[0] > 0.5 and high_fractions[1] > 0.5), text


def two_tunings(data: Data) -> tuple[bool, str]:
    """Judge statement P11: two neighbouring tunings give small and large bounces."""
    scene = data.scene("fig6").sortby("tuning")
    tuning, depth = scene.tuning.values, -scene.displacement_min.values
    if not all(np.isclose(tuning, nu, rtol=0.0, atol=1e-9).any() for nu in FIG6_TUNINGS):
        first, second = FIG6_TUNINGS
        raise NoData(f"no scene fig6 with tunings {first:g} and {second:g} is configured")
    text = ", ".join(f"{nu:g}: y_min {-d:.4g}" for nu, d in zip(tuning, depth, strict=True))
    # Large bounces are at least three times as deep as small ones.
    small, large = sorted(depth[abs(tuning - nu).argmin()] for nu in FIG6_TUNINGS)
    return bool(small > 0.0 and large > 3.0 * small), text + jump_description(data)


def jump_description(data: Data) -> str:
    """Return at which tuning the motion from rest jumps, and which variations move the jump.

    Only variations are named that move it between the two tunings of the paper's Fig. 6.
    """
    jumps = data.jump
    reference_tuning = float(jumps.jump[0])  # the first entry is the run without variations
    if not np.isfinite(reference_tuning):
        return "; no jump from rest in the scan"
    lower, upper = FIG6_TUNINGS
    lowest = reference_tuning + jumps.shift_low.values
    highest = reference_tuning + jumps.shift_high.values
    between = (lowest >= lower) & (highest <= upper)
    variations = zip(jumps.kind.values[between], jumps.value.values[between], strict=True)
    texts = ", ".join(f"{kind} {value:g}" for kind, value in variations) or "no variation"
    location = f"; from rest the orbit jumps at {reference_tuning:.7f}"
    return location + f"; between {lower:g} and {upper:g} with: {texts}"


def time_at_min_stiffness(data: Data) -> tuple[bool, str]:
    """Judge statement P12: the order of three dampings by time in mesh at the lower stiffness.

    The cases of the scene are material damping (k1), backlash damping (k1m), and both.
    """
    material, backlash, both = data.scene("fig7", cases=3).fraction_min_stiffness.values
    text = f"k1,k1m {both:.4f}, k1 {material:.4f}, k1m {backlash:.4f} of the time"
    return bool(both > material > backlash), text


def six_degrees(data: Data) -> tuple:
    """Judge statement P13: undamped motion with six degrees of freedom is unsteady and bounces.

    losing_share is the fraction of initial states from which contact is lost: random ones if the
    run depends on rounding errors (free_of_rounding is 0), else only rest. Return whether the
    statement holds, the result as text, and a note if the motion repeats to 1e-6 of its height
    although it looks unsteady in a plot (else "").
    """
    run = data.scene("fig8", cases=1).isel(case=0)
    distance, bounces, period = period_spread(run), float(run.bounces), repetition_period(run)
    unsteady, loss_fraction = distance > LINE_WIDTH, float(run.losing_share)
    text = (
        f"mesh periods {distance:.1g} of the height apart, "
        f"{bounces:.3g} bounces per mesh period, y_min {float(run.displacement_min):.3g}"
    )
    if not run.free_of_rounding:
        text = (
            f"from rest {'unsteady' if unsteady else 'steady'}, "
            f"contact {'lost' if bounces > 0.0 else 'kept'}; "
            f"lost from {fraction_text(loss_fraction)} of the seeded starts beside; "
            "how often, rounding decides"
        )
    # A motion that repeats after several mesh periods is not a single line in a plot.
    strict_difference = f"it repeats after {period} periods" if unsteady and period else ""
    return unsteady and bounces > 0.0 and loss_fraction > 0.5, text, strict_difference
