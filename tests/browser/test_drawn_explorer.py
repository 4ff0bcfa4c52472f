"""The explorer's page of drawn gears: numbers, curves, refusals and what is saved."""

import math
from dataclasses import replace

import numpy as np
import pytest
import xarray as xr
import yaml
from bokeh.models import Span

import gearlib
from gearlib import config
from gearlib.geometry import Mesh, SpurGear, TipRelief, optimum_relief
from gearlib.pages.explorer.drawn_figures import rows
from gearlib.pages.explorer.drawn_pair import START, Drawing
from gearlib.pages.explorer.serving import DRAWN, page_of
from tests.browser.glyphs import plots_of, points_of
from tests.geometry.drawings import fzg_c, twenty


@pytest.fixture
def drawing(mapping):
    return Drawing(mapping, "k1")


@pytest.fixture(scope="module")
def shown(mapping):
    return page_of(mapping, "k1", DRAWN)


def set_sliders(shown, **values):
    """Set sliders, in their units, and choices; the rest as at the start."""
    start = vars(shown.explored.start)
    for name, unit in (("module", 1e3), ("relief", 1e6), ("backlash", 1e6)):
        start = start | {name: start[name] * unit}
    for name, widget in {**shown.sliders, **shown.choices}.items():
        widget.value = values.get(name, start[name])


def test_the_damping_reaches_to_twice_that_of_the_gears(mapping, shown):
    strong = {"k1": {"material_damping": "40000 N s/m", "backlash_damping": "0 N s/m"}}
    other = page_of(mapping | {"dampings": mapping["dampings"] | strong}, "k1", DRAWN)
    for one in (shown, other):
        slider, own = one.sliders["damping"], one.explored.start.damping
        # In whole steps.
        assert slider.start == 0.0
        assert slider.end == pytest.approx(max(0.3, 2.0 * own), abs=slider.step)
    assert other.explored.start.damping > 0.3


def test_sliders_stand_for_the_drawn_gears_of_the_library(drawing, shown):
    drawn = twenty()
    assert drawing.mesh(drawing.start) == replace(drawn, backlash=100e-6)
    set_sliders(
        shown, module=8.0, pinion_shift=0.3, wheel_shift=-0.1, relief=12.0, backlash=80.0,
        torque=210.0, damping=0.04, length="long",
    )  # fmt: skip
    setting = shown.setting()
    common = {"teeth": 20, "module": 8e-3, "width": 0.03, "material": drawn.pinion.material}
    bare = [
        SpurGear(shift=shift, tip_diameter=tip, **common)
        for shift, tip in ((0.3, 0.1808), (-0.1, 0.1744))
    ]
    plain = Mesh(*bare)
    relief = TipRelief(amount=12e-6, length=(plain.contact_ratio - 1.0) * plain.base_pitch)
    expected = Mesh(*(replace(gear, tip_relief=relief) for gear in bare), backlash=80e-6)
    assert drawing.mesh(setting) == expected
    beta_m = drawing.backlash_damping
    common = {"torque": 210.0, "damping_ratio": 0.04, "backlash_damping_ratio": beta_m}
    assert drawing.pair(setting) == gearlib.GearPair.from_geometry(expected, **common)
    assert drawing.teeth(setting) == gearlib.LoadSharingPair.from_geometry(expected, **common)
    iso = Drawing({"gears": START | {"stiffness": "iso"}, "dampings": FZG["dampings"]}, "k")
    assert (iso.teeth(iso.start).stiffness, drawing.teeth(setting).stiffness) == ("iso", "energy")


#: FZG type C, whose tips are shortened, as a configuration has it, and one tooth out of place.
FZG = {
    "gears": {
        "pinion": {"teeth": 16, "module": "4.5 mm", "width": "14 mm", "shift": 0.1817,
                   "tip_diameter": "82.46 mm", "bore": "30 mm",
                   "pitch_errors": ["5 um"] + [0.0] * 15},
        "wheel": {"teeth": 24, "shift": 0.1715, "tip_diameter": "118.36 mm", "bore": "30 mm"},
        "centre_distance": "91.5 mm",
        "backlash": "160 um",
        "power": "30 kW",
        "speed": "948 rpm",
        "stiffness": "energy",
        "stiffness_options": {"coupling": 0.5},
    },
    "dampings": {"k": {"damping_ratio": 0.06, "backlash_damping_ratio": 0.01}},
}  # fmt: skip


