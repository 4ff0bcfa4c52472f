"""Gears given by geometry with published numbers, for the tests."""

import math

from gearlib.geometry import GearStage, Material, Rack, SpurGear


def iso_example(**changes):
    """Return example 1 of ISO/TR 6336-30:2017, with tip diameters rounded to 10 um."""
    common = {"module": 8e-3, "helix_angle": math.radians(15.8), "width": 0.1, "rack": "D"}
    pinion = SpurGear(teeth=17, shift=0.145, tip_diameter=0.15966, **common | changes)
    return GearStage(pinion, SpurGear(teeth=103, tip_diameter=0.87235, **common | changes), 0.5)


def fzg_c(**changes):
    """Return the FZG type C stage with shafts of 30 mm, as in the worked example."""
    common = {"module": 4.5e-3, "width": 0.014, "bore": 0.03} | changes
    pinion = SpurGear(teeth=16, shift=0.1817, tip_diameter=0.08246, **common)
    return GearStage(
        pinion, SpurGear(teeth=24, shift=0.1715, tip_diameter=0.11836, **common), 0.0915
    )


def gears_of_20_teeth(**changes):
    """Return a stage with z 20/20, m 10 mm, b 30 mm, E 200 GPa, a common example of backlash."""
    values = {"teeth": 20, "module": 0.01, "width": 0.03, "material": Material(young=200e9)}
    gear = SpurGear(**values | changes)
    return GearStage(gear, gear)


def high_contact_ratio_stage():
    """Return a stage of slender teeth with two or three pairs in contact at a time."""
    rack = Rack(addendum=1.35, dedendum=1.6, tip_radius=0.2)
    gear = SpurGear(teeth=50, module=4e-3, width=0.02, rack=rack)
    return GearStage(gear, gear)


def ring_stage(**changes):
    """Return the stage of a planet and a ring gear of standard proportions."""
    gear = SpurGear(teeth=36, module=4e-3, width=0.03)
    ring_values = {"teeth": 99, "outer_diameter": 0.44, "internal": True} | changes
    return GearStage(gear, SpurGear(module=4e-3, width=0.03, **ring_values))


def short_tooth_stage(helix_hands=(1, 1), **changes):
    """Return a helical stage with transverse contact ratio 0.82 and overlap ratio 2.9.

    `helix_hands` are the signs of both helix angles.
    """
    common = {"module": 3e-3, "width": 0.08, "rack": Rack(addendum=0.5)} | changes
    return GearStage(
        *(
            SpurGear(teeth=z, helix_angle=sign * 0.35, **common)
            for z, sign in zip((25, 60), helix_hands, strict=True)
        )
    )


def documentation_stage(**changes):
    """Return a stage with z 23/61, m 2.5 mm, b 18 mm, an example of the documentation."""
    pinion, wheel = (SpurGear(teeth=z, module=2.5e-3, width=0.018, **changes) for z in (23, 61))
    return GearStage(pinion, wheel, backlash=80e-6)
