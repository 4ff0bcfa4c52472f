"""Dynamic factor of two drawn gears over speed: exact sweeps beside ISO 6336-1, method B.

K_v is the largest mesh force over the static one. The standard has one curve; the sweeps, up and
down, have jumps, hysteresis, and peaks at fractions and multiples of the resonance. The model is
the smallest, a rectangular mesh stiffness, by both methods of `gearlib.geometry`. The teeth are
perfect, or deviate by a cosine of the mesh phase with both signs; from trough to crest it is as
high as their quality allows after running in, f_pb,eff + f_f,eff.
"""

import numpy as np

from gearlib import geometry
from gearlib.data.result import result, stacked
from gearlib.models.geometry import described_drawing
from gearlib.models.harmonics import Harmonics
from gearlib.models.one_degree import OneDegreePair
from gearlib.models.pair import GearPair
from gearlib.runs.sweeping import CARRIED, sweep

STIFFNESS = ("iso", "energy")
#: Change of K_v from speed to speed that counts as a jump.
JUMP = 0.75


def compute(pair, ratios, settings):
    """Return K_v of exact sweeps, up and down, and that of the standard.

    pair (as of `gearlib.models.geometry.described_drawing.mesh`, both gears with their quality;
    torque, N m, of the pinion); ratios: shape (n,), speeds over the resonance speed of the
    standard, N; settings: damping_ratio, periods, record_periods.

    Jumps are from the speed before, in the order of the sweep.
    """
    mesh, torque = described_drawing.mesh(pair), pair["torque"]
    ratios = np.asarray(ratios, float)
    resonance = geometry.dynamic_factor(mesh, torque, 1.0).resonance_speed
    speeds = ratios * resonance
    standard = geometry.dynamic_factor(mesh, torque, speeds)
    perfect = geometry.dynamic_factor(mesh, torque, speeds, pitch_deviation=0.0, form_deviation=0.0)
    height = standard.pitch_deviation + standard.form_deviation
    deviations = [0.0, height / 2.0, -height / 2.0]
    run = {name: settings[name] for name in ("periods", "record_periods")}
    rectangles = {
        method: GearPair.from_geometry(
            mesh, torque=torque, damping_ratio=settings["damping_ratio"], stiffness=method
        )
        for method in STIFFNESS
    }

    def curve(method, amplitude, direction):
        model = rectangle = rectangles[method]
        if amplitude:
            model = OneDegreePair(pair=rectangle, deviation=Harmonics(cosines=(amplitude,)))
        found = sweep(model, rectangle.tuning_at(speeds), direction=direction, **run)
        return {
            "dynamic_factor": found.dynamic_force_max.values,
            "fraction_normal": found.fraction_normal.values,
            "status": found.status.values,
        }

    axes = {
        "stiffness_method": list(STIFFNESS),
        "tooth_deviation": deviations,
        "direction": list(CARRIED),
    }
    data = stacked(axes, curve, "resonance_ratio")
    over, factor = data["dynamic_factor"]
    change = np.abs(np.diff(factor, axis=-1)) > JUMP
    jumps = np.zeros(factor.shape, bool)
    jumps[:, :, 0, 1:], jumps[:, :, 1, :-1] = change[:, :, 0], change[:, :, 1]
    data |= {
        "jumps": (over, jumps),
        "standard_factor": (over[1::2], [perfect.factor, standard.factor, standard.factor]),
        "speed": ("resonance_ratio", speeds),
        "torque": float(torque),
        "damping_ratio": float(settings["damping_ratio"]),
    }
    return result(
        "Dynamic factor of two drawn gears over speed",
        rectangles[STIFFNESS[-1]],
        data,
        axes | {"resonance_ratio": ratios},
        method="exact",
        drawing=pair,
        **settings,
    )
