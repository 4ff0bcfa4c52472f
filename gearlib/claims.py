"""The paper's statements, checked against computed data.

Every verdict follows from numbers by a stated rule; nothing is typed in. A statement that
differs stays in the table with its numbers; one for which the configuration has no data is "not
evaluated". Statements P1 ... P10 are those of Hortel & Skuderova (2007) on linear damping.
"""

import csv
import io
from dataclasses import asdict, dataclass, fields

import numpy as np

from gearlib.files import replacing

HOLDS, DIFFERS, OPEN = "holds", "differs", "not evaluated"

#: Displacements this little below a flank line are contact: far above rounding (1e-14), far below
#: the thickness of a line. A conservative mesh from rest touches y = 0 in every period.
TOUCH = 1e-6
#: How far the band around nu = 0.66 may reach to be "a small region": the paper gives one figure.
SMALL_REGION = 0.02
#: The paper reads nu = 0.8 and 1.12 off a plot of its own resolution, 0.01.
READING = 0.01


#: Degrees; a shift smaller than that is within the line width of a printed time course.
VISIBLE_SHIFT = 1.0


@dataclass(frozen=True)
class Claim:
    """One statement: what the paper says, what was computed, and the verdict."""

    id: str
    statement: str
    where: str
    computed: str
    verdict: str
    figure: str


class NoData(Exception):
    """The configuration holds no data for a statement; the message says which."""


def evaluate(pair, dampings, resonance, phase_planes, phase_lag, scenes):
    """Return the claims P1-P13.

    Parameters
    ----------
    pair : GearPair
        The gear pair; its damping is not used.
    dampings : dict of str to {"material": float, "backlash": float}
        The damping combinations, N s/m, by name.
    resonance, phase_planes : xarray.Dataset
        As gathered by `gearlib.gathering`.
    phase_lag : xarray.Dataset
        As computed by `gearlib.phase_lag`.
    scenes : dict of str to xarray.Dataset
        As computed by `gearlib.scenes`, by name; P8 and P11-P13 look at those whose names begin
        with fig4, fig6, fig7, fig8.

    Returns
    -------
    list of Claim
    """
    resonance = resonance.sortby("tuning")
    data = _Data(pair, dampings, resonance, phase_planes, phase_lag, scenes)
    return [_evaluate(check, data) for check in _CHECKS]


def write_csv(claims, path):
    """Write the claims as CSV, a row per statement, replacing the file in one step."""
    text = io.StringIO()
    writer = csv.DictWriter(text, [f.name for f in fields(Claim)], lineterminator="\n")
    writer.writeheader()
    writer.writerows(asdict(claim) for claim in claims)
    _replace(path, text.getvalue())


def write_markdown(claims, path):
    """Write the claims as a Markdown table, replacing the file in one step."""
    lines = [
        "# Statements of the paper against computed data",
        "",
        "| id | the paper | computed | verdict | figure |",
        "|---|---|---|---|---|",
    ]
    lines += [
        f"| {c.id} | {c.statement} ({c.where}) | {c.computed} | **{c.verdict}** | {c.figure} |"
        for c in claims
    ]
    _replace(path, "\n".join(lines) + "\n")


def _replace(path, text):
    with replacing(path) as temporary:
        temporary.write_text(text, encoding="utf-8")


