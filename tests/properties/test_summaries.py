"""Every variable of a summary, recomputed from the samples and the contact events of its run."""

import math

import numpy as np
import pytest

import gearlib
from gearlib import LoadSharingPair, integrators
from gearlib.data import summary
from gearlib.runs import simulation
from tests.geometry.stages import fzg_c
from tests.physics.test_step_methods import METHOD_VARIANTS, SCIPY_WITH_EVENTS
from tests.properties.known_models import MOTION_CASES, MotionCase

SAMPLES_PER_PERIOD = 1000
ROUNDING = 1e-9
LOAD_SHARING_PAIR = LoadSharingPair.from_geometry(
    fzg_c(), torque=300.0, damping_ratio=0.05, stiffness="iso"
)
MODELS = MOTION_CASES | {"pairs of teeth": MotionCase(LOAD_SHARING_PAIR, 0.9, (0.0, 0.0), 20)}
METHODS = [("exact", {}), ("taylor", {}), ("heyoka", {}), *METHOD_VARIANTS]
CASES = [
    (name, method, options)
    for name, case in MODELS.items()
    for method, options in METHODS
    if integrators.METHODS[method].supports(case.model)
    and integrators.describe_method(method).available
]


def low_stiffness_fraction_bounds(model, stiffness, contact, periods):
    """Return lower and upper bounds, (meshes,) each, of the fraction of time at low stiffness.

    It counts the time in contact while the stiffness is below its mean. The bounds differ by the
    time in which the stiffness is unknown.
    """
    if model.equation is not None:
        # Only the drive-side stiffness counts. Samples on the coast side do not contain it, so that
        # it is taken from other periods at the same phase.
        drive_stiffness = np.where(contact < 0, -math.inf, stiffness).reshape(periods, -1)
        stiffness = np.tile(drive_stiffness.max(axis=0), periods)[:, None]
    is_known = np.isfinite(stiffness)
    mean = stiffness.mean(axis=0, where=is_known & (stiffness > 0.0))
    is_low = is_known & (stiffness < mean * (1.0 - ROUNDING)) & (contact != 0)
    return is_low.mean(axis=0), (is_low | ~is_known).mean(axis=0)


def event_variables(run, contact, span):
    """Return the summary variables of a mesh that follow from its events, as a dict.

    `contact` is the contact state of the first sample, and `span` is the recorded phase interval.
    """
    before, after = run.event_from.values, run.event_to.values
    # A step across an event may put the first sample after the event, so that the state before
    # the first event is preferred.
    contact_states = np.append(before[:1] if before.size else contact, after)
    phases = run.event_phase.values - float(run.phase[0])
    assert (contact_states[:-1] == before).all()
    durations = np.diff([0.0, *phases, span])
    return {
        "fraction_drive": durations[contact_states == 1].sum() / span,
        "contact_loss_fraction": durations[contact_states == 0].sum() / span,
        "fraction_coast": durations[contact_states == -1].sum() / span,
        "bounces": (before == 1).sum() * math.tau / span,
    }


def expected_load_sharing(meshes, forces):
    """Return the force of each mesh divided by the mean force of all meshes on the same gear.

    The value is 1 for a mesh that shares neither gear with another mesh in the same role.
    """
    load_sharing = np.ones_like(forces)
    for index, mesh in enumerate(meshes):
        for gear in ("wheel", "pinion"):
            on_same_gear = [getattr(other, gear) == getattr(mesh, gear) for other in meshes]
            if sum(on_same_gear) > 1:
                load_sharing[index] = forces[index] / forces[on_same_gear].mean()
    return load_sharing


