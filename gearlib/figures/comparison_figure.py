"""The resonance characteristics of several gears over each other, labelled by case or project."""

from gearlib.figures import panels, style
from gearlib.figures import resonance_figure as fig3


@style.styled()
def draw(curves, labels):
    """Draw displacements in micrometres above, and the largest mesh forces over the loads below.

    curves (for each case its characteristics, as in `gearlib.figures.resonance_figure.draw`; from
    rest, where they have that direction); labels: their names. A case has a colour, a damping of it
    a line.
    """
    figure = style.page(6.0)
    above, below = figure.subplots(2, 1, sharex=True, height_ratios=[2.0, 1.0])
    mains = [_in_micrometres(fig3.sweeps_from_rest(data.sortby("tuning"))) for data in curves]
    above.set_ylim(style.limits(*(fig3.shown_range(main, fig3.EXTREMA) for main in mains)))
    below.set_ylim(0.0, 1.05 * max(fig3.shown_range(main, fig3.FORCE)[1] for main in mains))
    for number, (main, case) in enumerate(zip(mains, labels, strict=True)):
        colour = style.PALETTE[number % len(style.PALETTE)]
        for name, look in style.looks([str(name) for name in main.damping.values]).items():
            sweep, shift = main.sel(damping=name), number / len(mains)
            look = style.Look(colour, look.line, look.marker)
            label = f"{case}, {style.damping_label(name)}" if main.damping.size > 1 else case
            fig3.draw_sweep(above, sweep, look, shift, label=label)
            fig3.draw_sweep(below, sweep, look, shift, fig3.FORCE)
    above.set_ylabel("displacement (µm)")
    below.set_ylabel(panels.axis_label(mains[0][fig3.FORCE[0]], 24))
    below.set_xlabel(style.TUNING)
    style.legend(figure, above, 3)
    return figure


def _in_micrometres(sweeps):
    """Return sweeps with displacements in micrometres: static deflections differ between cases."""
    unit = 1e6 * sweeps.static_deflection
    return sweeps.assign({name: unit * sweeps[name] for name in fig3.EXTREMA})
