"""Rules for the statements on single runs, Fig. 2, 4, 6, 7 and 8; see `characteristics`."""

import numpy as np

from gearlib.claims.data import NoData

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
    scene = data.scene("fig6", 2)
    depth = -scene.displacement_min.values
    words = "; ".join(
        f"{title}: y_min {-d:.4g}" for title, d in zip(scene.case.values, depth, strict=True)
    )
    # Small and large bounces: one several times as deep as the other.
    small, large = sorted(depth)
    return bool(small > 0.0 and large > 3.0 * small), words + jump_words(data)


def jump_words(data):
    """Return where the motion from rest jumps, and what moves it between the two tunings."""
    jumps = data.jump
    base = float(jumps.jump[0])
    if not np.isfinite(base):
        return "; no jump from rest in the scan"
    inside = (jumps.jump.values >= 0.815) & (jumps.jump.values <= 0.8151)
    movers = [
        f"{kind} {value:g}"
        for kind, value in zip(jumps.kind.values[inside], jumps.value.values[inside], strict=True)
    ]
    words = f"; from rest the orbit jumps at {base:.7f}"
    return words + f"; between 0.815 and 0.8151 with: {', '.join(movers) or 'no variation'}"


def time_at_min_stiffness(data):
    scene = data.scene("fig7", 3)
    material, oil, both = scene.fraction_min_stiffness.values
    words = f"k1,k1m {both:.4f}, k1 {material:.4f}, k1m {oil:.4f} of the time"
    return bool(both > material > oil), words


def six_degrees(data):
    run = data.scene("fig8", 1).isel(case=0)
    period, bounces = int(run.period), float(run.bounces)
    words = f"period {period or 'none found'}, {bounces:.3g} bounces per mesh period, "
    words += f"y_min {float(run.displacement_min):.3g}"
    return period == 0 and bounces > 0.0, words
