"""Rules for the statements on single runs, Fig. 2, 4, 6, 7 and 8; see `characteristics`."""

import numpy as np

from gearlib.data.motions import LINE, spread
from gearlib.studies.certificates import FIG6_TUNINGS
from gearlib.studies.claims.characteristics import in_words, repeats
from gearlib.studies.claims.data import NoData

#: Degrees; a shift smaller than that is within the line width of a printed time course.
VISIBLE_SHIFT = 1.0


def phase_shift(data):
    lag = data.phase_lag.lag.isel(harmonic=0)
    if lag.size < 2 or lag.isnull().any():
        raise NoData("fewer than two dampings have an orbit of one mesh period")
    pairs = zip(lag.damping.values, lag.values, strict=True)
    words = ", ".join(f"k1 = {k:g} N s/m: {v:.3f}" for k, v in pairs)
    tuning, shift = float(data.phase_lag.shown_tuning), float(lag.max() - lag.min())
    return shift > VISIBLE_SHIFT, f"lag of the first harmonic at nu = {tuning:g}, degrees: {words}"


def contact_ratios(data):
    scene = data.scene("fig4", 2)
    low = scene.fraction_min_stiffness.values
    high = (scene.fraction_normal + scene.fraction_inverse).values - low
    words = "; ".join(
        f"{title}: {100 * a:.0f} % in mesh at C_min, {100 * b:.0f} % at C_max"
        for title, a, b in zip(scene.case.values, low, high, strict=True)
    )
    return bool(low[0] > 0.5 and high[1] > 0.5), words


def two_tunings(data):
    scene = data.scene("fig6").sortby("tuning")
    tuning, depth = scene.tuning.values, -scene.displacement_min.values
    if not all(np.isclose(tuning, nu, rtol=0.0, atol=1e-9).any() for nu in FIG6_TUNINGS):
        raise NoData(
            f"no scene fig6 with tunings {FIG6_TUNINGS[0]:g} and {FIG6_TUNINGS[1]:g} is configured"
        )
    words = ", ".join(f"{nu:g}: y_min {-d:.4g}" for nu, d in zip(tuning, depth, strict=True))
    # Small and large bounces: one several times as deep as the other.
    small, large = sorted(depth[abs(tuning - nu).argmin()] for nu in FIG6_TUNINGS)
    return bool(small > 0.0 and large > 3.0 * small), words + jump_words(data)


def jump_words(data):
    """Return where the motion from rest jumps, and what moves it between the paper's tunings."""
    jumps = data.jump
    base = float(jumps.jump[0])
    if not np.isfinite(base):
        return "; no jump from rest in the scan"
    # Of a tolerance the whole range over its starts.
    low, high = base + jumps.shift_low.values, base + jumps.shift_high.values
    inside = (low >= FIG6_TUNINGS[0]) & (high <= FIG6_TUNINGS[1])
    movers = [
        f"{kind} {value:g}"
        for kind, value in zip(jumps.kind.values[inside], jumps.value.values[inside], strict=True)
    ]
    words = f"; from rest the orbit jumps at {base:.7f}"
    movers = ", ".join(movers) or "no variation"
    return words + f"; between {FIG6_TUNINGS[0]:g} and {FIG6_TUNINGS[1]:g} with: {movers}"


def time_at_min_stiffness(data):
    scene = data.scene("fig7", 3)
    material, oil, both = scene.fraction_min_stiffness.values
    words = f"k1,k1m {both:.4f}, k1 {material:.4f}, k1m {oil:.4f} of the time"
    return bool(both > material > oil), words


def six_degrees(data):
    run = data.scene("fig8", 1).isel(case=0)
    apart, bounces, period = spread(run), float(run.bounces), repeats(run)
    share = float(run.losing_share)
    words = f"mesh periods {apart:.1g} of the height apart, {bounces:.3g} bounces per mesh period, "
    words += f"y_min {float(run.displacement_min):.3g}"
    if not run.free_of_rounding:
        words = f"from rest {'unsteady' if apart > LINE else 'steady'}, contact "
        words += f"{'lost' if bounces > 0.0 else 'kept'}; lost from {in_words(share)} of the "
        words += "seeded starts beside; how often, rounding decides"
    # Steady over several mesh periods: no single line in a plot, and yet it repeats.
    strictly = [f"it repeats after {period} periods"] if apart > LINE and period else []
    return apart > LINE and bounces > 0.0 and share > 0.5, words, *strictly
