"""A run at constant speed as a run-up whose speed stays, in SI units: for orders of both."""

import json
import math

import xarray as xr

from gearlib.data.provenance import canonical_json

#: What order maps take of a run -> (powers of length, of the mesh frequency; CF units).
_LENGTHS = {
    "displacement": (0, "m"),
    "velocity": (1, "m s-1"),
    "acceleration": (2, "m s-2"),
}


def as_run_up(run):
    """Return a dataset with what order maps take of a run-up, of a run of `gearlib.simulate`.

    Anything else comes back as it is: who takes it tells what it lacks.
    """
    needed = {"mesh_frequency", "static_deflection", "force_scale", "contact", *_LENGTHS}
    if not needed <= set(getattr(run, "variables", ())) or run.displacement.dims[0] != "phase":
        return run
    omega, length, rpm = (
        float(run[name]) for name in ("mesh_frequency", "static_deflection", "speed")
    )
    phase = run.phase.values - float(run.phase[0])
    over = ("time", *run.displacement.dims[1:])
    data: dict = {
        name: (over, run[name].values * (length * omega**power), {"units": units})
        for name, (power, units) in _LENGTHS.items()
    }
    data["dynamic_force"] = over, run.dynamic_force.values * float(run.force_scale), {"units": "N"}
    data |= {"contact": (over, run.contact.values), "phase": ("time", phase)}
    data["speed"] = "time", 0.0 * phase + rpm
    data |= {name: ("event", run[name].values) for name in ("event_from", "event_to")}
    data["event_time"] = "event", (run.event_phase.values - float(run.phase[0])) / omega
    data["event_velocity"] = "event", run.event_velocity.values * (length * omega)
    data["status"] = run.status
    coords = {"time": phase / omega} | {name: run[name].variable for name in over[1:]}
    found = xr.Dataset(data, coords)
    kept = ("references", "model", "gear_pair")
    found.attrs = {name: run.attrs[name] for name in kept if name in run.attrs}
    end = math.tau * json.loads(run.attrs["parameters"])["record_periods"] / omega
    course = {"speed": [[0.0, rpm], [end, rpm]], "load": [[0.0, 1.0]]}
    found.attrs |= {"title": run.attrs["title"], "parameters": canonical_json(course)}
    found.attrs["first_phase"] = float(run.phase[0])
    return found
