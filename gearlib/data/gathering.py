"""Concatenation of shards, the partial results of the workflow, to a dataset for each experiment.

The scalar coordinates `damping`, and `direction` or `tuning`, give the position of a shard; their
values keep the order in which they first appear. Attributes that differ between shards are dropped.
"""

import numpy as np
import xarray as xr

from gearlib.data import status

#: Variables that depend only on the gear pair without its damping.
PAIR_SCALES = {
    "static_deflection",
    "force_scale",
    "stiffness_scale",
    "backlash_ratio",
    "tuning_factor_max",
    "tuning_factor_min",
}
#: Variables that depend only on the gear pair without its damping and on the tuning.
TUNING_SCALES = {"mesh_frequency", "velocity_scale", "acceleration_scale", "speed"}
#: Variables over the phase that are gathered; all other variables over the phase are dropped.
_PHASE_PLANE_VARIABLES = {"displacement", "velocity", "contact"}


def gather_resonance(shards):
    """Return one dataset over (damping, direction, tuning) from the parts of several sweeps.

    Each part, a shard, is a result of `gearlib.sweep` over a window of tunings (mesh frequency over
    natural frequency), with scalar coordinates `damping` and `direction`. At tunings that only
    downward sweeps reach, the other sweeps are NaN with the status `NO_START`. Raises ValueError if
    the tunings of sweeps differ in another way.
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
    """Return a sweep padded with NaN at the lower tunings that only `longest_sweep` reaches.

    The sweep is returned unchanged unless `longest_sweep` goes downwards and both have the same
    highest tunings. A tuning is the mesh frequency over the natural frequency.
    """
    tunings, all_tunings = sweep.tuning.values, longest_sweep.tuning.values
    has_same_end = np.array_equal(tunings, all_tunings[-tunings.size :])
    if longest_sweep.direction != "down" or not has_same_end:
        return sweep
    # Integer variables cannot be NaN. The period 0 means a motion that is not periodic.
    fill_values = {"period": np.int32(0), "status": np.int8(status.NO_START)}
    extended = sweep.reindex(tuning=all_tunings, fill_value=fill_values)
    # Scales such as the speed depend only on the tuning and are known without a run.
    return extended.assign({name: longest_sweep[name] for name in TUNING_SCALES & set(sweep)})


def gather_phase_planes(shards):
    """Return displacement, velocity and contact over (damping, tuning, phase), with summaries.

    Each of the `shards` is a dataset of `gearlib.simulate` with a scalar coordinate `damping`. The
    phase is 0 at the start of the record. Raises ValueError if tunings (mesh frequency over natural
    frequency) differ between values of the damping, or recorded phases between runs.
    """
    return _concatenate_by_damping(map(_phase_plane, shards), "tuning", PAIR_SCALES)


def _phase_plane(run):
    """Return the variables of a run that a plot of velocity over displacement needs.

    `run` is a dataset of `gearlib.simulate`. Its tuning becomes a coordinate, and the phase is
    counted from the start of the record.
    """
    # Variables over the phase or the events; only some of them are kept.
    time_histories = {name for name in run.data_vars if {"phase", "event"} & {*run[name].dims}}
    phase = (run.phase - run.phase[0]).assign_attrs(run.phase.attrs)
    phase.attrs["long_name"] = "mesh phase from the start of the record"
    run = run.drop_encoding().drop_vars(time_histories - _PHASE_PLANE_VARIABLES)
    return run.set_coords("tuning").assign_coords(phase=phase)


def gather_failures(columns):
    """Return the verdicts on methods over (problem, trial) as one dataset.

    `columns` holds a dataset over the problems for each method, called a trial, which the function
    `gearlib.studies.trials.failures.judge_method` returns. Methods keep their order. Raises
    ValueError if their problems differ.
    """
    # Variables over the problems alone are the same for all methods.
    shared_names = {name for name in columns[0].data_vars if columns[0][name].dims == ("problem",)}
    return _concatenate(columns, "trial", shared_names)


def _group_by(datasets, coordinate):
    """Return lists of datasets that have the same value of a scalar coordinate.

    `coordinate` is its name. The lists are in the order in which their values first appear.
    """
    groups = {}
    for dataset in datasets:
        groups.setdefault(dataset[coordinate].item(), []).append(dataset)
    return groups.values()


def _concatenate_by_damping(datasets, dim, shared_names):
    """Return datasets concatenated along `dim` for each damping, then along `damping`.

    `shared_names` are the names of variables that do not vary along `dim`. The factors that convert
    results to SI units do not vary along `damping` either.
    """
    groups = _group_by(datasets, "damping")
    by_damping = [_concatenate(group, dim, shared_names) for group in groups]
    return _concatenate(by_damping, "damping", PAIR_SCALES | TUNING_SCALES)


def _concatenate(datasets, dim, shared_names):
    """Return datasets concatenated along `dim`.

    The variables `shared_names` must be equal in all datasets and do not get the dimension;
    otherwise ValueError is raised. They are given by name, because by default xarray decides by the
    values which variables get the dimension.
    """
    names = [name for name in datasets[0].data_vars if name in shared_names]
    shared, *other_shared = [dataset[names].drop_vars(dim, errors="ignore") for dataset in datasets]
    if not all(other.equals(shared) for other in other_shared):
        raise ValueError(f"shards along {dim} differ in their scales or in their tunings")
    varying = [dataset.drop_vars(names) for dataset in datasets]
    options = {"data_vars": "all", "coords": "minimal", "compat": "equals", "join": "exact"}
    concatenated = xr.concat(varying, dim, combine_attrs="drop_conflicts", **options)
    return concatenated.assign({name: shared[name].variable for name in names})