def test_gears_of_the_configuration_are_where_the_sliders_start():
    fzg, drawing = fzg_c(), Drawing(FZG, "k")
    mesh = drawing.mesh(drawing.start)
    for name in ("pinion", "wheel"):
        assert getattr(mesh, name).tip_diameter == getattr(fzg, name).tip_diameter
    # That without backlash, to the last digit of the drawing and of its shifts.
    assert mesh.centre_distance == pytest.approx(fzg.centre_distance, abs=5e-6)
    assert (drawing.start.backlash, drawing.start.damping) == pytest.approx((160e-6, 0.06))
    torque = 30e3 / (948.0 * math.tau / 60.0)
    # The slider has six digits.
    assert drawing.start.torque == pytest.approx(torque, rel=5e-6)
    # Tips stay as high above the shifted profile, in modules.
    larger = drawing.mesh(replace(drawing.start, module=5e-3, pinion_shift=0.3)).pinion
    above = [(g.tip_diameter / g.module / 2.0 - g.shift) for g in (larger, fzg.pinion)]
    assert above[0] == pytest.approx(above[1], rel=1e-11)


def test_a_view_shows_what_the_library_computes(drawing):
    """The characteristic is that of the rectangle, the motion that of pairs of teeth."""
    setting = replace(drawing.start, relief=10e-6, torque=400.0, speed=6000.0)
    seen = drawing.look(setting)
    mesh = drawing.mesh(setting)
    xr.testing.assert_identical(seen.error, mesh.transmission_error([*drawing.loads, 400.0]))
    pair, teeth = drawing.pair(setting), drawing.teeth(setting)
    run = gearlib.simulate(
        teeth, speed=6000.0, periods=300, record_periods=2, samples_per_period=256
    )
    np.testing.assert_array_equal(seen.run.displacement[-512:], run.displacement)
    assert pair.speed(seen.up["tuning"].values[[0, -1]]) == pytest.approx(drawing.speeds)
    up = gearlib.sweep(
        pair, seen.up["tuning"].values[:9], periods=70, record_periods=10, direction="up"
    )
    np.testing.assert_array_equal(seen.up["displacement_max"][:9], up.displacement_max)


@pytest.mark.parametrize("drawn", [None, FZG], ids=["start", "configuration"])
def test_what_is_saved_draws_what_is_seen(mapping, drawn):
    whole, damping = (mapping, "k1") if drawn is None else (drawn, "k")
    drawing = Drawing(whole, damping)
    start = drawing.start
    changes = {"module": 0.9 * start.module, "wheel_shift": 0.25, "torque": 170.0, "speed": 9000.0}
    for relief in (0.0, 7e-6):
        setting = replace(start, **changes, relief=relief)
        saved = config.load(yaml.safe_load(drawing.configuration(setting)))
        # What is derived and saved is rounded to twelve digits.
        mesh = drawing.mesh(setting)
        again = saved.gears.mesh()
        assert again.centre_distance == pytest.approx(mesh.centre_distance, rel=1e-11)
        assert again.backlash == mesh.backlash
        for name in ("pinion", "wheel"):
            own, other = getattr(again, name), getattr(mesh, name)
            assert replace(own, tip_relief=None) == replace(other, tip_relief=None)
            if relief:
                assert own.tip_relief.amount == relief
                assert own.tip_relief.length == pytest.approx(other.tip_relief.length, rel=1e-11)
        pair = gearlib.GearPair(**saved.pair_parameters(damping))
        assert pair.as_dict() == pytest.approx(drawing.pair(setting).as_dict(), rel=1e-11)
        assert pair.speed(saved.phase_planes.tunings[0]) == pytest.approx(9000.0)
        # The bodies and dampings of other gears would not fit these.
        assert list(saved.dampings) == [damping]
        assert saved.six_degrees.masses[0] == pytest.approx(again.pinion.mass, rel=1e-11)


def _numbers(shown):
    """Return the numbers of the table that the page shows, by their names."""
    lines = [line.split("|")[1:3] for line in shown.figures.table.object.splitlines()[2:]]
    return {name.strip(): float(text.split()[0].rstrip("°")) for name, text in lines}