class _Data:
    """The data of one configuration, asked for by what a statement needs."""

    def __init__(self, pair, dampings, resonance, phase_planes, phase_lag, scenes):
        self.phase_lag, self.scenes = phase_lag, scenes
        self.pair, self.resonance, self.phase_planes = pair, resonance, phase_planes
        self.dampings = {
            name: (values["material"] > 0.0, values["backlash"] > 0.0)
            for name, values in dampings.items()
        }

    def names(self, material=None, backlash=None):
        """Return the dampings with or without (None: either) material and backlash damping."""
        found = [
            name
            for name, (has_material, has_backlash) in self.dampings.items()
            if material in (None, has_material) and backlash in (None, has_backlash)
        ]
        if not found:
            raise NoData("no such damping combination is configured")
        return found

    def curve(self, name, low, high):
        """Return the cold characteristic of one damping on [low, high]."""
        if "cold" not in self.resonance.direction.values:
            raise NoData("no cold resonance characteristic is configured")
        tuning = self.resonance.tuning.values
        # Half a step of slack at most: tunings are decimals, bounds may differ by rounding.
        slack = 1e-9
        chosen = (tuning >= low - slack) & (tuning <= high + slack)
        if not chosen.any() or tuning[0] > low + READING or tuning[-1] < high - READING:
            raise NoData(f"the configured tunings do not cover {low:g} ... {high:g}")
        curve = self.resonance.sel(damping=name, direction="cold").isel(tuning=chosen)
        if (curve.status != 0).any():
            raise NoData(f"some runs of {name} could not go on")
        return curve

    def scene(self, figure, cases):
        """Return the scene of a figure, which must have so many cases."""
        found = [scene for name, scene in sorted(self.scenes.items()) if name.startswith(figure)]
        if not found or found[0].sizes["case"] != cases:
            raise NoData(f"no scene {figure} of {cases} cases is configured")
        if (found[0].status != 0).any():
            raise NoData("some of the runs could not go on")
        return found[0]

    def planes(self, names, tunings):
        """Return the phase planes of some dampings at some tunings."""
        there = self.phase_planes.tuning.values
        for tuning in tunings:
            if not np.isclose(there, tuning, rtol=0.0, atol=1e-9).any():
                raise NoData(f"no phase plane at nu = {tuning:g} is configured")
        planes = self.phase_planes.sel(damping=names).sel(tuning=tunings, method="nearest")
        if (planes.status != 0).any():
            raise NoData("some of the runs could not go on")
        return planes


def _evaluate(check, data):
    identifier, statement, where, figure, rule = check
    try:
        holds, computed = rule(data)
        verdict = HOLDS if holds else DIFFERS
    except NoData as reason:
        verdict, computed = OPEN, str(reason)
    return Claim(identifier, statement, where, computed, verdict, figure)


