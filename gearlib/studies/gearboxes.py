"""Compute a gearbox from a REXS file: its stages over the speed, and the whole box.

Each function reads the file again, so that jobs of a workflow need nothing but its path.
"""

import math
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
import xarray as xr

from gearlib.analysis.characteristic_frequencies import characteristic_frequencies
from gearlib.analysis.order_maps import order_map
from gearlib.data.result import result
from gearlib.gearboxes.gearbox import Gearbox, read_gearbox
from gearlib.models.load_sharing_pair import default_load_sharing_pair
from gearlib.runs.run_up import run_up as run_up_of
from gearlib.studies.teeth_over_speed import over_speed

#: First and last speed of a stage over its operating speed, or the last over the resonance speed.
SPEED_RANGE = 0.1, 1.5
#: Mesh periods before the record at tuning 1 and a damping ratio of 1, their limit, and the record.
_SETTLING, _MOST_PERIODS, _RECORDED = 8.0, 140, 10


def cases(file: str) -> list[tuple[str, str]]:
    """Return (stage, load case) of all stages that can be computed; equal ones count once.

    The equal meshes of the planets of a set are one.
    """
    box = read_gearbox(file)
    found = []
    for case in box.load_cases:
        seen: list = []
        for name in box.stages:
            if name not in box.refused and box.loads(case).missing is None:
                key = box.stage(name, case), f"{box.load(name, case)['torque']:.9g}"
                if key not in seen:
                    seen.append(key)
                    found.append((name, case))
    return found


def stage_over_speed(
    file: str, stage: str, load_case: str, damping_ratio: float, points: int
) -> xr.Dataset:
    """Return dynamic factor and transmission error of a stage over the speed, up and down.

    The speeds go from 10 to 150 % of the operating speed, which is one of them, or to 1.5 times the
    resonance speed if the file states none. The dataset is that of
    `gearlib.studies.teeth_over_speed.over_speed`.
    """
    box = read_gearbox(file)
    load = box.load(stage, load_case)
    torque, speed = load["torque"], load.get("speed")
    pair = default_load_sharing_pair(
        box.stage(stage, load_case), torque=torque, damping_ratio=damping_ratio
    )
    resonance_speed = float(pair.speed(1.0))
    top = speed or resonance_speed
    speeds = np.linspace(SPEED_RANGE[0] * top, SPEED_RANGE[1] * top, points)
    if speed:
        speeds = np.unique(np.append(speeds, speed))
    # Inertia is small below the slowest speed, whose motion stands for slower ones.
    simulated = np.unique(np.maximum(speeds, float(pair.speed(pair.slowest_tuning))))
    # At low tunings motions settle within few mesh periods, of many natural periods each.
    settling = math.ceil(_SETTLING / damping_ratio * speeds[-1] / resonance_speed)
    periods = min(settling, _MOST_PERIODS) + _RECORDED
    data = over_speed(pair, simulated, speed, periods=periods, record_periods=_RECORDED)
    data = data.isel(tuning=np.searchsorted(simulated, speeds).clip(0, simulated.size - 1))
    data = data.assign_coords(tuning=("tuning", speeds / resonance_speed, data.tuning.attrs))
    data["speed"] = "tuning", speeds, data.speed.attrs
    data["resonance_speed"] = (), resonance_speed, {"units": "min-1", "long_name": "n_E1"}
    return data.assign_attrs(stage=stage, load_case=load_case)


def whole_box(file: str, load_case: str, damping_ratio: float, orders: int) -> xr.Dataset:
    """Return modes, Campbell diagram, load shares and characteristic frequencies of the whole box.

    They are those of the train of the box in a load case; `orders` is the highest multiple of each
    mesh frequency.
    """
    box = read_gearbox(file)
    train = box.train(load_case, damping_ratio=damping_ratio)
    speed = _reference_speed(box, train, load_case)
    modes = train.modes().rename(mode="natural_mode")
    static = train.static()
    data = train.campbell(orders).drop_vars("modal_force").merge(train.layout())
    frequencies = characteristic_frequencies(train, speed or float(train.speed(1.0)))
    data = data.merge(frequencies.drop_vars("gear"), compat="override")
    data = data.assign(
        mode_frequency=modes.natural_frequency.drop_attrs(),
        mode_strain_energy=modes.strain_energy,
        mode_shaft_energy=modes.shaft_energy,
        mesh_force=static.mesh_force,
        load_sharing=static.load_sharing,
        operating_speed=math.nan if speed is None else speed,
        mesh_rate=("mesh", [float(ratio) for ratio in train.frequency_ratios]),
    )
    found = result("A gearbox", train, data, method="exact", load_case=load_case)
    return found.assign_attrs(load_case=load_case)


def _reference_speed(box: Gearbox, train: Any, load_case: str) -> float | None:
    """Return the operating speed of the reference pinion in the housing, rpm, or None."""
    speeds = box.loads(load_case).speeds
    if speeds is None:
        return None
    return abs(speeds[box.shaft_of[box.stages[train.reference].pinion.id].id])
