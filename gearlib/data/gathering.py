"""Concatenation of the shards of the workflow to one dataset for each experiment.

The position of a shard is given by its scalar coordinates `damping`, and `direction` or `tuning`,
whose values are in order of first appearance. Attributes that differ between shards are dropped.
"""

import numpy as np
import xarray as xr

from gearlib.data import status

#: Variables that depend only on the gear pair without its damping, and those on the tuning, too.
PAIR_SCALES = {
    "static_deflection",
    "force_scale",
    "stiffness_scale",
    "backlash_ratio",
    "tuning_factor_max",
    "tuning_factor_min",
}
TUNING_SCALES = {"mesh_frequency", "velocity_scale", "acceleration_scale", "speed"}
#: Variables over the phase that are gathered; all others over the phase are dropped.
_PHASE_PLANE_VARIABLES = {"displacement", "velocity", "contact"}


def gather_resonance(shards):
    """Return one dataset over (damping, direction, tuning) from partial results of `gearlib.sweep`.

    Each shard is a sweep over a window of tunings, with scalar coordinates `damping` and
    `direction`. If downward sweeps reach lower tunings than the other sweeps, these are NaN there,
    with the status `NO_START`. ValueError if tunings differ in another way.
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

    A sweep is returned unchanged unless the longest one goes downwards and ends beyond it.
    """
    tunings, all_tunings = sweep.tuning.values, longest_sweep.tuning.values
    has_same_end = np.array_equal(tunings, all_tunings[-tunings.size :])
    if longest_sweep.direction != "down" or not has_same_end:
        return sweep
    fill_values = {"period": np.int32(0), "status": np.int8(status.NO_START)}
    extended = sweep.reindex(tuning=all_tunings, fill_value=fill_values)
    return extended.assign({name: longest_sweep[name] for name in TUNING_SCALES & set(sweep)})


def gather_phase_planes(shards):
    """Return displacement, velocity and contact over (damping, tuning, phase), with summaries.

    Each shard is a dataset of `gearlib.simulate` with a scalar coordinate `damping`. The phase is 0
    at the start of the record. ValueError if tunings differ between dampings, or recorded phases
    between runs.
    """
    return _concatenate_by_damping(map(_phase_plane, shards), "tuning", PAIR_SCALES)


def _phase_plane(run):
    """Return the variables of a run for a phase plane, with the tuning as a coordinate."""
    time_histories = {n for n in run.data_vars if {"phase", "event"} & set(run[n].dims)}
    phase = (run.phase - run.phase[0]).assign_attrs(run.phase.attrs)
    phase.attrs["long_name"] = "mesh phase from the start of the record"
    run = run.drop_encoding().drop_vars(time_histories - _PHASE_PLANE_VARIABLES)
    return run.set_coords("tuning").assign_coords(phase=phase)


def gather_failures(columns):
    """Return the verdicts on methods over (problem, trial) as one dataset, from one per method.

    Each column, the dataset of a method (or "trial"), is a result of the function
    `gearlib.studies.trials.failures.judge_method`; methods keep their order. ValueError if they
    have different problems.
    """
    shared_names = {name for name in columns[0].data_vars if columns[0][name].dims == ("problem",)}
    return _concatenate(columns, "trial", shared_names)


def _group_by(datasets, coordinate):
    """Return lists of the datasets with equal scalar coordinates, in order of appearance."""
    groups = {}
    for dataset in datasets:
        groups.setdefault(dataset[coordinate].item(), []).append(dataset)
    return groups.values()


def _concatenate_by_damping(datasets, dim, shared_names):
    """Concatenate datasets along `dim` for each damping, then along `damping`.

    The variables `shared_names` do not vary along `dim`.
    """
    groups = _group_by(datasets, "damping")
    by_damping = [_concatenate(group, dim, shared_names) for group in groups]
    return _concatenate(by_damping, "damping", PAIR_SCALES | TUNING_SCALES)


def _concatenate(datasets, dim, shared_names):
    """Concatenate datasets along `dim`, except for the variables `shared_names`, which are equal.

    By default xarray would decide by the values which variables get the new dimension.
    """
    names = [name for name in datasets[0].data_vars if name in shared_names]
    shared = [dataset[names].drop_vars(dim, errors="ignore") for dataset in datasets]
    if not all(other.equals(shared[0]) for other in shared[1:]):
        raise ValueError(f"shards along {dim} differ in their scales or in their tunings")
    different = [dataset.drop_vars(names) for dataset in datasets]
    options = {"data_vars": "all", "coords": "minimal", "compat": "equals", "join": "exact"}
    concatenated = xr.concat(different, dim, combine_attrs="drop_conflicts", **options)
    return concatenated.assign({name: shared[0][name].variable for name in names})
