"""`orders`: order spectra of mesh force and transmission error over whole mesh periods.

Where the motion is a closed form between its breaks (a `GearPair`), so are its Fourier integrals:
with L = d^2 + (2 beta / nu) d + c / nu^2 on a piece from a to b, integration by parts of L x = r
gives the integral of x exp(-i w tau) from the states at both ends,

    I = (R - [x' e] - (i w + 2 beta / nu) [x e]) / (c / nu^2 - w^2 + 2 i w beta / nu),

with e = exp(-i w tau), R the integral of r e. No step, no sample enters but the states at the ends.
Other models go by the sum over their samples; its error is the difference of every second sample.
"""

import json
import math

import numpy as np
from scipy.linalg import expm

from gearlib import checks
from gearlib.data.result import result_of_many
from gearlib.models.harmonics import Harmonics
from gearlib.models.pair import GearPair
from gearlib.parameters import declared

#: Below, (w nearly the natural frequency without damping) a piece goes by its Taylor series.
_NEAR = 1e-9


def orders(run, *, count=None):
    """Return the order spectrum of the mesh force and of the transmission error of a run.

    Parameters
    ----------
    run : xarray.Dataset
        Of `gearlib.simulate`; its record has to hold whole revolutions, or whole orbits.
    count : int, optional
        Highest mesh order; by default 10, at most a quarter of the samples per period.

    Returns
    -------
    xarray.Dataset
        Over ``order`` (per revolution of the gear whose teeth count, from 0): mesh_order (order
        over teeth), force_amplitude (N, peak; the mean at order 0), force_phase,
        error_amplitude (m) and error_phase (rad; of a cosine of the mesh phase times the mesh
        order), force_amplitude_error and error_amplitude_error, estimates and no bounds: 1e-12 of
        the largest amplitude for rounding or, where a model has no closed form, the difference that
        every second sample makes; mean squares. Of a train over ``mesh`` too.

    Raises
    ------
    ValueError
        If the run could not go on, or has no whole revolutions.
    """
    names = {"phase", "displacement", "dynamic_force", "mesh_frequency"}
    if not names <= set(getattr(run, "variables", ())):
        shown = run.attrs.get("title", type(run).__name__) if hasattr(run, "attrs") else run
        raise checks.refusal("run", shown, "a dataset of gearlib.simulate, of gears that turn")
    if int(run.status):
        raise ValueError(f"run is not allowed: {run.status.attrs['message']}")
    asked = json.loads(run.attrs["parameters"])
    periods, samples = asked["record_periods"], run.phase.size
    teeth = round(float(run.mesh_frequency) * 60.0 / (math.tau * float(run.speed)))
    orbit = int(run.period)
    if periods % teeth and not (orbit and periods % orbit == 0):
        raise ValueError(
            f"record_periods = {periods} is not allowed: it must be a multiple of {teeth}, whole "
            "revolutions of the gear whose teeth count"
            + (f", or of the {orbit} periods of the orbit" if orbit else "")
        )
    most = max(samples // periods // 4, 1)
    count = checks.integer("count", min(10, most) if count is None else count, 1, most)
    harmonics = np.arange(count * periods + 1)
    pair = _pair(run)
    x, force = transmission_error(run), run.dynamic_force.values
    if pair is None:
        found = [_sampled(values, harmonics.size) for values in (force, x)]
        half = [_sampled(values[::2], harmonics.size) for values in (force, x)]
        errors = [np.abs(one - other) for one, other in zip(found, half, strict=True)]
    else:
        found = _exact(pair, run, harmonics / periods, periods)
        errors = [1e-12 * np.abs(one).max() * np.ones(one.shape) for one in found]
    # A period that begins later turns the phases only: they count from the mesh phase 0.
    turn = np.exp(-1j * harmonics / periods * float(run.phase[0]))
    turn = turn.reshape(-1, *[1] * (x.ndim - 1))
    scales = float(run.force_scale), float(run.static_deflection)
    dims = ("order", *run.displacement.dims[1:])
    data = {}
    for name, one, error, scale in zip(("force", "error"), found, errors, scales, strict=True):
        if pair is None:
            one = one * turn
        peak = np.where(harmonics.reshape(turn.shape) > 0, 2.0, 1.0) * scale
        data[f"{name}_amplitude"] = dims, peak * np.abs(one)
        data[f"{name}_phase"] = dims, np.angle(one)
        data[f"{name}_amplitude_error"] = dims, peak * error
    data["mesh_order"] = "order", harmonics / periods
    data["mean_square_force"] = dims[1:], (force**2).mean(axis=0) * scales[0] ** 2
    data["mean_square_error"] = dims[1:], (x**2).mean(axis=0) * scales[1] ** 2
    for name in ("tuning", "speed", "mesh_frequency", "period"):
        data[name] = run[name].values
    coords = {"order": harmonics * teeth / periods}
    coords |= {name: run[name].values for name in dims[1:]}
    found = result_of_many("Order spectrum of a gear mesh", data, coords, "Fourier integrals")
    found["order"].attrs["long_name"] = "order, waves per revolution of the gear whose teeth count"
    kept = ("references", "gear_pair", "parameters")
    found.attrs |= {name: run.attrs[name] for name in kept if name in run.attrs}
    return found


def transmission_error(run):
    """Return the transmission error at the samples, static deflections.

    Displacements of models with deviations of the flanks are those of the flanks.
    """
    x = run.displacement.values
    model = json.loads(run.attrs.get("gear_pair") or run.attrs["model"])
    given = model.get("deviation") if "profile" in model else None
    if not given:
        return x
    phase, scale = run.phase.values, 1.0 / run.static_deflection.item()
    waves = Harmonics(given["cosines"], given["sines"]).table(scale)
    return x - sum(c * np.cos(k * phase) + s * np.sin(k * phase) for k, c, s in waves)


def _pair(run):
    """Return the `GearPair` of a run by an exact method, None of all others."""
    values = json.loads(run.attrs.get("gear_pair", "{}"))
    if values.keys() != declared(GearPair).keys() or "method exact" not in run.attrs["source"]:
        return None
    return GearPair(**{name: float(x) if x == "inf" else x for name, x in values.items()})


def _sampled(values, count):
    """Return the first `count` Fourier coefficients of samples, along the first axis."""
    return np.fft.rfft(values, axis=0)[:count] / len(values)


def _exact(pair, run, harmonics, periods):
    """Return the coefficients of force and displacement, both over `harmonics` of the phase."""
    breaks = _breaks(pair, run, periods)
    force = np.zeros(harmonics.size, complex)
    displacement = np.zeros(harmonics.size, complex)
    for (start, x, v, contact, level), (end, x_end, v_end, *_) in zip(
        breaks, breaks[1:], strict=False
    ):
        damping, stiffness, load = _law(pair, run, contact, level)
        # From its own beginning: far from phase 0 the products would round.
        length = end - start
        wave = np.exp(-1j * harmonics * length)
        with np.errstate(divide="ignore", invalid="ignore"):
            unit = np.where(harmonics > 0.0, (1.0 - wave) / (1j * harmonics), length)
            below = stiffness - harmonics**2 + 1j * harmonics * damping
            ends = v_end * wave - v + (1j * harmonics + damping) * (x_end * wave - x)
            integral = (load * unit - ends) / below
        size = stiffness + harmonics**2 + harmonics * damping
        for i in np.flatnonzero(np.abs(below) <= _NEAR ** (1 / 3) * size):
            integral[i] = _series(damping, stiffness, load, (x, v), harmonics[i], length)
        turn = np.exp(-1j * harmonics * start)
        displacement += turn * integral
        if contact:
            gap = pair.backlash_ratio if contact < 0 else 0.0
            force += turn * level * (integral + gap * unit)
    span = math.tau * periods
    return force / span, displacement / span


def _law(pair, run, contact, level):
    """Return damping, stiffness and load of x'' + d x' + c x = r between two breaks."""
    nu = float(run.tuning)
    if not contact:
        return 2.0 * pair.backlash_damping_ratio / nu, 0.0, 1.0 / nu**2
    gap = pair.backlash_ratio if contact < 0 else 0.0
    stiffness = level / nu**2
    return 2.0 * pair.damping_ratio / nu, stiffness, 1.0 / nu**2 - stiffness * gap


def _generator(damping, stiffness, load, order=0.0):
    """Return the matrix of (x, x', 1) exp(-i order tau)."""
    matrix = np.array([[0.0, 1.0, 0.0], [-stiffness, -damping, load], [0.0, 0.0, 0.0]])
    return matrix - 1j * order * np.eye(3) if order else matrix


def _series(damping, stiffness, load, state, order, length):
    """Return the integral over a piece where the denominator vanishes, as a matrix exponential."""
    whole = np.zeros((4, 4), complex)
    whole[:3, :3] = _generator(damping, stiffness, load, order)
    whole[:3, 3] = *state, 1.0
    return expm(whole * length)[0, 3]


def _breaks(pair, run, periods):
    """Return (phase, x, x', contact, stiffness) after each event, each switch and at both ends."""
    phase, first = run.phase.values, float(run.phase[0])
    last = first + math.tau * periods
    half = math.pi * (pair.contact_ratio - 1.0)
    high = pair.max_stiffness / pair.mean_stiffness
    edges = (first + math.tau * np.arange(periods))[:, None] + [half, math.tau - half]
    steady = pair.stiffness_ratio == 1.0 or not 0.0 < half < math.pi
    switches = [] if steady else edges.ravel().tolist()

    def level(at):
        low = not steady and half < at % math.tau < math.tau - half
        return high * (pair.stiffness_ratio if low else 1.0)

    names = ("event_phase", "event_from", "event_to", "event_velocity")
    events = list(zip(*(run[name].values for name in names), strict=True))
    marks = sorted([(at, 1, None) for at in switches] + [(e[0], 0, e) for e in events])
    contact = int(run.contact[0])
    middle = (marks[0][0] if marks else last) + first
    found = [
        (first, float(run.displacement[0]), float(run.velocity[0]), contact, level(middle / 2))
    ]
    for i, (at, _, event) in enumerate(marks):
        until = marks[i + 1][0] if i + 1 < len(marks) else last
        now = level((at + until) / 2.0)
        if event is not None:
            _, before, contact, v = event
            contact = int(contact)
            x = -pair.backlash_ratio if -1 in (contact, int(before)) else 0.0
            found.append((at, x, float(v), contact, now))
            continue
        # From the nearest state that is known: the last break or the last sample.
        start, x, v, _, before = found[-1]
        k = int(np.searchsorted(phase, at, "right")) - 1
        if phase[k] > start:
            start, x, v = phase[k], float(run.displacement[k]), float(run.velocity[k])
        matrix = _generator(*_law(pair, run, contact, before)) * (at - start)
        x, v, _ = expm(matrix) @ [x, v, 1.0]
        found.append((at, x, v, contact, now))
    return [*found, (last, *map(float, run.final_state.values), contact, 0.0)]
