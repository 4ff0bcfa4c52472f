"""The picture on the home page and the README: a gear pair, and its resonance with both jumps.

`python -m docs.hooks.home_picture` draws it anew.
"""

import math
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from gearlib import LoadSharingPair, sweep
from gearlib.figures import style
from gearlib.geometry import Mesh, SpurGear
from gearlib.models.geometry.mesh_stiffness import Tooth

PICTURE = Path(__file__).parents[1] / "images" / "home.png"


def outline(gear, centre, turn):
    """Return the outline of a gear, its first tooth under an angle, shape (2, n), mm."""
    tooth = Tooth(gear, gear.width)
    tip = gear.tip_roll_length / tooth.base_radius
    x, y, _ = tooth.flank(np.linspace(tooth.form_phi, tip, 12))
    # Down to the root, a little wider there, in a straight line for the fillet.
    angle = 1.25 * math.atan2(x[0], y[0])
    x = np.r_[tooth.root_radius * math.sin(angle), x]
    y = np.r_[tooth.root_radius * math.cos(angle), y]
    one = np.abs(x) + 1j * y
    both = np.r_[one, -one[::-1].conj()]
    pitch = 2.0 * math.pi / gear.teeth
    teeth = [-1j * both * np.exp(1j * (turn + pitch * k)) for k in range(gear.teeth)]
    whole = np.concatenate([*teeth, teeth[0][:1]])
    return 1e3 * whole.real + centre, 1e3 * whole.imag


def draw():
    """Return the figure."""
    pinion = SpurGear(teeth=23, module=2.5e-3, width=18e-3)
    wheel = SpurGear(teeth=61, module=2.5e-3, width=18e-3)
    mesh = Mesh(pinion, wheel, backlash=80e-6)
    pair = LoadSharingPair.from_geometry(mesh, torque=85.0, damping_ratio=0.06)
    tunings = np.linspace(0.5, 1.3, 801)
    figure = Figure((8.0, 3.2), layout="constrained")
    gears, curve = figure.subplots(1, 2, width_ratios=(1.0, 1.7))
    centre = 1e3 * mesh.centre_distance
    gears.fill(*outline(pinion, 0.0, 0.0), color=style.PALETTE[0], alpha=0.75, linewidth=0)
    turn = math.pi * (1.0 - 1.0 / wheel.teeth)
    gears.fill(*outline(wheel, centre, turn), color="0.6", linewidth=0)
    gears.set_aspect("equal")
    gears.set(xlim=(-34.0, 58.0), ylim=(-34.0, 34.0))
    gears.axis("off")
    for direction, colour in (("up", style.PALETTE[0]), ("down", style.PALETTE[4])):
        found = sweep(pair, tunings, periods=200, record_periods=8, direction=direction)
        height = found.displacement_max.values
        curve.plot(found.tuning, height, color=colour, label=f"speed {direction}")
        k = int(np.argmax(np.abs(np.diff(height))))
        at = tunings[k], height[k : k + 2].mean()
        curve.annotate("jump", at, (6.0, -10.0), textcoords="offset points", color=colour)
    curve.set_xlabel("mesh frequency / natural frequency")
    curve.set_ylabel("largest transmission error\n(static deflections)")
    curve.legend()
    return figure


if __name__ == "__main__":
    with style.styled():
        style.save(draw(), PICTURE)