def _intervals(tuning, where):
    """Return the stretches of tuning in which `where` is true, in words."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], where.astype(np.int8), [0]])))
    pairs = [(tuning[i], tuning[j - 1]) for i, j in zip(edges[::2], edges[1::2], strict=True)]
    return ", ".join(f"{a:.4g}" if a == b else f"{a:.4g} ... {b:.4g}" for a, b in pairs) or "none"


def _scales(data):
    printed = {0.815: (0.7391, 0.9639), 0.8151: (0.7392, 0.9640)}
    got = {nu: (data.pair.tuning_max(nu), data.pair.tuning_min(nu)) for nu in printed}
    # Printed with four decimals.
    holds = all(
        abs(a - b) <= 0.5001e-4 for nu in printed for a, b in zip(printed[nu], got[nu], strict=True)
    )
    return holds, "; ".join(f"{nu:g}: {a:.5f}, {b:.5f}" for nu, (a, b) in got.items())


def _damping_ratios(data):
    # N s/m, as printed, and half a unit of the last printed digit.
    printed = {3950.0: (0.062, 0.5e-3), 4000.0: (0.0624, 0.5e-4), 40.0: (0.000624, 0.5e-6)}
    got = {k: data.pair.replace(material_damping=k).damping_ratio for k in printed}
    holds = all(abs(got[k] - beta) <= digit for k, (beta, digit) in printed.items())
    return holds, "; ".join(f"{k:g} N s/m: {beta:.6g}" for k, beta in got.items())


def _phase_shift(data):
    lag = data.phase_lag.lag.isel(harmonic=0)
    if lag.size < 2 or lag.isnull().any():
        raise NoData("fewer than two dampings have an orbit of one mesh period")
    pairs = zip(lag.damping.values, lag.values, strict=True)
    words = ", ".join(f"k1 = {k:g} N s/m: {v:.3f}" for k, v in pairs)
    tuning, shift = float(data.phase_lag.shown_tuning), float(lag.max() - lag.min())
    return shift > VISIBLE_SHIFT, f"lag of the first harmonic at nu = {tuning:g}, degrees: {words}"


def _conservative_smooth(data):
    curve = data.curve(data.names(False, False)[0], 0.6, 0.8 - READING)
    lost = curve.displacement_min.values < -TOUCH
    tuning = curve.tuning.values
    inside = abs(tuning - 0.66) <= SMALL_REGION
    holds = bool(lost[inside].any() and not lost[~inside].any())
    # The upper end is the paper's 0.8 less the reading of its plot; where exactly bounces begin
    # is the next statement.
    return holds, f"below {0.8 - READING:g}: contact lost at {_intervals(tuning, lost)}"


def _conservative_chaotic(data):
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
    words = ", ".join(f"{name} {100 * value:.0f} %" for name, value in share.items())
    return bool(holds), f"bounces begin at {first:.4g}; of the tunings from there to 1.12: {words}"


def _damped_bounces(data):
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
            f"{name}: {_intervals(tuning, lost)}, inverse mesh {'yes' if inverse else 'no'}"
        )
    return bool(holds), "contact lost at " + "; ".join(words)


def _only_oil_bounces_above(data):
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


def _conservative_planes(data):
    name = data.names(False, False)[0]
    planes = data.planes(name, list(_PLANES))
    unsteady = planes.period.values == 0
    lost = planes.displacement_min.values < -TOUCH
    inverse = planes.fraction_inverse.values > 0
    at = np.array(_PLANES)
    holds = bool(unsteady.all())
    holds &= at[lost].tolist() == [0.66, 0.80, 0.81, 0.82]
    holds &= at[inverse].tolist() == [0.81, 0.82]
    words = {"unsteady": unsteady, "bounces": lost, "inverse mesh": inverse}
    return holds, "; ".join(f"{key} at {_listed(at[where])}" for key, where in words.items())


def _damped_planes(data):
    expected = {name: [] for name, flags in data.dampings.items() if any(flags)}
    for name in data.names(False, True):
        expected[name] = [0.60, 0.66, 0.78]
    at = np.array(_PLANES)
    got, words = {}, []
    for name in expected:
        planes = data.planes(name, list(_PLANES))
        unsteady = planes.period.values == 0
        got[name] = at[unsteady].tolist()
        drifts = [_drift(planes.isel(tuning=i)) for i in np.flatnonzero(unsteady)]
        listed = ", ".join(f"{nu:.2f} ({d:.1g})" for nu, d in zip(got[name], drifts, strict=True))
        words.append(f"{name} unsteady at {listed or 'none'}")
    return got == expected, "; ".join(words) + " (in brackets: change per orbit over its height)"


def _drift(plane):
    """Return by how much an unsteady orbit misses repeating, over its height.

    The smallest over whole numbers of mesh periods up to half the record; tells a motion that
    still settles from one that never does.
    """
    x = plane.displacement.values
    # The phase starts at zero, so that its size over its span counts the samples of a period.
    per_period = round(2.0 * np.pi / float(plane.phase[1] - plane.phase[0]))
    shifts = range(per_period, x.size // 2 + 1, per_period)
    misses = [np.abs(x[n:] - x[:-n]).max() for n in shifts]
    return min(misses, default=np.nan) / np.ptp(x)


def _contact_ratios(data):
    scene = data.scene("fig4", 2)
    low = scene.fraction_min_stiffness.values
    high = (scene.fraction_normal + scene.fraction_inverse).values - low
    words = "; ".join(
        f"{title}: {100 * a:.0f} % in mesh at C_min, {100 * b:.0f} % at C_max"
        for title, a, b in zip(scene.case.values, low, high, strict=True)
    )
    return bool(low[0] > 0.5 and high[1] > 0.5), words


def _two_tunings(data):
    scene = data.scene("fig6", 2)
    depth = -scene.displacement_min.values
    words = "; ".join(
        f"{title}: y_min {-d:.4g}" for title, d in zip(scene.case.values, depth, strict=True)
    )
    # Small and large bounces: one several times as deep as the other.
    small, large = sorted(depth)
    return bool(small > 0.0 and large > 3.0 * small), words + _jumps(data)


def _jumps(data):
    """Return where the damped characteristics jump from rest, in words."""
    words = []
    for name in data.names(material=True):
        curve = data.resonance.sel(damping=name, direction="cold")
        steps = np.abs(np.diff(curve.displacement_min.values))
        i = int(np.argmax(steps))
        tuning = curve.tuning.values
        words.append(f"{name} {tuning[i]:.4g} ... {tuning[i + 1]:.4g}")
    return "; the largest step from rest lies at " + ", ".join(words)


def _time_at_min_stiffness(data):
    scene = data.scene("fig7", 3)
    material, oil, both = scene.fraction_min_stiffness.values
    words = f"k1,k1m {both:.4f}, k1 {material:.4f}, k1m {oil:.4f} of the time"
    return bool(both > material > oil), words


def _six_degrees(data):
    run = data.scene("fig8", 1).isel(case=0)
    period, bounces = int(run.period), float(run.bounces)
    words = f"period {period or 'none found'}, {bounces:.3g} bounces per mesh period, "
    words += f"y_min {float(run.displacement_min):.3g}"
    return period == 0 and bounces > 0.0, words


def _listed(values):
    return ", ".join(f"{value:.2f}" for value in values) or "none"


_CHECKS = (
    (
        "P1",
        "nu = 0.815: nu_max 0.7391, nu_min 0.9639; nu = 0.8151: 0.7392, 0.9640",
        "text to Fig. 6",
        "Fig. 3",
        _scales,
    ),
    (
        "P2",
        "k1 = 3.95, 4, 0.04 N s/mm: beta 0.062, 0.0624, 0.000624",
        "text, Fig. 2",
        "Fig. 3",
        _damping_ratios,
    ),
    (
        "P3",
        "the size of k1 shifts the phase of y(t) against C(t)",
        "Fig. 2",
        "Fig. 2",
        _phase_shift,
    ),
    (
        "P4",
        "conservative: normal mesh for 0.6 <= nu < 0.8 except a small region near 0.66",
        "Fig. 3",
        "Fig. 3",
        _conservative_smooth,
    ),
    (
        "P5",
        "conservative: contact bounces begin at nu = 0.8; above, bounces and inverse mesh, chaotic",
        "Fig. 3",
        "Fig. 3",
        _conservative_chaotic,
    ),
    (
        "P6",
        "k1 > 0: normal mesh on 0.6 ... 0.8, bounces on 0.8 ... 1.12 without inverse mesh, normal "
        "mesh again above",
        "Fig. 3",
        "Fig. 3",
        _damped_bounces,
    ),
    (
        "P7",
        "k1 = 0, k1m > 0 is the only damped variant not in purely normal mesh above 1.12",
        "Fig. 3",
        "Fig. 3",
        _only_oil_bounces_above,
    ),
    (
        "P8",
        "contact ratio 1.1: mesh mostly at C_min; 1.9: mostly at C_max",
        "Fig. 4",
        "Fig. 4",
        _contact_ratios,
    ),
    (
        "P9",
        "conservative phase planes: all unsteady, bounces at 0.66, 0.80, 0.81, 0.82, inverse mesh "
        "at 0.81, 0.82 only",
        "Fig. 5",
        "Fig. 5",
        _conservative_planes,
    ),
    (
        "P10",
        "k1 = 0, k1m > 0: unsteady at 0.60, 0.66, 0.78; every other damped cell steady",
        "Fig. 5",
        "Fig. 5",
        _damped_planes,
    ),
    (
        "P11",
        "nu = 0.815 and 0.8151 give drastically different orbits: small and large bounces",
        "Fig. 6",
        "Fig. 6",
        _two_tunings,
    ),
    (
        "P12",
        "time in mesh at C_min at nu = 0.82: t(k1,k1m) > t(k1,0) > t(0,k1m)",
        "Fig. 7",
        "Fig. 7",
        _time_at_min_stiffness,
    ),
    (
        "P13",
        "conservative, nu = 0.66, six degrees of freedom: unsteady, contact bounces",
        "Fig. 8",
        "Fig. 8",
        _six_degrees,
    ),
)
