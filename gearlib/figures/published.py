"""A published problem: its motions in the phase plane, in time and in section, and a scan."""

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from gearlib.figures import style

_HEIGHT = 5.6
_LABELS = ("periodic", "quasi-periodic", "chaotic", "undecided", "unbounded")
_CHAOTIC = 2
#: Periods of the forcing drawn in the phase plane; of a chaotic motion as many as were recorded.
_SHOWN = 4

#: Name of displacement, its derivative in the model's time, time in periods, scanned parameter.
SYMBOLS = {
    "gear_rattle": ("$\\theta$", "$\\dot\\theta$", "eccentricity $\\varepsilon$"),
    "gear_pair": ("$x$", "$\\dot x$", "frequency $\\Omega$"),
    "soft_impact": ("$y$", "$\\dot y$", "gap $g$"),
}


def draw(**surveys):
    """Draw the surveys of problems, by their names; return the figures by theirs."""
    return {f"published_{name}": draw_survey(survey, name) for name, survey in surveys.items()}


@style.styled()
def draw_survey(survey, name):
    """Draw the survey of a problem.

    Parameters
    ----------
    survey : xarray.Dataset
        As of `gearlib.studies.trials.published.survey`.
    name : str
        A key of `SYMBOLS`.

    Returns
    -------
    matplotlib.figure.Figure
        Contact is shaded; the value of the source is dashed in the scan.
    """
    place, speed, parameter = SYMBOLS[name]
    figure = Figure((style.PAGE_WIDTH, _HEIGHT), layout="constrained")
    grid = figure.add_gridspec(2, 3, height_ratios=[1.0, 0.9])
    plane, section, course = (figure.add_subplot(grid[0, i]) for i in range(3))
    scan = figure.add_subplot(grid[1, :])
    frequency = float(survey.tuning)
    turns = survey.phase.values / (2.0 * np.pi)
    first = turns < _SHOWN
    handles = []
    for i in range(survey.sizes["attractor"]):
        one = survey.isel(attractor=i)
        colour = style.PALETTE[i % len(style.PALETTE)]
        chaotic = int(one.label) == _CHAOTIC
        x, v = one.displacement.values, one.velocity.values * frequency
        shown = slice(None) if chaotic else first
        width = 0.4 if chaotic else 1.1
        plane.plot(x[shown], v[shown], color=colour, linewidth=width, zorder=1 if chaotic else 2)
        course.plot(turns[first], x[first], color=colour)
        points = one.strobe_displacement.values, one.strobe_velocity.values * frequency
        marker = {"marker": ",", "zorder": 1} if chaotic else {"marker": "o", "markersize": 4}
        section.plot(*points, linestyle="none", color=colour, **marker)
        handles.append(Line2D([], [], color=colour, label=_words(one)))
    if not (survey.label.values == _CHAOTIC).any():
        # A few points have no scale of their own.
        section.set(xlim=plane.get_xlim(), ylim=plane.get_ylim())
    plane.set_xlim(_shade(plane.axvspan, plane.get_xlim(), survey))
    course.set_ylim(_shade(course.axhspan, course.get_ylim(), survey))
    plane.set(xlabel=place, ylabel=speed, title="phase plane")
    section.set(xlabel=place, ylabel=speed, title="once per period")
    course.set(xlabel="periods of the forcing", ylabel=place, title="time course")
    course.set_xlim(0.0, _SHOWN)
    seen = survey.scan_displacement.values
    value = np.broadcast_to(survey.value.values[:, None, None], seen.shape)
    scan.plot(value.ravel(), seen.ravel(), linestyle="none", marker=".", markersize=1.0, c="black")
    scan.axvline(float(survey.chosen_value), color="grey", linestyle="--", linewidth=0.8, zorder=0)
    scan.set(xlabel=parameter, ylabel=f"{place} once per period")
    scan.set_xlim(survey.value.values[0], survey.value.values[-1])
    figure.legend(handles=handles, loc="outside upper center", ncols=2)
    return figure


def _words(one):
    """Return the label, share and measure of stability of one motion."""
    label = _LABELS[int(one.label)]
    share = f"from {100.0 * float(one.share):.0f} % of the starts"
    if label == "periodic":
        return f"period {int(one.period)}, {share}, $|\\mu|$ = {float(one.largest_multiplier):.4f}"
    exponent, error = float(one.exponent), float(one.uncertainty)
    return f"{label}, {share}, exponent {exponent:.3f} ± {error:.3f} per period"


def _shade(span, limits, survey):
    """Shade where there is contact, within the limits of an axes; return the limits."""
    upper, lower = float(survey.upper_edge), float(survey.lower_edge)
    low, high = limits
    if high > upper:
        span(upper, high, color="#EBEBEB", linewidth=0, zorder=0)
    if low < lower:
        span(low, lower, color="#EBEBEB", linewidth=0, zorder=0)
    return limits