def summary_bounds(model, run, periods, sample_error):
    """Return bounds (low, high), (meshes,) each, of the summary variables, as a dict by name.

    The bounds follow from the samples and events of the run. `sample_error` is the number of
    samples by which a switch of stiffness or contact may appear too late.
    """
    mesh_count, span = max(len(model.mesh_names), 1), math.tau * periods
    names = ("displacement", "dynamic_force", "stiffness", "contact")
    x, force, stiffness, contact = (run[name].values.reshape(-1, mesh_count) for name in names)
    event_mesh = run.event_mesh.values if "event_mesh" in run else np.zeros(run.sizes["event"])
    runs = [run.isel(event=event_mesh == mesh) for mesh in range(mesh_count)]
    rows = [
        event_variables(mesh_run, state, span)
        for mesh_run, state in zip(runs, contact[0], strict=True)
    ]
    from_events = {name: np.array([row[name] for row in rows]) for name in rows[0]}
    bounds = {name: (values - ROUNDING, values + ROUNDING) for name, values in from_events.items()}
    stiffness_changes = np.diff(stiffness, axis=0)
    switches = np.diff(np.sign(stiffness_changes), axis=0, append=0.0) != 0
    switches |= np.diff(contact, axis=0) != 0
    low, high = low_stiffness_fraction_bounds(model, stiffness, contact, periods)
    margin = sample_error * (1 + switches.sum(axis=0)) / len(x)
    bounds["fraction_min_stiffness"] = low - margin, high + margin
    # Between two samples the displacement exceeds them by at most a quarter of its second
    # difference, and the force by its largest change between samples without a stiffness step.
    force_changes = np.abs(np.diff(force, axis=0))
    force_margin = 1.2 * force_changes.max(
        axis=0, where=np.abs(stiffness_changes) < 0.05, initial=0.0
    )
    x_margin = np.abs(np.diff(x, 2, axis=0)).max(axis=0) / 4.0
    for name, values, margin in (
        ("displacement", x, x_margin),
        ("dynamic_force", force, force_margin),
    ):
        # The end of the run is not a sample, and is extrapolated from the last two samples.
        end = 2.0 * values[-1] - values[-2]
        low, high = values.min(axis=0), values.max(axis=0)
        bounds[f"{name}_max"] = high - ROUNDING, np.maximum(high, end) + margin + ROUNDING
        bounds[f"{name}_min"] = np.minimum(low, end) - margin - ROUNDING, low + ROUNDING
    margin = sample_error * force_changes.sum(axis=0) / len(force) + ROUNDING
    bounds["mean_force"] = force.mean(axis=0) - margin, force.mean(axis=0) + margin
    if model.force_ratio_name in run:
        # The ratio is NaN for meshes without a mean force.
        static = np.abs(np.where(model.mean_forces, model.mean_forces, np.nan))
        peak = np.abs(force).max(axis=0)
        high = np.maximum(peak, np.abs(2.0 * force[-1] - force[-2])) + force_margin
        bounds[model.force_ratio_name] = (peak - ROUNDING) / static, (high + ROUNDING) / static
    if model.mesh_names:
        load_sharing = expected_load_sharing(model.meshes, run.mean_force.values)
        bounds["load_sharing"] = load_sharing - ROUNDING, load_sharing + ROUNDING
    else:
        v = run.velocity.values
        end = np.array([2.0 * x[-1, 0] - x[-2, 0], v[-1]])
        margin = np.array([4.0 * x_margin[0], np.abs(np.diff(v)).max()])
        bounds["final_state"] = end - margin, end + margin
    return bounds


@pytest.mark.parametrize(("name", "method", "options"), CASES)
def test_summary_follows_from_samples_and_events(name, method, options):
    """Each summary variable must lie within bounds from dense samples and the events."""
    model, tuning, state, periods = MODELS[name]
    recorded_periods = periods - 1
    run_options = {"periods": periods, "record_periods": recorded_periods}
    run_options |= {"initial_state": state, "method": method, "options": options}
    run = gearlib.simulate(model, tuning, samples_per_period=SAMPLES_PER_PERIOD, **run_options)
    assert int(run.status) == 0 and (np.diff(run.event_phase) >= 0.0).all()
    # Methods with long steps pass over switches, so that samples show these too late.
    sample_error = 50 if method in ("rk45", "scipy") and options != SCIPY_WITH_EVENTS else 1
    bounds = summary_bounds(model, run, recorded_periods, sample_error)
    # The summary table has all variables; datasets of models with one mesh lack some of them.
    table = simulation.run(model, tuning, samples_per_period=1, **run_options).summary
    span = math.tau * recorded_periods
    columns = summary.normalize_columns(table, span, recorded_periods)
    extra = model.extra_summary_variables((), table, span)
    for variable in bounds.keys() | columns.keys() | extra.keys():
        (low, high), values = bounds[variable], np.ravel(run.get(variable, columns.get(variable)))
        is_inside = (low <= values) & (values <= high) | (np.isnan(low) & np.isnan(values))
        assert is_inside.all(), f"{variable}: {values}, expected {low} to {high}"
