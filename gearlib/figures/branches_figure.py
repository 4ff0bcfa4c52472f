"""Branches of periodic orbits with their special points, and how damping moves these."""

import numpy as np

from gearlib.figures import style

_HEIGHT = 6.6
#: Points on both sides of a fold that tell on which side it lies.
_FAR = 6
#: label -> (name, colour, marker), in the codes of `gearlib.analysis.orbits.special_points`.
_SPECIAL = {
    1: ("fold", style.PALETTE[4], "o"),
    2: ("period doubling", style.PALETTE[5], "D"),
    3: ("Neimark-Sacker", style.PALETTE[1], "^"),
    4: ("grazing", style.PALETTE[0], "s"),
    5: ("branch point", style.PALETTE[3], "x"),
}


def draw_curve(axes, branches, variable, colour, width=1.0, zorder=2.0):
    """Draw a variable of branches over the tuning: solid where stable, dashed where unstable.

    `branches` are those of `gearlib.studies.resonance_branches.compute`.
    """
    tuning, values = branches.tuning.values, branches[variable].values
    number, stable = branches.branch.values, branches.stable.values.astype(bool)
    for one in np.unique(number):
        at = np.flatnonzero(number == one)
        # Pieces of one kind; each begins where the one before it ends.
        cuts = np.flatnonzero(np.diff(stable[at].astype(int))) + 1
        for piece in np.split(at, cuts):
            first = max(piece[0] - 1, at[0])
            drawn = slice(first, piece[-1] + 1)
            axes.plot(
                tuning[drawn],
                values[drawn],
                color=colour,
                linewidth=width,
                linestyle="-" if stable[piece[0]] else style.DASHED,
                zorder=zorder,
            )


@style.styled()
def draw(branches, loci):
    """Draw the branches of one damping, labelled, and the loci of their special points.

    They are those of `compute` and `compute_loci` of `gearlib.studies.resonance_branches`.
    Above, heights of orbits over the tuning; below, where the special points lie over tuning
    and damping ratio. The dotted line is the damping of the branches.
    """
    figure = style.page(_HEIGHT)
    top, bottom = figure.subplots(2, sharex=True, height_ratios=[1.2, 1.0])
    draw_curve(top, branches, "orbit_height", "black")
    tuning, height, labels = (branches[name].values for name in ("tuning", "orbit_height", "label"))
    shown = draw_special_points(top, tuning, height, labels)
    _name_places(top, tuning, height, labels, shown)
    for number in np.unique(loci["locus"].values):
        one = loci.isel(point=np.flatnonzero(loci["locus"].values == number))
        _draw_locus(bottom, one)
    given = float(loci.own_damping)
    bottom.axhline(given, color="black", linewidth=0.6, linestyle=":")
    for code in shown:
        at = labels == code
        _, colour, marker = _SPECIAL[code]
        bottom.plot(tuning[at], np.full(at.sum(), given), marker, color=colour, markersize=3.5)
    handles = [style.entry("stable orbit"), style.entry("unstable orbit", line=style.DASHED)]
    handles += [special_entry(code, "-") for code in shown]
    style.legend(figure, handles, len(handles), "upper")
    top.set_ylabel("height of the orbit\n(static defl.)")
    bottom.set_ylabel("damping ratio $\\beta$")
    bottom.set_xlabel(style.TUNING)
    return figure


def draw_special_points(axes, x, y, labels):
    """Mark the special points of branches, and return the codes of those that there are."""
    shown = [code for code in _SPECIAL if (labels == code).any()]
    for code in shown:
        _, colour, marker = _SPECIAL[code]
        at = labels == code
        axes.plot(x[at], y[at], marker, color=colour, markersize=4.5, zorder=3)
    return shown


def special_entry(code, line="none"):
    """Return what a legend says of a special point."""
    name, colour, marker = _SPECIAL[code]
    return style.entry(name, colour, line, marker, markersize=4)


def _draw_locus(axes, locus):
    """Draw the two halves of one locus, from its special point on."""
    _, colour, _ = _SPECIAL[int(locus.label[0])]
    tuning, damping = locus.tuning.values, locus.damping_ratio.values
    # The second half begins anew at the special point.
    given = float(locus.own_damping)
    starts = np.flatnonzero(np.isclose(damping, given, rtol=1e-12, atol=0.0))
    for part in np.split(np.arange(tuning.size), starts[1:]):
        axes.plot(tuning[part], damping[part], color=colour, linewidth=1.0)


def _name_places(axes, tuning, height, labels, shown):
    """Write the tuning beside each special point; close ones share a line of text."""
    at = np.flatnonzero(np.isin(labels, shown))
    near_height = 0.06 * np.ptp(axes.get_ylim())
    near_tuning = 0.05 * (np.ptp(tuning) or 1.0)
    groups = []
    for i in at[np.argsort(height[at], kind="stable")]:
        for group in groups:
            first = group[0]
            if (
                abs(height[i] - height[first]) < near_height
                and abs(tuning[i] - tuning[first]) < near_tuning
            ):
                group.append(i)
                break
        else:
            groups.append([i])
    for group in groups:
        words = ", ".join(f"{tuning[i]:.4f}" for i in sorted(group, key=lambda i: tuning[i]))
        # Beside a fold, on the side to which no branch goes; else above.
        i = min(group, key=lambda i: labels[i])
        around = tuning[[max(i - _FAR, 0), min(i + _FAR, tuning.size - 1)]]
        if (around > tuning[i]).all():
            place = (-6, 0), "right center"
        elif (around < tuning[i]).all():
            place = (6, 0), "left center"
        else:
            place = (0, 6), "center bottom"
        style.note(axes, words, (tuning[i], height[i]), *place, white=(0.15, 0.85), zorder=2.5)
