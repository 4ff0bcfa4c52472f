"""Where contact is proven to be kept within a box of two parameters; tightened tolerances."""

import numpy as np
from matplotlib.collections import PolyCollection
from matplotlib.patches import Patch

from gearlib.figures import plot_curves, style

_HEIGHT, _BOX_HEIGHT, _ROW = 1.3, 3.6, 0.28
_CERTIFIED, _FREE = style.PALETTE[2], style.PALETTE[1]
#: Opacity of certified pieces: marks lie on them.
_PALE = 0.35


@style.styled()
def draw(found):
    """Draw `gearlib.tolerances.tolerance_study.kept_contact`: two figures."""
    figure = style.page(_BOX_HEIGHT, 0.75)
    axes = figure.subplots()
    sure = found.certified.values == 1
    ends = np.stack([found.piece_low.values, found.piece_high.values], axis=2)
    names, units = found.box_parameter.values, found.box_units.values
    handles = _pieces(axes, names, units, ends[sure], ends[~sure])
    inside = found.sampled_margin.values > 0.0
    for own, words, marker, colour in (
        (inside, "contact kept", "o", "black"),
        (~inside, "contact lost", "x", _FREE),
    ):
        x, y = found.sampled.values[own].T
        style.dots(axes, x, y, marker, colour, 2.5)
        handles.append(style.entry(words, colour, "none", marker, markersize=3))
    axes.set_title(
        f"proven in {100.0 * float(found.certified_share):.1f} % of the box; "
        f"{int(found.contradictions)} of {int(found.proven_points)} points in it contradict"
    )
    style.legend(figure, handles, 4)
    return {"certified_box": figure, "tightened_tolerances": tightened(found)}


@style.styled()
def certified_box(proof, *, axes=None):
    """Draw the pieces of a box of two parameters: those that are certified, and open ones.

    Parameters
    ----------
    proof : gearlib.tolerances.boxes.BoxCertificate
        Of `gearlib.certify_box`, of two parameters.
    axes : matplotlib.axes.Axes, optional

    Returns
    -------
    matplotlib.axes.Axes

    Raises
    ------
    ValueError
        If it is none, or has not two parameters.
    """
    names = getattr(proof, "names", ())
    if len(names) != 2:
        raise ValueError(
            f"proof = {proof!r:.60} is not allowed: it must be a certificate of "
            "gearlib.certify_box with two parameters"
        )
    axes, _ = plot_curves.axes(axes)
    axes.legend(handles=_pieces(axes, names, proof.units, proof.certified, proof.open))
    axes.set_title(f"proven in {100.0 * proof.share:.1f} % of the box at {proof.speed:g} rpm")
    return axes


def _pieces(axes, names, units, certified, left):
    """Draw pieces, shape (c, 2, 2) each; return what a legend says of them."""
    handles = []
    for pieces, words, colour in (
        (certified, "certified", _CERTIFIED),
        (left, "open", "white"),
    ):
        corners = [[(a, c), (b, c), (b, d), (a, d)] for (a, b), (c, d) in pieces.tolist()]
        look = {"facecolor": colour, "edgecolor": "#7F7F7F", "linewidth": 0.3}
        look["alpha"] = _PALE if colour == _CERTIFIED else 1.0
        axes.add_collection(PolyCollection(corners, **look))
        handles.append(Patch(label=words, **look))
    every = np.concatenate([certified, left])
    for i, name in enumerate(names):
        getattr(axes, f"set_{'xy'[i]}lim")(every[:, i].min(), every[:, i].max())
        words = str(name).replace("_", " ")
        getattr(axes, f"set_{'xy'[i]}label")(f"{words} ({units[i]})")
    return handles


@style.styled()
def tightened(found, *, figure=None):
    """Draw by how much tolerances must shrink, and how many designs are then beyond the limit.

    Parameters
    ----------
    found : xarray.Dataset
        Of `gearlib.tighten`.
    figure : matplotlib.figure.Figure, optional

    Returns
    -------
    matplotlib.figure.Figure
        Left the share that may stay of all tolerances alike, and of each alone: by designs
        (filled), in first order (outline). Right the share of the designs beyond the limit.

    Raises
    ------
    ValueError
        If the dataset is another.
    """
    why = getattr(found, "attrs", {}).get("not_tightened")
    if not why:
        plot_curves.need("tightened", found, ("of_all", "tightened_share"), "tighten")
    rows = 2 if why else 2 + found.sizes["parameter"]
    figure = figure or style.page(_HEIGHT + _ROW * rows)
    if why:
        style.note(figure.subplots(), why, (0.5, 0.5), side="center center", wrap=True)
        figure.axes[0].set_axis_off()
        return figure
    left, right = figure.subplots(1, 2, sharey=True)
    names = [str(one).replace("_", " ") for one in found.parameter.values]
    names = ["as given", "all alike", *(f"{one} alone" for one in names)]
    places = np.arange(len(names))
    for which, of_all, look in (
        ("tightened_share", "of_all", {"color": style.PALETTE[0], "alpha": 0.6}),
        ("first_order_share", "first_order_of_all", {"fc": "none", "ec": "black", "lw": 0.6}),
    ):
        shares = [1.0, float(found[of_all]), *found[which].values]
        left.barh(places, np.nan_to_num(shares), height=0.7, **look)
    for place in places[2:][np.isnan(found.tightened_share.values)]:
        style.note(left, " does not suffice", (0.0, place))
    beyond = [*found.probability.values, *found.tightened_probability.values]
    right.barh(places, np.nan_to_num(beyond), height=0.7, color="#CFCFCF")
    low, high = found.probability_interval.values.T
    middle = found.probability.values
    wide = np.clip([middle - low, high - middle], 0.0, None)
    right.errorbar(middle, places[:2], xerr=wide, fmt="none", ecolor="black", lw=0.6)
    right.axvline(float(found.risk), color="black", linestyle=style.DASHED, lw=0.6)
    left.set_yticks(places, names)
    left.set_ylim(len(names) - 0.5, -0.5)
    left.set_xlim(0.0, 1.05)
    right.set_xlim(left=0.0)
    left.set_xlabel("share of the tolerance that may stay")
    right.set_xlabel("share of the designs beyond the limit")
    return figure
