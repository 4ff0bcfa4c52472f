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
from gearlib.data.result import make_result
from gearlib.gearboxes.gearbox import Gearbox, read_gearbox
from gearlib.models.load_sharing_pair import default_load_sharing_pair
from gearlib.runs.run_up import run_up as run_up_of
from gearlib.studies.teeth_over_speed import sweep_speeds

#: Lowest and highest speed, relative to the operating speed or, if none is stated, to the resonance
#: speed.
SPEED_RANGE = 0.1, 1.5
#: Samples per mesh period of the run-up.
_SAMPLES = 64
#: Mesh periods in which a motion settles at tuning 1 with a damping ratio of 1; largest number of
#: mesh periods before the record; mesh periods of the record.
_SETTLING_PERIODS, _MAX_SETTLING_PERIODS, _RECORD_PERIODS = 8.0, 140, 10


def list_computations(file: str) -> tuple[list[tuple[str, str]], list[str], dict[str, str]]:
    """List the computations that are possible with a gearbox, and why others are not.

    `file` is the path of a REXS file. Return three items: the pairs (stage, load case) to compute,
    in which equal meshes, such as those of several planets, count once; the load cases in which the
    whole gearbox can be computed; and a dict of the name of a stage or load case and the reason why
    it cannot be computed.
    """
    box = read_gearbox(file)
    stages = []
    box_cases = []
    reasons = dict(box.refused)
    for case in box.load_cases:
        missing = box.loads(case).missing
        if missing is not None:
            reasons[case] = str(missing)
            continue
        listed: list = []  # stages and torques of this load case
        for name in box.stages:
            if name in box.refused:
                continue
            stage_and_torque = box.stage(name, case), f"{box.load(name, case)['torque']:.9g}"
            if stage_and_torque not in listed:
                listed.append(stage_and_torque)
                stages.append((name, case))
        try:
            box.train(case, model="rectangle")
            box_cases.append(case)
        except ValueError as error:
            reasons[case] = str(error)
    return stages, box_cases, reasons


def sweep_stage(
    file: str, stage: str, load_case: str, damping_ratio: float, points: int
) -> xr.Dataset:
    """Compute dynamic factor and transmission error of a stage in sweeps of the speed, up and down.

    `file` is the path of a REXS file, in which `stage` and `load_case` are names. There are about
    `points` speeds from 10 to 150 % of the operating speed, which is one of them, or of the
    resonance speed if the file states no operating speed. Speeds below the slowest that can be
    simulated get the motion of this slowest speed. The variables of the dataset are described in
    `gearlib.studies.teeth_over_speed.sweep_speeds`.
    """
    box = read_gearbox(file)
    load = box.load(stage, load_case)
    torque, speed = load["torque"], load.get("speed")
    pair = default_load_sharing_pair(
        box.stage(stage, load_case), torque=torque, damping_ratio=damping_ratio
    )
    resonance_speed = float(pair.speed(1.0))
    reference_speed = speed or resonance_speed
    lowest_ratio, highest_ratio = SPEED_RANGE
    speeds = np.linspace(lowest_ratio * reference_speed, highest_ratio * reference_speed, points)
    if speed:
        speeds = np.unique(np.append(speeds, speed))
    # Inertia forces are small below the slowest speed, so its motion represents slower speeds.
    simulated = np.unique(np.maximum(speeds, float(pair.speed(pair.slowest_tuning))))
    # Motions settle within some natural periods, of which a mesh period has more at lower speeds.
    # Therefore the highest speed decides how many mesh periods are needed.
    settling = math.ceil(_SETTLING_PERIODS / damping_ratio * speeds[-1] / resonance_speed)
    periods = min(settling, _MAX_SETTLING_PERIODS) + _RECORD_PERIODS
    data = sweep_speeds(pair, simulated, speed, periods=periods, record_periods=_RECORD_PERIODS)
    data = data.isel(tuning=np.searchsorted(simulated, speeds).clip(0, simulated.size - 1))
    data = data.assign_coords(tuning=("tuning", speeds / resonance_speed, data.tuning.attrs))
    data["speed"] = "tuning", speeds, data.speed.attrs
    data["resonance_speed"] = (), resonance_speed, {"units": "min-1", "long_name": "n_E1"}
    return data.assign_attrs(stage=stage, load_case=load_case)


