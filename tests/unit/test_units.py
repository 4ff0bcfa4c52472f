"""Numbers with and without units, as drawings and engineers have them."""

import pytest

from gearlib.config import ConfigError, load, units
from gearlib.geometry import Mesh, SpurGear


@pytest.mark.parametrize("text", ["85 Nm", "85Nm", "85 N·m", "85 N⋅m", "85 N*m", "85 N m"])
def test_a_torque_as_engineers_write_it(text):
    assert units.read(text, "N m") == 85.0


@pytest.mark.parametrize("text", ["2500um", "2500 µm", "2500 μm", "2.5mm", "0.25 cm"])
def test_a_length_as_engineers_write_it(text):
    assert units.read(text, "m") == 0.0025


@pytest.mark.parametrize(
    ("changes", "likely"),
    [
        ({"module": 2.5}, "2.5 mm"),
        ({"width": 18}, "18 mm"),
        ({"bore": 30}, "30 mm"),
        ({"pressure_angle": 20}, "20 deg"),
    ],
)
def test_a_bare_number_too_large_is_asked_about(changes, likely):
    gear = {"teeth": 23, "module": 2.5e-3, "width": 0.018}
    with pytest.raises(ValueError, match=f"did you mean {likely}"):
        SpurGear(**gear | changes)
    with pytest.raises(ConfigError, match=f"did you mean {likely}"):
        load({"gears": {"pinion": gear | changes, "wheel": {"teeth": 61}, "torque": 85.0}})


@pytest.mark.parametrize(("backlash", "likely"), [(80, "80 um"), (0.08, "0.08 mm")])
def test_a_backlash_above_the_pitch_is_asked_about(backlash, likely):
    gear = SpurGear(teeth=23, module=2.5e-3, width=0.018)
    with pytest.raises(ValueError, match=f"base pitch.*did you mean {likely}"):
        Mesh(gear, gear, backlash=backlash)
