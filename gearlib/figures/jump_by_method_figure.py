"""Where each method switches between the orbits from rest: a row of ticks for each knob value."""

import numpy as np

from gearlib.figures import style
from gearlib.figures.work_precision_figure import FAMILIES

_ROW_HEIGHT, _HEAD = 0.125, 0.75
_COLUMNS = (1.01, 1.12)


@style.styled()
def draw(jumps, marked=()):
    """Draw the switch points of all methods over the tuning, the cheapest methods above.

    `jumps` are datasets of `gearlib.studies.trials.jump_by_method.compute`, one for each
    method, `marked` tunings to compare with, at most two.

    Ticks lie in the middle of a step of the scan, that of the largest switch where bisection
    puts it. The black line is the exact jump, the band lies between the marked tunings; a thin
    line shows how far a scan went. Beside each row the evaluations per mesh period and the
    error of the largest switch; "none": the scan has no switch.
    """
    rows = sorted(
        (
            (float(data.period_evaluations[k]), str(data.line[k].item()), -k, data, k)
            for data in jumps
            for k in range(data.sizes["rung"])
        ),
        key=lambda row: row[:3],
    )
    # A single row would leave no room for the axes.
    height = max(len(rows), 6)
    figure = style.page(_HEAD + _ROW_HEIGHT * height)
    axes = figure.subplots()
    words = "line: exact jump"
    if marked:
        axes.axvspan(
            min(marked), max(marked), color=style.PALETTE[1], alpha=0.45, linewidth=0.6, zorder=0
        )
        words += f"; band: {' to '.join(f'{nu:g}' for nu in marked)}"
    axes.set_xlabel(f"tuning $\\nu_s$ ({words})")
    exact = float(jumps[0].exact_jump)
    if np.isfinite(exact):
        axes.axvline(exact, color="black", linewidth=0.7, zorder=1)
    names = []
    for y, (cost, line, _, data, k) in enumerate(rows):
        colour = FAMILIES[data.family.values[k]][1]
        low, high = float(data.scan_from[k]), float(data.scan_to[k])
        axes.hlines(y, low, high, color="#CFCFCF", linewidth=0.4, zorder=0)
        ticks = data.switch_tuning.values[data.switch_rung.values == k]
        # The largest switch is known better than the others, which lie somewhere within a step.
        jump, step = float(data.jump[k]), float(data.scan_step[k])
        ticks = np.where(np.abs(ticks - jump) <= 0.5001 * step, jump, ticks)
        axes.vlines(ticks, y - 0.42, y + 0.42, color=colour, linewidth=1.4, zorder=3)
        knob = data.knob.values[k].replace("steps_per_period", "steps")
        names.append(f"{line}, {knob}" if knob else line)
        error = float(data.jump_error[k])
        words = f"{error:+.0e}" if np.isfinite(error) else "none"
        # Bisection tells no more than its resolution.
        if abs(error) <= float(data.resolution[k]):
            words = f"< {float(data.resolution[k]):.0e}"
        _note(axes, _COLUMNS[0], y, f"{cost:.0f}")
        _note(axes, _COLUMNS[1], y, words)
    for x, words in zip(_COLUMNS, ("evaluations", "error"), strict=False):
        _note(axes, x, -1.2, words)
    starts = [float(data.scan_from.min()) for data in jumps if data.sizes["rung"]]
    stops = [float(data.scan_to.max()) for data in jumps if data.sizes["rung"]]
    if rows:
        axes.set_xlim(min(starts), max(stops))
    axes.set_yticks(range(len(names)), names, fontsize=6)
    axes.tick_params(axis="y", length=0)
    axes.set_ylim(height - 0.4, -0.6)
    return figure


def _note(axes, x, y, words):
    """Write beside a row; x in shares of the axes."""
    style.note(axes, words, (x, y), of=("axes fraction", "data"), annotation_clip=False)
