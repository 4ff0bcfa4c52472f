"""Check that all functions and commands give the same dynamic factor for the same gears."""

import json

import pytest
import xarray as xr
import yaml
from click.testing import CliRunner

from gearlib import config, duty_point
from gearlib.cli import main
from gearlib.models.from_values import build_model
from gearlib.studies import paper

DAMPINGS = {"usual": {"damping_ratio": 0.05, "backlash_damping_ratio": 0.0}}
RELIEF = {"tip_relief": {"amount": 25e-6, "length": 4e-3}}
SPUR = {
    "pinion": {"teeth": 24, "module": 5e-3, "width": 45e-3, **RELIEF},
    "wheel": {"teeth": 71, **RELIEF},
    **{"torque": 900.0, "speed": 1800.0},
}
HELICAL = {
    "pinion": {"teeth": 33, "module": 2.5e-3, "width": 52e-3, "helix_angle": "21 deg"},
    "wheel": {"teeth": 70},
    **{"torque": 310.0, "speed": 4200.0},
}
RING = {
    "pinion": {"teeth": 26, "module": 3e-3, "width": 30e-3},
    "wheel": {"teeth": 89, "internal": True, "outer_diameter": 0.31},
    **{"torque": 220.0, "speed": 2100.0},
}


def run_command(*arguments):
    """Run a command of gearlib on gears.yaml and return its printed output."""
    command, *options = map(str, arguments)
    result = CliRunner().invoke(main, [command, "--config", "gears.yaml", *options])
    assert result.exit_code == 0, result.output
    return result.output


def dynamic_factors(settings, gears):
    """Yield the dynamic factor at the speed of the gears, computed in six different ways.

    `settings` is the checked configuration with the section `gears`.
    """
    speed, damping_ratio = gears["speed"], DAMPINGS["usual"]["damping_ratio"]
    gear_stage = settings.gears.gear_stage()
    load = {"torque": gears["torque"], "damping_ratio": damping_ratio}
    yield duty_point(gear_stage, speed, **load).dynamic_factor.item()
    rows = json.loads(run_command("gears", "--format", "json"))
    values_by_name = {row["name"]: row["values"] for row in rows}
    yield from values_by_name["dynamic_factor"].values()
    run_command("simulate", "-o", "run.nc")
    yield xr.load_dataset("run.nc").dynamic_factor.item()
    speeds = ("--start", f"{speed} rpm", "--stop", f"{1.01 * speed} rpm", "--points", 2)
    run_command("sweep", *speeds, "--direction", "cold", "-o", "sweep.nc")
    yield float(xr.load_dataset("sweep.nc").dynamic_factor[0])
    run = {"periods": settings.periods, "record_periods": 10, "initial_state": "static"}
    models = (
        build_model(settings.model_description("usual", pitch_errors=True)),
        build_model(settings.pair_description("usual")),
    )
    motion = paper.simulate_phase_portrait(*models, settings.phase_planes.tunings[0], run, "usual")
    yield motion.dynamic_factor.item()
    from gearlib.explorer import view

    yield view.compute_view(configuration(gears), "usual").run.dynamic_factor.item()


def configuration(gears):
    """Return a configuration, as a dict, with given gears and a phase plane at their speed."""
    phase_planes = {"tunings": [f"{gears['speed']} rpm"]}
    return {"gears": gears, "dampings": DAMPINGS, "phase_planes": phase_planes}


@pytest.mark.parametrize("gears", [SPUR, HELICAL, RING])
def test_library_commands_and_explorer_give_the_same_dynamic_factor(gears, tmp_path, monkeypatch):
    """Six ways to compute the dynamic factor must agree, and it must tend to 1 at low speed."""
    monkeypatch.chdir(tmp_path)
    mapping = configuration(gears)
    (tmp_path / "gears.yaml").write_text(yaml.safe_dump(mapping), encoding="utf-8")
    duty_point_factor, *other_factors = dynamic_factors(config.load(mapping), gears)
    assert duty_point_factor > 1.005 and len(other_factors) == 5
    assert other_factors == pytest.approx([duty_point_factor] * 5, rel=1e-9)
    gear_stage = config.load(mapping).gears.gear_stage()
    slow_point = duty_point(gear_stage, 1.0, torque=gears["torque"], damping_ratio=0.05)
    assert slow_point.dynamic_factor == pytest.approx(1.0, abs=0.01)
