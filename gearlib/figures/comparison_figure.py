"""The resonance characteristics of several gears over each other, labelled by case or project."""

from gearlib.figures import resonance_figure as fig3
from gearlib.figures import style


@style.styled()
def draw(curves, labels):
    """Draw displacements in micrometres above, and the largest mesh forces over the loads below.

    curves (for each case its characteristics, as in `gearlib.figures.resonance_figure.draw`; from
    rest, where they have that direction); labels: their names. A case has a colour, a damping of it
    a line.
    """
    figure = style.page(6.0)
    above, below = figure.subplots(2, 1, sharex=True, height_ratios=[2.0, 1.0])
    mains = [_main(one.sortby("tuning")) for one in curves]
    limits = [fig3.displacement_limits(one, flank=False) for one in mains]
    above.set_ylim(min(low for low, _ in limits), max(high for _, high in limits))
    below.set_ylim(0.0, 1.05 * max(fig3.extent(one, fig3.FORCE)[1] for one in mains))
    handles = []
    for number, (one, label) in enumerate(zip(mains, labels, strict=True)):
        colour = style.PALETTE[number % len(style.PALETTE)]
        for name, look in style.looks([str(name) for name in one.damping.values]).items():
            curve, shift = one.sel(damping=name), number / len(mains)
            fig3.draw_sweep(above, curve, colour, look.line, look.marker, shift)
            fig3.draw_sweep(below, curve, colour, look.line, look.marker, shift, names=fig3.FORCE)
            words = f"{label}, {style.damping_label(name)}" if one.damping.size > 1 else label
            handles.append(style.entry(words, colour, look.line, look.marker, markersize=4))
    above.set_ylabel("$y$ (µm)")
    below.set_ylabel("mesh force over load")
    below.set_xlabel(style.TUNING)
    style.legend(figure, handles, 3)
    return figure


def _main(curves):
    """Return the curves of one direction, displacements in micrometres: deflections differ."""
    names = curves.direction.values
    main = curves.sel(direction="cold" if "cold" in names else names[0])
    unit = 1e6 * main.static_deflection
    return main.assign({name: unit * main[name] for name in fig3.EXTREMA})
