"""Measured curves as points over the tuning, their jumps as dotted lines."""

from gearlib.figures import style

#: Sets, and how the speed was reached.
_COLOURS = ("#D55E00", "#CC79A7", "#56B4E9", "#882255")
_MARKERS = {1: "^", -1: "v", 0: "o"}
_JUMPS = ("jump_up", "jump_down", "onset_of_contact_loss")


def draw(axes, curves, names):
    """Draw what curves have of some observables; return the entries of the legend.

    curves: datasets of `gearlib.studies.measured_comparison`. What lies beyond the limits
    of the axes is left out.
    """
    handles, limits = [], (axes.get_xlim(), axes.get_ylim())
    for number, curve in enumerate(curves):
        colour, filled = _COLOURS[number % len(_COLOURS)], True
        shown = [one for one in (*names, *_JUMPS) if one in curve]
        for name in [one for one in shown if one not in _JUMPS]:
            attrs = curve[name].attrs
            filled = not (attrs["unknown_gain"] or attrs["unknown_offset"])
            values = (curve[name].values - attrs["fitted_offset"]) / attrs["fitted_gain"]
            for way, marker in _MARKERS.items():
                own = curve.direction.values == way
                look = {"markerfacecolor": colour if filled else "none", "zorder": 3}
                at = curve.tuning.values[own]
                style.dots(axes, at, values[own], marker, colour, 3.0, markeredgewidth=0.5, **look)
        rate = float(curve.attrs["tuning_rate"])
        for name in [one for one in shown if one in _JUMPS]:
            at = rate * float(curve[name])
            axes.axvline(at, color=colour, linestyle=":", linewidth=0.9, zorder=1.6)
        face = {} if filled else {"markerfacecolor": "none"}
        if shown:
            handles.append(style.entry(f"measured: {curve.title}", colour, ":", "^", **face))
    axes.set_xlim(*limits[0])
    axes.set_ylim(*limits[1])
    return handles
