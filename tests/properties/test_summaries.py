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

#: Number of samples in each mesh period.
SAMPLES = 1000
ROUNDING = 1e-9
TEETH = LoadSharingPair.from_geometry(fzg_c(), torque=300.0, damping_ratio=0.05, stiffness="iso")
MODELS = MOTION_CASES | {"pairs of teeth": MotionCase(TEETH, 0.9, (0.0, 0.0), 20)}
METHODS = [("exact", {}), ("taylor", {}), ("heyoka", {}), *METHOD_VARIANTS]
CASES = [
    (name, method, options)
    for name, case in MODELS.items()
    for method, options in METHODS
    if integrators.METHODS[method].supports(case.model)
    and integrators.describe_method(method).available
]


def shares_of_low_stiffness(model, stiffness, contact, periods):
    """Return bounds of the fraction of time in contact at low stiffness, two arrays (meshes,).

    Stiffness below its mean counts as low. The bounds differ if the stiffness of some samples is
    unknown.
    """
    if model.equation is not None:
        # The stiffness of the drive side counts, which samples on the coast side do not show.
        drive_stiffness = np.where(contact < 0, -math.inf, stiffness).reshape(periods, -1)
        stiffness = np.tile(drive_stiffness.max(axis=0), periods)[:, None]
    is_known = np.isfinite(stiffness)
    mean = stiffness.mean(axis=0, where=is_known & (stiffness > 0.0))
    is_low = is_known & (stiffness < mean * (1.0 - ROUNDING)) & (contact != 0)
    return is_low.mean(axis=0), (is_low | ~is_known).mean(axis=0)


def variables_of_events(run, contact, span):
    """Return the summary variables of a mesh that follow from its events, as a dict.

    `contact` is the contact state of the first sample, `span` the length of the record in phase.
    """
    before, after = run.event_from.values, run.event_to.values
    # A step across an event may put the first sample on the other side of the event.
    codes = np.append(before[:1] if before.size else contact, after)
    phases = run.event_phase.values - float(run.phase[0])
    assert (codes[:-1] == before).all()
    durations = np.diff([0.0, *phases, span])
    return {
        "fraction_drive": durations[codes == 1].sum() / span,
        "contact_loss_fraction": durations[codes == 0].sum() / span,
        "fraction_coast": durations[codes == -1].sum() / span,
        "bounces": (before == 1).sum() * math.tau / span,
    }


def load_shares(meshes, forces):
    """Return mesh forces divided by the mean force of all meshes on the same gear.

    Meshes that share no gear with others have the value 1.
    """
    shares = np.ones_like(forces)
    for index, mesh in enumerate(meshes):
        for gear in ("wheel", "pinion"):
            on_same_gear = [getattr(other, gear) == getattr(mesh, gear) for other in meshes]
            if sum(on_same_gear) > 1:
                shares[index] = forces[index] / forces[on_same_gear].mean()
    return shares


def bounds_of_summary(model, run, periods, sample_error):
    """Return bounds (low, high), (meshes,) each, of summary variables as a dict by name.

    The bounds follow from samples and events. Switches of stiffness and contact are known to
    `sample_error` samples.
    """
    meshes, span = max(len(model.mesh_names), 1), math.tau * periods
    names = ("displacement", "dynamic_force", "stiffness", "contact")
    x, force, stiffness, contact = (run[name].values.reshape(-1, meshes) for name in names)
    event_mesh = run.event_mesh.values if "event_mesh" in run else np.zeros(run.sizes["event"])
    runs = [run.isel(event=event_mesh == mesh) for mesh in range(meshes)]
    rows = [variables_of_events(*own, span) for own in zip(runs, contact[0], strict=True)]
    events = {name: np.array([row[name] for row in rows]) for name in rows[0]}
    bounds = {name: (values - ROUNDING, values + ROUNDING) for name, values in events.items()}
    jumps = np.diff(stiffness, axis=0)
    switches = (np.diff(contact, axis=0) != 0) | (np.diff(np.sign(jumps), axis=0, append=0.0) != 0)
    low, high = shares_of_low_stiffness(model, stiffness, contact, periods)
    room = sample_error * (1 + switches.sum(axis=0)) / len(x)
    bounds["fraction_min_stiffness"] = low - room, high + room
    # Between two samples a curve deviates by its second differences, and the force by its usual
    # rise.
    rises = np.abs(np.diff(force, axis=0))
    rise = rises.max(axis=0, where=np.abs(jumps) < 0.05, initial=0.0)
    bend = np.abs(np.diff(x, 2, axis=0)).max(axis=0) / 4.0
    for name, values, room in (("displacement", x, bend), ("dynamic_force", force, 1.2 * rise)):
        # The end of the run is not a sample.
        end = 2.0 * values[-1] - values[-2]
        low, high = values.min(axis=0), values.max(axis=0)
        bounds[f"{name}_max"] = high - ROUNDING, np.maximum(high, end) + room + ROUNDING
        bounds[f"{name}_min"] = np.minimum(low, end) - room - ROUNDING, low + ROUNDING
    room = sample_error * rises.sum(axis=0) / len(force) + ROUNDING
    bounds["mean_force"] = force.mean(axis=0) - room, force.mean(axis=0) + room
    if model.force_ratio_name in run:
        static = np.abs(np.where(model.mean_forces, model.mean_forces, np.nan))
        peak = np.abs(force).max(axis=0)
        high = np.maximum(peak, np.abs(2.0 * force[-1] - force[-2])) + 1.2 * rise
        bounds[model.force_ratio_name] = (peak - ROUNDING) / static, (high + ROUNDING) / static
    if model.mesh_names:
        shares = load_shares(model.meshes, run.mean_force.values)
        bounds["load_sharing"] = shares - ROUNDING, shares + ROUNDING
    else:
        v = run.velocity.values
        end = np.array([2.0 * x[-1, 0] - x[-2, 0], v[-1]])
        room = np.array([4.0 * bend[0], np.abs(np.diff(v)).max()])
        bounds["final_state"] = end - room, end + room
    return bounds


@pytest.mark.parametrize(("name", "method", "options"), CASES)
def test_summary_follows_from_samples_and_events(name, method, options):
    """Recompute each summary variable from dense samples and events, for each model and method."""
    model, tuning, state, periods = MODELS[name]
    recorded = periods - 1
    settings = {"periods": periods, "record_periods": recorded, "initial_state": state}
    settings |= {"method": method, "options": options}
    run = gearlib.simulate(model, tuning, samples_per_period=SAMPLES, **settings)
    assert int(run.status) == 0 and (np.diff(run.event_phase) >= 0.0).all()
    # Long steps go across switches, which samples then show late.
    sample_error = 50 if method in ("rk45", "scipy") and options != SCIPY_WITH_EVENTS else 1
    bounds = bounds_of_summary(model, run, recorded, sample_error)
    # Datasets of models with one mesh lack some columns, which the summary table has.
    table = simulation.run(model, tuning, samples_per_period=1, **settings).summary
    columns = summary.normalize_columns(table, math.tau * recorded, recorded)
    extra = model.extra_summary_variables((), table, math.tau * recorded)
    for variable in bounds.keys() | columns.keys() | extra.keys():
        (low, high), values = bounds[variable], np.ravel(run.get(variable, columns.get(variable)))
        is_inside = (low <= values) & (values <= high) | (np.isnan(low) & np.isnan(values))
        assert is_inside.all(), f"{variable}: {values}, expected {low} to {high}"
