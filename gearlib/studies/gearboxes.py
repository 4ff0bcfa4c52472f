"""Compute a gearbox from a REXS file: its stages over the speed, and the whole box.

Each function reads the file again, so that jobs of a workflow need nothing but its path.
"""

import math
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
import xarray as xr

from gearlib.analysis.characteristic_frequencies import (
    FREQUENCIES,
    characteristic_frequencies,
    frequency_rows,
)
from gearlib.analysis.order_maps import order_map
from gearlib.data.result import result
from gearlib.gearboxes.gearbox import Gearbox, read_gearbox
from gearlib.models.load_sharing_pair import default_load_sharing_pair
from gearlib.runs.run_up import run_up as run_up_of
from gearlib.studies.teeth_over_speed import over_speed

#: First and last speed of a stage over its operating speed, or the last over the resonance speed.
SPEED_RANGE = 0.1, 1.5
#: Samples per mesh period of the run-up.
_SAMPLES = 64
#: Mesh periods before the record at tuning 1 and a damping ratio of 1, their limit, and the record.
_SETTLING, _MOST_PERIODS, _RECORDED = 8.0, 140, 10


def jobs(file: str) -> tuple[list[tuple[str, str]], list[str], dict[str, str]]:
    """Return what can be computed of a gearbox, and why the rest cannot.

    They are (stage, load case) of each stage, where the equal meshes of planets count once, the
    load cases of the whole box, and reasons by the name of a stage or load case.
    """
    box = read_gearbox(file)
    stages, whole, reasons = [], [], dict(box.refused)
    for case in box.load_cases:
        if (missing := box.loads(case).missing) is not None:
            reasons[case] = str(missing)
            continue
        seen: list = []
        for name in box.stages:
            if name not in box.refused:
                key = box.stage(name, case), f"{box.load(name, case)['torque']:.9g}"
                if key not in seen:
                    seen.append(key)
                    stages.append((name, case))
        try:
            box.train(case, model="rectangle")
            whole.append(case)
        except ValueError as error:
            reasons[case] = str(error)
    return stages, whole, reasons


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
    data = data.merge(frequencies, compat="override")
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


def run_up(file: str, load_case: str, damping_ratio: float, revolutions: int) -> xr.Dataset:
    """Return the order map of the force of the first mesh in a run-up of the whole box.

    The speed goes from 10 to 100 % of the operating speed, or to the lowest natural frequency of
    the box if the file states none.
    """
    box = read_gearbox(file)
    train = box.train(load_case, damping_ratio=damping_ratio)
    natural = float(train.modes().natural_frequency.values[train.free_motions.shape[1]])
    top = _reference_speed(box, train, load_case) or natural * 60.0 / train.reference_pinion.teeth
    start = SPEED_RANGE[0] * top
    seconds = 60.0 * revolutions / (0.5 * (start + top))
    run = run_up_of(train, start, top, duration=seconds, samples_per_period=_SAMPLES)
    found = order_map(run, variable="dynamic_force", highest=3.0 * train.reference_pinion.teeth)
    # CF has rules for coordinates called time, which seconds since the start do not keep.
    found = found.isel(mesh=0).drop_vars("mesh").rename(time="block")
    return found.assign_attrs(load_case=load_case)


def outline(file: str) -> xr.Dataset:
    """Return the outline of a gearbox; see `Gearbox.outline`."""
    return read_gearbox(file).outline()


