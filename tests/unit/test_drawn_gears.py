"""Gears by their drawing in the configuration: what is derived, what is refused."""

import copy
import math
import subprocess
import sys

import pytest

from gearlib import GearPair
from gearlib.config import cases, load, overlay, overlay_gears
from gearlib.config import gears_section as sections
from gearlib.geometry import Material, Mesh, Rack, SpurGear, TipRelief, Web
from tests.geometry.drawings import fzg_c, iso_example, ring
from tests.paper import CONFIG

FZG = {
    "gears": {
        "pinion": {
            "teeth": 16,
            "module": "4.5 mm",
            "width": "14 mm",
            "shift": 0.1817,
            "tip_diameter": "82.46 mm",
            "bore": "30 mm",
        },
        "wheel": {"teeth": 24, "shift": 0.1715, "tip_diameter": "118.36 mm", "bore": "30 mm"},
        "centre_distance": "91.5 mm",
        "backlash": "160.5 um",
        "torque": "302 N m",
    },
    "dampings": {"k": {"damping_ratio": 0.06, "backlash_damping": 0.0}},
}
MISSING = object()


def changed(path, value, base=FZG):
    settings = copy.deepcopy(base)
    *parts, key = path.split("/")
    section = settings
    for name in parts:
        section = section.setdefault(name, {})
    if value is MISSING:
        del section[key]
    else:
        section[key] = value
    return settings


def pair_of(settings, damping="k"):
    return GearPair(**load(settings).pair_parameters(damping))


def expect(settings, mesh, **options):
    """Compare a configuration with what the library makes of a mesh; 12 digits are kept."""
    expected = GearPair.from_geometry(mesh, **options).as_dict()
    for name, value in pair_of(settings).as_dict().items():
        assert value == pytest.approx(expected[name], rel=1e-11), name


def test_the_pair_is_that_of_the_library():
    drawn = fzg_c()
    mesh = Mesh(drawn.pinion, drawn.wheel, drawn.centre_distance, backlash=160.5e-6)
    expect(FZG, mesh, torque=302.0, damping_ratio=0.06)
    energy = changed("gears/stiffness", "energy")
    energy["gears"]["stiffness_options"] = {"hertz": "logarithmic"}
    expect(
        energy,
        mesh,
        torque=302.0,
        damping_ratio=0.06,
        stiffness="energy",
        options={"hertz": "logarithmic"},
    )
    power = changed("gears/torque", MISSING)
    power["gears"] |= {"power": "60 kW", "speed": "2170 rpm"}
    expect(power, mesh, power=60e3, speed=2170.0, damping_ratio=0.06)


def test_helical_gears_and_a_ring_gear():
    pinion = {"teeth": 17, "module": "8 mm", "width": "100 mm", "helix_angle": "15.8 deg"}
    pinion |= {"shift": 0.145, "tip_diameter": "159.66 mm", "rack": "D"}
    gears = {"pinion": pinion, "wheel": {"teeth": 103, "tip_diameter": "872.35 mm"}}
    helical = FZG | {"gears": gears | {"centre_distance": "500 mm", "torque": "9 kN m"}}
    expect(helical, iso_example(), torque=9000.0, damping_ratio=0.06)
    wheel = {"teeth": 99, "internal": True, "outer_diameter": "440 mm"}
    gears = {"pinion": {"teeth": 36, "module": "4 mm", "width": "30 mm"}, "wheel": wheel}
    inner = FZG | {"gears": gears | {"torque": 100.0}}
    expect(inner, ring(), torque=100.0, damping_ratio=0.06)


def test_every_key_reaches_the_gear():
    every = {
        "teeth": 40,
        "module": "4 mm",
        "width": "30 mm",
        "shift": 0.1,
        "pressure_angle": "22 deg",
        "helix_angle": "5 deg",
        "tip_diameter": "168.5 mm",
        "rack": "C",
        "addendum": 0.9,
        "dedendum": 1.3,
        "fillet_radius": 0.2,
        "thickness_allowance": "-40 um",
        "bore": "40 mm",
        "web": {"thickness": "10 mm", "rim_diameter": "130 mm", "hub_diameter": "60 mm"},
        "material": {"young": "200 GPa", "poisson": 0.29, "density": "7.8 g/cm^3"},
        "quality": 6,
        "tip_relief": {"amount": "20 um", "length": "3 mm", "shape": "parabolic"},
        "pitch_errors": ["5 um"] + [0.0] * 39,
    }
    assert every.keys() == sections.PinionSection.model_fields.keys()
    common = dict(
        module=4e-3,
        width=0.03,
        pressure_angle=math.radians(22.0),
        helix_angle=math.radians(5.0),
        rack=Rack(addendum=0.9, dedendum=1.3, tip_radius=0.2),
        material=Material(young=200e9, poisson=0.29, density=7800.0),
    )
    web = Web(thickness=0.01, rim_diameter=0.13, hub_diameter=0.06)
    # Relief of helical gears has no motion, but in a drawing all keys stand together.
    section = sections.DrawnPair(pinion=every, wheel={"teeth": 50}, torque=50.0)
    mesh = section.mesh()
    own = dict(shift=0.1, tip_diameter=0.1685, thickness_allowance=-4e-5, bore=0.04, web=web)
    own |= dict(quality=6, tip_relief=TipRelief(amount=2e-5, length=3e-3, shape="parabolic"))
    own["pitch_errors"] = (5e-6,) + (0.0,) * 39
    assert mesh.pinion == SpurGear(teeth=40, **own, **common)
    # What gears of one mesh share passes to the wheel, a bore or a web does not.
    assert mesh.wheel == SpurGear(teeth=50, **common)


