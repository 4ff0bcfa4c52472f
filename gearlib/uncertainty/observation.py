"""An observation: measured values, the function that predicts them, and quantities of orbits."""

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from scipy.optimize import brentq

from gearlib.analysis.orbits.continuation import continue_orbit
from gearlib.analysis.orbits.jumps import main_resonance
from gearlib.analysis.orbits.shooting import NoOrbit, periodic_orbit
from gearlib.analysis.orbits.special_points import FOLD
from gearlib.analysis.orbits.tracing import ContinuationFailed
from gearlib.data import summary
from gearlib.data.status import OK
from gearlib.engines import orbit as orbit_columns
from gearlib.runs.simulation import run
from gearlib.runs.sweeping import sweep
from gearlib.uncertainty.design_quantities import RESONANCE_NAMES

#: Residual of a speed that the model does not have.
MISSING_RESIDUAL = 100.0
#: A step from one measured value to the next that is a jump, as a share of the value.
JUMP_SHARE = 0.15
START_REFUSAL = (
    "model is not allowed: a motion with its values, where the fit starts, could not be run to the "
    "end"
)
#: Values of an orbit that can be compared.
STATISTICS = (
    "displacement_max",
    "displacement_min",
    "dynamic_force_max",
    "dynamic_force_min",
    "fraction_normal",
    "fraction_backlash",
    "fraction_inverse",
)
#: Mean force of a mesh over that of all meshes of its central gear; mesh orders of displacements.
SHARING, ORDER = "load_sharing", "order_amplitude"
#: Samples in a mesh period of which mesh orders are sums.
SAMPLES = 64
#: Shares of the tunings of the highest and the lowest jump between which a branch is followed.
_ABOVE, _BELOW = 1.5, 0.7
#: Shares of a measured onset of contact loss at which that of a model is searched.
_ONSET_SHARES = np.linspace(0.7, 1.3, 61)
#: Mesh periods at each of these speeds.
SETTLING = {"periods": 200, "record_periods": 1}


class Channel(NamedTuple):
    """Measured values of one sensor."""

    name: str
    values: np.ndarray
    deviations: np.ndarray  #: standard deviations; a common scale where the noise is unknown
    noise_known: bool
    unknown_gain: bool = False
    unknown_offset: bool = False
    #: Numbers of the values in the order in which they were measured, shape (sequences, steps).
    sequences: Any = None
    joined: bool = False  #: whether its deviations are weighted with those of the channel before it

    @property
    def eliminated(self) -> int:
        """Return how many numbers of the sensor are taken from the data."""
        return self.unknown_gain + self.unknown_offset

    def sensed(self, predicted: np.ndarray) -> tuple:
        """Return predicted values as the sensor shows them, and its gain.

        An unknown gain and offset enter linearly: those that suit the measured values best are
        eliminated (variable projection, Golub and Pereyra 1973).
        """
        columns = [predicted] * self.unknown_gain + [np.ones(predicted.size)] * self.unknown_offset
        if not columns:
            return predicted, 1.0
        constant = 0.0 if self.unknown_gain else predicted
        matrix = np.stack(columns, axis=1) / self.deviations[:, None]
        sizes = np.linalg.norm(matrix, axis=0)
        sizes[sizes == 0.0] = 1.0
        wanted = (self.values - constant) / self.deviations
        best = np.linalg.lstsq(matrix / sizes, wanted, rcond=None)[0] / sizes
        gain = float(best[0]) if self.unknown_gain else 1.0
        return constant + np.stack(columns, axis=1) @ best, gain


class Observation(NamedTuple):
    """A part of a measured set and the function that predicts it."""

    kind: str
    channels: list
    #: model -> (values of each channel, largest way into the backlash, m)
    predict: Callable
    #: values of each channel as the sensors show them -> curves to be drawn
    draw: Callable
    warning: str = ""

    def sensed(self, model: Any) -> list | None:
        """Return what the sensors show of a model, None where a motion could not go on."""
        try:
            predicted = self.predict(model)[0]
        except (NoOrbit, ContinuationFailed, ArithmeticError, ValueError):
            return None
        pairs = zip(self.channels, predicted, strict=True)
        return [channel.sensed(values)[0] for channel, values in pairs]

    def residuals(self, model: Any) -> np.ndarray | None:
        """Return predicted less measured values over their deviations, None as `sensed`."""
        sensed = self.sensed(model)
        if sensed is None:
            return None
        pairs = zip(self.channels, sensed, strict=True)
        rows = [(values - channel.values) / channel.deviations for channel, values in pairs]
        return np.nan_to_num(np.concatenate(rows), nan=MISSING_RESIDUAL)


