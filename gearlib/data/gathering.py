"""Concatenation of shards, the partial results of the workflow, to one dataset per experiment.

The position of a shard in the dataset is given by its scalar coordinates `damping` and `direction`
or `tuning`; their values keep the order of first appearance. Attributes that differ between shards
are dropped.
"""

import numpy as np
import xarray as xr

from gearlib.data import status

#: Variables that depend only on the gear pair, but not on its damping.
PAIR_SCALES = {
    "static_deflection",
    "force_scale",
    "stiffness_scale",
    "backlash_ratio",
    "tuning_factor_max",
    "tuning_factor_min",
}
#: Variables that depend only on the tuning and on the gear pair, but not on its damping.
TUNING_SCALES = {"mesh_frequency", "velocity_scale", "acceleration_scale", "speed"}
#: Variables over the phase that are kept; all others over the phase are dropped.
_PHASE_PLANE_VARIABLES = {"displacement", "velocity", "contact"}


def gather_resonance(shards):
    """Concatenate parts of sweeps to one dataset over (damping, direction, tuning).

    Each shard is a result of `gearlib.sweep` over a window of tunings, with the scalar coordinates
    `damping` and `direction`. At tunings that only downward sweeps reach, the other sweeps are NaN
    and have the status `NO_START`. Raise ValueError if the tunings differ in any other way.
    """
    sweeps = []
    for shards_of_damping in _group_by(shards, "damping"):
        for windows in _group_by(shards_of_damping, "direction"):
            windows = sorted(windows, key=lambda window: float(window.tuning[0]))
            sweeps.append(_concatenate(windows, "tuning", PAIR_SCALES))
    longest_sweep = max(sweeps, key=lambda sweep: sweep.sizes["tuning"])
    sweeps = [_extend_downwards(sweep, longest_sweep) for sweep in sweeps]
    return _concatenate_by_damping(sweeps, "direction", PAIR_SCALES | TUNING_SCALES)


def _extend_downwards(sweep, longest_sweep):
    """Pad a sweep with NaN at the lower tunings that only `longest_sweep` reaches.

    The sweep is returned unchanged if `longest_sweep` does not go downwards, or if the other
    tunings differ.
    """
    tunings, all_tunings = sweep.tuning.values, longest_sweep.tuning.values
    has_equal_tunings = np.array_equal(tunings, all_tunings[-tunings.size :])
    if longest_sweep.direction != "down" or not has_equal_tunings:
        return sweep
    # Integer variables cannot be NaN; the period 0 marks a motion that is not periodic.
    fill_values = {"period": np.int32(0), "status": np.int8(status.NO_START)}
    extended = sweep.reindex(tuning=all_tunings, fill_value=fill_values)
    # Variables such as the speed depend only on the tuning and are known without a run.
    return extended.assign({name: longest_sweep[name] for name in TUNING_SCALES & set(sweep)})


def gather_phase_planes(shards):
    """Concatenate runs to displacement, velocity and contact over (damping, tuning, phase).

    Each of the `shards` is a dataset of `gearlib.simulate` with a scalar coordinate `damping`. Its
    summary variables are kept. The phase is 0 at the start of the record. Raise ValueError if the
    tunings are not equal for all values of the damping, or the phases for all runs.
    """
    return _concatenate_by_damping(map(_extract_phase_plane, shards), "tuning", PAIR_SCALES)


def _extract_phase_plane(run):
    """Return the variables of a run that are needed to plot its phase plane, and its summaries.

    `run` is a dataset of `gearlib.simulate`. Its tuning becomes a coordinate, and the phase is
    counted from the start of the record.
    """
    time_histories = {name for name in run.data_vars if {"phase", "event"} & {*run[name].dims}}
    phase = (run.phase - run.phase[0]).assign_attrs(run.phase.attrs)
    phase.attrs["long_name"] = "mesh phase from the start of the record"
    run = run.drop_encoding().drop_vars(time_histories - _PHASE_PLANE_VARIABLES)
    return run.set_coords("tuning").assign_coords(phase=phase)


def gather_failures(columns):
    """Concatenate the verdicts on methods to one dataset over (problem, trial).

    `columns` are results of `gearlib.studies.trials.failures.judge_method`: one dataset over the
    problems per trial of a method. The order is kept. Raise ValueError if the problems differ.
    """
    # Variables with the single dimension `problem` are the same for all methods.
    shared_names = {name for name in columns[0].data_vars if columns[0][name].dims == ("problem",)}
    return _concatenate(columns, "trial", shared_names)


def _group_by(datasets, coordinate):
    """Group datasets by the value of a scalar coordinate; return the groups as lists.

    `coordinate` is its name. The groups are in the order of first appearance.
    """
    groups = {}
    for dataset in datasets:
        groups.setdefault(dataset[coordinate].item(), []).append(dataset)
    return groups.values()


def _concatenate_by_damping(datasets, dim, shared_names):
    """Concatenate datasets along `dim` for each damping, then along `damping`.

    `shared_names` are the names of variables that do not vary along `dim`.
    """
    groups = _group_by(datasets, "damping")
    concatenated_groups = [_concatenate(group, dim, shared_names) for group in groups]
    return _concatenate(concatenated_groups, "damping", PAIR_SCALES | TUNING_SCALES)


def _concatenate(datasets, dim, shared_names):
    """Concatenate datasets along `dim`, except for the variables `shared_names`.

    These must be equal in all datasets, or ValueError is raised, and do not get the dimension. They
    are named explicitly, because xarray would choose them by their values.
    """
    names = [name for name in datasets[0].data_vars if name in shared_names]
    shared_variables = [dataset[names].drop_vars(dim, errors="ignore") for dataset in datasets]
    shared = shared_variables[0]
    if not all(variables.equals(shared) for variables in shared_variables[1:]):
        raise ValueError(f"shards along {dim} differ in their scales or in their tunings")
    varying = [dataset.drop_vars(names) for dataset in datasets]
    options = {"data_vars": "all", "coords": "minimal", "compat": "equals", "join": "exact"}
    concatenated = xr.concat(varying, dim, combine_attrs="drop_conflicts", **options)
    return concatenated.assign({name: shared[name].variable for name in names})
