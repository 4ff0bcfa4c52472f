"""Draw the picture of the home page and the README anew: `python -m docs.hooks.home_picture`."""

import math
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from gearlib import LoadSharingPair, plot, sweep
from gearlib.figures import style
from gearlib.geometry import GearStage, SpurGear
from gearlib.models.geometry.mesh_stiffness import Tooth


def fill_gear(axes, gear, centre, angle, colour):
    """Fill a gear whose first tooth points in the direction `angle`; `centre` is in mm."""
    tooth = Tooth(gear, gear.width)
    tip = gear.tip_roll_length / tooth.base_radius
    x, y, _ = tooth.flank(np.linspace(tooth.form_phi, tip, 12))
    # The fillet is drawn as a straight line that widens towards the root.
    root = tooth.root_radius * np.exp(1.25j * math.atan2(abs(x[0]), y[0]))
    flank = np.r_[root, y + 1j * np.abs(x)]
    directions = angle + 2.0 * math.pi / gear.teeth * np.arange(gear.teeth)
    outline = 1e3 * np.outer(np.exp(1j * directions), np.r_[flank.conj(), flank[::-1]]).ravel()
    axes.fill(outline.real + centre, outline.imag, color=colour, linewidth=0)


def draw():
    """Return the figure: a gear pair, and its resonance with both jumps."""
    pinion, wheel = (SpurGear(teeth=z, module=2.5e-3, width=18e-3) for z in (23, 61))
    mesh = GearStage(pinion, wheel, backlash=80e-6)
    pair = LoadSharingPair.from_geometry(mesh, torque=85.0, damping_ratio=0.06)
    figure = Figure((8.0, 3.2), layout="constrained")
    gears, curve = figure.subplots(1, 2, width_ratios=(1.0, 1.7))
    fill_gear(gears, pinion, 0.0, 0.0, (style.PALETTE[0], 0.75))
    facing_angle = math.pi * (1.0 - 1.0 / wheel.teeth)
    fill_gear(gears, wheel, 1e3 * mesh.centre_distance, facing_angle, "0.6")
    gears.set(aspect="equal", xlim=(-34.0, 58.0), ylim=(-34.0, 34.0))
    gears.axis("off")
    tunings, settings = np.linspace(0.5, 1.3, 801), {"periods": 200, "record_periods": 8}
    curves = [sweep(pair, tunings, direction=to, **settings) for to in ("up", "down")]
    plot.resonance(*curves, axes=curve, variable="displacement_max")
    return figure


if __name__ == "__main__":
    with style.rc_context():
        style.save(draw(), Path(__file__).parents[1] / "images" / "home.png")
