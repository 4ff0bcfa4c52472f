"""Compute a gearbox from a REXS file: its stages over speed, and the whole gearbox.

Each function reads the file itself, so that jobs of a workflow only need its path.
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
from gearlib.runs.run_up import run_up
from gearlib.studies.teeth_over_speed import sweep_speeds

#: Lowest and highest speed, relative to the operating speed or, if it is unknown, to the resonance
#: speed.
SPEED_RANGE = 0.1, 1.5
#: Samples per mesh period of the run-up.
_SAMPLES = 64
#: Settling time at tuning 1 and damping ratio 1, maximum settling time, and length of the record,
#: in mesh periods.
_SETTLING_PERIODS, _MAX_SETTLING_PERIODS, _RECORD_PERIODS = 8.0, 140, 10


def list_computations(file: str) -> tuple[list[tuple[str, str]], list[str], dict[str, str]]:
    """List the stages and load cases of a gearbox that can be computed.

    `file` is the path of a REXS file. Return three items: a list of pairs (stage, load case), in
    which equal meshes, e.g. of several planets, occur once; a list of the load cases in which the
    whole gearbox can be computed; and a dict that maps the names of other stages and load cases to
    the reasons why they cannot be computed.
    """
    gearbox = read_gearbox(file)
    stages = []
    gearbox_cases = []
    reasons = dict(gearbox.refused)
    for case in gearbox.load_cases:
        torque_error = gearbox.loads(case).torque_error
        if torque_error is not None:
            reasons[case] = str(torque_error)
            continue
        listed: list = []  # (stage, torque) of this load case
        for name in gearbox.stages:
            if name in gearbox.refused:
                continue
            stage_and_torque = (
                gearbox.stage(name, case),
                f"{gearbox.load(name, case)['torque']:.9g}",
            )
            if stage_and_torque not in listed:
                listed.append(stage_and_torque)
                stages.append((name, case))
        try:
            gearbox.train(case, model="rectangle")
            gearbox_cases.append(case)
        except ValueError as error:
            reasons[case] = str(error)
    return stages, gearbox_cases, reasons


def sweep_stage(
    file: str, stage: str, load_case: str, damping_ratio: float, points: int
) -> xr.Dataset:
    """Compute dynamic factor and transmission error of a stage in sweeps up and down in speed.

    `file` is the path of a REXS file; `stage` and `load_case` are names in this file. The stage is
    computed at about `points` speeds from 10 to 150 % of the operating speed, including the
    operating speed, or of the resonance speed if the operating speed is unknown. Speeds that are
    too low to be simulated get the results of the lowest simulated speed. The dataset is described
    in `gearlib.studies.teeth_over_speed.sweep_speeds`.
    """
    gearbox = read_gearbox(file)
    load = gearbox.load(stage, load_case)
    torque, speed = load["torque"], load.get("speed")
    pair = default_load_sharing_pair(
        gearbox.stage(stage, load_case), torque=torque, damping_ratio=damping_ratio
    )
    resonance_speed = float(pair.speed(1.0))
    reference_speed = speed or resonance_speed
    lowest_ratio, highest_ratio = SPEED_RANGE
    speeds = np.linspace(lowest_ratio * reference_speed, highest_ratio * reference_speed, points)
    if speed:
        speeds = np.unique(np.append(speeds, speed))
    # Below the slowest simulated speed, inertia forces are negligible and the motion is the same.
    simulated_speeds = np.unique(np.maximum(speeds, float(pair.speed(pair.slowest_tuning))))
    # The settling time is proportional to the natural period, and mesh periods are shortest at the
    # highest speed, which therefore needs most of them.
    settling_periods = math.ceil(_SETTLING_PERIODS / damping_ratio * speeds[-1] / resonance_speed)
    periods = min(settling_periods, _MAX_SETTLING_PERIODS) + _RECORD_PERIODS
    run = {"periods": periods, "record_periods": _RECORD_PERIODS}
    data = sweep_speeds(pair, simulated_speeds, speed, **run)
    indices = np.searchsorted(simulated_speeds, speeds).clip(0, simulated_speeds.size - 1)
    data = data.isel(tuning=indices)
    data = data.assign_coords(tuning=("tuning", speeds / resonance_speed, data.tuning.attrs))
    data["speed"] = "tuning", speeds, data.speed.attrs
    data["resonance_speed"] = (), resonance_speed, {"units": "min-1", "long_name": "n_E1"}
    return data.assign_attrs(stage=stage, load_case=load_case)


def analyse_gearbox(file: str, load_case: str, damping_ratio: float, orders: int) -> xr.Dataset:
    """Compute modes, Campbell diagram, load sharing and characteristic frequencies of a gearbox.

    The gearbox in the REXS file `file` is modelled as one gear train in the given load case.
    `damping_ratio` is the damping ratio of the meshes, `orders` the highest multiple of each mesh
    frequency in the Campbell diagram.
    """
    gearbox = read_gearbox(file)
    train = gearbox.train(load_case, damping_ratio=damping_ratio)
    speed = _reference_speed(gearbox, train, load_case)
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
    """Compute the order map of the force in the first mesh of a gearbox during a run-up.

    The gearbox in the REXS file `file` is modelled as one gear train. The speed rises from 10 to
    100 % of the operating speed within this number of `revolutions`. If the operating speed is
    unknown, the run-up ends where the mesh frequency equals the lowest natural frequency.
    """
    gearbox = read_gearbox(file)
    train = gearbox.train(load_case, damping_ratio=damping_ratio)
    teeth = train.reference_pinion.teeth
    # The frequencies of the rigid-body modes, which come first, are zero.
    rigid_body_mode_count = train.free_motions.shape[1]
    lowest_frequency = float(train.modes().natural_frequency.values[rigid_body_mode_count])
    stop_speed = _reference_speed(gearbox, train, load_case) or lowest_frequency * 60.0 / teeth
    start_speed = SPEED_RANGE[0] * stop_speed
    seconds = 60.0 * revolutions / (0.5 * (start_speed + stop_speed))
    run = run_up(train, start_speed, stop_speed, duration=seconds, samples_per_period=_SAMPLES)
    dataset = order_map(run, variable="dynamic_force", highest=3.0 * teeth)
    # In the CF conventions, a coordinate called "time" needs a reference date.
    dataset = dataset.isel(mesh=0).drop_vars("mesh").rename(time="block")
    return dataset.assign_attrs(load_case=load_case)


def gearbox_outline(file: str) -> xr.Dataset:
    """Return the outline of the gearbox in the REXS file `file`; see `Gearbox.outline`."""
    return read_gearbox(file).outline()


def stage_rows(stages: Sequence[xr.Dataset], file: str) -> Iterator[list]:
    """Yield the rows of the table of stages, beginning with the column names.

    `stages` are datasets from `sweep_stage` for the gearbox in `file`. Each stage has one row per
    load case. If there are several load cases, the row "all" has the maximum of each column and the
    contact loss averaged over the load durations. In the last rows, the column "note" states why a
    stage or load case was not computed.
    """
    gearbox = read_gearbox(file)
    yield [
        *("stage", "load_case", "load_duration_fraction", "torque_n_m", "speed_rpm"),
        *("dynamic_factor", "dynamic_factor_iso_6336", "largest_dynamic_factor", "at_speed_rpm"),
        *("peak_to_peak_error_um", "resonance_speed_rpm", "contact_loss_fraction", "jumps_rpm"),
        "note",
    ]
    # Stage -> list of (load duration fraction, values, jump speeds), one per load case.
    cases_by_stage: dict[str, list] = {}
    for data in stages:
        case, name = data.attrs["load_case"], data.attrs["stage"]
        fraction = gearbox.load_cases[case]
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
            # The speed of the largest dynamic factor follows it in the next column.
            factor_column, speed_column = 3, 4
            _, largest[speed_column] = max(
                values[factor_column : speed_column + 1] for values in rows
            )
            losses = np.nan_to_num([values[-1] for values in rows])
            largest[-1] = np.dot(fractions, losses) / np.sum(fractions)
            texts = [_format_number(value) for value in largest[1:]]
            duration = _format_number(np.sum(fractions))
            yield [name, "all", duration, "", "", *texts, _format_jump_speeds(all_jumps), ""]
    _, _, reasons = list_computations(file)
    for name, reason in reasons.items():
        is_case = name in gearbox.load_cases
        yield ["" if is_case else name, name if is_case else "", *[""] * 11, reason]


def _stage_values(data: xr.Dataset) -> list[float]:
    """Return the values of a stage in the columns from speed_rpm to contact_loss_fraction.

    `data` is a dataset from `sweep_stage`; each value is the larger one of both sweep directions.
    Unknown values are NaN, i.e. all values at the operating point if the operating speed is
    unknown, and the dynamic factor by ISO 6336 if the gears have no quality class.
    """
    factors = data.dynamic_factor.max("direction")
    largest_index = int(factors.fillna(-np.inf).argmax("tuning"))
    operating_point = xr.Dataset()
    error = None
    operating_speed = float(data.operating_speed)
    if np.isfinite(operating_speed):
        nearest_index = int(np.abs(data.speed.values - operating_speed).argmin())
        operating_point = data.isel(tuning=nearest_index)
        error = 1e6 * operating_point.error_peak_to_peak
    values = [
        operating_point.get(name) for name in ("speed", "dynamic_factor", "iso_dynamic_factor")
    ]
    values += [factors[largest_index], data.speed[largest_index], error]
    values += [data.resonance_speed, operating_point.get("contact_loss_fraction")]
    return [math.nan if value is None else float(value.max()) for value in values]


def _format_jump_speeds(speeds: np.ndarray) -> str:
    """Format jump speeds in increasing order, omitting NaN."""
    return " ".join(map(_format_number, np.sort(speeds[np.isfinite(speeds)])))


def _format_number(value: Any) -> str:
    """Format a number with six significant digits; return "" for NaN."""
    return f"{float(value):.6g}" if np.isfinite(value) else ""


def gearbox_rows(gearboxes: Sequence[xr.Dataset]) -> Iterator[list]:
    """Yield the rows of the table of whole gearboxes, beginning with the column names.

    `gearboxes` are datasets from `analyse_gearbox`, one per load case. The rows are natural
    frequencies, with the mesh and the shaft that store most energy of the mode; static mesh forces;
    and characteristic frequencies. The column "of" states the mode, mesh or other component.
    """
    yield ["load_case", "of", "quantity", "value", "unit"]
    for gearbox in gearboxes:
        case = gearbox.attrs["load_case"]
        for i, frequency in enumerate(gearbox.mode_frequency.values):
            yield [case, f"mode {i}", "natural frequency", _format_number(frequency), "Hz"]
            for name, dim in (("mode_strain_energy", "mesh"), ("mode_shaft_energy", "shaft")):
                shares = gearbox[name].isel(natural_mode=i)
                if shares.size and float(shares.max()) > 0.0:
                    name_of_maximum = str(gearbox[dim].values[int(shares.values.argmax())])
                    quantity = f"largest share of the energy in a {dim}, {name_of_maximum}"
                    yield [case, f"mode {i}", quantity, _format_number(shares.max()), ""]
        for name in gearbox.mesh.values:
            mesh = gearbox.sel(mesh=name)
            yield [case, name, "static mesh force", _format_number(mesh.mesh_force), "N"]
            yield [case, name, "static load sharing", _format_number(mesh.load_sharing), ""]
        names = [name for name in FREQUENCIES if name in gearbox]
        frequencies = gearbox[names].assign(speed=gearbox.speed)
        _, *rows = frequency_rows(frequencies)  # without the column names
        for component, kind, hertz, order in rows:
            yield [case, component, f"{kind}, order {order}", hertz, "Hz"]


def _reference_speed(gearbox: Gearbox, train: Any, load_case: str) -> float | None:
    """Return the operating speed of the reference pinion relative to the housing, in rpm.

    The reference pinion belongs to the mesh whose frequency defines the tuning of the train. Return
    None if the file states no speeds for this load case.
    """
    speeds = gearbox.loads(load_case).speeds
    if speeds is None:
        return None
    reference_stage = gearbox.stages[train.reference]
    shaft = gearbox.shaft_of[reference_stage.pinion.id]
    return abs(speeds[shaft.id])
