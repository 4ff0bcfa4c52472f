"""From the shards of the workflow to one dataset for each experiment.

A shard says by its scalar coordinates where it belongs: `damping`, and `direction` or `tuning`.
The order of dampings, directions and tunings is that of their first appearance. Attributes on
which the shards disagree (the parameters of the single run) stay with the shards.
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

#: What the phase planes keep of a time course; the rest is in the shards.
_DRAWN = {"displacement", "velocity", "contact"}


def gather_resonance(shards):
    """Return the characteristics, as in `gearlib.sweep`, over (damping, direction, tuning).

    Shards are sweeps, one for each window of tunings, with scalar coordinates `damping` and
    `direction`. Scales to SI stay as they are. Where a downward sweep has gone on below the others
    these are NaN, their status is `NO_START`. ValueError if their tunings differ otherwise.
    """
    shared = PAIR_SCALES | TUNING_SCALES

    def windows(datasets):
        return _stack(sorted(datasets, key=lambda d: float(d.tuning[0])), "tuning", PAIR_SCALES)

    curves = [
        windows(group)
        for damping in _groups(shards, "damping")
        for group in _groups(damping, "direction")
    ]
    longest = max(curves, key=lambda curve: curve.sizes["tuning"])
    curves = [_widened(curve, longest) for curve in curves]
    both = [_stack(group, "direction", shared) for group in _groups(curves, "damping")]
    return _stack(both, "damping", shared)


def _widened(curve, longest):
    """Return a curve over the tunings of a downward sweep that has gone on below its own."""
    own, whole = curve.tuning.values, longest.tuning.values
    if longest.direction != "down" or not np.array_equal(own, whole[-own.size :]):
        return curve
    fill = {"period": np.int32(0), "status": np.int8(status.NO_START)}
    found = curve.reindex(tuning=whole, fill_value=fill)
    return found.assign({name: longest[name] for name in TUNING_SCALES & set(curve)})


def gather_phase_planes(shards):
    """Return the phase planes of all dampings and tunings.

    shards: results of `gearlib.simulate` with a scalar coordinate `damping`.

    displacement, velocity, contact over (damping, tuning, phase), the phase counted from the start
    of the record; orbit summary, final state and status over (damping, tuning); the scales to SI.

    ValueError if dampings do not share their tunings, or runs their recorded phases.
    """

    def tunings(datasets):
        return _stack([_drawn_part(dataset) for dataset in datasets], "tuning", PAIR_SCALES)

    shared = PAIR_SCALES | TUNING_SCALES
    return _stack([tunings(group) for group in _groups(shards, "damping")], "damping", shared)


def gather_failures(columns):
    """Return the matrix of failures over (problem, trial); what describes a problem, once.

    Columns are datasets of `gearlib.studies.trials.failures.compute`, one trial each, in the
    order of the figure. ValueError if they do not share their problems.
    """
    shared = {name for name in columns[0].data_vars if columns[0][name].dims == ("problem",)}
    return _stack(columns, "trial", shared)


def _drawn_part(run):
    """Return what a phase plane needs of a run, its tuning as a coordinate."""
    courses = {name for name in run.data_vars if {"phase", "event"} & set(run[name].dims)}
    phase = (run.phase - run.phase[0]).assign_attrs(run.phase.attrs)
    phase.attrs["long_name"] = "mesh phase from the start of the record"
    drawn = run.drop_encoding().drop_vars(courses - _DRAWN)
    return drawn.set_coords("tuning").assign_coords(phase=phase)


def _groups(datasets, coordinate):
    """Return the datasets in groups of equal scalar coordinate, in order of appearance."""
    groups = {}
    for dataset in datasets:
        groups.setdefault(dataset[coordinate].item(), []).append(dataset)
    return groups.values()


def _stack(datasets, dim, shared):
    """Return the datasets side by side along `dim`; variables in `shared` must agree and stay."""
    # Which variables gain the dimension is a matter of their names. Left to itself xarray would
    # decide by their values, and the shape of the result would depend on the numbers in it.
    kept = [name for name in datasets[0].data_vars if name in shared]
    scales = [dataset[kept].drop_vars(dim, errors="ignore") for dataset in datasets]
    if not all(other.equals(scales[0]) for other in scales[1:]):
        raise ValueError(f"shards along {dim} differ in their scales or in their tunings")
    stacked = xr.concat(
        [dataset.drop_vars(kept) for dataset in datasets],
        dim=dim,
        data_vars="all",
        coords="minimal",
        compat="equals",
        join="exact",
        combine_attrs="drop_conflicts",
    )
    return stacked.assign({name: scales[0][name].variable for name in kept})