def _involute(angle):
    return math.tan(angle) - angle


def test_sliders_move_the_derived_numbers(shown):
    """By closed forms of ISO 21771 and by how each number scales."""
    set_sliders(shown)
    start = _numbers(shown)
    set_sliders(shown, pinion_shift=0.4, wheel_shift=0.2)
    shifted = _numbers(shown)
    angle = math.radians(shifted["working pressure angle"])
    nominal = math.radians(20.0)
    # The table has a hundredth of a degree, and inv' = tan^2 is 0.19 here.
    expected = _involute(nominal) + 2.0 * math.tan(nominal) * 0.6 / 40.0
    assert _involute(angle) == pytest.approx(expected, abs=0.19 * math.radians(0.005))
    base = 100.0 * math.cos(nominal)
    path = sum(math.sqrt((110.0 + 10.0 * x) ** 2 - base**2) for x in (0.4, 0.2))
    distance = 2.0 * base / math.cos(angle)
    path -= math.sqrt(distance**2 - (2.0 * base) ** 2)
    # A hundredth of a degree moves it by 0.002.
    ratio = path / (10.0 * math.pi * math.cos(nominal))
    assert shifted["contact ratio"] == pytest.approx(ratio, abs=2e-3)
    assert shifted["contact ratio"] < start["contact ratio"] - 0.1
    # Gears of half the module have a quarter of the mass, and nearly the same stiffness.
    set_sliders(shown, module=5.0)
    small = _numbers(shown)
    assert small["centre distance"] == pytest.approx(100.0)
    assert small["contact ratio"] == start["contact ratio"]
    assert small["resonance speed"] / start["resonance speed"] == pytest.approx(2.0, rel=0.02)
    # Constant Hertz contact: deflections are in proportion to the load, errors without relief too.
    set_sliders(shown, torque=600.0)
    heavy = _numbers(shown)
    for name in ("static deflection", "peak-to-peak error"):
        assert heavy[name] == pytest.approx(2.0 * start[name], abs=0.015)
    assert heavy["mean eigenfrequency"] == start["mean eigenfrequency"]
    # What counts is how the reliefs of both flanks differ: of linear ones over all and over half
    # of double contact it is the same; not so the error.
    relieved = {}
    for length in ("short", "long"):
        set_sliders(shown, relief=8.0, length=length)
        relieved[length] = _numbers(shown)
        assert relieved[length]["effective contact ratio"] < 1.3 < start["effective contact ratio"]
    assert relieved["long"]["peak-to-peak error"] > relieved["short"]["peak-to-peak error"]
    set_sliders(shown, backlash=250.0)
    assert _numbers(shown)["backlash"] == 250.0


def test_the_table_says_what_the_library_says(drawing):
    seen = drawing.look(replace(drawing.start, pinion_shift=0.3, relief=10e-6))
    mesh, pair = seen.mesh, seen.pair
    error = mesh.transmission_error(drawing.start.torque)
    assert dict(rows(seen)) == {
        "contact ratio": f"{mesh.contact_ratio:.4f}",
        "working pressure angle": f"{math.degrees(mesh.working_pressure_angle):.2f}°",
        "centre distance": f"{mesh.centre_distance * 1e3:.3f} mm",
        "backlash": "100 µm",
        "least backlash, ISO/TR 10064-2": f"{mesh.recommended_backlash * 1e6:.0f} µm",
        "C_max": f"{pair.max_stiffness * 1e-6:.1f} N/µm",
        "κ": f"{pair.stiffness_ratio:.4f}",
        "ε": f"{pair.contact_ratio:.4f}",
        "static deflection": f"{pair.static_deflection * 1e6:.2f} µm",
        "mean eigenfrequency": f"{pair.mean_eigenfrequency / math.tau:.0f} Hz",
        "resonance speed": f"{pair.mean_eigenfrequency / math.tau * 60.0 / 20:.0f} rpm",
        "peak-to-peak error": f"{error.peak_to_peak_error.item() * 1e6:.2f} µm",
        "effective contact ratio": f"{error.effective_contact_ratio.item():.4f}",
    }