def stage_rows(stages: Sequence[xr.Dataset], file: str) -> Iterator[list]:
    """Yield the rows of the table of stages: each in each load case, then in all of them.

    `stages` are results of `stage_over_speed`. A row of all cases has the largest values, and the
    contact loss over the whole duration. The last column says what is missing, and why.
    """
    box = read_gearbox(file)
    yield [
        *("stage", "load_case", "load_duration_fraction", "torque_n_m", "speed_rpm"),
        *("dynamic_factor", "dynamic_factor_iso_6336", "largest_dynamic_factor", "at_speed_rpm"),
        *("peak_to_peak_error_um", "resonance_speed_rpm", "contact_loss_fraction", "jumps_rpm"),
        "note",
    ]
    cells: dict[str, list] = {}  # stage -> (duration, values, jumps) of its load cases
    for data in stages:
        case, name = data.attrs["load_case"], data.attrs["stage"]
        fraction, speed = box.load_cases[case], float(data.operating_speed)
        point = data.sel(tuning=_nearest(data, speed)) if np.isfinite(speed) else None
        values, jumps = _stage_values(point, data)
        texts = *map(_text, (fraction, data.torque, *values)), _jumps_text(jumps)
        cells.setdefault(name, []).append((fraction, values, jumps))
        yield [name, case, *texts, ""]
    for name, found in cells.items():
        if len(found) > 1:
            fractions, rows, all_jumps = zip(*found, strict=True)
            largest = np.fmax.reduce(np.array(rows))
            largest[4] = max(x[3:5] for x in rows)[1]  # the speed of the largest factor
            losses = np.nan_to_num([x[-1] for x in rows])
            largest[-1] = np.dot(fractions, losses) / np.sum(fractions)
            texts = *map(_text, largest[1:]), _jumps_text(np.concatenate(all_jumps))
            yield [name, "all", _text(np.sum(fractions)), "", "", *texts, ""]
    for name, reason in jobs(file)[2].items():
        is_case = name in box.load_cases
        yield ["" if is_case else name, name if is_case else "", *[""] * 11, reason]


def _nearest(data: xr.Dataset, speed: float) -> float:
    return float(data.tuning[int(np.abs(data.speed.values - speed).argmin())])


def _stage_values(point: xr.Dataset | None, data: xr.Dataset) -> tuple[list[float], np.ndarray]:
    """Return the numbers of a row from operating point and curves, NaN where unknown, and jumps."""
    factors = data.dynamic_factor.max("direction")
    at = int(factors.fillna(-np.inf).argmax("tuning"))
    known = xr.Dataset() if point is None else point
    values = [
        *(known.get("speed"), known.get("dynamic_factor"), known.get("iso_dynamic_factor")),
        *(factors[at], data.speed[at]),
        None if point is None else 1e6 * point.error_peak_to_peak,
        *(data.resonance_speed, known.get("contact_loss_fraction")),
    ]
    jumps = np.concatenate([data.jump_up_speed.values, data.jump_down_speed.values])
    return [math.nan if x is None else float(x.max()) for x in values], jumps


def _jumps_text(jumps: np.ndarray) -> str:
    return " ".join(map(_text, np.sort(jumps[np.isfinite(jumps)])))


def _text(value: Any) -> str:
    """Return a number with six digits, "" for one that is not known."""
    return f"{float(value):.6g}" if np.isfinite(value) else ""


def box_rows(boxes: Sequence[xr.Dataset]) -> Iterator[list]:
    """Yield the rows of the table of whole boxes: modes, load shares, characteristic frequencies.

    `boxes` are results of `whole_box`.
    """
    yield ["load_case", "of", "quantity", "value", "unit"]
    for box in boxes:
        case = box.attrs["load_case"]
        for i, frequency in enumerate(box.mode_frequency.values):
            yield [case, f"mode {i}", "natural frequency", _text(frequency), "Hz"]
            for name, dim in (("mode_strain_energy", "mesh"), ("mode_shaft_energy", "shaft")):
                share = box[name].isel(natural_mode=i)
                if share.size and float(share.max()) > 0.0:
                    owner = str(box[dim].values[int(share.values.argmax())])
                    largest = f"largest share of the energy in a {dim}, {owner}"
                    yield [case, f"mode {i}", largest, _text(share.max()), ""]
        for name in box.mesh.values:
            mesh = box.sel(mesh=name)
            yield [case, name, "static mesh force", _text(mesh.mesh_force), "N"]
            yield [case, name, "static load sharing", _text(mesh.load_sharing), ""]
        frequencies = box[[x for x in FREQUENCIES if x in box]].assign(speed=box.speed)
        for owner, kind, hertz, order in list(frequency_rows(frequencies))[1:]:
            yield [case, owner, f"{kind}, order {order}", hertz, "Hz"]


def _reference_speed(box: Gearbox, train: Any, load_case: str) -> float | None:
    """Return the operating speed of the reference pinion in the housing, rpm, or None."""
    speeds = box.loads(load_case).speeds
    if speeds is None:
        return None
    return abs(speeds[box.shaft_of[box.stages[train.reference].pinion.id].id])
