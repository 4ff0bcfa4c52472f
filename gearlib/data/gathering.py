"""From the shards of the workflow to one dataset for each experiment.

Scalar coordinates of a shard say where it belongs: `damping`, and `direction` or `tuning`. Their
order is that of their first appearance. Attributes on which shards disagree are dropped.
"""

import numpy as np
import xarray as xr

from gearlib.data import status

#: Variables that depend on the pair alone, and on pair and tuning, but never on the damping.
PAIR_SCALES = {
    "static_deflection",
    "force_scale",
    "stiffness_scale",
    "backlash_ratio",
    "tuning_factor_max",
    "tuning_factor_min",
}
TUNING_SCALES = {"mesh_frequency", "velocity_scale", "acceleration_scale", "speed"}
#: Time courses that phase planes show; the others stay in the shards.
_SHOWN_COURSES = {"displacement", "velocity", "contact"}


def gather_resonance(shards):
    """Return one dataset over (damping, direction, tuning) from partial results of `gearlib.sweep`.

    Each shard is a sweep over a window of tunings, with scalar coordinates `damping` and
    `direction`. If downward sweeps reach lower tunings than the other sweeps, these are NaN there,
    with the status `NO_START`. ValueError if tunings differ in another way.
    """
    curves = []
    for damping in _groups(shards, "damping"):
        for windows in _groups(damping, "direction"):
            windows = sorted(windows, key=lambda window: float(window.tuning[0]))
            curves.append(_stack(windows, "tuning", PAIR_SCALES))
    longest = max(curves, key=lambda curve: curve.sizes["tuning"])
    curves = [_widened(curve, longest) for curve in curves]
    return _stack_by_damping(curves, "direction", PAIR_SCALES | TUNING_SCALES)


def _widened(curve, longest):
    """Return a sweep extended to the lower tunings of `longest`, if that is a downward sweep."""
    tunings, all_tunings = curve.tuning.values, longest.tuning.values
    same_end = np.array_equal(tunings, all_tunings[-tunings.size :])
    if longest.direction != "down" or not same_end:
        return curve
    fill = {"period": np.int32(0), "status": np.int8(status.NO_START)}
    widened = curve.reindex(tuning=all_tunings, fill_value=fill)
    return widened.assign({name: longest[name] for name in TUNING_SCALES & set(curve)})


def gather_phase_planes(shards):
    """Return displacement, velocity and contact over (damping, tuning, phase), with summaries.

    Each shard is a dataset of `gearlib.simulate` with a scalar coordinate `damping`. The phase is 0
    at the start of the record. ValueError if tunings differ between dampings, or recorded phases
    between runs.
    """
    return _stack_by_damping([_phase_plane(shard) for shard in shards], "tuning", PAIR_SCALES)


def _phase_plane(run):
    """Return the variables of a run for a phase plane, with the tuning as a coordinate."""
    time_histories = {n for n in run.data_vars if {"phase", "event"} & set(run[n].dims)}
    phase = (run.phase - run.phase[0]).assign_attrs(run.phase.attrs)
    phase.attrs["long_name"] = "mesh phase from the start of the record"
    shown = run.drop_encoding().drop_vars(time_histories - _SHOWN_COURSES)
    return shown.set_coords("tuning").assign_coords(phase=phase)


def gather_failures(columns):
    """Return the failures over (problem, trial) as one dataset, from one dataset per trial.

    Each column is a result of `gearlib.studies.trials.failures.compute`, in the order of the
    figure. ValueError if the trials have different problems.
    """
    shared = {name for name in columns[0].data_vars if columns[0][name].dims == ("problem",)}
    return _stack(columns, "trial", shared)


def _groups(datasets, coordinate):
    """Return lists of the datasets of equal scalar coordinate, in order of appearance."""
    groups = {}
    for dataset in datasets:
        groups.setdefault(dataset[coordinate].item(), []).append(dataset)
    return groups.values()


def _stack_by_damping(datasets, dim, shared):
    """Concatenate datasets along `dim` for each damping, then along `damping`.

    `shared` names variables that do not vary along `dim`.
    """
    stacks = [_stack(group, dim, shared) for group in _groups(datasets, "damping")]
    return _stack(stacks, "damping", PAIR_SCALES | TUNING_SCALES)


def _stack(datasets, dim, shared):
    """Concatenate datasets along `dim`, except for variables in `shared`, which must be equal.

    By default xarray would decide by the values which variables get the new dimension.
    """
    names = [name for name in datasets[0].data_vars if name in shared]
    scales = [dataset[names].drop_vars(dim, errors="ignore") for dataset in datasets]
    if not all(other.equals(scales[0]) for other in scales[1:]):
        raise ValueError(f"shards along {dim} differ in their scales or in their tunings")
    stacked = xr.concat(
        [dataset.drop_vars(names) for dataset in datasets],
        dim=dim,
        data_vars="all",
        coords="minimal",
        compat="equals",
        join="exact",
        combine_attrs="drop_conflicts",
    )
    return stacked.assign({name: scales[0][name].variable for name in names})