def test_each_curve_holds_what_it_is_called(shown):
    set_sliders(shown, relief=8.0, torque=420.0, speed=8800.0)
    drawing, plots = shown.explored, plots_of(shown)
    seen = drawing.look(shown.setting())
    (legend,) = plots["Harris map"].legend
    curves = {item.label.value: item.renderers[0] for item in legend.items}
    widths = {name: curve.glyph.line_width for name, curve in curves.items()}
    assert [name for name, width in widths.items() if width > 1] == ["chosen torque"]
    for name, curve in curves.items():
        torque = 420.0 if name == "chosen torque" else float(name.removesuffix(" N m"))
        error = seen.mesh.transmission_error(torque).transmission_error.values[0] * 1e6
        phase = np.arange(257) / 256
        np.testing.assert_allclose(points_of(curve), [phase, [*error, error[0]]], rtol=1e-12)
    (share,) = plots["Load share of a pair of teeth"].renderers
    x, y = points_of(share)
    start, end = np.array(seen.mesh.path) * 1e3
    assert np.all(np.diff(x) > 0.0)
    assert start <= x[0] < x[-1] <= end
    # In single contact a pair has it all; one base pitch apart two pairs share it.
    pitch = seen.mesh.base_pitch * 1e3
    np.testing.assert_array_equal(y[(x > end - pitch + 0.1) & (x < start + pitch - 0.1)], 1.0)
    double = x < end - pitch
    np.testing.assert_allclose(y[double] + np.interp(x[double] + pitch, x, y), 1.0, atol=1e-9)
    (marker,) = plots["Load share of a pair of teeth"].select(Span)
    assert marker.location == pytest.approx(1e3 * seen.mesh.pitch_point)
    characteristic = plots["Resonance characteristic"]
    curve = characteristic.renderers[0]
    np.testing.assert_allclose(points_of(curve)[0], np.linspace(*drawing.speeds, 500), rtol=1e-12)
    np.testing.assert_array_equal(points_of(curve)[1], seen.up["displacement_max"])
    (marker,) = characteristic.select(Span)
    assert marker.location == pytest.approx(8800.0)


def test_relief_moves_what_pairs_of_teeth_do(shown):
    """Relief for the load takes away the motion of the teeth; the rectangle does not know it."""
    best = optimum_relief(shown.explored.drawn, 300.0, length="long").pinion.tip_relief
    ranges = {}
    for amount in (0.0, 1e6 * best.amount):
        set_sliders(shown, relief=amount, length="long")
        for name in ("up", "course"):
            ranges[name, amount > 0.0] = np.ptp(shown.figures.motion.sources[name].data["y"])
    assert ranges["up", True] == ranges["up", False] > 1.0
    assert ranges["course", True] < 0.3 * ranges["course", False]


REFUSED = {
    "undercut": ({"pinion_shift": -0.5}, "pinion: shift = -0.5 is not allowed: .*undercuts"),
    "pointed": ({"wheel_shift": 1.4}, "wheel: tip_diameter = 0.248 is not allowed: .*pointed"),
    "interference": ({"pinion_shift": 1.2}, "tip_diameter of the wheel .*interference"),
    "clearance": ({"pinion_shift": 0.6, "wheel_shift": 1.0}, "keep clear of each other"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_a_wrong_combination_is_said_in_place_of_the_figures(shown, name):
    change, sentence = REFUSED[name]
    set_sliders(shown, **change)
    _refused(shown, sentence)
    set_sliders(shown)
    assert shown.shown.visible
    assert not shown.button.disabled
    assert "The motion from rest" in shown.note.object


def _refused(shown, sentence):
    assert not shown.shown.visible
    assert shown.button.disabled
    with pytest.raises(ValueError, match=sentence) as refusal:
        shown.explored.look(shown.setting())
    assert shown.note.object == str(refusal.value)
    assert "\n" not in shown.note.object


def test_too_small_a_contact_ratio_is_said_too():
    short = {**START, "pinion": {**START["pinion"], "tip_diameter": 0.2125}}
    short["wheel"] = {"teeth": 20, "tip_diameter": 0.2125}
    other = page_of({"gears": short, "dampings": FZG["dampings"]}, "k", DRAWN)
    other.sliders["wheel_shift"].value = 0.4
    _refused(other, r"contact_ratio = 0\.\d+ is not allowed: it must be >= 1")
