"""Campbell diagram: natural frequencies, orders of the mesh frequencies, speeds of lost contact."""

import numpy as np
import xarray as xr

from gearlib.data.motions import FRACTION_TOLERANCE
from gearlib.figures import schematic, style

_MODE_COLOURS = {"rotational": "#D55E00", "translational": "#56B4E9", "satellite": "#CC79A7"}
_OTHER_MODE_COLOUR, _LOST_CONTACT_COLOUR = "0.5", "#F0E442"
#: Whether the meshes excite an intersection -> its name, face colour and marker size.
_INTERSECTIONS = {True: ("excited", "black", 3.5), False: ("not excited", "white", 2.5)}


@style.styled()
def draw(diagram: xr.Dataset):
    """Return a figure of frequencies over the speed of the reference pinion, beside the train.

    `diagram` is a result of `gearlib.studies.trains.campbell`; mesh_rate is the frequency of each
    mesh over that of the reference mesh. Speeds at which a mesh loses contact in a sweep are marked
    behind the line of its mesh frequency.
    """
    figure = style.page_figure(height=4.2)
    # `draw_train` draws the train and returns the rest of the figure.
    axes = schematic.draw_train(figure, diagram, colours={}).add_subplot()
    speed = diagram.speed.values
    handles = draw_orders(axes, diagram, speed[-1])
    # The suffix "high": the largest fraction of time in contact over several initial states.
    loses_contact = diagram.contact_loss_fraction_high.max("direction") > FRACTION_TOLERANCE
    half_step = np.array([-0.5, 0.5]) * (speed[1] - speed[0])
    for name in diagram.mesh.values:
        relative_frequency = float(diagram.mesh_rate.sel(mesh=name))
        for middle in speed[loses_contact.sel(mesh=name)]:
            ends = middle + half_step
            frequency = mesh_frequency_per_speed(diagram) * relative_frequency * ends
            axes.plot(ends, frequency, color=_LOST_CONTACT_COLOUR, linewidth=5, zorder=0.5)
    axes.axvline(speed[0], color="0.6", linestyle=":", linewidth=0.8, zorder=0.4)
    style.second_scale(axes, float(diagram.tuning[-1]) / speed[-1], style.OWN_TUNING_LABEL)
    handles.append(style.legend_entry("sweeps begin", "0.6", ":", linewidth=0.8))
    handles.append(style.legend_entry("contact lost in a sweep", _LOST_CONTACT_COLOUR, linewidth=5))
    style.legend(figure, handles, columns=4, fontsize=6.5)
    return figure


def mesh_frequency_per_speed(diagram: xr.Dataset) -> float:
    """Return the frequency of the reference mesh over the speed of its pinion, kHz/rpm."""
    order = float(diagram.stiffness_order[0])
    return 1e-3 * float(diagram.natural_frequency[0] / diagram.critical_speed[0, 0]) / order


def draw_orders(axes, diagram: xr.Dataset, stop: float) -> list:
    """Draw natural frequencies, mesh orders and intersections up to the speed `stop` (rpm).

    Return the legend handles. `diagram` is a result of `gearlib.studies.trains.campbell`; multiples
    of mesh frequencies are dashed. An order is a frequency over that of the reference mesh.
    """
    per_speed = mesh_frequency_per_speed(diagram)
    natural_frequencies = 1e-3 * diagram.natural_frequency.values
    colours = {str(kind): _OTHER_MODE_COLOUR for kind in diagram.mode_kind.values} | _MODE_COLOURS
    top = 1.05 * natural_frequencies.max()
    for frequency, kind in zip(natural_frequencies, diagram.mode_kind.values, strict=True):
        axes.axhline(frequency, color=colours[str(kind)], linewidth=0.7, zorder=1)
    # Without the orders of the meshes, no order of the stiffness is known to be a multiple.
    mesh_orders = diagram.get("mesh_rate", diagram.stiffness_order).values
    orders = diagram.stiffness_order.values
    for order, text in zip(orders, style.number_texts(orders, digits=3), strict=True):
        # The line ends at the right or at the upper limit of the axes: (speed, frequency).
        end = min(stop, top / (per_speed * order)) * np.array([1.0, per_speed * order])
        dashes = "-" if order in mesh_orders else "--"
        axes.plot([0.0, end[0]], [0.0, end[1]], dashes, color="0.3", linewidth=0.8)
        box = style.white_box(padding=0.15)
        style.annotate(axes, text, 0.97 * end, anchor="center center", bbox=box)
    for is_excited, (_, face, size) in _INTERSECTIONS.items():
        mask = diagram.excites.values == is_excited
        x = diagram.critical_speed.values[mask]
        y = np.broadcast_to(natural_frequencies, mask.shape)[mask]
        options = {"markerfacecolor": face, "markeredgewidth": 0.5, "zorder": 3}
        style.draw_markers(axes, x, y, "o", "black", size, **options)
    axes.set(xlim=(0.0, stop), ylim=(0.0, top))
    axes.set(xlabel="speed of the reference pinion (rpm)", ylabel="frequency (kHz)")
    kinds = dict.fromkeys(map(str, diagram.mode_kind.values))
    handles = [style.legend_entry(f"{kind} mode", colours[kind]) for kind in kinds]
    handles.append(style.legend_entry("mesh frequency", "0.3", linewidth=0.8))
    handles.append(style.legend_entry("its multiple", "0.3", "--", linewidth=0.8))
    for name, face, size in _INTERSECTIONS.values():
        options = {"marker": "o", "markerfacecolor": face, "markersize": size}
        handles.append(style.legend_entry(name, line="none", **options))
    return handles
