"""Our branch beside AUTO-07p's on a smoothed mesh: folds, and heights of orbits, over the width.

AUTO-07p (Doedel and others; Debian package auto-07p, with gfortran) knows smooth systems only, so
that its results go to ours as the width of the smoothing goes to zero. Run as

    python benchmarks/auto/run.py

Every width takes AUTO some seconds to minutes. The numbers are in docs/continuation.md.
"""

import json
import math
import shutil
import subprocess
import tempfile
from pathlib import Path

import numpy as np
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicHermiteSpline

from gearlib import GearPair, continue_orbit, periodic_orbit
from gearlib.analysis.orbits.special_points import FOLD

HERE = Path(__file__).parent
#: The paper's mesh, damped alike in contact and in free flight: only g and c have to be smoothed.
RATIOS = {
    "contact_ratio": 1.569,
    "stiffness_ratio": 0.5879,
    "damping": 0.0617,
    "backlash_ratio": 4.0,
}
START, STOP, SHOWN = 0.6, 1.2, 0.75
WIDTHS = (0.1, 0.05, 0.025, 0.0125, 0.00625)
#: Types of points in AUTO's files: fold of periodic orbits, value asked for.
_FOLD, _GIVEN = 5, -4


def start_orbit(width):
    """Return (phase, states) of the smooth orbit at START, after transients."""
    nu, beta = START, RATIOS["damping"]
    kappa, epsilon, gap = (
        RATIOS[k] for k in ("stiffness_ratio", "contact_ratio", "backlash_ratio")
    )
    high = 1.0 / (kappa + (1.0 - kappa) * (epsilon - 1.0))
    edge = math.cos(math.pi * (epsilon - 1.0))

    def rate(t, z):
        x, v = z
        c = 0.5 * (1.0 + math.tanh((math.cos(t) - edge) / width))
        c = high * (kappa + (1.0 - kappa) * c)
        far = -(x + gap)
        g = 0.5 * (x + math.hypot(x, width)) - 0.5 * (far + math.hypot(far, width))
        return v, (1.0 - c * g) / nu**2 - 2.0 * beta / nu * v

    turn = 2.0 * math.pi
    options = {"method": "DOP853", "rtol": 1e-10, "atol": 1e-12, "max_step": turn / 100}
    settled = solve_ivp(rate, (0.0, 40 * turn), (1.0, 0.0), **options).y[:, -1]
    phase = np.linspace(0.0, turn, 801)
    x, v = solve_ivp(rate, (0.0, turn), settled, t_eval=phase, **options).y
    return phase, np.column_stack([x, v, np.cos(phase), np.sin(phase)])


def solutions(path):
    """Yield (type of point, nu, course of phase, x, x', ...) of a solution file of AUTO-07p."""
    lines = path.read_text(encoding="utf-8").splitlines()
    while lines:
        header = list(map(int, lines[0].split()))
        kind, points, columns, rows, parameters = (header[i] for i in (2, 6, 7, 8, 11))
        values = [float(word) for line in lines[1 : rows + 1] for word in line.split()]
        course = np.reshape(values[: points * columns], (points, columns))
        yield kind, values[-parameters], course
        lines = lines[rows + 1 :]


def height(course):
    """Return largest less smallest displacement of an orbit of AUTO."""
    spline = CubicHermiteSpline(2.0 * math.pi * course[:, 0], course[:, 1], course[:, 2])
    return float(np.ptp(spline(np.linspace(0.0, 2.0 * math.pi, 200_001))))


def auto(width):
    """Return (folds, heights at SHOWN) of AUTO's branch."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for file in ("gear.f90", "gear.auto"):
            shutil.copy(HERE / file, folder)
        phase, states = start_orbit(width)
        np.savetxt(folder / "start.dat", np.column_stack([phase, states]), fmt="%.16e")
        keys = ("damping", "stiffness_ratio", "contact_ratio", "backlash_ratio")
        values = [START, *(RATIOS[key] for key in keys), width]
        case = {
            "parameters": {i + 1: v for i, v in enumerate(values)} | {11: 2.0 * math.pi},
            "intervals": 400,
            "points": 4000,
            "step": 0.05,
            "tunings": [SHOWN],
            "stop": [STOP, 0.5],
        }
        (folder / "case.json").write_text(json.dumps(case), encoding="utf-8")
        done = subprocess.run(["auto-07p", "gear.auto"], cwd=folder, capture_output=True, text=True)
        if not (folder / "s.gear").exists():
            raise RuntimeError(done.stdout[-2000:] + done.stderr[-2000:])
        found = list(solutions(folder / "s.gear"))
    folds = [nu for kind, nu, _ in found if kind == _FOLD]
    return folds, [height(course) for kind, nu, course in found if kind == _GIVEN and nu < 1.0]


def ours():
    """Return (folds, heights at SHOWN) of our branch."""
    pair = GearPair.from_ratios(**RATIOS, backlash_damping=RATIOS["damping"])
    branch = continue_orbit(periodic_orbit(pair, START), to=STOP)
    folds = branch.tuning.values[branch.label.values == FOLD]
    tuning = branch.tuning.values
    heights = []
    for i in np.flatnonzero((tuning[:-1] - SHOWN) * (tuning[1:] - SHOWN) < 0.0):
        share = (SHOWN - tuning[i]) / (tuning[i + 1] - tuning[i])
        states = branch.state.values
        guess = states[i] + share * (states[i + 1] - states[i])
        one = continue_orbit(periodic_orbit(pair, SHOWN, guess=guess), to=SHOWN + 1e-6)
        heights.append(float(one.orbit_height[0]))
    return list(map(float, folds)), heights


if __name__ == "__main__":
    folds, heights = ours()
    print("ours", *(f"{value:.9f}" for value in (*folds, *heights)))
    rows = []
    for width in WIDTHS:
        rows.append(np.concatenate(auto(width)))
        print(f"{width:7.5f}", *(f"{value:.9f}" for value in rows[-1]), flush=True)
    # The hyperbolas cost w^2 log w, the tanh w^2: three widths give the limit.
    for i in range(len(WIDTHS) - 2):
        w = np.array(WIDTHS[i : i + 3])
        terms = np.column_stack([np.ones(3), w**2, w**2 * np.log(w)])
        limit = np.linalg.solve(terms, rows[i : i + 3])[0]
        print("limit  ", *(f"{value:.9f}" for value in limit))
        print("  less ours", *(f"{value:.1e}" for value in limit - (folds + heights)))