class Curve(NamedTuple):
    """A measured quantity over the speed, or over the mesh phase, and what the fit makes of it."""

    name: str
    units: str
    over: str  #: speed (rpm) or phase (mesh periods)
    at: np.ndarray
    heights: tuple  #: (measured, fitted) as the sensor sees them; NaN where left out
    falls: np.ndarray  #: whether the speed falls


class Place(NamedTuple):
    """A measured speed, rpm."""

    name: str
    measured: float
    deviation: float
    fitted: float


def at_speed(model: Any, speed: float, guess: Any, samples: int = 1) -> dict:
    """Return values of the orbit near a guess at a speed in rpm: name -> values of the meshes, SI.

    `ORDER` has complex amplitudes, shape (orders, meshes); the displacement is twice the real part
    of their sum.
    """
    orbit = periodic_orbit(model, speed / float(model.speed(1.0)), guess=guess)
    n = orbit.period
    settings = {"periods": n, "record_periods": n, "initial_state": tuple(orbit.state)}
    done = run(model, orbit.tuning, samples, **settings)
    if done.status:
        raise NoOrbit(f"the motion at {speed:g} rpm could not go on")
    table = summary.variables(model, (), done.summary, done.final, np.array([n, OK]), n)
    scales = {"displacement": model.static_deflection, "dynamic": model.load}
    values = {
        name: np.atleast_1d(numbers) * scales.get(name.partition("_")[0], 1.0)
        for name, (_, numbers) in table.items()
    }
    meshes = max(len(model.mesh_names), 1)
    of_meshes = done.samples[:, : meshes * orbit_columns.SAMPLE_COLUMNS]
    x = (
        of_meshes[:, orbit_columns.SAMPLE_X :: orbit_columns.SAMPLE_COLUMNS]
        * model.static_deflection
    )
    return values | {ORDER: np.fft.rfft(x, axis=0, norm="forward")[::n]}


def pick(values: dict, quantity: str, mesh: int) -> float:
    """Return one value of an orbit: of `STATISTICS`, `SHARING`, or `ORDER` with its number."""
    name, _, number = quantity.rpartition("_")
    if name == ORDER:
        return 2.0 * abs(values[ORDER][int(number), mesh])
    return float(values[quantity][mesh])


def special_speeds(model: Any, measured: dict) -> dict:
    """Return the speeds of jumps and onset that a model has, rpm, next to measured ones.

    Jumps are folds of the branch of orbits, the onset is a grazing. With one degree of freedom
    they are those of the main resonance; with more coordinates the branch is followed.
    """
    rate = float(model.speed(1.0))
    if model.size == 2 and model.repeats == 1:
        resonance = main_resonance(model, [RESONANCE_NAMES[name] for name in measured])
        if resonance.lost:
            raise ContinuationFailed
        tunings = {name: getattr(resonance, RESONANCE_NAMES[name]) for name in measured}
        return {name: rate * tuning for name, tuning in tunings.items() if np.isfinite(tuning)}
    jumps = {name: speed for name, speed in measured.items() if name.startswith("jump")}
    speeds = fold_speeds(model, jumps) if jumps else {}
    if "onset_of_contact_loss" in measured:
        onset = _onset(model, measured["onset_of_contact_loss"])
        speeds |= {} if math.isnan(onset) else {"onset_of_contact_loss": onset}
    return speeds


def fold_speeds(model: Any, measured: dict) -> dict:
    """Return name of a jump -> speed of the fold next to what was measured, rpm."""
    rate, speeds = float(model.speed(1.0)), {}
    orbit = periodic_orbit(model, _ABOVE * max(measured.values()) / rate)
    branch = continue_orbit(orbit, to=_BELOW * min(measured.values()) / rate)
    folds = branch.tuning.values[branch.label.values == FOLD] * rate
    # From above a resonance is entered at its lower fold and left at its upper one.
    for name, speed in measured.items():
        candidates = folds[: 2 * (folds.size // 2)][name != "jump_down" :: 2]
        if candidates.size:
            speeds[name] = float(candidates[np.abs(candidates - speed).argmin()])
    return speeds


def _onset(model: Any, measured: float) -> float:
    """Return the speed of the onset of contact loss next to what was measured, or NaN."""
    speeds = measured * _ONSET_SHARES
    curve = sweep(model, speeds / float(model.speed(1.0)), direction="up", **SETTLING)
    least = curve.displacement_min.values.reshape(speeds.size, -1).min(axis=1)
    steps = np.flatnonzero((least[1:] > 0.0) != (least[:-1] > 0.0))
    if not steps.size:
        return math.nan
    i = steps[np.abs(speeds[steps] - measured).argmin()]
    state = curve.final_state.values[i]

    def distance(speed: float) -> float:
        return at_speed(model, speed, state)["displacement_min"].min()

    return brentq(distance, speeds[i], speeds[i + 1], xtol=1e-12 * measured, rtol=1e-14)
