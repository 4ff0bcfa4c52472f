"""Figures of drawn gears: derived numbers, Harris map, load share, and their motion."""

import math

import numpy as np
import panel as pn

from gearlib.figures.style import PALETTE
from gearlib.pages.explorer.curves import Curves, Room, beside, empty, pane
from gearlib.pages.explorer.motion import Motion

#: As high as the table beside them.
_HARRIS, _SHARE = Room(0.45, 400, 340, 2), Room(0.45, 400, 260)


class DrawnFigures(Curves):
    """The figures of the view of a `Drawing`, and of its motion."""

    def __init__(self, drawing):
        self.motion = Motion(over_speed=True)
        self.resonance = self.motion.resonance
        self.table = pn.pane.Markdown("", width=290)
        self._loads = drawing.loads
        #: Names of the curves of the Harris map, in the order of the loads.
        self._curves = [*range(drawing.loads.size), "chosen"]
        super().__init__([*self._curves, "share"])

    def panes(self):
        """Return the derived numbers and the figures."""
        first = self.table, pane(self._harris(), _HARRIS), pane(self._share(), _SHARE)
        return [beside(*first), *self.motion.panes()]

    def draw(self, seen):
        """Show a view, and return it in words."""
        lines = [f"| {name} | {value} |" for name, value in rows(seen)]
        self.table.object = "\n".join(["| derived | |", "|---|---:|", *lines])
        error = seen.error
        # After the last mesh period it closes where it began; several, if there are pitch errors.
        count = len(seen.mesh.pitch_errors)
        phase = np.append(error.phase.values / math.tau, count)
        curves = 1e6 * error.transmission_error.values
        for name, curve in zip(self._curves, curves, strict=True):
            self.show(name, phase, np.append(curve, curve[0]))
        error = error.isel(phase=slice(0, error.phase.size // count))
        position, share = 1e3 * error.path_position.values, error.load_share.values[-1]
        inside = np.isfinite(position)
        order = np.argsort(position[inside])
        self.show("share", position[inside][order], share[inside][order])
        # The pitch point.
        self.marker.location = 1e3 * seen.mesh.pitch_point
        return self.motion.draw(seen)

    def _harris(self):
        plot = empty("Harris map: static transmission error", "mesh phase / 2π", "µm")
        for name, load in zip(self._curves, [*self._loads, None], strict=True):
            words, colour, width = "chosen torque", PALETTE[0], 3
            if load is not None:
                words, colour, width = f"{load:g} N m", "#999999", 1
            self.line(plot, name, colour, line_width=width, legend_label=words)
        plot.add_layout(plot.legend[0], "right")
        return plot

    def _share(self):
        plot = empty("Load share of a pair of teeth", "position on the path of contact, mm", "")
        self.line(plot, "share", PALETTE[0])
        return self.marked(plot)


def rows(seen):
    """Return the derived numbers of a view of drawn gears as pairs of texts."""
    mesh, pair, static = seen.mesh, seen.pair, seen.error.isel(torque=-1)
    return [
        ("contact ratio", f"{mesh.contact_ratio:.4f}"),
        ("working pressure angle", f"{math.degrees(mesh.working_pressure_angle):.2f}°"),
        ("centre distance", f"{1e3 * mesh.centre_distance:.3f} mm"),
        ("backlash", f"{1e6 * mesh.backlash:.0f} µm"),
        ("least backlash, ISO/TR 10064-2", f"{1e6 * mesh.recommended_backlash:.0f} µm"),
        ("C_max", f"{1e-6 * pair.max_stiffness:.1f} N/µm"),
        ("κ", f"{pair.stiffness_ratio:.4f}"),
        ("ε", f"{pair.contact_ratio:.4f}"),
        ("static deflection", f"{1e6 * pair.static_deflection:.2f} µm"),
        ("mean eigenfrequency", f"{pair.mean_eigenfrequency / math.tau:.0f} Hz"),
        ("resonance speed", f"{pair.speed(1.0):.0f} rpm"),
        ("peak-to-peak error", f"{1e6 * static.peak_to_peak_error.item():.2f} µm"),
        ("effective contact ratio", f"{static.effective_contact_ratio.item():.4f}"),
    ]
