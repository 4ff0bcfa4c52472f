"""Basins of attraction: a map for each case, with the attractors in it."""

from gearlib.figures import style

_HEIGHT = 3.9
#: Colours of the attractors in their order; chaotic, unbounded and undecided have their own.
COLOURS = (*style.PALETTE, "#F0E442", "#8C510A", "#762A83", "#A6DBA0", "#FDB863")
OTHERS = {1: "#000000", 2: "#D9D9D9", 3: "#FFFFFF"}
_MARKERS = "o^sDvP*X<>hp"
_KINDS = ("period", "chaotic", "unbounded", "undecided")


def looks(kinds):
    """Return (colour, marker) of each attractor, given its kind."""
    periodic = iter(range(len(kinds)))
    chosen = []
    for kind in kinds:
        i = next(periodic) if kind == 0 else 0
        colour = COLOURS[i % len(COLOURS)] if kind == 0 else OTHERS[int(kind)]
        chosen.append((colour, _MARKERS[i % len(_MARKERS)]))
    return chosen


@style.styled()
def draw(data):
    """Draw the basins of all cases of `gearlib.studies.global_picture.basin_cases`.

    Every initial state has the colour of its attractor, whose stroboscopic states are marked
    where they lie in the picture; below, periods and shares.
    """
    figure, panels = style.panels(data.sizes["case"], _HEIGHT)
    for i, axes in enumerate(panels):
        _draw_case(axes, data.isel(case=i))
    return figure


def _draw_case(axes, case):
    basin = case.basin.values
    count = int(basin.max()) + 1
    kinds = case.attractor_kind.values[:count]
    chosen = looks(kinds)
    x, v = case.displacement.values, case.velocity.values
    style.map_of_codes(axes, x, v, basin.T, [colour for colour, _ in chosen])
    limits = axes.get_xlim(), axes.get_ylim()
    handles = []
    for i, (colour, marker) in enumerate(chosen):
        share, error = float(case.share[i]), float(case.share_error[i])
        words = _KINDS[kinds[i]] + (f" {int(case.period[i])}" if kinds[i] == 0 else "")
        words += f": {100 * share:.1f} ± {100 * error:.2f} %"
        options = {"marker": marker, "markerfacecolor": colour, "markeredgecolor": "white"}
        if kinds[i] == 0:
            points = case.state.values[i]
            axes.plot(*points.T, linestyle="none", markersize=5.5, **options)
        options["markeredgecolor"] = "grey"
        handles.append(style.entry(words, "C0", "none", markersize=5, **options))
    axes.set_xlim(limits[0])
    axes.set_ylim(limits[1])
    axes.set_title(str(case.case.item()))
    axes.set_xlabel("initial displacement (static defl.)")
    axes.set_ylabel(f"initial {style.RATE}" if axes.get_subplotspec().is_first_col() else "")
    axes.legend(
        handles=handles,
        loc="upper center",
        bbox_to_anchor=(0.5, -0.16),
        ncols=2,
        fontsize=6.5,
        frameon=False,
        handletextpad=0.2,
        columnspacing=1.0,
    )