def analyse_gearbox(file: str, load_case: str, damping_ratio: float, orders: int) -> xr.Dataset:
    """Compute modes, Campbell diagram, load shares and characteristic frequencies of a gearbox.

    `file` is the path of a REXS file; its gearbox is computed as one gear train in the named load
    case. `damping_ratio` is the damping ratio of the meshes, `orders` the highest multiple of each
    mesh frequency in the Campbell diagram.
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
    dataset = make_result("A gearbox", train, data, method="exact", load_case=load_case)
    return dataset.assign_attrs(load_case=load_case)


def compute_run_up_orders(
    file: str, load_case: str, damping_ratio: float, revolutions: int
) -> xr.Dataset:
    """Compute an order map: amplitudes of the first mesh force over orders and speed in a run-up.

    `file` is the path of a REXS file; its gearbox is computed as one gear train. The speed rises
    from 10 to 100 % of the operating speed within this number of `revolutions`. If the file states
    no operating speed, the run-up ends where the mesh frequency equals the lowest natural
    frequency.
    """
    box = read_gearbox(file)
    train = box.train(load_case, damping_ratio=damping_ratio)
    teeth = train.reference_pinion.teeth
    # The first natural frequencies, those of the rigid-body ("free") motions, are zero.
    lowest_frequency = float(train.modes().natural_frequency.values[train.free_motions.shape[1]])
    stop_speed = _reference_speed(box, train, load_case) or lowest_frequency * 60.0 / teeth
    start_speed = SPEED_RANGE[0] * stop_speed
    seconds = 60.0 * revolutions / (0.5 * (start_speed + stop_speed))
    run = run_up_of(train, start_speed, stop_speed, duration=seconds, samples_per_period=_SAMPLES)
    dataset = order_map(run, variable="dynamic_force", highest=3.0 * teeth)
    # In the CF conventions a coordinate called time has a reference date, which is missing here.
    dataset = dataset.isel(mesh=0).drop_vars("mesh").rename(time="block")
    return dataset.assign_attrs(load_case=load_case)


def gearbox_outline(file: str) -> xr.Dataset:
    """Return the outline of the gearbox in a REXS file, see `Gearbox.outline`."""
    return read_gearbox(file).outline()


def stage_rows(stages: Sequence[xr.Dataset], file: str) -> Iterator[list]:
    """Yield the rows of the table of stages: the names of the columns, then their values.

    `stages` are datasets from `sweep_stage` for the gearbox in `file`. Each stage has one row
    per load case. With several cases, a row "all" has the largest values, and the contact loss
    averaged over the load durations. The last rows tell in the column "note" why a stage or case
    was not computed.
    """
    box = read_gearbox(file)
    yield [
        *("stage", "load_case", "load_duration_fraction", "torque_n_m", "speed_rpm"),
        *("dynamic_factor", "dynamic_factor_iso_6336", "largest_dynamic_factor", "at_speed_rpm"),
        *("peak_to_peak_error_um", "resonance_speed_rpm", "contact_loss_fraction", "jumps_rpm"),
        "note",
    ]
    # Stage -> (duration fraction, values, jump speeds) of each of its load cases.
    cases_by_stage: dict[str, list] = {}
    for data in stages:
        case, name = data.attrs["load_case"], data.attrs["stage"]
        fraction = box.load_cases[case]
        values = _stage_values(data)
        jumps = np.concatenate([data.jump_up_speed.values, data.jump_down_speed.values])
        cases_by_stage.setdefault(name, []).append((fraction, values, jumps))
        texts = [_format_number(value) for value in (fraction, data.torque, *values)]
        yield [name, case, *texts, _format_jump_speeds(jumps), ""]
    for name, cases in cases_by_stage.items():
        if len(cases) > 1:
            fractions = [fraction for fraction, _, _ in cases]
            rows = [values for _, values, _ in cases]
            all_jumps = np.concatenate([jumps for _, _, jumps in cases])
            largest = np.fmax.reduce(np.array(rows))
            # Columns 3 and 4 are the largest dynamic factor and its speed, which stay together.
            largest[4] = max(values[3:5] for values in rows)[1]
            losses = np.nan_to_num([values[-1] for values in rows])
            largest[-1] = np.dot(fractions, losses) / np.sum(fractions)
            texts = [_format_number(value) for value in largest[1:]]
            duration = _format_number(np.sum(fractions))
            yield [name, "all", duration, "", "", *texts, _format_jump_speeds(all_jumps), ""]
    _, _, reasons = list_computations(file)
    for name, reason in reasons.items():
        is_case = name in box.load_cases
        yield ["" if is_case else name, name if is_case else "", *[""] * 11, reason]


def _stage_values(data: xr.Dataset) -> list[float]:
    """Return the values of a stage in the columns from speed_rpm to contact_loss_fraction.

    `data` is a dataset from `sweep_stage`, over tuning (dimensionless mesh frequency) and the
    direction of the sweep; the larger value of both directions is returned. Unknown values are NaN:
    those at the operating point if the file states no operating speed, and the dynamic factor of
    ISO 6336 if the gears have no quality.
    """
    factors = data.dynamic_factor.max("direction")
    largest_index = int(factors.fillna(-np.inf).argmax("tuning"))
    point = xr.Dataset()  # the operating point
    error = None
    operating_speed = float(data.operating_speed)
    if np.isfinite(operating_speed):
        nearest_index = int(np.abs(data.speed.values - operating_speed).argmin())
        point = data.isel(tuning=nearest_index)
        error = 1e6 * point.error_peak_to_peak
    values = [point.get(name) for name in ("speed", "dynamic_factor", "iso_dynamic_factor")]
    values += [factors[largest_index], data.speed[largest_index], error]
    values += [data.resonance_speed, point.get("contact_loss_fraction")]
    return [math.nan if value is None else float(value.max()) for value in values]


def _format_jump_speeds(speeds: np.ndarray) -> str:
    """Return jump speeds as a string, in increasing order, without NaN."""
    return " ".join(map(_format_number, np.sort(speeds[np.isfinite(speeds)])))


def _format_number(value: Any) -> str:
    """Return a number as a string with six significant digits, "" for NaN."""
    return f"{float(value):.6g}" if np.isfinite(value) else ""


def gearbox_rows(boxes: Sequence[xr.Dataset]) -> Iterator[list]:
    """Yield the rows of the table of whole gearboxes: the names of the columns, then their values.

    `boxes` are datasets from `analyse_gearbox`, one for each load case. Their rows are natural
    frequencies, with the mesh and the shaft that have the largest share of the energy of a mode;
    static forces of the meshes; and characteristic frequencies. The column "of" names the mode,
    mesh or part.
    """
    yield ["load_case", "of", "quantity", "value", "unit"]
    for box in boxes:
        case = box.attrs["load_case"]
        for i, frequency in enumerate(box.mode_frequency.values):
            yield [case, f"mode {i}", "natural frequency", _format_number(frequency), "Hz"]
            for name, dim in (("mode_strain_energy", "mesh"), ("mode_shaft_energy", "shaft")):
                shares = box[name].isel(natural_mode=i)
                if shares.size and float(shares.max()) > 0.0:
                    owner = str(box[dim].values[int(shares.values.argmax())])
                    quantity = f"largest share of the energy in a {dim}, {owner}"
                    yield [case, f"mode {i}", quantity, _format_number(shares.max()), ""]
        for name in box.mesh.values:
            mesh = box.sel(mesh=name)
            yield [case, name, "static mesh force", _format_number(mesh.mesh_force), "N"]
            yield [case, name, "static load sharing", _format_number(mesh.load_sharing), ""]
        names = [name for name in FREQUENCIES if name in box]
        frequencies = box[names].assign(speed=box.speed)
        # The first row has the names of the columns.
        for owner, kind, hertz, order in list(frequency_rows(frequencies))[1:]:
            yield [case, owner, f"{kind}, order {order}", hertz, "Hz"]


def _reference_speed(box: Gearbox, train: Any, load_case: str) -> float | None:
    """Return the operating speed of the reference pinion relative to the housing, rpm.

    The reference pinion is that of the mesh whose frequency defines the tuning of the train. Return
    None if the file states no speeds in this load case.
    """
    speeds = box.loads(load_case).speeds
    if speeds is None:
        return None
    reference_stage = box.stages[train.reference]
    shaft = box.shaft_of[reference_stage.pinion.id]
    return abs(speeds[shaft.id])