def test_other_units_rerun_nothing():
    settings = load(FZG)
    other = copy.deepcopy(FZG)
    other["gears"]["pinion"] |= {
        "module": 4.5e-3,
        "width": "0.55118110236220472441 inch",
        "tip_diameter": "8.246 cm",
        "pressure_angle": 0.3490658503988659,
        "material": {"young": "206000 N/mm^2"},
    }
    other["gears"] |= {"centre_distance": 0.0915, "torque": "0.302 kN m", "stiffness": "iso"}
    again = load(other)
    # 302 N m at 2170 rpm; the last digits of the quotient are others.
    other["gears"] |= {"power": "68.62704432011785 kW", "speed": "2170 rpm"}
    del other["gears"]["torque"]
    assert repr(load(other).pair_parameters("k")) == repr(again.pair_parameters("k"))
    # Snakemake compares params as text.
    assert repr(again.pair_parameters("k")) == repr(settings.pair_parameters("k"))
    assert repr(again.model_dump()) == repr(settings.model_dump())


def test_dampings_by_ratio_decrement_and_coefficient():
    decrement = 2.0 * math.pi * 0.06 / math.sqrt(1.0 - 0.06**2)
    dampings = {
        "ratio": {"damping_ratio": 0.06, "backlash_damping_ratio": 0.02},
        "decrement": {"logarithmic_decrement": decrement, "backlash_damping": "30 N s/m"},
        "k": {"material_damping": 500.0, "backlash_damping": 0.0},
    }
    # Of a pair given by its numbers too.
    for base in (FZG, CONFIG):
        settings = base | {"dampings": base["dampings"] | dampings}
        ratio, by_decrement = pair_of(settings, "ratio"), pair_of(settings, "decrement")
        assert ratio.damping_ratio == pytest.approx(0.06, rel=1e-11)
        assert ratio.backlash_damping_ratio == pytest.approx(0.02, rel=1e-11)
        assert by_decrement.damping_ratio == pytest.approx(0.06, rel=1e-11)
        assert by_decrement.backlash_damping == 30.0
        assert pair_of(settings, "k").material_damping == 500.0
    own = {"damping_ratio": 0.02, "backlash_damping": 0.0}
    case = {"title": "a", "tuning": 0.7, "damping": own}
    sections = {"bifurcation": {"damping": own}, "basins": {"cases": [case]}}
    sections["poincare"] = {"cases": [case | {"phase": 0.0, "settle": 10}]}
    settings = load(FZG | sections)
    expected = load(changed("dampings/k/damping_ratio", 0.02)).pair_parameters("k")
    assert settings.pair_parameters(settings.bifurcation.damping) == expected
    for section in (settings.basins, settings.poincare):
        assert settings.case_parameters(section.cases[0]) == expected


def test_a_configuration_laid_over_another_one():
    mine = {"gears": {"torque": 100.0}}
    whole = overlay(FZG, mine)
    assert load(whole).gear_pair.load < load(FZG).gear_pair.load
    # What says the same in another way gives way.
    assert "gear_pair" not in overlay(CONFIG, FZG) and "gears" not in overlay(FZG, CONFIG)
    k = overlay(FZG, {"dampings": {"k": {"material_damping": 1.0}}})["dampings"]["k"]
    assert k == {"material_damping": 1.0, "backlash_damping": 0.0}
    found = cases(FZG | {"cases": {"a": {}, "b": {"gear_pair": CONFIG["gear_pair"]}}})
    assert load(found["b"]).gear_pair == load(CONFIG).gear_pair
    # Drawn gears do not get what config.yaml says of the paper's.
    merged = {**CONFIG, **FZG}
    assert overlay_gears(merged, FZG) == FZG
    in_cases = {"cases": {"a": FZG, "b": FZG}}
    assert overlay_gears(CONFIG | in_cases, in_cases) == in_cases
    lighter = {"gear_pair": {"load": 1.0}}
    assert overlay_gears(overlay(CONFIG, lighter), lighter) == overlay(CONFIG, lighter)
    assert overlay_gears(overlay(FZG, mine), mine) == whole


@pytest.mark.parametrize("helix", ["0 deg", "12 deg"])
def test_a_drawing_is_read_without_the_numerical_stack(helix):
    settings = changed("gears/pinion/helix_angle", helix)
    settings["gears"]["pinion"] |= {"tip_diameter": "83 mm"}
    del settings["gears"]["centre_distance"]
    code = f"import sys; from gearlib.config import load; load({settings!r}); "
    code += "print({'numpy', 'numba', 'xarray', 'pint'} & set(sys.modules))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "set()"
